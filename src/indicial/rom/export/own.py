"""The package's own files: exact to the last digit, with a schema version."""

from __future__ import annotations

from pathlib import Path

from indicial.errors import InputError
from indicial.rom.state_space import StateSpaceModel


def export_json(model: StateSpaceModel, path: Path) -> tuple[Path, ...]:
    """A JSON file, see `StateSpaceModel.to_json`."""
    model.to_json(path)
    return (path,)


def export_netcdf(model: StateSpaceModel, path: Path) -> tuple[Path, ...]:
    """A netCDF-4 file, see `StateSpaceModel.to_netcdf`."""
    model.to_netcdf(path)
    return (path,)


def read_model(path: str | Path) -> StateSpaceModel:
    """A model from either kind of file, by its name's end.

    Raises
    ------
    InputError
        If the file is missing, holds something else or is called otherwise.
    """
    readers = {".json": StateSpaceModel.from_json, ".nc": StateSpaceModel.from_netcdf}
    suffix = Path(path).suffix
    if suffix not in readers:
        raise InputError(f"{path}: a model's file ends in {' or '.join(readers)}")
    return readers[suffix](path)
