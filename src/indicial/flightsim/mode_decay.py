r"""A mode's eigenvalue read from a nonlinear flight, as a check of the linear model that it came from.

The flight starts disturbed along the mode's shape. The left eigenvector y of the mode picks it out of the disturbance,

    c(t) = y^H (x(t) - x_steady) = c(0) exp(lambda t)

in a linear flight; lambda is the slope of log c fitted over the record. What the nonlinear flight adds falls with the
amplitude.
"""

from __future__ import annotations

import math

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.attitude import euler_angles, quaternion_from_euler
from indicial.flightsim.dynamics import RIGID_STATES
from indicial.flightsim.initial import InitialState
from indicial.flightsim.linear import LinearFlight
from indicial.flightsim.modes import Mode
from indicial.flightsim.simulate import fly
from indicial.flightsim.trajectory import Trajectory

_SAMPLES = 400
_LONGEST = 3.0  # times that a mode may grow or die by a factor e in a record


def fitted_eigenvalue(linear: LinearFlight, mode: Mode, *, amplitude: float = 1e-3, periods: float = 2.0) -> complex:
    """Eigenvalue [1/s] of a mode fitted to a nonlinear flight that starts along its shape.

    Parameters
    ----------
    linear : LinearFlight
        With the attitude's states theta and phi (nose not vertical).
    mode : Mode
        Of `aircraft_modes` of it.
    amplitude : float
        Of the largest of V/speed and the angles [rad].
    periods : float
        Length of the flight, in turns of the mode; at most three times the time of a factor e.

    Raises
    ------
    InputError
        If the mode is not the linear model's, or neutral: there is nothing to fit.
    """
    from scipy.linalg import eig

    values, left, _ = eig(linear.a, left=True, right=True)
    at = int(np.argmin(np.abs(values - mode.eigenvalue)))
    if abs(values[at] - mode.eigenvalue) > 1e-6 * max(1.0, abs(mode.eigenvalue)):
        raise InputError(f"{mode.name} is no mode of this linear model")
    if abs(mode.eigenvalue) < 1e-8:
        raise InputError(f"{mode.name} is neutral: there is no decay to fit")
    shape = np.array([mode.shape[name] for name in linear.states])
    turn = periods * mode.period if mode.frequency else math.inf
    time = min(turn, _LONGEST / abs(mode.damping) if mode.damping else math.inf)
    steady = linear.trim
    start = _moved(linear, amplitude * shape.real)
    flown = fly(
        steady.dynamics,
        start,
        time,
        method="dop853",
        step=time / _SAMPLES,
        tolerance=1e-11,
        parameters=dict(steady.parameters),
    )
    seen = _read(linear, flown) - _read_trim(linear)
    along = seen @ left[:, at].conj()
    if mode.frequency:
        phase = np.unwrap(np.angle(along))
        return complex(_slope(flown.time, np.log(np.abs(along))), _slope(flown.time, phase))
    return complex(_slope(flown.time, np.log(np.abs(along))), 0.0)


def _slope(time: Array, values: Array) -> float:
    return float(np.polyfit(time - time.mean(), values, 1)[0])


def _moved(linear: LinearFlight, change: Array) -> InitialState:
    """The steady flight changed by values of the linear model's states."""
    new = dict(zip(linear.states, _read_trim(linear) + change, strict=True))
    steady = linear.trim
    psi = float(euler_angles(steady.state[6:10])[0])
    speed, alpha, beta = new["V"], new["alpha"], new["beta"]
    velocity = speed * np.array([math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)])
    position = steady.state[:3].copy()
    if "altitude" in new:
        position[2] = -new["altitude"]
    lags = np.array([new[name] for name in linear.lag_states])
    return InitialState(
        velocity,
        quaternion_from_euler(psi, new["theta"], new["phi"]),
        np.array([new[name] for name in "pqr"]),
        position,
        lags if lags.size else None,
    )


def _read_trim(linear: LinearFlight) -> Array:
    state = linear.trim.state
    u, v, w = state[3:6]
    speed = math.sqrt(u * u + v * v + w * w)
    _, theta, phi = euler_angles(state[6:10])
    values = {"V": speed, "alpha": math.atan2(w, u), "beta": math.asin(v / speed), "theta": theta, "phi": phi}
    values |= dict(zip("pqr", state[10:13], strict=True)) | {"altitude": -state[2]}
    values |= dict(zip(linear.lag_states, state[len(RIGID_STATES) :], strict=True))
    return np.array([float(values[name]) for name in linear.states])


def _read(linear: LinearFlight, flown: Trajectory) -> Array:
    u, v, w = flown.velocity.T
    speed = np.sqrt(u * u + v * v + w * w)
    _, theta, phi = flown.euler.T
    values = {"V": speed, "alpha": np.arctan2(w, u), "beta": np.arcsin(v / speed), "theta": theta, "phi": phi}
    values |= dict(zip("pqr", flown.rate.T, strict=True)) | {"altitude": -flown.position[:, 2]}
    values |= dict(zip(linear.lag_states, flown.lag.T, strict=True))
    seen: Array = np.stack([values[name] for name in linear.states], axis=1)
    return seen
