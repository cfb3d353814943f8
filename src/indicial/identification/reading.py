r"""A user's table of a flight as a `FlightRecord`, by a map that says which column is which channel.

::

    [time]
    column = "Time"
    unit = "ms"

    [channels.alpha]
    column = "AOA [deg]"
    unit = "deg"
    sign = -1                    # of the file's convention
    offset = 0.5                 # added, in the file's unit, after sign and scale
    time_shift = 0.02            # the instrument is late by this [s]

    [channels.az]
    column = "Nz"
    unit = "g"
    sign = -1

    [inputs.elevator]
    column = "DE"
    unit = "deg"

    [standard_deviations]        # SI units, radians
    alpha = 0.002

``value = unit * (sign * scale * column + offset)``; a channel given only by the name of its column is in SI units.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.identification.record import CHANNEL_UNITS, FlightRecord, check_channel
from indicial.readers.plain_csv import split_table
from indicial.readers.table import Table, read_text

_DEGREE = math.radians(1.0)
_FOOT, _KNOT, _GRAVITY = 0.3048, 1852.0 / 3600.0, 9.80665
_FACTORS: Mapping[str, Mapping[str, float]] = {
    "m": {"m": 1.0, "km": 1e3, "ft": _FOOT},
    "m/s": {"m/s": 1.0, "km/h": 1.0 / 3.6, "kt": _KNOT, "ft/s": _FOOT},
    "rad": {"rad": 1.0, "deg": _DEGREE, "mrad": 1e-3},
    "rad/s": {"rad/s": 1.0, "deg/s": _DEGREE, "rpm": 2.0 * math.pi / 60.0},
    "rad/s^2": {"rad/s^2": 1.0, "deg/s^2": _DEGREE},
    "m/s^2": {"m/s^2": 1.0, "g": _GRAVITY, "ft/s^2": _FOOT},
    "Pa": {"Pa": 1.0, "hPa": 100.0, "kPa": 1e3, "psf": 47.88025898, "psi": 6894.757293},
    "1": {"1": 1.0, "%": 0.01},
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6},
}
_INPUT_FACTORS = {**_FACTORS["1"], **_FACTORS["rad"], "N": 1.0, "kN": 1e3}

_LARGEST = {"rad": 2.0 * math.pi, "m/s^2": 2000.0, "V": 15e3, "mach": 50.0, "alpha": math.pi, "beta": math.pi / 2.0}
_TURNING = ("phi", "psi")
"""Angles that may count turns: of any size where the map states their unit."""

_LARGEST_RATE = 60.0  # rad/s, of q and r; a missile may roll faster


class _Column(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    column: str
    unit: str | None = None
    scale: Annotated[float, Field(gt=0.0)] = 1.0
    sign: Literal[1, -1] = 1
    offset: float = 0.0
    time_shift: float = 0.0


class _Map(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    time: _Column | str
    channels: Annotated[dict[str, _Column | str], Field(min_length=1)]
    inputs: dict[str, _Column | str] = {}
    standard_deviations: dict[str, float] = {}


def read_flight_record(path: str | Path, columns: Mapping[str, Any] | str | Path) -> FlightRecord:
    """Read a table of a user: separated by commas, semicolons, tabs or blanks, a line of names above the numbers.

    An empty field, or one that is no number, is a dropout.

    Parameters
    ----------
    path : str or Path
    columns : mapping, or str or Path of a TOML file
        Which column is which channel, as in the head of this module.

    Raises
    ------
    InputError
        If the map asks for what is not there, a unit does not fit, or values are of a size that the unit cannot have.
    """
    name, chosen = _read_map(columns)
    table = _read_table(Path(path))
    time = _values("time", chosen.time, _FACTORS["s"], table, name)
    if np.any(np.isnan(time)):
        raise InputError(f"{path}: time is missing in row {int(np.argmax(np.isnan(time))) + 1}")
    channels: dict[str, Array] = {}
    for channel, column in chosen.channels.items():
        check_channel(channel)
        values = _values(channel, column, _FACTORS[CHANNEL_UNITS[channel]], table, name)
        if channel not in _TURNING or isinstance(column, str) or column.unit is None:
            check_size(channel, values, str(path))
        channels[channel] = _shifted(time, values, column)
    inputs = {
        given: _shifted(time, _values(given, column, _INPUT_FACTORS, table, name), column)
        for given, column in chosen.inputs.items()
    }
    try:
        return FlightRecord(time, channels, inputs, chosen.standard_deviations, {"file": Path(path).name})
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def check_size(channel: str, values: Array, source: str) -> None:
    """Raise InputError where values are too large for the unit of the channel, as degrees read as radians are."""
    unit = CHANNEL_UNITS[channel]
    limit = _LARGEST.get(channel, _LARGEST.get(unit, math.inf))
    if channel in ("q", "r"):
        limit = _LARGEST_RATE
    largest = float(np.max(np.abs(values), initial=0.0, where=np.isfinite(values)))
    if largest <= limit:
        return
    angular = unit.startswith("rad")
    guess = f"; are they {unit.replace('rad', 'deg')}? Then the map must say so" if angular else ""
    raise InputError(f"{source}: {channel} reaches {largest:.4g} {unit}, more than is plausible ({limit:.4g}){guess}")


def _read_map(columns: Mapping[str, Any] | str | Path) -> tuple[str, _Map]:
    name, content = "map", columns
    if isinstance(columns, str | Path):
        name = str(columns)
        try:
            content = tomllib.loads(read_text(Path(columns)))
        except tomllib.TOMLDecodeError as error:
            raise InputError(f"{name}: not valid TOML: {error}") from error
    try:
        return name, _Map.model_validate(content)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"] if not str(part).startswith("_") and part != "str")
        what = {"missing": "missing", "extra_forbidden": "unknown key"}.get(first["type"], first["msg"])
        raise InputError(f"{name}: {key}: {what}") from None


def _read_table(path: Path) -> Table:
    names, rows = split_table(path)
    doubled = [name for i, name in enumerate(names) if name in names[:i]]
    if doubled:
        raise InputError(f"{path}: column {doubled[0]!r} is there twice")
    whole = [row for row in rows if len(row) == len(names)]
    if not whole:
        raise InputError(f"{path}: no row has {len(names)} fields")
    values = np.array([[_number(one) for one in row] for row in whole])
    return Table(path.name, dict(zip(names, values.T, strict=True)))


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def _values(name: str, given: _Column | str, factors: Mapping[str, float], table: Table, source: str) -> Array:
    column = _Column(column=given) if isinstance(given, str) else given
    if column.unit is not None and column.unit not in factors:
        raise InputError(f"{source}: unit of {name} is {column.unit!r}; allowed: {', '.join(factors)}")
    factor = 1.0 if column.unit is None else factors[column.unit]
    if column.column not in table.columns:
        raise InputError(f"{source}: {name}: {_no_column(column.column, table)}")
    values = table[column.column]
    if not np.any(np.isfinite(values)):
        raise InputError(f"{table.source}: column {column.column!r} ({name}) holds no number")
    said = re.search(r"[\[(_ ](deg|rad)(?:/s)?[\])]?$", column.column)
    if said and {"deg": "rad", "rad": "deg"}[said[1]] in (column.unit or "rad"):
        raise InputError(f"{source}: {name}: column {column.column!r} is in {said[1]} by its name, not {column.unit}")
    scaled: Array = factor * (column.sign * column.scale * values + column.offset)
    return scaled


def _no_column(name: str, table: Table) -> str:
    return f"{table.source} has no column {name!r}; there are {', '.join(map(repr, table.columns))}"


def _shifted(time: Array, values: Array, given: _Column | str) -> Array:
    """Values moved back by how late the instrument is, between samples by straight lines; dropouts stay."""
    shift = 0.0 if isinstance(given, str) else given.time_shift
    if shift == 0.0:
        return values
    if abs(shift) >= time[-1] - time[0]:
        raise InputError(f"time_shift of column {getattr(given, 'column', given)!r} is longer than the record")
    return np.interp(time + shift, time, values, left=math.nan, right=math.nan)
