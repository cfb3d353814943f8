"""Any table with a line of names: separated by commas, semicolons (then with decimal commas too), tabs or blanks."""

from __future__ import annotations

import csv
import re
from pathlib import Path

from indicial.errors import InputError
from indicial.readers.table import Table, numeric_rows, read_text


def recognises(path: Path) -> bool:
    """Whether its name ends as that of a table."""
    return path.is_file() and path.suffix in (".csv", ".txt", ".dat", ".tsv")


def read(path: Path) -> tuple[Table, ...]:
    """The one table of a file; comments begin with #, and one of them may name the columns."""
    names, rows = split_table(path)
    columns, notes = numeric_rows(rows, names, path)
    return (Table(path.name, columns, notes=notes),)


def split_table(path: Path) -> tuple[list[str], list[list[str]]]:
    """Names of the columns and fields of the rows, as text, decimal commas made points."""
    lines = [line for line in read_text(path).splitlines() if line.strip()]
    first = next((i for i, line in enumerate(lines) if _is_numeric(line)), None)
    if first is None or first == 0:
        raise InputError(f"{path}: a table needs a line of column names and rows of numbers under it")
    delimiter = _delimiter(lines[first])
    names = [name.strip().strip('"').strip() for name in _split(lines[first - 1].lstrip("# \t"), delimiter)]
    rows = [_split(line, delimiter) for line in lines[first:] if not line.startswith("#")]
    if delimiter == ";":
        rows = [[one.replace(",", ".") for one in row] for row in rows]
    return names, rows


def _is_numeric(line: str) -> bool:
    return (
        not line.startswith("#") and re.match(r"^[\s\"]*[+-]?[0-9.]+(?:[,;.eE+\-\s0-9\"]|nan|inf)*$", line) is not None
    )


def _delimiter(line: str) -> str | None:
    """What parts the fields of a row of numbers; None for blanks."""
    return next((one for one in (";", "\t", ",") if one in line), None)


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return next(csv.reader([" ".join(line.split())], delimiter=" ", skipinitialspace=True))
    return [one.strip() for one in next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))]
