r"""Moving air: steady wind, wind that changes with altitude, discrete gusts; `turbulence` holds random ones.

A wind is the velocity of the air over the ground in earth axes, an expression of position, altitude and `TIME`. Gusts
are frozen in the air's field: they stand along a direction, and the vehicle flies through them.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Protocol, Self

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.expressions import is_number, table

Triple = tuple[Any, Any, Any]


class Wind(Protocol):
    """Velocity of the air over the ground, as a casadi expression."""

    def velocity(self, position: Any, altitude: Any) -> Any:
        """Earth axes [m/s], shape (3, 1)."""
        ...

    def rotation(self, position: Any, altitude: Any) -> Any:
        """Turning rate of the air as the body feels it, earth axes [rad/s], shape (3, 1); None if it does not turn."""
        ...


@dataclass(frozen=True)
class SteadyWind:
    """The same wind everywhere.

    Parameters
    ----------
    vector : tuple of float or casadi expression
        Where the air goes, earth axes x, y, z down [m/s].
    """

    vector: Triple

    def __post_init__(self) -> None:
        if len(self.vector) != 3 or not all(math.isfinite(v) for v in self.vector if is_number(v)):
            raise InputError(f"wind must be three finite components [m/s], not {self.vector}")

    @classmethod
    def from_direction(cls, speed: float, direction: float) -> Self:
        """Of a speed [m/s], coming from a direction [rad] turned from the x axis (north) towards y (east)."""
        return cls((-speed * math.cos(direction), -speed * math.sin(direction), 0.0))

    def velocity(self, position: Any, altitude: Any) -> Any:
        """The vector."""
        del position, altitude
        return ca.vertcat(*(ca.SX(v) for v in self.vector))

    def rotation(self, position: Any, altitude: Any) -> Any:
        """None."""
        del position, altitude


@dataclass(frozen=True)
class WindProfile:
    """Wind that changes with altitude, linear between the altitudes given and held beyond them.

    Parameters
    ----------
    altitude : array_like
        Increasing [m], shape (n,).
    vectors : array_like
        Where the air goes at each, earth axes [m/s], shape (n, 3).
    """

    altitude: Array
    vectors: Array

    def __post_init__(self) -> None:
        for name in ("altitude", "vectors"):
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=float))
        if self.vectors.shape != (self.altitude.size, 3):
            raise InputError(
                f"a wind profile of {self.altitude.size} altitudes needs vectors of shape ({self.altitude.size}, 3), "
                f"not {self.vectors.shape}"
            )
        self.velocity(ca.SX.sym("position", 3), ca.SX.sym("altitude"))

    @classmethod
    def power_law(cls, wind: ArrayLike, height: float, exponent: float, top: float, points: int = 24) -> Self:
        """``wind (h/height)^exponent`` from the ground (altitude 0) up to `top` [m], held above.

        The exponent is about 1/7 over open country. Points are close together near the ground.
        """
        if not (height > 0.0 and exponent > 0.0 and top > 0.0 and points >= 2):
            raise InputError("a power law needs height, exponent and top above 0, and two points or more")
        altitude = top * np.linspace(0.0, 1.0, points) ** 3
        return cls(altitude, np.outer((altitude / height) ** exponent, np.asarray(wind, dtype=float)))

    def velocity(self, position: Any, altitude: Any) -> Any:
        """By altitude."""
        del position
        return ca.vertcat(*(table(altitude, self.altitude, column) for column in self.vectors.T))

    def rotation(self, position: Any, altitude: Any) -> Any:
        """None: its gradient is taken for small on the length of the vehicle."""
        del position, altitude


@dataclass(frozen=True)
class CosineGust:
    r"""One discrete gust, ``(A/2)(1 - cos(2 pi s/L))`` over 0 < s < L, frozen in space (14 CFR 25.341).

    Parameters
    ----------
    amplitude : tuple of float or casadi expression
        A, earth axes [m/s]: upward is negative z.
    length : float
        L [m], twice the gust gradient distance H.
    start : float
        Where s = 0, along the direction from the origin of the earth axes [m].
    heading : float
        Of the direction along which it stands, horizontal, from x to y [rad].
    """

    amplitude: Triple
    length: float
    start: float = 0.0
    heading: float = 0.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.length) and self.length > 0.0):
            raise InputError(f"length of a gust is {self.length} m, must be positive and finite")

    def velocity(self, position: Any, altitude: Any) -> Any:
        """By the way flown along the direction."""
        del altitude
        along = math.cos(self.heading) * position[0] + math.sin(self.heading) * position[1] - self.start
        inside = ca.fmin(ca.fmax(along, 0.0), self.length)
        shape = 0.5 * (1.0 - ca.cos(2.0 * math.pi / self.length * inside))
        return shape * ca.vertcat(*(ca.SX(a) for a in self.amplitude))

    def rotation(self, position: Any, altitude: Any) -> Any:
        """None: its gradient is taken for small on the length of the vehicle."""
        del position, altitude


@dataclass(frozen=True)
class Winds:
    """Several winds at once: their sum.

    Parameters
    ----------
    parts : tuple of Wind
    """

    parts: tuple[Wind, ...]

    def velocity(self, position: Any, altitude: Any) -> Any:
        """The sum."""
        return _sum(part.velocity(position, altitude) for part in self.parts)

    def rotation(self, position: Any, altitude: Any) -> Any:
        """The sum of those that turn."""
        turning = [part.rotation(position, altitude) for part in self.parts]
        found = [one for one in turning if one is not None]
        return _sum(found) if found else None


def _sum(vectors: Iterable[Any]) -> Any:
    total = ca.SX.zeros(3)
    for vector in vectors:
        total = total + vector
    return total
