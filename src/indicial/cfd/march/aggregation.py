"""A coarse level without a coarse mesh: cells lumped by strength of coupling, and the matrix summed over the lumps."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sparse
from numba import njit
from scipy.sparse.linalg import splu

from indicial.cfd.march.ilu import Pattern
from indicial.cfd.march.krylov import State
from indicial.conventions import Index
from indicial.errors import DivergenceError


@njit(cache=True)
def _match(indptr, indices, strength):  # type: ignore[no-untyped-def]
    """Number of the pair of each node: itself and the unpaired neighbour that it is coupled to most strongly."""
    n = indptr.shape[0] - 1
    pair = np.full(n, -1, dtype=np.int64)
    count = 0
    for i in range(n):
        if pair[i] >= 0:
            continue
        best, most = -1, 0.0
        for s in range(indptr[i], indptr[i + 1]):
            j = indices[s]
            if j != i and pair[j] < 0 and strength[s] > most:
                best, most = j, strength[s]
        pair[i] = count
        if best >= 0:
            pair[best] = count
        count += 1
    return pair, count


def aggregates(pattern: Pattern, blocks: State, most: int) -> Index:
    """Lump of each cell (nc,): pairs of pairs of pairs, until there are no more than `most` or nothing is coupled."""
    n = len(pattern.diagonal)
    norms = np.sqrt(np.einsum("nij,nij->n", blocks, np.conj(blocks)).real)
    graph = sparse.csr_matrix((norms, pattern.indices, pattern.indptr), shape=(n, n))
    graph = (graph + graph.T).tocsr()
    lump, count = np.arange(n), n
    while count > most:
        before = count
        pair, count = _match(graph.indptr, graph.indices, graph.data)
        if count == before:
            break
        lump = pair[lump]
        gather = sparse.csr_matrix((np.ones(before), (pair, np.arange(before))), shape=(count, before))
        graph = (gather @ graph @ gather.T).tocsr()
    return lump


class CoarseLevel:
    """``A_c = P^T A P`` with P constant on lumps of cells, factorised; and A P, for residuals of what it gives.

    Raises
    ------
    DivergenceError
        If the coarse matrix is singular.
    """

    def __init__(self, pattern: Pattern, blocks: State, most: int) -> None:
        n = len(pattern.diagonal)
        lump = aggregates(pattern, blocks, most)
        size = int(lump.max()) + 1
        matrix = sparse.bsr_matrix((blocks, pattern.indices, pattern.indptr), shape=(5 * n, 5 * n))
        spread = sparse.csr_matrix((np.ones(n), lump, np.arange(n + 1)), shape=(n, size))
        self._spread = spread
        self._product = (matrix @ sparse.kron(spread, np.eye(5), format="bsr")).tobsr((5, 5))
        try:
            self._factors = splu((sparse.kron(spread.T, np.eye(5), format="bsr") @ self._product).tocsc())
        except RuntimeError as error:
            raise DivergenceError(f"the coarse level of a linear solver is singular: {error}") from error
        self._complex = np.iscomplexobj(blocks)

    def restrict(self, b: State) -> State:
        """``P^T b``, (lumps, 5)."""
        return np.asarray(self._spread.T @ b)

    def spread(self, z: State) -> State:
        """``P z``, (nc, 5)."""
        return np.asarray(self._spread @ z)

    def product(self, z: State) -> State:
        """``A P z``, (nc, 5)."""
        return np.asarray(self._product @ z.ravel()).reshape(-1, 5)

    def product_transposed(self, y: State) -> State:
        """``P^T A^T y``, (lumps, 5)."""
        return np.asarray(self._product.T @ y.ravel()).reshape(-1, 5)

    def solve(self, z: State, *, transposed: bool = False) -> State:
        """``A_c^-1 z`` or ``A_c^-T z``, (lumps, 5)."""
        mode = "T" if transposed else "N"
        if self._complex or not np.iscomplexobj(z):
            kind = np.complex128 if self._complex else np.float64
            return np.asarray(self._factors.solve(z.astype(kind).ravel(), mode)).reshape(z.shape)
        both = self._factors.solve(np.column_stack([z.real.ravel(), z.imag.ravel()]), mode)
        return np.asarray(both[:, 0] + 1j * both[:, 1]).reshape(z.shape)
