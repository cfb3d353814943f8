"""A missile-like linear system with known answers, as the solver of a pipeline run: seconds instead of minutes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from indicial.cfd import ConvergenceHistory
from indicial.conventions import Array, ReferenceQuantities
from indicial.errors import DivergenceError
from indicial.frequency import FrequencyResponse
from indicial.history import History
from indicial.motion import FlightCondition, Motion, Rates
from indicial.solver import Solver, SteadyLoads
from rom.linearised import DenseFlow
from theory.linear import LinearSystem

_COLUMNS = ("alpha", "beta", "p", "q", "r")


def missile(reference: ReferenceQuantities) -> LinearSystem:
    """Loads about the size of a finned missile's at M 2: settled values and two lags, symmetric in pitch and yaw."""
    poles = np.array([-0.2, -0.5])
    settled = np.zeros((6, 5))
    settled[2, 0], settled[4, 0] = 11.0, -25.0  # CN, Cm with alpha
    settled[2, 3], settled[4, 3] = 90.0, -330.0  # with q
    settled[1, 1], settled[5, 1] = -11.0, 25.0  # CY, Cn with beta
    settled[1, 4], settled[5, 4] = 90.0, -330.0  # with r
    settled[3, 2] = -20.0  # Cl with p
    lagging = np.array([0.3, 0.2])  # parts of the settled value that come late
    b = np.repeat(-poles, 5)[:, None] * np.tile(np.eye(5), (2, 1))
    c = np.concatenate([part * settled for part in lagging], axis=1)
    d = (1.0 - lagging.sum()) * settled
    offset = np.array([0.35, 0.0, 0.0, 0.0, 0.0, 0.0])
    return LinearSystem(reference, np.repeat(poles, 5), b, c, d, offset)


class _Flow(DenseFlow):
    @property
    def baseline(self) -> Array:
        return missile(self.reference).offset


def longitudinal_flow(system: LinearSystem, condition: FlightCondition) -> DenseFlow:
    """What alpha and q do to CA, CN and Cm."""
    columns, rows = [_COLUMNS.index(name) for name in ("alpha", "q")], [0, 2, 4]
    moved = np.flatnonzero(np.any(system.b[:, columns] != 0.0, axis=1))
    return _Flow(
        mass=np.eye(moved.size),
        jacobian=np.diag(-system.poles[moved]),
        b=-system.b[np.ix_(moved, columns)],
        c=system.c[np.ix_(rows, moved)],
        d=system.d[np.ix_(rows, columns)],
        outputs=("CA", "CN", "Cm"),
        condition=condition,
        reference=system.reference,
    )


@dataclass(frozen=True)
class Oracle:
    """A `SolverFactory` of that system, which writes down every experiment that is really performed."""

    reference: ReferenceQuantities
    log: Path
    fails_on: str = ""

    def key(self) -> str:
        return hashlib.sha256(repr(self.reference).encode()).hexdigest()

    def build(self, whole: bool, progress: Callable[[float], None]) -> Solver:
        return _Logged(missile(self.reference), self.log, self.fails_on, whole, progress)


@dataclass(frozen=True)
class _Logged:
    solver: LinearSystem
    log: Path
    fails_on: str
    whole: bool
    progress: Callable[[float], None]

    @property
    def reference(self) -> ReferenceQuantities:
        return self.solver.reference

    def steady(self, condition: FlightCondition, rates: Rates = Rates()) -> SteadyLoads:
        self._note("steady")
        return self.solver.steady(condition, rates)

    def unsteady(self, condition: FlightCondition, motion: Motion, times: Array) -> History:
        self._note(str(motion.describe()["kind"]))
        return self.solver.unsteady(condition, motion, times)

    def frequency_response(
        self, condition: FlightCondition, k: ArrayLike = (), inputs: tuple[str, ...] | None = None
    ) -> FrequencyResponse:
        self._note("frequency_response")
        system, wanted, ks = self.solver, inputs or _COLUMNS, np.atleast_1d(np.asarray(k, dtype=float))
        columns = [_COLUMNS.index(name) for name in wanted]
        return FrequencyResponse(
            k=ks,
            inputs=wanted,
            values=np.array([system.transfer(one)[:, columns] for one in ks]),
            static=system.transfer(0.0).real[:, columns],
            slope=system.slope()[:, columns],
            direct=system.d[:, columns],
            baseline=system.offset,
            condition=condition,
            reference=system.reference,
        )

    def linearise(self, condition: FlightCondition) -> tuple[DenseFlow, ...]:
        self._note("projection")
        return (longitudinal_flow(self.solver, condition),)

    def convergence(self, condition: FlightCondition, rates: Rates = Rates()) -> ConvergenceHistory:
        return ConvergenceHistory(
            np.logspace(0, -9, 10), np.full(10, 1e8), np.arange(10), np.ones(10, dtype=bool), 1e-15
        )

    def _note(self, what: str) -> None:
        self.progress(0.5)
        with self.log.open("a") as file:
            file.write(f"{what} {'whole' if self.whole else 'half'}\n")
        if what == self.fails_on:
            raise DivergenceError("residual 1e+10 at step 3 of 9; try a smaller time step")
