"""What output error is asked: parameters, and the records with the models that flew them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim import Dynamics, InitialState, Signal
from indicial.flightsim.march import Drive
from indicial.flightsim.signals import Schedule
from indicial.identification.instruments import Installation
from indicial.identification.measurement import RangeRecord
from indicial.identification.reading import check_size
from indicial.identification.record import FlightRecord
from indicial.identification.sensitivity import BIAS, Integers, Marched, SensitivityModel
from indicial.identification.start_state import StartState

_PHASE = 0.1  # rad; angle of the fastest motion in one Runge-Kutta step


@dataclass(frozen=True)
class Parameter:
    """An unknown of the fit.

    Parameters
    ----------
    name : str
        A free symbol of the models, or ``bias_CHANNEL`` (added to what the channel sees).
    start : float
    prior : tuple of float, optional
        Mean and standard deviation of what is known beforehand, Gaussian.
    per_record : bool
        Whether each record has its own value.
    positive : bool
        Whether only values above 0 make sense.
    """

    name: str
    start: float
    prior: tuple[float, float] | None = None
    per_record: bool = False
    positive: bool = False

    def __post_init__(self) -> None:
        if not math.isfinite(self.start):
            raise InputError(f"start of parameter {self.name} is {self.start}, must be finite")
        if self.positive and not self.start > 0.0:
            raise InputError(f"start of parameter {self.name} is {self.start}, must be positive")
        if self.prior is not None and not (all(map(math.isfinite, self.prior)) and self.prior[1] > 0.0):
            raise InputError(f"prior of {self.name} is {self.prior}, must be a mean and a positive standard deviation")


@dataclass(frozen=True)
class Manoeuvre:
    """A record with the model that flew it.

    Parameters
    ----------
    model : SensitivityModel
    time : ndarray
        [s], shape (n,).
    measured : ndarray
        In the order of the model's channels, NaN where there is nothing, shape (n, n_channels).
    standard_deviations : ndarray
        Of each channel: the noise, or the start of its estimate, shape (n_channels,).
    start : StartState
    known : mapping
        Values of the model's parameters that are not unknown: numbers or signals.
    substeps : ndarray of int
        Runge-Kutta steps in each interval, shape (n - 1,).
    nodes : ndarray of int
        Instants at which the state is set anew (multiple shooting).
    node_states : ndarray
        To start from, shape (n_nodes, nx).
    name : str
    """

    model: SensitivityModel
    time: Array
    measured: Array
    standard_deviations: Array
    start: StartState
    known: Mapping[str, float | Signal] = field(default_factory=dict)
    substeps: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    nodes: Integers = field(default_factory=lambda: np.zeros(0, np.int64))
    node_states: Array = field(default_factory=lambda: np.zeros((0, 13)))
    name: str = "record"

    @classmethod
    def of_flight(
        cls,
        record: FlightRecord,
        dynamics: Dynamics,
        initial: InitialState,
        *,
        channels: Sequence[str] | None = None,
        free_start: Sequence[str] = (),
        known: Mapping[str, float | Signal] | None = None,
        biases: Sequence[str] = (),
        segments: int = 1,
        steps_per_interval: int = 1,
        installation: Installation | None = None,
        model: SensitivityModel | None = None,
        name: str = "record",
    ) -> Manoeuvre:
        """A flight record, whose inputs drive the model's parameters of the same names.

        Parameters
        ----------
        record : FlightRecord
        dynamics : Dynamics
        initial : InitialState
            Where it starts, or near it.
        channels : sequence of str, optional
            What to fit; all the record's if not given.
        free_start : sequence of str
            Start values that are unknown; see `StartState`.
        known : mapping, optional
            Values of parameters that are neither unknown nor inputs.
        biases : sequence of str
            Channels with an unknown offset; its `Parameter` is called ``bias_CHANNEL``.
        segments : int
            Pieces of multiple shooting. The states at the seams start from what was measured there, where it was, so
            that a wrong start of the parameters cannot carry an unstable flight away.
        steps_per_interval : int
            Runge-Kutta steps from instant to instant.
        installation : Installation, optional
            Where the instruments are, at the centre of gravity if not given: the model then shows what they feel there,
            and angular accelerations need no slopes.
        model : SensitivityModel, optional
            If it is compiled already.

        Raises
        ------
        InputError
            If a channel is missing or dead, or a number makes no sense, as degrees for radians do not.
        """
        seen = tuple(record.channels) if channels is None else tuple(channels)
        record.require(*seen)
        for channel in seen:
            if channel not in ("phi", "psi"):
                check_size(channel, record[channel], name)
        if segments < 1 or steps_per_interval < 1:
            raise InputError("segments and steps_per_interval must be at least 1")
        built = SensitivityModel.of(dynamics, seen, biases, installation) if model is None else model
        stated = [record.standard_deviations.get(c) or _roughness(c, record[c]) for c in seen]
        inputs = {n: Signal(record.time, record.inputs[n]) for n in record.inputs if n in built.parameter_names}
        start = StartState.of(dynamics, initial, free_start)
        at = np.unique(np.linspace(0, len(record) - 1, segments + 1).astype(np.int64)[1:-1])
        return cls(
            model=built,
            time=record.time,
            measured=np.stack([record[c] for c in seen], axis=1),
            standard_deviations=np.array(stated),
            start=start,
            known={**inputs, **(known or {})},
            substeps=np.full(len(record) - 1, steps_per_interval, dtype=np.int64),
            nodes=at,
            node_states=_seams(dynamics, initial, record, at),
            name=name,
        )

    @classmethod
    def of_range(
        cls, record: RangeRecord, model: SensitivityModel, start: StartState, fastest: float, name: str = "shot"
    ) -> Manoeuvre:
        """The record of a range; `fastest` is the angular frequency of the fastest motion [rad/s]."""
        return cls(
            model=model,
            time=record.time,
            measured=record.values,
            standard_deviations=record.standard_deviations,
            start=start,
            substeps=np.full(len(record) - 1, substeps_needed(record.time, fastest), dtype=np.int64),
            node_states=np.zeros((0, len(model.dynamics.state_names))),
            name=name,
        )

    def schedule(self, unknown: Sequence[str]) -> tuple[Array, Drive]:
        """Values of all parameters, 0 for the unknown, and the signals among them.

        Raises
        ------
        InputError
            If one is neither known nor unknown, or both.
        """
        names = self.model.parameter_names
        for name in names:
            if (name in self.known) == (name in unknown):
                state = "both known and unknown" if name in unknown else "neither known nor unknown"
                raise InputError(f"parameter {name} of {self.name} is {state}: make it one of them")
        stray = set(self.known) - set(names)
        if stray:
            raise InputError(f"{', '.join(sorted(stray))}, known of {self.name}, is no parameter of its model")
        schedule = Schedule.of(names, {name: self.known.get(name, 0.0) for name in names})
        return schedule.at(self.time[0])[:, 0], schedule.drive

    def fly(
        self, values: Array, drive: Drive, columns: Integers, unknowns: Array, nodes: Array | None = None
    ) -> Marched:
        """March with parameters `values` from the start given by the last of `unknowns`."""
        state, slope = self.start.state(unknowns[unknowns.size - len(self.start.free) :])
        slopes = np.zeros((state.size, unknowns.size))
        slopes[:, unknowns.size - len(self.start.free) :] = slope
        at = self.nodes if nodes is not None else self.nodes[:0]
        seams = np.zeros((0, state.size)) if nodes is None else nodes
        return self.model.march((state, slopes), values, drive, columns, self.time, self.substeps, (at, seams))

    @property
    def biases(self) -> tuple[str, ...]:
        """Parameters that are offsets of channels."""
        return tuple(name for name in self.model.parameter_names if name.startswith(BIAS))


def substeps_needed(time: Array, fastest: float) -> int:
    """Runge-Kutta steps between instants, such that the fastest motion [rad/s] turns by 0.1 rad at most in one."""
    return max(1, math.ceil(float(np.max(np.diff(np.asarray(time)))) * fastest / _PHASE))


def _roughness(name: str, values: Array) -> float:
    """Standard deviation of white noise that second differences would have; a start, no more."""
    known = values[np.isfinite(values)]
    if known.size < 5:
        raise InputError(f"channel {name} has {known.size} values: too few to fit")
    size = float(np.median(np.abs(np.diff(known, 2)))) / (0.6745 * math.sqrt(6.0))
    size = max(size, 1e-4 * float(np.ptp(known)))
    if size == 0.0:
        raise InputError(f"channel {name} does not change: leave it out, or state its standard deviation")
    return size


def _seams(dynamics: Dynamics, initial: InitialState, record: FlightRecord, at: Integers) -> Array:
    """States at the seams: what was measured there, and the initial state's where nothing was."""
    chart = StartState.of(dynamics, initial, ())
    states = []
    for index in at:
        measured = {}
        for name in chart.names[:12]:
            if name in record.channels:
                known = np.flatnonzero(np.isfinite(record[name]))
                measured[name] = float(np.interp(record.time[index], record.time[known], record[name][known]))
        states.append(chart.replace(measured).state(np.zeros(0))[0])
    return np.array(states).reshape(len(states), len(dynamics.state_names))
