"""A missile: pointed nose, cylinder, flat base and a set of fins."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from indicial.cfd.shapes.fins import FinSet
from indicial.cfd.shapes.nose import Nose
from indicial.cfd.shapes.validation import require, require_positive
from indicial.conventions import Array, ReferenceQuantities


@dataclass(frozen=True)
class FinnedBody:
    """Body of revolution with fins. The diameter is in metres, all else in calibres (diameters).

    Axes: x aft from the tip of the nose, y right, z up.

    Parameters
    ----------
    diameter : float
        Diameter d of the cylinder [m].
    nose : Nose
    length : float
        From the tip to the flat base [calibres]; equal to the nose's length if there is no cylinder.
    fins : FinSet, optional
        On the cylinder.

    Raises
    ------
    InputError
        If the parts do not fit each other.
    """

    diameter: float
    nose: Nose
    length: float
    fins: FinSet | None = None

    def __post_init__(self) -> None:
        require_positive("FinnedBody", diameter=self.diameter, length=self.length)
        long_enough = self.length >= self.nose.length * (1.0 - 1e-12)
        require(long_enough, "FinnedBody", "length", self.length, f"at least the nose's length {self.nose.length}")
        if self.fins is not None:
            root, end = self.fins.root_leading_edge, self.fins.trailing_edge
            require(root >= self.nose.length, "FinnedBody", "fins", f"from x = {root}", "behind the nose")
            require(end <= self.length + 1e-12, "FinnedBody", "fins", f"to x = {end}", f"within {self.length} calibres")

    @classmethod
    def from_half_angle(
        cls, diameter: float, nose_half_angle_deg: float, length: float, fins: FinSet | None = None
    ) -> Self:
        """Body with a conical nose of the given half angle [deg]."""
        in_range = 0.0 < nose_half_angle_deg < 60.0
        require(in_range, "FinnedBody", "nose_half_angle_deg", nose_half_angle_deg, "above 0 and below 60")
        return cls(diameter, Nose("cone", 0.5 / math.tan(math.radians(nose_half_angle_deg))), length, fins)

    @classmethod
    def basic_finner(cls, diameter: float = 0.03, roll_deg: float = 45.0) -> Self:
        """The Basic Finner reference projectile: 10 calibres, 10-degree cone, four square fins.

        Cone of 10 degrees half angle (2.836 calibres), total length 10, fins of chord 1 and exposed span 1 with their
        trailing edges at the base, section a single wedge, 0.08 thick at the trailing edge. The radius of 0.004
        calibres on nose and leading edges is taken as sharp. 30 mm is the diameter of the range models.

        Source: A. D. Dupuis and W. Hathaway, DREV-TM-9703, 1997 (range models of 30 mm).
        """
        fins = FinSet(
            number=4, root_chord=1.0, tip_chord=1.0, span=1.0, trailing_edge=10.0, section="single_wedge",
            thickness_ratio=0.08, roll_deg=roll_deg,
        )  # fmt: skip
        return cls.from_half_angle(diameter, 10.0, 10.0, fins)

    def radius(self, x: ArrayLike) -> Array:
        """Radius of the body [calibres] at x [calibres]; 0 ahead of the nose."""
        return self.nose.radius(x)

    @property
    def base_area(self) -> float:
        """``pi d^2 / 4`` [m^2], the usual reference area of a missile."""
        return math.pi * self.diameter**2 / 4.0

    @property
    def body_volume(self) -> float:
        """Volume of the body without fins [m^3]."""
        return self.diameter**3 * (self.nose.volume + math.pi * 0.25 * (self.length - self.nose.length))

    @property
    def lateral_area(self) -> float:
        """Area of nose and cylinder [m^2], fin roots not taken off, without the base."""
        return self.diameter**2 * (self.nose.lateral_area + math.pi * (self.length - self.nose.length))

    @property
    def fin_planform_area(self) -> float:
        """Exposed area of one fin [m^2]; 0 without fins."""
        return 0.0 if self.fins is None else self.diameter**2 * self.fins.planform_area

    def reference(self, moment_reference: float) -> ReferenceQuantities:
        """Reference quantities: d, ``pi d^2 / 4``, moments about `moment_reference` calibres behind the nose."""
        return ReferenceQuantities(self.diameter, self.base_area, (moment_reference * self.diameter, 0.0, 0.0))

    def summary(self) -> str:
        """One line for a reader."""
        fins = "no fins"
        if self.fins is not None:
            f = self.fins
            fins = (
                f"{f.number} fins ({f.section}, chords {f.root_chord:g} and {f.tip_chord:g}, span {f.span:g}, "
                f"trailing edge at {f.trailing_edge:g})"
            )
        nose = f"{self.nose.type} nose of {self.nose.length:.4g} (tip {np.rad2deg(self.nose.tip_half_angle):.4g} deg)"
        return f"{nose}, length {self.length:g} calibres of {self.diameter:g} m, {fins}"
