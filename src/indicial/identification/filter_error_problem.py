"""What filter error asks: unknowns, records, and what the filter makes of them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.flightsim.signals import Parameters
from indicial.identification.filtering import FilterInput
from indicial.identification.problem import Parameter
from indicial.identification.record import FlightRecord
from indicial.identification.state_model import StateModel, check_names

INTENSITY, NOISE = "intensity_", "noise_"
"""A parameter of such a name and a state's is its process noise, and a channel's its standard deviation."""


@dataclass(frozen=True)
class Unknown:
    """What one number of the fit is, and where it goes in the input of the filter."""

    name: str
    kind: Literal["parameter", "intensity", "noise", "start"]
    index: int
    records: tuple[int, ...]
    start: float
    logarithmic: bool
    prior: tuple[float, float] | None = None

    def value(self, coordinate: float) -> float:
        """Of the unknown at a coordinate."""
        return math.exp(coordinate) if self.logarithmic else coordinate

    def put(self, given: FilterInput, value: float) -> FilterInput:
        """The input with a value in its place."""
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
class FilterErrorProblem:
    """Records and unknowns of one fit; coordinates are the unknowns, positive ones by their logarithms."""

    inputs: tuple[FilterInput, ...]
    unknowns: tuple[Unknown, ...]

    @property
    def start(self) -> Array:
        """Coordinates to start from, shape (n,)."""
        return np.array([math.log(u.start) if u.logarithmic else u.start for u in self.unknowns])

    def values(self, coordinates: Array) -> Array:
        """Of the unknowns, shape (n,)."""
        return np.array([u.value(float(c)) for u, c in zip(self.unknowns, coordinates, strict=True)])

    def filled(self, coordinates: Array, record: int) -> FilterInput:
        """What the filter is given of a record."""
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
        """J with priors."""
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

    def without(self, at: Array, lost: list[bool]) -> tuple[FilterErrorProblem, Array]:
        """The problem with lost process noise at zero, and lost measurement noise where it has come to."""
        inputs = list(self.inputs)
        for unknown, coordinate, gone in zip(self.unknowns, at, lost, strict=True):
            for record in unknown.records if gone else ():
                value = 0.0 if unknown.kind == "intensity" else unknown.value(float(coordinate))
                inputs[record] = unknown.put(inputs[record], value)
        kept = tuple(u for u, gone in zip(self.unknowns, lost, strict=True) if not gone)
        return FilterErrorProblem(tuple(inputs), kept), at[~np.array(lost)]

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


def build_problem(
    model: StateModel,
    records: Sequence[FlightRecord],
    starts: Sequence[Mapping[str, float]],
    parameters: Sequence[Parameter],
    start_errors: Mapping[str, float],
    free_start: Sequence[str],
    known: Parameters,
    estimate_noise: bool,
) -> FilterErrorProblem:
    """Gather and check what `filter_error` says."""
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
    unknowns: list[Unknown] = []
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
            unknowns.append(Unknown(NOISE + channel, "noise", i, every, stated, True))
    for k, start in enumerate(starts):
        for state in free_start:
            name = f"start_{state}[{k}]" if len(every) > 1 else f"start_{state}"
            unknowns.append(Unknown(name, "start", model.state_names.index(state), (k,), float(start[state]), False))
    if not unknowns:
        raise InputError("filter error needs something unknown")
    return FilterErrorProblem(inputs, tuple(unknowns))


def _unknown(model: StateModel, p: Parameter, name: str, records: tuple[int, ...]) -> Unknown:
    if p.name in model.parameter_names:
        index = model.parameter_names.index(p.name)
        return Unknown(name, "parameter", index, records, p.start, p.positive, p.prior)
    allowed = (*(INTENSITY + s for s in model.state_names), *(NOISE + c for c in model.channels))
    check_names("parameter", [p.name], (*model.parameter_names, *allowed))
    if not p.start > 0.0:
        raise InputError(f"start of {p.name} is {p.start}, must be positive")
    if p.name.startswith(INTENSITY):
        index = model.state_names.index(p.name.removeprefix(INTENSITY))
        return Unknown(name, "intensity", index, records, p.start, True, p.prior)
    return Unknown(name, "noise", model.channels.index(p.name.removeprefix(NOISE)), records, p.start, True, p.prior)


def _with(values: Array, where: int | tuple[slice, int], value: float) -> Array:
    changed = values.copy()
    changed[where] = value
    return changed
