r"""A preconditioner for hard solves: wide block ILU(0) and a coarse level.

A compact (first-order) preconditioner leaves to GMRES all that parts the second-order operator from the first-order
one, and ILU(0) leaves it the smooth disturbances that reach across many cells: pressure waves where the flow is
subsonic. Here the factors are those of the second-order blocks themselves, with as large a part of the
second-order terms as the factors bear. What is smooth is solved for first, on lumps of cells:

    T = Q + M^-1 (I - A Q),     Q = P A_c^-1 P^T,     A_c = P^T A P,     M = L U,

with A the assembled blocks (A-DEF1 of Tang, Nabben, Vuik & Erlangga 2009). Solves to small residuals take a third to a
tenth of the products that they take with the compact factors, which cost a fourth as much to make and to apply: steps
in time, which are easy, stay with those.

In a mesh of hexahedra a row has 25 blocks: 8 kB a cell while the factors are made, 4 kB held, twice that if complex.
"""

from __future__ import annotations

import logging

import numpy as np

from indicial.cfd.flow.jacobian import Jacobian
from indicial.cfd.march.aggregation import CoarseLevel
from indicial.cfd.march.assembly import wide_blocks
from indicial.cfd.march.ilu import BlockILU, Pattern
from indicial.cfd.march.krylov import State

log = logging.getLogger(__name__)

SECOND_ORDER_PARTS = (0.8, 0.5, 0.2, 0.0)
"""Of which the first that `LARGEST_GROWTH` allows is taken. With fewer of the second-order terms more is left to GMRES
(on half a finned body at M 4.5, 31 products become 53 from 0.8 to 0.5). With more of them incomplete factors may grow
without bound where a cell's own block does not outweigh those beside it: in the wake along a sting, whose last cells
are a hundred times longer than they are wide, and in a far field of large cells at a frequency."""

LARGEST_GROWTH = 5.0
"""Of a disturbance by ``I - A T``. Good factors leave it about as large as it was; where they grow in no more than four
of 75,000 cells, it becomes hundreds or thousands of times as large."""

TRIAL_PASSES = 3
"""Through ``I - A T``, after which a disturbance at random has become the one that grows most."""

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

    Attributes
    ----------
    part : float
        Part of the second-order terms in the factors, of `SECOND_ORDER_PARTS`.

    Raises
    ------
    DivergenceError
        If a diagonal block or the coarse matrix is singular.
    """

    def __init__(
        self, jacobian: Jacobian, pattern: Pattern, extra: State | None = None, *, parity: float = 1.0
    ) -> None:
        self._factorise(SECOND_ORDER_PARTS[0], jacobian, pattern, extra, parity)
        for part in SECOND_ORDER_PARTS[1:]:
            growth = self._growth(jacobian, extra, parity)
            if growth <= LARGEST_GROWTH:
                break
            log.debug("factors with %g of the second-order terms let disturbances grow by %.1e", self.part, growth)
            del self._coarse, self._fine  # before others are made: they are large
            # the last, of the compact stencil, are taken untried: what a solution is worth GMRES sees
            self._factorise(part, jacobian, pattern, extra, parity)

    def _factorise(self, part: float, jacobian: Jacobian, pattern: Pattern, extra: State | None, parity: float) -> None:
        """Make both levels from blocks with a part of the second-order terms."""
        self.part = part
        blocks = wide_blocks(jacobian, pattern, extra, part=part, parity=parity)
        self._coarse = CoarseLevel(pattern, blocks, min(MOST_LUMPS, max(1, len(pattern.diagonal) // CELLS_PER_LUMP)))
        self._fine = BlockILU(pattern, blocks)

    def _growth(self, jacobian: Jacobian, extra: State | None, parity: float) -> float:
        """Growth of a disturbance in the last of `TRIAL_PASSES` through ``I - A T``, with the exact A."""
        v: State = np.random.default_rng(0).standard_normal((jacobian.grid.n_cells, 5))
        growth = 1.0
        for _ in range(TRIAL_PASSES):
            v = v / np.linalg.norm(v)
            x = self.solve(v)
            v = v - jacobian.apply(x, parity)
            if extra is not None:
                v = v - np.einsum("nij,nj->ni", extra, x)
            growth = float(np.linalg.norm(v))
            if not 0.0 < growth < np.inf:
                break
        return growth

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
