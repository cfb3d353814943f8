"""Where the grid planes of a body mesh stand: along the axis, out from the body, round it.

All distributions are smooth functions of the fraction of cells counted, so that meshes of different resolution
belong to one family. Lengths are in calibres.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from indicial.cfd.mesh.geometry import Array
from indicial.cfd.mesh.structured import geometric, two_sided


@dataclass(frozen=True)
class Anchor:
    """A station x that the mesh must have, the step wanted there, and the largest one up to the next anchor."""

    x: float
    step: float
    largest: float


def axial_stations(anchors: Sequence[Anchor], factor: float, growth: float = 0.3) -> tuple[Array, list[int]]:
    """Stations through all anchors, and the indices of the anchors.

    At factor 1 the step at x is the least of `largest` and of ``step + growth |x - x_a|`` over the anchors; there are
    `factor` times as many steps between any two anchors.
    """
    stations, at = [np.array([anchors[0].x])], [0]
    for left, right in pairwise(anchors):
        x = np.linspace(left.x, right.x, 401)
        step = np.full(x.size, left.largest)
        for anchor in anchors:
            step = np.minimum(step, anchor.step + growth * np.abs(x - anchor.x))
        count = np.concatenate([[0.0], np.cumsum(0.5 * (1.0 / step[1:] + 1.0 / step[:-1]) * np.diff(x))])
        n = max(1, round(factor * max(1, round(count[-1]))))
        inner = np.interp(np.linspace(0.0, count[-1], n + 1), count, x)
        inner[-1] = right.x
        stations.append(inner[1:])
        at.append(at[-1] + n)
    return np.concatenate(stations), at


def plain_levels(inner: Array, outer: Array, n: int) -> Array:
    """Radii (ni, n + 1) from `inner` to `outer`, finer towards the body."""
    fractions = two_sided(0.6 / n, 1.5 / n, n)
    return inner[:, None] + (outer - inner)[:, None] * fractions


def tip_levels(inner: Array, tip: Array, outer: Array, n_span: int, n_outer: int) -> Array:
    """Radii (ni, n_span + n_outer + 1) from `inner` through `tip` to `outer`, finer towards body and tip."""
    span = two_sided(0.75 / n_span, 0.75 / n_span, n_span)
    levels = np.empty((inner.size, n_span + n_outer + 1))
    levels[:, : n_span + 1] = inner[:, None] + (tip - inner)[:, None] * span
    levels[:, n_span] = tip
    for i in range(inner.size):
        first = min((tip[i] - inner[i]) * (1.0 - span[-2]), (outer[i] - tip[i]) / n_outer)
        levels[i, n_span:] = tip[i] + geometric(first, outer[i] - tip[i], n_outer)
    return levels


def wide_levels(inner: Array, outer: Array, first: float, n: int) -> Array:
    """Radii (ni, n + 1) from `inner` to `outer`, steps growing by a constant ratio from `first`."""
    return np.stack([a + geometric(min(first, (b - a) / n), b - a, n) for a, b in zip(inner, outer, strict=True)])


def smooth_step(x: Array, start: float, end: float) -> Array:
    """0 up to `start`, 1 from `end`, a smooth cubic between."""
    u = np.clip((x - start) / (end - start), 0.0, 1.0)
    return u * u * (3.0 - 2.0 * u)


def azimuthal_fractions(n: int, fin_at_start: bool, fin_at_end: bool) -> Array:
    """`n` + 1 fractions of a sector, finer towards the fins that bound it."""
    ratio = 0.7
    if fin_at_start and fin_at_end:
        return two_sided(ratio / n, ratio / n, n)
    if fin_at_start or fin_at_end:
        half = 2.0 * two_sided(ratio / (2 * n), ratio / (2 * n), 2 * n)[: n + 1]
        half[-1] = 1.0
        return half if fin_at_start else (1.0 - half[::-1])
    return np.linspace(0.0, 1.0, n + 1)
