"""The pictures of the study, after the paper's figures 11 to 16."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from indicial.history import History
from indicial.report.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, figure_style, save
from indicial.studies.bocian.agreement import PAPER, REDUCTIONS, by_alpha, by_strips, piece, rows
from indicial.studies.bocian.glider import Glider
from indicial.studies.kept import Results
from indicial.studies.piece import PieceResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLOURS = dict(zip(REDUCTIONS, (ORANGE, GREEN, PURPLE), strict=True))
_MARKS = dict(zip(REDUCTIONS, "s^v", strict=True))
_CLP = "roll damping Cl_p, on half the span"


def draw(results: Results, folder: Path) -> tuple[Path, ...]:
    """Write all figures for which there are results."""
    paths = []
    drawn = {
        "frequency.png": ("frequency", _frequency),
        "loops.png": ("loops", _loops),
        "separation.png": ("loops", _separation),
        "variants.png": ("variants", _variants),
        "freedom.png": ("freedom", _freedom),
        "rocking.png": ("rocking", _rocking),
        "cells.png": ("cells", _cells),
    }
    with figure_style() as plt:
        if piece(results, "frame", level="fine") and piece(results, "forced"):
            paths.append(save(_incidence(results, plt), folder / "incidence.png"))
        if piece(results, "frame", mesh="spread") and piece(results, "forced", mesh="spread"):
            paths.append(save(_spread(results, plt), folder / "spread.png"))
        for name, (method, function) in drawn.items():
            result = piece(results, method)
            if result is not None:
                paths.append(save(function(result, plt), folder / name))
    return tuple(paths)


def _incidence(results: Results, plt: Any) -> Figure:
    """Figure 12: Cl_p over incidence by both methods and all reductions."""
    frame, forced = piece(results, "frame", level="fine"), piece(results, "forced")
    assert frame is not None
    assert forced is not None
    figure: Figure
    figure, axes = plt.subplots(figsize=(7.0, 4.6))
    steady = by_alpha(frame, "one_sided")
    axes.plot(list(steady), list(steady.values()), "o-", color=BLUE, label="MRF, 0 and 0.2 rad/s")
    free = piece(results, "frame", mesh="free")
    beyond, swung = piece(results, "frame", mesh="beyond"), piece(results, "forced", mesh="beyond")
    if beyond is not None and swung is not None:
        more, further = by_alpha(beyond, "one_sided"), by_alpha(swung, "fourier")
        axes.plot(list(more), list(more.values()), "o:", color=BLUE, fillstyle="none", label="MRF, beyond the paper")
        axes.plot(list(further), list(further.values()), "v:", color=PURPLE, label="FOM, fourier, beyond the paper")
    if free is not None:
        other = by_alpha(free, "one_sided")
        axes.plot(list(other), list(other.values()), "--", color=SKY, lw=1.2, label="MRF, free transition")
    for reduction in REDUCTIONS:
        found = by_alpha(forced, reduction)
        axes.plot(
            list(found),
            list(found.values()),
            f"{_MARKS[reduction]}--",
            color=_COLOURS[reduction],
            fillstyle="none",
            label=f"FOM, {reduction.replace('_', ' ')}",
        )
    axes.plot(4.0, PAPER[0.1], "*", color=BLACK, ms=11, label="paper, FOM at k = 0.1")
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set_xlabel("angle of attack [deg]")
    axes.set_ylabel(_CLP)
    axes.legend(fontsize=8)
    return figure


def _frequency(result: PieceResult, plt: Any) -> Figure:
    """Figure 11."""
    figure: Figure
    figure, axes = plt.subplots(figsize=(6.5, 4.0))
    k = [row["k"] for row in rows(result)]
    axes.plot(k, [row["fourier"] for row in rows(result)], "s-", color=ORANGE, label="FOM, sections on the lattice")
    axes.plot([0.0, *k], [result.provenance["linear_at_zero"], *result.provenance["linear"]], "-", color=SKY,
              label="lattice alone, H(ik)")  # fmt: skip
    axes.plot(list(PAPER), list(PAPER.values()), "*", color=BLACK, ms=11, label="paper")
    axes.set_xlabel("k on half the span")
    axes.set_ylabel(_CLP)
    axes.legend(fontsize=8)
    return figure


def _loops(result: PieceResult, plt: Any) -> Figure:
    """Figures 13 to 15: Cl over the angle of roll."""
    figure: Figure
    figure, axes = plt.subplots(1, 3, figsize=(10.0, 3.4))
    for ax, alpha in zip(axes, result.piece.settings["alpha_deg"], strict=True):
        history = History.from_netcdf(result.file(f"alpha_{alpha:g}"))
        amplitude, omega = history.motion["amplitude"], history.motion["omega"]
        roll = np.degrees(amplitude * np.sin(omega * history.time))
        ax.plot(roll, history["Cl"], color=ORANGE)
        ax.plot(roll[0], history["Cl"][0], "o", color=BLACK, ms=5, label="start")
        ax.set_title(f"alpha {alpha:g} deg")
        ax.set_xlabel("angle of roll [deg]")
    axes[0].set_ylabel("Cl, on half the span")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper right", fontsize=8)
    return figure


def _separation(result: PieceResult, plt: Any) -> Figure:
    """Figure 16: attached and separated parts of the wing's upper side."""
    glider = Glider.published()
    figure: Figure
    figure, axes = plt.subplots(3, 2, figsize=(10.0, 4.2), sharex=True, sharey=True)
    y = np.array(result.provenance["y_m"])
    edges = np.concatenate([[-0.5 * glider.span], 0.5 * (y[1:] + y[:-1]), [0.5 * glider.span]])
    for row, alpha in zip(axes, result.piece.settings["alpha_deg"], strict=True):
        for ax, flow, title in zip(row, ("still", "turning"), ("p = 0", "p = 0.2 rad/s"), strict=True):
            points = result.provenance["separation"][f"alpha_{alpha:g}"][flow]
            for left, right, x in zip(edges[:-1], edges[1:], points, strict=True):
                ends = np.array([left, right])
                lead, chord = _planform(glider, ends)
                ax.fill_between(ends, -lead, -(lead + x * chord), color=VERMILION, lw=0.0)
                ax.fill_between(ends, -(lead + x * chord), -(lead + chord), color=BLUE, lw=0.0)
            ax.set_title(f"alpha {alpha:g} deg, {title}", fontsize=9)
    for ax in axes[-1]:
        ax.set_xlabel("y [m], right wing at y > 0")
    for ax in axes[:, 0]:
        ax.set_ylabel("-x [m]")
    handles = [plt.Rectangle((0, 0), 1, 1, color=colour) for colour in (VERMILION, BLUE)]
    figure.legend(handles, ["attached", "separated"], loc="outside upper center", ncols=2, fontsize=9)
    return figure


def _planform(glider: Glider, y: np.ndarray[Any, Any]) -> tuple[Any, Any]:
    """Leading edge and chord [m] at places across."""
    chord = glider.root_chord * (1.0 - (1.0 - glider.taper) * np.abs(y) / (0.5 * glider.span))
    lead = 0.25 * (glider.root_chord - chord) + np.abs(y) * math.tan(glider.sweep)
    return lead, chord


def _variants(result: PieceResult, plt: Any) -> Figure:
    """Cl_p at 4 degrees with what is not published."""
    found = result.provenance["rows"]
    figure: Figure
    figure, axes = plt.subplots(figsize=(7.0, 3.6))
    labels = list(found)
    axes.barh(labels, [row["fom"] for row in found.values()], color=ORANGE, height=0.6)
    axes.axvline(PAPER[0.1], color=BLACK, ls="--", label="paper")
    axes.set_xlim(1.1 * PAPER[0.1], 0.8 * PAPER[0.1])
    axes.invert_yaxis()
    axes.set_xlabel(f"{_CLP}, alpha 4 deg, k = 0.1")
    axes.legend(fontsize=8)
    return figure


def _freedom(result: PieceResult, plt: Any) -> Figure:
    """How far FOM moves in stall with its own choices."""
    alphas = result.piece.settings["alpha_deg"]
    figure: Figure
    figure, axes = plt.subplots(figsize=(8.0, 4.6))
    cycle = (BLUE, SKY, GREEN, ORANGE, VERMILION, PURPLE)
    for n, (label, listed) in enumerate(result.provenance["rows"].items()):
        colour, width = (BLACK, 2.5) if label == "base" else (cycle[n % 6], 1.2)
        dashes = "o-" if n < 7 else "o--"
        axes.plot(alphas, [row["fourier"] for row in listed], dashes, ms=3, color=colour, lw=width, label=label)
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set_xlabel("angle of attack [deg]")
    axes.set_ylabel(_CLP)
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def _rocking(result: PieceResult, plt: Any) -> Figure:
    """The rate of roll after release."""
    figure: Figure
    figure, axes = plt.subplots(figsize=(7.0, 4.2))
    cycle = (BLUE, SKY, GREEN, PURPLE, ORANGE, VERMILION, BLACK)
    for n, row in enumerate(sorted(rows(result), key=lambda row: float(row["alpha_deg"]))):
        dashes = "-" if row["autorotates"] else ":"
        axes.plot(row["time_s"], row["p"], dashes, color=cycle[n % 7], label=f"{row['alpha_deg']:g} deg")
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set_xlabel("time after release [s]")
    axes.set_ylabel("rate of roll [rad/s]")
    axes.legend(fontsize=8, ncols=2, title="solid: autorotates", title_fontsize=8)
    return figure


def _cells(result: PieceResult, plt: Any) -> Figure:
    """Cl_p in stall with several numbers of strips, for each spread of separation."""
    spreads = result.piece.settings["spreads"]
    figure: Figure
    figure, axes = plt.subplots(1, len(spreads), figsize=(11.0, 3.6), sharey=True)
    for ax, spread in zip(axes, spreads, strict=True):
        for colour, mark, (across, found) in zip(
            (BLUE, ORANGE, GREEN, VERMILION), "osv^", by_strips(result, spread).items(), strict=True
        ):
            ax.plot(list(found), list(found.values()), f"{mark}-", color=colour, ms=4, lw=1.2, label=f"{across} strips")
        ax.axhline(0.0, color=GREY, lw=0.8)
        ax.set_title("each strip on its own" if spread == 0.0 else f"spread over {spread:g} c", fontsize=10)
        ax.set_xlabel("angle of attack [deg]")
    axes[0].set_ylabel("Cl_p by MRF, on half the span")
    axes[0].legend(fontsize=8)
    return figure


def _spread(results: Results, plt: Any) -> Figure:
    """Both methods in stall, each strip on its own and separation spread over a chord."""
    figure: Figure
    figure, axes = plt.subplots(figsize=(7.0, 4.2))
    for colour, method, reading in ((BLUE, "frame", "one_sided"), (PURPLE, "forced", "fourier")):
        name = {"frame": "MRF", "forced": "FOM"}[method]
        for mesh, dashes, said in (("base", "o:", "each strip on its own"), ("spread", "s-", "spread over a chord")):
            found: dict[float, float] = {}
            for part in (mesh, *(("beyond",) if mesh == "base" else ())):
                result = piece(results, method, mesh=part, level="fine")
                found |= {a: v for a, v in by_alpha(result, reading).items() if a >= 13.0} if result else {}
            axes.plot(list(found), list(found.values()), dashes, color=colour, ms=4, label=f"{name}, {said}")
    axes.axhline(0.0, color=GREY, lw=0.8)
    axes.set_xlabel("angle of attack [deg]")
    axes.set_ylabel(_CLP)
    axes.legend(fontsize=8)
    return figure
