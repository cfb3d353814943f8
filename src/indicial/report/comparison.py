"""The closing comparison: derivative by derivative, every method beside the measured value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from indicial.derivatives import Derivative, DerivativeTable
from indicial.report.style import METHOD_COLOURS, METHOD_MARKERS, METHOD_NAMES, figure_style, symbol

if TYPE_CHECKING:
    from matplotlib.figure import Figure

COLUMNS = ("mrf", "fom", "irm", "rom", "identified", "measured")

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
        By method, for the methods of `COLUMNS`.
    """

    name: str
    records: dict[str, Derivative]

    @property
    def measured(self) -> Derivative | None:
        """The free-flight value."""
        return self.records.get("measured")

    def deviation(self, method: str) -> float | None:
        """value/measured - 1 (negative: too small in size), or None where one is missing."""
        record, measured = self.records.get(method), self.measured
        if record is None or measured is None or measured.value == 0.0:
            return None
        return record.value / measured.value - 1.0


def comparison(table: DerivativeTable) -> list[ComparisonRow]:
    """The rows of the closing table; of several records of one method, the one to be compared.

    Of a forced oscillation that is the Fourier reduction; of two amplitudes, the smaller.
    """
    rows = []
    for name in ROWS:
        records = {method: record for method in COLUMNS if (record := _chosen(table, name, method)) is not None}
        if records:
            rows.append(ComparisonRow(name, records))
    return rows


def _chosen(table: DerivativeTable, name: str, method: str) -> Derivative | None:
    found = [r for r in table.select(name=name, method=method) if r.reduction in (None, "fourier")]
    return min(found, key=lambda r: r.amplitude_deg if r.amplitude_deg is not None else 0.0) if found else None


def comparison_text(rows: Sequence[ComparisonRow]) -> str:
    """The closing table as text: value, standard uncertainty, and deviation from the measured value."""
    heading = f"{'derivative':<18}" + "".join(f"{method:>18}" for method in COLUMNS)
    lines = [heading, "-" * len(heading)]
    for row in rows:
        lines.append(f"{row.name:<18}" + "".join(f"{_cell(row.records.get(method)):>18}" for method in COLUMNS))
        deviations = [row.deviation(method) for method in COLUMNS[:-1]]
        if any(d is not None for d in deviations):
            shown = ["" if d is None else f"({d:+.0%})" for d in deviations]
            lines.append(f"{'  from measured':<18}" + "".join(f"{cell:>18}" for cell in shown))
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
        deviations = {m: d for m in ("mrf", "fom", "irm") if (d := row.deviation(m)) is not None}
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
        others = [f"{m.upper()} {d:+.0%}" for m, d in deviations.items() if m != method]
        aside = f"; {', '.join(others)}" if others else ""
        parts.append(f"{row.name} {worst:+.0%} (by {method.upper()}{at}{sigma}{aside})")
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
            for offset, method in enumerate(COLUMNS):
                record = row.records.get(method)
                if record is None:
                    continue
                label = METHOD_NAMES[method] if method not in shown else None
                shown.add(method)
                axes.errorbar(
                    record.value / unit,
                    line + 0.1 * (offset - 2.5),
                    xerr=None if record.uncertainty is None else abs(record.uncertainty / unit),
                    fmt=METHOD_MARKERS[method],
                    color=METHOD_COLOURS[method],
                    ms=10 if method == "measured" else 6,
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
