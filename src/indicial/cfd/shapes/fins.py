"""A set of equal fins round a body, in calibres."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from indicial.cfd.shapes.validation import require, require_positive
from indicial.conventions import Array

Section = Literal["single_wedge", "double_wedge", "plate"]


@dataclass(frozen=True)
class FinSet:
    """Equal trapezoidal fins, evenly spread round the body; lengths in calibres.

    The section's thickness is the same fraction of the chord all along the span, so that the faces of a wedge are
    flat. A single wedge is sharp in front and cut off at its thickest; a double wedge is thickest at half chord;
    a plate has no thickness. The tip is cut off square, parallel to the body's axis.

    Parameters
    ----------
    number : int
    root_chord, tip_chord : float
        Chords on the body's surface and at the tip [calibres].
    span : float
        Exposed span of one fin, from the body's surface to its tip [calibres].
    leading_edge_sweep_deg : float
        Positive when the leading edge runs aft towards the tip, [0, 80).
    trailing_edge : float
        Distance of the root's trailing edge from the nose [calibres].
    section : {"single_wedge", "double_wedge", "plate"}
    thickness_ratio : float
        Largest thickness over chord; 0 for a plate.
    roll_deg : float
        Angle of the first fin from the y axis (right) towards the z axis (up). 45 puts four fins in an x, 0 in a +.

    Raises
    ------
    InputError
        Naming the field and what is allowed.
    """

    number: int
    root_chord: float
    tip_chord: float
    span: float
    trailing_edge: float
    section: Section = "single_wedge"
    thickness_ratio: float = 0.0
    leading_edge_sweep_deg: float = 0.0
    roll_deg: float = 45.0

    def __post_init__(self) -> None:
        require(
            isinstance(self.number, int) and 1 <= self.number <= 16, "FinSet", "number", self.number, "from 1 to 16"
        )
        require_positive(
            "FinSet", root_chord=self.root_chord, tip_chord=self.tip_chord, span=self.span,
            trailing_edge=self.trailing_edge,
        )  # fmt: skip
        sections = ("single_wedge", "double_wedge", "plate")
        require(self.section in sections, "FinSet", "section", self.section, f"one of {', '.join(sections)}")
        if self.section == "plate":
            require(self.thickness_ratio == 0.0, "FinSet", "thickness_ratio", self.thickness_ratio, "0 for a plate")
        else:
            thin = 0.0 < self.thickness_ratio <= 0.2
            require(thin, "FinSet", "thickness_ratio", self.thickness_ratio, "above 0 and at most 0.2 for a wedge")
        sweep = self.leading_edge_sweep_deg
        require(0.0 <= sweep < 80.0, "FinSet", "leading_edge_sweep_deg", sweep, "from 0 to below 80")
        require(math.isfinite(self.roll_deg), "FinSet", "roll_deg", self.roll_deg, "finite")
        require(
            self.root_leading_edge > 0.0,
            "FinSet",
            "root_chord",
            self.root_chord,
            "below trailing_edge, behind the nose",
        )

    @property
    def root_leading_edge(self) -> float:
        """Distance of the root's leading edge from the nose [calibres]."""
        return self.trailing_edge - self.root_chord

    @property
    def angles(self) -> Array:
        """Angles of the fins from the y axis towards the z axis [rad], in [0, 2 pi), shape (number,)."""
        return np.asarray(np.deg2rad((self.roll_deg + 360.0 / self.number * np.arange(self.number)) % 360.0))

    @property
    def planform_area(self) -> float:
        """Exposed area of one fin [calibres^2]."""
        return 0.5 * (self.root_chord + self.tip_chord) * self.span

    def leading_edge(self, fraction: ArrayLike) -> Array:
        """x of the leading edge [calibres] at a fraction of the exposed span."""
        aft = self.span * math.tan(math.radians(self.leading_edge_sweep_deg))
        return self.root_leading_edge + aft * np.asarray(fraction, dtype=float)

    def chord(self, fraction: ArrayLike) -> Array:
        """Chord [calibres] at a fraction of the exposed span."""
        return self.root_chord + (self.tip_chord - self.root_chord) * np.asarray(fraction, dtype=float)

    def half_thickness(self, chord_fraction: ArrayLike) -> Array:
        """Half the thickness over the chord, at a fraction of the chord; 0 outside it."""
        u = np.asarray(chord_fraction, dtype=float)
        inside = (u >= 0.0) & (u <= 1.0)
        if self.section == "single_wedge":
            shape = u
        elif self.section == "double_wedge":
            shape = 1.0 - np.abs(2.0 * u - 1.0)
        else:
            shape = np.zeros_like(u)
        return np.where(inside, 0.5 * self.thickness_ratio * shape, 0.0)
