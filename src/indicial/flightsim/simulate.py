"""Flying a model: fixed-step Runge-Kutta inside CasADi, or an adaptive scheme as a cross-check."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.flightsim.aerodynamics import Aerodynamics
from indicial.flightsim.atmosphere import Atmosphere
from indicial.flightsim.dynamics import POSITION, QUATERNION, RATE, VELOCITY, Dynamics, build_dynamics
from indicial.flightsim.earth import Earth
from indicial.flightsim.initial import InitialState
from indicial.flightsim.trajectory import Trajectory
from indicial.flightsim.vehicle import Vehicle

log = logging.getLogger(__name__)

Method = Literal["rk4", "dop853"]

_BLOCK = 2048  # steps marched at a time between looks at the end condition
_MAX_STEPS = 20_000_000


@dataclass(frozen=True)
class End:
    """Where a flight ends, if that is before its duration is over.

    Parameters
    ----------
    x : float, optional
        Downrange station [m], reached from below.
    altitude : float, optional
        Altitude [m], reached from above.
    """

    x: float | None = None
    altitude: float | None = None

    def margins(self, dynamics: Dynamics, states: Array) -> Array:
        """What is left until each end [m], shape (n_ends, n), negative once passed; states are (n, nx)."""
        left = []
        if self.x is not None:
            left.append(self.x - states[:, 0])
        if self.altitude is not None:
            left.append(np.array(dynamics.altitude(states.T)).ravel() - self.altitude)
        return np.array(left).reshape(len(left), len(states))


def simulate(
    vehicle: Vehicle,
    aerodynamics: Aerodynamics,
    initial: InitialState,
    duration: float,
    *,
    step: float | None = None,
    every: int | None = None,
    end: End | None = None,
    method: Method = "rk4",
    atmosphere: Atmosphere | None = None,
    earth: Earth | None = None,
    estimate_error: bool = True,
) -> Trajectory:
    """Fly a vehicle: `build_dynamics`, then `fly`."""
    dynamics = build_dynamics(vehicle, aerodynamics, atmosphere, earth)
    return fly(
        dynamics, initial, duration, step=step, every=every, end=end, method=method, estimate_error=estimate_error
    )


def fly(
    dynamics: Dynamics,
    initial: InitialState,
    duration: float,
    *,
    step: float | None = None,
    every: int | None = None,
    end: End | None = None,
    method: Method = "rk4",
    parameters: Mapping[str, float] | None = None,
    estimate_error: bool = True,
) -> Trajectory:
    """Fly a model from an initial state.

    Parameters
    ----------
    dynamics : Dynamics
    initial : InitialState
    duration : float
        [s]; the flight ends there at the latest.
    step : float, optional
        Of "rk4" [s]. If not given, see `suggest_step`.
    every : int, optional
        Every how many steps an instant is kept; the first and last always are. 1 if `step` is given, else by
        `suggest_step`.
    end : End, optional
    method : {"rk4", "dop853"}
        Fixed-step Runge-Kutta of fourth order, marched inside CasADi; or SciPy's adaptive DOP853 at a tolerance
        of 1e-11, much slower, as a second implementation.
    parameters : mapping, optional
        Values of the model's free symbols.
    estimate_error : bool
        Fly "rk4" again with half the step, and record the difference, (16/15) of which is the error of the flight
        returned, in the provenance.

    Raises
    ------
    InputError
        If duration or step make no sense.
    DivergenceError
        If the state does not stay finite.
    """
    if not (math.isfinite(duration) and duration > 0.0):
        raise InputError(f"flight duration is {duration} s, must be positive and finite")
    values = dynamics.parameter_vector(parameters)
    start = dynamics.initial_vector(initial, values)
    if step is None:
        step, kept = suggest_step(dynamics, start, values, duration)
    else:
        kept = 1
    every = kept if every is None else every
    if not (math.isfinite(step) and 0.0 < step <= duration) or duration / step > _MAX_STEPS:
        raise InputError(f"step is {step} s, must be at most the duration and no less than 1/{_MAX_STEPS} of it")
    if every < 1:
        raise InputError(f"every is {every}, must be at least 1 (every step is kept)")
    end = End() if end is None else end
    if end.margins(dynamics, start[None, :]).min(initial=math.inf) <= 0.0:
        raise InputError("the flight starts beyond its end")
    provenance: dict[str, Any] = {"method": method, "step_s": step, "every": every}
    if method == "dop853":
        time, states = _adaptive(dynamics, start, values, duration, every * step, end)
    elif method == "rk4":
        time, states = _fixed_step(dynamics, start, values, duration, step, every, end)
        if estimate_error:
            finer = _fixed_step(dynamics, start, values, duration, step / 2.0, 2 * every, end)
            provenance |= _difference(time, states, *finer)
    else:
        raise InputError(f"method is {method!r}, must be 'rk4' or 'dop853'")
    return record(dynamics, time, states, values, provenance)


def suggest_step(dynamics: Dynamics, state: Array, parameters: Array, duration: float) -> tuple[float, int]:
    """Step [s] and every how many of them to keep.

    The step is at most a tenth of the flight, a tenth of the time constant of the rigid body (its lag states held)
    at `state`, and half of that of the fastest eigenvalue, a lag that follows the motion: five times inside the
    stability limit. The instants kept are a tenth of the rigid body's time constant apart, or closer.
    """
    jacobian = np.array(dynamics.derivative.jacobian()(state, parameters, 0)[0])
    fastest, rigid = (float(np.max(np.abs(np.linalg.eigvals(m)))) for m in (jacobian[3:, 3:], jacobian[3:13, 3:13]))
    instants = math.ceil(max(10.0, duration * rigid / 0.1))
    steps = max(instants, math.ceil(duration * fastest / 0.5))
    return duration / steps, steps // instants


def record(dynamics: Dynamics, time: Array, states: Array, parameters: Array, provenance: dict[str, Any]) -> Trajectory:
    """The trajectory of states (n, nx), with loads evaluated and range checked."""
    outputs = dynamics.loads(states.T, np.tile(parameters[:, None], (1, len(time))))
    force, moment, density, sound = (np.array(output).T for output in outputs)
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
        reference=dynamics.vehicle.reference.about(dynamics.vehicle.centre_of_gravity),
        lag_names=dynamics.state_names[13:],
        provenance={"vehicle": dynamics.vehicle.name, **provenance},
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


def _fixed_step(
    dynamics: Dynamics, start: Array, parameters: Array, duration: float, step: float, every: int, end: End
) -> tuple[Array, Array]:
    """Instants kept (n,) and states (n, nx), the first included; the last step is cut to meet the end exactly."""
    lengths = _step_lengths(duration, step)
    time = np.append(step * np.arange(lengths.size), duration)
    kept, blocks, before = [0], [start[None, :]], start
    for first in range(0, lengths.size, _BLOCK):
        chosen = lengths[first : first + _BLOCK]
        if first == 0 or chosen.size < _BLOCK:
            march = dynamics.march(chosen.size)
        states = np.array(march(before, parameters, chosen[None, :])).T
        passed = np.any(end.margins(dynamics, states) <= 0.0, axis=0)
        flown = int(np.argmax(passed)) if np.any(passed) else chosen.size
        good = np.all(np.isfinite(states[:flown]), axis=1)
        if not np.all(good):
            when = time[first + int(np.argmin(good))]
            raise DivergenceError(f"flight is not finite after t = {when:.6g} s: try a step below {step:.3g} s")
        index = first + 1 + np.arange(flown)
        wanted = (index % every == 0) | (index == lengths.size)
        kept += index[wanted].tolist()
        blocks.append(states[:flown][wanted])
        if flown < chosen.size:
            here = states[flown - 1] if flown else before
            length, last = _last_step(dynamics, here, parameters, chosen[flown], end)
            return np.append(time[kept], time[first + flown] + length), np.vstack([*blocks, last])
        before = states[-1]
    return time[kept], np.vstack(blocks)


def _step_lengths(duration: float, step: float) -> Array:
    """Equal steps, and a shorter last one if they do not fill the duration."""
    whole = math.floor(duration / step * (1.0 + 1e-12))
    rest = duration - whole * step
    return np.full(whole, step) if rest < 1e-9 * step else np.append(np.full(whole, step), rest)


def _last_step(dynamics: Dynamics, state: Array, parameters: Array, step: float, end: End) -> tuple[float, Array]:
    """Length [s] of the step that meets the end, and the state there, shape (1, nx)."""
    from scipy.optimize import brentq

    one = dynamics.step()

    def after(length: float) -> Array:
        return np.array(one(state, parameters, length)).T

    def margin(length: float) -> float:
        return float(end.margins(dynamics, after(length)).min())

    length = float(brentq(margin, 0.0, step, xtol=1e-14 * step, rtol=1e-14))
    return length, after(length)


def _adaptive(
    dynamics: Dynamics, start: Array, parameters: Array, duration: float, step: float, end: End
) -> tuple[Array, Array]:
    from scipy.integrate import solve_ivp

    def derivative(_: float, state: Array) -> Array:
        return np.array(dynamics.derivative(state, parameters)).ravel()

    def margin(_: float, state: Array) -> float:
        return float(end.margins(dynamics, state[None, :]).min(initial=math.inf))

    margin.terminal = True  # type: ignore[attr-defined]
    events = None if end == End() else margin
    times = np.append(np.arange(0.0, duration * (1.0 - 1e-12), step), duration)
    scale = np.maximum(np.abs(start), 1.0)
    result = solve_ivp(
        derivative, (0.0, duration), start, "DOP853", times, rtol=1e-11, atol=1e-13 * scale, events=events
    )
    if not result.success:
        raise DivergenceError(f"adaptive flight stopped at t = {result.t[-1]:.6g} s: {result.message}")
    time, states = result.t, result.y.T
    if result.status == 1 and result.t_events[0][0] > time[-1]:
        time, states = np.append(time, result.t_events[0][0]), np.vstack([states, result.y_events[0]])
    return time, states


def _difference(time: Array, states: Array, finer_time: Array, finer: Array) -> dict[str, float]:
    """Error of `states`: 16/15 of the difference from a flight of half the step, at the instants of both."""
    n = min(len(time), len(finer_time))
    shared = np.isclose(time[:n], finer_time[:n], rtol=1e-12, atol=0.0)
    coarse, fine = states[:n][shared], finer[:n][shared]
    position = np.max(np.linalg.norm(coarse[:, POSITION] - fine[:, POSITION], axis=1))
    a, b = (y[:, QUATERNION] / np.linalg.norm(y[:, QUATERNION], axis=1, keepdims=True) for y in (coarse, fine))
    attitude = np.max(4.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(a - b, axis=1), 0.0, 1.0)))
    return {
        "position_error_m": float(position) * 16.0 / 15.0,
        "attitude_error_rad": float(attitude) * 16.0 / 15.0,
    }
