r"""The lattice with section data behind the solver protocol: attached flow, stall, and what lies between."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from indicial.cfd.lattice.coupling import StripProblem, viscous_loads
from indicial.cfd.lattice.instant import Instant, StripLoads
from indicial.cfd.lattice.march import March, steady_instant
from indicial.cfd.lattice.panels import Lattice
from indicial.cfd.lattice.polars import NeuralFoil, Polar, PolarSource, mixed
from indicial.cfd.lattice.separation import SeparationLag, SeparationState, StripSections
from indicial.cfd.lattice.solver import LatticeSettings, LatticeSolver, jump_impulse
from indicial.cfd.lattice.spanwise import spanwise_mean
from indicial.cfd.lattice.steady_states import SteadyStrips, distinct, settle, starts
from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities
from indicial.errors import DivergenceError, InputError
from indicial.history import History
from indicial.motion import FlightCondition, Motion, Rates
from indicial.solver import SteadyLoads

VISCOSITY = 1.458e-6
"""Sutherland's constant of air [kg/(m s sqrt(K))]."""

SUBSTEP = 1.0
"""Largest step of the separation points, in the shorter of their time constants."""


_SUBSTEP_TOLERANCE = 1e-7


class ExtrapolationWarning(UserWarning):
    """A section met an incidence beyond the trusted range of its polar."""


@dataclass(frozen=True)
class SectionSettings:
    """How sections answer.

    Parameters
    ----------
    lag : SeparationLag
    start : str
        Which steady state motions and `steady` begin from, where there are several: "attached", "separated",
        "left attached" or "right attached".
    spread : float
        Chords of span over which the incidence that a separation point answers to is averaged; 0, the default, leaves
        each strip on its own. See `indicial.cfd.lattice.spanwise`.

    Raises
    ------
    InputError
        If the spread is negative or not finite.
    """

    lag: SeparationLag = field(default_factory=SeparationLag)
    start: str = "attached"
    spread: float = 0.0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.spread) and self.spread >= 0.0):
            raise InputError(f"spread is {self.spread} chords, must be finite and at least 0")


@dataclass(frozen=True)
class StripRecord:
    """What the strips did in a motion.

    Parameters
    ----------
    time : ndarray
        [s], shape (n,).
    alpha, point, circulation : ndarray
        Incidence met [rad], separation point, circulation [m^2/s], shape (n, S).
    outside : ndarray
        Which strips were beyond the trusted range of their polars (booleans), shape (n, S).
    """

    time: Array
    alpha: Array
    point: Array
    circulation: Array
    outside: Array


class SectionLatticeSolver:
    """Lifting surfaces whose strips have the lift, drag and moment of viscous sections.

    Parameters
    ----------
    lattice : Lattice
        Cut with ``camber=False``: camber is in the section data.
    reference : ReferenceQuantities
    polars : callable, optional
        Gives the polar of a section at a Reynolds number; `NeuralFoil` if not given, or `PolarTables`.
    settings : SectionSettings, optional
    lattice_settings : LatticeSettings, optional

    Raises
    ------
    InputError
        If the lattice has camber.
    """

    def __init__(
        self,
        lattice: Lattice,
        reference: ReferenceQuantities,
        polars: PolarSource | None = None,
        settings: SectionSettings = SectionSettings(),
        lattice_settings: LatticeSettings | None = None,
    ) -> None:
        if lattice.camber:
            raise InputError("section data bring the camber: cut the lattice with camber=False")
        self.settings = settings
        self.attached = LatticeSolver(lattice, reference, lattice_settings or LatticeSettings())
        self._polars = polars or NeuralFoil()
        self._sections = lru_cache(maxsize=4)(self._sections_at)
        self.record: StripRecord | None = None

    @property
    def lattice(self) -> Lattice:
        """Its panels."""
        return self.attached.lattice

    @property
    def reference(self) -> ReferenceQuantities:
        """What the loads are made dimensionless with."""
        return self.attached.reference

    def sections(self, condition: FlightCondition) -> StripSections:
        """Tables of all strips at the Reynolds numbers of a flight condition, on their own chords.

        Raises
        ------
        InputError
            If a section has no polar data.
        """
        return self._sections(round(unit_reynolds(condition), 3))

    def _sections_at(self, unit: float) -> StripSections:
        strips = self.lattice.strips
        known: dict[tuple[str, float], Polar] = {}
        polars = []
        for chord, (inner, outer, weight) in zip(strips.chord, strips.sections, strict=True):
            reynolds = float(f"{unit * chord:.6g}")
            parts = []
            for section, share in ((inner, 1.0 - weight), (outer, weight)):
                key = (section.name, reynolds)
                if share > 0.0 and key not in known:
                    known[key] = self._polars(section, reynolds)
                if share > 0.0:
                    parts.append((known[key], share))
            polars.append(mixed(parts))
        return StripSections.of(polars, spanwise_mean(strips, self.settings.spread))

    def steady_states(
        self, condition: FlightCondition, rates: Rates = Rates(), *, more: Sequence[Array] = ()
    ) -> tuple[SteadyStrips, ...]:
        """All distinct steady states that the starts lead to, first the one of the settings' start if it leads to any.

        Parameters
        ----------
        condition : FlightCondition
        rates : Rates
        more : sequence of ndarray
            Separation points (S,) to start from besides, such as those of a neighbouring condition.

        Raises
        ------
        DivergenceError
            If none is found.
        """
        instant = self._steady_instant(condition, rates)
        problem, sections = StripProblem.at(instant), self.sections(condition)
        listed = {**starts(instant), **{f"given {n}": point for n, point in enumerate(more)}}
        if self.settings.start not in listed:
            raise InputError(f"no start {self.settings.start!r}; there are {', '.join(listed)}")
        order = [self.settings.start, *(name for name in listed if name != self.settings.start)]
        found, failed = [], ""
        for name in order:
            try:
                found.append(settle(problem, sections, listed[name], name, self.settings.lag))
            except DivergenceError as error:
                failed = str(error)
        if not found:
            raise DivergenceError(failed)
        return distinct(found)

    def steady(self, condition: FlightCondition, rates: Rates = Rates()) -> SteadyLoads:
        """Loads of the steady state that the start of the settings leads to.

        ``convergence`` says how many states there are (`states`), the least and largest Cl among them, and how many
        strips are beyond the trusted range of their polars (`extrapolated`); of the latter a warning is given too.

        Raises
        ------
        InputError, DivergenceError
            For a section without data, a Mach number beyond the linear rule; if no steady state is found.
        """
        states = self.steady_states(condition, rates)
        loads = [self.state_loads(condition, rates, state) for state in states]
        outside = self.sections(condition).outside(states[0].alpha)
        self._warn(outside, f"alpha {np.degrees(condition.alpha):.1f} deg")
        told: dict[str, float | int | str] = {
            "start": states[0].start,
            "states": len(states),
            "least_Cl": float(min(one[3] for one in loads)),
            "largest_Cl": float(max(one[3] for one in loads)),
            "growth": states[0].growth,
            "extrapolated": int(np.count_nonzero(outside)),
            "iterations": states[0].iterations,
        }
        return SteadyLoads(loads[0], condition, rates, self.reference, told)

    def state_loads(self, condition: FlightCondition, rates: Rates, state: SteadyStrips) -> Array:
        """The six coefficients of one steady state, shape (6,)."""
        instant = self._steady_instant(condition, rates)
        problem = StripProblem.at(instant)
        circulation = self._panels(instant, problem, state.across, state.circulation)
        return self._coefficients(instant, circulation, condition, state.across, state.point)

    def unsteady(self, condition: FlightCondition, motion: Motion, times: ArrayLike) -> History:
        """Loads at `times` [s], the steps of the wake; the separation points take smaller ones.

        `record` then holds what the strips did. The history's provenance says how many strips were beyond the trusted
        range of their polars at worst (`extrapolated`), and a warning is given. The loads at t = 0+ are told as
        `LatticeSolver.unsteady` tells them.

        Raises
        ------
        InputError, DivergenceError
            For bad times, a section without data; if lattice and sections do not meet.
        """
        t = np.asarray(times, dtype=float)
        if t.ndim != 1 or t.size < 1 or t[0] != 0.0 or np.any(np.diff(t) <= 0.0) or not np.all(np.isfinite(t)):
            raise InputError("times must be finite, start at 0 and increase")
        run = SectionMarch(self, condition, motion)
        velocity, rate = motion.velocity(t), motion.rate(t)
        with threadpool_limits(limits=1, user_api="blas"):  # small matrices: threads would only fight
            loads = np.array([run.step(float(t[n]), velocity[n], rate[n]) for n in range(t.size)])
        if t.size > 1:
            loads[0] = run.first_loads(float(t[1]))
        impulse = run.impulse * 2.0 * condition.speed / self.reference.length
        self.record = run.record(t)
        self._warn(np.any(self.record.outside, axis=0), f"motion {motion.describe()['kind']!r}")
        return History(
            time=t,
            coefficients=loads,
            velocity=velocity,
            rate=rate,
            before=run.before,
            condition=condition,
            reference=self.reference,
            motion=motion.describe(),
            provenance={
                **self._provenance(int(np.max(np.sum(self.record.outside, axis=1)))),
                "impulse": dict(zip(COEFFICIENTS, impulse.tolist(), strict=True)),
            },
        )

    def _steady_instant(self, condition: FlightCondition, rates: Rates) -> Instant:
        motion = self.attached.motion(condition.velocity, rates.as_array())
        return steady_instant(self.attached.influence(condition), motion, self.attached.frozen(condition))

    def _panels(self, instant: Instant, problem: StripProblem, across: Array, circulation: Array) -> Array:
        """Circulation of all panels (P,)."""
        wash = problem.wash(across, circulation)
        return instant.circulation(wash[self.lattice.strip])

    def _coefficients(
        self,
        instant: Instant,
        circulation: Array,
        condition: FlightCondition,
        across: Array,
        point: Array,
        rate: Array | None = None,
    ) -> Array:
        lattice = instant.loads(circulation, rate)
        viscous = viscous_loads(instant, self.sections(condition), across, point)
        both = StripLoads(lattice.force + viscous.force, lattice.moment + viscous.moment)
        return self.attached.coefficients(both, condition)

    def _warn(self, outside: Array, where: str) -> None:
        count = int(np.count_nonzero(outside))
        if count:
            text = f"{where}: {count} of {outside.size} strips meet incidences beyond the trusted range of their polars"
            warnings.warn(text, ExtrapolationWarning, stacklevel=3)

    def _provenance(self, outside: int) -> dict[str, Any]:
        return {
            **self.attached.provenance,
            "sections": type(self._polars).__name__,
            "delay": self.settings.lag.delay,
            "response": self.settings.lag.response,
            "start": self.settings.start,
            "spread": self.settings.spread,
            "extrapolated": outside,
        }


class SectionMarch:
    """One motion: wake, circulation and separation points in step; `step` by `step`, whatever decides the next."""

    def __init__(self, solver: SectionLatticeSolver, condition: FlightCondition, motion: Motion) -> None:
        self._solver, self._condition = solver, condition
        attached = solver.attached
        self._sections = solver.sections(condition)
        before = attached.motion(motion.velocity_before, motion.rate_before)
        influence, frozen = attached.influence(condition), attached.frozen(condition)
        self._start = steady_instant(influence, before, frozen)
        self._problem = StripProblem.at(self._start)
        state = settle(
            self._problem,
            self._sections,
            starts(self._start)[solver.settings.start],
            solver.settings.start,
            solver.settings.lag,
        )
        self._across = state.across
        self.state = SeparationState(self._sections.seen(state.alpha), state.point)
        circulation = solver._panels(self._start, self._problem, state.across, state.circulation)
        self.before = solver._coefficients(self._start, circulation, condition, state.across, state.point)
        self._march = March(influence, before, circulation, frozen)
        self._time = 0.0
        self._kept: list[tuple[Instant, Array, Array, Array]] = []
        self._rows: list[tuple[Array, Array, Array]] = []

    def step(self, time: float, velocity: Array, rate: Array) -> Array:
        """Go on to a time [s]; the six coefficients."""
        solver = self._solver
        instant = self._march.advance(time, solver.attached.motion(velocity, rate))
        problem = StripProblem.at(instant)
        gamma = self._follow(problem, time - self._time)
        circulation = solver._panels(instant, problem, self._across, gamma)
        self._march.accept(circulation)
        self._problem, self._time = problem, time
        alpha = problem.incidence(self._across)
        self._rows.append((alpha, self.state.point, gamma))
        if len(self._kept) < 2:
            self._kept.append((instant, circulation, self._across, self.state.point))
        return solver._coefficients(instant, circulation, self._condition, self._across, self.state.point)

    def _follow(self, problem: StripProblem, step: float) -> Array:
        """Separation points and wind across the chords up to the next instant; its Gamma (S,)."""
        if step <= 0.0:
            self._across, gamma = problem.solve(self._sections, self._across, self.state.point)
            return gamma
        lag, chord = self._solver.settings.lag, self._solver.lattice.strips.chord
        speed = np.hypot(problem.along, self._across)
        travelled = speed * step / chord
        count = int(np.ceil(float(np.max(travelled)) / (SUBSTEP * min(lag.delay, lag.response))))
        for n in range(1, count + 1):
            # the incidence midway decides
            middle = self._problem.between(problem, (n - 0.5) / count)
            self._across, _ = middle.solve(self._sections, self._across, self.state.point, _SUBSTEP_TOLERANCE)
            alpha = middle.incidence(self._across)
            self.state = self._sections.advance(self.state, alpha, travelled / count, lag)
        self._across, gamma = problem.solve(self._sections, self._across, self.state.point)
        return gamma

    def first_loads(self, step: float) -> Array:
        """Loads at t = 0+, with the rate of change of the first step."""
        (first, after, across, point), (_, later, _, _) = self._kept
        return self._solver._coefficients(first, after, self._condition, across, point, (later - after) / step)

    @property
    def impulse(self) -> Array:
        """Of the jump at t = 0, coefficients times seconds, shape (6,)."""
        return self._solver.attached.coefficients(jump_impulse(self._kept[0][0], self._start), self._condition)

    def record(self, times: Array) -> StripRecord:
        alpha, point, gamma = (np.array(column) for column in zip(*self._rows, strict=True))
        outside = np.array([self._sections.outside(one) for one in alpha])
        return StripRecord(times, alpha, point, gamma, outside)


def unit_reynolds(condition: FlightCondition) -> float:
    """Reynolds number per metre [1/m], with Sutherland's viscosity."""
    viscosity = VISCOSITY * condition.temperature**1.5 / (condition.temperature + 110.4)
    return float(condition.density * condition.speed / viscosity)
