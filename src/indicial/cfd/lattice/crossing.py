"""Sheets of panels that cut one another, or lie on one another, are no set of lifting surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations, permutations

import numpy as np

from indicial.cfd.lattice.sheets import Sheet
from indicial.conventions import Array
from indicial.errors import InputError

_INSIDE = 1e-6
"""How far inside both, as a fraction of them, a filament and a panel must meet: touching edges are allowed."""


def refuse_crossing(sheets: Sequence[Sheet]) -> None:
    """Raise an InputError that names two sheets whose panels cut or cover one another.

    A surface may end on another one, as a fin does on a fuselage's or a tailplane's middle.
    """
    for one, other in permutations(sheets, 2):
        if _apart(one, other):
            continue
        at = _cut(one.edges, other.edges)
        if at is not None:
            place = ", ".join(f"{value:.4g}" for value in at)
            raise InputError(f"surfaces {one.name!r} and {other.name!r} cross one another at x, y, z = {place} m")
    for one, other in combinations(sheets, 2):
        gaps = np.linalg.norm(one.collocation.reshape(-1, 1, 3) - other.collocation.reshape(1, -1, 3), axis=-1)
        if np.min(gaps) < 1e-6 * float(np.min(one.strips.chord)):
            raise InputError(f"surfaces {one.name!r} and {other.name!r} lie on one another")


def _apart(one: Sheet, other: Sheet) -> bool:
    """Whether the boxes round two sheets have no point in common."""
    a, b = one.edges.reshape(-1, 3), other.edges.reshape(-1, 3)
    return bool(np.any(np.min(a, axis=0) > np.max(b, axis=0)) or np.any(np.max(a, axis=0) < np.min(b, axis=0)))


def _cut(edges: Array, panels: Array) -> Array | None:
    """A point where a side of one grid of panels passes through a panel of another, by Moller and Trumbore's test."""
    # sides of two panels too: a corner that lies in the other panel is no end of the surface
    across = [(edges[:, :-n], edges[:, n:]) for n in (1, 2)]
    along = [(edges[:-n], edges[n:]) for n in (1, 2)]
    start, end = (np.concatenate([pair[k].reshape(-1, 3) for pair in across + along]) for k in (0, 1))
    a, b, c, d = (part.reshape(-1, 3) for part in (panels[:-1, :-1], panels[:-1, 1:], panels[1:, 1:], panels[1:, :-1]))
    for corner, first, second in ((a, b - a, c - a), (a, c - a, d - a)):
        way = (end - start)[:, None]
        normal = np.cross(way, second)
        volume = np.sum(first * normal, axis=-1)
        size = np.linalg.norm(way, axis=-1) * np.linalg.norm(np.cross(first, second), axis=-1)
        crossing = np.abs(volume) > _INSIDE * size
        scale = np.where(crossing, volume, 1.0)
        offset = start[:, None] - corner
        u = np.sum(offset * normal, axis=-1) / scale
        turned = np.cross(offset, first)
        v = np.sum(way * turned, axis=-1) / scale
        t = np.sum(second * turned, axis=-1) / scale
        low, high = _INSIDE, 1.0 - _INSIDE
        hit = crossing & (u > low) & (v > low) & (u + v < high) & (t > low) & (t < high)
        if np.any(hit):
            n, m = np.argwhere(hit)[0]
            return np.asarray(start[n] + t[n, m] * (end - start)[n])
    return None
