"""Many flights whose start, vehicle, derivatives and wind are drawn at random.

Whatever is to vary is a symbol of the model (a derivative, the mass, a component of the wind) or a quantity of the
start. All draws are made before the first flight, so that a seed is a result, whatever the number of threads.
"""

from __future__ import annotations

import csv
import io
import math
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.files import write_text
from indicial.flightsim.dynamics import Dynamics
from indicial.flightsim.initial import InitialState
from indicial.flightsim.march import ENDED, NOT_FINITE, runge_kutta
from indicial.flightsim.signals import Parameters, Schedule
from indicial.flightsim.simulate import End

if TYPE_CHECKING:
    from matplotlib.figure import Figure

START = ("speed", "alpha", "beta", "path_angle", "heading", "bank", "p", "q", "r", "x", "y", "z")
"""What may vary of the start [m/s, rad, rad/s, m]; see `InitialState.from_path`."""


@dataclass(frozen=True)
class Dispersion:
    """Normal deviations from the values given, correlated if told so.

    Parameters
    ----------
    names : tuple of str
        Of `START`, and of the model's parameters.
    covariance : array_like
        Shape (n, n).

    Raises
    ------
    InputError
        If the covariance is not one, or a name stands twice.
    """

    names: tuple[str, ...]
    covariance: Array

    def __post_init__(self) -> None:
        matrix = np.array(self.covariance, dtype=float)
        n = len(self.names)
        if len(set(self.names)) != n or matrix.shape != (n, n):
            raise InputError(f"{n} names, each once, need a covariance of shape ({n}, {n}), not {matrix.shape}")
        if not np.all(np.isfinite(matrix)) or not np.allclose(matrix, matrix.T):
            raise InputError("a covariance must be finite and symmetric")
        scale = np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
        if np.min(np.linalg.eigvalsh(matrix / np.outer(scale, scale)), initial=0.0) < -1e-9:
            raise InputError("a covariance must not be negative in any direction")
        object.__setattr__(self, "covariance", matrix)

    @classmethod
    def independent(cls, **standard_deviations: float) -> Dispersion:
        """One standard deviation for each name."""
        return cls(tuple(standard_deviations), np.diag(np.square(list(standard_deviations.values()))))

    def with_(self, other: Dispersion) -> Dispersion:
        """Both, independent of each other."""
        n = len(self.names)
        matrix = np.zeros((n + len(other.names),) * 2)
        matrix[:n, :n], matrix[n:, n:] = self.covariance, other.covariance
        return Dispersion(self.names + other.names, matrix)

    def draw(self, count: int, seed: int) -> Array:
        """Deviations, shape (count, n)."""
        values, directions = np.linalg.eigh(self.covariance)
        half = directions * np.sqrt(np.maximum(values, 0.0))
        drawn: Array = np.random.default_rng(seed).standard_normal((count, len(self.names))) @ half.T
        return drawn


@dataclass(frozen=True)
class MonteCarlo:
    """Where many flights went.

    Parameters
    ----------
    names : tuple of str
        What varied.
    drawn : ndarray
        Its deviations, shape (n, n_names).
    time : ndarray
        Duration of each flight [s], shape (n,).
    final : ndarray
        Final state of each, shape (n, nx).
    ended : ndarray of bool
        Whether it met the end, shape (n,); else it flew for its duration.
    largest_angle : ndarray
        Largest angle between axis and path (of attack, in still air) at 500 instants [rad], shape (n,).
    failed : ndarray of bool
        Flights that did not stay finite, shape (n,); left out of every figure below.
    state_names : tuple of str
    seed : int
    """

    names: tuple[str, ...]
    drawn: Array
    time: Array
    final: Array
    ended: NDArray[np.bool_]
    largest_angle: Array
    failed: NDArray[np.bool_]
    state_names: tuple[str, ...]
    seed: int
    provenance: dict[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return int(self.time.size)

    def column(self, name: str) -> Array:
        """Values of a final state, ``time``, ``largest_angle`` or what varied, of the flights that did not fail.

        Raises
        ------
        InputError
            If there is none of that name.
        """
        known = {"time": self.time, "largest_angle": self.largest_angle}
        known |= {f"drawn {one}": self.drawn[:, i] for i, one in enumerate(self.names)}
        known |= {one: self.final[:, i] for i, one in enumerate(self.state_names)}
        if name not in known:
            raise InputError(f"no {name!r}; there are {', '.join(known)}")
        return known[name][~self.failed]

    def percentiles(self, name: str, levels: Sequence[float] = (5.0, 50.0, 95.0)) -> Array:
        """Percentiles of a `column`."""
        found: Array = np.percentile(self.column(name), np.asarray(levels, dtype=float))
        return found

    def footprint(self, axes: tuple[str, str] = ("y", "z"), level: float = 0.95) -> tuple[Array, Array]:
        """Ellipse that holds a share of the final points, if they are normal: its centre, and the half axes as columns.

        ``(x - centre)^T C^-1 (x - centre) = chi^2_2(level) = -2 ln(1 - level)``.
        """
        if not 0.0 < level < 1.0:
            raise InputError(f"level is {level}, must lie between 0 and 1")
        points = np.stack([self.column(name) for name in axes])
        values, directions = np.linalg.eigh(np.cov(points))
        half: Array = directions * np.sqrt(np.maximum(values, 0.0) * -2.0 * math.log1p(-level))
        return points.mean(axis=1), half

    def circular_error(self, axes: tuple[str, str] = ("y", "z")) -> float:
        """Radius [m] about the mean point that holds half of the flights."""
        points = np.stack([self.column(name) for name in axes])
        return float(np.median(np.linalg.norm(points - points.mean(axis=1, keepdims=True), axis=0)))

    def summary(self, axes: tuple[str, str] = ("y", "z")) -> str:
        """Percentiles of the end, and the circular error."""
        lines = [
            f"{len(self)} flights, seed {self.seed}: {np.count_nonzero(self.ended)} met their end, "
            f"{np.count_nonzero(self.failed)} failed; what varied: {', '.join(self.names)}",
            f"  {'':<16}{'5%':>12}{'median':>12}{'95%':>12}",
        ]
        for name in ("time", "x", "y", "z", "largest_angle"):
            low, middle, high = self.percentiles(name)
            lines.append(f"  {name:<16}{low:>12.5g}{middle:>12.5g}{high:>12.5g}")
        across = " and ".join(axes)
        return "\n".join([*lines, f"  half of the flights within {self.circular_error(axes):.4g} m in {across}"])

    def to_csv(self, path: str | Path) -> None:
        """One row a flight: what was drawn, how it ended, the final state."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        drawn = [f"drawn {name}" for name in self.names]
        writer.writerow([*drawn, "time", "largest_angle", "ended", "failed", *self.state_names])
        for i in range(len(self)):
            numbers = [*self.drawn[i].tolist(), float(self.time[i]), float(self.largest_angle[i])]
            outcome = [int(self.ended[i]), int(self.failed[i])]
            writer.writerow([*map(repr, numbers), *outcome, *map(repr, self.final[i].tolist())])
        write_text(path, out.getvalue())

    def plot(self, axes: tuple[str, str] = ("y", "z")) -> Figure:
        """The footprint with its ellipses, and the distribution of the largest angle."""
        import matplotlib.pyplot as plt

        figure, panels = plt.subplots(1, 2, figsize=(11, 5), layout="constrained")
        across, along = (self.column(name) for name in axes)
        panels[0].plot(across, along, ".", markersize=3, alpha=0.5, label=f"{across.size} flights")
        turn = np.linspace(0.0, 2.0 * np.pi, 200)
        for level in (0.5, 0.95):
            centre, half = self.footprint(axes, level)
            ellipse = centre[:, None] + half @ np.stack([np.cos(turn), np.sin(turn)])
            panels[0].plot(*ellipse, label=f"{level:.0%} if normal")
        panels[0].set(xlabel=f"{axes[0]} at the end [m]", ylabel=f"{axes[1]} at the end [m]", aspect="equal")
        panels[0].set_adjustable("datalim")
        panels[0].legend()
        panels[1].hist(np.degrees(self.column("largest_angle")), bins=40)
        panels[1].set(xlabel="largest total angle of attack [deg]", ylabel="flights")
        return figure


def monte_carlo(
    dynamics: Dynamics,
    start: Mapping[str, float],
    dispersion: Dispersion,
    duration: float,
    *,
    flights: int,
    seed: int,
    step: float,
    parameters: Parameters | None = None,
    end: End | None = None,
    threads: int | None = None,
) -> MonteCarlo:
    """Fly a model many times, by Runge-Kutta with fixed steps, from starts and with parameters drawn at random.

    Parameters
    ----------
    dynamics : Dynamics
    start : mapping
        Mean values of the start, by the names in `START`; those not given are 0. A speed is needed.
    dispersion : Dispersion
        Of the start and of parameters.
    duration : float
        Of each flight at most [s].
    flights : int
    seed : int
    step : float
        [s].
    parameters : mapping, optional
        Mean values of the model's parameters; a `Signal` flies as it is given.
    end : End, optional
    threads : int, optional
        As many as there are cores if not given; results do not depend on it.

    Raises
    ------
    InputError
        If a name is unknown, or a start or parameter is missing.
    """
    if not (flights >= 1 and 0.0 < step <= duration):
        raise InputError(f"{flights} flights of {duration} s in steps of {step} s: all must be positive")
    schedule = Schedule.of(dynamics.parameter_names, parameters)
    unknown = sorted(set(start) - set(START))
    if unknown or "speed" not in start:
        raise InputError(f"a start needs a speed and may have {', '.join(START)}; given are {', '.join(start)}")
    _check_names(dispersion.names, schedule)
    drawn = dispersion.draw(flights, seed)
    vectors = np.tile(schedule.at(0.0)[:, 0], (flights, 1))
    for column, name in enumerate(dispersion.names):
        if name in dynamics.parameter_names:
            vectors[:, dynamics.parameter_names.index(name)] += drawn[:, column]
    starts = [
        _start(dynamics, start, dispersion.names, row, values) for row, values in zip(drawn, vectors, strict=True)
    ]
    workers = min(flights, threads or os.cpu_count() or 1)
    shares = np.array_split(np.arange(flights), workers)
    out = _Outcome.of(flights, len(dynamics.state_names))
    fleet = _Fleet(dynamics, np.array(starts), vectors, schedule, duration, step, End() if end is None else end)
    fleet.compile()
    with ThreadPoolExecutor(workers) as pool:
        list(pool.map(lambda share: fleet.fly(share, out), shares))
    names = dispersion.names
    made = {"vehicle": dynamics.vehicle.name, "step_s": step}
    return MonteCarlo(
        names, drawn, out.time, out.final, out.ended, out.angle, out.failed, dynamics.state_names, seed, made
    )


def _check_names(names: Sequence[str], schedule: Schedule) -> None:
    for name in names:
        if name in schedule.signals:
            raise InputError(f"{name} is a function of time here and cannot vary: make its size a parameter")
        if name in schedule.names and name in START:
            raise InputError(f"{name} is both a parameter of the model and a quantity of the start: rename the symbol")
        if name not in schedule.names and name not in START:
            known = ", ".join((*START, *schedule.names))
            raise InputError(f"{name} cannot vary: neither of the start nor a parameter; there are {known}")


def _start(
    dynamics: Dynamics, mean: Mapping[str, float], names: Sequence[str], deviations: Array, parameters: Array
) -> Array:
    values = dict.fromkeys(START, 0.0) | {name: float(value) for name, value in mean.items()}
    for name, deviation in zip(names, deviations, strict=True):
        if name in values:
            values[name] += float(deviation)
    rate, position = ([values.pop(name) for name in group] for group in (("p", "q", "r"), ("x", "y", "z")))
    speed = values.pop("speed")
    angles: dict[str, Any] = values
    return dynamics.initial_vector(InitialState.from_path(speed, rate=rate, position=position, **angles), parameters)


@dataclass(frozen=True)
class _Outcome:
    """What the threads fill, each its own rows."""

    time: Array
    final: Array
    ended: NDArray[np.bool_]
    angle: Array
    failed: NDArray[np.bool_]

    @classmethod
    def of(cls, n: int, states: int) -> _Outcome:
        flags = [np.zeros(n, dtype=bool) for _ in range(2)]
        return cls(np.zeros(n), np.zeros((n, states)), flags[0], np.zeros(n), flags[1])


@dataclass(frozen=True)
class _Fleet:
    """All flights, ready to go."""

    dynamics: Dynamics
    starts: Array
    parameters: Array
    schedule: Schedule
    duration: float
    step: float
    end: End

    def compile(self) -> None:
        """Before threads need them."""
        self.dynamics.rate_kernel, self.dynamics.monitor_kernel  # noqa: B018

    def fly(self, share: NDArray[np.int64], out: _Outcome) -> None:
        """Some of them, one after the other."""
        every = max(1, math.ceil(0.002 * self.duration / self.step))
        room = math.ceil(self.duration / self.step * (1.0 + 1e-12)) // every + 4
        times, states = np.empty(room), np.empty((room, self.starts.shape[1]))
        rate, monitor = self.dynamics.rate_kernel.code, self.dynamics.monitor_kernel.code
        drive, rows = self.schedule.drive, self.end.rows
        for i in share:
            kept, outcome = runge_kutta(
                rate,
                monitor,
                self.starts[i],
                self.parameters[i],
                drive,
                self.duration,
                self.step,
                every,
                rows,
                times,
                states,
            )
            u, v, w = states[:kept, 3], states[:kept, 4], states[:kept, 5]
            out.angle[i] = float(np.max(np.arctan2(np.hypot(v, w), u)))
            out.time[i], out.final[i] = times[kept - 1], states[kept - 1]
            out.ended[i], out.failed[i] = outcome == ENDED, outcome == NOT_FINITE
