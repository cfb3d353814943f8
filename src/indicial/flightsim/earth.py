"""The ground under the flight: which way is down, how hard it pulls, how high the vehicle is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import casadi as ca

from indicial.errors import InputError


class Earth(Protocol):
    """Gravity and altitude as casadi expressions of position in earth axes."""

    def gravity(self, position: Any) -> Any:
        """Acceleration of gravity [m/s^2], earth axes, a casadi expression of shape (3, 1)."""
        ...

    def altitude(self, position: Any) -> Any:
        """Geometric altitude [m], a casadi expression."""
        ...


@dataclass(frozen=True)
class FlatEarth:
    """Flat and not rotating: earth axes x downrange (north), y right (east), z down; altitude is -z.

    Parameters
    ----------
    g : float
        [m/s^2], constant; 0 for straight flight.
    """

    g: float = 9.80665

    def __post_init__(self) -> None:
        if not math.isfinite(self.g):
            raise InputError(f"gravity is {self.g} m/s^2, must be finite")

    def gravity(self, position: Any) -> Any:
        """(0, 0, g)."""
        del position
        return ca.SX([0.0, 0.0, self.g])

    def altitude(self, position: Any) -> Any:
        """``-z``."""
        return -position[2]
