r"""Published and exact numbers that travel with the package, and the case files beside them.

The tables and their sources are described in ``data/README.md``. Nothing is tuned to them: they are what results
are compared with.
"""

from __future__ import annotations

import csv
import io
import math
import tomllib
from dataclasses import dataclass
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Literal

import numpy as np

from indicial.conventions import Array
from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError

PROBABLE_ERROR = 0.6744897501960817
"""Probable error in standard deviations: half of a normal distribution lies within it."""

FINNER_DIAMETER = 0.030
"""Calibre of the range models [m]."""

FINNER_MOMENT_REFERENCE = 5.5
"""Centre of gravity of the range models, calibres from the nose."""

Reduction = Literal["multifit", "shots", "linear"]

_RANGE_COLUMNS = {
    "CN_alpha": "cna",
    "Cm_alpha": "cma",
    "Cm_q+Cm_alphadot": "cmq_sum",
    "Cl_p": "clp",
    "CA_0": "cx0",
}


def data_folder() -> Traversable:
    """Where cases and reference tables are: inside the installed package, or ``data/`` of a checkout.

    Raises
    ------
    InputError
        If neither is there (a broken installation).
    """
    packaged = resources.files("indicial") / "_data"
    if packaged.is_dir():
        return packaged
    checkout = Path(__file__).resolve().parents[2] / "data"
    if checkout.is_dir():
        return checkout
    raise InputError("the data folder of indicial is missing; install the package again")


def find_case(path: str | Path) -> Path:
    """A case file: `path` itself if it is on disk, else the packaged case of that name.

    ``data/cases/basic_finner_quick.toml``, ``basic_finner_quick.toml`` and ``basic_finner_quick`` all find the
    packaged one.

    Raises
    ------
    InputError
        If there is no such case; the message lists the packaged ones.
    """
    given = Path(path)
    if given.is_file():
        return given
    cases = data_folder() / "cases"
    name = given.name if given.suffix == ".toml" else f"{given.name}.toml"
    packaged = cases / name
    if given.parent in (Path(), Path("data/cases")) and packaged.is_file():
        return Path(str(packaged))
    known = ", ".join(sorted(item.name for item in cases.iterdir() if item.name.endswith(".toml")))
    raise InputError(f"{path}: no such case file; packaged cases: {known}")


_AIRCRAFT_KEYS = {"aircraft_class", "derivatives"}
_FLIGHT_TEST_KEYS = {"records", "longitudinal"}


def find_aircraft(path: str | Path) -> Path | None:
    """An aircraft file: `path` itself if it is one on disk, else the packaged one of that name; None for other things.

    ``data/aircraft/boeing_747.toml``, ``boeing_747.toml`` and ``boeing_747`` all find the packaged one.
    """
    return _find(path, "aircraft", _AIRCRAFT_KEYS)


def find_flight_test(path: str | Path) -> Path | None:
    """A flight test file, as `find_aircraft`; the packaged ones are in ``data/flight_tests``."""
    return _find(path, "flight_tests", _FLIGHT_TEST_KEYS)


def _find(path: str | Path, folder: str, keys: set[str]) -> Path | None:
    given = Path(path)
    if given.is_file():
        try:
            content = tomllib.loads(given.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return given if keys & set(content) else None
    name = given.name if given.suffix == ".toml" else f"{given.name}.toml"
    packaged = data_folder() / folder / name
    if not given.is_dir() and given.parent in (Path(), Path("data") / folder) and packaged.is_file():
        return Path(str(packaged))
    return None


@dataclass(frozen=True)
class Table:
    """A CSV table by column name.

    Parameters
    ----------
    name : str
    source : str
        The comment lines at its head.
    columns : dict
        Cells as text, one list a column.
    """

    name: str
    source: str
    columns: dict[str, list[str]]

    def text(self, column: str) -> list[str]:
        """The cells of one column.

        Raises
        ------
        InputError
            If there is no such column.
        """
        if column not in self.columns:
            raise InputError(f"{self.name}: no column {column!r}; there are {', '.join(self.columns)}")
        return self.columns[column]

    def numbers(self, column: str) -> Array:
        """One column as numbers, NaN where a cell is blank, shape (rows,).

        Raises
        ------
        InputError
            If a cell is neither blank nor a number.
        """
        cells = self.text(column)
        try:
            return np.array([float(cell) if cell.strip() else math.nan for cell in cells])
        except ValueError as error:
            raise InputError(f"{self.name}: column {column!r}: {error}") from error

    def summary(self) -> str:
        """One line."""
        rows = len(next(iter(self.columns.values()), []))
        return f"{self.name}: {rows} rows of {', '.join(self.columns)}"


def read_table(name: str) -> Table:
    """A reference table by file name without suffix, for example ``"cone_exact"``.

    Raises
    ------
    InputError
        If there is no such table, or a row is as long as no heading says.
    """
    folder = data_folder() / "reference"
    file = folder / f"{name}.csv"
    if not file.is_file():
        known = ", ".join(sorted(item.name[:-4] for item in folder.iterdir() if item.name.endswith(".csv")))
        raise InputError(f"no reference table {name!r}; there are {known}")
    lines = file.read_text(encoding="utf-8").splitlines()
    source = " ".join(line.lstrip("# ").strip() for line in lines if line.startswith("#"))
    rows = list(csv.reader(io.StringIO("\n".join(line for line in lines if line and not line.startswith("#")))))
    heading, body = rows[0], rows[1:]
    for number, row in enumerate(body, start=1):
        if len(row) != len(heading):
            raise InputError(f"{name}.csv: data row {number} has {len(row)} cells, the heading has {len(heading)}")
    return Table(name, source, {column: [row[i] for row in body] for i, column in enumerate(heading)})


def finner_range(reduction: Reduction = "multifit") -> DerivativeTable:
    """Free-flight derivatives of the Basic Finner, about 5.5 d, rates per d/2V (DREV-TM-9703, Tables VII to IX).

    Only the damping sum has a probable error in print; it is given as a standard deviation. ``CA_0`` holds the base.

    Parameters
    ----------
    reduction : {"multifit", "shots", "linear"}
        6-DOF fits to groups of shots (the benchmark), to single shots, or linear theory.
    """
    table = read_table(f"basic_finner_range_{reduction}")
    names = {
        **_RANGE_COLUMNS,
        **({"CA_0": "cd0", "Cm_q+Cm_alphadot": "cmq_plus_cmadot"} if reduction == "linear" else {}),
    }
    columns = {name: table.numbers(column) for name, column in names.items() if column in table.columns}
    percent = table.numbers("cmq_pe_pct") if "cmq_pe_pct" in table.columns else np.full(0, math.nan)
    shots = table.columns.get("shot")
    records = []
    for row, mach in enumerate(table.numbers("mach")):
        label = f"DREV-TM-9703 {reduction}" + (f" {shots[row]}" if shots else "")
        for name, values in columns.items():
            if math.isnan(values[row]):
                continue
            error = percent[row] / 100.0 * abs(values[row]) if name == "Cm_q+Cm_alphadot" and percent.size else math.nan
            sigma = None if math.isnan(error) else error / PROBABLE_ERROR
            records.append(_finner(name, "measured", float(values[row]), float(mach), label, sigma))
    return DerivativeTable(tuple(records))


def finner_range_machs() -> tuple[float, float]:
    """Lowest and highest Mach number of the multiple fits, between which `finner_range_at` answers."""
    machs = [record.mach for record in finner_range("multifit").records]
    return min(machs), max(machs)


def finner_range_at(mach: float) -> DerivativeTable:
    """The multiple-fit range data at one Mach number, linear between the two neighbouring groups.

    The uncertainty of an interpolated value is the root sum square of (i) the printed errors (where there are
    any), weighted as the values are, and (ii) how far a parabola through the three nearest groups lies from the
    chord: what is not known between the groups. At a group's own Mach number only (i) is left. Note that
    single shots scatter far more than the printed errors say (``finner_range("shots")``).

    Raises
    ------
    InputError
        Outside the Mach numbers flown.
    """
    measured = finner_range("multifit")
    records = []
    for name in measured.names():
        rows = sorted(measured.select(name=name), key=lambda r: r.mach)
        machs = np.array([r.mach for r in rows])
        values = np.array([r.value for r in rows])
        if not machs[0] <= mach <= machs[-1]:
            raise InputError(f"range data is from M {machs[0]:g} to {machs[-1]:g}, M {mach:g} is outside")
        right = min(max(int(np.searchsorted(machs, mach)), 1), machs.size - 1)
        pair = [right - 1, right]
        weight = (mach - machs[right - 1]) / (machs[right] - machs[right - 1])
        weights = np.array([1.0 - weight, weight])
        value = float(weights @ values[pair])
        others = [i for i in np.argsort(np.abs(machs - mach)) if i not in pair]
        three = [*pair, others[0]]
        between = 0.0 < weight < 1.0
        curve = np.polyval(np.polyfit(machs[three], values[three], 2), mach) if between else value
        printed = np.array([math.nan if rows[i].uncertainty is None else rows[i].uncertainty for i in pair])
        noise = float(np.sqrt(np.sum((weights * printed) ** 2)))
        parts = [abs(float(curve) - value)] + ([] if math.isnan(noise) else [noise])
        sigma = math.hypot(*parts)
        source = f"DREV-TM-9703 Table IX, between M {machs[right - 1]:g} and {machs[right]:g}"
        records.append(_finner(name, "measured", value, mach, source, sigma if sigma > 0.0 else None))
    return DerivativeTable(tuple(records))


def finner_arl() -> DerivativeTable:
    """ARL's RANS damping sums of the Basic Finner, forced pitching of 0.25 deg at k = 0.1 (ARL-TR-6725, Table A-1).

    The method is ``fom``: another CFD code's forced oscillation, not a measurement.
    """
    table = read_table("basic_finner_cfd_arl")
    machs = table.numbers("mach")
    return DerivativeTable(
        tuple(
            _finner(name, "fom", float(value), float(mach), "ARL-TR-6725", None, k=0.1, amplitude_deg=0.25)
            for name, column in (("Cm_q+Cm_alphadot", "pdm"), ("CN_q+CN_alphadot", "pdf"))
            for mach, value in zip(machs, table.numbers(column), strict=True)
        )
    )


def _finner(
    name: str,
    method: str,
    value: float,
    mach: float,
    source: str,
    uncertainty: float | None,
    k: float | None = None,
    amplitude_deg: float | None = None,
) -> Derivative:
    d = FINNER_DIAMETER
    return Derivative(
        name=name,
        method=method,
        value=value,
        mach=mach,
        alpha_deg=0.0,
        beta_deg=0.0,
        source=source,
        reference_length_m=d,
        reference_area_m2=math.pi * d * d / 4.0,
        moment_reference_m=(FINNER_MOMENT_REFERENCE * d, 0.0, 0.0),
        uncertainty=uncertainty,
        k=k,
        amplitude_deg=amplitude_deg,
    )
