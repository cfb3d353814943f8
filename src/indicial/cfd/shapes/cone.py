"""A circular cone, pointed, at the tip of whose axis the mesh axes begin."""

from __future__ import annotations

import math
from dataclasses import dataclass

from indicial.cfd.shapes.finned_body import FinnedBody
from indicial.cfd.shapes.nose import Nose
from indicial.cfd.shapes.validation import require, require_positive


@dataclass(frozen=True)
class Cone:
    """Pointed cone from x = 0 to its flat base.

    Parameters
    ----------
    half_angle_deg : float
        Above 0 and below 60.
    length : float
        [m].
    """

    half_angle_deg: float
    length: float = 1.0

    def __post_init__(self) -> None:
        angle = self.half_angle_deg
        require(0.0 < angle < 60.0, "Cone", "half_angle_deg", angle, "above 0 and below 60")
        require_positive("Cone", length=self.length)

    @property
    def base_diameter(self) -> float:
        """[m]."""
        return 2.0 * self.length * math.tan(math.radians(self.half_angle_deg))

    @property
    def base_area(self) -> float:
        """[m^2]."""
        return math.pi * self.base_diameter**2 / 4.0

    @property
    def volume(self) -> float:
        """[m^3]."""
        return self.base_area * self.length / 3.0

    @property
    def lateral_area(self) -> float:
        """[m^2], without the base."""
        return self.base_area / math.sin(math.radians(self.half_angle_deg))

    def body(self) -> FinnedBody:
        """The cone as a body without cylinder or fins."""
        calibres = self.length / self.base_diameter
        return FinnedBody(self.base_diameter, Nose("cone", calibres), calibres)
