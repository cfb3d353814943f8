"""Aircraft files: an aircraft by its derivatives in one flight condition, for its modes and their damping."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from indicial.case.model import NotNegative, Positive, Section
from indicial.case.reading import parse, read_text
from indicial.conventions import ReferenceQuantities
from indicial.flightsim import BodyAxisAerodynamics, Vehicle

DERIVATIVES = tuple(
    item.name
    for item in fields(BodyAxisAerodynamics)
    if item.name.startswith("C") and not item.name.endswith("_0") and item.name != "CD_0"
)
"""Names that an aircraft file may give."""


class AircraftReference(Section):
    """What coefficients and rates are made dimensionless with."""

    chord_m: Annotated[Positive, Field(description="mean chord c: pitching moment, q c/2V and alphadot c/2V")]
    span_m: Annotated[Positive, Field(description="span b: rolling and yawing moment, p b/2V and r b/2V")]
    area_m2: Annotated[Positive, Field(description="wing area S")]

    @property
    def quantities(self) -> ReferenceQuantities:
        """Chord, span and area, about the centre of gravity."""
        return ReferenceQuantities(self.chord_m, self.area_m2, lateral_length=self.span_m)


class AircraftMass(Section):
    """Mass properties, about the centre of gravity, in the axes of the derivatives."""

    mass_kg: Annotated[Positive, Field(description="mass")]
    Ixx_kg_m2: Annotated[Positive, Field(description="moment of inertia in roll")]
    Iyy_kg_m2: Annotated[Positive, Field(description="moment of inertia in pitch")]
    Izz_kg_m2: Annotated[Positive, Field(description="moment of inertia in yaw")]
    Ixz_kg_m2: Annotated[float, Field(description="product of inertia, the integral of x z dm")] = 0.0

    def vehicle(self, title: str, reference: ReferenceQuantities) -> Vehicle:
        """Mass and inertia, about the centre of gravity."""
        x, y, z, xz = self.Ixx_kg_m2, self.Iyy_kg_m2, self.Izz_kg_m2, self.Ixz_kg_m2
        inertia = np.array([[x, 0.0, -xz], [0.0, y, 0.0], [-xz, 0.0, z]])
        return Vehicle(title, self.mass_kg, inertia, reference, (0.0, 0.0, 0.0))


class AircraftCondition(Section):
    """The steady flight that the derivatives are of."""

    speed_m_s: Annotated[Positive, Field(description="true airspeed")]
    density_kg_m3: Annotated[Positive, Field(description="of the air")]
    temperature_K: Annotated[Positive, Field(description="of the air, for the Mach number")] = 288.15
    altitude_m: Annotated[float, Field(description="for the record")] = 0.0
    path_angle_deg: Annotated[float, Field(gt=-80.0, lt=80.0, description="climb angle")] = 0.0
    gravity_m_s2: Annotated[Positive, Field(description="of the place")] = 9.80665


class AircraftFile(Section):
    """An aircraft by its derivatives in stability axes: x along the velocity of the steady flight."""

    schema_version: Annotated[Literal[1], Field(description="of this format")]
    title: Annotated[str, Field(min_length=1, description="what it is")]
    source: Annotated[str, Field(min_length=1, description="where the numbers are from")]
    aircraft_class: Annotated[
        Literal["I", "II", "II-L", "II-C", "III", "IV"], Field(description="class of MIL-F-8785C")
    ]
    category: Annotated[Literal["A", "B", "C"], Field(description="category of the flight phase, MIL-F-8785C")]
    reference: Annotated[AircraftReference, Field(description="reference quantities")]
    mass: Annotated[AircraftMass, Field(description="mass properties")]
    condition: Annotated[AircraftCondition, Field(description="steady flight")]
    derivatives: Annotated[
        dict[str, float],
        Field(description="per rad, rates and alphadot per c/2V or b/2V, u per V: CX_u, CZ_alpha, Cm_q, Cl_p, ..."),
    ]
    uncertainties: Annotated[dict[str, NotNegative], Field(description="standard errors by the same names")] = {}  # noqa: RUF012

    @model_validator(mode="after")
    def _known(self) -> Self:
        for table in ("derivatives", "uncertainties"):
            for name in getattr(self, table):
                if name not in DERIVATIVES:
                    raise ValueError(f"{table}.{name}: no such derivative; allowed: {', '.join(DERIVATIVES)}")
        for name in self.uncertainties:
            if name not in self.derivatives:
                raise ValueError(f"uncertainties.{name}: is of a derivative that is not given; allowed: those given")
        for needed in ("CZ_alpha", "Cm_alpha", "Cm_q"):
            if needed not in self.derivatives:
                raise ValueError(f"derivatives.{needed}: missing; allowed: a number")
        return self

    @property
    def reference_quantities(self) -> ReferenceQuantities:
        """Chord, span and area, about the centre of gravity."""
        return self.reference.quantities

    @property
    def vehicle(self) -> Vehicle:
        """Mass and inertia."""
        return self.mass.vehicle(self.title, self.reference.quantities)

    def aerodynamics(self, speed: float | None = None) -> BodyAxisAerodynamics:
        """The derivatives, those of the speed about `speed` [m/s] (the file's if not given)."""
        values: dict[str, Any] = dict(self.derivatives)
        about = self.condition.speed_m_s if speed is None else speed
        return BodyAxisAerodynamics(reference=self.reference_quantities, speed=about, **values)


def read_aircraft(path: str | Path) -> AircraftFile:
    """Read and check an aircraft file.

    Raises
    ------
    InputError
        ``FILE: key.path: what is wrong; allowed: ...``
    """
    return parse(AircraftFile, read_text(path), str(path))
