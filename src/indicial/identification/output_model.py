r"""The flight model as a function from unknowns to what the stations of a range see, with exact sensitivities.

Unknowns are derivatives and the state at the first station. With the Runge-Kutta step ``x+ = phi(x, p, h)`` the
sensitivities ``S = dx/dtheta`` follow from its exact Jacobians, ``S+ = phi_x S + phi_p``: those of the numbers that
the integrator gives, not of the equations it approximates.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim import (
    DERIVATIVES,
    Atmosphere,
    DerivativeAerodynamics,
    Dynamics,
    Earth,
    InitialState,
    Trajectory,
    Vehicle,
    build_dynamics,
)
from indicial.flightsim.simulate import record

SUMS = {"Cm_q+Cm_alphadot": ("Cm_q", "Cm_alphadot"), "CN_q+CN_alphadot": ("CN_q", "CN_alphadot")}
"""Sums that count as one derivative: their second part is held at the model's value, the first takes the rest."""

FREE_FLIGHT = ("CA_0", "CN_alpha", "Cm_alpha", "Cm_q+Cm_alphadot")
"""What the free flight of a missile that does not roll determines."""

NOT_ROLLING = ("x", "y", "z", "Vx", "Vy", "Vz", "yaw", "pitch", "q", "r")
ROLLING = (*NOT_ROLLING, "roll", "p")
"""Unknowns of the first station: position [m], velocity [m/s] in earth axes, Euler angles [rad], body rates [rad/s]."""

CHANNELS = ("x", "y", "z", "yaw", "pitch")

_PHASE = 0.1  # rad; angle of the fastest motion in one Runge-Kutta step


@dataclass(frozen=True)
class OutputModel:
    """What stations see of a flight, and its derivatives with respect to the unknowns.

    It is built once for one vehicle, choice of free derivatives and number of stations, and serves any record of them.

    Parameters
    ----------
    dynamics : Dynamics
        Its parameters are the free derivatives.
    derivatives : tuple of str
        Free derivatives and sums.
    initial : tuple of str
        Unknowns of the first station.
    channels : tuple of str
        What is measured.
    stations, substeps : int
        Number of stations, and of Runge-Kutta steps between two of them.
    outputs_function : casadi.Function
        (unknowns, intervals) -> (outputs, sensitivities, states).
    plain_function : casadi.Function
        (unknowns, intervals) -> outputs.
    """

    dynamics: Dynamics
    derivatives: tuple[str, ...]
    initial: tuple[str, ...]
    channels: tuple[str, ...]
    stations: int
    substeps: int
    outputs_function: Any
    plain_function: Any

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the unknowns: derivatives, then the state at the first station."""
        return (*self.derivatives, *self.initial)

    def outputs(self, unknowns: ArrayLike, time: ArrayLike) -> Array:
        """What the stations see at `time` [s], shape (n_stations, n_channels)."""
        return np.array(self.plain_function(unknowns, self._steps(time))).T

    def sensitivities(self, unknowns: ArrayLike, time: ArrayLike) -> tuple[Array, Array]:
        """Outputs (n_stations, n_channels) and their derivatives (n_stations, n_channels, n_unknowns)."""
        seen, slopes, _ = self.outputs_function(unknowns, self._steps(time))
        shape = (self.stations, len(self.names), len(self.channels))
        return np.array(seen).T, np.array(slopes).T.reshape(shape).transpose(0, 2, 1)

    def trajectory(self, unknowns: ArrayLike, time: Array) -> Trajectory:
        """The flight at the stations."""
        states = np.array(self.outputs_function(unknowns, self._steps(time))[2]).T
        values = np.asarray(unknowns, dtype=float)[: len(self.derivatives)]
        return record(self.dynamics, time, states, values, {"method": "output error"})

    def _steps(self, time: ArrayLike) -> Array:
        lengths = np.diff(np.asarray(time, dtype=float)) / self.substeps
        if lengths.shape != (self.stations - 1,):
            raise InputError(f"this output model has {self.stations} stations, the record {np.size(time)}")
        return np.repeat(lengths, self.substeps)[None, :]


def substeps_needed(time: ArrayLike, fastest: float) -> int:
    """Runge-Kutta steps between stations, such that the fastest motion [rad/s] turns by 0.1 rad at most in one."""
    return max(1, math.ceil(float(np.max(np.diff(np.asarray(time)))) * fastest / _PHASE))


def build_output_model(
    vehicle: Vehicle,
    aerodynamics: DerivativeAerodynamics,
    free: Sequence[str] = FREE_FLIGHT,
    *,
    stations: int,
    substeps: int,
    roll: bool = False,
    atmosphere: Atmosphere | None = None,
    earth: Earth | None = None,
) -> OutputModel:
    """The output model of a vehicle on a range.

    Parameters
    ----------
    vehicle : Vehicle
    aerodynamics : DerivativeAerodynamics
        Gives every derivative that is not free its value.
    free : sequence of str
        Names in `indicial.flightsim.DERIVATIVES`, ``Cl_0``, or the sums ``Cm_q+Cm_alphadot`` and ``CN_q+CN_alphadot``.
        A free flight separates the parts of the sums only in so far as incidence and attitude part, which is by the
        curvature of the path: too little to measure.
    stations, substeps : int
        See `substeps_needed`.
    roll : bool
        Whether roll is measured. If not, the missile is taken not to roll.
    atmosphere, earth : optional
        See `indicial.flightsim.build_dynamics`.

    Raises
    ------
    InputError
        If a name is unknown, there twice or, being part of a sum, stands beside it.
    """
    dynamics = build_dynamics(vehicle, _with_symbols(aerodynamics, free), atmosphere, earth)
    derivatives = tuple(name for name in dynamics.parameter_names)
    initial = ROLLING if roll else NOT_ROLLING
    channels = (*CHANNELS, "roll") if roll else CHANNELS
    start = _start(initial)
    view = _view(channels)
    steps = (stations - 1) * substeps
    return OutputModel(
        dynamics=dynamics,
        derivatives=derivatives,
        initial=initial,
        channels=channels,
        stations=stations,
        substeps=substeps,
        outputs_function=_march_with_sensitivities(dynamics, start, view, steps, substeps, len(initial)),
        plain_function=_march(dynamics, start, view, steps, substeps, len(initial)),
    )


def _with_symbols(aerodynamics: DerivativeAerodynamics, free: Iterable[str]) -> DerivativeAerodynamics:
    wanted = tuple(free)
    plain = {part: name for name in wanted for part in SUMS.get(name, (name,))}
    count = sum(len(SUMS.get(name, (name,))) for name in wanted)
    allowed = (*DERIVATIVES, "Cl_0", *SUMS)
    for name in wanted:
        if name not in allowed:
            raise InputError(f"no derivative {name!r} to identify; there are {', '.join(allowed)}")
    if not wanted or len(plain) != count:
        raise InputError(
            f"derivatives to identify must be named once, a sum without its parts, not {', '.join(wanted)}"
        )
    values: dict[str, Any] = {name: ca.SX.sym(name) for name in wanted if name not in SUMS}
    for name, (first, second) in SUMS.items():
        if name in wanted:
            values[first] = ca.SX.sym(name) - getattr(aerodynamics, second)
    return replace(aerodynamics, **values)


def _start(initial: tuple[str, ...]) -> Any:
    """State at the first station: casadi.Function unknowns -> (state (13, 1), its Jacobian (13, n))."""
    unknowns = ca.SX.sym("initial", len(initial))
    value = dict(zip(initial, ca.vertsplit(unknowns), strict=True))
    yaw, pitch, roll = value["yaw"], value["pitch"], value.get("roll", ca.SX(0))
    cy, sy, cp, sp = ca.cos(yaw / 2), ca.sin(yaw / 2), ca.cos(pitch / 2), ca.sin(pitch / 2)
    cr, sr = ca.cos(roll / 2), ca.sin(roll / 2)
    quaternion = ca.vertcat(
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
    velocity = ca.mtimes(_rotation(quaternion).T, ca.vertcat(value["Vx"], value["Vy"], value["Vz"]))
    position = ca.vertcat(value["x"], value["y"], value["z"])
    rate = ca.vertcat(value.get("p", ca.SX(0)), value["q"], value["r"])
    state = ca.vertcat(position, velocity, quaternion, rate)
    return ca.Function("start", [unknowns], [ca.densify(state), ca.densify(ca.jacobian(state, unknowns))])


def _view(channels: tuple[str, ...]) -> Any:
    """What a station sees of a state: casadi.Function state -> outputs (n_channels, 1)."""
    state = ca.SX.sym("state", 13)
    r = _rotation(state[6:10] / ca.norm_2(state[6:10]))
    seen = {
        **{name: state[i] for i, name in enumerate("xyz")},
        "yaw": ca.atan2(r[1, 0], r[0, 0]),
        "pitch": -ca.asin(r[2, 0]),
        "roll": ca.atan2(r[2, 1], r[2, 2]),
    }
    return ca.Function("view", [state], [ca.vertcat(*(seen[name] for name in channels))])


def _rotation(quaternion: Any) -> Any:
    """Rotation matrix body -> earth of a unit quaternion."""
    w, x, y, z = ca.vertsplit(quaternion)
    return ca.vertcat(
        ca.horzcat(1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        ca.horzcat(2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        ca.horzcat(2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def _march(dynamics: Dynamics, start: Any, view: Any, steps: int, substeps: int, n_initial: int) -> Any:
    n = len(dynamics.parameter_names)
    unknowns, lengths = ca.MX.sym("unknowns", n + n_initial), ca.MX.sym("steps", 1, steps)
    first, _ = start(unknowns[n:])
    states = dynamics.march(steps)(first, unknowns[:n], lengths)
    at_stations = ca.horzcat(first, states[:, substeps - 1 :: substeps])
    seen = view.map(1 + steps // substeps)(at_stations)
    return ca.Function("outputs", [unknowns, lengths], [seen])


def _march_with_sensitivities(
    dynamics: Dynamics, start: Any, view: Any, steps: int, substeps: int, n_initial: int
) -> Any:
    """(unknowns, steps) -> outputs (nc, n), their sensitivities (nc n_unknowns, n), by columns, and states (nx, n)."""
    n = len(dynamics.parameter_names)
    unknowns, lengths = ca.MX.sym("unknowns", n + n_initial), ca.MX.sym("steps", 1, steps)
    state, slope = start(unknowns[n:])
    first = ca.vertcat(state, ca.MX.zeros(13 * n), ca.vec(slope))
    step = _step_with_sensitivities(dynamics, n + n_initial).mapaccum("march", steps)
    marched = step(first, ca.repmat(unknowns[:n], 1, steps), lengths)
    kept = ca.horzcat(first, marched[:, substeps - 1 :: substeps])

    carried = ca.SX.sym("carried", 13 * (1 + n + n_initial))
    state, slopes = carried[:13], ca.reshape(carried[13:], 13, n + n_initial)
    seen = view(state)
    outlook = ca.Function("outlook", [carried], [seen, ca.vec(ca.mtimes(ca.jacobian(seen, state), slopes))])
    values, derivatives = outlook.map(1 + steps // substeps)(kept)
    return ca.Function("outputs", [unknowns, lengths], [values, derivatives, kept[:13, :]])


def _step_with_sensitivities(dynamics: Dynamics, n_unknowns: int) -> Any:
    """One step of state and sensitivities, stacked: (carried, parameters, step [s]) -> carried."""
    n = len(dynamics.parameter_names)
    carried, parameters = ca.SX.sym("carried", 13 * (1 + n_unknowns)), ca.SX.sym("parameters", n)
    length = ca.SX.sym("step")
    state, slope = carried[:13], ca.reshape(carried[13:], 13, n_unknowns)
    after = dynamics.step()(state, parameters, length)
    direct = ca.horzcat(ca.jacobian(after, parameters), ca.SX(13, n_unknowns - n))
    slope_after = ca.mtimes(ca.jacobian(after, state), slope) + direct
    return ca.Function("step", [carried, parameters, length], [ca.vertcat(after, ca.vec(ca.densify(slope_after)))])


def unknowns_of(state: InitialState, initial: tuple[str, ...]) -> Array:
    """Values of the unknowns of the first station for a state, shape (n,)."""
    from indicial.flightsim.attitude import euler_angles, matrix_from_quaternion

    velocity = matrix_from_quaternion(state.quaternion) @ state.velocity
    yaw, pitch, roll = euler_angles(state.quaternion)
    values = dict(
        zip(ROLLING, (*state.position, *velocity, yaw, pitch, *state.rate[1:], roll, state.rate[0]), strict=True)
    )
    return np.array([values[name] for name in initial])
