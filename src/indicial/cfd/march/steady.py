r"""Steady states by Newton-Krylov with pseudo-time continuation.

Each iteration solves ``(V/dtau dW/dq + J) dq = -R`` with the exact J. The pseudo-time step grows as the residual
falls (switched evolution relaxation, Mulder & van Leer 1985) until the iteration is Newton's own. An impulsive
start goes through the first-order scheme, which nothing upsets, to the second-order one.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from indicial.cfd.flow.gas import GAMMA, STILL_AIR, P, conservative_jacobian
from indicial.cfd.flow.grid import Grid
from indicial.cfd.flow.jacobian import Jacobian
from indicial.cfd.flow.residual import MeshMotion, Residual
from indicial.cfd.march.ilu import BlockILU, Pattern
from indicial.cfd.march.krylov import gmres
from indicial.conventions import Array
from indicial.errors import DivergenceError

log = logging.getLogger(__name__)

Progress = Callable[[float], None]
"""Told the fraction done, 0 to 1."""

_NEWTON_CFL = 1e8
_LARGEST_CHANGE = 0.4


@dataclass(frozen=True)
class SteadyState:
    """A converged state and how it was reached.

    Parameters
    ----------
    q : ndarray
        Primitive state (nc, 5).
    motion : MeshMotion
    residuals : ndarray
        Residual norm after each iteration, relative to that of still air under the same motion.
    products : int
        Products with J spent.
    """

    q: Array
    motion: MeshMotion
    residuals: Array
    products: int


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


def converge(
    residual: Residual,
    pattern: Pattern,
    motion: MeshMotion,
    start: Array | None = None,
    *,
    tolerance: float = 1e-9,
    iterations: int = 120,
    progress: Progress | None = None,
) -> SteadyState:
    """The steady state under a constant motion.

    Parameters
    ----------
    start : ndarray, optional
        A nearby state, taken straight into Newton's iteration; without it, an impulsive start from still air.
    tolerance : float
        Wanted fall of the residual, relative to that of still air under the same motion.

    Raises
    ------
    DivergenceError
        If it is not reached.
    """
    scale = residual_scale(residual, motion)
    norms: list[float] = []
    spent = 0
    if start is None:
        first = Residual(residual.grid, second_order=False, far=residual.far)
        q = np.broadcast_to(residual.far, (residual.grid.n_cells, 5)).copy()
        q, spent = _iterate(first, pattern, q, motion, scale, 1e-3, 20.0, iterations, norms, None)
        q, more = _iterate(residual, pattern, q, motion, scale, tolerance, 20.0, iterations, norms, progress)
    else:
        q, more = _iterate(residual, pattern, start.copy(), motion, scale, tolerance, 1e4, iterations, norms, progress)
    return SteadyState(q, motion, np.array(norms), spent + more)


def _iterate(
    residual: Residual,
    pattern: Pattern,
    q: Array,
    motion: MeshMotion,
    scale: float,
    tolerance: float,
    cfl: float,
    iterations: int,
    norms: list[float],
    progress: Progress | None,
) -> tuple[Array, int]:
    """Newton steps from q until the residual is `tolerance` of `scale`; returns the state and the products spent."""
    volume = residual.grid.volume
    r = residual(q, motion)
    norm = float(np.linalg.norm(r)) / scale
    first, lowest_cfl, spent = max(norm, 10.0 * tolerance), cfl, 0
    norms.append(norm)
    while norm > tolerance and iterations > 0:
        iterations -= 1
        dt = cfl * local_time_step(residual.grid, q, motion)
        mass = (volume / dt)[:, None, None] * conservative_jacobian(q)
        jacobian = Jacobian(residual, q, motion)
        blocks = jacobian.compact_blocks(mass, pattern.slots, pattern.diagonal, len(pattern.indices))
        ilu = BlockILU(pattern, blocks)
        forcing = 0.1 if cfl < 1e3 else 1e-2

        def shifted(x: Array, mass: Array = mass, jacobian: Jacobian = jacobian) -> Array:
            y: Array = jacobian.apply(x) + np.einsum("nij,nj->ni", mass, x)
            return y

        solution = gmres(shifted, ilu.solve, -r, forcing)
        spent += solution.products
        trial = limited_update(q, solution.x)
        r_trial = residual(trial, motion)
        norm_trial = float(np.linalg.norm(r_trial)) / scale
        log.debug("residual %.2e, CFL %.1e, %d products", norm_trial, cfl, solution.products)
        if np.isfinite(norm_trial) and norm_trial < 3.0 * norm:
            # a step that the linear solver could not finish was too long
            solved = solution.relative_residual <= forcing
            cfl *= 1.2 * float(np.clip(norm / norm_trial, 0.3, 8.0)) if solved else 0.3
            cfl = min(cfl, _NEWTON_CFL)
            q, r, norm = trial, r_trial, norm_trial
            norms.append(norm)
            if progress is not None:
                progress(
                    float(np.clip(np.log(first / norm) / np.log(first / tolerance), 0.0, 1.0)) if norm < first else 0.0
                )
        else:
            cfl *= 0.1
            if cfl < 1e-4 * lowest_cfl:
                break
    if norm > tolerance:
        worst = int(np.argmax(np.sum((r / volume[:, None]) ** 2, axis=1)))
        raise DivergenceError(
            f"the steady solution stopped at a residual of {norm:.1e} (wanted {tolerance:.1e}) after {len(norms)} "
            "iterations; try a finer or smoother mesh, or a start from a nearby condition",
            cell=worst,
            state=q,
        )
    return q, spent


def limited_update(q: Array, dq: Array) -> Array:
    """q + dq, cell by cell shortened so that density and pressure change by at most a part."""
    ratio = np.maximum(np.abs(dq[:, 0] / q[:, 0]), np.abs(dq[:, P] / q[:, P]))
    factor = np.minimum(1.0, _LARGEST_CHANGE / np.maximum(ratio, 1e-300))
    updated: Array = q + factor[:, None] * dq
    return updated
