"""Atmospheres: constant, and the U.S. Standard Atmosphere 1976 (the same as ISA to 32 km)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array
from indicial.errors import InputError

GAMMA = 1.4
GAS_CONSTANT = 8314.32 / 28.9644
"""Specific gas constant of air [J/(kg K)], R*/M0 of the U.S. Standard Atmosphere 1976 (table 2)."""


class Air(NamedTuple):
    """State of the air; each a casadi expression or an array."""

    temperature: Any
    """[K]"""
    pressure: Any
    """[Pa]"""
    density: Any
    """[kg/m^3]"""
    speed_of_sound: Any
    """[m/s]"""


class Atmosphere(Protocol):
    """Air as a casadi expression of geometric altitude."""

    @property
    def altitude_range(self) -> tuple[float, float]:
        """Lowest and highest geometric altitude [m] at which it holds."""
        ...

    def air(self, altitude: Any) -> Air:
        """State of the air at a geometric altitude [m], a casadi expression."""
        ...


def _perfect_gas(temperature: Any, pressure: Any) -> Air:
    density = pressure / (GAS_CONSTANT * temperature)
    return Air(temperature, pressure, density, ca.sqrt(GAMMA * GAS_CONSTANT * temperature))


@dataclass(frozen=True)
class ConstantAtmosphere:
    """The same air everywhere: a range at 20 C and 1 atm unless told otherwise.

    Parameters
    ----------
    temperature : float
        [K].
    pressure : float
        [Pa].
    """

    temperature: float = 293.15
    pressure: float = 101325.0

    def __post_init__(self) -> None:
        for name in ("temperature", "pressure"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0) or (name == "temperature" and value == 0.0):
                raise InputError(f"atmosphere {name} is {value}, must be positive (a pressure of 0 is vacuum)")

    @property
    def altitude_range(self) -> tuple[float, float]:
        """Everywhere."""
        return (-math.inf, math.inf)

    def air(self, altitude: Any) -> Air:
        """The same at every altitude."""
        del altitude
        return _perfect_gas(ca.SX(self.temperature), ca.SX(self.pressure))


_EARTH_RADIUS = 6356766.0
_GRAVITY = 9.80665
_BASES = (0.0, 11e3, 20e3, 32e3, 47e3, 51e3, 71e3, 84852.0)
_LAPSES = (-6.5e-3, 0.0, 1.0e-3, 2.8e-3, 0.0, -2.8e-3, -2.0e-3)


@dataclass(frozen=True)
class StandardAtmosphere:
    r"""The U.S. Standard Atmosphere 1976 from -5 to 86 km, and days warmer or colder than it.

    Seven layers linear in geopotential altitude ``h = r0 z/(r0 + z)`` (Eq. 18) with temperature (Eq. 23) and the
    barometric formula (Eqs. 33a, 33b); g0 = 9.80665 m/s^2, r0 = 6356.766 km. Up to 32 km it is ISA (ISO 2533).
    The temperature is the molecular-scale one, which parts from the kinetic one by 0.04% at 86 km.

    Parameters
    ----------
    temperature_offset : float
        Added to the temperature at every altitude [K], pressure unchanged at each geopotential altitude.

    Notes
    -----
    Temperature and pressure are a sum and a product over layers of the thickness climbed in each, so that the
    expression has no branches. Outside `altitude_range` a trajectory is flagged.
    """

    temperature_offset: float = 0.0

    @property
    def altitude_range(self) -> tuple[float, float]:
        """-5 to 86 km geometric."""
        return (-5e3, 86e3)

    def air(self, altitude: Any) -> Air:
        """State of the air at a geometric altitude [m], a casadi expression."""
        geopotential = _EARTH_RADIUS * altitude / (_EARTH_RADIUS + altitude)
        temperature: Any = 288.15
        pressure: Any = 101325.0
        for i, lapse in enumerate(_LAPSES):
            climbed = ca.fmin(geopotential - _BASES[i], _BASES[i + 1] - _BASES[i])
            if i > 0:
                climbed = ca.fmax(climbed, 0.0)
            above = temperature + lapse * climbed
            if lapse == 0.0:
                pressure = pressure * ca.exp(-_GRAVITY * climbed / (GAS_CONSTANT * temperature))
            else:
                pressure = pressure * (above / temperature) ** (-_GRAVITY / (GAS_CONSTANT * lapse))
            temperature = above
        return _perfect_gas(temperature + self.temperature_offset, pressure)


def air_at(atmosphere: Atmosphere, altitude: ArrayLike) -> Air:
    """State of the air at geometric altitudes [m], as arrays of the shape of `altitude`.

    Raises
    ------
    InputError
        If an altitude lies outside the atmosphere's range.
    """
    z = np.asarray(altitude, dtype=float)
    low, high = atmosphere.altitude_range
    if np.any(z < low) or np.any(z > high):
        raise InputError(f"altitude must be within {low:g} to {high:g} m of the {type(atmosphere).__name__}")
    symbol = ca.SX.sym("altitude")
    function = ca.Function("air", [symbol], [ca.vertcat(*(ca.SX(value) for value in atmosphere.air(symbol)))])
    columns: Array = np.array(function(z.reshape(1, -1)))
    return Air(*(row.reshape(z.shape) for row in columns))
