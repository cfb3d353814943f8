"""What instruments see of a state: the channels of records as casadi expressions of a flight model."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import casadi as ca

from indicial.errors import InputError
from indicial.flightsim import Dynamics
from indicial.identification.instruments import Installation

_BODY_RATES = ("p", "q", "r")
_SPECIFIC = ("ax", "ay", "az")
_TURNS = ("phi", "psi", "roll", "yaw")

ANGLES = ("alpha", "beta", "theta", "pitch", *_TURNS)
"""Channels that are angles: a residual of theirs is taken within half a turn."""


def channel_expressions(
    dynamics: Dynamics,
    channels: Sequence[str],
    state: Any,
    parameters: Any,
    time: Any,
    installation: Installation | None = None,
) -> list[Any]:
    """The channels, in the order asked for; names and units are those of `FlightRecord` and `RangeRecord`.

    Specific force is ``vdot + (omega + Omega) x v - omega x cdot - R^T g``: all that acts but gravity, over mass; at a
    place r from the centre of gravity ``omegadot x r + omega x (omega x r)`` more, and the air there ``omega x r``.
    Without an installation all is at the centre of gravity.

    Raises
    ------
    InputError
        If there is no such channel.
    """
    r = rotation(state[6:10] / ca.norm_2(state[6:10]))
    _, _, _, sound, wind = dynamics.loads(state, parameters, time)
    density = dynamics.loads(state, parameters, time)[2]
    place, omega = Installation() if installation is None else installation, state[10:13]
    through_air = state[3:6] - wind + ca.cross(omega, ca.DM(place.vanes))
    speed = ca.norm_2(through_air)
    change = dynamics.derivative(state, parameters, time)
    earth_rate = ca.mtimes(r.T, ca.DM(dynamics.earth.rotation))
    gravity = ca.mtimes(r.T, dynamics.earth.gravity(state[:3]))
    felt = change[3:6] + ca.cross(state[10:13] + earth_rate, state[3:6]) - gravity
    felt -= ca.cross(omega, _drift(dynamics, parameters, time))
    arm = ca.DM(place.accelerometers)
    felt += ca.cross(change[10:13], arm) + ca.cross(omega, ca.cross(omega, arm))
    seen = {
        **{name: state[i] for i, name in enumerate("xyz")},
        "altitude": dynamics.altitude(state),
        "V": speed,
        "alpha": place.upwash * ca.atan2(through_air[2], through_air[0]),
        "beta": place.sidewash * ca.asin(through_air[1] / speed),
        "mach": speed / sound,
        "dynamic_pressure": 0.5 * density * speed**2,
        **{name: state[10 + i] for i, name in enumerate(_BODY_RATES)},
        **{f"{name}dot": change[10 + i] for i, name in enumerate(_BODY_RATES)},
        **{name: felt[i] for i, name in enumerate(_SPECIFIC)},
    }
    seen["psi"] = seen["yaw"] = ca.atan2(r[1, 0], r[0, 0])
    seen["theta"] = seen["pitch"] = -ca.asin(r[2, 0])
    seen["phi"] = seen["roll"] = ca.atan2(r[2, 1], r[2, 2])
    unknown = [name for name in channels if name not in seen]
    if unknown:
        raise InputError(f"no channel {unknown[0]!r} of a flight model; there are {', '.join(seen)}")
    return [seen[name] for name in channels]


def rotation(quaternion: Any) -> Any:
    """Rotation matrix body -> earth of a unit quaternion."""
    w, x, y, z = ca.vertsplit(quaternion)
    return ca.vertcat(
        ca.horzcat(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        ca.horzcat(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        ca.horzcat(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def _drift(dynamics: Dynamics, parameters: Any, time: Any) -> Any:
    """Velocity of the centre of gravity in the body as mass burns, body axes [m/s]."""
    clock = ca.SX.sym("clock")
    centre = dynamics.mass_properties(parameters, clock)[1]
    # mesh axes are x aft and z up: the body's x and z, turned about
    drift = ca.jacobian(centre, clock) * ca.DM([-1.0, 1.0, -1.0])
    return ca.substitute(drift, clock, time)
