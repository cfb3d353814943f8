"""The figures of the study: errors and poles of every realisation, and the Finner under a multisine."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from indicial.report.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, figure_style, save
from indicial.rom import check_prediction
from indicial.studies.kept import Results
from indicial.studies.piece import PieceResult
from indicial.studies.plate.agreement import PLATE_ERROR, asked, methods
from indicial.studies.plate.computing import finner_files, finner_model

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_COLOURS = (BLUE, SKY, GREEN, PURPLE, ORANGE, VERMILION, BLACK, GREY)
_MARKS = "osv^Dx+*"


def draw(results: Results, folder: Path) -> tuple[Path, ...]:
    """Write all figures for which there are results."""
    plates, finner = results.select(mesh="plate"), results.select(mesh="finner")
    paths = []
    with figure_style() as plt:
        if len(plates):
            paths.append(save(_errors(plates, plt), folder / "errors.png"))
            middle = plates.at(2.0)
            if middle is not None:
                paths.append(save(_poles(middle, plt), folder / "poles.png"))
        if len(finner):
            paths.append(save(_finner(finner.results[0], plt), folder / "finner.png"))
    return tuple(paths)


def _errors(plates: Results, plt: Any) -> Figure:
    figure: Figure
    figure, axes = plt.subplots(figsize=(7.5, 4.4))
    for i, method in enumerate(methods(plates)):
        rows = [(r.piece.mach, r.provenance["realisations"].get(method)) for r in plates]
        points = np.array([(mach, max(asked(row).values())) for mach, row in sorted(rows, key=_mach) if row])
        axes.semilogy(points[:, 0], points[:, 1], f"{_MARKS[i % 8]}-", color=_COLOURS[i % 8], label=method)
    axes.axhline(PLATE_ERROR, color=GREY, ls="--", label="asked")
    axes.set_xlabel("Mach number")
    axes.set_ylabel("largest error / peak load, motions not seen")
    axes.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure


def _mach(row: tuple[float, Any]) -> float:
    return row[0]


def _poles(result: PieceResult, plt: Any) -> Figure:
    figure: Figure
    figure, axes = plt.subplots(figsize=(6.5, 5.0))
    for i, (method, row) in enumerate(result.provenance["realisations"].items()):
        poles = np.array(row["poles"])
        style = {"color": _COLOURS[i % 8], "fillstyle": "none"}
        axes.plot(poles[:, 0], poles[:, 1], _MARKS[i % 8], label=f"{method}, {row['order']} states", **style)
    axes.set_xlabel("real part of pole, per 2V/c")
    axes.set_ylabel("imaginary part")
    axes.set_title(f"plate, M {result.piece.mach:g}")
    axes.legend(fontsize=8)
    return figure


def _finner(result: PieceResult, plt: Any) -> Figure:
    """The multisine as marched, and by the model of six states."""
    histories, response = finner_files(result)
    model = finner_model(response, result.piece.settings)
    check = check_prediction(model, histories["multisine"])
    figure: Figure
    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(8.0, 5.5))
    for ax, name in zip(axes, ("CN", "Cm"), strict=True):
        ax.plot(check.measured.s, check.measured[name], color=GREY, lw=3.0, label="marched, not seen")
        ax.plot(check.predicted.s, check.predicted[name], color=BLUE, lw=1.0, label=f"model, {model.order} states")
        ax.set_ylabel(name)
    axes[0].legend(fontsize=8)
    axes[1].set_xlabel("reduced time s = 2Vt/d")
    return figure
