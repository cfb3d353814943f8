r"""Steady states by Newton-Krylov with pseudo-time continuation.

Each iteration solves ``(V/dtau dW/dq + J) dq = -R`` with the exact J. The pseudo-time step grows as the residual
falls (switched evolution relaxation, Mulder & van Leer 1985) until the iteration is Newton's own. An impulsive
start goes through the first-order scheme, which nothing upsets, to the second-order one.

On its way to its place a shock raises the residual, so a step may: only one that raises it threefold is taken back.
(Asked never to raise it, by a line search, the iteration takes up to three times the steps to a transonic flow.)
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from indicial.cfd.flow.gas import GAMMA, STILL_AIR, P, conservative_jacobian
from indicial.cfd.flow.grid import Grid
from indicial.cfd.flow.jacobian import Jacobian
from indicial.cfd.flow.residual import MeshMotion, Residual, gather
from indicial.cfd.march.convergence import ConvergenceHistory, Recorder
from indicial.cfd.march.ilu import BlockILU, Pattern
from indicial.cfd.march.krylov import KrylovResult, gmres
from indicial.conventions import Array
from indicial.errors import DivergenceError

log = logging.getLogger(__name__)

Progress = Callable[[float], None]
"""Told the fraction done, 0 to 1."""

_START_CFL = 20.0
_NEARBY_CFL = 1e4
_NEWTON_CFL = 1e8
_LEAST_CFL = 2e-3
_FIRST_ORDER_TOLERANCE = 1e-3
_LARGEST_RISE = 3.0
_LARGEST_CHANGE = 0.4


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
    second = _Continuation(residual, pattern, motion, scale, record, progress)
    if start is None:
        plain = Residual(residual.grid, second_order=False, far=residual.far)
        first = _Continuation(plain, pattern, motion, scale, record)
        q = np.broadcast_to(residual.far, (residual.grid.n_cells, 5)).copy()
        q = first.run(q, _FIRST_ORDER_TOLERANCE, _START_CFL, iterations)
        q = second.run(q, tolerance, _START_CFL, iterations)
    else:
        q = second.run(start.copy(), tolerance, _NEARBY_CFL, iterations)
    return SteadyState(q, motion, record.history(round_off(residual) / scale))


@dataclass
class _Continuation:
    """Pseudo-time continuation of one residual into Newton's iteration."""

    residual: Residual
    pattern: Pattern
    motion: MeshMotion
    scale: float
    record: Recorder
    progress: Progress | None = None

    def run(self, q: Array, tolerance: float, cfl: float, iterations: int) -> Array:
        """Newton steps from q until the residual is `tolerance` of the scale."""
        r, norm = self._evaluate(q)
        first = max(norm, 10.0 * tolerance)
        self._note(norm, 0.0)
        while norm > max(tolerance, round_off(self.residual) / self.scale):
            if iterations == 0 or cfl < _LEAST_CFL:
                raise self._divergence(q, r, norm, tolerance, cfl)
            iterations -= 1
            # Newton's last steps are worth accurate solutions, the last of all no more than what is wanted of it
            forcing = max(0.1 if cfl < 1e3 else 1e-2, 0.3 * tolerance / norm)
            solution = self._solve(q, r, cfl, forcing)
            if solution is None:
                cfl *= 0.1
                continue
            trial = limited_update(q, solution.x)
            r_trial, norm_trial = self._evaluate(trial)
            if not norm_trial < _LARGEST_RISE * norm:
                cfl *= 0.1
                continue
            self._note(norm_trial, cfl)
            # a step that the linear solver could not finish was too long
            solved = solution.relative_residual <= forcing
            cfl *= 1.2 * float(np.clip(norm / norm_trial, 0.3, 8.0)) if solved else 0.3
            cfl = min(cfl, _NEWTON_CFL)
            q, r, norm = trial, r_trial, norm_trial
            self._tell(np.log(first / norm) / np.log(first / tolerance))
        return q

    def _evaluate(self, q: Array) -> tuple[Array, float]:
        """Residual of q and its norm over the scale."""
        r = self.residual(q, self.motion)
        return r, float(np.linalg.norm(r)) / self.scale

    def _solve(self, q: Array, r: Array, cfl: float, forcing: float) -> KrylovResult | None:
        """The step of a pseudo-time step of size `cfl`; None if its matrix is singular."""
        grid, pattern = self.residual.grid, self.pattern
        dt = cfl * local_time_step(grid, q, self.motion)
        mass = (grid.volume / dt)[:, None, None] * conservative_jacobian(q)
        jacobian = Jacobian(self.residual, q, self.motion)
        blocks = jacobian.compact_blocks(mass, pattern.slots, pattern.diagonal, len(pattern.indices))
        try:
            ilu = BlockILU(pattern, blocks)
        except DivergenceError:
            return None

        def shifted(x: Array) -> Array:
            y: Array = jacobian.apply(x) + np.einsum("nij,nj->ni", mass, x)
            return y

        solution = gmres(shifted, ilu.solve, -r, forcing)
        self.record.products += solution.products
        return solution

    def _note(self, norm: float, cfl: float) -> None:
        self.record.note(norm, cfl, self.residual.second_order)
        log.debug("residual %.2e, CFL %.1e, %d products", norm, cfl, self.record.products)

    def _tell(self, fraction: float) -> None:
        if self.progress is not None:
            self.progress(float(np.clip(fraction, 0.0, 1.0)))

    def _divergence(self, q: Array, r: Array, norm: float, tolerance: float, cfl: float) -> DivergenceError:
        worst = int(np.argmax(np.sum((r / self.residual.grid.volume[:, None]) ** 2, axis=1)))
        why = (
            "no pseudo-time step is short enough; try a finer or smoother mesh"
            if cfl < _LEAST_CFL
            else "no more steps are allowed; allow more, or try a finer or smoother mesh"
        )
        return DivergenceError(
            f"the steady solution stopped at a residual of {norm:.1e} (wanted {tolerance:.1e}) after "
            f"{self.record.steps} Newton steps: {why}, or a start from a nearby condition",
            cell=worst,
            state=q,
        )


def limited_update(q: Array, dq: Array) -> Array:
    """q + dq, cell by cell shortened so that density and pressure change by at most a part."""
    ratio = np.maximum(np.abs(dq[:, 0] / q[:, 0]), np.abs(dq[:, P] / q[:, P]))
    factor = np.minimum(1.0, _LARGEST_CHANGE / np.maximum(ratio, 1e-300))
    updated: Array = q + factor[:, None] * dq
    return updated
