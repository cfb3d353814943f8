"""Writing files so that nothing is ever half written, and states so that a killed run goes on where it was."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import tempfile
import time
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from indicial.errors import InputError

if TYPE_CHECKING:
    import xarray


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """A temporary path beside `path` that replaces it when the block ends well, and is removed if it does not."""
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.stem}-", suffix=target.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        mode = 0o666 & ~_umask()
        os.chmod(temporary, mode)
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def why(error: Exception) -> str:
    """What an error says, without the number and name that the system's errors repeat."""
    return (error.strerror if isinstance(error, OSError) else None) or str(error)


def write_text(path: str | Path, text: str) -> None:
    """Write `text` to `path` in one step."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def write_csv(path: str | Path, header: Mapping[str, Any], columns: Mapping[str, NDArray[np.float64]]) -> None:
    """Write a CSV file in one step: header in ``# key: value`` lines, a line of names, every digit of numbers kept."""
    out = io.StringIO()
    for key, value in header.items():
        out.write(f"# {key}: {value}\n")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(map(repr, row) for row in np.stack(list(columns.values()), axis=1).tolist())
    write_text(path, out.getvalue())


def read_csv(path: str | Path) -> tuple[dict[str, str], dict[str, NDArray[np.float64]]]:
    """Header and columns of a file of `write_csv`.

    Raises
    ------
    InputError
        If the file is missing, has no rows, or holds something that is not a number.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a readable CSV file ({why(error)})") from error
    header = dict(line[2:].split(": ", 1) for line in lines if line.startswith("# ") and ": " in line)
    rows = list(csv.reader(line for line in lines if line.strip() and not line.startswith("#")))
    if len(rows) < 2:
        raise InputError(f"{path}: has no rows under its line of names")
    values = np.empty((len(rows) - 1, len(rows[0])))
    for i, row in enumerate(rows[1:]):
        try:
            values[i] = [float(one) for one in row]
        except ValueError as error:
            raise InputError(f"{path}: row {i + 1} does not hold {len(rows[0])} numbers ({error})") from error
    return header, dict(zip(rows[0], values.T, strict=True))


def parse_json(path: str | Path) -> Any:
    """What a JSON file holds.

    Raises
    ------
    InputError
        If the file is missing or is not one.
    """
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not a readable JSON file ({why(error)})") from error


def read_json(path: str | Path, format_: str, version: int) -> dict[str, Any]:
    """Content of a JSON file of this format and version.

    Raises
    ------
    InputError
        If the file is missing or holds something else.
    """
    values = parse_json(path)
    known = isinstance(values, dict) and values.get("format") == format_
    if not known or values.get("schema_version") != version:
        raise InputError(f"{path}: not an {format_} of schema version {version}")
    content: dict[str, Any] = values
    return content


@contextmanager
def parts_of(path: str | Path) -> Iterator[None]:
    """Say of which file it is that a part is missing or bad."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except KeyError as error:
        raise InputError(f"{path}: damaged, a part is missing ({error.args[0]})") from error
    except (TypeError, ValueError) as error:
        raise InputError(f"{path}: damaged ({error})") from error


def write_netcdf(path: str | Path, data: xarray.Dataset) -> None:
    """Write a netCDF-4 file in one step."""
    with atomic_path(path) as temporary:
        data.to_netcdf(temporary, engine="h5netcdf")


def read_netcdf(path: str | Path, format_: str, version: int) -> xarray.Dataset:
    """The whole of one of the package's netCDF files, which says in its attributes what it is.

    Raises
    ------
    InputError
        If there is no such file, it is not netCDF, or it holds something else or another version of it.
    """
    import xarray as xr

    if not Path(path).is_file():
        raise InputError(f"{path}: no such file")
    try:
        with xr.open_dataset(path, engine="h5netcdf") as opened:
            data: xarray.Dataset = opened.load()
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not a netCDF file ({error})") from error
    check_format(path, data.attrs, format_, version)
    return data


def check_format(path: str | Path, attributes: Mapping[Any, Any], format_: str, version: int) -> None:
    """Raise InputError unless `attributes` name this format and version."""
    if attributes.get("format") != format_ or str(attributes.get("schema_version")) != str(version):
        raise InputError(f"{path}: not a file of {format_}, schema version {version}")


@cache
def sources_digest(package: str, without: str | None = None) -> str:
    """A name for the source code of a package, so that results of other code than today's are not taken for its own.

    A package inside it that the results do not depend on may be left out.
    """
    root = Path(str(resources.files(package)))
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        if path.relative_to(root).parts[0] == without:
            continue
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask


class Checkpoint:
    """Named arrays in one file that belongs to one computation.

    Parameters
    ----------
    path : Path
        The file; need not exist.
    key : str
        What the state belongs to. A file with another key is not read.
    interval : float
        Least time between two saves [s], so that saving never rules the run.
    """

    def __init__(self, path: Path, key: str, interval: float = 20.0) -> None:
        self.path = path
        self._key = key
        self._interval = interval
        self._saved = time.monotonic()

    def load(self) -> dict[str, NDArray[Any]] | None:
        """The arrays of the last save, or None."""
        try:
            with np.load(self.path, allow_pickle=False) as stored:
                if str(stored["key"]) != self._key:
                    return None
                return {name: stored[name] for name in stored.files if name != "key"}
        except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile):
            return None

    def save(self, **arrays: NDArray[Any]) -> None:
        """Save now."""
        with atomic_path(self.path) as temporary, open(temporary, "wb") as file:
            np.savez(file, allow_pickle=False, key=np.array(self._key), **arrays)
        self._saved = time.monotonic()

    def save_if_due(self, **arrays: NDArray[Any]) -> None:
        """Save if the interval has passed."""
        if time.monotonic() - self._saved >= self._interval:
            self.save(**arrays)

    def remove(self) -> None:
        """Delete the file: the computation is complete."""
        self.path.unlink(missing_ok=True)
