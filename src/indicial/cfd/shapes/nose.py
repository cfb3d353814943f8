"""Noses of bodies of revolution, in calibres: radius over length, volume and area in closed form."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from indicial.cfd.shapes.validation import require, require_positive
from indicial.conventions import Array

NoseType = Literal["cone", "tangent_ogive"]


@dataclass(frozen=True)
class Nose:
    """A pointed nose, of base radius 1/2, all lengths in calibres.

    Parameters
    ----------
    type : {"cone", "tangent_ogive"}
    length : float
        Length [calibres]; an ogive is at least half a calibre long.

    Raises
    ------
    InputError
        On another type or an impossible length.
    """

    type: NoseType
    length: float

    def __post_init__(self) -> None:
        require(self.type in ("cone", "tangent_ogive"), "Nose", "type", self.type, "'cone' or 'tangent_ogive'")
        require_positive("Nose", length=self.length)
        if self.type == "tangent_ogive":
            require(self.length >= 0.5, "Nose", "length", self.length, "at least 0.5 calibre for an ogive")

    @property
    def _arc(self) -> float:
        """Radius of the ogive's arc [calibres]."""
        return self.length**2 + 0.25

    @property
    def tip_half_angle(self) -> float:
        """Angle between the axis and the surface at the tip [rad]."""
        if self.type == "cone":
            return math.atan(0.5 / self.length)
        return math.asin(self.length / self._arc)

    def radius(self, x: ArrayLike) -> Array:
        """Radius [calibres] at x [calibres] from the tip; 0 ahead of it and 1/2 behind the nose."""
        s = np.clip(np.asarray(x, dtype=float), 0.0, self.length)
        if self.type == "cone":
            return np.asarray(0.5 * s / self.length)
        # r = sqrt(a^2 - (L - x)^2) + 1/2 - a, written without the difference of large numbers
        gap = (self.length - s) ** 2
        return np.asarray(0.5 - gap / (self._arc + np.sqrt(self._arc**2 - gap)))

    @property
    def volume(self) -> float:
        """Volume [calibres^3]."""
        if self.type == "cone":
            return math.pi * 0.25 * self.length / 3.0
        a, length, offset = self._arc, self.length, 0.5 - self._arc
        arc_area = 0.5 * (length * math.sqrt(a * a - length * length) + a * a * math.asin(length / a))
        return math.pi * (a * a * length - length**3 / 3.0 + 2.0 * offset * arc_area + offset * offset * length)

    @property
    def lateral_area(self) -> float:
        """Area of the surface [calibres^2]."""
        if self.type == "cone":
            return math.pi * 0.5 * math.hypot(0.5, self.length)
        a = self._arc
        return 2.0 * math.pi * a * (self.length + (0.5 - a) * math.asin(self.length / a))
