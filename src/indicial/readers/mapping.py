r"""The map: what a file cannot say of itself, in TOML. Nothing of it is assumed.

::

    [condition]                  # the flight condition about which the motion is made
    mach = 2.0
    alpha_deg = 0.0
    temperature_K = 288.15
    pressure_Pa = 101325.0

    [reference]                  # what the loads shall be made dimensionless with
    length_m = 0.25
    area_m2 = 0.2
    moment_reference_m = [0.1, 0.0, 0.0]

    [made_with]                  # only if the file holds coefficients: what they were made with
    length_m = 1.0
    area_m2 = 1.0
    density_kg_m3 = 1.225
    speed_m_s = 340.0

    [time]
    unit = "s"                   # also "ms", "us", "2Vt/c", "Vt/c"
    column = "flow-time"         # where the format does not fix it; or step_s = 1e-4 where it only counts steps

    [axes]                       # in which the file gives its loads
    frame = "x aft, z up"
    body_pitch_deg = 0.0         # of the body's nose above the frame, before the motion
    turn_with_body = true        # only for motions that rotate: whether the frame does too

    [columns]                    # quantity = "name in the file"
    Cx = "cx"
    Cz = "cz"
    Cmy = "cm"

    [[histories]]
    files = ["alpha_step-rfile.out"]
    motion = { kind = "alpha_step", amplitude_deg = 1.0, start = 0.0 }
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.files import why
from indicial.motion import FlightCondition
from indicial.readers.axes import FRAMES
from indicial.readers.registry import FORMATS

Positive = Annotated[float, Field(gt=0.0)]
Before = dict[Literal["CA", "CY", "CN", "Cl", "Cm", "Cn"], float]


class Section(BaseModel):
    """A table of a map: no unknown keys, finite numbers."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Condition(Section):
    """The flight condition."""

    mach: Positive
    alpha_deg: float
    beta_deg: float = 0.0
    temperature_K: Positive
    pressure_Pa: Positive

    def flight_condition(self) -> FlightCondition:
        """In SI and radians."""
        degree = 0.017453292519943295
        return FlightCondition(
            self.mach, degree * self.alpha_deg, degree * self.beta_deg, self.temperature_K, self.pressure_Pa
        )


class Reference(Section):
    """What the loads shall be made dimensionless with."""

    length_m: Positive
    area_m2: Positive
    moment_reference_m: tuple[float, float, float]
    lateral_length_m: Positive | None = None
    rate_normalisation: Literal["c/2V", "c/V"] = "c/2V"

    def quantities(self) -> ReferenceQuantities:
        """As the package holds them."""
        return ReferenceQuantities(
            self.length_m, self.area_m2, self.moment_reference_m, self.lateral_length_m, self.rate_normalisation
        )


class MadeWith(Section):
    """What the file's coefficients were made with: one length serves all moments."""

    length_m: Positive | None = None
    area_m2: Positive | None = None
    density_kg_m3: Positive | None = None
    speed_m_s: Positive | None = None


class Time(Section):
    """How the file tells time."""

    unit: Literal["s", "ms", "us", "2Vt/c", "Vt/c"]
    column: str | None = None
    step_s: Positive | None = None


class Axes(Section):
    """In which the file gives its loads."""

    frame: str
    body_pitch_deg: float
    turn_with_body: bool | None = None
    pitch_axis: Literal["right", "left"] | None = None

    @model_validator(mode="after")
    def _known(self) -> Self:
        if self.frame not in FRAMES:
            raise ValueError(f"frame is {self.frame!r}; allowed: {', '.join(map(repr, FRAMES))}")
        return self


class AlphaStep(Section):
    """A jump of the angle of attack without rotation, at `start` in the file's time."""

    kind: Literal["alpha_step"]
    amplitude_deg: float
    start: float
    row_at_start: Literal["before", "after"] | None = None


class RateStep(Section):
    """A jump of the pitch rate at constant angle of attack, at `start` in the file's time."""

    kind: Literal["pitch_rate_step"]
    rate_deg_s: float | None = None
    reduced_rate: float | None = None
    start: float
    row_at_start: Literal["before", "after"] | None = None

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        if (self.rate_deg_s is None) == (self.reduced_rate is None):
            raise ValueError("give either rate_deg_s or reduced_rate (q c/2V)")
        return self


class Oscillation(Section):
    """``amplitude sin(omega (t - start))`` in pitch about the moment reference point, or one half of that motion."""

    kind: Literal["pitch_oscillation", "plunge_oscillation", "pitch_rate_oscillation"]
    amplitude_deg: float
    frequency_Hz: Positive | None = None
    omega_rad_s: Positive | None = None
    k: Positive | None = None
    start: float

    @model_validator(mode="after")
    def _one_frequency(self) -> Self:
        if sum(one is not None for one in (self.frequency_Hz, self.omega_rad_s, self.k)) != 1:
            raise ValueError("give one of frequency_Hz, omega_rad_s, k")
        return self


class TableMotion(Section):
    """A motion in columns, of a file of its own or of that of the loads; what is not given is constant.

    `alpha` is the whole angle of attack at the moment reference point.
    """

    kind: Literal["table"]
    file: str | None = None
    time: str
    alpha: str | None = None
    q: str | None = None
    angle_unit: Literal["deg", "rad"]
    start: float


MotionMap = Annotated[AlphaStep | RateStep | Oscillation | TableMotion, Field(discriminator="kind")]


class HistoryMap(Section):
    """One run: its files, its motion, and the loads before it where the file does not hold them."""

    files: tuple[str, ...] = ()
    motion: MotionMap
    before: Before | None = None


class Mapping(Section):
    """A whole map."""

    format: str | None = None
    condition: Condition
    reference: Reference
    made_with: MadeWith = MadeWith()
    time: Time
    axes: Axes
    columns: dict[str, str]
    histories: Annotated[tuple[HistoryMap, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _known(self) -> Self:
        if self.format is not None and self.format not in FORMATS:
            raise ValueError(f"format is {self.format!r}; allowed: {', '.join(FORMATS)}")
        return self


def read_mapping(path: str | Path) -> Mapping:
    """Read and check a map.

    Raises
    ------
    InputError
        ``FILE: key: what is wrong`` for the first thing that is wrong, with the number of others.
    """
    try:
        content = tomllib.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({why(error)})") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not valid TOML: {error}") from error
    return parse_mapping(content, str(path))


def parse_mapping(content: dict[str, Any], name: str = "map") -> Mapping:
    """The map of these tables; `name` heads error messages."""
    try:
        return Mapping.model_validate(content)
    except ValidationError as error:
        # a misspelt key leaves another one missing: say the misspelling, which explains both
        found = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
        rest = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        raise InputError(f"{name}: {_say(dict(found[0]))}{rest}") from None


def _say(problem: dict[str, Any]) -> str:
    key = ".".join(str(part) for part in problem["loc"])
    if problem["type"] == "missing":
        return f"{key}: missing; it is asked for because it cannot be told from the file"
    if problem["type"] == "extra_forbidden":
        return f"{key}: unknown key"
    if problem["type"] == "value_error":
        return f"{key}: {problem['ctx']['error']}"
    return f"{key}: {problem['msg']}"
