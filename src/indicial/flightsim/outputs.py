r"""What an instrument reads in flight, as casadi expressions: outputs of linear models and targets of trims.

Through still air on a flat earth, all of the centre of gravity, body axes:

    V, alpha = atan2(w, u), beta = asin(v/V), path_angle, climb_rate, altitude, phi, theta, p, q, r,
    ax, ay, az = d(u, v, w)/dt + omega x (u, v, w) - R^T g     (specific force, as accelerometers feel it)
    load_factor = -(az cos(alpha) - ax sin(alpha))/g0          (across the velocity, in the plane of symmetry)
    mach, dynamic_pressure
"""

from __future__ import annotations

from typing import Any

import casadi as ca

from indicial.errors import InputError
from indicial.flightsim.dynamics import POSITION, QUATERNION, RATE, VELOCITY, Dynamics, rotation_matrix
from indicial.flightsim.earth import FlatEarth

STANDARD_GRAVITY = 9.80665
"""g0 of load factors [m/s^2]."""

OUTPUTS = (
    *("V", "alpha", "beta", "path_angle", "climb_rate", "altitude", "phi", "theta", "p", "q", "r"),
    *("ax", "ay", "az", "load_factor", "mach", "dynamic_pressure"),
)


def require_steady_surroundings(dynamics: Dynamics) -> None:
    """Refuse what no flight is steady in: wind, which a turning vehicle meets from changing sides, and a round earth.

    Raises
    ------
    InputError
    """
    if dynamics.wind is not None:
        raise InputError("steady flight is taken through still air: build the dynamics without wind for it")
    if not isinstance(dynamics.earth, FlatEarth):
        raise InputError(f"steady flight needs a FlatEarth, not {type(dynamics.earth).__name__}, which turns under it")


def flight_outputs(dynamics: Dynamics, state: Any, parameters: Any, time: float) -> dict[str, Any]:
    """Every one of `OUTPUTS` as an expression of state and parameters."""
    u, v, w = ca.vertsplit(state[VELOCITY])
    speed = ca.norm_2(state[VELOCITY])
    vertical = vertical_in_body(state[QUATERNION])
    rate = dynamics.derivative(state, parameters, time)
    _, _, density, sound, _ = dynamics.loads(state, parameters, time)
    climb = -ca.dot(vertical, state[VELOCITY])
    felt = rate[VELOCITY] + ca.cross(state[RATE], state[VELOCITY])
    felt = felt - ca.mtimes(rotation_matrix(state[QUATERNION]).T, dynamics.earth.gravity(state[POSITION]))
    across = ca.sqrt(u * u + w * w)
    p, q, r = ca.vertsplit(state[RATE])
    values = {
        "V": speed,
        "alpha": ca.atan2(w, u),
        "beta": ca.asin(v / speed),
        "path_angle": ca.asin(climb / speed),
        "climb_rate": climb,
        "altitude": dynamics.altitude(state),
        "phi": ca.atan2(vertical[1], vertical[2]),
        "theta": -ca.asin(vertical[0]),
        "p": p,
        "q": q,
        "r": r,
        "ax": felt[0],
        "ay": felt[1],
        "az": felt[2],
        "load_factor": (felt[0] * w - felt[2] * u) / (across * STANDARD_GRAVITY),
        "mach": speed / sound,
        "dynamic_pressure": 0.5 * density * speed**2,
    }
    assert tuple(values) == OUTPUTS
    return values


def vertical_in_body(quaternion: Any) -> Any:
    """Downward unit vector in body axes, of a quaternion of any norm."""
    return rotation_matrix(quaternion).T[:, 2]
