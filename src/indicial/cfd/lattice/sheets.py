"""One surface in one piece, cut into panels, and its strips."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from indicial.cfd.lattice.lofting import Loft, Spacing, joined, span_middles
from indicial.cfd.shapes import LiftingSurface, WingSection
from indicial.conventions import Array

_MIRROR = np.array([1.0, -1.0, 1.0])


@dataclass(frozen=True)
class Strips:
    """What a section model needs to know of each chordwise row of panels, n in all, from left to right.

    Parameters
    ----------
    surface : tuple of str
    chord, width, area : ndarray
        [m], [m], [m^2], shape (n,). The width is measured across the flow, along the surface.
    quarter_chord, three_quarter_chord : ndarray
        Points [m], shape (n, 3).
    aft, up, span : ndarray
        Unit vectors along the twisted chord, across chord and span, and along the span (to the right), shape (n, 3).
    sections : tuple
        (inner section, outer section, weight of the outer one) of each strip.
    """

    surface: tuple[str, ...]
    chord: Array
    width: Array
    area: Array
    quarter_chord: Array
    three_quarter_chord: Array
    aft: Array
    up: Array
    span: Array
    sections: tuple[tuple[WingSection, WingSection, float], ...]

    def __len__(self) -> int:
        return len(self.chord)


@dataclass(frozen=True)
class Sheet:
    """One surface in one piece: rows from the leading edge, columns from left to right.

    Parameters
    ----------
    name : str
    nodes : ndarray
        Corners of the bound rings (rows + 1, columns + 1, 3); the last row is the trailing edge.
    edges : ndarray
        Corners of the panels, for pictures and areas, same shape.
    collocation, normal : ndarray
        Shape (rows, columns, 3).
    front : ndarray
        Points on the front sides of the rings where their wind is taken, same shape.
    strips : Strips
    """

    name: str
    nodes: Array
    edges: Array
    collocation: Array
    normal: Array
    front: Array
    strips: Strips

    @property
    def last_chord(self) -> Array:
        """Length of the last panels along the cuts [m], shape (columns + 1,)."""
        return np.asarray(np.linalg.norm(self.edges[-1] - self.edges[-2], axis=-1))

    @property
    def rows(self) -> int:
        """Panels along the chord."""
        return len(self.collocation)

    @property
    def columns(self) -> int:
        """Panels across."""
        return int(self.collocation.shape[1])


def sheets_of(surface: LiftingSurface, u: Array, places: Array, spacing: Spacing, camber: bool) -> list[Sheet]:
    """One sheet of a surface cut at fractions u of the chord and places across [m]; two if a gap parts its halves."""
    right = _sheet(surface, u, places, spacing, camber)
    if not surface.symmetric:
        return [right]
    left = _mirrored(right)
    return [_side_by_side(left, right)] if joined(surface) else [left, right]


def _sheet(surface: LiftingSurface, u: Array, places: Array, spacing: Spacing, camber: bool) -> Sheet:
    """The stations as they are listed."""
    middles_at = span_middles(surface, places, spacing)
    cuts, middles = Loft.at(surface, places, camber), Loft.at(surface, middles_at, camber)
    steps = np.diff(u)
    nodes = cuts.points(np.append(u[:-1] + 0.25 * steps, 1.0))
    share = ((middles_at - places[:-1]) / np.diff(places))[:, None]
    front = (1.0 - share) * nodes[:-1, :-1] + share * nodes[:-1, 1:]
    control = u[:-1] + 0.75 * steps
    between = cuts.points(control)
    across = between[:, 1:] - between[:, :-1]
    normal = np.cross(middles.tangents(control), across)
    normal /= np.linalg.norm(normal, axis=-1)[..., None]
    edges = cuts.points(u)
    diagonals = np.cross(edges[1:, 1:] - edges[:-1, :-1], edges[:-1, 1:] - edges[1:, :-1])
    width = np.diff(places)
    aft, up = middles.axes()
    strips = Strips(
        surface=(surface.name,) * len(width),
        chord=middles.chord,
        width=width,
        area=0.5 * np.sum(np.linalg.norm(diagonals, axis=-1), axis=0),
        quarter_chord=middles.quarter_chord,
        three_quarter_chord=middles.quarter_chord + 0.5 * middles.chord[:, None] * aft,
        aft=aft,
        up=up,
        span=np.cross(up, aft),
        sections=tuple(middles.sections(n) for n in range(len(width))),
    )
    return Sheet(surface.name, nodes, edges, middles.points(control), normal, front, strips)


def _mirrored(sheet: Sheet) -> Sheet:
    """Behind the plane y = 0, from left to right again."""
    s = sheet.strips

    def turned(values: Array) -> Array:
        return np.asarray(values[:, ::-1] * _MIRROR)

    def flipped(values: Array) -> Array:
        return np.asarray(values[::-1] * _MIRROR)

    strips = Strips(
        surface=s.surface,
        chord=s.chord[::-1],
        width=s.width[::-1],
        area=s.area[::-1],
        quarter_chord=flipped(s.quarter_chord),
        three_quarter_chord=flipped(s.three_quarter_chord),
        aft=flipped(s.aft),
        up=flipped(s.up),
        span=-flipped(s.span),
        sections=s.sections[::-1],
    )
    return Sheet(
        sheet.name,
        turned(sheet.nodes),
        turned(sheet.edges),
        turned(sheet.collocation),
        turned(sheet.normal),
        turned(sheet.front),
        strips,
    )


def _side_by_side(left: Sheet, right: Sheet) -> Sheet:
    """Two halves that share their root."""

    def both(a: Array, b: Array, axis: int = 1) -> Array:
        return np.concatenate([a, b], axis=axis)

    one, two = left.strips, right.strips
    vectors = ("chord", "width", "area", "quarter_chord", "three_quarter_chord", "aft", "up", "span")
    strips = Strips(
        surface=one.surface + two.surface,
        **{name: both(getattr(one, name), getattr(two, name), 0) for name in vectors},
        sections=one.sections + two.sections,
    )
    return Sheet(
        left.name,
        both(left.nodes, right.nodes[:, 1:]),
        both(left.edges, right.edges[:, 1:]),
        both(left.collocation, right.collocation),
        both(left.normal, right.normal),
        both(left.front, right.front),
        strips,
    )
