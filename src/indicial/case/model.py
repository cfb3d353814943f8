"""What a case file may say: one model a table, the unit of every quantity in its key.

Every field has a description: the case-file page of the documentation is made from it, and so are error messages.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from indicial.conventions import ReferenceQuantities
from indicial.motion import FlightCondition
from indicial.reference_data import finner_range_machs

if TYPE_CHECKING:
    from indicial.cfd.shapes import FinnedBody

UNITS = {
    "deg": "degrees",
    "m": "metres",
    "K": "kelvin",
    "Pa": "pascals",
    "kg": "kilograms",
    "kg_m2": "kg m^2",
    "calibres": "calibres",
    "m2": "square metres",
    "m_s": "metres per second",
    "m_s2": "metres per second squared",
    "kg_m3": "kilograms per cubic metre",
    "s": "seconds",
    "deg_s": "degrees per second",
    "k": "omega c/2V",
    "k_max": "omega c/2V",
}
"""Unit of a quantity by its key or the end of it."""

Positive = Annotated[float, Field(gt=0.0)]
Distance = Annotated[float, Field(ge=1.0, le=200.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
SmallAngle = Annotated[float, Field(gt=0.0, le=5.0)]
SmallRate = Annotated[float, Field(gt=0.0, le=0.05)]
Frequency = Annotated[float, Field(ge=0.0, le=20.0)]


class Section(BaseModel):
    """A table of a case file: strict types, no unknown keys, finite numbers."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class Condition(Section):
    """Steady flight through still air."""

    mach: Annotated[float, Field(gt=0.0, le=10.0, description="Mach number")]
    alpha_deg: Annotated[float, Field(gt=-90.0, lt=90.0, description="mean angle of attack")] = 0.0
    temperature_K: Annotated[float, Field(gt=0.0, description="static temperature of the still air")] = 293.15
    pressure_Pa: Annotated[float, Field(gt=0.0, description="static pressure of the still air")] = 101325.0


class Fins(Section):
    """Equal trapezoidal fins, evenly spread round the body, thickness in proportion to the local chord."""

    number: Annotated[int, Field(ge=1, le=16, description="number of fins")] = 4
    root_chord_calibres: Annotated[Positive, Field(description="chord at the body")]
    tip_chord_calibres: Annotated[Positive, Field(description="chord at the tip")]
    span_calibres: Annotated[Positive, Field(description="exposed span of one fin, from the body's surface")]
    trailing_edge_calibres: Annotated[Positive, Field(description="trailing edge of the root, from the nose")]
    section: Annotated[
        Literal["single_wedge", "double_wedge"],
        Field(description="section: sharp in front and cut off at its thickest, or thickest at half chord"),
    ] = "single_wedge"
    thickness_ratio: Annotated[float, Field(gt=0.0, le=0.2, description="largest thickness over chord")]
    leading_edge_sweep_deg: Annotated[float, Field(ge=0.0, lt=80.0, description="sweep of the leading edge")] = 0.0
    roll_deg: Annotated[
        float, Field(ge=0.0, lt=360.0, description="angle of the first fin from the right, upward: 45 is an x")
    ] = 45.0


class Shape(Section):
    """A finned body of revolution: nose, cylinder, flat base, fins."""

    kind: Annotated[Literal["finned_body"], Field(description="kind of shape")]
    diameter_m: Annotated[Positive, Field(description="calibre d: the body's diameter and reference length")]
    nose: Annotated[Literal["cone", "tangent_ogive"], Field(description="nose type")] = "cone"
    nose_length_calibres: Annotated[Positive, Field(description="length of the nose")]
    length_calibres: Annotated[Positive, Field(description="length of the whole body")]
    fins: Annotated[Fins, Field(description="the fins")]

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.nose_length_calibres >= self.length_calibres:
            raise ValueError("nose_length_calibres: reaches the base; allowed: less than length_calibres")
        if self.fins.trailing_edge_calibres > self.length_calibres:
            raise ValueError("fins.trailing_edge_calibres: is behind the base; allowed: at most length_calibres")
        leading = self.fins.trailing_edge_calibres - self.fins.root_chord_calibres
        if leading < self.nose_length_calibres:
            raise ValueError("fins.root_chord_calibres: reaches onto the nose; allowed: fins on the cylinder")
        return self


class Reference(Section):
    """What coefficients refer to; length d and area pi d^2/4 follow from the shape."""

    moment_reference_calibres: Annotated[
        float, Field(description="moment reference point (centre of gravity), from the nose")
    ]


class Mesh(Section):
    """The body-fitted mesh, of half the body, and of the whole one for roll."""

    resolution: Annotated[
        float, Field(ge=0.5, le=8.0, description="cells along every direction relative to the quick mesh, which is 1")
    ]
    margin: Annotated[
        float, Field(ge=1.0, le=3.0, description="distance of the outer boundary, relative to the bow shock's")
    ] = 1.15
    wake: Annotated[
        Literal["none", "sting"],
        Field(
            description="behind the base: nothing, for supersonic flow from Mach 1.4, or the body goes on as a "
            "cylinder without load in a wide domain, for any Mach number and 2.4 times the cells"
        ),
    ] = "none"
    upstream_calibres: Annotated[
        Distance,
        Field(description="nose to the upstream end, with a sting: short above Mach 1, at least 10 below"),
    ] = 2.0
    downstream_calibres: Annotated[Distance, Field(description="base to the downstream end, with a sting")] = 20.0
    radius_calibres: Annotated[Distance, Field(description="radius of the domain, with a sting")] = 30.0

    @model_validator(mode="after")
    def _used(self) -> Self:
        outer = {"sting": ["margin"], "none": ["upstream_calibres", "downstream_calibres", "radius_calibres"]}
        for key in outer[self.wake]:
            if key in self.model_fields_set:
                raise ValueError(f"{key}: says nothing with wake = {self.wake!r}; allowed: leave it out")
        return self


class Flow(Section):
    """The flow solver."""

    steady_tolerance: Annotated[
        float,
        Field(
            gt=0.0,
            le=1e-6,  # from a looser one the flow cannot be linearised
            description="residual of a steady state, relative to that of still air",
        ),
    ] = 1e-10
    unsteady_tolerance: Annotated[
        float,
        Field(gt=0.0, lt=1.0, description="residual left by a time step, relative to what the motion does to it"),
    ] = 2e-4


class MovingFrame(Section):
    """Steady states in the moving frame (MRF), differences between opposite disturbances."""

    alpha_amplitude_deg: Annotated[SmallAngle, Field(description="half difference in alpha")] = 0.25
    pitch_rate: Annotated[SmallRate, Field(description="half difference in q c/2V")] = 0.001
    roll_rate: Annotated[SmallRate, Field(description="p c/2V of the whole model")] = 0.005
    second_factor: Annotated[
        float,
        Field(gt=1.0, le=4.0, description="second amplitude of every rate, relative to the first: shows linearity"),
    ] = 2.0


class ForcedOscillation(Section):
    """Forced oscillation (FOM): pitching about the moment reference, and plunging."""

    k: Annotated[float, Field(gt=0.0, le=2.0, description="reduced frequency")] = 0.1
    amplitude_deg: Annotated[SmallAngle, Field(description="amplitude in alpha")] = 0.25
    second_factor: Annotated[
        float,
        Field(gt=1.0, le=4.0, description="second amplitude in pitch, relative to the first: shows linearity"),
    ] = 2.0
    steps_per_period: Annotated[int, Field(ge=16, le=10000, multiple_of=2, description="time steps in a period")] = 48
    periods: Annotated[
        int, Field(ge=2, le=50, description="whole periods; the first is left to the start and not read")
    ] = 2


class IndicialResponse(Section):
    """Responses to steps in alpha and in q (IRM)."""

    alpha_amplitude_deg: Annotated[SmallAngle, Field(description="step in alpha")] = 0.25
    pitch_rate: Annotated[SmallRate, Field(description="step in q c/2V")] = 0.0005
    second_factor: Annotated[
        float,
        Field(gt=1.0, le=4.0, description="second size of both steps, relative to the first: shows linearity"),
    ] = 2.0
    first_step: Annotated[Positive, Field(description="first time step, in s = 2Vt/c")] = 0.05
    growth: Annotated[float, Field(ge=1.0, le=1.5, description="ratio of neighbouring time steps, up to the last")] = (
        1.1
    )
    last_step: Annotated[Positive, Field(description="largest time step, in s")] = 1.5
    duration: Annotated[Positive, Field(description="length of the response, in s")] = 60.0

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.first_step <= self.last_step < self.duration:
            raise ValueError("last_step: is out of order; allowed: first_step <= last_step < duration")
        return self


class Operator(Section):
    """The flow linearised about its steady state: derivatives and H(ik) by linear solves, without a march."""

    k: Annotated[
        list[Frequency],
        Field(description="reduced frequencies of H(ik), beside 0 and that of the forced oscillation"),
    ] = [0.05, 0.2, 0.5]
    inputs: Annotated[
        list[Literal["alpha", "q", "beta", "p", "r"]],
        Field(
            description="motions that loads respond to; alpha and q must be there, half the body serves the others too"
        ),
    ] = ["alpha", "q"]
    k_max: Annotated[
        Frequency, Field(description="band, from 0, of the model projected from the operator; 0 makes none")
    ] = 0.5
    tolerance: Annotated[
        float,
        Field(ge=1e-6, le=0.1, description="error of that model over the band, relative to the peak of each channel"),
    ] = 0.01

    @model_validator(mode="after")
    def _longitudinal(self) -> Self:
        if not {"alpha", "q"} <= set(self.inputs):
            raise ValueError("inputs: lacks alpha or q, which other methods are compared with; allowed: both, and more")
        if len(set(self.inputs)) < len(self.inputs):
            raise ValueError("inputs: holds one twice; allowed: each once")
        return self


class Rom(Section):
    """The state-space model identified from the step responses."""

    order: Annotated[int, Field(ge=1, le=30, description="largest number of states for each input")] = 6


class Vehicle(Section):
    """Mass properties of the model in flight."""

    mass_kg: Annotated[Positive, Field(description="mass")]
    axial_inertia_kg_m2: Annotated[Positive, Field(description="moment of inertia about the body's axis, Ix")]
    transverse_inertia_kg_m2: Annotated[Positive, Field(description="moment of inertia in pitch and yaw, Iy = Iz")]

    @model_validator(mode="after")
    def _physical(self) -> Self:
        if self.axial_inertia_kg_m2 > 2.0 * self.transverse_inertia_kg_m2:
            raise ValueError("axial_inertia_kg_m2: no body has it; allowed: up to twice transverse_inertia_kg_m2")
        return self


class Flight(Section):
    """The free flight that is simulated and then identified."""

    distance_m: Annotated[float, Field(gt=0.0, le=5000.0, description="length of the range")] = 230.0
    initial_alpha_deg: Annotated[
        float, Field(ge=-10.0, le=10.0, description="angle of attack at the start of the flight")
    ] = 1.0
    initial_beta_deg: Annotated[float, Field(ge=-10.0, le=10.0, description="sideslip at the start")] = 0.0
    roll_rate_deg_s: Annotated[float, Field(ge=-36000.0, le=36000.0, description="roll rate at the start")] = 0.0

    @model_validator(mode="after")
    def _disturbed(self) -> Self:
        if self.initial_alpha_deg == 0.0 and self.initial_beta_deg == 0.0:
            raise ValueError("initial_alpha_deg: is 0, as is initial_beta_deg; allowed: one of them not 0")
        return self


class Range(Section):
    """Spark-range measurements of that flight: stations, positions and angles with noise."""

    stations: Annotated[int, Field(ge=12, le=1000, description="number of stations along the range")] = 54
    position_noise_m: Annotated[Positive, Field(description="standard deviation of a measured position")] = 0.001
    angle_noise_deg: Annotated[Positive, Field(description="standard deviation of yaw and pitch")] = 0.1
    roll_noise_deg: Annotated[Positive, Field(description="standard deviation of roll, measured if it rolls")] = 1.0
    seed: Annotated[int, Field(ge=0, description="seed of the noise: the same seed, the same noise")] = 1


class Comparison(Section):
    """What the results are compared with."""

    measured: Annotated[
        Literal["none", "basic_finner_range"],
        Field(description="measured derivatives: the Basic Finner's free flights (DREV-TM-9703), or none"),
    ] = "none"


class Run(Section):
    """How the work is done; nothing here changes a result."""

    workers: Annotated[int, Field(ge=1, le=256, description="processes that share the CFD runs")] = 2


class Case(Section):
    """A case file: from a shape to a flown, identified and checked model."""

    title: Annotated[str, Field(min_length=1, max_length=120, description="what the report is headed with")]
    condition: Annotated[Condition, Field(description="flight condition")]
    shape: Annotated[Shape, Field(description="the body")]
    reference: Annotated[Reference, Field(description="reference quantities")]
    mesh: Annotated[Mesh, Field(description="the mesh")]
    flow: Annotated[Flow, Field(description="the flow solver")] = Flow()
    moving_frame: Annotated[MovingFrame, Field(description="moving reference frame, MRF")] = MovingFrame()
    forced_oscillation: Annotated[ForcedOscillation, Field(description="forced oscillation, FOM")] = ForcedOscillation()
    indicial_response: Annotated[IndicialResponse, Field(description="indicial response, IRM")] = IndicialResponse()
    operator: Annotated[Operator, Field(description="linearised flow")] = Operator()
    rom: Annotated[Rom, Field(description="reduced-order model")] = Rom()
    vehicle: Annotated[Vehicle, Field(description="mass properties")]
    flight: Annotated[Flight, Field(description="free flight")] = Flight()
    range: Annotated[Range, Field(description="measurements of the flight")] = Range()
    comparison: Annotated[Comparison, Field(description="measured data")] = Comparison()
    run: Annotated[Run, Field(description="how the work is done")] = Run()

    @model_validator(mode="after")
    def _solvable(self) -> Self:
        mach = self.condition.mach
        if mach < 1.4 and self.mesh.wake == "none":
            raise ValueError(
                "condition.mach: is too low for a mesh that ends at the base, where all flow must leave supersonic; "
                "allowed: at least 1.4, or any with wake = 'sting' in the table mesh"
            )
        if mach < 1.0 and self.mesh.upstream_calibres < 10.0:
            raise ValueError(
                f"mesh.upstream_calibres: is {self.mesh.upstream_calibres:g}, too short for subsonic flow; "
                "allowed: at least 10 below Mach 1"
            )
        if self.comparison.measured == "basic_finner_range":
            lowest, highest = finner_range_machs()
            if not lowest <= mach <= highest:
                raise ValueError(
                    f"comparison.measured: was flown from Mach {lowest:g} to {highest:g}, not at {mach:g}; "
                    "allowed: 'none' there"
                )
        if not 0.0 < self.reference.moment_reference_calibres < self.shape.length_calibres:
            raise ValueError("reference.moment_reference_calibres: is off the body; allowed: 0 to length_calibres")
        return self

    @property
    def flight_condition(self) -> FlightCondition:
        """The flight condition, in SI units and radians."""
        c = self.condition
        return FlightCondition(c.mach, math.radians(c.alpha_deg), 0.0, c.temperature_K, c.pressure_Pa)

    @property
    def body(self) -> FinnedBody:
        """The shape."""
        # the solver's package takes seconds to load; a case is read in far less
        from indicial.cfd.shapes import FinnedBody, FinSet, Nose

        s, f = self.shape, self.shape.fins
        fins = FinSet(
            number=f.number,
            root_chord=f.root_chord_calibres,
            tip_chord=f.tip_chord_calibres,
            span=f.span_calibres,
            trailing_edge=f.trailing_edge_calibres,
            section=f.section,
            thickness_ratio=f.thickness_ratio,
            leading_edge_sweep_deg=f.leading_edge_sweep_deg,
            roll_deg=f.roll_deg,
        )
        return FinnedBody(s.diameter_m, Nose(s.nose, s.nose_length_calibres), s.length_calibres, fins)

    @property
    def reference_quantities(self) -> ReferenceQuantities:
        """Length d, area pi d^2/4, moment reference point; rates per c/2V."""
        return self.body.reference(self.reference.moment_reference_calibres)
