"""The state from which a flight starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array, velocity_from_angles
from indicial.errors import InputError
from indicial.flightsim.attitude import matrix_from_quaternion, quaternion_from_euler, quaternion_from_matrix

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class InitialState:
    """Position, velocity, attitude, rates and lag states at the start.

    Parameters
    ----------
    velocity : array_like
        Of the centre of gravity [m/s], body axes, shape (3,).
    quaternion : array_like
        Attitude body -> earth, scalar first, shape (4,); made of unit norm.
    rate : array_like
        (p, q, r) [rad/s], body axes, shape (3,).
    position : array_like
        Earth axes x downrange, y right, z down [m], shape (3,).
    lag : array_like, optional
        Lag states; if not given, settled: as if the initial incidence and rates had stood for ever.
    """

    velocity: Array
    quaternion: Array
    rate: Array
    position: Array
    lag: Array | None = None

    def __post_init__(self) -> None:
        shapes = {"velocity": (3,), "quaternion": (4,), "rate": (3,), "position": (3,)}
        for name, shape in shapes.items():
            values = np.array(getattr(self, name), dtype=float)
            if values.shape != shape or not np.all(np.isfinite(values)):
                raise InputError(f"initial {name} must be finite and of shape {shape}")
            object.__setattr__(self, name, values)
        norm = float(np.linalg.norm(self.quaternion))
        if norm == 0.0:
            raise InputError("initial quaternion is zero, must have a direction")
        object.__setattr__(self, "quaternion", self.quaternion / norm)
        if self.lag is not None:
            object.__setattr__(self, "lag", np.array(self.lag, dtype=float).reshape(-1))

    @classmethod
    def from_path(
        cls,
        speed: float,
        *,
        alpha: float = 0.0,
        beta: float = 0.0,
        path_angle: float = 0.0,
        heading: float = 0.0,
        bank: float = 0.0,
        rate: ArrayLike = (0.0, 0.0, 0.0),
        position: ArrayLike = (0.0, 0.0, 0.0),
        lag: Array | None = None,
    ) -> Self:
        """Flight along a given path at given angles to it.

        Parameters
        ----------
        speed : float
            [m/s].
        alpha, beta : float
            alpha = atan2(w, u), beta = asin(v/V) [rad].
        path_angle, heading : float
            Climb angle gamma and heading chi of the velocity [rad].
        bank : float
            Bank mu about the velocity [rad].
        rate : array_like
            (p, q, r) [rad/s].
        """
        velocity = velocity_from_angles(speed, alpha, beta)
        wind = matrix_from_quaternion(quaternion_from_euler(heading, path_angle, bank))
        body_from_wind = _about_y(alpha) @ _about_z(-beta)
        attitude = quaternion_from_matrix(wind @ body_from_wind.T)
        return cls(velocity, attitude, np.asarray(rate), np.asarray(position), lag)

    @classmethod
    def from_attitude(
        cls,
        velocity: ArrayLike,
        *,
        yaw: float = 0.0,
        pitch: float = 0.0,
        roll: float = 0.0,
        rate: ArrayLike = (0.0, 0.0, 0.0),
        position: ArrayLike = (0.0, 0.0, 0.0),
        lag: Array | None = None,
    ) -> Self:
        """Velocity in earth axes [m/s] and attitude in Euler angles [rad]."""
        attitude = quaternion_from_euler(yaw, pitch, roll)
        body = matrix_from_quaternion(attitude).T @ np.asarray(velocity, dtype=float)
        return cls(body, attitude, np.asarray(rate), np.asarray(position), lag)


def _about_y(angle: float) -> Array:
    """Components after axes turn by -angle about y: (1, 0, 0) becomes (cos, 0, sin)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def _about_z(angle: float) -> Array:
    """Components after axes turn by angle about z: (1, 0, 0) becomes (cos, -sin, 0)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
