"""Report files of Ansys Fluent, ``NAME-rfile.out``.

Three header lines, of which only the third is complete::

    "cm-rfile"
    "Time Step" "cm etc.."
    ("Time Step" "cm" "flow-time")
    1 -0.0123 0.0005

The place of ``flow-time`` changes. Steady solutions count ``Iteration`` and have none. A continued solution appends.
"""

from __future__ import annotations

import re
from pathlib import Path

from indicial.errors import InputError
from indicial.readers.table import Table, numeric_rows, read_text

_HEADER = re.compile(r'^\(\s*(?:"[^"]*"\s*)+\)\s*$')
_TIME, _STEP, _ITERATION = "flow-time", "Time Step", "Iteration"


def recognises(path: Path) -> bool:
    """Whether one of the first lines is a bracket of quoted names."""
    return path.is_file() and any(_HEADER.match(line.strip()) for line in read_text(path).splitlines()[:10])


def read(path: Path) -> tuple[Table, ...]:
    """The one table of a report file."""
    text = read_text(path)
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    headers = [line for line in lines if _HEADER.match(line)]
    if not headers:
        raise InputError(f'{path}: no header like ("Time Step" "cm" "flow-time"), this is no report file of Fluent')
    names = re.findall(r'"([^"]*)"', headers[0])
    if any(re.findall(r'"([^"]*)"', one) != names for one in headers[1:]):
        raise InputError(f"{path}: its columns change in the middle of the file; part it there")
    begun = lines[lines.index(headers[0]) + 1 :]
    rows = [line.split() for line in begun if not line.startswith(("(", '"'))]
    columns, notes = numeric_rows(rows, names, path, ends_whole=text.endswith("\n"))
    index = next((name for name in (_STEP, _ITERATION) if name in columns), None)
    time = _TIME if _TIME in columns else None
    return (Table(path.name, columns, index, time, steady=_STEP not in columns and time is None, notes=notes),)
