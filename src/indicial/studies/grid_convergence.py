r"""Discretisation uncertainty from systematically refined meshes: the grid-convergence index.

With f_1, f_2, f_3 from the finest mesh to the coarsest, ``h = N^(-1/3)``, ``r_21 = h_2/h_1``, ``r_32 = h_3/h_2`` and
``e_21 = f_2 - f_1``, ``e_32 = f_3 - f_2``, the observed order p solves

    e_32/e_21 = r_21^p (r_32^p - 1)/(r_21^p - 1),

and the index, half the width of an interval that should hold the exact solution of the equations in some 95 of 100
cases, is ``F_s |e_21|/(r_21^p - 1)``.

Sources: P. J. Roache, "Perspective: a method for uniform reporting of grid refinement studies", J. Fluids Eng. 116
(1994) 405; I. B. Celik et al., "Procedure for estimation and reporting of uncertainty due to discretization in CFD
applications", J. Fluids Eng. 130 (2008) 078001.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from scipy.optimize import brentq

from indicial.errors import InputError

FORMAL_ORDER = 2.0
"""Of the scheme where the flow is smooth; shocks and edges take it towards 1."""

ASYMPTOTIC = (0.75, 3.0)
"""Observed orders that are taken as those of the asymptotic range: about first order, by shocks, up to the formal order
and half as much again."""

SAFETY, SAFETY_ELSEWHERE = 1.25, 3.0
"""Roache's factors: for three meshes in the asymptotic range, and for two meshes or outside of it."""


@dataclass(frozen=True)
class GridConvergence:
    """What refinement says of one number.

    Parameters
    ----------
    value : float
        On the finest mesh.
    change : float
        Finest less next coarser, relative to the finest.
    order : float or None
        Observed; None if the changes alternate or grow, or there are two meshes only.
    asymptotic : bool
        Whether the observed order is one that the scheme can have.
    index : float
        Grid-convergence index, in units of the value.
    """

    value: float
    change: float
    order: float | None
    asymptotic: bool
    index: float

    def summary(self) -> str:
        """A few words."""
        order = "no order" if self.order is None else f"order {self.order:.2f}"
        where = "" if self.asymptotic else ", not in the asymptotic range"
        return f"{self.value:.5g} +- {self.index:.2g} (last change {self.change:+.2%}, {order}{where})"


def grid_convergence(values: Sequence[float], cells: Sequence[int]) -> GridConvergence:
    """Judge a number from two or three meshes, coarsest first.

    Raises
    ------
    InputError
        With another number of meshes, or if the cells do not increase.
    """
    if len(values) != len(cells) or len(values) not in (2, 3):
        raise InputError(f"grid convergence needs two or three meshes, not {len(values)} values on {len(cells)}")
    if any(fine <= coarse for coarse, fine in pairwise(cells)):
        raise InputError("grid convergence needs meshes from the coarsest to the finest")
    f1, f2 = values[-1], values[-2]
    r21 = (cells[-1] / cells[-2]) ** (1.0 / 3.0)
    order = None
    if len(values) == 3:
        order = observed_order(f1, f2, values[0], r21, (cells[1] / cells[0]) ** (1.0 / 3.0))
    asymptotic = order is not None and ASYMPTOTIC[0] <= order <= ASYMPTOTIC[1]
    power = min(order, FORMAL_ORDER) if asymptotic and order is not None else FORMAL_ORDER
    index = (SAFETY if asymptotic else SAFETY_ELSEWHERE) * abs(f2 - f1) / (r21**power - 1.0)
    return GridConvergence(f1, (f1 - f2) / f1 if f1 else math.inf, order, asymptotic, index)


def observed_order(f1: float, f2: float, f3: float, r21: float, r32: float) -> float | None:
    """Order p with ``f = f_0 + C h^p`` on three meshes, finest first; None if there is none between 0.01 and 20."""
    e21, e32 = f2 - f1, f3 - f2
    if e21 == 0.0 or e32 / e21 <= 0.0:
        return None

    def misfit(p: float) -> float:
        return p * math.log(r21) + math.log(math.expm1(p * math.log(r32)) / math.expm1(p * math.log(r21))) - log_ratio

    log_ratio = math.log(e32 / e21)
    low, high = 0.01, 20.0
    if misfit(low) > 0.0 or misfit(high) < 0.0:
        return None
    return float(brentq(misfit, low, high, xtol=1e-12))
