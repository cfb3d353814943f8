"""The figures of the study: recovered against published coefficients, coverage, what the printed errors imply."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from indicial.report.style import BLACK, BLUE, GREEN, GREY, ORANGE, SKY, VERMILION, figure_style, save
from indicial.studies.kept import Results
from indicial.studies.piece import PieceResult
from indicial.studies.range.agreement import DAMPING, SURE, implied_noise
from indicial.studies.range.pieces import NAMES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SEEN = {"exact": "exactly seen", "seen": "range noise"}
_COLUMNS = {"linear": (SKY, "v"), "single": (ORANGE, "s"), "multiple": (BLUE, "o")}


def draw(results: Results, folder: Path) -> tuple[Path, ...]:
    """Write all figures for which there are results."""
    closing = sorted(results.select(method="closing"), key=lambda r: r.piece.mach)
    paths = []
    with figure_style() as plt:
        if closing:
            paths.append(save(_recovered(closing, plt), folder / "recovered.png"))
            paths.append(save(_columns(closing, plt), folder / "columns.png"))
        for method, function, name in (("implied", _implied, "implied.png"), ("in_flow", _in_flow, "in_flow.png")):
            found = next(iter(results.select(method=method)), None)
            if found is not None:
                paths.append(save(function(found, closing, plt), folder / name))
    return tuple(paths)


def _recovered(closing: list[PieceResult], plt: Any) -> Figure:
    """Every coefficient less its truth, in per cent, with its 95% interval, and all records as dots."""
    figure: Figure
    figure, axes = plt.subplots(len(NAMES), 1, figsize=(8.0, 10.0), sharex=True)
    for k, (ax, name) in enumerate(zip(axes, NAMES, strict=True)):
        for i, result in enumerate(closing):
            truth = result.provenance["truth"][name]
            dots = 100.0 * np.array(result.provenance["errors"])[:, k] / abs(truth)
            ax.plot(np.full(dots.size, i) + 0.25, dots, ".", color=GREY, ms=3)
            value, error = result.provenance["multiple"][name]
            off = 100.0 * (value - truth) / abs(truth)
            ax.errorbar(i, off, yerr=100.0 * SURE * error / abs(truth), fmt="o", color=BLUE, capsize=3)
        ax.axhline(0.0, color=BLACK, lw=0.8)
        ax.set_ylabel(f"{name}\n[% off]")
    axes[-1].set_xticks(range(len(closing)), [f"{r.piece.mach:g}" for r in closing])
    axes[-1].set_xlabel("Mach number of the group; blue: first record and 95% interval, grey: 30 records")
    return figure


def _columns(closing: list[PieceResult], plt: Any) -> Figure:
    """The damping sum by the three reductions, and the truth."""
    figure: Figure
    figure, axes = plt.subplots(figsize=(8.0, 4.6))
    seen = set()
    for result in closing:
        for row in result.provenance["columns"]:
            if DAMPING not in row:
                continue
            kind = row["reduction"]
            colour, mark = _COLUMNS[kind]
            bar = row[f"{DAMPING}_pe_pct"] / 100.0 * abs(row[DAMPING])
            label = None if kind in seen else f"{kind}, with probable error"
            axes.errorbar(
                row["mach"], row[DAMPING], yerr=bar, fmt=mark, color=colour, ms=5, capsize=2, lw=0.8, label=label
            )
            seen.add(kind)
    for result in closing:  # one value a group, over the mean Mach numbers of its shots
        machs, flown = [row["mach"] for row in result.provenance["columns"]], result.provenance["truth"][DAMPING]
        label = "flown" if result is closing[0] else None
        axes.plot([min(machs) - 0.02, max(machs) + 0.02], [flown, flown], "-", color=BLACK, lw=1.5, label=label)
    axes.set_ylim(-800.0, 0.0)
    axes.set_xlabel("mean Mach number of the flight")
    axes.set_ylabel("Cm_q + Cm_alphadot, per d/2V")
    axes.legend(fontsize=8)
    return figure


def _implied(result: PieceResult, closing: list[PieceResult], plt: Any) -> Figure:
    """Probable error over yaw by stations and noise; and the noise that the printed errors imply."""
    del closing
    figure: Figure
    figure, axes = plt.subplots(1, 2, figsize=(10.5, 4.2))
    rows = result.provenance["rows"]
    styles = dict(zip(sorted({r["stations"] for r in rows}), (":", "-", "--"), strict=False))
    colours = dict(zip(sorted({r["angle_deg"] for r in rows}), (GREEN, BLUE, VERMILION), strict=False))
    for stations, style in styles.items():
        for angle, colour in colours.items():
            line = [r for r in rows if r["stations"] == stations and r["angle_deg"] == angle]
            axes[0].loglog(
                [r["yaw_deg"] for r in line],
                [r["pe_pct"] for r in line],
                style,
                color=colour,
                label=f"{stations} stations, {angle:g} deg",
            )
    axes[0].set_xlabel("root mean square yaw [deg]")
    axes[0].set_ylabel("probable error of the damping sum, one shot [%]")
    axes[0].set_title(f"M {result.piece.mach:g}", fontsize=9)
    yaws = sorted({r["yaw_deg"] for r in rows})
    axes[0].set_xticks(yaws, [f"{yaw:g}" for yaw in yaws])
    axes[0].minorticks_off()
    axes[0].set_yticks([0.5, 1, 2, 5, 10, 20, 50], ["0.5", "1", "2", "5", "10", "20", "50"])
    axes[0].set_ylim(top=5.0 * axes[0].get_ylim()[1])  # room for the legend
    axes[0].legend(fontsize=7, ncols=3, loc="upper center")
    noise = implied_noise(result)
    axes[1].plot(list(noise), list(noise.values()), "o", color=BLUE)
    axes[1].axhline(0.1, color=GREY, lw=0.8, label="assumed")
    axes[1].set_ylim(bottom=0.0)
    axes[1].set_xlabel("Mach number of the group")
    axes[1].set_ylabel("noise of angles that the printed error implies [deg]")
    axes[1].legend(fontsize=8)
    return figure


def _in_flow(result: PieceResult, closing: list[PieceResult], plt: Any) -> Figure:
    """The damping sum from the flight in the flow beside what the flow gave by every method."""
    del closing
    figure: Figure
    figure, axes = plt.subplots(figsize=(7.5, 3.6))
    labels: list[str] = []
    for name, row in result.provenance["rows"].items():
        value, error = row[DAMPING]
        bar = SURE * error if name.startswith("seen") else 0.0
        axes.errorbar(value, len(labels), xerr=bar, fmt="o", color=BLUE, capsize=3)
        seen, _, flights = name.partition(", ")
        labels.append(f"identified, {_SEEN[seen]}: {flights}")
    for method, values in result.provenance["cfd"].items():
        if DAMPING in values:
            axes.plot(values[DAMPING], len(labels), "s", color=ORANGE)
            labels.append(method)
    axes.set_yticks(range(len(labels)), labels, fontsize=8)
    axes.invert_yaxis()
    axes.set_xlabel("Cm_q + Cm_alphadot at M 2, per d/2V")
    return figure
