"""The formats that are read. A new one is a file beside this with `recognises` and `read`, and a line here."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from indicial.errors import InputError
from indicial.readers import fluent, openfoam, plain_csv, su2
from indicial.readers.table import Table, combine


@dataclass(frozen=True)
class Reader:
    """A format.

    Parameters
    ----------
    recognises : callable
        Whether a path is of this format, by its content.
    read : callable
        The tables of a path; several where the format spreads a run over files.
    """

    recognises: Callable[[Path], bool]
    read: Callable[[Path], tuple[Table, ...]]


FORMATS = {
    "fluent": Reader(fluent.recognises, fluent.read),
    "su2": Reader(su2.recognises, su2.read),
    "openfoam": Reader(openfoam.recognises, openfoam.read),
    "csv": Reader(plain_csv.recognises, plain_csv.read),
}
"""By name, in the order in which they are asked whether a file is theirs."""


def read_table(paths: str | Path | Sequence[str | Path], format_: str | None = None) -> Table:
    """One run from its files: several restarts, or several quantities of the same steps.

    Parameters
    ----------
    paths : path or sequence of paths
        Restarts in the order in which they ran; of OpenFOAM the folder ``postProcessing/NAME`` will do.
    format_ : str, optional
        Of `FORMATS`; told by the content if not given.

    Raises
    ------
    InputError
        If a file is missing, of unknown format, or holds no rows.
    """
    given = [Path(paths)] if isinstance(paths, (str, Path)) else [Path(path) for path in paths]
    if not given:
        raise InputError("no file to read")
    for path in given:
        if not path.exists():
            raise InputError(f"{path}: no such file")
    return combine([table for path in given for table in FORMATS[_format(path, format_)].read(path)])


def _format(path: Path, given: str | None) -> str:
    if given is not None:
        if given not in FORMATS:
            raise InputError(f"format is {given!r}, must be one of {', '.join(FORMATS)}")
        return given
    for name, reader in FORMATS.items():
        if reader.recognises(path):
            return name
    raise InputError(f"{path}: of no known format; name one of {', '.join(FORMATS)} or write a table with column names")
