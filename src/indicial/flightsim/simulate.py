"""Flying a model: compiled Runge-Kutta, with fixed steps or with error control; CVODES for fast lag states."""

from __future__ import annotations

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.flightsim.aerodynamics import Aerodynamics
from indicial.flightsim.atmosphere import Atmosphere
from indicial.flightsim.dynamics import POSITION, QUATERNION, RATE, VELOCITY, Dynamics, build_dynamics
from indicial.flightsim.earth import Earth
from indicial.flightsim.forces import Force
from indicial.flightsim.initial import InitialState
from indicial.flightsim.march import NOT_FINITE, TOO_MANY_STEPS, adaptive, dop853, runge_kutta
from indicial.flightsim.signals import Parameters, Schedule
from indicial.flightsim.trajectory import Trajectory
from indicial.flightsim.vehicle import Vehicle
from indicial.flightsim.wind import Wind

log = logging.getLogger(__name__)

Method = Literal["rk4", "cvodes", "dop853"]

TOLERANCE = 1e-11
"""Relative tolerance of the adaptive methods."""

_STIFF_BLOCK = 128  # instants CVODES marches between looks at the end: nothing need be well behaved beyond it
_STIFF = 10  # steps an instant from which CVODES takes less time than Runge-Kutta
MAX_STEPS = 20_000_000
_MAX_ADAPTIVE_STEPS = 400_000
_LEAST_TOLERANCE = 1e-14  # that double precision can tell


@dataclass(frozen=True)
class End:
    """Where a flight ends, if that is before its duration is over.

    Parameters
    ----------
    x : float, optional
        Downrange station [m], reached from below.
    altitude : float, optional
        Altitude [m], reached from above.
    apogee : bool
        Where the vehicle, climbing until then, begins to fall.
    """

    x: float | None = None
    altitude: float | None = None
    apogee: bool = False

    @property
    def rows(self) -> Array:
        """(monitored quantity, sign, level) of each end, as `march` takes them, shape (n, 3)."""
        rows = []
        if self.x is not None:
            rows.append((0, -1.0, self.x))
        if self.altitude is not None:
            rows.append((1, 1.0, self.altitude))
        if self.apogee:
            rows.append((2, 1.0, 0.0))
        return np.array(rows, dtype=float).reshape(len(rows), 3)

    def margins(self, dynamics: Dynamics, states: Array, parameters: Array) -> Array:
        """What is left until each end [m, m, m/s], shape (n_ends, n), negative once passed; states are (n, nx).

        Parameters hold for all states.
        """
        values = np.tile(parameters[:, None], (1, len(states)))
        seen = np.array(dynamics.monitor(states.T, values, 0.0))
        rows = self.rows
        margins: Array = rows[:, 1:2] * (seen[rows[:, 0].astype(int)] - rows[:, 2:3])
        return margins


def simulate(
    vehicle: Vehicle,
    aerodynamics: Aerodynamics,
    initial: InitialState,
    duration: float,
    *,
    step: float | None = None,
    every: int | None = None,
    end: End | None = None,
    method: Method | None = None,
    atmosphere: Atmosphere | None = None,
    earth: Earth | None = None,
    wind: Wind | None = None,
    forces: Sequence[Force] = (),
    parameters: Parameters | None = None,
    estimate_error: bool = True,
) -> Trajectory:
    """Fly a vehicle: `build_dynamics`, then `fly`."""
    dynamics = build_dynamics(vehicle, aerodynamics, atmosphere, earth, wind, forces)
    return fly(
        dynamics,
        initial,
        duration,
        step=step,
        every=every,
        end=end,
        method=method,
        parameters=parameters,
        estimate_error=estimate_error,
    )


def fly(
    dynamics: Dynamics,
    initial: InitialState,
    duration: float,
    *,
    step: float | None = None,
    every: int | None = None,
    end: End | None = None,
    method: Method | None = None,
    parameters: Parameters | None = None,
    estimate_error: bool = True,
    tolerance: float = TOLERANCE,
) -> Trajectory:
    """Fly a model from an initial state.

    Parameters
    ----------
    dynamics : Dynamics
    initial : InitialState
    duration : float
        [s]; the flight ends there at the latest.
    step : float, optional
        Of "rk4" [s]; the other methods choose their own. If not given, see `suggest_step`.
    every : int, optional
        Every how many steps an instant is kept; the first and last always are. 1 if `step` is given, else by
        `suggest_step`. The other methods keep instants as far apart ("cvodes" evenly spaced, no farther).
    end : End, optional
    method : {"rk4", "cvodes", "dop853"}, optional
        Fixed-step Runge-Kutta of fourth order, compiled; CVODES in CasADi, for lag states far faster than the
        motion; or compiled DOP853, of order 8, whose steps follow the error. If not given, "rk4" if `step` is, else
        by `suggest_method`.
    tolerance : float
        Relative, of the adaptive methods; the absolute one is a hundredth of it (times the state's size at the start,
        where that is larger than 1).
    parameters : mapping, optional
        Values of the model's free symbols: numbers, or a `Signal` for one that changes with time, such as a control.
        "dop853" stops at each point of a signal; the steps of "rk4" go over it, and lose order unless they meet it.
    estimate_error : bool
        Fly again and record the error of the flight returned in the provenance: "rk4" with half the step, 16/15 of
        the difference; the others with a hundredth of the tolerance, the difference.

    Raises
    ------
    InputError
        If duration or step make no sense.
    DivergenceError
        If the state does not stay finite.
    """
    if not (math.isfinite(duration) and duration > 0.0):
        raise InputError(f"flight duration is {duration} s, must be positive and finite")
    schedule = Schedule.of(dynamics.parameter_names, parameters)
    values = schedule.at(0.0)[:, 0]
    start = dynamics.initial_vector(initial, values)
    if step is None:
        step, kept = suggest_step(dynamics, start, values, duration)
        if method is None:
            method = "dop853" if schedule.signals else suggest_method(kept)
    else:
        kept = 1
        method = "rk4" if method is None else method
    every = kept if every is None else every
    if every < 1:
        raise InputError(f"every is {every}, must be at least 1 (every step is kept)")
    if method != "rk4":
        step, every = every * step, 1  # instants only
    if not (math.isfinite(step) and 0.0 < step <= duration) or duration / step > MAX_STEPS:
        raise InputError(f"step is {step} s, must be at most the duration and no less than 1/{MAX_STEPS} of it")
    end = End() if end is None else end
    if end.margins(dynamics, start[None, :], values).min(initial=math.inf) < 0.0:
        raise InputError("the flight starts beyond its end")
    flight = _Flight(dynamics, start, schedule, duration, end)
    provenance: dict[str, Any] = {"method": method, "tolerance": tolerance}
    if method in ("dop853", "cvodes"):
        march = _adaptive if method == "dop853" else _stiff
        time, states = march(flight, step, tolerance)
        if estimate_error:
            provenance |= _difference(time, states, *march(flight, step, max(0.01 * tolerance, _LEAST_TOLERANCE)))
    elif method == "rk4":
        provenance = {"method": method, "step_s": step, "every": every}
        time, states = _fixed_step(flight, step, every)
        if estimate_error:
            finer = _difference(time, states, *_fixed_step(flight, step / 2.0, 2 * every))
            provenance |= {name: 16.0 / 15.0 * value for name, value in finer.items()}
    else:
        raise InputError(f"method is {method!r}, must be 'rk4', 'cvodes' or 'dop853'")
    return record(dynamics, time, states, schedule.at(time), provenance)


def suggest_step(dynamics: Dynamics, state: Array, parameters: Array, duration: float) -> tuple[float, int]:
    """Step [s] and every how many of them to keep.

    The step is at most a tenth of the flight, a tenth of the time constant of the rigid body (its lag states held)
    at `state`, and half of that of the fastest eigenvalue, a lag that follows the motion: five times inside the
    stability limit. The instants kept are a tenth of the rigid body's time constant apart, or closer.
    """
    jacobian = dynamics.jacobian(state, parameters)
    fastest, rigid = (float(np.max(np.abs(np.linalg.eigvals(m)))) for m in (jacobian[3:, 3:], jacobian[3:13, 3:13]))
    instants = math.ceil(max(10.0, duration * rigid / 0.1))
    steps = max(instants, math.ceil(duration * fastest / 0.5))
    return duration / steps, steps // instants


def suggest_method(every: int) -> Method:
    """CVODES where `suggest_step` takes many steps an instant, Runge-Kutta where the motion itself rules its step."""
    return "cvodes" if every > _STIFF else "rk4"


def record(dynamics: Dynamics, time: Array, states: Array, parameters: Array, provenance: dict[str, Any]) -> Trajectory:
    """The trajectory of states (n, nx), with loads evaluated and range checked.

    Parameters are those of all instants (n_parameters,), or of each (n_parameters, n).
    """
    if parameters.ndim == 1:
        parameters = np.tile(parameters[:, None], (1, len(time)))
    outputs = dynamics.loads(states.T, parameters, time[None, :])
    force, moment, density, sound, wind = (np.array(output).T for output in outputs)
    x, y, z = np.array(dynamics.mass_properties(parameters[:, 0], time[0])[1]).ravel().tolist()
    quaternion = states[:, QUATERNION] / np.linalg.norm(states[:, QUATERNION], axis=1, keepdims=True)
    trajectory = Trajectory(
        time=time,
        position=states[:, POSITION],
        velocity=states[:, VELOCITY],
        quaternion=quaternion,
        rate=states[:, RATE],
        force=force,
        moment=moment,
        density=density.ravel(),
        speed_of_sound=sound.ravel(),
        lag=states[:, 13:],
        outside_range=np.zeros(len(time), dtype=bool),
        reference=dynamics.vehicle.reference.about((x, y, z)),
        lag_names=dynamics.state_names[13:],
        provenance={"vehicle": dynamics.vehicle.name, **provenance},
        wind=wind,
    )
    outside = _outside(dynamics, trajectory, states)
    if np.any(outside):
        log.warning("flight leaves the stated range of its models at t = %.6g s", time[np.argmax(outside)])
    return replace(trajectory, outside_range=outside)


def _outside(dynamics: Dynamics, trajectory: Trajectory, states: Array) -> NDArray[np.bool_]:
    validity = dynamics.aerodynamics.validity
    low, high = dynamics.atmosphere.altitude_range
    altitude = np.array(dynamics.altitude(states.T)).ravel()
    mach, moving = trajectory.mach, trajectory.speed > 0.0
    outside: NDArray[np.bool_] = (
        (moving & (trajectory.total_angle > validity.alpha_max))
        | (mach < validity.mach_min)
        | (mach > validity.mach_max)
        | (altitude < low)
        | (altitude > high)
    )
    return outside


class _Flight(NamedTuple):
    """What every method flies."""

    dynamics: Dynamics
    start: Array
    schedule: Schedule
    duration: float
    end: End


def _fixed_step(flight: _Flight, step: float, every: int) -> tuple[Array, Array]:
    dynamics, start, schedule, duration, end = flight
    room = math.ceil(duration / step * (1.0 + 1e-12)) // every + 3
    times, states = np.empty(room), np.empty((room, start.size))
    rate, monitor = dynamics.rate_kernel.code, dynamics.monitor_kernel.code
    kept, outcome = runge_kutta(
        rate, monitor, start, schedule.at(0.0)[:, 0], schedule.drive, duration, step, every, end.rows, times, states
    )
    if outcome == NOT_FINITE:
        raise DivergenceError(f"flight is not finite after t = {times[kept - 1]:.6g} s: try a step below {step:.3g} s")
    return times[:kept].copy(), states[:kept].copy()


def _adaptive(flight: _Flight, spacing: float, tolerance: float) -> tuple[Array, Array]:
    """Instants `spacing` [s] apart, and where the flight ends."""
    dynamics, start, schedule, duration, end = flight
    instants = np.append(np.arange(0.0, duration * (1.0 - 1e-12), spacing), duration)
    times, states = np.empty(instants.size + 1), np.empty((instants.size + 1, start.size))
    absolute = 0.01 * tolerance * np.maximum(np.abs(start), 1.0)
    rate, monitor = dynamics.rate_kernel.code, dynamics.monitor_kernel.code
    limits = (tolerance, absolute)
    # what depends on time or place may be short: a step from one instant to the next at most
    largest = spacing if dynamics.time_dependent or dynamics.wind is not None else math.inf
    kept, outcome, _ = adaptive(
        rate,
        monitor,
        start,
        schedule.at(0.0)[:, 0],
        schedule.drive,
        instants,
        limits,
        largest,
        end.rows,
        dop853(),
        _MAX_ADAPTIVE_STEPS,
        times,
        states,
    )
    if outcome in (NOT_FINITE, TOO_MANY_STEPS):
        why = "it takes too many steps" if outcome == TOO_MANY_STEPS else "it is not finite, or its steps vanish"
        raise DivergenceError(f"adaptive flight stopped after t = {times[kept - 1]:.6g} s: {why}")
    return times[:kept].copy(), states[:kept].copy()


def _stiff(flight: _Flight, spacing: float, tolerance: float) -> tuple[Array, Array]:
    """Instants evenly spaced over the duration, at most `spacing` [s] apart; the last step is cut to meet the end."""
    dynamics, start, schedule, duration, end = flight
    if schedule.signals:
        raise InputError(f"CVODES does not take signals ({', '.join(schedule.signals)}); 'rk4' and 'dop853' do")
    parameters = schedule.at(0.0)[:, 0]
    number = math.ceil(duration / spacing * (1.0 - 1e-12))
    even = duration / number
    time = np.append(even * np.arange(number), duration)
    blocks, before = [start[None, :]], start
    for first in range(0, number, _STIFF_BLOCK):
        chosen = min(_STIFF_BLOCK, number - first)
        if first == 0 or chosen < _STIFF_BLOCK:
            march = dynamics.stiff_march(chosen, tolerance)
        states = _marched(march, before, parameters, even)
        passed = np.any(end.margins(dynamics, states, parameters) <= 0.0, axis=0)
        flown = int(np.argmax(passed)) if np.any(passed) else chosen
        good = np.all(np.isfinite(states[:flown]), axis=1)
        if not np.all(good):
            when = time[first + int(np.argmin(good))]
            within = f"CVODES gave up within the next {_STIFF_BLOCK * even:.3g} s"
            raise DivergenceError(f"flight is not finite after t = {when:.6g} s: {within}")
        blocks.append(states[:flown])
        if flown < chosen:
            here = states[flown - 1] if flown else before
            length, last = _last_step(flight, dynamics.stiff_march(1, tolerance), here, even)
            return np.append(time[: first + flown + 1], time[first + flown] + length), np.vstack([*blocks, last])
        before = states[-1]
    return time, np.vstack(blocks)


def _last_step(flight: _Flight, one: Any, state: Array, step: float) -> tuple[float, Array]:
    """Length [s] of the step that meets the end, and the state there, shape (1, nx)."""
    from scipy.optimize import brentq

    parameters = flight.schedule.at(0.0)[:, 0]

    def after(length: float) -> Array:
        return _marched(one, state, parameters, length)

    def margin(length: float) -> float:
        return float(flight.end.margins(flight.dynamics, after(length), parameters).min())

    if margin(step) >= 0.0:  # it ends there, to round-off
        return step, after(step)
    length = float(brentq(margin, 0.0, step, xtol=1e-14 * step, rtol=1e-14))
    return length, after(length)


def _marched(march: Any, state: Array, parameters: Array, spacing: float) -> Array:
    """States at each instant, shape (n, nx); not a number if CVODES gave up."""
    try:
        return np.array(march(state, parameters, spacing)).T
    except RuntimeError as error:
        log.debug("march failed: %s", error)
        return np.full((march.size2_out(0), state.size), np.nan)


def _difference(time: Array, states: Array, finer_time: Array, finer: Array) -> dict[str, float]:
    """Largest difference of position and attitude from a finer flight, at the instants of both."""
    n = min(len(time), len(finer_time))
    shared = np.isclose(time[:n], finer_time[:n], rtol=1e-12, atol=0.0)
    coarse, fine = states[:n][shared], finer[:n][shared]
    position = np.max(np.linalg.norm(coarse[:, POSITION] - fine[:, POSITION], axis=1))
    a, b = (y[:, QUATERNION] / np.linalg.norm(y[:, QUATERNION], axis=1, keepdims=True) for y in (coarse, fine))
    attitude = np.max(4.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(a - b, axis=1), 0.0, 1.0)))
    return {"position_error_m": float(position), "attitude_error_rad": float(attitude)}
