"""Periodic flows: the time-spectral equations solved for all instants together, by the continuation of steady states.

One state to start from goes through the first-order scheme unless it is near the solution; the flow that fewer
harmonics gave is interpolated in time and taken straight into the second-order scheme.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from indicial.cfd.flow.gas import RHO, P
from indicial.cfd.flow.residual import MeshMotion, Residual
from indicial.cfd.march.continuation import Standing, continuation
from indicial.cfd.march.convergence import ConvergenceHistory, Recorder
from indicial.cfd.march.ilu import Pattern
from indicial.cfd.march.steady import Progress, limited_update, residual_scale
from indicial.cfd.march.time_spectral import PeriodicJacobian, PeriodicResidual, resample
from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.files import Checkpoint

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
    checkpoint: Checkpoint | None = None,
) -> PeriodicState:
    """The periodic flow under `motions` at the N = 2h + 1 instants of a period ``2 pi / omega``.

    Parameters
    ----------
    start : ndarray
        One state (nc, 5), which far from the solution is taken through the first-order scheme, as in an impulsive
        start; or the flow that fewer or as many harmonics gave, at its own instants (2m + 1, nc, 5), which is
        interpolated in time and taken straight into the second-order scheme.
    tolerance : float
        Wanted fall of the coupled residual, relative to that of still air under the same motion. Where round-off
        leaves more than that, what it leaves is wanted.
    iterations : int
        Newton steps allowed to each phase.
    checkpoint : Checkpoint, optional
        Where the iteration keeps where it stands; one that was killed goes on from there, step by step as if it never
        had been.

    Raises
    ------
    InputError
        If N is even or less than 3, or `start` is at an even number of instants or has, between them, a density or
        pressure that is not positive.
    DivergenceError
        If it is not reached; its `state` holds the last states (N, nc, 5).
    """
    equations = _PeriodicEquations(PeriodicResidual(residual, motions, omega), pattern)
    scale = float(np.linalg.norm([residual_scale(residual, motion) for motion in motions]))
    kept = _load(checkpoint)
    if kept is not None:
        at, record = kept
        far_off = not record.second_order
    else:
        q = _at_instants(start, len(motions))
        far_off = start.ndim == 2 and bool(np.linalg.norm(equations(q)) > _NEAR * scale)
        at, record = Standing(q, _START_CFL if far_off else _NEARBY_CFL, iterations), Recorder()
    keep = partial(_save, checkpoint, record) if checkpoint is not None else None
    try:
        if far_off:
            plain = Residual(residual.grid, second_order=False, far=residual.far)
            first = _PeriodicEquations(PeriodicResidual(plain, motions, omega), pattern)
            q = continuation(first, at, scale=scale, tolerance=_NEAR, record=record, keep=keep)
            at = Standing(q, _NEARBY_CFL, iterations)
        q = continuation(equations, at, scale=scale, tolerance=tolerance, record=record, progress=progress, keep=keep)
    except DivergenceError:
        _remove(checkpoint)
        raise
    _remove(checkpoint)
    return PeriodicState(q, record.history(equations.round_off() / scale))


def _at_instants(start: Array, count: int) -> Array:
    """States at `count` instants from one state, or from those at the instants of another number of harmonics."""
    if start.ndim == 2:
        return np.broadcast_to(start, (count, *start.shape)).copy()
    if len(start) % 2 == 0:
        raise InputError(f"a periodic start at {len(start)} instants: their number must be odd")
    q = resample(start, count // 2)
    if not np.all(q[..., [RHO, P]] > 0.0):
        raise InputError(
            f"the start at {len(start)} instants has no positive density and pressure between them: "
            "start from one state, or from more harmonics"
        )
    return q


def _save(checkpoint: Checkpoint, record: Recorder, at: Standing) -> None:
    """Keep where the iteration stands and how it came there, if it is time to."""
    checkpoint.save_if_due(
        q=at.q, standing=np.array([at.cfl, at.iterations, at.first]), **record.history(0.0).to_arrays()
    )


def _load(checkpoint: Checkpoint | None) -> tuple[Standing, Recorder] | None:
    """What `_save` kept, if anything."""
    stored = checkpoint.load() if checkpoint is not None else None
    if stored is None:
        return None
    cfl, iterations, first = stored["standing"].tolist()
    record = Recorder.of(ConvergenceHistory.from_arrays(stored))
    return Standing(stored["q"], cfl, int(iterations), first), record


def _remove(checkpoint: Checkpoint | None) -> None:
    """The iteration is at its end, good or bad: nothing to go on with."""
    if checkpoint is not None:
        checkpoint.remove()


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
