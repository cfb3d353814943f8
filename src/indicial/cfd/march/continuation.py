r"""Pseudo-time continuation into Newton's iteration: the one loop behind steady and periodic flows.

For equations ``F(q) = 0`` each step solves ``(V/dtau dW/dq + dF/dq) dq = -F`` with the exact Jacobian, by GMRES. The
pseudo-time step grows as the residual falls (switched evolution relaxation, Mulder & van Leer 1985) until the
iteration is Newton's own.

On its way to its place a shock raises the residual, so a step may: only one that raises it threefold is taken back.
(Asked never to raise it, by a line search, the iteration takes up to three times the steps to a transonic flow.)
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from indicial.cfd.flow.residual import Residual
from indicial.cfd.march.convergence import Recorder
from indicial.cfd.march.krylov import KrylovResult, gmres
from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError

log = logging.getLogger(__name__)

_NEWTON_CFL = 1e8
"""Largest pseudo-time step, in signal crossings of a cell: Newton's iteration to all intents."""

_LEAST_CFL = 2e-3
_LARGEST_RISE = 3.0


class Linearised(Protocol):
    """``A = V/dtau dW/dq + dF/dq`` at one state, with an approximate inverse."""

    @property
    def products(self) -> int:
        """Products with the Jacobian of one flow state spent so far, those of the preconditioner included."""

    def apply(self, x: Array) -> Array:
        """``A x``."""

    def precondition(self, b: Array) -> Array:
        """About ``A^-1 b``."""


class FlowEquations(Protocol):
    """``F(q) = 0`` for one flow state, (nc, 5), or several together, (N, nc, 5)."""

    @property
    def name(self) -> str:
        """As in "the steady solution"."""

    @property
    def advice(self) -> str:
        """What else to try where the iteration fails."""

    @property
    def residual(self) -> Residual:
        """Of one flow state."""

    def __call__(self, q: Array) -> Array:
        """F, of the shape of q."""

    def round_off(self) -> float:
        """Norm of F that double precision leaves at the last q evaluated."""

    def linearise(self, q: Array, cfl: float) -> Linearised:
        """With the pseudo-time step that is `cfl` times the local one; DivergenceError if that is singular."""

    def update(self, q: Array, dq: Array) -> Array:
        """``q + dq``, shortened where it must be for a state to remain a state."""


@dataclass(frozen=True)
class Standing:
    """Where an iteration stands: all that it needs to go on as if it had never stopped.

    Parameters
    ----------
    q : ndarray
        State or states.
    cfl : float
        Pseudo-time step to go on with, in signal crossings of a cell.
    iterations : int
        Newton steps allowed from here, those taken back included.
    first : float, optional
        Residual that it started from; None at the start itself.
    """

    q: Array
    cfl: float
    iterations: int
    first: float | None = None


def continuation(
    equations: FlowEquations,
    start: Standing,
    *,
    scale: float,
    tolerance: float,
    record: Recorder,
    progress: Callable[[float], None] | None = None,
    keep: Callable[[Standing], None] | None = None,
) -> Array:
    """Newton steps from a start until the norm of F is `tolerance` of `scale`, or what round-off leaves of it.

    Parameters
    ----------
    record : Recorder
        Told of every state that the iteration stands on, and of all products with J.
    progress : callable, optional
        Told the fraction done, 0 to 1.
    keep : callable, optional
        Told after each step where the iteration stands.

    Raises
    ------
    InputError
        If F is not finite at the start.
    DivergenceError
        If it is not reached; carries the last good state.
    """

    def evaluate(q: Array) -> tuple[Array, float]:
        f = equations(q)
        # never zero: its logarithm and its inverse are taken
        return f, float(np.maximum(np.linalg.norm(f) / scale, np.finfo(float).tiny))

    def note(norm: float, cfl: float) -> None:
        record.note(norm, cfl, equations.residual.second_order)
        log.debug("residual %.2e, CFL %.1e, %d products", norm, cfl, record.products)

    q, cfl, iterations = start.q, start.cfl, start.iterations
    f, norm = evaluate(q)
    if not np.isfinite(norm):
        raise InputError(f"the {equations.name} solution cannot start: the residual of its first state is not finite")
    if start.first is None:
        note(norm, 0.0)
    first = norm if start.first is None else start.first
    while norm > max(tolerance, equations.round_off() / scale):
        if iterations == 0 or cfl < _LEAST_CFL:
            raise _failure(equations, q, f, norm, tolerance, cfl, record.steps)
        iterations -= 1
        # Newton's last steps are worth accurate solutions, the last of all no more than what is wanted of it
        forcing = max(0.1 if cfl < 1e3 else 1e-2, 0.3 * tolerance / norm)
        solution = _solve(equations, q, f, cfl, forcing, record)
        if solution is None:
            cfl *= 0.1
            continue
        trial = equations.update(q, solution.x)
        f_trial, norm_trial = evaluate(trial)
        if not norm_trial < _LARGEST_RISE * norm:
            cfl *= 0.1
            continue
        note(norm_trial, cfl)
        # a step that the linear solver could not finish was too long
        solved = solution.relative_residual <= forcing
        cfl *= 1.2 * float(np.clip(norm / norm_trial, 0.3, 8.0)) if solved else 0.3
        cfl = min(cfl, _NEWTON_CFL)
        q, f, norm = trial, f_trial, norm_trial
        if keep is not None:
            keep(Standing(q, cfl, iterations, first))
        if progress is not None:
            whole = np.log(max(first / tolerance, 10.0))
            progress(float(np.clip(np.log(first / norm) / whole, 0.0, 1.0)))
    return q


def _solve(
    equations: FlowEquations, q: Array, f: Array, cfl: float, forcing: float, record: Recorder
) -> KrylovResult | None:
    """The step of one pseudo-time step; None if its equations are singular."""
    try:
        linear = equations.linearise(q, cfl)
    except DivergenceError:
        return None
    try:
        return gmres(linear.apply, linear.precondition, -f, forcing)
    except DivergenceError:
        return None
    finally:
        record.products += linear.products


def _failure(
    equations: FlowEquations, q: Array, f: Array, norm: float, tolerance: float, cfl: float, steps: int
) -> DivergenceError:
    why = (
        "no pseudo-time step is short enough; try"
        if cfl < _LEAST_CFL
        else "no more steps are allowed; allow more, or try"
    )
    # of all states together, per volume
    density = f.reshape(-1, *f.shape[-2:]) / equations.residual.grid.volume[:, None]
    return DivergenceError(
        f"the {equations.name} solution stopped at a residual of {norm:.1e} (wanted {tolerance:.1e}) after {steps} "
        f"Newton steps: {why} {equations.advice}",
        cell=int(np.argmax(np.sum(density**2, axis=(0, 2)))),
        state=q,
    )
