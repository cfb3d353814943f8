r"""Incomplete block factorisation of the compact Jacobian, on its own pattern: block ILU(0).

The preconditioner of every implicit solve. With cells numbered downstream it is nearly a direct solver where the
flow is supersonic. Factors are kept in single precision: they only precondition. Blocks may be complex (a matrix
shifted by i omega), right-hand sides too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from numba import njit

from indicial.cfd.flow.grid import Grid
from indicial.cfd.march import sweeps
from indicial.cfd.march.krylov import State
from indicial.conventions import Index
from indicial.errors import DivergenceError


@dataclass(frozen=True)
class Pattern:
    """Block-sparse rows of the compact Jacobian: sorted columns, and where each face's entry goes.

    Parameters
    ----------
    indptr, indices : ndarray
        Rows and sorted columns.
    diagonal : ndarray
        Slot of each diagonal block (nc,).
    slots : ndarray
        Slot of each entry of the grid's cell-to-face table, -1 on the boundary.
    """

    indptr: Index
    indices: Index
    diagonal: Index
    slots: Index

    @classmethod
    def of(cls, grid: Grid) -> Pattern:
        """The pattern of a grid's nearest neighbours."""
        n = grid.n_cells
        rows = np.repeat(np.arange(n), np.diff(grid.offsets))
        inside = grid.cells >= 0
        i = np.concatenate([np.arange(n), rows[inside]])
        j = np.concatenate([np.arange(n), grid.cells[inside]])
        order = np.lexsort((j, i))
        place = np.empty(len(order), dtype=np.int32)
        place[order] = np.arange(len(order))
        slots = np.full(len(rows), -1, dtype=np.int32)
        slots[inside] = place[n:]
        indptr = np.concatenate([[0], np.cumsum(np.bincount(i, minlength=n))]).astype(np.int32)
        return cls(indptr, j[order].astype(np.int32), place[:n], slots)

    @classmethod
    def wide(cls, grid: Grid) -> Pattern:
        """The pattern of nearest neighbours and theirs: all that the second-order Jacobian couples."""
        compact, n = cls.of(grid), grid.n_cells
        ones = np.ones(len(compact.indices), dtype=np.int32)
        adjacent = sparse.csr_matrix((ones, compact.indices, compact.indptr), shape=(n, n))
        square = (adjacent @ adjacent).tocsr()
        square.sort_indices()
        indptr, indices = square.indptr.astype(np.int32), square.indices.astype(np.int32)
        # rows follow one another and are sorted, so that row and column together are one sorted key
        key = np.repeat(np.arange(n), np.diff(indptr)) * n + indices
        rows = np.repeat(np.arange(n), np.diff(grid.offsets))
        slots = np.where(grid.cells >= 0, np.searchsorted(key, rows * n + grid.cells), -1)
        diagonal = np.searchsorted(key, np.arange(n) * (n + 1))
        return cls(indptr, indices, diagonal.astype(np.int32), slots.astype(np.int32))


@njit(cache=True, error_model="numpy")
def _invert(a, out):  # type: ignore[no-untyped-def]
    """Inverse of a 5 x 5 block by Gauss-Jordan with partial pivoting; false if it is singular."""
    m = np.empty((5, 5), dtype=a.dtype)
    for i in range(5):
        for j in range(5):
            m[i, j] = a[i, j]
            out[i, j] = 1.0 if i == j else 0.0
    for c in range(5):
        p = c
        for i in range(c + 1, 5):
            if abs(m[i, c]) > abs(m[p, c]):
                p = i
        if not abs(m[p, c]) > 0.0:
            return False
        if p != c:
            for j in range(5):
                m[c, j], m[p, j] = m[p, j], m[c, j]
                out[c, j], out[p, j] = out[p, j], out[c, j]
        d = 1.0 / m[c, c]
        for j in range(5):
            m[c, j] *= d
            out[c, j] *= d
        for i in range(5):
            if i != c:
                t = m[i, c]
                if t != 0.0:
                    for j in range(5):
                        m[i, j] -= t * m[c, j]
                        out[i, j] -= t * out[c, j]
    return True


@njit(cache=True, error_model="numpy")
def _factorise(blocks, indptr, indices, diagonal):  # type: ignore[no-untyped-def]
    """Factors in place; diagonal blocks are left inverted. Returns the row of a singular block, or -1."""
    n = indptr.shape[0] - 1
    place = np.empty(n, dtype=np.int32)
    place[:] = -1
    product = np.empty((5, 5), dtype=blocks.dtype)
    inverse = np.empty((5, 5), dtype=blocks.dtype)
    for i in range(n):
        for s in range(indptr[i], indptr[i + 1]):
            place[indices[s]] = s
        for s in range(indptr[i], diagonal[i]):
            k = indices[s]
            d = blocks[diagonal[k]]
            for a in range(5):
                for b in range(5):
                    t = 0.0
                    for m in range(5):
                        t += blocks[s, a, m] * d[m, b]
                    product[a, b] = t
            for a in range(5):
                for b in range(5):
                    blocks[s, a, b] = product[a, b]
            for u in range(diagonal[k] + 1, indptr[k + 1]):
                target = place[indices[u]]
                if target >= 0:
                    for a in range(5):
                        for b in range(5):
                            t = 0.0
                            for m in range(5):
                                t += product[a, m] * blocks[u, m, b]
                            blocks[target, a, b] -= t
        for s in range(indptr[i], indptr[i + 1]):
            place[indices[s]] = -1
        if not _invert(blocks[diagonal[i]], inverse):
            return i
        for a in range(5):
            for b in range(5):
                blocks[diagonal[i], a, b] = inverse[a, b]
    return -1


class BlockILU:
    """``M^-1`` of a block-sparse matrix, real or complex, applied to real or complex states (nc, 5).

    Parameters
    ----------
    pattern : Pattern
    blocks : ndarray
        (entries, 5, 5), in the pattern's order; overwritten by the factors.

    Raises
    ------
    DivergenceError
        If a diagonal block becomes singular.
    """

    def __init__(self, pattern: Pattern, blocks: State) -> None:
        self.pattern = pattern
        row = _factorise(blocks, pattern.indptr, pattern.indices, pattern.diagonal)
        if row >= 0:
            raise DivergenceError(f"the linearised equations of cell {row} are singular", cell=row)
        self._complex = np.iscomplexobj(blocks)
        self._lower, self._upper = sweeps.lay_out(blocks, pattern.indptr, pattern.diagonal)

    def solve(self, b: State) -> State:
        """``M^-1 b``, complex if M or b is."""
        return self._swept(b, sweeps.solve_complex if self._complex else sweeps.solve_real)

    def solve_transposed(self, b: State) -> State:
        """``M^-T b``: the transpose, nothing conjugated."""
        return self._swept(b, sweeps.solve_transposed_complex if self._complex else sweeps.solve_transposed_real)

    def _swept(self, b: State, sweep: Callable[..., None]) -> State:
        """What a sweep makes of b; with real factors of its real and imaginary part apart."""
        if np.iscomplexobj(b) and not self._complex:
            return self._swept(b.real, sweep) + 1j * self._swept(b.imag, sweep)
        x = np.empty(len(b) * (16 if self._complex else 8))
        sweeps.padded(b, x)
        p = self.pattern
        sweep(self._lower, self._upper, p.indptr, p.indices, p.diagonal, x)
        out = np.empty(b.shape, dtype=complex if self._complex else float)
        (sweeps.unpadded_complex if self._complex else sweeps.unpadded_real)(x, out)
        return out
