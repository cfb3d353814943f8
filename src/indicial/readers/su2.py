"""History files of SU2, ``history.csv``: quoted and padded names, a row for each inner iteration unless switched off.

``"Time(sec)"`` is the time that the computer took. Physical time is ``Cur_Time``, where it was asked for, or
``Time_Iter`` times the time step.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from indicial.errors import InputError
from indicial.readers.table import Table, numeric_rows, read_text

_STEP, _TIME = "Time_Iter", "Cur_Time"
_COUNTERS = (_STEP, "Inner_Iter", "Outer_Iter")


def recognises(path: Path) -> bool:
    """Whether the first line names one of SU2's counters."""
    if not path.is_file():
        return False
    head = read_text(path).partition("\n")[0]
    return any(f'"{name}"' in head for name in _COUNTERS)


def read(path: Path) -> tuple[Table, ...]:
    """The one table of a history file."""
    text = read_text(path)
    head, _, body = text.partition("\n")
    names = [name.strip().strip('"').strip() for name in head.split(",")]
    if not set(_COUNTERS) & set(names):
        raise InputError(f"{path}: no column Time_Iter or Inner_Iter, this is no history file of SU2")
    # a restart that appends repeats the header
    rows = [line.split(",") for line in body.splitlines() if line.strip() and not line.lstrip().startswith('"')]
    columns, notes = numeric_rows(rows, names, path, ends_whole=text.endswith("\n"))
    # a steady solution has one step, or does not count them
    steady = _STEP not in columns or bool(np.all(columns[_STEP] == columns[_STEP][0]))
    index = next(name for name in (_STEP, "Outer_Iter", "Inner_Iter") if name in columns) if not steady else None
    return (Table(path.name, columns, index, _TIME if _TIME in columns else None, steady=steady, notes=notes),)
