"""Models for other programs: one file for each format, and the table of them.

Every simulator's model takes the motion as the simulator has it: alpha and beta in rad, p, q, r in rad/s, the speed;
reduced time and dimensionless rates are made inside, with the speed of the moment.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from indicial.errors import InputError
from indicial.rom.export.c_source import export_c
from indicial.rom.export.fmu import export_fmu
from indicial.rom.export.jsbsim import export_jsbsim
from indicial.rom.export.matlab import export_matlab
from indicial.rom.export.own import export_json, export_netcdf, read_model
from indicial.rom.state_space import StateSpaceModel

FORMATS: dict[str, Callable[[StateSpaceModel, Path], tuple[Path, ...]]] = {
    "json": export_json,
    "netcdf": export_netcdf,
    "mat": export_matlab,
    "c": export_c,
    "fmu": export_fmu,
    "jsbsim": export_jsbsim,
}
"""Format, and what writes it and returns the files written."""

SUFFIXES = {"json": ".json", "netcdf": ".nc", "mat": ".mat", "c": ".c", "fmu": ".fmu", "jsbsim": ".xml"}
"""Format, and how its file must be called."""


def export(model: StateSpaceModel, to: str, path: str | Path) -> tuple[Path, ...]:
    """Write `model` in a format of `FORMATS`.

    Returns
    -------
    tuple of Path
        The files written, `path` first.

    Raises
    ------
    InputError
        If the format is not known, the file is not called as it must be, or the model cannot be written so.
    """
    if to not in FORMATS:
        raise InputError(f"no export format {to!r}; there are {', '.join(FORMATS)}")
    if Path(path).suffix != SUFFIXES[to]:
        raise InputError(f"{path}: a file for {to} must end in {SUFFIXES[to]}")
    return FORMATS[to](model, Path(path))


__all__ = [
    "FORMATS",
    "SUFFIXES",
    "export",
    "export_c",
    "export_fmu",
    "export_jsbsim",
    "export_json",
    "export_matlab",
    "export_netcdf",
    "read_model",
]
