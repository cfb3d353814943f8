"""Force coefficients of OpenFOAM: ``forceCoeffs.dat`` (openfoam.org, and older ones) and ``coefficient.dat`` (.com).

Lines with ``#`` state directions and reference quantities, the last of them names the columns, which differ with
version and choice. Every start of the solver leaves a folder of its own, ``postProcessing/NAME/TIME``; they overlap.
"""

from __future__ import annotations

import re
from pathlib import Path

from indicial.errors import InputError
from indicial.readers.table import Header, Table, numeric_rows, read_text

_FILES = re.compile(r"^(?:coefficient|forceCoeffs)(?:_([0-9.eE+-]+))?\.dat$")
_STATED = re.compile(r"^#\s*(\w+)\s*:\s*(.*)$")


def recognises(path: Path) -> bool:
    """Whether this is a folder with such files in folders of times, or a file that names its columns after a #."""
    if path.is_dir():
        return bool(_parts(path))
    return path.is_file() and any(re.match(r"#\s*Time\s", line) for line in read_text(path).splitlines()[:40])


def read(path: Path) -> tuple[Table, ...]:
    """The table of a file; of a folder, those of all starts of the solver, in their order."""
    files = _parts(path) if path.is_dir() else [path]
    if not files:
        raise InputError(f"{path}: holds no folder of a time with coefficient.dat or forceCoeffs.dat in it")
    return tuple(_read(file) for file in files)


def _parts(folder: Path) -> list[Path]:
    """Files of all starts, in the order of their folders' times and of the times in their names."""
    found = []
    for file in [*folder.glob("*.dat"), *folder.glob("*/*.dat")]:
        named = _FILES.match(file.name)
        start = _number(file.parent.name) if file.parent != folder else 0.0
        if named and start is not None:
            found.append((start, _number(named[1] or "0") or 0.0, file))
    return [file for _, _, file in sorted(found)]


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def _read(path: Path) -> Table:
    text = read_text(path)
    comments = [line for line in text.splitlines() if line.startswith("#")]
    names = next((line[1:].split() for line in reversed(comments) if line[1:].split()[:1] == ["Time"]), None)
    if names is None:
        raise InputError(f"{path}: no line '# Time ...' that names the columns")
    header: Header = {}
    for line in comments:
        if (stated := _STATED.match(line)) and (value := _value(stated[2])) is not None:
            header[stated[1]] = value
    rows = [line.split() for line in text.splitlines() if line.strip() and not line.startswith("#")]
    columns, notes = numeric_rows(rows, names, path, ends_whole=text.endswith("\n"))
    return Table(f"{path.parent.name}/{path.name}", columns, None, "Time", header=header, notes=notes)


def _value(text: str) -> float | tuple[float, float, float] | None:
    """A number, or a vector in brackets."""
    numbers = [_number(one) for one in text.strip().strip("()").split()]
    if len(numbers) == 1:
        return numbers[0]
    if len(numbers) == 3 and all(one is not None for one in numbers):
        x, y, z = (one or 0.0 for one in numbers)
        return x, y, z
    return None
