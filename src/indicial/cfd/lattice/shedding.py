r"""How a wake joins the lattice that sheds it, and how it is cut into rings.

A lattice whose filaments stand at a quarter of equal panels of length d, and whose boundary condition holds midway,
is a quadrature rule: a filament stands for the vorticity half a panel to both of its sides. So the circulation that the
panels sum to is that of the sheet up to the last collocation point, d/4 ahead of the trailing edge. There the wake
begins: its circulation at a distance x' behind *that* point is what the panels summed to when the wind was there. The
lattice goes on in the wake with rings from (m - 1/2) d to (m + 1/2) d, whatever the time step, each with its mean of
the circulations, linear in time between the instants; the first is the panels' last. Farther back they may be longer
in proportion to their distance.

So the whole is second order in space and time: rings of the length that the wind goes in a step, which is what a
lattice usually sheds, would spoil the principal value at the last collocation point wherever that length is not d.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numba import njit

from indicial.cfd.flow.compiled import KERNEL
from indicial.cfd.lattice.wake import WakeSheet
from indicial.conventions import Array

START = 0.25
"""Where the wake begins, in last panels ahead of the trailing edge."""

GROWTH = 0.1
"""Length of the rings over their distance, where that is longer than a panel."""


@dataclass(frozen=True)
class Rings:
    """A wake cut into rings.

    Parameters
    ----------
    nodes : ndarray
        Their corners (n + 1, columns + 1, 3) from the trailing edge on [m].
    strength : ndarray
        Circulation without what is the panels' now, shape (n, columns).
    share : ndarray
        How much of the panels' circulation of now each has, shape (n, columns).
    tail : ndarray
        Circulation from the last corners to infinity (columns,).
    far : ndarray
        Where to, a unit vector (3,).
    """

    nodes: Array
    strength: Array
    share: Array
    tail: Array
    far: Array

    @property
    def young(self) -> int:
        """How many rings have a share of the circulation of now."""
        return int(np.flatnonzero(np.any(self.share > 0.0, axis=1))[-1]) + 1


@lru_cache(maxsize=8)
def sides(length: float) -> Array:
    """Distances x'/d of the sides of rings, until beyond a length over d, shape (n,)."""
    found = [0.5]
    while found[-1] < length:
        middle = found[-1] + 0.5
        found.append(found[-1] + max(1.0, GROWTH * middle))
    return np.array(found)


def departure(edge: Array, away: Array, chord: Array) -> Array:
    """The line at which the wake begins (columns + 1, 3), for last panels of `chord` (columns + 1,) [m]."""
    return np.asarray(edge - START * chord[:, None] * away)


def cut(wake: WakeSheet, edge: Array, chord: Array) -> Rings:
    """Rings of a wake whose first line is the departure of now; its circulation there counts as not yet known.

    Parameters
    ----------
    wake : WakeSheet
    edge : ndarray
        The trailing edge (columns + 1, 3) [m].
    chord : ndarray
        Of the last panels, d, shape (columns + 1,) [m].
    """
    longest = float(np.max(wake.path[-1] / chord))
    # few different lengths, so that the cuts are found ready
    relative = sides(2.0 ** np.ceil(np.log2(longest)) if longest > 0.0 else 0.0)
    relative = relative[: int(np.searchsorted(relative, longest)) + 1]
    n, columns = len(relative), len(edge) - 1
    nodes, strength, share = np.empty((n + 1, columns + 1, 3)), np.zeros((n, columns)), np.zeros((n, columns))
    nodes[0], share[0] = edge, 1.0
    _place(wake.lines, wake.path, wake.tangent, wake.far, relative, chord, nodes)
    _mean(wake.path, wake.circulation, relative, chord, strength, share)
    return Rings(nodes, strength, share, wake.circulation[-1], wake.far)


_SERIAL = {**KERNEL, "parallel": False}


@njit(**_SERIAL)
def _place(lines, path, tangent, far, relative, chord, nodes):  # type: ignore[no-untyped-def]
    """Corners of rings at distances ``relative * chord``, cubic between the lines and along `far` beyond."""
    last = lines.shape[0] - 1
    for j in range(lines.shape[1]):
        i = 0
        for r in range(len(relative)):
            x = relative[r] * chord[j]
            while i < last and path[i + 1, j] < x:
                i += 1
            if i == last:
                for c in range(3):
                    nodes[r + 1, j, c] = lines[i, j, c] + (x - path[i, j]) * far[c]
            else:
                length = path[i + 1, j] - path[i, j]
                w = (x - path[i, j]) / length
                v = 1.0 - w
                for c in range(3):
                    ends = v * v * (1.0 + 2.0 * w) * lines[i, j, c] + w * w * (1.0 + 2.0 * v) * lines[i + 1, j, c]
                    slopes = v * v * w * tangent[i, j, c] - w * w * v * tangent[i + 1, j, c]
                    nodes[r + 1, j, c] = ends + length * slopes


@njit(**_SERIAL)
def _mean(path, circulation, relative, chord, strength, share):  # type: ignore[no-untyped-def]
    """Means over rings of what is linear between the lines; the first line's circulation counts as a share."""
    last = path.shape[0] - 1
    for j in range(circulation.shape[1]):
        d = 0.5 * (chord[j] + chord[j + 1])
        i = 0
        for r in range(1, len(relative)):
            a, end = relative[r - 1] * d, relative[r] * d
            total = part = 0.0
            x = a
            while x < end:
                while i < last and 0.5 * (path[i + 1, j] + path[i + 1, j + 1]) <= x:
                    i += 1
                if i == last:
                    known, own = circulation[i, j], 1.0 if last == 0 else 0.0
                    total += (end - x) * (0.0 if last == 0 else known)
                    part += (end - x) * own
                    break
                low, high = 0.5 * (path[i, j] + path[i, j + 1]), 0.5 * (path[i + 1, j] + path[i + 1, j + 1])
                stop = min(end, high)
                w = (0.5 * (x + stop) - low) / (high - low)
                total += (stop - x) * (w * circulation[i + 1, j] + ((1.0 - w) * circulation[i, j] if i > 0 else 0.0))
                part += (stop - x) * (1.0 - w) if i == 0 else 0.0
                x = stop
            strength[r, j] = total / (end - a)
            share[r, j] = part / (end - a)
