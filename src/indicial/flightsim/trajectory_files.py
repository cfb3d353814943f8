"""Files of trajectories: CSV, netCDF or Parquet by the suffix of the file's name, every digit kept."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities
from indicial.errors import InputError
from indicial.files import atomic_path, check_format, parts_of, read_netcdf, write_netcdf, write_text

if TYPE_CHECKING:
    import xarray

    from indicial.flightsim.trajectory import Trajectory

SCHEMA_VERSION = 2
FORMAT = "indicial trajectory"
SUFFIXES = (".csv", ".nc", ".parquet")

# of the vectors of a trajectory: the label of each component, in tables, with its unit
COLUMNS = {
    "position": ("x_m", "y_m", "z_m"),
    "velocity": ("u_m_s", "v_m_s", "w_m_s"),
    "quaternion": ("q0", "q1", "q2", "q3"),
    "rate": ("p_rad_s", "q_rad_s", "r_rad_s"),
    "force": ("force_x_n", "force_y_n", "force_z_n"),
    "moment": ("moment_x_n_m", "moment_y_n_m", "moment_z_n_m"),
    "wind": ("wind_u_m_s", "wind_v_m_s", "wind_w_m_s"),
}
_UNITS = {"position": "m", "velocity": "m/s", "quaternion": "1", "rate": "rad/s"} | {
    "force": "N",
    "moment": "N m",
    "wind": "m/s",
}
_AXES = {"position": "earth", "quaternion": "body to earth"}
_ANGLES_DEG = {"alpha_deg": "alpha", "beta_deg": "beta", "total_angle_deg": "total_angle"}


def save(trajectory: Trajectory, path: str | Path) -> None:
    """Write a trajectory in one step, in the format that the suffix names.

    Raises
    ------
    InputError
        If the suffix is none of `SUFFIXES`, or pyarrow is missing for Parquet.
    """
    suffix = _suffix(path)
    if suffix == ".nc":
        write_netcdf(path, dataset(trajectory))
    elif suffix == ".csv":
        _write_csv(path, _header(trajectory), _table(trajectory))
    else:
        _write_parquet(path, _header(trajectory), _table(trajectory))


def load(path: str | Path) -> dict[str, Any]:
    """The fields of the trajectory in a file of `save`; columns of tables are found by name.

    Raises
    ------
    InputError
        If the file is missing, not an indicial trajectory, or lacks a column.
    """
    suffix = _suffix(path)
    if suffix == ".nc":
        data = read_netcdf(path, FORMAT, SCHEMA_VERSION)
        with parts_of(path):
            names = ("time", *COLUMNS, "density", "speed_of_sound", "lag", "outside_range")
            return {name: data[name].values for name in names} | _of_header(data.attrs)
    attrs, column = (_read_csv if suffix == ".csv" else _read_parquet)(path)
    check_format(path, attrs, FORMAT, SCHEMA_VERSION)
    with parts_of(path):
        header = _of_header(attrs)
        values: dict[str, Any] = {
            name: np.stack([column[label] for label in labels], axis=1) for name, labels in COLUMNS.items()
        }
        names = header["lag_names"]
        return (
            values
            | header
            | {
                "time": column["time_s"],
                "density": column["density_kg_m3"],
                "speed_of_sound": column["speed_of_sound_m_s"],
                "lag": np.reshape([column[name] for name in names], (len(names), len(column["time_s"]))).T,
                "outside_range": column["outside_range"],
            }
        )


def dataset(trajectory: Trajectory) -> xarray.Dataset:
    """A trajectory as an `xarray.Dataset` with units."""
    import xarray as xr

    data: dict[str, Any] = {}
    for name in COLUMNS:
        second = "component" if name == "quaternion" else "axis"
        attrs = {"units": _UNITS[name], "axes": _AXES.get(name, "body")}
        data[name] = (("time", second), getattr(trajectory, name), attrs)
    data["lag"] = (("time", "lag_state"), trajectory.lag, {"units": "1"})
    data["density"] = ("time", trajectory.density, {"units": "kg/m^3"})
    data["speed_of_sound"] = ("time", trajectory.speed_of_sound, {"units": "m/s"})
    data["mach"] = ("time", trajectory.mach, {"units": "1"})
    for name in _ANGLES_DEG.values():
        data[name] = ("time", getattr(trajectory, name), {"units": "rad"})
    about = {"units": "1", "axes": "body", "moments": "about the centre of gravity"}
    data["coefficients"] = (("time", "coefficient"), trajectory.coefficients, about)
    data["outside_range"] = ("time", trajectory.outside_range.astype(np.int8), {"units": "1"})
    coords: dict[str, Any] = {
        "time": ("time", trajectory.time, {"units": "s"}),
        "axis": ["x", "y", "z"],
        "component": ["q0", "q1", "q2", "q3"],
        "coefficient": list(COEFFICIENTS),
    }
    return xr.Dataset(data, coords, _header(trajectory))


def _suffix(path: str | Path) -> str:
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise InputError(f"{path}: a trajectory file ends in {', '.join(SUFFIXES)}")
    return suffix


def _header(trajectory: Trajectory) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "schema_version": SCHEMA_VERSION,
        "reference": json.dumps(trajectory.reference.to_dict()),
        "lag_names": json.dumps(list(trajectory.lag_names)),
        "provenance": json.dumps(trajectory.provenance),
    }


def _of_header(attrs: Mapping[Any, Any]) -> dict[str, Any]:
    return {
        "reference": ReferenceQuantities.from_dict(json.loads(attrs["reference"])),
        "lag_names": tuple(json.loads(attrs["lag_names"])),
        "provenance": json.loads(attrs["provenance"]),
    }


def _table(trajectory: Trajectory) -> dict[str, Array]:
    """Columns with units in their names; Mach number and angles in degrees for the reader, `load` needs them not."""
    columns = {"time_s": trajectory.time}
    for name, labels in COLUMNS.items():
        columns |= dict(zip(labels, getattr(trajectory, name).T, strict=True))
    columns |= {"density_kg_m3": trajectory.density, "speed_of_sound_m_s": trajectory.speed_of_sound}
    columns |= dict(zip(trajectory.lag_names, trajectory.lag.T, strict=True))
    columns |= {"mach": trajectory.mach}
    columns |= {label: np.degrees(getattr(trajectory, name)) for label, name in _ANGLES_DEG.items()}
    return columns | {"outside_range": trajectory.outside_range.astype(np.int8)}


def _write_csv(path: str | Path, header: Mapping[str, Any], columns: Mapping[str, Array]) -> None:
    out = io.StringIO()
    for key, value in header.items():
        out.write(f"# {key}: {value}\n")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*(map(repr, column.tolist()) for column in columns.values()), strict=True))
    write_text(path, out.getvalue())


def _read_csv(path: str | Path) -> tuple[dict[str, Any], dict[str, Array]]:
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise InputError(f"{path}: not a readable trajectory file ({error.strerror})") from error
    attrs: dict[str, Any] = dict(line[2:].split(": ", 1) for line in lines if line.startswith("# ") and ": " in line)
    check_format(path, attrs, FORMAT, SCHEMA_VERSION)
    rows = list(csv.reader(line for line in lines if not line.startswith("#")))
    try:
        table = np.array(rows[1:], dtype=float)
        return attrs, {name: table[:, i] for i, name in enumerate(rows[0])}
    except (IndexError, ValueError) as error:
        raise InputError(f"{path}: not a complete trajectory ({error})") from error


def _write_parquet(path: str | Path, header: Mapping[str, Any], columns: Mapping[str, Array]) -> None:
    pyarrow = _pyarrow()
    table = pyarrow.table(dict(columns)).replace_schema_metadata({key: str(value) for key, value in header.items()})
    with atomic_path(path) as temporary:
        pyarrow.parquet.write_table(table, temporary)


def _read_parquet(path: str | Path) -> tuple[dict[str, Any], dict[str, Array]]:
    pyarrow = _pyarrow()
    try:
        table = pyarrow.parquet.read_table(path)
    except (OSError, pyarrow.ArrowException) as error:
        raise InputError(f"{path}: not a readable Parquet file ({error})") from error
    attrs = {key.decode(): value.decode() for key, value in (table.schema.metadata or {}).items()}
    return attrs, {name: table[name].to_numpy() for name in table.column_names}


def _pyarrow() -> Any:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise InputError("Parquet files need pyarrow: pip install 'indicial[parquet]'") from error
    return pyarrow
