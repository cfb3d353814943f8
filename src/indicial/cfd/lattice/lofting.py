"""Points and normals of a lifting surface between its stations, and where panels are cut."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from indicial.cfd.shapes import LiftingSurface, WingSection
from indicial.conventions import Array, Index
from indicial.errors import InputError

Spacing = Literal["cosine", "equal"]


def span_edges(surface: LiftingSurface, count: int, spacing: Spacing) -> Array:
    """Cuts along the listed stations, as lengths from the first one seen from behind [m], shape (count + 1,).

    Cosine spacing is dense at free ends: at the tip only where the root is joined to its mirror image. The
    cut nearest to each station is moved onto it.
    """
    along = lengths(surface)
    if count < len(along) - 1:
        raise InputError(f"surface {surface.name!r} needs at least {len(along) - 1} panels across, not {count}")
    u = np.linspace(0.0, 1.0, count + 1)
    if spacing == "cosine":
        u = np.sin(0.5 * np.pi * u) if joined(surface) else 0.5 * (1.0 - np.cos(np.pi * u))
    elif spacing != "equal":
        raise InputError(f"spacing is {spacing!r}, must be 'cosine' or 'equal'")
    edges: Array = u * along[-1]
    for n, station in enumerate(along[1:-1], start=1):
        # leave a cut for every station to come
        first, last = n, count - (len(along) - 1 - n)
        edges[first + int(np.argmin(np.abs(edges[first : last + 1] - station)))] = station
    if np.any(np.diff(edges) <= 0.0):
        raise InputError(f"surface {surface.name!r}: {count} panels across do not resolve its stations; take more")
    return edges


def span_middles(surface: LiftingSurface, edges: Array, spacing: Spacing) -> Array:
    """Where the boundary condition and the wind on the filaments are taken between cuts [m], shape (count,).

    In the middle, of the angle whose cosine the spacing is: with it the lift of a whole wing and its induced drag
    converge as fast as a quadrature of Chebyshev's does (Lan, J. Aircraft 11, 1974).
    """
    if spacing == "equal":
        return np.asarray(0.5 * (edges[:-1] + edges[1:]))
    whole = edges[-1]
    if joined(surface):
        angle = np.arcsin(edges / whole)
        return np.asarray(whole * np.sin(0.5 * (angle[:-1] + angle[1:])))
    angle = np.arccos(np.clip(1.0 - 2.0 * edges / whole, -1.0, 1.0))
    return np.asarray(0.5 * whole * (1.0 - np.cos(0.5 * (angle[:-1] + angle[1:]))))


def joined(surface: LiftingSurface) -> bool:
    """Whether the root is on the symmetry plane, so that both halves are one sheet."""
    return surface.symmetric and surface.stations[0].y == 0.0


def lengths(surface: LiftingSurface) -> Array:
    """Of the stations from the first one, along the surface seen from behind [m], shape (n,)."""
    points = np.array([[s.y, s.z] for s in surface.stations])
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])


@dataclass(frozen=True)
class Loft:
    """Sections of a surface at places along its span.

    Parameters
    ----------
    quarter_chord, up : ndarray
        The section's quarter chord [m], and the unit vector across chord and span, shape (n, 3).
    chord, twist, fraction : ndarray
        [m], [rad], and weight of the outer of the two `stations`, shape (n,).
    stations : ndarray
        Index of the inner one of the two stations between which each section lies, shape (n,).
    surface : LiftingSurface
    camber : bool
        Whether the mean surface has the sections' camber; if not, it is that of the chords.
    """

    quarter_chord: Array
    up: Array
    chord: Array
    twist: Array
    fraction: Array
    stations: Index
    surface: LiftingSurface
    camber: bool = True

    @classmethod
    def at(cls, surface: LiftingSurface, places: Array, camber: bool = True) -> Loft:
        """The sections at lengths from the first station [m], shape (n,)."""
        along = lengths(surface)
        inner = np.clip(np.searchsorted(along, places, side="right") - 1, 0, len(along) - 2)
        fraction = (places - along[inner]) / (along[inner + 1] - along[inner])
        s = surface.stations

        def between(values: Array) -> Array:
            weight = fraction.reshape(-1, *(1,) * (values.ndim - 1))
            mixed: Array = (1.0 - weight) * values[inner] + weight * values[inner + 1]
            return mixed

        return cls(
            between(np.array([one.quarter_chord for one in s])),
            _up(surface, along, inner, places),
            between(np.array([one.chord for one in s])),
            between(np.array([one.twist for one in s])),
            fraction,
            inner,
            surface,
            camber,
        )

    def sections(self, n: int) -> tuple[WingSection, WingSection, float]:
        """Sections of the stations on both sides of place n, and the weight of the outer one."""
        s, inner = self.surface.stations, int(self.stations[n])
        return s[inner].section, s[inner + 1].section, float(self.fraction[n])

    def _mean_lines(self, u: Array) -> tuple[Array, Array]:
        """Camber and slope at fractions u of the chord, mixed between the stations' sections, shape (len(u), n)."""
        if not self.camber:
            return np.zeros((len(u), len(self.chord))), np.zeros((len(u), len(self.chord)))
        lines = [station.section.mean_line(u) for station in self.surface.stations]
        camber, slope = (np.stack([line[part] for line in lines], axis=1) for part in (0, 1))
        inner, outer = self.stations, self.stations + 1
        weight = self.fraction
        return (
            (1.0 - weight) * camber[:, inner] + weight * camber[:, outer],
            (1.0 - weight) * slope[:, inner] + weight * slope[:, outer],
        )

    def points(self, u: Array) -> Array:
        """Points of the mean surface at fractions u of the chord, shape (len(u), n, 3)."""
        camber, _ = self._mean_lines(u)
        along, across = self.axes()
        place = ((u - 0.25)[:, None] * self.chord)[..., None] * along + (camber * self.chord)[..., None] * across
        points: Array = self.quarter_chord + place
        return points

    def tangents(self, u: Array) -> Array:
        """Chordwise tangents of the mean surface (not of unit length), shape (len(u), n, 3)."""
        _, slope = self._mean_lines(u)
        along, across = self.axes()
        tangents: Array = along + slope[..., None] * across
        return tangents

    def axes(self) -> tuple[Array, Array]:
        """Unit vectors along the twisted chord (aft) and across it (up), shape (n, 3)."""
        sine, cosine = np.sin(self.twist)[:, None], np.cos(self.twist)[:, None]
        aft = np.array([1.0, 0.0, 0.0])
        return cosine * aft - sine * self.up, sine * aft + cosine * self.up


def _up(surface: LiftingSurface, along: Array, inner: Index, places: Array) -> Array:
    """x cross span, and the mean of both sides at a station."""
    points = np.array([[s.y, s.z] for s in surface.stations])
    span = np.diff(points, axis=0) / np.diff(along)[:, None]
    ups = np.stack([np.zeros(len(span)), -span[:, 1], span[:, 0]], axis=1)
    # the neighbour of the first piece of a joined surface is its mirror image
    before = ups[0] * [1.0, -1.0, 1.0] if joined(surface) else ups[0]
    at_station = np.stack([before, *ups]) + np.stack([*ups, ups[-1]])
    at_station /= np.linalg.norm(at_station, axis=1)[:, None]
    up: Array = ups[inner]
    for n, station in enumerate(along):
        up[np.abs(places - station) <= 1e-12 * along[-1]] = at_station[n]
    return up


def chord_edges(count: int, spacing: Spacing) -> Array:
    """Cuts across the chord as fractions of it, shape (count + 1,)."""
    if not (isinstance(count, int | np.integer) and count >= 1):
        raise InputError(f"{count} panels along the chord: must be a whole number of at least 1")
    u = np.linspace(0.0, 1.0, count + 1)
    if spacing == "equal":
        return u
    if spacing != "cosine":
        raise InputError(f"spacing is {spacing!r}, must be 'cosine' or 'equal'")
    return np.array([0.5 * (1.0 - math.cos(math.pi * value)) for value in u])
