"""The state at the start of a record as a function of unknowns that an engineer has a feeling for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim import Dynamics, InitialState
from indicial.flightsim.attitude import euler_angles, matrix_from_quaternion
from indicial.identification.channels import rotation

_POSITION = ("x", "y", "z")
_EARTH_VELOCITY = ("Vx", "Vy", "Vz")
_PATH = ("V", "alpha", "beta")
_RANGE_ANGLES, _FLIGHT_ANGLES = ("yaw", "pitch", "roll"), ("psi", "theta", "phi")
_RATES = ("p", "q", "r")


@dataclass(frozen=True)
class StartState:
    """State at the first instant, by position [m], velocity, Euler angles [rad], body rates [rad/s] and lag states.

    Velocity over the ground is ``Vx Vy Vz`` [m/s] in earth axes with angles called ``yaw pitch roll`` (ranges), or
    ``V`` [m/s], ``alpha``, ``beta`` [rad] with ``psi theta phi`` (flight test). Where wind blows, these V, alpha and
    beta are of the motion over the ground.

    Parameters
    ----------
    free : tuple of str
        Unknown; all else is held.
    values : ndarray
        Of all, shape (12 + lag states,).
    names : tuple of str
    function : casadi.Function
        values -> (state, Jacobian).
    """

    free: tuple[str, ...]
    values: Array
    names: tuple[str, ...]
    function: Any

    @classmethod
    def of(cls, dynamics: Dynamics, initial: InitialState | Array, free: Sequence[str]) -> StartState:
        """The start of a model near a state, some of whose values are free.

        Raises
        ------
        InputError
            If a name is unknown, stands twice, or belongs to the other set of names.
        """
        state = initial if not isinstance(initial, InitialState) else dynamics.initial_vector(initial)
        earth = any(name in (*_EARTH_VELOCITY, *_RANGE_ANGLES) for name in free)
        velocity, angles = (_EARTH_VELOCITY, _RANGE_ANGLES) if earth else (_PATH, _FLIGHT_ANGLES)
        names = (*_POSITION, *velocity, *angles, *_RATES, *dynamics.state_names[13:])
        unknown = [name for name in free if name not in names]
        if unknown or len(set(free)) != len(free):
            wrong = unknown[0] if unknown else "one that stands twice"
            raise InputError(f"no start value {wrong} to free; there are {', '.join(names)}, each once")
        values = _values(state, earth)
        return cls(tuple(free), values, names, _function(len(names), earth))

    @property
    def unknowns(self) -> Array:
        """Values of those that are free, shape (n,)."""
        return self.values[self.where]

    @property
    def where(self) -> list[int]:
        """Where the free ones stand among all."""
        return [self.names.index(name) for name in self.free]

    def replace(self, given: Mapping[str, float]) -> StartState:
        """With other values."""
        values = self.values.copy()
        for name, value in given.items():
            values[self.names.index(name)] = value
        return StartState(self.free, values, self.names, self.function)

    def state(self, unknowns: Array) -> tuple[Array, Array]:
        """State (nx,) and its derivative with respect to the unknowns (nx, n)."""
        values = self.values.copy()
        values[self.where] = unknowns
        state, slope = self.function(values)
        return np.array(state).ravel(), np.array(slope)[:, self.where]


def _values(state: Array, earth: bool) -> Array:
    matrix = matrix_from_quaternion(state[6:10] / np.linalg.norm(state[6:10]))
    velocity = matrix @ state[3:6]
    if not earth:
        u, v, w = state[3:6]
        speed = float(np.linalg.norm(state[3:6]))
        if speed == 0.0:
            raise InputError("a start at rest has no alpha and beta; free Vx, Vy and Vz instead")
        velocity = np.array([speed, np.arctan2(w, u), np.arcsin(v / speed)])
    values: Array = np.concatenate([state[:3], velocity, euler_angles(state[6:10]), state[10:]])
    return values


def _function(size: int, earth: bool) -> Any:
    values = ca.SX.sym("start", size)
    quaternion = quaternion_of(*ca.vertsplit(values[6:9]))
    if earth:
        velocity = ca.mtimes(rotation(quaternion).T, values[3:6])
    else:
        speed, alpha, beta = ca.vertsplit(values[3:6])
        velocity = speed * ca.vertcat(ca.cos(alpha) * ca.cos(beta), ca.sin(beta), ca.sin(alpha) * ca.cos(beta))
    state = ca.densify(ca.vertcat(values[:3], velocity, quaternion, values[9:]))
    return ca.Function("start", [values], [state, ca.densify(ca.jacobian(state, values))])


def quaternion_of(yaw: Any, pitch: Any, roll: Any) -> Any:
    """Attitude quaternion body -> earth of Euler angles z-y-x [rad], casadi."""
    cy, sy, cp, sp = ca.cos(yaw / 2), ca.sin(yaw / 2), ca.cos(pitch / 2), ca.sin(pitch / 2)
    cr, sr = ca.cos(roll / 2), ca.sin(roll / 2)
    return ca.vertcat(
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
