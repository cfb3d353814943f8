r"""What instruments measured of a flight: channels and controls in time, with units, dropouts and files."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.files import check_format, parts_of, read_csv, read_netcdf, write_csv, write_netcdf

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

SCHEMA_VERSION = 1
FORMAT = "indicial flight record"

_GROUPS = {
    "m": ("x", "y", "z", "altitude"),
    "m/s": ("V",),
    "rad": ("alpha", "beta", "phi", "theta", "psi"),
    "1": ("mach",),
    "rad/s": ("p", "q", "r"),
    "rad/s^2": ("pdot", "qdot", "rdot"),
    "m/s^2": ("ax", "ay", "az"),
    "Pa": ("dynamic_pressure",),
}
CHANNEL_UNITS: Mapping[str, str] = MappingProxyType(
    {name: unit for unit, names in _GROUPS.items() for name in names},
)
"""The channels that a record may have, and the unit of each."""

_SHOWN = {"rad": ("deg", math.degrees(1.0)), "rad/s": ("deg/s", math.degrees(1.0))} | {
    "rad/s^2": ("deg/s^2", math.degrees(1.0)),
    "Pa": ("kPa", 1e-3),
}
_PANELS = (
    *(("alpha", "beta"), ("V",), ("p", "q", "r"), ("ax", "ay", "az"), ("phi", "theta", "psi")),
    *(("pdot", "qdot", "rdot"), ("mach",), ("dynamic_pressure",), ("x", "y", "z"), ("altitude",)),
)


@dataclass(frozen=True)
class FlightRecord:
    """Measurements of one manoeuvre on one clock.

    Channels: ``x y z`` position of the centre of gravity, earth axes x forward, y right, z down, ``altitude`` [m];
    ``V`` airspeed [m/s]; ``alpha = atan2(w, u)``, ``beta = asin(v/V)`` at the centre of gravity [rad]; ``mach``;
    ``p q r`` [rad/s] and ``pdot qdot rdot`` [rad/s^2], body axes; ``ax ay az`` specific force (all forces but gravity,
    over mass) at the centre of gravity, body axes [m/s^2]; ``phi theta psi`` Euler angles (z-y-x) [rad];
    ``dynamic_pressure`` [Pa].

    Parameters
    ----------
    time : array_like
        Strictly increasing [s], shape (n,).
    channels : mapping of str to array_like
        What was measured, each of shape (n,). NaN is a dropout, or an instant at which a slower instrument was silent.
    inputs : mapping of str to array_like
        Controls, known at all instants, angles in rad, each of shape (n,).
    standard_deviations : mapping of str to float
        Of the noise of channels, in their units, where it is known.
    provenance : dict
        Where it comes from (plain values).

    Raises
    ------
    InputError
        If time does not increase, a length differs, a channel is not one of `CHANNEL_UNITS`, a value is infinite, an
        input has a gap, or nothing was measured.
    """

    time: Array
    channels: Mapping[str, Array]
    inputs: Mapping[str, Array] = field(default_factory=dict)
    standard_deviations: Mapping[str, float] = field(default_factory=dict)
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        time = _column("time", self.time, np.shape(self.time))
        if time.ndim != 1 or time.size < 2:
            raise InputError(f"time of a flight record has shape {time.shape}, must be (n,) with at least 2 instants")
        _all_known("time", time)
        back = np.flatnonzero(np.diff(time) <= 0.0)
        if back.size:
            raise InputError(
                f"time of a flight record does not increase from row {back[0] + 1} ({time[back[0]]:.9g} s) to row "
                f"{back[0] + 2} ({time[back[0] + 1]:.9g} s)"
            )
        channels = {str(name): _column(name, values, time.shape) for name, values in self.channels.items()}
        inputs = {str(name): _column(name, values, time.shape) for name, values in self.inputs.items()}
        for name in (*channels, *self.standard_deviations):
            check_channel(name)
        for name, values in inputs.items():
            _all_known(f"input {name}", values)
            if name in CHANNEL_UNITS or name == "time":
                raise InputError(f"input {name} of a flight record has the name of a channel")
        for name, sd in self.standard_deviations.items():
            if not (math.isfinite(sd) and sd > 0.0):
                raise InputError(f"standard deviation of channel {name} is {sd}, must be positive and finite")
        if not any(np.any(np.isfinite(values)) for values in channels.values()):
            raise InputError("a flight record needs at least one channel with data")
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "channels", MappingProxyType(channels))
        object.__setattr__(self, "inputs", MappingProxyType(inputs))
        deviations = {str(name): float(sd) for name, sd in self.standard_deviations.items()}
        object.__setattr__(self, "standard_deviations", MappingProxyType(deviations))

    def __len__(self) -> int:
        return int(self.time.size)

    def __getitem__(self, name: str) -> Array:
        """A channel or an input by name, shape (n,).

        Raises
        ------
        InputError
            If the record has none of that name.
        """
        if name in self.channels:
            return self.channels[name]
        if name in self.inputs:
            return self.inputs[name]
        raise InputError(f"the flight record has no {name}; it has {', '.join((*self.channels, *self.inputs))}")

    def __reduce__(self) -> tuple[Any, ...]:
        """Read-only mappings do not pickle by themselves."""
        parts = (dict(self.channels), dict(self.inputs), dict(self.standard_deviations), self.provenance)
        return (type(self), (self.time, *parts))

    @property
    def duration(self) -> float:
        """From the first instant to the last [s]."""
        return float(self.time[-1] - self.time[0])

    @property
    def interval(self) -> float:
        """Median time between instants [s]."""
        return float(np.median(np.diff(self.time)))

    @property
    def evenly_sampled(self) -> bool:
        """Whether all intervals agree within a thousandth of one."""
        return bool(np.max(np.abs(np.diff(self.time) - self.interval)) <= 1e-3 * self.interval)

    def measured(self, *names: str) -> Any:
        """Where all of these channels have a value, bool of shape (n,)."""
        known = np.ones(len(self), dtype=bool)
        for name in names:
            known &= np.isfinite(self[name])
        return known

    def require(self, *names: str) -> None:
        """Raise InputError, naming them, unless the record has data of all these channels or inputs."""
        lacking = [name for name in names if name not in self.channels and name not in self.inputs]
        if lacking:
            has = ", ".join((*self.channels, *self.inputs))
            raise InputError(f"the flight record lacks {', '.join(lacking)}; it has {has}")
        dead = [name for name in names if not np.any(np.isfinite(self[name]))]
        if dead:
            raise InputError(f"channel {', '.join(dead)} of the flight record has no data at all")

    def select(self, start: float, end: float) -> FlightRecord:
        """The part from `start` to `end` [s], both included.

        Raises
        ------
        InputError
            If it holds fewer than two instants, or nothing that was measured.
        """
        chosen = (self.time >= start) & (self.time <= end)
        if np.count_nonzero(chosen) < 2:
            span = f"{self.time[0]:.6g} to {self.time[-1]:.6g} s"
            raise InputError(f"{start:g} to {end:g} s holds fewer than two instants of the flight record ({span})")
        return replace(
            self,
            time=self.time[chosen],
            channels={name: values[chosen] for name, values in self.channels.items()},
            inputs={name: values[chosen] for name, values in self.inputs.items()},
        )

    def with_channels(self, **channels: Array) -> FlightRecord:
        """The record with some channels replaced or added."""
        return replace(self, channels={**self.channels, **channels})

    def to_dataset(self) -> xarray.Dataset:
        """The record as an `xarray.Dataset` with units."""
        import xarray as xr

        data: dict[str, Any] = {}
        for name, values in self.channels.items():
            attrs: dict[str, Any] = {"units": CHANNEL_UNITS[name], "kind": "channel"}
            if name in self.standard_deviations:
                attrs["standard_deviation"] = self.standard_deviations[name]
            data[name] = ("time", values, attrs)
        data |= {name: ("time", values, {"kind": "input"}) for name, values in self.inputs.items()}
        return xr.Dataset(data, {"time": ("time", self.time, {"units": "s"})}, self._header())

    def to_netcdf(self, path: str | Path) -> None:
        """Write a netCDF-4 file in one step."""
        write_netcdf(path, self.to_dataset())

    @classmethod
    def from_netcdf(cls, path: str | Path) -> Self:
        """Read a file of `to_netcdf`.

        Raises
        ------
        InputError
            If the file is missing or not a flight record.
        """
        data = read_netcdf(path, FORMAT, SCHEMA_VERSION)
        return cls._from_columns(path, {str(name): data[name].values for name in data.variables}, data.attrs)

    def to_csv(self, path: str | Path) -> None:
        """Write a CSV file: header in `#` lines, units in the names of channels' columns, every digit kept."""
        columns = {"time_s": self.time}
        columns |= {f"{name}_{_suffix(name)}": values for name, values in self.channels.items()}
        write_csv(path, self._header(), {**columns, **self.inputs})

    @classmethod
    def from_csv(cls, path: str | Path) -> Self:
        """Read a file of `to_csv`; files of others are read by `read_flight_record`.

        Raises
        ------
        InputError
            If the file is missing, not a flight record, or holds something that is not a number.
        """
        header, columns = read_csv(path)
        check_format(path, header, FORMAT, SCHEMA_VERSION)
        labels = {f"{name}_{_suffix(name)}": name for name in CHANNEL_UNITS} | {"time_s": "time"}
        return cls._from_columns(path, {labels.get(name, name): values for name, values in columns.items()}, header)

    @classmethod
    def _from_columns(cls, path: str | Path, columns: Mapping[str, Array], header: Mapping[Any, Any]) -> Self:
        with parts_of(path):
            names = {kind: json.loads(header[kind]) for kind in ("channels", "inputs")}
            return cls(
                time=columns["time"],
                channels={name: columns[name] for name in names["channels"]},
                inputs={name: columns[name] for name in names["inputs"]},
                standard_deviations=json.loads(header["standard_deviations"]),
                provenance=json.loads(header["provenance"]),
            )

    def _header(self) -> dict[str, Any]:
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "channels": json.dumps(list(self.channels)),
            "inputs": json.dumps(list(self.inputs)),
            "standard_deviations": json.dumps(dict(self.standard_deviations)),
            "provenance": json.dumps(self.provenance),
        }

    def summary(self) -> str:
        """What was measured, how often, over what range, and what is missing."""
        rate = f"{1.0 / self.interval:.4g} Hz" + ("" if self.evenly_sampled else ", unevenly")
        lines = [f"flight record: {len(self)} instants over {self.duration:.4g} s, {rate}"]
        lines += [f"  {self._line(name, values)}" for name, values in self.channels.items()]
        for name, values in self.inputs.items():
            lines.append(f"  {name:<17}{np.min(values):>11.4g} to {np.max(values):.4g} (input)")
        return "\n".join(lines)

    def _line(self, name: str, values: Array) -> str:
        known = values[np.isfinite(values)]
        if known.size == 0:
            return f"{name:<17}no data"
        unit, scale = shown_unit(name)
        text = f"{name:<17}{scale * np.min(known):>11.4g} to {scale * np.max(known):.4g} {unit}".rstrip()
        if name in self.standard_deviations:
            text += f", standard deviation {scale * self.standard_deviations[name]:.3g}"
        missing = 1.0 - known.size / values.size
        if missing > 0.0:
            text += f", {100.0 * missing:.3g}% missing"
        return text + (", does not change" if np.ptp(known) == 0.0 else "")

    def plot(self) -> Figure:
        """Channels in groups of one unit, and controls, against time; angles in degrees."""
        import matplotlib.pyplot as plt

        groups = [kept for panel in _PANELS if (kept := [name for name in panel if name in self.channels])]
        rows = len(groups) + bool(self.inputs)
        figure, axes = plt.subplots(
            rows, 1, figsize=(9, 1.0 + 1.6 * rows), sharex=True, layout="constrained", squeeze=False
        )
        for ax, names in zip(axes[:, 0], groups, strict=False):
            unit, scale = shown_unit(names[0])
            for name in names:
                known = self.measured(name)
                ax.plot(self.time[known], scale * self.channels[name][known], ".-", ms=2, lw=0.7, label=name)
            ax.set(ylabel=f"[{unit or '1'}]")
        for name, values in self.inputs.items():
            axes[-1, 0].plot(self.time, values, label=name)
        if self.inputs:
            axes[-1, 0].set(ylabel="inputs (rad)")
        axes[-1, 0].set(xlabel="time [s]")
        for ax in axes[:, 0]:
            ax.legend(loc="upper right", fontsize="small", ncols=3)
        return figure


def check_channel(name: str) -> None:
    """Raise InputError unless `name` is one of `CHANNEL_UNITS`."""
    if name not in CHANNEL_UNITS:
        raise InputError(f"{name!r} is not a channel of flight records; known are {', '.join(CHANNEL_UNITS)}")


def shown_unit(name: str) -> tuple[str, float]:
    """The unit in which a channel, of a range too, is shown to readers, and how many of it its SI unit is."""
    unit = CHANNEL_UNITS.get(name, "rad")  # a range's own channels are yaw, pitch and roll
    return ("", 1.0) if unit == "1" else _SHOWN.get(unit, (unit, 1.0))


def _suffix(name: str) -> str:
    return CHANNEL_UNITS[name].replace("/", "_").replace("^", "").lower()


def _column(name: str, values: Any, shape: tuple[int, ...]) -> Array:
    try:
        column = np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} of a flight record is not numeric ({error})") from error
    if column.shape != shape:
        raise InputError(f"{name} of a flight record has shape {column.shape}, time has {shape}")
    infinite = np.flatnonzero(np.isinf(column))
    if infinite.size:
        raise InputError(f"{name} of a flight record is infinite in row {infinite[0] + 1}; a dropout is NaN")
    column.setflags(write=False)
    return column


def _all_known(name: str, values: Array) -> None:
    missing = np.flatnonzero(np.isnan(values))
    if missing.size:
        raise InputError(f"{name} of a flight record is missing in row {missing[0] + 1}: it must be known throughout")
