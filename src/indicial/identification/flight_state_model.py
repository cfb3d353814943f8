r"""The flight model with noise, as filters take it: Euler angles for the quaternion, and only the states that move.

A unit quaternion has four numbers for three freedoms, so the covariance of its errors is singular; Euler angles have
none of that and are not defined at a pitch of 90 deg only. Rates, loads and channels are those of `Dynamics` and
`channels`: the one model.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
from numpy.typing import ArrayLike

from indicial.errors import InputError
from indicial.flightsim import Dynamics, InitialState
from indicial.flightsim.attitude import euler_angles
from indicial.flightsim.expressions import TIME
from indicial.identification.channels import channel_expressions
from indicial.identification.state_model import Process, StateModel, check_names, state_model

MOTION = ("x", "y", "z", "u", "v", "w", "phi", "theta", "psi", "p", "q", "r")
"""States of flight: position in earth axes [m], velocity over the ground in body axes [m/s], Euler angles [rad] (not
defined at a pitch of 90 deg), body rates [rad/s]; lag states of the aerodynamics come after them."""


def flight_model(
    dynamics: Dynamics,
    states: Sequence[str],
    channels: Sequence[str],
    *,
    held: Mapping[str, float] | None = None,
    intensity: Mapping[str, float] | None = None,
    processes: Mapping[str, Process] | None = None,
    substeps: int = 1,
) -> StateModel:
    """The flight model with noise.

    Parameters
    ----------
    dynamics : Dynamics
    states : sequence of str
        Those of `MOTION` and lag states that move, as ``("u", "w", "theta", "q")`` for flight in the plane of symmetry.
    channels : sequence of str
        Those of flight records.
    held : mapping of str to float
        Values of the states that do not move; 0 where not given.
    intensity, processes, substeps
        See `state_model`. A gust is a process that stands for a symbol in the model's wind; its own rate of change
        is not among what the alphadot derivatives see.

    Raises
    ------
    InputError
        If a name is unknown.
    """
    lags = dynamics.state_names[13:]
    every = (*MOTION, *lags)
    check_names("state", states, every)
    check_names("held state", held or {}, every)
    symbol = {name: ca.SX.sym(name) for name in every}
    values = {name: symbol[name] if name in states else ca.SX(float((held or {}).get(name, 0.0))) for name in every}
    free = [ca.SX.sym(name) for name in dynamics.parameter_names]
    clash = set(every) & set(dynamics.parameter_names)
    if clash:
        raise InputError(f"symbols of the model have names of states: {', '.join(sorted(clash))}")
    full, given = _full_state(values, lags), ca.vertcat(ca.SX(0, 1), *free)
    moving = _euler_rates(dynamics.derivative(full, given, TIME), full, lags)
    seen = channel_expressions(dynamics, channels, full, given, TIME)
    return state_model(
        {name: moving[name] for name in states},
        dict(zip(channels, seen, strict=True)),
        [*(symbol[name] for name in states), *free],
        intensity=intensity,
        processes=processes,
        substeps=substeps,
    )


def flight_start(
    dynamics: Dynamics, initial: InitialState, states: Sequence[str], parameters: ArrayLike = ()
) -> dict[str, float]:
    """Values of states of `flight_model` at an initial state; lag states that it does not give settle.

    Raises
    ------
    InputError
        If a name is unknown.
    """
    lags = dynamics.state_names[13:]
    check_names("state", states, (*MOTION, *lags))
    vector = dynamics.initial_vector(initial, parameters)
    psi, theta, phi = (float(angle) for angle in euler_angles(vector[6:10]))
    values = dict(zip((*MOTION, *lags), [*vector[:6], phi, theta, psi, *vector[10:]], strict=True))
    return {name: float(values[name]) for name in states}


def _full_state(values: Mapping[str, Any], lags: Sequence[str]) -> Any:
    (cr, sr), (cp, sp), (cy, sy) = (
        (ca.cos(values[name] / 2), ca.sin(values[name] / 2)) for name in ("phi", "theta", "psi")
    )
    quaternion = [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ]
    before, after = [values[n] for n in MOTION[:6]], [values[n] for n in (*MOTION[9:], *lags)]
    return ca.vertcat(*before, *quaternion, *after)


def _euler_rates(rate: Any, full: Any, lags: Sequence[str]) -> dict[str, Any]:
    """Rates of the states in Euler angles, from those with the quaternion."""
    unit = ca.SX.sym("quaternion", 4)
    w, x, y, z = ca.vertsplit(unit)
    angles = ca.vertcat(
        ca.atan2(2 * (y * z + w * x), w * w - x * x - y * y + z * z),
        ca.asin(2 * (w * y - x * z) / ca.sumsqr(unit)),
        ca.atan2(2 * (x * y + w * z), w * w + x * x - y * y - z * z),
    )
    turning = ca.substitute(ca.jacobian(angles, unit), unit, full[6:10])
    stacked = ca.vertcat(rate[:6], ca.mtimes(turning, rate[6:10]), rate[10:])
    return dict(zip((*MOTION, *lags), ca.vertsplit(stacked), strict=True))
