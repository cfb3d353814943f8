r"""Output error for any flight model and several records at once: the engine.

With v the residuals of all records in standard deviations, made white by what they remember (`coloured`), and priors,

    J = 1/2 |v|^2 + sum (theta_i - m_i)^2 / (2 s_i^2)

is minimised by damped Gauss-Newton steps with exact sensitivities (`sensitivity`). The noise of a channel is a factor,
common to all records, on its stated standard deviation, ``sum v^2/(n - h)`` with h the channel's leverage. First it is
taken for white; if the residuals of the best fit are not, an autoregressive model of each coloured channel is
estimated, and the fit repeated with it until both settle: generalised least squares, whose inverse information is the
covariance of the estimate. Source: Klein & Morelli, "Aircraft System Identification" (2006), ch. 6; Cochrane & Orcutt,
JASA 44 (1949) 32, for the iteration.
"""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.flightsim.march import Drive
from indicial.identification.accuracy import WHITE_LEVEL, cramer_rao, neighbour_test, undetermined
from indicial.identification.channels import ANGLES
from indicial.identification.coloured import reflections, runs, whiten
from indicial.identification.estimate import Estimate
from indicial.identification.fit import OutputErrorFit
from indicial.identification.problem import Manoeuvre, Parameter
from indicial.identification.sensitivity import Integers, Marched

log = logging.getLogger(__name__)

_SHORT = 1e-4  # standard errors; a step shorter than this is the last
_MAX_STEPS = 80
_MAX_DAMPING = 1e9
_SETTLED = 1e-3  # relative change of the noise
_ROUNDS = 12
_UNSETTLED = f"the estimate of the noise had not settled after {_ROUNDS} rounds: standard errors are less sure"
_NO_EFFECT = 1e-6  # standard deviations
_LEAST_NOISE = 1e-3  # of the stated
_LONG = 0.5  # of a step, in radians of the fastest motion; from 0.9 on estimates move by a third of their errors


@dataclass(frozen=True)
class Noise:
    """What is taken for the noise of each channel: a factor on the stated deviation, and reflection coefficients."""

    factor: dict[str, float]
    memory: dict[str, Array]


@dataclass(frozen=True)
class _Record:
    """A manoeuvre with where its unknowns stand among all."""

    manoeuvre: Manoeuvre
    values: Array
    drive: Drive
    columns: Integers
    where: Integers
    known: NDArray[np.bool_]

    def filled(self, unknowns: Array) -> Array:
        """Values of the model's parameters, those of signals at the start."""
        own, values = unknowns[self.where], self.values.copy()
        free = self.columns >= 0
        values[free] = own[self.columns[free]]
        return values


@dataclass(frozen=True)
class _Point:
    """Unknowns and seam states with what they give."""

    unknowns: Array
    seams: tuple[Array, ...]
    marched: tuple[Marched, ...]


class Problem:
    """Records and unknowns of one fit.

    Parameters
    ----------
    manoeuvres : sequence of Manoeuvre
    parameters : sequence of Parameter
        Start values of the records come behind them.
    threads : int, optional
        As many as there are cores if not given; results do not depend on it.

    Raises
    ------
    InputError
        If parameters and models do not fit each other.
    """

    def __init__(
        self, manoeuvres: Sequence[Manoeuvre], parameters: Sequence[Parameter], threads: int | None = None
    ) -> None:
        wanted = [p.name for p in parameters]
        if not manoeuvres or len(set(wanted)) != len(wanted):
            raise InputError("output error needs at least one record, and parameters that are named once")
        self.parameters = tuple(parameters)
        several = len(manoeuvres) > 1
        names: list[str] = []
        start: list[float] = []
        self.prior: list[tuple[int, float, float]] = []
        self.positive: list[int] = []
        place: dict[tuple[str, int], int] = {}
        for p in parameters:
            for k in range(len(manoeuvres)) if p.per_record else range(1):
                for record in [k] if p.per_record else range(len(manoeuvres)):
                    place[p.name, record] = len(names)
                if p.prior is not None:
                    self.prior.append((len(names), *p.prior))
                if p.positive:
                    self.positive.append(len(names))
                names.append(f"{p.name}[{manoeuvres[k].name}]" if p.per_record and several else p.name)
                start.append(p.start)
        self.derivatives = len(names)
        self.records: list[_Record] = []
        for k, m in enumerate(manoeuvres):
            own = [n for n in m.model.parameter_names if n in wanted]
            values, drive = m.schedule(own)
            columns = np.array([own.index(n) if n in own else -1 for n in m.model.parameter_names], dtype=np.int64)
            first = len(names)
            names += [f"{n}[{m.name}]" if several else n for n in m.start.free]
            start += m.start.unknowns.tolist()
            where = np.array([*(place[n, k] for n in own), *range(first, len(names))], dtype=np.int64)
            self.records.append(_Record(m, values, drive, columns, where, np.isfinite(m.measured)))
        stray = [n for n in wanted if not any(n in m.model.parameter_names for m in manoeuvres)]
        if stray:
            raise InputError(f"parameter {', '.join(stray)} is in no record's model")
        self.names, self.start = tuple(names), np.array(start)
        self.channels = tuple(dict.fromkeys(c for m in manoeuvres for c in m.model.channels))
        self.threads = threads or os.cpu_count() or 1

    def look(self, unknowns: Array, seams: tuple[Array, ...] | None) -> _Point | None:
        """Fly all records; None where a flight is not finite or a value is not physical."""
        if any(unknowns[i] <= 0.0 for i in self.positive):
            return None

        def fly(k: int) -> Marched:
            record = self.records[k]
            nodes = None if seams is None else seams[k]
            own = unknowns[record.where]
            return record.manoeuvre.fly(record.filled(unknowns), record.drive, record.columns, own, nodes)

        indices = range(len(self.records))
        if self.threads == 1 or len(self.records) == 1:
            marched = tuple(fly(k) for k in indices)
        else:
            with ThreadPoolExecutor(min(self.threads, len(self.records))) as pool:
                marched = tuple(pool.map(fly, indices))
        if not all(np.all(np.isfinite(m.outputs)) and np.all(np.isfinite(m.slopes)) for m in marched):
            return None
        return _Point(
            unknowns, tuple(np.zeros((0, m.states.shape[1])) for m in marched) if seams is None else seams, marched
        )

    def residuals(self, point: _Point, k: int) -> Array:
        """Measured less computed of one record, its gaps closed to first order; NaN where nothing was measured."""
        record, marched = self.records[k], point.marched[k]
        difference: Array = record.manoeuvre.measured - marched.outputs
        turning = [c in ANGLES for c in record.manoeuvre.model.channels]
        difference[:, turning] = (difference[:, turning] + math.pi) % (2.0 * math.pi) - math.pi
        return difference - marched.slopes[:, :, -1]

    def rows(self, point: _Point, noise: Noise) -> dict[str, tuple[Array, Array]]:
        """Of each channel, all records: white sensitivities (n, n_unknowns) and residuals (n,)."""
        made: dict[str, list[tuple[Array, Array]]] = {c: [] for c in self.channels}
        for k, record in enumerate(self.records):
            difference = self.residuals(point, k)
            for i, channel in enumerate(record.manoeuvre.model.channels):
                known = record.known[:, i]
                both = np.concatenate([difference[:, i : i + 1], point.marched[k].slopes[:, i, :-1]], axis=1)
                both = both / (record.manoeuvre.standard_deviations[i] * noise.factor[channel])
                white = whiten(both, noise.memory[channel], known)[known]
                slopes = np.zeros((len(white), len(self.names)))
                slopes[:, record.where] = white[:, 1:]
                made[channel].append((slopes, white[:, 0]))
        return {c: (np.vstack([s for s, _ in p]), np.concatenate([r for _, r in p])) for c, p in made.items()}

    def system(self, point: _Point, noise: Noise) -> tuple[Array, Array]:
        """All rows, priors last."""
        parts = list(self.rows(point, noise).values())
        slopes = np.zeros((len(self.prior), len(self.names)))
        left = np.empty(len(self.prior))
        for row, (i, mean, sd) in enumerate(self.prior):
            slopes[row, i], left[row] = 1.0 / sd, (mean - point.unknowns[i]) / sd
        return np.vstack([*(s for s, _ in parts), slopes]), np.concatenate([*(r for _, r in parts), left])

    def moved(self, point: _Point, step: Array) -> tuple[Array, ...] | None:
        """Seam states after a step that closes the gaps."""
        if not any(len(s) for s in point.seams):
            return None if not any(r.manoeuvre.nodes.size for r in self.records) else point.seams
        seams = []
        for record, marched, states in zip(self.records, point.marched, point.seams, strict=True):
            full = np.append(step[record.where], 1.0)
            seams.append(states + marched.node_slopes @ full)
        return tuple(seams)


def fit_manoeuvres(
    manoeuvres: Sequence[Manoeuvre],
    parameters: Sequence[Parameter],
    *,
    estimate_noise: bool = True,
    colour: bool = True,
    threads: int | None = None,
) -> OutputErrorFit:
    """Fit models to records.

    Parameters
    ----------
    manoeuvres : sequence of Manoeuvre
    parameters : sequence of Parameter
        Unknowns; the start values that each manoeuvre frees are unknown besides.
    estimate_noise : bool
        Whether the noise is estimated from the residuals, or as stated.
    colour : bool
        Whether residuals that are not white are modelled (autoregressive, by channel).
    threads : int, optional
        Records are flown side by side in as many.

    Raises
    ------
    InputError
        If a parameter has no effect, a channel is dead, or something is missing.
    DivergenceError
        If the fit does not converge.
    """
    problem = Problem(manoeuvres, parameters, threads)
    noise = Noise(dict.fromkeys(problem.channels, 1.0), dict.fromkeys(problem.channels, np.zeros(0)))
    with threadpool_limits(limits=1, user_api="blas"):
        seams = tuple(r.manoeuvre.node_states for r in problem.records)
        point = problem.look(problem.start, seams if any(len(s) for s in seams) else None)
        if point is None:
            raise DivergenceError("the flight from the start values is not finite: give better ones, or more segments")
        _check_effects(problem, point, noise)
        cost: list[float] = []
        point = minimise(problem, point, noise, cost)
        settled = not estimate_noise
        for _ in range(_ROUNDS if estimate_noise else 0):
            before, noise = noise, estimated_noise(problem, point, noise, colour)
            point = minimise(problem, point, noise, cost)
            if settled := _settled(before, noise):
                break
        found = _result(problem, point, noise, tuple(cost))
        return found if settled else replace(found, findings=(*found.findings, _UNSETTLED))


@dataclass(frozen=True)
class _Slope:
    """A point with the rows of its linear problem and J there."""

    point: _Point
    slopes: Array
    residuals: Array
    cost: float

    @classmethod
    def at(cls, problem: Problem, point: _Point, noise: Noise) -> _Slope:
        slopes, residuals = problem.system(point, noise)
        return cls(point, slopes, residuals, 0.5 * float(residuals @ residuals))

    def after(self, problem: Problem, step: Array, noise: Noise) -> _Slope | None:
        """Where a step leads; None if nothing flies there."""
        point = problem.look(self.point.unknowns + step, problem.moved(self.point, step))
        return None if point is None else _Slope.at(problem, point, noise)


def minimise(problem: Problem, point: _Point, noise: Noise, cost: list[float]) -> _Point:
    """Damped Gauss-Newton from a point; J at the start and after each step goes into `cost`.

    A whole step that makes J larger is followed by another before it is given up: where a flight is unstable J is a
    valley a million times steeper across than along, whose floor is curved; the second step leads back to it.
    """
    here = _Slope.at(problem, point, noise)
    cost.append(here.cost)
    damping = 0.0
    for _ in range(_MAX_STEPS):
        step, length = gauss_newton_step(here.slopes, here.residuals, damping)
        there = here.after(problem, step, noise)
        if there is not None and there.cost > here.cost and damping == 0.0 and length >= _SHORT:
            there = there.after(problem, gauss_newton_step(there.slopes, there.residuals, 0.0)[0], noise)
        if there is not None and (there.cost <= here.cost or length < _SHORT):
            here = there
            damping = 0.0 if damping < 1e-4 else damping / 10.0
            cost.append(here.cost)
            log.info("output error: J = %.6g after a step of %.2g standard errors", here.cost, length)
            if length < _SHORT:
                return here.point
            continue
        damping = max(1e-3, 10.0 * damping)
        if damping > _MAX_DAMPING:
            break
    raise DivergenceError(
        f"output error did not converge (J {cost[0]:.6g} to {cost[-1]:.6g}): free less, give better start values, "
        "divide the record into segments, or check units and signs of its channels"
    )


def gauss_newton_step(slopes: Array, residuals: Array, damping: float) -> tuple[Array, float]:
    """Damped Gauss-Newton step, and the length of the undamped one in standard errors.

    Directions that the rows do not tell beyond round-off have no part in either.
    """
    size = np.linalg.norm(slopes, axis=0)
    triangle = np.asarray(np.linalg.qr(np.column_stack([slopes / size, residuals]), mode="r"))
    left, singular, rows = np.linalg.svd(triangle[: size.size, : size.size])
    along = left.T @ triangle[: size.size, -1]
    smallest = np.finfo(float).eps * slopes.shape[0] * singular[0]
    told = singular > smallest
    gain = np.where(told, singular / (singular**2 + damping + smallest**2), 0.0)
    return rows.T @ (gain * along) / size, float(np.linalg.norm(along[told]))


def estimated_noise(problem: Problem, point: _Point, noise: Noise, colour: bool) -> Noise:
    """Memory of each channel from its residuals, then its size from what is white, less what the fit took."""
    white = Noise(noise.factor, dict.fromkeys(problem.channels, np.zeros(0)))
    memory = white.memory
    if colour:
        memory = {c: _memory(problem, point, c, noise) for c in problem.channels}
    trial = Noise(noise.factor, memory)
    rows = problem.rows(point, trial)
    slopes, _ = problem.system(point, trial)
    bound = cramer_rao(slopes)
    factor = {}
    for channel, (own, residuals) in rows.items():
        freedom = residuals.size - float(np.sum((own @ bound) * own))
        if freedom < 1.0:
            raise InputError(f"too little of channel {channel} for so many unknowns: free fewer")
        factor[channel] = noise.factor[channel] * max(math.sqrt(float(residuals @ residuals) / freedom), _LEAST_NOISE)
        factor[channel] = max(factor[channel], _LEAST_NOISE)
    return Noise(factor, memory)


def _memory(problem: Problem, point: _Point, channel: str, noise: Noise) -> Array:
    """Reflection coefficients of one channel; none if its residuals pass as white."""
    plain = Noise(noise.factor, {**noise.memory, channel: np.zeros(0)})
    slopes, _ = problem.system(point, noise)
    own, residuals = problem.rows(point, plain)[channel]
    test = neighbour_test(channel, residuals, own, cramer_rao(slopes))
    if test.probability > WHITE_LEVEL / len(problem.channels) and noise.memory[channel].size == 0:
        return np.zeros(0)
    stretches = []
    for k, record in enumerate(problem.records):
        if channel in record.manoeuvre.model.channels:
            i = record.manoeuvre.model.channels.index(channel)
            series = problem.residuals(point, k)[:, i] / record.manoeuvre.standard_deviations[i]
            stretches += [series[first:stop] for first, stop in runs(record.known[:, i])]
    return reflections(stretches)


def _settled(before: Noise, after: Noise) -> bool:
    for channel, factor in after.factor.items():
        if abs(factor / before.factor[channel] - 1.0) > _SETTLED and factor > _LEAST_NOISE:
            return False
        old, new = before.memory[channel], after.memory[channel]
        if old.size != new.size or (new.size and float(np.max(np.abs(old - new))) > _SETTLED):
            return False
    return True


def _check_effects(problem: Problem, point: _Point, noise: Noise) -> None:
    """Refuse an unknown whose whole value, or 1, changes nothing that could be measured; and a dead channel."""
    for k, record in enumerate(problem.records):
        m, seen = record.manoeuvre, point.marched[k].outputs
        for i, channel in enumerate(m.model.channels):
            values = m.measured[record.known[:, i], i]
            if values.size > 2 and np.ptp(values) == 0.0 and np.ptp(seen[:, i]) > 5.0 * m.standard_deviations[i]:
                raise InputError(f"channel {channel} of {m.name} does not change, its model does: dead? leave it out")
    slopes, _ = problem.system(point, noise)
    effect = np.max(np.abs(slopes), axis=0)
    for name, value, size in zip(problem.names, point.unknowns, effect, strict=True):
        if size * max(1.0, abs(value)) < _NO_EFFECT:
            raise InputError(f"{name} has no effect on these records: hold it, or give a flight that depends on it")


def _long_steps(problem: Problem, point: _Point) -> list[str]:
    """Records whose Runge-Kutta steps are too long for the motion found, in words."""
    found = []
    for record, marched in zip(problem.records, point.marched, strict=True):
        m, values = record.manoeuvre, record.filled(point.unknowns)
        dynamics = m.model.dynamics
        slope = dynamics.jacobian(marched.states[0], values[: len(dynamics.parameter_names)], m.time[0])
        fastest = float(np.max(np.abs(np.linalg.eigvals(slope))))
        intervals = np.diff(m.time)
        if float(np.max(intervals / m.substeps)) * fastest > _LONG:
            needed = math.ceil(float(np.max(intervals)) * fastest / _LONG)
            found.append(
                f"steps of {m.name} are long for its motion of {fastest:.3g} rad/s, which biases the estimates: "
                f"steps_per_interval of {needed}"
            )
    return found


def _result(problem: Problem, point: _Point, noise: Noise, cost: tuple[float, ...]) -> OutputErrorFit:
    slopes, _ = problem.system(point, noise)
    covariance = cramer_rao(slopes)
    errors = np.sqrt(np.diag(covariance))
    n = problem.derivatives
    estimates = [
        Estimate(name, float(value), float(error))
        for name, value, error in zip(problem.names, point.unknowns, errors, strict=True)
    ]
    return OutputErrorFit(
        parameters=tuple(estimates[:n]),
        start_values=tuple(estimates[n:]),
        covariance=covariance,
        findings=(
            *(undetermined(problem.names[:n], point.unknowns[:n], covariance[:n, :n]) if n else ()),
            *_long_steps(problem, point),
        ),
        noise=noise.factor,
        memory=noise.memory,
        manoeuvres=tuple(r.manoeuvre for r in problem.records),
        residuals=tuple(problem.residuals(point, k) for k in range(len(problem.records))),
        white={c: residuals for c, (_, residuals) in problem.rows(point, noise).items()},
        states=tuple(m.states for m in point.marched),
        starts={p.name: p.start for p in problem.parameters},
        cost=cost,
    )
