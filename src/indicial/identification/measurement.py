r"""What an aeroballistic range measures of a flight: positions and angles at stations, with stated precision.

Each station takes two shadowgraphs at right angles by a spark; reading them gives where the centre of gravity was and
how the missile's axis (and a marked fin) stood at the instant of the spark.
"""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.files import read_netcdf, write_csv, write_netcdf
from indicial.flightsim import Trajectory

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

SCHEMA_VERSION = 1
FORMAT = "indicial range record"
MINIMUM_STATIONS = 12

POSITIONS = ("x", "y", "z")
ANGLES = ("yaw", "pitch")
_UNITS = {"time": "s", "x": "m", "y": "m", "z": "m", "yaw": "rad", "pitch": "rad", "roll": "rad"}


@dataclass(frozen=True)
class Precision:
    """Standard deviations of what a range measures.

    The defaults, 1 mm and 0.1 deg, are an assumption of the size usual for spark ranges, and not the figures of one.
    Time is taken as exact: the error of the spark's time (0.7 mm for 1 microsecond at 700 m/s) is part of that of x.

    Parameters
    ----------
    position : float
        Of x, y and z [m].
    angle : float
        Of yaw and pitch [rad].
    roll : float
        Of roll [rad].
    """

    position: float = 1.0e-3
    angle: float = math.radians(0.1)
    roll: float = math.radians(1.0)

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"precision of {name} is {value}, must be positive and finite")

    def of(self, channels: tuple[str, ...]) -> Array:
        """Standard deviation of each channel, shape (n,)."""
        kinds = dict.fromkeys(POSITIONS, self.position) | dict.fromkeys(ANGLES, self.angle) | {"roll": self.roll}
        return np.array([kinds[name] for name in channels])


@dataclass(frozen=True)
class RangeRecord:
    """Measurements of one flight at the stations of a range.

    Parameters
    ----------
    time : array_like
        Of each station's spark, strictly increasing [s], shape (n,).
    x, y, z : array_like
        Measured position of the centre of gravity, earth axes x downrange, y right, z down [m], shape (n,).
    yaw, pitch : array_like
        Measured Euler angles psi, theta (z-y-x) of the body axes in earth axes [rad], shape (n,).
    roll : array_like, optional
        Measured Euler angle phi [rad], any whole turns left out, shape (n,).
    precision : Precision
    provenance : dict
        Where it comes from: a seed, a shot (plain values).

    Raises
    ------
    InputError
        If there are fewer than 12 stations, a value is missing, time or x does not increase.
    """

    time: Array
    x: Array
    y: Array
    z: Array
    yaw: Array
    pitch: Array
    roll: Array | None = None
    precision: Precision = Precision()
    provenance: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = np.size(self.time)
        if n < MINIMUM_STATIONS:
            raise InputError(f"range record has {n} stations, at least {MINIMUM_STATIONS} are needed")
        for name in ("time", *self.channels):
            values = np.array(getattr(self, name), dtype=float)
            if values.shape != (n,):
                raise InputError(f"column {name} of the range record has shape {values.shape}, time has ({n},)")
            missing = np.flatnonzero(~np.isfinite(values))
            if missing.size:
                raise InputError(
                    f"column {name}, station {missing[0] + 1} of the range record is {values[missing[0]]}: leave out a "
                    "station that measured nothing"
                )
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        for name in ("time", "x"):
            back = np.flatnonzero(np.diff(getattr(self, name)) <= 0.0)
            if back.size:
                raise InputError(
                    f"column {name} of the range record does not increase from station {back[0] + 1} to {back[0] + 2}"
                )

    def __len__(self) -> int:
        return int(self.time.size)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of what was measured: x, y, z, yaw, pitch, and roll if it was."""
        return (*POSITIONS, *ANGLES, *(() if self.roll is None else ("roll",)))

    @property
    def values(self) -> Array:
        """All measurements, in the order of `channels`, shape (n, n_channels)."""
        return np.stack([getattr(self, name) for name in self.channels], axis=1)

    @property
    def standard_deviations(self) -> Array:
        """Stated standard deviation of each channel [m] or [rad], shape (n_channels,)."""
        return self.precision.of(self.channels)

    def to_dataset(self) -> xarray.Dataset:
        """The record as an `xarray.Dataset` with units."""
        import xarray as xr

        data = {name: ("station", getattr(self, name), {"units": _UNITS[name]}) for name in ("time", *self.channels)}
        return xr.Dataset(data, {"station": np.arange(1, len(self) + 1)}, self._header())

    def to_netcdf(self, path: str | Path) -> None:
        """Write a netCDF-4 file in one step."""
        write_netcdf(path, self.to_dataset())

    @classmethod
    def from_netcdf(cls, path: str | Path) -> Self:
        """Read a file of `to_netcdf`.

        Raises
        ------
        InputError
            If the file is missing or not a range record.
        """
        data = read_netcdf(path, FORMAT, SCHEMA_VERSION)
        columns = {str(name): data[name].values for name in data.data_vars}
        return cls._from_columns(columns, _checked_header(dict(data.attrs), path, None), path)

    def to_csv(self, path: str | Path) -> None:
        """Write a CSV file: header in `#` lines, units in column names, every digit kept."""
        columns = {f"{name}_{_UNITS[name]}": getattr(self, name) for name in ("time", *self.channels)}
        write_csv(path, self._header(), columns)

    @classmethod
    def from_csv(cls, path: str | Path, precision: Precision | None = None) -> Self:
        """Read a file of `to_csv`, or any CSV file with its columns.

        Columns are found by name: ``time_s``, ``x_m``, ``y_m``, ``z_m``, and ``yaw``, ``pitch`` and, if measured,
        ``roll``, each with ``_rad`` or ``_deg``. Others are passed over.

        Parameters
        ----------
        path : str or Path
        precision : Precision, optional
            Replaces the file's own; needed if the file has none.

        Raises
        ------
        InputError
            If the file is missing, lacks a column or the precision, or holds something that is not a number.
        """
        try:
            lines = Path(path).read_text(encoding="utf-8").splitlines()
        except OSError as error:
            raise InputError(f"{path}: not a readable range record ({error.strerror})") from error
        attrs = dict(line[2:].split(": ", 1) for line in lines if line.startswith("# ") and ": " in line)
        header = _checked_header(attrs, path, precision)
        rows = list(csv.DictReader(line for line in lines if line.strip() and not line.startswith("#")))
        columns: dict[str, Array] = {}
        for name, unit in _UNITS.items():
            labels = [f"{name}_{unit}", *([f"{name}_deg"] if unit == "rad" else [])]
            for label in labels:
                if rows and label in rows[0]:
                    values = _numbers(rows, label, path)
                    columns[name] = np.radians(values) if label.endswith("_deg") else values
                    break
        return cls._from_columns(columns, header, path)

    @classmethod
    def _from_columns(cls, columns: Mapping[str, Array], header: dict[str, Any], path: str | Path) -> Self:
        lacking = [name for name in ("time", *POSITIONS, *ANGLES) if name not in columns]
        if lacking:
            raise InputError(f"{path}: range record lacks column {', '.join(lacking)}")
        measured: dict[str, Any] = {name: columns[name] for name in _UNITS if name in columns}
        try:
            return cls(**measured, **header)
        except InputError as error:
            raise InputError(f"{path}: {error}") from error

    def _header(self) -> dict[str, Any]:
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "precision": json.dumps(asdict(self.precision)),
            "provenance": json.dumps(self.provenance),
        }

    def summary(self) -> str:
        """How many stations over what distance, and how well measured."""
        p = self.precision
        measured = "position, yaw, pitch" + ("" if self.roll is None else ", roll")
        roll = "" if self.roll is None else f", roll {math.degrees(p.roll):g} deg"
        largest = math.degrees(float(np.max(np.hypot(self.yaw, self.pitch))))
        return (
            f"range record: {len(self)} stations from x = {self.x[0]:.4g} to {self.x[-1]:.4g} m in "
            f"{self.time[-1] - self.time[0]:.4g} s; {measured}\n"
            f"  standard deviations: position {1e3 * p.position:g} mm, angles {math.degrees(p.angle):g} deg{roll}; "
            f"largest angle to the range's axis {largest:.3g} deg"
        )

    def plot(self) -> Figure:
        """Angles and swerve against distance, with bars of one standard deviation."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(2, 1, figsize=(9, 6), sharex=True, layout="constrained")
        for name in ANGLES:
            spread = math.degrees(self.precision.angle)
            axes[0].errorbar(self.x, np.degrees(getattr(self, name)), spread, fmt=".", label=name)
        for name in ("y", "z"):
            axes[1].errorbar(self.x, 1e3 * getattr(self, name), 1e3 * self.precision.position, fmt=".", label=name)
        axes[0].set(ylabel="angle [deg]")
        axes[1].set(xlabel="x [m]", ylabel="position [mm]")
        for ax in axes:
            ax.legend()
        return figure


def measure(
    trajectory: Trajectory,
    stations: int | ArrayLike = 54,
    *,
    seed: int | None,
    precision: Precision | None = None,
    roll: bool = False,
) -> RangeRecord:
    """What a range measures of a simulated flight.

    Parameters
    ----------
    trajectory : Trajectory
        Goes downrange all the time.
    stations : int or array_like
        Where they stand, x [m], increasing; or how many, evenly spaced over the flight. 54 on 230 m is the size of the
        DREV range (Dupuis & Drouin, AIAA 88-2017, 1988).
    seed : int or None
        Of the white noise; None measures without error (the record then still states its precision).
    precision : Precision, optional
        The default one if not given.
    roll : bool
        Whether roll is measured.

    Raises
    ------
    InputError
        If the stations are too few, not increasing or off the flight.
    """
    along = trajectory.position[:, 0]
    places = np.linspace(along[0], along[-1], stations) if isinstance(stations, int) else np.asarray(stations, float)
    if places.ndim != 1 or places.size < MINIMUM_STATIONS or np.any(np.diff(places) <= 0.0):
        raise InputError(f"stations must be at least {MINIMUM_STATIONS}, one after another downrange")
    precision = Precision() if precision is None else precision
    seen = trajectory.at_stations(places)
    yaw, pitch, turn = seen.euler.T
    exact = dict(zip((*POSITIONS, *ANGLES), (*seen.position.T, yaw, pitch), strict=True)) | (
        {"roll": turn} if roll else {}
    )
    channels = tuple(exact)
    noise = np.zeros((len(channels), len(seen)))
    if seed is not None:
        noise = precision.of(channels)[:, None] * np.random.default_rng(seed).standard_normal(noise.shape)
    measured: dict[str, Any] = {name: exact[name] + noise[i] for i, name in enumerate(channels)}
    provenance = {"simulated": True, "seed": seed, "flight": trajectory.provenance.get("vehicle", "")}
    return RangeRecord(time=seen.time, **measured, precision=precision, provenance=provenance)


def _numbers(rows: list[dict[str, str]], label: str, path: str | Path) -> Array:
    values = np.empty(len(rows))
    for i, row in enumerate(rows):
        try:
            values[i] = float(row[label])
        except (TypeError, ValueError) as error:
            raise InputError(f"{path}: column {label}, station {i + 1} is {row[label]!r}, must be a number") from error
    return values


def _checked_header(attrs: dict[str, Any], path: str | Path, precision: Precision | None) -> dict[str, Any]:
    """Precision and provenance of a file; a file with no header is a user's own, and needs a precision."""
    if "format" in attrs or precision is None:
        if attrs.get("format") != FORMAT or int(attrs.get("schema_version", 0)) != SCHEMA_VERSION:
            raise InputError(
                f"{path}: not an {FORMAT} of schema version {SCHEMA_VERSION}; "
                "a plain CSV file can be read by stating its precision"
            )
        own = Precision(**json.loads(attrs["precision"]))
        return {"precision": precision or own, "provenance": json.loads(attrs["provenance"])}
    return {"precision": precision, "provenance": {"file": Path(path).name}}
