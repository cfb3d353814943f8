r"""A preconditioner for hard solves: wide block ILU(0) and a coarse level.

A compact (first-order) preconditioner leaves to GMRES all that parts the second-order operator from the first-order
one, and ILU(0) leaves it the smooth disturbances that reach across many cells: pressure waves where the flow is
subsonic. Here the factors are those of the second-order blocks themselves, with `SECOND_ORDER_PART` of the
second-order terms. What is smooth is solved for first, on lumps of cells:

    T = Q + M^-1 (I - A Q),     Q = P A_c^-1 P^T,     A_c = P^T A P,     M = L U,

with A the assembled blocks (A-DEF1 of Tang, Nabben, Vuik & Erlangga 2009). Solves to small residuals take a third to a
tenth of the products that they take with the compact factors, which cost a fourth as much to make and to apply: steps
in time, which are easy, stay with those.

In a mesh of hexahedra a row has 25 blocks: 8 kB a cell while the factors are made, 4 kB held, twice that if complex.
"""

from __future__ import annotations

from indicial.cfd.flow.jacobian import Jacobian
from indicial.cfd.march.aggregation import CoarseLevel
from indicial.cfd.march.assembly import wide_blocks
from indicial.cfd.march.ilu import BlockILU, Pattern
from indicial.cfd.march.krylov import State

SECOND_ORDER_PART = 0.8
"""With all of the second-order terms the incomplete factors of unresolved waves grow (a far field of large cells, at a
frequency); with few of them shear along thin cells is left to GMRES (a cone's wall). Between, the choice is flat."""

CELLS_PER_LUMP = 64
MOST_LUMPS = 1000


class TwoLevel:
    """``T`` of the matrix ``extra + J``, real or complex, applied to real or complex states (nc, 5).

    Parameters
    ----------
    jacobian : Jacobian
    pattern : Pattern
        ``Pattern.wide(grid)``.
    extra : ndarray, optional
        Added to J on the diagonal (nc, 5, 5), as ``sigma V dW/dq``.
    parity : float
        Sign of the images behind symmetry planes.

    Raises
    ------
    DivergenceError
        If a diagonal block or the coarse matrix is singular.
    """

    def __init__(
        self, jacobian: Jacobian, pattern: Pattern, extra: State | None = None, *, parity: float = 1.0
    ) -> None:
        blocks = wide_blocks(jacobian, pattern, extra, part=SECOND_ORDER_PART, parity=parity)
        self._coarse = CoarseLevel(pattern, blocks, min(MOST_LUMPS, max(1, len(pattern.diagonal) // CELLS_PER_LUMP)))
        self._fine = BlockILU(pattern, blocks)

    def solve(self, b: State) -> State:
        """``T b``."""
        coarse = self._coarse
        z = coarse.solve(coarse.restrict(b))
        return self._fine.solve(b - coarse.product(z)) + coarse.spread(z)

    def solve_transposed(self, b: State) -> State:
        """``T^T b``: the transpose, nothing conjugated."""
        coarse = self._coarse
        y = self._fine.solve_transposed(b)
        z = coarse.solve(coarse.restrict(b) - coarse.product_transposed(y), transposed=True)
        return y + coarse.spread(z)
