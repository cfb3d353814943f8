r"""Incomplete block factorisation of the compact Jacobian, on its own pattern: block ILU(0).

The preconditioner of every implicit solve. With cells numbered downstream it is nearly a direct solver where the
flow is supersonic. Factors are kept in single precision: they only precondition. Blocks may be complex (a matrix
shifted by i omega), right-hand sides too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sparse
from numba import njit

from indicial.cfd.flow.grid import Grid
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


@njit(cache=True, error_model="numpy", fastmath=True)
def _solve(blocks, indptr, indices, diagonal, b, x):  # type: ignore[no-untyped-def]
    """x = U^-1 L^-1 b."""
    n = indptr.shape[0] - 1
    for i in range(n):
        y0, y1, y2, y3, y4 = b[i, 0], b[i, 1], b[i, 2], b[i, 3], b[i, 4]
        for s in range(indptr[i], diagonal[i]):
            j = indices[s]
            for m in range(5):
                v = x[j, m]
                y0 -= blocks[s, 0, m] * v
                y1 -= blocks[s, 1, m] * v
                y2 -= blocks[s, 2, m] * v
                y3 -= blocks[s, 3, m] * v
                y4 -= blocks[s, 4, m] * v
        x[i, 0], x[i, 1], x[i, 2], x[i, 3], x[i, 4] = y0, y1, y2, y3, y4
    for i in range(n - 1, -1, -1):
        y0, y1, y2, y3, y4 = x[i, 0], x[i, 1], x[i, 2], x[i, 3], x[i, 4]
        for s in range(diagonal[i] + 1, indptr[i + 1]):
            j = indices[s]
            for m in range(5):
                v = x[j, m]
                y0 -= blocks[s, 0, m] * v
                y1 -= blocks[s, 1, m] * v
                y2 -= blocks[s, 2, m] * v
                y3 -= blocks[s, 3, m] * v
                y4 -= blocks[s, 4, m] * v
        d = blocks[diagonal[i]]
        for a in range(5):
            x[i, a] = d[a, 0] * y0 + d[a, 1] * y1 + d[a, 2] * y2 + d[a, 3] * y3 + d[a, 4] * y4


@njit(cache=True, error_model="numpy", fastmath=True)
def _solve_transposed(blocks, indptr, indices, diagonal, x):  # type: ignore[no-untyped-def]
    """x = L^-T U^-T x in place: rows of the factors are columns of their transposes, so each row is scattered."""
    n = indptr.shape[0] - 1
    for i in range(n):
        y0, y1, y2, y3, y4 = x[i, 0], x[i, 1], x[i, 2], x[i, 3], x[i, 4]
        d = blocks[diagonal[i]]
        for a in range(5):
            x[i, a] = d[0, a] * y0 + d[1, a] * y1 + d[2, a] * y2 + d[3, a] * y3 + d[4, a] * y4
        y0, y1, y2, y3, y4 = x[i, 0], x[i, 1], x[i, 2], x[i, 3], x[i, 4]
        for s in range(diagonal[i] + 1, indptr[i + 1]):
            j = indices[s]
            u = blocks[s]
            for a in range(5):
                x[j, a] -= u[0, a] * y0 + u[1, a] * y1 + u[2, a] * y2 + u[3, a] * y3 + u[4, a] * y4
    for i in range(n - 1, -1, -1):
        y0, y1, y2, y3, y4 = x[i, 0], x[i, 1], x[i, 2], x[i, 3], x[i, 4]
        for s in range(indptr[i], diagonal[i]):
            j = indices[s]
            u = blocks[s]
            for a in range(5):
                x[j, a] -= u[0, a] * y0 + u[1, a] * y1 + u[2, a] * y2 + u[3, a] * y3 + u[4, a] * y4


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
        self._factors = blocks.astype(np.complex64 if np.iscomplexobj(blocks) else np.float32)

    def solve(self, b: State) -> State:
        """``M^-1 b``, complex if M or b is."""
        x = np.empty(b.shape, dtype=np.result_type(self._factors, b))
        p = self.pattern
        _solve(self._factors, p.indptr, p.indices, p.diagonal, b, x)
        return x

    def solve_transposed(self, b: State) -> State:
        """``M^-T b``: the transpose, nothing conjugated."""
        x = b.astype(np.result_type(self._factors, b))
        p = self.pattern
        _solve_transposed(self._factors, p.indptr, p.indices, p.diagonal, x)
        return x
