r"""Filter error: maximum likelihood of a flight in turbulence, with a Kalman filter inside.

With innovations nu and their covariance S of the extended Kalman filter (`kalman`), which takes them one channel after
the other as independent errors e with variances s,

    J = 1/2 sum (nu^T S^-1 nu + ln det S) = 1/2 sum (e^2/s + ln s),
    gradient   sum (e e'/s + s'/(2 s) (1 - e^2/s)),         information   sum (e' e'^T/s + s' s'^T/(2 s^2)),

is minimised over parameters of the model, start states, intensities of process noise and deviations of measurement
noise together, by damped scoring steps: Gauss-Newton on the rows ``e'/sqrt(s)`` and ``s'/(sqrt(2) s)``. Where a model
is wrong J bends otherwise than its information says, which is learnt from the gradients on the way (Dennis, Gay &
Welsch, ACM Trans. Math. Softw. 7 (1981) 348). The information is exact for a linear model; its inverse is the
covariance of the estimate. Positive unknowns go by their logarithms.
Derivatives are central differences of a thousandth of a standard error. Without process noise and with a known start
this is output error.

Source: Maine & Iliff, NASA RP-1168 (1986), ch. 9, and SIAM J. Appl. Math. 41 (1981) 558 (both noises at once);
Jategaonkar, "Flight Vehicle System Identification" (2nd ed., 2015), ch. 5.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.flightsim.signals import Parameters
from indicial.identification.accuracy import cramer_rao, undetermined
from indicial.identification.estimate import Estimate
from indicial.identification.filter_error_fit import FilterErrorFit
from indicial.identification.filtering import FilterInput, FilterResult
from indicial.identification.maximum_likelihood import gauss_newton_step
from indicial.identification.problem import Parameter
from indicial.identification.record import FlightRecord
from indicial.identification.state_model import StateModel, check_names

log = logging.getLogger(__name__)

INTENSITY, NOISE = "intensity_", "noise_"
"""A parameter of such a name and a state's is its process noise, and a channel's its standard deviation."""

_SHORT = 1e-3  # standard errors; a step shorter than this is the last
_MAX_STEPS = 100
_MAX_DAMPING = 1e9
_DIFFERENCE = 1e-3  # standard errors
_FIRST_DIFFERENCE = 1e-5
_LEAST_BEND, _MOST_BEND = 0.1, 10.0  # of J against the information, in any direction
_MOST = 1.0  # change of a logarithm in one step
_UNSEEN = 0.03  # information on a logarithm, as 1 over its standard error, below which noise is not seen
_NO_EFFECT = 1e-6
_LEAST_NOISE = 1e-3  # of the stated


@dataclass(frozen=True)
class _Unknown:
    """What one number of the fit is, and where it goes in the input of the filter."""

    name: str
    kind: Literal["parameter", "intensity", "noise", "start"]
    index: int
    records: tuple[int, ...]
    start: float
    logarithmic: bool
    prior: tuple[float, float] | None = None

    def value(self, coordinate: float) -> float:
        return math.exp(coordinate) if self.logarithmic else coordinate

    def put(self, given: FilterInput, value: float) -> FilterInput:
        if self.kind == "parameter":
            return replace(given, parameters=_with(given.parameters, (slice(None), self.index), value))
        if self.kind == "intensity":
            return replace(given, intensity=_with(given.intensity, self.index, value))
        if self.kind == "noise":
            return replace(given, variance=_with(given.variance, self.index, value**2))
        return replace(given, mean=_with(given.mean, self.index, value))


Seen = list[tuple[Array, Array]]
"""Of each record: errors and variances of what was measured, shape (number,)."""


@dataclass(frozen=True)
class _Problem:
    inputs: tuple[FilterInput, ...]
    unknowns: tuple[_Unknown, ...]

    def filled(self, coordinates: Array, record: int) -> FilterInput:
        given = self.inputs[record]
        for unknown, coordinate in zip(self.unknowns, coordinates, strict=True):
            if record in unknown.records:
                given = unknown.put(given, unknown.value(float(coordinate)))
        return given

    def look(self, coordinates: Array, records: Sequence[int] | None = None) -> Seen | None:
        """Filter records (all if not said); None where a filter breaks down."""
        seen = []
        for record in range(len(self.inputs)) if records is None else records:
            broken, made = self.filled(coordinates, record).run()
            if broken >= 0:
                return None
            known = np.isfinite(made.errors)
            seen.append((made.errors[known], made.variances[known]))
        return seen

    def cost(self, coordinates: Array, seen: Seen) -> float:
        total = sum(0.5 * float(np.sum(e * e / s + np.log(s))) for e, s in seen)
        for unknown, coordinate in zip(self.unknowns, coordinates, strict=True):
            if unknown.prior is not None:
                mean, sd = unknown.prior
                total += 0.5 * ((unknown.value(float(coordinate)) - mean) / sd) ** 2
        return total

    def system(self, coordinates: Array, seen: Seen, differences: Array) -> tuple[Array, Array]:
        """Rows whose normal equations are those of the scoring step: (2 number + priors, n) and their right side."""
        sizes = [e.size for e, _ in seen]
        first = np.concatenate([[0], np.cumsum(sizes)])
        error = np.concatenate([e for e, _ in seen])
        variance = np.concatenate([s for _, s in seen])
        slopes = np.zeros((2, error.size, len(self.unknowns)))
        for j, unknown in enumerate(self.unknowns):
            h = np.zeros(coordinates.size)
            h[j] = differences[j]
            above, below = (self.look(coordinates + sign * h, unknown.records) for sign in (1.0, -1.0))
            if above is None or below is None:
                raise DivergenceError(f"the filter breaks down beside {unknown.name} = {unknown.value(coordinates[j])}")
            for record, (e1, s1), (e0, s0) in zip(unknown.records, above, below, strict=True):
                rows = slice(first[record], first[record + 1])
                slopes[0, rows, j] = (e1 - e0) / (2.0 * h[j]) / np.sqrt(variance[rows])
                slopes[1, rows, j] = np.log(s1 / s0) / (2.0 * h[j]) / math.sqrt(2.0)
        z = error / np.sqrt(variance)
        prior_rows, prior_right = self._priors(coordinates)
        right = [-z, -(1.0 - z * z) / math.sqrt(2.0), prior_right]
        return np.vstack([*slopes, prior_rows]), np.concatenate(right)

    def _priors(self, coordinates: Array) -> tuple[Array, Array]:
        rows, right = [], []
        for j, unknown in enumerate(self.unknowns):
            if unknown.prior is not None:
                value = unknown.value(float(coordinates[j]))
                row = np.zeros(len(self.unknowns))
                row[j] = (value if unknown.logarithmic else 1.0) / unknown.prior[1]
                rows.append(row)
                right.append((unknown.prior[0] - value) / unknown.prior[1])
        return np.array(rows).reshape(len(rows), len(self.unknowns)), np.array(right)


def filter_error(
    model: StateModel,
    records: Sequence[FlightRecord],
    starts: Sequence[Mapping[str, float]],
    parameters: Sequence[Parameter],
    *,
    start_errors: Mapping[str, float] | None = None,
    free_start: Sequence[str] = (),
    known: Parameters | None = None,
    estimate_noise: bool = True,
) -> FilterErrorFit:
    """Fit a model with process noise to records.

    Parameters
    ----------
    model : StateModel
    records : sequence of FlightRecord
        With the standard deviations of their channels: what holds, or where the estimate starts. Values may be missing.
    starts : sequence of mapping
        Of each record: every state before the first measurement.
    parameters : sequence of Parameter
        Parameters of the model, and ``intensity_STATE``: process noise, positive, in units of the state over sqrt(s).
        ``noise_CHANNEL`` may be given to set a prior.
    start_errors : mapping of str to float
        Standard errors of the starts, what is known of them beforehand; 0 where not given.
    free_start : sequence of str
        States whose starts are unknown constants, in each record its own.
    known : mapping of str to float or Signal, optional
        Parameters of the model that are neither unknown nor inputs of the records.
    estimate_noise : bool
        Whether the standard deviations of all channels are unknown, common to all records.

    Raises
    ------
    InputError
        If a name is unknown, a channel dead, a parameter without effect.
    DivergenceError
        If the fit does not converge, or the filter breaks down at the start.
    """
    problem = _problem(model, records, starts, parameters, start_errors or {}, free_start, known or {}, estimate_noise)
    at = np.array([math.log(u.start) if u.logarithmic else u.start for u in problem.unknowns])
    problem, at, cost, unseen = _minimise(problem, at)
    return _result(problem, at, cost, unseen, {p.name: p.start for p in parameters})


def _minimise(problem: _Problem, at: Array) -> tuple[_Problem, Array, tuple[float, ...], list[_Unknown]]:
    """Damped scoring; noise that is not seen is set to where it goes, and left."""
    seen = problem.look(at)
    if seen is None:
        raise DivergenceError("the filter breaks down at the start values: give better ones, or larger start errors")
    size = np.array([1.0 if u.logarithmic else max(1.0, abs(u.start)) for u in problem.unknowns])
    slopes, right = problem.system(at, seen, _FIRST_DIFFERENCE * size)
    _check_effects(problem, slopes, size)
    cost, damping, unseen = [problem.cost(at, seen)], 0.0, list[_Unknown]()
    bend = np.zeros((at.size, at.size))  # of J, beyond the information
    slopes, right = problem.system(at, seen, _differences(slopes))
    for _ in range(_MAX_STEPS):
        lost = [_is_unseen(u, slopes[:, j], right) for j, u in enumerate(problem.unknowns)]
        if any(lost):
            unseen += [u for u, gone in zip(problem.unknowns, lost, strict=True) if gone]
            problem, at = _without(problem, at, lost)
            if not at.size:
                raise InputError(f"the records show no {unseen[-1].name}, and nothing else was asked")
            seen = problem.look(at)
            if seen is None:
                raise DivergenceError(f"the filter breaks down without {unseen[-1].name}: hold it at a positive value")
            slopes, right = problem.system(at, seen, _differences(slopes[:, ~np.array(lost)]))
            bend = np.zeros((at.size, at.size))
            cost.append(problem.cost(at, seen))
            continue
        _, length = gauss_newton_step(slopes, right, damping)
        step = _bent_step(slopes, right, bend, damping)
        logarithms = np.array([u.logarithmic for u in problem.unknowns])
        step[logarithms] = np.clip(step[logarithms], -_MOST, _MOST)
        trial = problem.look(at + step)
        after = math.inf if trial is None else problem.cost(at + step, trial)
        if trial is not None and (after <= cost[-1] or length < _SHORT):
            at, seen = at + step, trial
            _check_noise(problem, at)
            along = slopes @ step
            promised = float(right @ along) - 0.5 * float(along @ along + step @ bend @ step)
            damping = _next_damping(damping, (cost[-1] - after) / promised)
            cost.append(after)
            log.info("filter error: J = %.6g after a step of %.2g standard errors", after, length)
            before = right @ slopes
            slopes, right = problem.system(at, seen, _differences(slopes))
            if length < _SHORT:
                return problem, at, tuple(cost), unseen
            bend = _learnt(bend, step, before - right @ slopes - slopes.T @ (slopes @ step))
            continue
        damping = max(1e-3, 10.0 * damping)
        if damping > _MAX_DAMPING:
            break
    raise DivergenceError(
        f"filter error did not converge (J {cost[0]:.6g} to {cost[-1]:.6g}): free less, or give better start values"
    )


def _next_damping(damping: float, kept: float) -> float:
    """After a step that kept this share of the fall of J that it promised."""
    if kept < 0.25:
        return max(1e-3, 4.0 * damping)
    if kept < 0.75:
        return damping
    return 0.0 if damping < 1e-3 else damping / 10.0


def _bent_step(slopes: Array, right: Array, bend: Array, damping: float) -> Array:
    """Damped Newton step with the information and what J was found to bend beyond it."""
    size = np.linalg.norm(slopes, axis=0)
    scaled = slopes / size
    information = scaled.T @ scaled
    left = np.linalg.cholesky(information + (damping + np.finfo(float).eps * len(slopes)) * np.eye(size.size))
    half = np.linalg.solve(left, np.linalg.solve(left, bend / np.outer(size, size)).T)
    bends, directions = np.linalg.eigh(np.eye(size.size) + 0.5 * (half + half.T))
    along = directions.T @ np.linalg.solve(left, scaled.T @ right)
    step: Array = np.linalg.solve(left.T, directions @ (along / np.clip(bends, _LEAST_BEND, _MOST_BEND))) / size
    return step


def _learnt(bend: Array, step: Array, missing: Array) -> Array:
    """Symmetric rank-one update, after which `bend` explains what the information misses of the gradient's change."""
    rest = missing - bend @ step
    along = float(rest @ step)
    if abs(along) <= 1e-8 * float(np.linalg.norm(rest) * np.linalg.norm(step)):
        return bend
    return bend + np.outer(rest, rest) / along


def _differences(slopes: Array) -> Array:
    """Steps of central differences, shape (n,): a small part of the standard error of each unknown alone."""
    steps: Array = _DIFFERENCE / np.maximum(np.linalg.norm(slopes, axis=0), _DIFFERENCE)
    return steps


def _is_unseen(unknown: _Unknown, slope: Array, right: Array) -> bool:
    """Whether noise falls, and has fallen below what the records show."""
    if unknown.kind not in ("intensity", "noise") or unknown.prior is not None:
        return False
    return float(np.linalg.norm(slope)) < _UNSEEN and float(slope @ right) < 0.0


def _without(problem: _Problem, at: Array, lost: list[bool]) -> tuple[_Problem, Array]:
    """The problem with lost process noise at zero, and lost measurement noise where it has come to."""
    inputs = list(problem.inputs)
    for unknown, coordinate, gone in zip(problem.unknowns, at, lost, strict=True):
        for record in unknown.records if gone else ():
            value = 0.0 if unknown.kind == "intensity" else unknown.value(float(coordinate))
            inputs[record] = unknown.put(inputs[record], value)
    kept = tuple(u for u, gone in zip(problem.unknowns, lost, strict=True) if not gone)
    return _Problem(tuple(inputs), kept), at[~np.array(lost)]


def _check_effects(problem: _Problem, slopes: Array, size: Array) -> None:
    effect = np.max(np.abs(slopes), axis=0) * size
    for unknown, largest in zip(problem.unknowns, effect, strict=True):
        if largest < _NO_EFFECT and unknown.kind != "intensity":
            raise InputError(
                f"{unknown.name} has no effect on these records: hold it, or give a flight that depends on it"
            )


def _check_noise(problem: _Problem, at: Array) -> None:
    for unknown, coordinate in zip(problem.unknowns, at, strict=True):
        if unknown.kind == "noise" and unknown.value(float(coordinate)) < _LEAST_NOISE * unknown.start:
            raise DivergenceError(
                f"{unknown.name} falls below a thousandth of the {unknown.start:g} stated: hold it (estimate_noise)"
            )


def _problem(
    model: StateModel,
    records: Sequence[FlightRecord],
    starts: Sequence[Mapping[str, float]],
    parameters: Sequence[Parameter],
    start_errors: Mapping[str, float],
    free_start: Sequence[str],
    known: Parameters,
    estimate_noise: bool,
) -> _Problem:
    names = [p.name for p in parameters]
    if not records or len(starts) != len(records) or len(set(names)) != len(names):
        raise InputError("filter error needs a record or more, a start for each, and parameters that are named once")
    check_names("state", free_start, model.state_names)
    both = sorted(set(names) & set(known))
    if both:
        raise InputError(f"parameter {', '.join(both)} is both known and unknown: make it one of them")
    held = {**known, **{p.name: p.start for p in parameters if p.name in model.parameter_names}}
    inputs = tuple(
        FilterInput.of(model, record, start, start_errors, held) for record, start in zip(records, starts, strict=True)
    )
    every = tuple(range(len(records)))
    unknowns: list[_Unknown] = []
    for p in parameters:
        groups = [(k,) for k in every] if p.per_record else [every]
        for group in groups:
            name = f"{p.name}[{group[0]}]" if p.per_record and len(every) > 1 else p.name
            unknowns.append(_unknown(model, p, name, group))
    for i, channel in enumerate(model.channels if estimate_noise else ()):
        if NOISE + channel not in names:
            stated = math.sqrt(inputs[0].variance[i])
            if any(given.variance[i] != inputs[0].variance[i] for given in inputs):
                raise InputError(f"standard deviation of {channel} differs from record to record: state it as one")
            unknowns.append(_Unknown(NOISE + channel, "noise", i, every, stated, True))
    for k, start in enumerate(starts):
        for state in free_start:
            name = f"start_{state}[{k}]" if len(every) > 1 else f"start_{state}"
            unknowns.append(_Unknown(name, "start", model.state_names.index(state), (k,), float(start[state]), False))
    if not unknowns:
        raise InputError("filter error needs something unknown")
    return _Problem(inputs, tuple(unknowns))


def _unknown(model: StateModel, p: Parameter, name: str, records: tuple[int, ...]) -> _Unknown:
    if p.name in model.parameter_names:
        index = model.parameter_names.index(p.name)
        return _Unknown(name, "parameter", index, records, p.start, p.positive, p.prior)
    allowed = (*(INTENSITY + s for s in model.state_names), *(NOISE + c for c in model.channels))
    check_names("parameter", [p.name], (*model.parameter_names, *allowed))
    if not p.start > 0.0:
        raise InputError(f"start of {p.name} is {p.start}, must be positive")
    if p.name.startswith(INTENSITY):
        index = model.state_names.index(p.name.removeprefix(INTENSITY))
        return _Unknown(name, "intensity", index, records, p.start, True, p.prior)
    return _Unknown(name, "noise", model.channels.index(p.name.removeprefix(NOISE)), records, p.start, True, p.prior)


def _with(values: Array, where: int | tuple[slice, int], value: float) -> Array:
    changed = values.copy()
    changed[where] = value
    return changed


def _result(
    problem: _Problem, at: Array, cost: tuple[float, ...], unseen: list[_Unknown], starts: Mapping[str, float]
) -> FilterErrorFit:
    seen = problem.look(at)
    assert seen is not None  # it was looked at before
    slopes, _ = problem.system(at, seen, _differences(problem.system(at, seen, np.full(at.size, 1e-6))[0]))
    values = np.array([u.value(float(c)) for u, c in zip(problem.unknowns, at, strict=True)])
    scale = np.where([u.logarithmic for u in problem.unknowns], values, 1.0)
    covariance = cramer_rao(slopes) * np.outer(scale, scale)
    errors = np.sqrt(np.diag(covariance))
    model = problem.inputs[0].model
    filters = []
    for k in range(len(problem.inputs)):
        given = problem.filled(at, k)
        filters.append(FilterResult(replace(model, intensity=given.intensity), given.time, given.run()[1], "extended"))
    estimates = [Estimate(u.name, v, e) for u, v, e in zip(problem.unknowns, values.tolist(), errors, strict=True)]
    own = [j for j, u in enumerate(problem.unknowns) if u.kind == "parameter"]
    findings = undetermined(tuple(estimates[j].name for j in own), values[own], covariance[np.ix_(own, own)])
    return FilterErrorFit(
        estimates=tuple(estimates),
        covariance=covariance,
        findings=(*(findings if own else ()), *(f"the records show no {u.name}" for u in unseen)),
        filters=tuple(filters),
        measured=tuple(given.measured for given in problem.inputs),
        starts=dict(starts),
        cost=cost,
    )
