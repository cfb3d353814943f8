"""Flight test files: records of instruments, the aircraft that flew them, and the derivatives that are looked for."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from indicial.case.aircraft import AircraftMass, AircraftReference
from indicial.case.model import Positive, Section
from indicial.case.reading import parse, read_text
from indicial.flightsim import Vehicle

Place = Annotated[list[float], Field(min_length=3, max_length=3)]


class Instruments(Section):
    """Where instruments are, from the centre of gravity in body axes x forward, y right, z down."""

    accelerometers_m: Annotated[Place, Field(description="accelerometers")] = [0.0, 0.0, 0.0]  # noqa: RUF012
    vanes_m: Annotated[Place, Field(description="vanes of alpha and beta, and the speed's probe")] = [0.0, 0.0, 0.0]  # noqa: RUF012
    upwash: Annotated[Positive, Field(description="what the vane shows of alpha, times alpha")] = 1.0
    sidewash: Annotated[Positive, Field(description="what the vane shows of beta, times beta")] = 1.0


class Air(Section):
    """The standard atmosphere of the day; altitude is that of the records where they have it."""

    altitude_m: Annotated[
        float | None,
        Field(ge=-5e3, le=86e3, description="of records without; by default that of the density in the record, or 0"),
    ] = None
    temperature_offset_K: Annotated[float, Field(gt=-80.0, lt=80.0, description="warmer than standard by")] = 0.0


class Longitudinal(Section):
    """Terms of the forces and the moment in the plane of symmetry, beside the constant that each has."""

    CX: Annotated[list[str], Field(description="of the force along x, such as `alpha`, `alpha^2`")]
    CZ: Annotated[list[str], Field(description="of the force along z, such as `alpha`, `q`, `elevator`")]
    Cm: Annotated[list[str], Field(description="of the pitching moment, such as `alpha`, `q`, `alpha*elevator`")]


class Lateral(Section):
    """Terms out of the plane of symmetry; all three empty: the records are of flight in it."""

    CY: Annotated[list[str], Field(description="of the side force, such as `beta`, `rudder`")] = []  # noqa: RUF012
    Cl: Annotated[list[str], Field(description="of the rolling moment, such as `beta`, `p`, `aileron`")] = []  # noqa: RUF012
    Cn: Annotated[list[str], Field(description="of the yawing moment, such as `beta`, `r`, `rudder`")] = []  # noqa: RUF012


class OutputError(Section):
    """How the model is flown against the records."""

    channels: Annotated[list[str], Field(description="to fit; empty: all of motion, attitude and acceleration")] = []  # noqa: RUF012
    biases: Annotated[list[str], Field(description="channels with an unknown offset, found in the fit")] = []  # noqa: RUF012
    segments: Annotated[int, Field(ge=1, le=1000, description="pieces of multiple shooting, for unstable flight")] = 1
    steps_per_interval: Annotated[int, Field(ge=1, le=100, description="integration steps from sample to sample")] = 1
    leave_out_outliers: Annotated[bool, Field(description="whether the fit is repeated without suspicious samples")] = (
        True
    )


class FlightTest(Section):
    """Records, aircraft, and the coefficients' terms, whose values are looked for: `Cm_0`, `Cm_alpha`, `Cm_q`, ..."""

    schema_version: Annotated[Literal[1], Field(description="of this format")]
    title: Annotated[str, Field(min_length=1, max_length=120, description="what the report is headed with")]
    records: Annotated[
        list[str], Field(min_length=1, description="tables of measurements, beside this file; fitted together")
    ]
    map: Annotated[str, Field(description="which column is which channel, a file beside this one")]
    reference: Annotated[AircraftReference, Field(description="reference quantities")]
    mass: Annotated[AircraftMass, Field(description="mass properties")]
    instruments: Annotated[Instruments, Field(description="where they are")] = Instruments()
    air: Annotated[Air, Field(description="the day's air")] = Air()
    longitudinal: Annotated[Longitudinal, Field(description="terms in the plane of symmetry")]
    lateral: Annotated[Lateral, Field(description="terms out of it")] = Lateral()
    expected: Annotated[
        dict[str, float], Field(description="values known before, as from CFD: each estimate is held against its own")
    ] = {}  # noqa: RUF012
    expected_errors: Annotated[dict[str, Positive], Field(description="their standard errors")] = {}  # noqa: RUF012
    prior: Annotated[list[str], Field(description="expected values, with errors, that bind the fit")] = []  # noqa: RUF012
    fixed: Annotated[dict[str, float], Field(description="values that are not looked for but taken")] = {}  # noqa: RUF012
    output_error: Annotated[OutputError, Field(description="how the model is fitted")] = OutputError()

    @model_validator(mode="after")
    def _known(self) -> Self:
        names = [f"{name}_{term}" for name, terms in self.terms.items() for term in ("0", *terms)]
        for table in ("expected", "fixed"):
            for name in getattr(self, table):
                if name not in names:
                    raise ValueError(f"{table}.{name}: no such term; allowed: {', '.join(names)}")
        for name in self.expected_errors:
            if name not in self.expected:
                raise ValueError(f"expected_errors.{name}: is of a value not expected; allowed: names in [expected]")
        for name in self.prior:
            if name not in self.expected_errors:
                raise ValueError(f"prior: {name} has no expected value with an error; allowed: those in both tables")
            if name in self.fixed:
                raise ValueError(f"prior: {name} is fixed, too; allowed: one of them")
        return self

    @property
    def terms(self) -> dict[str, tuple[str, ...]]:
        """Terms of each coefficient that the model has."""
        lateral = {name: tuple(getattr(self.lateral, name)) for name in ("CY", "Cl", "Cn")}
        own = {name: tuple(getattr(self.longitudinal, name)) for name in ("CX", "CZ", "Cm")}
        return {**own, **(lateral if any(lateral.values()) else {})}

    @property
    def vehicle(self) -> Vehicle:
        """Mass, inertia and reference quantities, about the centre of gravity."""
        return self.mass.vehicle(self.title, self.reference.quantities)


def read_flight_test(path: str | Path) -> FlightTest:
    """Read and check a flight test file.

    Raises
    ------
    InputError
        ``FILE: key.path: what is wrong; allowed: ...``
    """
    return parse(FlightTest, read_text(path), str(path))
