"""What a reader makes of a file: named columns, without what a restart has made obsolete."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array
from indicial.errors import InputError

Header = dict[str, float | tuple[float, float, float]]


@dataclass(frozen=True)
class Table:
    """Columns of a history, a row for each step, in the file's own names, units and axes.

    Parameters
    ----------
    source : str
        The file or files.
    columns : dict
        Name to values, each of shape (n,).
    index : str or None
        The column that counts steps and by which rows are told apart.
    time : str or None
        The column that holds physical time, where the format has one.
    steady : bool
        Whether rows are iterations of a steady solution.
    header : dict
        Reference quantities and directions that the file itself states.
    notes : tuple of str
        What was left out in reading.
    """

    source: str
    columns: dict[str, Array]
    index: str | None = None
    time: str | None = None
    steady: bool = False
    header: Header = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return 0 if not self.columns else len(next(iter(self.columns.values())))

    def __getitem__(self, name: str) -> Array:
        """One column by name."""
        if name not in self.columns:
            raise InputError(f"{self.source}: no column {name!r}; there are {', '.join(map(repr, self.columns))}")
        return self.columns[name]

    def rows(self, chosen: NDArray[np.bool_]) -> dict[str, Array]:
        """The columns at some rows."""
        return {name: values[chosen] for name, values in self.columns.items()}

    def key(self) -> Array | None:
        """What rows are ordered by: the count of steps, or time."""
        name = self.index if self.index is not None else self.time
        return None if name is None else self[name]


def read_text(path: Path) -> str:
    """The text of a file.

    Raises
    ------
    InputError
        If there is none, or it is not text.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file ({error.reason})") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error


def numeric_rows(
    lines: Sequence[Sequence[str]], names: Sequence[str], path: Path, *, ends_whole: bool = True
) -> tuple[dict[str, Array], tuple[str, ...]]:
    """Columns of the rows that have a number for each name, and what was left out.

    A row that a killed run has cut short is left out, and the last row too if `ends_whole` is false: its last number
    may have lost digits.

    Raises
    ------
    InputError
        If names repeat, or no row is left.
    """
    if len(set(names)) != len(names):
        raise InputError(f"{path}: a column name is there twice: {', '.join(names)}")
    good: list[list[float]] = []
    bad = 0
    for fields in lines if ends_whole else lines[:-1]:
        try:
            row = [float(one) for one in fields]
        except ValueError:
            row = []
        if len(row) == len(names):
            good.append(row)
        else:
            bad += 1
    if not good:
        raise InputError(f"{path}: no row with {len(names)} numbers ({', '.join(names)})")
    notes = [f"{path.name}: {bad} row(s) cut short or not numeric, left out"] if bad else []
    notes += [] if ends_whole else [f"{path.name}: does not end with a line break, the last row is left out"]
    values = np.array(good)
    return {name: values[:, j] for j, name in enumerate(names)}, tuple(notes)


def latest(table: Table) -> Table:
    """The table without rows that a later row makes obsolete: those at the same step or beyond it.

    A run that is continued from an earlier state writes its steps again, after those that are given up; of the inner
    iterations of a step the last counts.
    """
    key = table.key()
    if key is None or key.size < 2:
        return table
    first_later = np.minimum.accumulate(key[::-1])[::-1]
    kept = np.append(key[:-1] < first_later[1:], True)
    if np.all(kept):
        return table
    note = f"{np.count_nonzero(~kept)} row(s) repeated by later ones (a restart, or inner iterations): the last counts"
    return replace(table, columns=table.rows(kept), notes=(*table.notes, note))


def combine(tables: Sequence[Table]) -> Table:
    """One run from its files: with the same columns they follow one another, with others they are joined by step.

    Raises
    ------
    InputError
        If files with different columns have no count of steps, or no time, in common.
    """
    groups: dict[frozenset[str], list[Table]] = {}
    for table in tables:
        groups.setdefault(frozenset(table.columns), []).append(table)
    return reduce(_joined, [latest(_following(group)) for group in groups.values()])


def _following(tables: Sequence[Table]) -> Table:
    first = tables[0]
    columns = {name: np.concatenate([table[name] for table in tables]) for name in first.columns}
    notes = tuple(note for table in tables for note in table.notes)
    for table in tables[1:]:
        if table.header != first.header:
            raise InputError(f"{table.source}: its header states other reference quantities than {first.source}")
    return replace(first, source=_names(tables), columns=columns, notes=notes)


def _joined(left: Table, right: Table) -> Table:
    shared = [name for name in (left.index, left.time) if name is not None and name in right.columns]
    if not shared:
        raise InputError(f"{right.source}: has no count of steps in common with {left.source}, they cannot be joined")
    _, i, j = np.intersect1d(left[shared[0]], right[shared[0]], return_indices=True)
    if i.size == 0:
        raise InputError(f"{right.source}: has no step in common with {left.source}")
    lost = len(left) + len(right) - 2 * i.size
    columns = {name: values[j] for name, values in right.columns.items()}
    columns.update({name: values[i] for name, values in left.columns.items()})
    notes = [f"{lost} row(s) of steps that only one of the files has, left out"] if lost else []
    return replace(
        left,
        source=_names([left, right]),
        columns=columns,
        time=left.time if left.time is not None else right.time,
        header={**right.header, **left.header},
        notes=(*left.notes, *right.notes, *notes),
    )


def _names(tables: Sequence[Table]) -> str:
    return ", ".join(table.source for table in tables)
