"""Periodic flows: the time-spectral equations solved for all instants together, by the continuation of steady states.

An oscillation of a few degrees is taken straight to the second-order scheme from the steady state at its mean; what
starts further off goes through the first-order one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from indicial.cfd.flow.residual import MeshMotion, Residual
from indicial.cfd.march.continuation import continuation
from indicial.cfd.march.convergence import ConvergenceHistory, Recorder
from indicial.cfd.march.ilu import Pattern
from indicial.cfd.march.steady import Progress, limited_update, residual_scale
from indicial.cfd.march.time_spectral import PeriodicJacobian, PeriodicResidual
from indicial.conventions import Array

_NEAR = 1e-2
"""Residual of a start from which the second-order scheme is taken at once."""
_START_CFL, _NEARBY_CFL = 20.0, 100.0


@dataclass(frozen=True)
class PeriodicState:
    """A converged periodic flow and how it was reached.

    Parameters
    ----------
    q : ndarray
        Primitive states at the N instants (N, nc, 5).
    history : ConvergenceHistory
        Residuals relative to those of still air under the same motion; products with the Jacobian of one instant,
        of which one with the coupled Jacobian makes N.
    """

    q: Array
    history: ConvergenceHistory


def converge_periodic(
    residual: Residual,
    pattern: Pattern,
    motions: Sequence[MeshMotion],
    omega: float,
    start: Array,
    *,
    tolerance: float = 1e-10,
    iterations: int = 200,
    progress: Progress | None = None,
) -> PeriodicState:
    """The periodic flow under `motions` at the N = 2h + 1 instants of a period ``2 pi / omega``.

    Parameters
    ----------
    start : ndarray
        A state to start from: one for all instants (nc, 5), or one for each (N, nc, 5). Far from the solution it is
        taken through the first-order scheme, as in an impulsive start.
    tolerance : float
        Wanted fall of the coupled residual, relative to that of still air under the same motion. Where round-off
        leaves more than that, what it leaves is wanted.
    iterations : int
        Newton steps allowed to each phase.

    Raises
    ------
    InputError
        If N is even or less than 3.
    DivergenceError
        If it is not reached; its `state` holds the last states (N, nc, 5).
    """
    equations = _PeriodicEquations(PeriodicResidual(residual, motions, omega), pattern)
    scale = float(np.linalg.norm([residual_scale(residual, motion) for motion in motions]))
    q = np.broadcast_to(start, (len(motions), *start.shape[-2:])).copy()
    record = Recorder()
    if float(np.linalg.norm(equations(q))) > _NEAR * scale:
        plain = Residual(residual.grid, second_order=False, far=residual.far)
        q = continuation(
            _PeriodicEquations(PeriodicResidual(plain, motions, omega), pattern),
            q,
            scale=scale,
            tolerance=_NEAR,
            cfl=_START_CFL,
            iterations=iterations,
            record=record,
        )
    q = continuation(
        equations,
        q,
        scale=scale,
        tolerance=tolerance,
        cfl=_NEARBY_CFL,
        iterations=iterations,
        record=record,
        progress=progress,
    )
    return PeriodicState(q, record.history(equations.round_off() / scale))


@dataclass(frozen=True)
class _PeriodicEquations:
    """F = 0 at all instants, for the `continuation`."""

    periodic: PeriodicResidual
    pattern: Pattern
    name: ClassVar[str] = "periodic"
    advice: ClassVar[str] = "fewer harmonics, a smaller amplitude or a smoother mesh"

    @property
    def residual(self) -> Residual:
        return self.periodic.residual

    def __call__(self, q: Array) -> Array:
        return self.periodic(q)

    def round_off(self) -> float:
        return self.periodic.round_off

    def linearise(self, q: Array, cfl: float) -> _Linearised:
        return _Linearised(self.periodic.linearise(q, 1.0 / (cfl * self.periodic.time_step(q))), self.pattern)

    def update(self, q: Array, dq: Array) -> Array:
        return limited_update(q, dq)


class _Linearised:
    """The coupled Jacobian with its preconditioner."""

    def __init__(self, jacobian: PeriodicJacobian, pattern: Pattern) -> None:
        self._jacobian = jacobian
        self.apply = jacobian.apply
        self.precondition = jacobian.preconditioner(pattern)

    @property
    def products(self) -> int:
        return self._jacobian.products
