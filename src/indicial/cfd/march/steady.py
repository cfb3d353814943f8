r"""Steady states by Newton-Krylov with pseudo-time continuation.

Each iteration solves ``(V/dtau dW/dq + J) dq = -R`` with the exact J, by the rules of `continuation`. An impulsive
start goes through the first-order scheme, which nothing upsets, to the second-order one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from indicial.cfd.flow.gas import GAMMA, RHO, STILL_AIR, P, conservative_jacobian
from indicial.cfd.flow.grid import Grid
from indicial.cfd.flow.jacobian import Jacobian
from indicial.cfd.flow.residual import MeshMotion, Residual, gather
from indicial.cfd.march.continuation import Standing, continuation
from indicial.cfd.march.convergence import ConvergenceHistory, Recorder
from indicial.cfd.march.ilu import BlockILU, Pattern
from indicial.cfd.march.krylov import Operator
from indicial.cfd.march.preconditioner import TwoLevel
from indicial.conventions import Array

Progress = Callable[[float], None]
"""Told the fraction done, 0 to 1."""

_START_CFL = 20.0
_NEARBY_CFL = 1e4
_FIRST_ORDER_TOLERANCE = 1e-3
_LARGEST_CHANGE = 0.4

_HARD = 30
"""Products of one step's linear solution beyond which its preconditioner no longer serves."""


@dataclass(frozen=True)
class SteadyState:
    """A converged state and how it was reached.

    Parameters
    ----------
    q : ndarray
        Primitive state (nc, 5).
    motion : MeshMotion
    history : ConvergenceHistory
    """

    q: Array
    motion: MeshMotion
    history: ConvergenceHistory


def local_time_step(grid: Grid, q: Array, motion: MeshMotion) -> Array:
    """Cell volume over the sum of its faces' signal speeds times areas, shape (nc,): the step of CFL 1."""
    i = grid.owner
    ug = grid.normal @ motion.velocity + (grid.moment @ motion.omega) / grid.area
    sound = np.sqrt(GAMMA * q[:, P] / q[:, 0])
    speed = (np.abs(np.sum(q[i, 1:4] * grid.normal, axis=1) - ug) + sound[i]) * grid.area
    ni = grid.n_interior
    total = np.bincount(i, speed, grid.n_cells) + np.bincount(grid.neighbour, speed[:ni], grid.n_cells)
    step: Array = grid.volume / (0.5 * total)
    return step


def residual_scale(residual: Residual, motion: MeshMotion) -> float:
    """Residual norm of still air under `motion`: the size of what the body does to the air."""
    still = np.broadcast_to(STILL_AIR, (residual.grid.n_cells, 5)).copy()
    scale = float(np.linalg.norm(residual(still, motion)))
    return scale if scale > 1e-13 else 1.0


def round_off(residual: Residual) -> float:
    """Residual norm that double precision leaves at the last state evaluated.

    ``eps || sum over a cell's faces of |F A| ||``: the fluxes of a converged state cancel, their last digits do not.
    With the far field hundreds of lengths away its large faces set it.
    """
    g = residual.grid
    sizes = np.empty((g.n_cells, 5))
    gather(np.abs(residual.face_flux), g.offsets, g.faces, np.ones_like(g.signs), sizes)
    return float(np.finfo(float).eps * np.linalg.norm(sizes))


def converge(
    residual: Residual,
    pattern: Pattern,
    motion: MeshMotion,
    start: Array | None = None,
    *,
    tolerance: float = 1e-10,
    iterations: int = 200,
    progress: Progress | None = None,
) -> SteadyState:
    """The steady state under a constant motion.

    Parameters
    ----------
    start : ndarray, optional
        A nearby state, taken straight into Newton's iteration; without it, an impulsive start from still air.
    tolerance : float
        Wanted fall of the residual, relative to that of still air under the same motion. Where round-off leaves more
        than that, what it leaves is wanted.
    iterations : int
        Newton steps allowed to each phase.

    Raises
    ------
    DivergenceError
        If it is not reached; carries the last good state.
    """
    scale = residual_scale(residual, motion)
    record = Recorder()
    if start is None:
        plain = Residual(residual.grid, second_order=False, far=residual.far)
        q = continuation(
            _SteadyEquations(plain, pattern, motion),
            Standing(np.broadcast_to(residual.far, (residual.grid.n_cells, 5)).copy(), _START_CFL, iterations),
            scale=scale,
            tolerance=_FIRST_ORDER_TOLERANCE,
            record=record,
        )
    else:
        q = start.copy()
    q = continuation(
        _SteadyEquations(residual, pattern, motion),
        Standing(q, _START_CFL if start is None else _NEARBY_CFL, iterations),
        scale=scale,
        tolerance=tolerance,
        record=record,
        progress=progress,
    )
    return SteadyState(q, motion, record.history(round_off(residual) / scale))


class _SteadyEquations:
    """``R(q; V_b, omega) = 0`` for the `continuation`."""

    name: ClassVar[str] = "steady"
    advice: ClassVar[str] = "a finer or smoother mesh, or a start from a nearby condition"

    def __init__(self, residual: Residual, pattern: Pattern, motion: MeshMotion) -> None:
        self.residual = residual
        self._motion = motion
        self._preconditioners = _Preconditioners(residual, pattern)

    def __call__(self, q: Array) -> Array:
        return self.residual(q, self._motion)

    def round_off(self) -> float:
        return round_off(self.residual)

    def linearise(self, q: Array, cfl: float) -> _SteadyJacobian:
        grid = self.residual.grid
        dt = cfl * local_time_step(grid, q, self._motion)
        mass = (grid.volume / dt)[:, None, None] * conservative_jacobian(q)
        return self._preconditioners.attach(_SteadyJacobian(Jacobian(self.residual, q, self._motion), mass))

    def update(self, q: Array, dq: Array) -> Array:
        return limited_update(q, dq)


class _SteadyJacobian:
    """``V/dtau dW/dq + J`` and its approximate inverse."""

    precondition: Operator

    def __init__(self, jacobian: Jacobian, mass: Array) -> None:
        self.jacobian, self.mass = jacobian, mass
        self.products = 0

    def apply(self, x: Array) -> Array:
        self.products += 1
        y: Array = self.jacobian.apply(x) + np.einsum("nij,nj->ni", self.mass, x)
        return y


class _Preconditioners:
    """The approximate inverse of each step: compact factors while they serve, then wide ones for as long as those do.

    Compact factors are cheap to make and are made for every step. On fine meshes they leave too much to GMRES; wide
    ones cost as much as many products, so they stay until a step shows that the flow has moved away from them.
    """

    def __init__(self, residual: Residual, compact: Pattern) -> None:
        self._residual, self._compact = residual, compact
        self._wide: Pattern | None = None
        self._kept: TwoLevel | None = None
        self._last: _SteadyJacobian | None = None

    def attach(self, linear: _SteadyJacobian) -> _SteadyJacobian:
        """Give the matrix its approximate inverse.

        Raises
        ------
        DivergenceError
            If that is singular.
        """
        hard = self._last is not None and self._last.products > _HARD and self._residual.second_order
        self._last = linear
        if hard:
            self._wide = self._wide or Pattern.wide(self._residual.grid)
            self._kept = None  # its memory goes before the next is made
            self._kept = TwoLevel(linear.jacobian, self._wide, linear.mass)
        linear.precondition = self._compact_factors(linear) if self._kept is None else self._kept.solve
        return linear

    def _compact_factors(self, linear: _SteadyJacobian) -> Operator:
        p = self._compact
        return BlockILU(p, linear.jacobian.compact_blocks(linear.mass, p.slots, p.diagonal, len(p.indices))).solve


def limited_update(q: Array, dq: Array) -> Array:
    """q + dq (..., 5), cell by cell shortened so that density and pressure change by at most a part."""
    ratio = np.maximum(np.abs(dq[..., RHO] / q[..., RHO]), np.abs(dq[..., P] / q[..., P]))
    factor = np.minimum(1.0, _LARGEST_CHANGE / np.maximum(ratio, 1e-300))
    updated: Array = q + factor[..., None] * dq
    return updated
