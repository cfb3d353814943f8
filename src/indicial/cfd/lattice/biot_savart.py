r"""Velocities induced by straight vortex filaments.

From a filament of strength gamma between points at r1 and r2 from where the velocity is wanted (Katz and Plotkin,
Low-Speed Aerodynamics, 2nd ed., section 2.12, with the cosines written out):

    v = gamma/(4 pi) (r1 x r2) (|r1| + |r2|) / ( |r1| |r2| (|r1| |r2| + r1.r2) ),

and from one that starts at a and runs on to infinity along d, with r from a to where it is wanted:
``v = gamma/(4 pi) (d x r) / (|r| (|r| - d.r))``. Near a filament, at distance h, the denominators are
``|r2 - r1|^2 h^2/2`` and ``h^2/2``; there they may not fall below what they are on the edge of its core, within which
the air turns like a solid (Rankine's vortex), and outside of which nothing changes. On its own line a filament induces
nothing. Loops run over points in lanes, so that they are vectorised, and add in one order whatever the number of
threads. Sheets are gone through row by row, with the distances of the points from the nodes of two rows at hand: a
square root for each node, not two for each filament.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit, prange

from indicial.cfd.flow.compiled import KERNEL

LANES = 128
_PER_4PI = 1.0 / (4.0 * math.pi)
_ON_LINE = 1e-12
"""Squared angle [rad^2] below which a point counts as on a filament's line."""

_INLINE: dict[str, Any] = {"cache": True, "error_model": "numpy", "forceinline": True}


@njit(**_INLINE)
def _distance(px, py, pz, a):  # type: ignore[no-untyped-def]
    """Of p from the node a (3,)."""
    x, y, z = px - a[0], py - a[1], pz - a[2]
    return math.sqrt(x * x + y * y + z * z)


@njit(**_INLINE)
def _segment(px, py, pz, ax, ay, az, bx, by, bz, n1, n2, core2):  # type: ignore[no-untyped-def]
    """Velocity at p, at distances n1 and n2 from a and b, from a unit filament from a to b."""
    x1, y1, z1 = px - ax, py - ay, pz - az
    x2, y2, z2 = px - bx, py - by, pz - bz
    product = n1 * n2
    apart = product * (product + x1 * x2 + y1 * y2 + z1 * z2)
    dx, dy, dz = bx - ax, by - ay, bz - az
    lower = max(apart, 0.5 * core2 * (dx * dx + dy * dy + dz * dz))
    off = apart > _ON_LINE * product * product
    k = _PER_4PI * (n1 + n2) / (lower if off else 1.0)
    k = k if off else 0.0
    return k * (y1 * z2 - z1 * y2), k * (z1 * x2 - x1 * z2), k * (x1 * y2 - y1 * x2)


@njit(**_INLINE)
def _ray(px, py, pz, ax, ay, az, n, dx, dy, dz, core2):  # type: ignore[no-untyped-def]
    """Velocity at p, at a distance n from a, from a unit filament from a to infinity along the unit vector d."""
    x, y, z = px - ax, py - ay, pz - az
    apart = n * (n - (x * dx + y * dy + z * dz))
    off = apart > _ON_LINE * n * n
    k = _PER_4PI / (max(apart, 0.5 * core2) if off else 1.0)
    k = k if off else 0.0
    return k * (dy * z - dz * y), k * (dz * x - dx * z), k * (dx * y - dy * x)


@njit(**KERNEL)
def ring_velocities(corners, points, out):  # type: ignore[no-untyped-def]
    """Velocities (3, n_points, n_rings) at points (n_points, 3) from unit rings through corners (n_rings, 4, 3)."""
    for p in prange(points.shape[0]):
        px, py, pz = points[p, 0], points[p, 1], points[p, 2]
        for r in range(corners.shape[0]):
            u = v = w = 0.0
            for side in range(4):
                a, b = corners[r, side], corners[r, (side + 1) % 4]
                n1, n2 = _distance(px, py, pz, a), _distance(px, py, pz, b)
                du, dv, dw = _segment(px, py, pz, a[0], a[1], a[2], b[0], b[1], b[2], n1, n2, 0.0)
                u, v, w = u + du, v + dv, w + dw
            out[0, p, r], out[1, p, r], out[2, p, r] = u, v, w


@njit(**KERNEL)
def sheet_velocity(nodes, strength, tail, far, core2, points, out):  # type: ignore[no-untyped-def]
    """Add to `out` (3, n_points) the velocity of a sheet of rings that goes on to infinity.

    Rings between nodes (rows + 1, columns + 1, 3) have strength (rows, columns); from the last row of nodes on, strips
    of strength tail (columns,) run along the unit vector `far` (3,). Points (3, n_points).
    """
    rows, columns = strength.shape
    n_points = points.shape[1]
    for block in prange((n_points + LANES - 1) // LANES):
        first = block * LANES
        count = min(LANES, n_points - first)
        px, py, pz = (
            points[0, first : first + count],
            points[1, first : first + count],
            points[2, first : first + count],
        )
        u, v, w = np.zeros(count), np.zeros(count), np.zeros(count)
        here, behind = np.empty((columns + 1, count)), np.empty((columns + 1, count))
        _distances(px, py, pz, nodes[0], here)
        for i in range(rows + 1):
            for j in range(columns):
                gamma = (strength[i, j] if i < rows else tail[j]) - (strength[i - 1, j] if i > 0 else 0.0)
                if gamma != 0.0:
                    ax, ay, az = nodes[i, j, 0], nodes[i, j, 1], nodes[i, j, 2]
                    bx, by, bz = nodes[i, j + 1, 0], nodes[i, j + 1, 1], nodes[i, j + 1, 2]
                    n1, n2 = here[j], here[j + 1]
                    for m in range(count):
                        du, dv, dw = _segment(px[m], py[m], pz[m], ax, ay, az, bx, by, bz, n1[m], n2[m], core2)
                        u[m] += gamma * du
                        v[m] += gamma * dv
                        w[m] += gamma * dw
            if i < rows:
                _distances(px, py, pz, nodes[i + 1], behind)
            for j in range(columns + 1):
                left = (strength[i, j - 1] if i < rows else tail[j - 1]) if j > 0 else 0.0
                right = (strength[i, j] if i < rows else tail[j]) if j < columns else 0.0
                gamma = left - right
                if gamma == 0.0:
                    continue
                ax, ay, az = nodes[i, j, 0], nodes[i, j, 1], nodes[i, j, 2]
                n1 = here[j]
                if i < rows:
                    bx, by, bz = nodes[i + 1, j, 0], nodes[i + 1, j, 1], nodes[i + 1, j, 2]
                    n2 = behind[j]
                    for m in range(count):
                        du, dv, dw = _segment(px[m], py[m], pz[m], ax, ay, az, bx, by, bz, n1[m], n2[m], core2)
                        u[m] += gamma * du
                        v[m] += gamma * dv
                        w[m] += gamma * dw
                else:
                    for m in range(count):
                        du, dv, dw = _ray(px[m], py[m], pz[m], ax, ay, az, n1[m], far[0], far[1], far[2], core2)
                        u[m] += gamma * du
                        v[m] += gamma * dv
                        w[m] += gamma * dw
            here, behind = behind, here
        for m in range(count):
            out[0, first + m] += u[m]
            out[1, first + m] += v[m]
            out[2, first + m] += w[m]


@njit(**KERNEL)
def strip_velocities(nodes, weights, far, core2, points, out):  # type: ignore[no-untyped-def]
    """Velocities per unit strength of each strip of a sheet whose rings are weighted.

    As `sheet_velocity`, with strength ``weights[q, row, j]`` (n_weights, rows + 1, columns) in strip j alone; the last
    row of weights is the tails'. Points (3, n_points), out (n_weights, 3, columns, n_points) is overwritten.
    """
    rows, columns = nodes.shape[0] - 1, nodes.shape[1] - 1
    sets, n_points = weights.shape[0], points.shape[1]
    for block in prange((n_points + LANES - 1) // LANES):
        first = block * LANES
        count = min(LANES, n_points - first)
        px, py, pz = (
            points[0, first : first + count],
            points[1, first : first + count],
            points[2, first : first + count],
        )
        sums = np.zeros((sets, columns, 3, count))
        u, v, w = np.empty(count), np.empty(count), np.empty(count)
        here, behind = np.empty((columns + 1, count)), np.empty((columns + 1, count))
        _distances(px, py, pz, nodes[0], here)
        for i in range(rows + 1):
            for j in range(columns):
                ax, ay, az = nodes[i, j, 0], nodes[i, j, 1], nodes[i, j, 2]
                bx, by, bz = nodes[i, j + 1, 0], nodes[i, j + 1, 1], nodes[i, j + 1, 2]
                n1, n2 = here[j], here[j + 1]
                for m in range(count):
                    u[m], v[m], w[m] = _segment(px[m], py[m], pz[m], ax, ay, az, bx, by, bz, n1[m], n2[m], core2)
                for q in range(sets):
                    _add(sums[q, j], weights[q, i, j] - (weights[q, i - 1, j] if i > 0 else 0.0), u, v, w)
            if i < rows:
                _distances(px, py, pz, nodes[i + 1], behind)
            for j in range(columns + 1):
                ax, ay, az = nodes[i, j, 0], nodes[i, j, 1], nodes[i, j, 2]
                n1 = here[j]
                if i < rows:
                    bx, by, bz = nodes[i + 1, j, 0], nodes[i + 1, j, 1], nodes[i + 1, j, 2]
                    n2 = behind[j]
                    for m in range(count):
                        u[m], v[m], w[m] = _segment(px[m], py[m], pz[m], ax, ay, az, bx, by, bz, n1[m], n2[m], core2)
                else:
                    for m in range(count):
                        u[m], v[m], w[m] = _ray(px[m], py[m], pz[m], ax, ay, az, n1[m], far[0], far[1], far[2], core2)
                for q in range(sets):
                    if j > 0:
                        _add(sums[q, j - 1], weights[q, i, j - 1], u, v, w)
                    if j < columns:
                        _add(sums[q, j], -weights[q, i, j], u, v, w)
            here, behind = behind, here
        for q in range(sets):
            for j in range(columns):
                for c in range(3):
                    out[q, c, j, first : first + count] = sums[q, j, c]


@njit(**_INLINE)
def _distances(px, py, pz, row, out):  # type: ignore[no-untyped-def]
    """Of points in lanes from the nodes of a row (columns + 1, 3), shape (columns + 1, lanes)."""
    for j in range(row.shape[0]):
        for m in range(len(px)):
            out[j, m] = _distance(px[m], py[m], pz[m], row[j])


@njit(**_INLINE)
def _add(total, gamma, u, v, w):  # type: ignore[no-untyped-def]
    """Add gamma times a velocity in lanes to total (3, lanes)."""
    if gamma != 0.0:
        for m in range(len(u)):
            total[0, m] += gamma * u[m]
            total[1, m] += gamma * v[m]
            total[2, m] += gamma * w[m]
