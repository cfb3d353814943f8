r"""The blocks of the second-order Jacobian on the pattern of neighbours and their neighbours.

The factors of `Jacobian` make cheap products; a factorisation needs entries. A face state is

    q_f = q_c + p [ (a_c - 1) q_c + a_o q_o + sum_n b_n (q_n - q_c) ],     b_n = c_r w_n.r + c_d w_n.d,

over the neighbours n of cell c, with the slopes (a_c, a_o, c_r, c_d) of the reconstruction and the least-squares
weights w_n. The part p of the second-order terms is 1 for the exact Jacobian and 0 for the compact one.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from indicial.cfd.flow.face_flux import mirrored
from indicial.cfd.flow.grid import MIRROR
from indicial.cfd.flow.jacobian import Jacobian
from indicial.cfd.march.ilu import Pattern
from indicial.cfd.march.krylov import State


@njit(cache=True, error_model="numpy")
def _slot(indices, lo, hi, column):  # type: ignore[no-untyped-def]
    """Where a sorted row holds `column`."""
    while lo < hi:
        middle = (lo + hi) // 2
        if indices[middle] < column:
            lo = middle + 1
        else:
            hi = middle
    return lo


@njit(cache=True, error_model="numpy")
def _add(out, flux, slope):  # type: ignore[no-untyped-def]
    """Add the columns of a flux derivative, each times its variable's slope."""
    for m in range(5):
        for k in range(5):
            out[m, k] += flux[m, k] * slope[k]


@njit(cache=True, error_model="numpy")
def _add_image(out, flux, slope, parity, n):  # type: ignore[no-untyped-def]
    """The same for slopes that act on a cell's mirror image behind a plane of unit normal n."""
    for m in range(5):
        out[m, 0] += parity * flux[m, 0] * slope[0]
        u, v, w = mirrored(flux[m, 1] * slope[1], flux[m, 2] * slope[2], flux[m, 3] * slope[3], n[0], n[1], n[2])
        out[m, 1] += parity * u
        out[m, 2] += parity * v
        out[m, 3] += parity * w
        out[m, 4] += parity * flux[m, 4] * slope[4]


@njit(cache=True, parallel=True, error_model="numpy")
def _assemble(  # type: ignore[no-untyped-def]
    indptr,
    indices,
    offsets,
    faces,
    signs,
    cells,
    weights,
    owner,
    neighbour,
    normal,
    ri,
    rj,
    dl,
    dr,
    lin,
    part,
    parity,
    out,
):
    """Add the blocks of every row to `out`."""
    ones = np.ones(5)
    for c in prange(offsets.shape[0] - 1):
        lo, hi = indptr[c], indptr[c + 1]
        flux, slope = np.empty((5, 5)), np.empty(5)
        for e in range(offsets[c], offsets[c + 1]):
            f = faces[e]
            n = normal[f]
            for side in range(2 if cells[e] >= 0 else 1):
                # the cell whose state at the face this is, and the way to the face and to what lies behind it
                a = owner[f] if side == 0 else neighbour[f]
                r = ri[f] if side == 0 else rj[f]
                d = 0.0 * r
                if cells[e] >= 0:
                    d = ri[f] - rj[f] if side == 0 else rj[f] - ri[f]
                elif cells[e] == MIRROR:
                    d = 2.0 * (r[0] * n[0] + r[1] * n[1] + r[2] * n[2]) * n
                for m in range(5):
                    for k in range(5):
                        flux[m, k] = signs[e] * (dl[f, m, k] if side == 0 else dr[f, m, k])
                if cells[e] == MIRROR:
                    _add_image(flux, dr[f], ones, parity, n)
                own = out[_slot(indices, lo, hi, a)]
                s = lin[f, side]
                for k in range(5):
                    slope[k] = 1.0 + part * (s[k, 0] - 1.0)
                _add(own, flux, slope)
                if part == 0.0:
                    continue
                for k in range(5):
                    slope[k] = part * s[k, 1]
                if cells[e] >= 0:
                    _add(out[_slot(indices, lo, hi, neighbour[f] if side == 0 else owner[f])], flux, slope)
                elif cells[e] == MIRROR:
                    _add_image(own, flux, slope, parity, n)
                for g in range(offsets[a], offsets[a + 1]):
                    w = weights[g]
                    along_r = w[0] * r[0] + w[1] * r[1] + w[2] * r[2]
                    along_d = w[0] * d[0] + w[1] * d[1] + w[2] * d[2]
                    if along_r == 0.0 and along_d == 0.0:
                        continue
                    for k in range(5):
                        slope[k] = part * (s[k, 2] * along_r + s[k, 3] * along_d)
                    if cells[g] >= 0:
                        _add(out[_slot(indices, lo, hi, cells[g])], flux, slope)
                    else:
                        _add_image(own, flux, slope, parity, normal[faces[g]])
                    for k in range(5):
                        slope[k] = -slope[k]
                    _add(own, flux, slope)


def wide_blocks(
    jacobian: Jacobian, pattern: Pattern, extra: State | None = None, *, part: float = 1.0, parity: float = 1.0
) -> State:
    """Blocks of ``extra + J`` in a pattern that holds neighbours and their neighbours (entries, 5, 5).

    Parameters
    ----------
    extra : ndarray, optional
        Added on the diagonal (nc, 5, 5); the blocks are complex if it is.
    part : float
        Part of the second-order terms that is kept: 1 gives J exactly, 0 its compact part.
    parity : float
        Sign of the images behind symmetry planes.
    """
    g = jacobian.grid
    out = np.zeros((len(pattern.indices), 5, 5), np.float64 if extra is None else np.result_type(extra, np.float64))
    if extra is not None:
        out[pattern.diagonal] += extra
    if jacobian.source is not None:
        out[pattern.diagonal] += jacobian.source
    _assemble(
        pattern.indptr,
        pattern.indices,
        g.offsets,
        g.faces,
        g.signs,
        g.cells,
        g.weights,
        g.owner,
        g.neighbour,
        g.normal,
        g.to_owner,
        g.to_neighbour,
        jacobian.flux_left,
        jacobian.flux_right,
        jacobian.slopes,
        part if jacobian.second_order else 0.0,
        parity,
        out,
    )
    return out
