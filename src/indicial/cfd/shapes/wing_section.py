"""Sections of lifting surfaces: camber and thickness, NACA four- and five-digit families and tables."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, PchipInterpolator

from indicial.cfd.shapes.airfoil import Airfoil
from indicial.cfd.shapes.validation import require
from indicial.conventions import Array
from indicial.errors import InputError

_FIVE_DIGIT = {1: (0.0580, 361.400), 2: (0.1260, 51.640), 3: (0.2025, 15.957), 4: (0.2900, 6.643), 5: (0.3910, 3.230)}
"""m and k1 of the mean lines 210 to 250, of a design lift coefficient of 0.3 (Jacobs and Pinkerton, NACA TR 537)."""

_STATIONS = 161


@dataclass(frozen=True)
class WingSection:
    """A section of unit chord: mean line and half thickness over x, from leading (0) to trailing edge (1).

    Parameters
    ----------
    name : str
        Under which polars are kept.
    x, camber, half_thickness : ndarray
        Increasing from 0 to 1; fractions of the chord, shape (n,).
    """

    name: str
    x: Array
    camber: Array
    half_thickness: Array

    def __post_init__(self) -> None:
        for field in ("x", "camber", "half_thickness"):
            values = np.asarray(getattr(self, field), dtype=float)
            require(values.ndim == 1 and values.size >= 5, "WingSection", field, values.shape, "at least five numbers")
            require(bool(np.all(np.isfinite(values))), "WingSection", field, "not finite", "finite")
            require(values.size == np.size(self.x), "WingSection", field, values.size, "as long as x")
            object.__setattr__(self, field, values)
        whole = abs(self.x[0]) < 1e-12 and abs(self.x[-1] - 1.0) < 1e-12 and bool(np.all(np.diff(self.x) > 0.0))
        require(whole, "WingSection", "x", (self.x[0], self.x[-1]), "increasing from 0 to 1")
        require(bool(np.all(self.half_thickness >= 0.0)), "WingSection", "half_thickness", "negative", "at least 0")

    @classmethod
    def flat(cls, name: str = "flat") -> Self:
        """A plate without camber and thickness."""
        x = _cosine(_STATIONS)
        return cls(name, x, np.zeros_like(x), np.zeros_like(x))

    @classmethod
    def naca(cls, digits: str) -> Self:
        """A four-digit ("2412") or a simple five-digit section ("23012", "43018").

        Raises
        ------
        InputError
            If the number is not of these families (reflexed five-digit sections are not).
        """
        x = _cosine(_STATIONS)
        if len(digits) == 4:
            airfoil = Airfoil.naca(digits)
            return cls(f"naca{digits}", x, airfoil.camber_line(x)[0], airfoil.half_thickness(x))
        if len(digits) != 5 or not digits.isdigit() or digits[3:] == "00":
            raise InputError(f"NACA section is {digits!r}, must be four or five digits with a thickness, as '43012'")
        if int(digits[1]) not in _FIVE_DIGIT or digits[2] != "0" or digits[0] == "0":
            raise InputError(f"NACA section {digits}: the second digit must be 1 to 5, the third 0 (no reflex)")
        m, k1 = _FIVE_DIGIT[int(digits[1])]
        ahead = x**3 - 3.0 * m * x**2 + m**2 * (3.0 - m) * x
        # the first digit times 3/20 is the design lift coefficient, to which camber is proportional
        camber = k1 * int(digits[0]) / 2.0 / 6.0 * np.where(x < m, ahead, m**3 * (1.0 - x))
        return cls(f"naca{digits}", x, camber, Airfoil(int(digits[3:]) / 100.0).half_thickness(x))

    @classmethod
    def from_coordinates(cls, name: str, points: ArrayLike) -> Self:
        """From a table (n, 2) that runs from the trailing edge over the top, round the nose and below back (Selig's).

        Chord from the leading point to the mean of the two ends. The mean line is the mean of the sides at equal x.

        Raises
        ------
        InputError
            If the table is no such loop.
        """
        table = np.asarray(points, dtype=float)
        if table.ndim != 2 or table.shape[1] != 2 or len(table) < 9 or not np.all(np.isfinite(table)):
            raise InputError(f"section {name}: coordinates must be at least nine finite points (n, 2)")
        end = 0.5 * (table[0] + table[-1])
        nose = int(np.argmax(np.linalg.norm(table - end, axis=1)))
        along = end - table[nose]
        chord = float(np.linalg.norm(along))
        turn = np.array([[along[0], along[1]], [-along[1], along[0]]]) / chord**2
        local = (table - table[nose]) @ turn.T
        top, bottom = local[nose::-1], local[nose:]
        if min(len(top), len(bottom)) < 4 or np.any(np.diff(top[:, 0]) <= 0.0) or np.any(np.diff(bottom[:, 0]) <= 0.0):
            raise InputError(f"section {name}: x must run from the trailing edge to the nose and back, without turning")
        x = _cosine(_STATIONS)
        # a side is smooth in sqrt(x): the nose is a parabola
        upper, lower = (PchipInterpolator(np.sqrt(np.clip(s[:, 0], 0, 1)), s[:, 1])(np.sqrt(x)) for s in (top, bottom))
        if np.any(upper - lower < -1e-9):
            raise InputError(f"section {name}: the lower side is above the upper one; must run over the top first")
        return cls(name, x, 0.5 * (upper + lower), np.maximum(0.5 * (upper - lower), 0.0))

    def mean_line(self, x: ArrayLike) -> tuple[Array, Array]:
        """Camber and its slope at fractions x of the chord."""
        spline = CubicSpline(self.x, self.camber)
        at = np.asarray(x, dtype=float)
        return np.asarray(spline(at)), np.asarray(spline(at, 1))

    def coordinates(self) -> Array:
        """Points (n, 2) from the trailing edge over the top, round the nose and below back, thickness normal to x."""
        top = np.stack([self.x, self.camber + self.half_thickness], axis=1)
        bottom = np.stack([self.x, self.camber - self.half_thickness], axis=1)
        return np.concatenate([top[::-1], bottom[1:]])


def _cosine(count: int) -> Array:
    """Fractions of the chord from 0 to 1, dense at both ends."""
    return np.asarray(0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, count))))
