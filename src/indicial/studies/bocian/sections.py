r"""The glider's sections with one property replaced at a time: what each of them does to the roll damping."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from indicial.cfd.lattice import NeuralFoil
from indicial.cfd.lattice.polars import GRID, Polar, PolarSource
from indicial.cfd.lattice.separation import attached_lift
from indicial.cfd.shapes import WingSection
from indicial.errors import InputError

THICKNESS = {"naca43018": 0.18, "naca43012": 0.12, "naca0012": 0.12}
"""Of the sections, in chords."""

_LIFTS = ("polar", "attached", "plate", "joukowski")


@dataclass(frozen=True)
class ChangedSections:
    """A source of polars that changes those of another.

    Parameters
    ----------
    source : callable
    lift : str
        "polar" leaves it. The others are ``cl = a sin(alpha - alpha0)`` with the polar's alpha0: "attached" with the
        slope that the polar has over its first 6 degrees from zero lift, "plate" with 2 pi, "joukowski" with that of
        Joukowski's sections of the same thickness in inviscid flow, ``2 pi (1 + 4/(3 sqrt 3) t/c)`` to first order.
    reynolds : float, optional
        Taken for all chords.
    section : str, optional
        Name of the one taken for all of the wing.
    drag : bool
        Whether sections have their drag and moment.

    Raises
    ------
    InputError
        If there is no such lift.
    """

    source: PolarSource
    lift: str = "polar"
    reynolds: float | None = None
    section: str | None = None
    drag: bool = True

    def __post_init__(self) -> None:
        if self.lift not in _LIFTS:
            raise InputError(f"no lift {self.lift!r} of a section; there are {', '.join(_LIFTS)}")

    def __call__(self, section: WingSection, reynolds: float) -> Polar:
        """The changed polar."""
        if self.section is not None and section.name.startswith("naca43"):
            section = WingSection.naca(self.section.removeprefix("naca"))
        polar = self.source(section, self.reynolds or reynolds)
        if not self.drag:
            polar = replace(polar, cd=np.zeros_like(polar.cd), cm=np.zeros_like(polar.cm))
        if self.lift == "polar":
            return polar
        own, zero = attached_lift(polar)
        round_nose = 2.0 * math.pi * (1.0 + 4.0 / (3.0 * math.sqrt(3.0)) * THICKNESS[section.name])
        slope = {"attached": own, "plate": 2.0 * math.pi, "joukowski": round_nose}[self.lift]
        full = polar.full
        drags = (full.cd, full.cm) if self.drag else (np.zeros_like(GRID), np.zeros_like(GRID))
        return Polar(polar.section, polar.reynolds, GRID, slope * np.sin(GRID - zero), *drags, trusted=full.range)


def changed(source: PolarSource, settings: dict[str, Any]) -> PolarSource:
    """The source that a piece's settings ask for: "network" replaces it, "sections" changes it."""
    if "network" in settings:
        source = NeuralFoil(**settings["network"])
    return ChangedSections(source, **settings["sections"]) if "sections" in settings else source
