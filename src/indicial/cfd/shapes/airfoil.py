"""Airfoil sections of unit chord: the NACA four-digit family."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from indicial.cfd.shapes.validation import require
from indicial.conventions import Array
from indicial.errors import InputError


@dataclass(frozen=True)
class Airfoil:
    """NACA four-digit section, x from 0 at the leading to 1 at the trailing edge, z up.

    Thickness ``y_t = 5 t (0.2969 sqrt(x) - 0.1260 x - 0.3516 x^2 + 0.2843 x^3 - b x^4)`` with b = 0.1015, or
    0.1036, which closes the trailing edge; laid off normal to the camber line (two parabolas).
    Source: Abbott and von Doenhoff, Theory of Wing Sections, Dover 1959, chapter 6 (for b = 0.1015).

    Parameters
    ----------
    thickness : float
        t, fraction of the chord, (0, 0.4].
    camber : float
        Largest camber, fraction of the chord, [0, 0.095].
    camber_position : float
        Its position, [0.05, 0.95]; without meaning if there is no camber.
    closed_trailing_edge : bool
        Whether the trailing edge is sharp.
    """

    thickness: float
    camber: float = 0.0
    camber_position: float = 0.4
    closed_trailing_edge: bool = True

    def __post_init__(self) -> None:
        require(0.0 < self.thickness <= 0.4, "Airfoil", "thickness", self.thickness, "above 0 and at most 0.4")
        require(0.0 <= self.camber <= 0.095, "Airfoil", "camber", self.camber, "from 0 to 0.095")
        position = self.camber_position
        require(0.05 <= position <= 0.95, "Airfoil", "camber_position", position, "from 0.05 to 0.95")

    @classmethod
    def naca(cls, digits: str, closed_trailing_edge: bool = True) -> Self:
        """Section of a four-digit number such as "0012" or "2412"."""
        if len(digits) != 4 or not digits.isdigit() or digits[2:] == "00":
            raise InputError(f"NACA section is {digits!r}, must be four digits with a thickness, such as '0012'")
        camber, position = int(digits[0]) / 100.0, int(digits[1]) / 10.0
        if (camber == 0.0) != (position == 0.0):
            raise InputError(f"NACA section {digits}: the first two digits must both be zero or both not")
        return cls(int(digits[2:]) / 100.0, camber, position or 0.4, closed_trailing_edge)

    @property
    def symmetric(self) -> bool:
        """Whether there is no camber."""
        return self.camber == 0.0

    @cached_property
    def _coefficients(self) -> Array:
        last = -0.1036 if self.closed_trailing_edge else -0.1015
        return 5.0 * self.thickness * np.array([0.2969, -0.1260, -0.3516, 0.2843, last])

    def half_thickness(self, x: ArrayLike) -> Array:
        """y_t, fraction of the chord, at x in [0, 1]."""
        x = np.asarray(x, dtype=float)
        a = self._coefficients
        value: Array = a[0] * np.sqrt(x) + x * (a[1] + x * (a[2] + x * (a[3] + x * a[4])))
        return np.maximum(value, 0.0) if self.closed_trailing_edge else value

    def camber_line(self, x: ArrayLike) -> tuple[Array, Array]:
        """Camber and its slope at x."""
        x = np.asarray(x, dtype=float)
        m, p = self.camber, self.camber_position
        ahead = x < p
        scale = np.where(ahead, m / p**2, m / (1.0 - p) ** 2)
        z = scale * np.where(ahead, 2.0 * p * x - x * x, 1.0 - 2.0 * p + 2.0 * p * x - x * x)
        return z, 2.0 * scale * (p - x)

    def surface(self, x: ArrayLike, side: float) -> Array:
        """Points (..., 2) of the upper (side = 1) or lower (side = -1) surface laid off at x on the chord."""
        x = np.asarray(x, dtype=float)
        z, slope = self.camber_line(x)
        along = side * self.half_thickness(x) / np.sqrt(1.0 + slope**2)
        return np.stack([x - along * slope, z + along], axis=-1)

    @property
    def nose_radius(self) -> float:
        """Radius of curvature of the leading edge, fraction of the chord: ``1.1019 t^2``."""
        return float(0.5 * self._coefficients[0] ** 2)

    @property
    def trailing_edge_angle(self) -> float:
        """Angle between the upper and lower surface at a closed trailing edge [rad]."""
        thinning = -float(self._coefficients @ np.array([0.5, 1.0, 2.0, 3.0, 4.0]))
        camber_slope = float(self.camber_line(1.0)[1])
        return 2.0 * math.atan(thinning / math.hypot(1.0, camber_slope))

    @property
    def area(self) -> float:
        """Area of a section without camber, fraction of chord squared: ``2 integral of y_t dx``, exactly."""
        require(self.symmetric, "Airfoil", "camber", self.camber, "0 for the area in closed form")
        return float(2.0 * self._coefficients @ np.array([2.0 / 3.0, 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0, 1.0 / 5.0]))
