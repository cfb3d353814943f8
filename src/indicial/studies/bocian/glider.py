"""The glider: its surfaces, its sections' polars, and the two ways of making its roll damping dimensionless."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from indicial.cfd.lattice import (
    Lattice,
    NeuralFoil,
    PolarTables,
    SectionLatticeSolver,
    SectionSettings,
    SeparationLag,
)
from indicial.cfd.shapes import LiftingSurface, SpanStation, WingSection
from indicial.conventions import ReferenceQuantities
from indicial.motion import FlightCondition
from indicial.reference_data import data_folder, read_table
from indicial.studies.bocian.sections import changed

ROOT, TIP, TAIL = (WingSection.naca(digits) for digits in ("43018", "43012", "0012"))
"""Sections; 43018A and 43012A are taken for the plain ones, the tail's is estimated."""

TRIPPED, FREE = "tripped", "free"
"""Polars with transition forced at a tenth of the chord on both sides, and with free transition."""

REYNOLDS = (0.6e6, 0.9e6, 1.3e6, 1.9e6, 2.8e6, 4.2e6)
USUAL = 0.25
"""C_lp on the span over C_lp on half of it, in both the moment and the rate."""


@dataclass(frozen=True)
class Glider:
    """Dimensions [m], [m^2], [rad]; `published` gives those of the data sheet, with estimates where it has none."""

    span: float
    area: float
    sweep: float
    dihedral: float
    taper: float
    washout: float
    tail_area: float
    tail_arm: float
    tail_span: float
    tail_taper: float
    tail_height: float
    fin_area: float
    fin_height: float
    fin_taper: float
    tail: bool = True
    fin: bool = False

    @classmethod
    def published(cls) -> Glider:
        """Dimensions of ``data/reference/szd9_bocian.csv``."""
        values = dimensions()
        angles: dict[str, Any] = {name: math.radians(values[f"wing_{name}"]) for name in ("dihedral", "washout")}
        tails: dict[str, Any] = {name: values[name] for name in values if name.startswith(("tail_", "fin_"))}
        return cls(
            span=values["wing_span"],
            area=values["wing_area"],
            sweep=math.radians(values["wing_quarter_chord_sweep"]),
            taper=values["wing_taper"],
            **angles,
            **tails,
        )

    @property
    def root_chord(self) -> float:
        """Of the trapezium of that area [m]."""
        return 2.0 * self.area / (self.span * (1.0 + self.taper))

    def surfaces(self) -> tuple[LiftingSurface, ...]:
        """Wing, tailplane and fin; mesh axes, origin at the wing root's leading edge."""
        wing = LiftingSurface.wing(
            "wing",
            self.span,
            self.root_chord,
            taper=self.taper,
            sweep=self.sweep,
            dihedral=self.dihedral,
            washout=self.washout,
            sections=(ROOT, TIP),
        )
        found = [wing]
        quarter = 0.25 * self.root_chord + self.tail_arm
        if self.tail:
            chord = 2.0 * self.tail_area / (self.tail_span * (1.0 + self.tail_taper))
            place = (quarter - 0.25 * chord, self.tail_height)
            found.append(
                LiftingSurface.wing(
                    "tailplane",
                    self.tail_span,
                    chord,
                    taper=self.tail_taper,
                    sections=(TAIL, TAIL),
                    root_leading_edge=place,
                )
            )
        if self.fin:
            chord = 2.0 * self.fin_area / (self.fin_height * (1.0 + self.fin_taper))
            foot, x = self.tail_height, quarter - 0.25 * chord
            stations = (
                SpanStation(x, 0.0, foot, chord, section=TAIL),
                SpanStation(
                    x + 0.25 * chord * (1.0 - self.fin_taper),
                    0.0,
                    foot + self.fin_height,
                    chord * self.fin_taper,
                    section=TAIL,
                ),
            )
            found.append(LiftingSurface("fin", stations, symmetric=False))
        return tuple(found)

    @property
    def reference(self) -> ReferenceQuantities:
        """Half the span as the length of everything, about the wing root's quarter chord."""
        half = 0.5 * self.span
        return ReferenceQuantities(half, self.area, (0.25 * self.root_chord, 0.0, 0.0), lateral_length=half)


def dimensions() -> dict[str, float]:
    """The data sheet by quantity."""
    table = read_table("szd9_bocian")
    return dict(zip(table.text("quantity"), (float(v) for v in table.numbers("value")), strict=True))


def flight(alpha_deg: float) -> FlightCondition:
    """At the speed that the paper's frequencies imply, at sea level."""
    still = FlightCondition(0.1)
    return FlightCondition(dimensions()["speed"] / still.speed_of_sound, alpha=math.radians(alpha_deg))


def glider(changes: dict[str, Any]) -> Glider:
    """The published one with changes."""
    return replace(Glider.published(), **changes)


def polars(kind: str) -> PolarTables:
    """The kept polars of wing and tail sections: ``tripped`` or ``free``."""
    return PolarTables.from_csv(Path(str(data_folder() / "reference" / f"szd9_polars_{kind}.csv")))


def make_polars(kind: str) -> PolarTables:
    """The polars anew, by the network of `indicial.cfd.lattice.NeuralFoil`."""
    network = NeuralFoil(size="xlarge", transition=0.1 if kind == TRIPPED else 1.0)
    return PolarTables.of(network(section, reynolds) for section in (ROOT, TIP, TAIL) for reynolds in REYNOLDS)


def solver(settings: dict[str, Any]) -> SectionLatticeSolver:
    """The glider of a piece: lattice, sections, time constants and spread of separation."""
    one = glider(settings.get("changes", {}))
    rows, columns = settings["panels"]
    others = {"tailplane": 6, "fin": 5}
    lattice = Lattice.of(one.surfaces(), chordwise=int(rows), spanwise={"wing": int(columns), **others}, camber=False)
    lag = SeparationLag(*settings.get("lag", (SeparationLag.delay, SeparationLag.response)))
    source = changed(polars(settings["polars"]), settings)
    model = SectionSettings(lag, spread=float(settings.get("spread", 0.0)))
    return SectionLatticeSolver(lattice, one.reference, source, model)
