r"""What a manoeuvre will tell before it is flown, which of several tells most, and one made to tell more.

The information that a record will hold is that of the model's own sensitivities along the flight, ``F = S^T R^-1 S``;
its inverse bounds the covariance of what will be identified (`accuracy`). A manoeuvre is judged by the errors that it
promises. `improve_input` changes a control step by step, each step to the one of a few levels that makes the
determinant of the parameters' covariance smallest (coordinate exchange of D-optimal design), as long as the flight
stays within limits. Source: Mehra, IEEE Trans. Autom. Control 19 (1974) 753; Meyer & Nachtsheim, Technometrics 37
(1995) 60; Klein & Morelli, "Aircraft System Identification" (2006), ch. 9.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim import Dynamics, InitialState, Signal
from indicial.identification.accuracy import cramer_rao, undetermined
from indicial.identification.maximum_likelihood import Noise, Problem
from indicial.identification.problem import Manoeuvre, Parameter, substeps_needed
from indicial.identification.record import FlightRecord
from indicial.identification.sensitivity import SensitivityModel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_BETTER = 1e-6  # of the logarithm of the determinant; smaller gains end the search
_ROUNDS = 6


@dataclass(frozen=True)
class Experiment:
    """A flight to be flown: model, values believed, instruments and instants. What it takes to judge inputs.

    Parameters
    ----------
    dynamics : Dynamics
        With the parameters to be identified and the controls as free symbols.
    initial : InitialState
    values : mapping of str to float
        What the parameters are believed to be, or the size that they may have; not 0.
    noise : mapping of str to float
        Standard deviation of each channel that will be measured; its names are `FlightRecord`'s.
    time : ndarray
        Instants of the record [s], shape (n,).
    free_start : sequence of str
        Start values that will be identified besides; see `StartState`.
    known : mapping of str to float
        Values of other free symbols that are not controls.
    """

    dynamics: Dynamics
    initial: InitialState
    values: Mapping[str, float]
    noise: Mapping[str, float]
    time: Array
    free_start: Sequence[str] = ()
    known: Mapping[str, float] = field(default_factory=dict)

    @property
    def controls(self) -> tuple[str, ...]:
        """Free symbols that neither are to be identified nor are known."""
        return tuple(n for n in self.dynamics.parameter_names if n not in self.values and n not in self.known)

    def judge(self, inputs: Mapping[str, Signal | float], model: SensitivityModel | None = None) -> Promise:
        """What a flight with these controls will tell; those left out are 0.

        Raises
        ------
        InputError
            If a name is no control, or the flight is not finite.
        """
        return _Judge(self, model).promise(inputs)


@dataclass(frozen=True)
class Promise:
    """What a manoeuvre will tell.

    Parameters
    ----------
    names : tuple of str
        Parameters.
    values, standard_errors : ndarray
        Believed values, and the errors that estimates of them will have at best, shape (n,).
    covariance : ndarray
        Of the parameters, start values free besides, shape (n, n).
    findings : tuple of str
        What the record will not tell, in words: `accuracy.undetermined`.
    inputs : dict of str to Signal
    time : ndarray
        [s], shape (n,).
    outputs : dict of str to ndarray
        Each channel along the flight.
    """

    names: tuple[str, ...]
    values: Array
    standard_errors: Array
    covariance: Array
    findings: tuple[str, ...]
    inputs: dict[str, Signal]
    time: Array
    outputs: dict[str, Array]

    @property
    def relative_errors(self) -> dict[str, float]:
        """Standard error over value by parameter."""
        shares = self.standard_errors / np.abs(self.values)
        return dict(zip(self.names, (float(s) for s in shares), strict=True))

    @property
    def log_determinant(self) -> float:
        """Of the covariance of the parameters in units of their values: D-optimal designs have it smallest."""
        scaled = self.covariance / np.outer(self.values, self.values)
        return float(np.linalg.slogdet(scaled)[1])

    def correlation(self, one: str, other: str) -> float:
        """Of the estimates of two parameters."""
        i, j = self.names.index(one), self.names.index(other)
        return float(self.covariance[i, j] / (self.standard_errors[i] * self.standard_errors[j]))

    def summary(self) -> str:
        """Errors to be expected, and what the record will not tell."""
        driven = ", ".join(self.inputs) or "no control"
        lines = [f"a record of {self.time[-1] - self.time[0]:g} s with {driven} will tell"]
        for name, value, error in zip(self.names, self.values, self.standard_errors, strict=True):
            lines.append(f"  {name:<18}{value:>12.5g} +- {error:.3g} ({abs(error / value):.2g} of it)")
        return "\n".join([*lines, *(f"  {text}" for text in self.findings)])

    def plot(self) -> Figure:
        """Controls and channels along the flight."""
        import matplotlib.pyplot as plt

        rows = len(self.inputs) + len(self.outputs)
        figure, axes = plt.subplots(
            rows, 1, figsize=(8, 1.0 + 1.3 * rows), sharex=True, layout="constrained", squeeze=False
        )
        fine = np.linspace(self.time[0], self.time[-1], 2000)
        for ax, (name, signal) in zip(axes[:, 0], self.inputs.items(), strict=False):
            ax.plot(fine, signal.at(fine), color="C1")
            ax.set_ylabel(name)
        for ax, (name, values) in zip(axes[len(self.inputs) :, 0], self.outputs.items(), strict=True):
            ax.plot(self.time, values)
            ax.set_ylabel(name)
        axes[-1, 0].set_xlabel("time [s]")
        return figure


@dataclass(frozen=True)
class Ranking:
    """Manoeuvres in the order of what they promise.

    Parameters
    ----------
    wanted : tuple of str
        Parameters they are ranked for.
    promises : dict of str to Promise
        Best first.
    """

    wanted: tuple[str, ...]
    promises: dict[str, Promise]

    @property
    def best(self) -> str:
        """Name of the first."""
        return next(iter(self.promises))

    def summary(self) -> str:
        """Relative errors of the wanted parameters, a line a manoeuvre, and what the best will not tell."""
        width = max(len(name) for name in self.promises) + 2
        head = f"  {'manoeuvre':<{width}}" + "".join(f"{n:>18}" for n in self.wanted)
        lines = ["expected standard error over value", head]
        for name, promise in self.promises.items():
            shares = promise.relative_errors
            lines.append(f"  {name:<{width}}" + "".join(f"{shares[n]:>18.3g}" for n in self.wanted))
        return "\n".join([*lines, *(f"  {self.best}: {text}" for text in self.promises[self.best].findings)])


def rank_manoeuvres(
    experiment: Experiment, candidates: Mapping[str, Mapping[str, Signal | float]], wanted: Sequence[str] | None = None
) -> Ranking:
    """Judge several manoeuvres by the worst relative error of the wanted parameters.

    Parameters
    ----------
    experiment : Experiment
    candidates : mapping
        Controls of each manoeuvre, by its name.
    wanted : sequence of str, optional
        All parameters if not given. Of two that a record cannot separate, name both: the manoeuvre that separates them
        comes first.

    Raises
    ------
    InputError
        If there is no candidate, or a wanted name is no parameter.
    """
    names = tuple(experiment.values) if wanted is None else tuple(wanted)
    unknown = [name for name in names if name not in experiment.values]
    if unknown or not candidates:
        raise InputError(f"no parameter {unknown[0]!r} to rank for" if unknown else "no manoeuvre to rank")
    judge = _Judge(experiment)
    judged = {name: judge.promise(inputs) for name, inputs in candidates.items()}
    order = sorted(judged, key=lambda name: max(judged[name].relative_errors[n] for n in names))
    return Ranking(names, {name: judged[name] for name in order})


def improve_input(
    experiment: Experiment,
    control: str,
    start: Signal,
    amplitude: float,
    *,
    steps: int = 20,
    limits: Mapping[str, tuple[float, float]] | None = None,
    held: Mapping[str, Signal | float] | None = None,
    progress: Callable[[float], None] | None = None,
) -> Promise:
    """A control of constant steps that tells more than the one to start from, never less.

    Parameters
    ----------
    experiment : Experiment
    control : str
        To be designed.
    start : Signal
        To begin with; it is sampled in the middle of each step.
    amplitude : float
        Steps are of this size, of none, or of this size with the other sign; values of `start` between are kept until
        something better is found.
    steps : int
        Of equal length over the record.
    limits : mapping of str to pair of float, optional
        Lowest and highest value of channels along the flight, such as ``{"alpha": (0.0, 0.15)}``.
    held : mapping, optional
        Other controls.
    progress : callable, optional
        Told the fraction that is done.

    Raises
    ------
    InputError
        If the start breaks a limit, or a name is unknown.
    """
    if control not in experiment.controls:
        raise InputError(f"no control {control!r} to design; there are {', '.join(experiment.controls)}")
    bounds = dict(limits or {})
    unknown = [name for name in bounds if name not in experiment.noise]
    if unknown:
        raise InputError(f"no channel {unknown[0]!r} to limit; there are {', '.join(experiment.noise)}")
    judge, others = _Judge(experiment), dict(held or {})
    edges = np.linspace(experiment.time[0], experiment.time[-1], steps + 1)
    values = start.at(0.5 * (edges[1:] + edges[:-1]))

    def promise(levels: Array) -> Promise | None:
        return within(judge.promise({**others, control: Signal.pieces(edges, levels, levels[0], levels[-1])}))

    def within(found: Promise) -> Promise | None:
        inside = all(
            low <= float(np.min(found.outputs[n])) and float(np.max(found.outputs[n])) <= high
            for n, (low, high) in bounds.items()
        )
        return found if inside else None

    first = promise(values)
    if first is None:
        raise InputError("the input to start from breaks a limit: begin with a smaller one")
    best = first
    # an input of steps may tell less than the one it was sampled from, which then is to beat if it may be flown
    whole = within(judge.promise({**others, control: start}))
    for turn in range(_ROUNDS):
        before = best.log_determinant
        for i in range(steps):
            for level in (-amplitude, 0.0, amplitude):
                if level == values[i]:
                    continue
                trial = values.copy()
                trial[i] = level
                found = promise(trial)
                if found is not None and found.log_determinant < best.log_determinant - _BETTER:
                    best, values = found, trial
            if progress is not None:
                progress((turn + (i + 1) / steps) / _ROUNDS)
        if best.log_determinant > before - _BETTER:
            break
    return best if whole is None or best.log_determinant < whole.log_determinant else whole


class _Judge:
    """An experiment with its model compiled, for many inputs."""

    def __init__(self, experiment: Experiment, model: SensitivityModel | None = None) -> None:
        self.experiment = experiment
        stray = [n for n in (*experiment.values, *experiment.known) if n not in experiment.dynamics.parameter_names]
        if stray or not experiment.values:
            raise InputError(
                f"{stray[0]} is no free symbol of the model; there are {', '.join(experiment.dynamics.parameter_names)}"
                if stray
                else "an experiment needs a parameter to identify"
            )
        nothing = [name for name, value in experiment.values.items() if value == 0.0]
        if nothing:
            raise InputError(
                f"{nothing[0]} is believed to be 0, but errors are judged in units of that: give the size it may have"
            )
        self.model = SensitivityModel.of(experiment.dynamics, tuple(experiment.noise)) if model is None else model
        self.parameters = [Parameter(name, float(value)) for name, value in experiment.values.items()]
        time = np.asarray(experiment.time, dtype=float)
        blank = FlightRecord(time, {c: np.zeros(time.size) for c in experiment.noise}, {}, dict(experiment.noise))
        self.manoeuvre = Manoeuvre.of_flight(
            blank,
            experiment.dynamics,
            experiment.initial,
            free_start=experiment.free_start,
            steps_per_interval=substeps_needed(time, self._fastest()),
            model=self.model,
        )

    def _fastest(self) -> float:
        """Largest eigenvalue of the motion at the start, controls 0 [rad/s]: how short steps must be."""
        dynamics = self.experiment.dynamics
        believed = {**self.experiment.known, **self.experiment.values}
        parameters = [believed.get(name, 0.0) for name in dynamics.parameter_names]
        slope = dynamics.jacobian(dynamics.initial_vector(self.experiment.initial, parameters), parameters)
        return float(np.max(np.abs(np.linalg.eigvals(slope))))

    def promise(self, inputs: Mapping[str, Signal | float]) -> Promise:
        experiment = self.experiment
        stray = [name for name in inputs if name not in experiment.controls]
        if stray:
            raise InputError(f"no control {stray[0]!r}; there are {', '.join(experiment.controls) or 'none'}")
        known = {**dict.fromkeys(experiment.controls, 0.0), **inputs, **experiment.known}
        problem = Problem([replace(self.manoeuvre, known=known)], self.parameters, 1)
        channels = self.model.channels
        noise = Noise(dict.fromkeys(channels, 1.0), dict.fromkeys(channels, np.zeros(0)))
        with threadpool_limits(limits=1, user_api="blas"):
            point = problem.look(problem.start, None)
            if point is None:
                raise InputError("the flight with these controls is not finite: make them or the record smaller")
            slopes, _ = problem.system(point, noise)
            silent = np.linalg.norm(slopes, axis=0) == 0.0
            covariance = np.full((slopes.shape[1], slopes.shape[1]), 0.0)
            covariance[np.ix_(~silent, ~silent)] = cramer_rao(slopes[:, ~silent])
        covariance[silent, silent] = math.inf
        n = len(self.parameters)
        own, values = covariance[:n, :n], np.array([p.start for p in self.parameters])
        names = tuple(p.name for p in self.parameters)
        findings = tuple(f"{name} will have no effect" for name, dead in zip(names, silent[:n], strict=True) if dead)
        if not findings:
            findings = undetermined(names, values, own)
        outputs = point.marched[0].outputs
        return Promise(
            names,
            values,
            np.sqrt(np.diag(own)),
            own,
            findings,
            {name: value for name, value in inputs.items() if isinstance(value, Signal)},
            np.asarray(experiment.time, dtype=float),
            {channel: outputs[:, i] for i, channel in enumerate(channels)},
        )
