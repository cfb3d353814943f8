"""The closing comparison: derivative by derivative, every method beside the measured value."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from indicial.derivatives import Derivative, DerivativeTable
from indicial.report.style import METHOD_COLOURS, METHOD_MARKERS, METHOD_NAMES, METHOD_SHORT, figure_style, symbol

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = ("mrf", "irm", "operator", "rom", "fom", "operator_at_k", "identified", "measured")
"""Methods at k = 0; the forced oscillation and, at the same k, the operator; flights."""

COMPUTED = ("mrf", "irm", "operator", "fom")

ROWS = (
    "CN_alpha",
    "Cm_alpha",
    "CN_q",
    "Cm_q",
    "CN_alphadot",
    "Cm_alphadot",
    "CN_q+CN_alphadot",
    "Cm_q+Cm_alphadot",
    "Cl_p",
    "CA_0",
)


@dataclass(frozen=True)
class ComparisonRow:
    """One derivative: a record for each method that has it.

    Parameters
    ----------
    name : str
    records : dict
        By column of `COLUMNS`.
    """

    name: str
    records: dict[str, Derivative]

    @property
    def measured(self) -> Derivative | None:
        """The free-flight value."""
        return self.records.get("measured")

    def deviation(self, column: str) -> float | None:
        """value/measured - 1 (negative: too small in size), or None where one is missing."""
        record, measured = self.records.get(column), self.measured
        if record is None or measured is None or measured.value == 0.0:
            return None
        return record.value / measured.value - 1.0


def comparison(table: DerivativeTable) -> list[ComparisonRow]:
    """The rows of the closing table; of several records of one method, the one to be compared.

    Of a forced oscillation that is the Fourier reduction; of two amplitudes, the smaller; of the operator, the values
    at k = 0 and those at the k of the forced oscillation.
    """
    rows = []
    oscillation = next((r.k for r in table.select(method="fom") if r.k is not None), None)
    at_k = DerivativeTable() if oscillation is None else operator_at(table, oscillation)
    tables = {"operator": table.select(method="operator", k=None), "operator_at_k": at_k}
    for name in ROWS:
        records = {
            column: record
            for column in COLUMNS
            if (record := _chosen(tables.get(column, table.select(method=column)), name)) is not None
        }
        if records:
            rows.append(ComparisonRow(name, records))
    return rows


def operator_at(table: DerivativeTable, k: float) -> DerivativeTable:
    """The operator's records at a reduced frequency."""
    found = table.select(method="operator")
    return DerivativeTable(tuple(r for r in found if r.k is not None and math.isclose(r.k, k, rel_tol=1e-9)))


def _chosen(table: DerivativeTable, name: str) -> Derivative | None:
    found = [r for r in table.select(name=name) if r.reduction in (None, "fourier")]
    return min(found, key=lambda r: r.amplitude_deg if r.amplitude_deg is not None else 0.0) if found else None


def comparison_text(rows: Sequence[ComparisonRow]) -> str:
    """The closing table as text: value, standard uncertainty, and deviation from the measured value."""
    heading = f"{'derivative':<18}" + "".join(f"{METHOD_SHORT[column]:>16}" for column in COLUMNS)
    lines = [heading, "-" * len(heading)]
    for row in rows:
        lines.append(f"{row.name:<18}" + "".join(f"{_cell(row.records.get(column)):>16}" for column in COLUMNS))
        deviations = [row.deviation(column) for column in COLUMNS[:-1]]
        if any(d is not None for d in deviations):
            shown = ["" if d is None else f"({d:+.0%})" for d in deviations]
            lines.append(f"{'  from measured':<18}" + "".join(f"{cell:>16}" for cell in shown))
    return "\n".join(lines)


def _cell(record: Derivative | None) -> str:
    if record is None:
        return "-"
    spread = "" if record.uncertainty is None else f" ±{record.uncertainty:.2g}"
    return f"{record.value:.4g}{spread}"


def statement(rows: Sequence[ComparisonRow], mesh: str) -> str:
    """How far the computed values are from the measured ones, in plain words made from the numbers.

    Parameters
    ----------
    rows : sequence of ComparisonRow
    mesh : str
        What mesh the values come from, for the sentence.
    """
    parts = []
    for row in rows:
        deviations = {m: d for m in COMPUTED if (d := row.deviation(m)) is not None}
        if not deviations:
            continue
        method, worst = max(deviations.items(), key=lambda item: abs(item[1]))
        measured = row.measured
        assert measured is not None
        sigma = ""
        if measured.uncertainty:
            sigma = f", {abs(row.records[method].value - measured.value) / measured.uncertainty:.1f} standard errors"
        k = row.records[method].k
        at = "" if k is None else f" at k = {k:g}"
        others = [f"{METHOD_SHORT[m]} {d:+.0%}" for m, d in deviations.items() if m != method]
        aside = f"; {', '.join(others)}" if others else ""
        parts.append(f"{row.name} {worst:+.0%} (by {METHOD_SHORT[method]}{at}{sigma}{aside})")
    if not parts:
        return f"On {mesh} no computed derivative has a measured value to be compared with."
    note = ""
    if any(row.name == "CA_0" for row in rows):
        note = (
            " The measured axial force holds base drag and skin friction, which the inviscid loads on nose, body and "
            "fins leave out."
        )
    return f"On {mesh} the computed values differ from free flight as follows: {'; '.join(parts)}.{note}"


def comparison_figure(rows: Sequence[ComparisonRow]) -> Figure:
    """Ratio of every value to the measured one (to the mean of the methods where none was measured)."""
    with figure_style() as plt:
        figure: Figure
        figure, axes = plt.subplots(figsize=(8.6, 0.62 * len(rows) + 1.6))
        shown: set[str] = set()
        for line, row in enumerate(rows):
            values = [record.value for record in row.records.values()]
            unit = row.measured.value if row.measured is not None else float(np.mean(values))
            for offset, column in enumerate(COLUMNS):
                record = row.records.get(column)
                if record is None:
                    continue
                label = METHOD_NAMES[column] if column not in shown else None
                shown.add(column)
                axes.errorbar(
                    record.value / unit,
                    line + 0.6 * (offset / (len(COLUMNS) - 1) - 0.5),
                    xerr=None if record.uncertainty is None else abs(record.uncertainty / unit),
                    fmt=METHOD_MARKERS[column],
                    color=METHOD_COLOURS[column],
                    ms=10 if column == "measured" else 6,
                    capsize=2,
                    label=label,
                )
        axes.axvline(1.0, color="0.4", lw=0.8)
        names = [symbol(row.name) + ("" if row.measured else " (not measured)") for row in rows]
        axes.set_yticks(range(len(rows)), names)
        axes.set_ylim(len(rows) - 0.4, -0.6)
        axes.set_xlabel("value / measured value (where not measured: / mean of the methods)")
        axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.0, 0.5))
        return figure
