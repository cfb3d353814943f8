"""The figures of the study: derivatives against Mach number, by method, with flights and other CFD beside them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from indicial.reference_data import finner_arl, finner_range, read_table
from indicial.report.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, figure_style, save, symbol
from indicial.studies.finner import experiment_figures
from indicial.studies.finner.agreement import SUM
from indicial.studies.finner.axial_force import axial_force
from indicial.studies.finner.flow_pictures import shock_pattern, surface_pressure
from indicial.studies.finner.load_pictures import hysteresis, step_responses, time_step
from indicial.studies.finner.pieces import LEVELS, OVERLAP
from indicial.studies.finner.selection import (
    OTHER_MOMENT_REFERENCE,
    about,
    convergence,
    derivative,
    finest,
    slowest_turns,
    suitable,
)
from indicial.studies.finner.variants import FINNER
from indicial.studies.kept import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LEVEL_COLOURS = {"quick": SKY, "coarse": BLUE, "medium": BLACK}

_Canvas = Callable[..., tuple["Figure", "Axes"]]


def draw(results: Results, folder: Path) -> tuple[Path, ...]:
    """Write all figures for which there are results."""
    if not len(finest(results)):
        return ()
    paths = []
    with figure_style() as plt:
        for name, make in _FIGURES.items():
            figure = make(results, plt.subplots)
            paths.append(save(figure, folder / f"{name}.png"))
        for name, draw_picture in _PICTURES.items():
            picture = draw_picture(results, plt)
            if picture is not None:
                paths.append(save(picture, folder / f"{name}.png"))
    return tuple(paths)


def _operator(axes: Axes, results: Results, name: str, colour: str = BLUE) -> None:
    """The operator's curve at k = 0 on the finest meshes, with grid-convergence indices as error bars."""
    best = finest(results)
    mach = best.machs()
    value = np.array([derivative(r, name, k=None) for r in best])
    judged = [convergence(results, float(m), name) for m in mach]
    bars = np.array([np.nan if one is None else one.index for one in judged])
    axes.errorbar(mach, value, bars, fmt=".-", color=colour, capsize=2, elinewidth=0.8, label="operator, k = 0")


def _flights(axes: Axes, name: str) -> None:
    """Single shots as points, multiple fits with their printed errors."""
    shots = finner_range("shots").select(name=name)
    axes.plot([r.mach for r in shots], [r.value for r in shots], ".", color=GREY, label="free flight, single shots")
    groups = finner_range("multifit").select(name=name).records
    error = [r.uncertainty or 0.0 for r in groups]
    axes.errorbar(
        [r.mach for r in groups], [r.value for r in groups], error, fmt="*", color=VERMILION, markersize=9,
        capsize=3, zorder=5, label="free flight, multiple fits",
    )  # fmt: skip


def _paper(axes: Axes, figure: int, series: str, label: str, style: str) -> None:
    table = read_table("basic_finner_paper_figures")
    rows = [
        i for i, (f, s) in enumerate(zip(table.text("fig"), table.text("series"), strict=True))
        if (int(f), s) == (figure, series)
    ]  # fmt: skip
    mach, value = table.numbers("mach")[rows], table.numbers("value")[rows]
    axes.plot(mach, value, style, color=PURPLE, linewidth=1.0, markersize=4, label=label)


def _marched(axes: Axes, results: Results, method: str, name: str, label: str, marker: str, colour: str) -> None:
    best = finest(results, method)
    best = slowest_turns(results, best) if method == "mrf" else best
    found = [r for r in best if r.derivatives.select(name=name).records]
    if found:
        value = [derivative(r, name) for r in found]
        axes.plot([r.piece.mach for r in found], value, marker, color=colour, fillstyle="none", label=label)


def _finish(axes: Axes, name: str) -> None:
    axes.set_xlabel("Mach number")
    axes.set_ylabel(symbol(name) if name.endswith("_0") else f"{symbol(name)} [1/rad]")
    axes.legend(fontsize=8)


def _pitch_damping(results: Results, canvas: _Canvas) -> Figure:
    figure, axes = canvas(figsize=(7.0, 4.4))
    _operator(axes, results, "Cm_q")
    _marched(axes, results, "mrf", "Cm_q", "MRF", "o", VERMILION)
    _marched(axes, results, "fom_pitch_rate", "Cm_q", "FOM, k = 0.025", "s", ORANGE)
    _marched(axes, results, "irm", "Cm_q", "IRM", "^", GREEN)
    _paper(axes, 3, "cmq_MRF", "the paper, MRF (read off)", "--")
    _paper(axes, 3, "cmq_FOM", "the paper, FOM (read off)", "s")
    _finish(axes, "Cm_q")
    return figure


def _incidence_rate(results: Results, canvas: _Canvas) -> Figure:
    figure, axes = canvas(figsize=(7.0, 4.4))
    _operator(axes, results, "Cm_alphadot")
    best = finest(results)
    at_k = [derivative(r, "Cm_alphadot", k=0.025) for r in best]
    axes.plot(best.machs(), at_k, ":", color=BLUE, label="operator, k = 0.025")
    _marched(axes, results, "fom_plunge", "Cm_alphadot", "FOM (plunge), k = 0.025", "s", ORANGE)
    _marched(axes, results, "irm", "Cm_alphadot", "IRM", "^", GREEN)
    _paper(axes, 6, "cmadot_FOM", "the paper, FOM (read off)", "--")
    _paper(axes, 6, "cmadot_IRM", "the paper, IRM (read off)", "-.")
    _finish(axes, "Cm_alphadot")
    return figure


def _damping_sum(results: Results, canvas: _Canvas) -> Figure:
    figure, axes = canvas(figsize=(7.0, 4.8))
    _flights(axes, SUM)
    _operator(axes, results, SUM)
    best = finest(results)
    axes.plot(best.machs(), [derivative(r, SUM, k=0.1) for r in best], ":", color=BLUE, label="operator, k = 0.1")
    arl = finner_arl().select(name=SUM).records
    axes.plot([r.mach for r in arl], [r.value for r in arl], "--", color=GREEN, label="ARL, RANS, k = 0.1")
    _paper(axes, 7, "sum_MRF_plus_FOM", "the paper (read off)", "--")
    axes.set_xlim(0.95, 4.6)
    axes.set_ylim(-620.0, -100.0)
    _finish(axes, SUM)
    return figure


def _normal_damping(results: Results, canvas: _Canvas) -> Figure:
    figure, axes = canvas(figsize=(7.0, 4.0))
    name = "CN_q+CN_alphadot"
    _operator(axes, results, name)
    best = finest(results)
    axes.plot(best.machs(), [derivative(r, name, k=0.1) for r in best], ":", color=BLUE, label="operator, k = 0.1")
    arl = finner_arl().select(name=name).records
    axes.plot([r.mach for r in arl], [r.value for r in arl], "--", color=GREEN, label="ARL, RANS, k = 0.1")
    axes.set_xlim(0.95, 4.6)
    _finish(axes, name)
    return figure


def _against_flights(name: str) -> Callable[[Results, _Canvas], Figure]:
    def make(results: Results, canvas: _Canvas) -> Figure:
        figure, axes = canvas(figsize=(7.0, 4.0))
        _flights(axes, name)
        _operator(axes, results, name)
        _finish(axes, name)
        return figure

    return make


def _centre_of_pressure(results: Results, canvas: _Canvas) -> Figure:
    figure, axes = canvas(figsize=(7.0, 4.0))
    best = finest(results)
    centre = [5.5 - derivative(r, "Cm_alpha", k=None) / derivative(r, "CN_alpha", k=None) for r in best]
    axes.plot(best.machs(), centre, ".-", color=BLUE, label="operator")
    groups = finner_range("multifit")
    cn, cm = (groups.select(name=name).records for name in ("CN_alpha", "Cm_alpha"))
    measured = [5.5 - m.value / n.value for n, m in zip(cn, cm, strict=True)]
    axes.plot([r.mach for r in cn], measured, "*", color=VERMILION, markersize=9, label="free flight, multiple fits")
    axes.set_xlabel("Mach number")
    axes.set_ylabel("centre of pressure [calibres from the nose]")
    axes.legend(fontsize=8)
    return figure


def _moment_references(results: Results, canvas: _Canvas) -> Figure:
    figure, axes = canvas(figsize=(7.0, 4.0))
    best = finest(results)
    for place, colour in ((5.5, BLUE), (OTHER_MOMENT_REFERENCE, ORANGE)):
        moved = [about(r, place) for r in best]
        total = [one["Cm_q"] + one["Cm_alphadot"] for one in moved]
        axes.plot(best.machs(), total, ".-", color=colour, label=f"operator, about {place:g} d")
    _flights(axes, SUM)
    axes.set_ylim(-620.0, -100.0)
    _finish(axes, SUM)
    return figure


def _axial(results: Results, canvas: _Canvas) -> Figure:
    figure, axes = canvas(figsize=(7.0, 4.4))
    best = finest(results)
    mach = best.machs()
    parts = [axial_force(FINNER, r.piece.mach, derivative(r, "CA_0")) for r in best]
    layers = {
        "inviscid: forebody and fins": [p.forebody_and_fins for p in parts],
        "skin friction, estimated": [p.friction for p in parts],
        "base, estimated": [p.base for p in parts],
        "fins' trailing edges, estimated": [p.trailing_edges for p in parts],
    }
    axes.stackplot(mach, *layers.values(), labels=list(layers), colors=[BLUE, SKY, ORANGE, GREY], alpha=0.7)
    _flights(axes, "CA_0")
    _finish(axes, "CA_0")
    return figure


def _refinement(results: Results, canvas: _Canvas) -> Figure:
    figure, axes = canvas(figsize=(7.0, 4.4))
    for level in LEVELS:
        chosen = suitable(results).select(level=level)
        for name, style in (("Cm_q", ".-"), ("Cm_alphadot", ".--")):
            mach, value = chosen.series(name, k=None)
            axes.plot(mach, value, style, color=LEVEL_COLOURS[level], label=f"{symbol(name)}, {level} mesh")
        other = results.select(method="operator", mesh="sting", level=level)
        for mach_there in OVERLAP:
            if (one := other.at(mach_there)) is not None:
                axes.plot(mach_there, derivative(one, "Cm_q", k=None), "x", color=LEVEL_COLOURS[level])
    axes.set_xlabel("Mach number")
    axes.set_ylabel("[1/rad]; crosses: with a sting")
    axes.legend(fontsize=8, ncols=2)
    return figure


def _transonic(results: Results, canvas: _Canvas) -> Figure:
    figure, axes = canvas(figsize=(7.0, 4.4))
    for level in LEVELS:
        chosen = suitable(results).select(level=level)
        for k, style in ((None, ".-"), (0.025, ".:"), (0.1, ".--")):
            mach, value = chosen.series("Cm_alphadot", k=k)
            near = mach <= 1.6
            if near.any():
                label = f"{level}, k = {0.0 if k is None else k:g}"
                axes.plot(mach[near], value[near], style, color=LEVEL_COLOURS[level], label=label)
    _paper(axes, 6, "cmadot_FOM", "the paper, FOM (read off)", "--")
    _paper(axes, 6, "cmadot_IRM", "the paper, IRM (read off)", "-.")
    axes.set_xlim(1.0, 1.6)
    _finish(axes, "Cm_alphadot")
    return figure


_FIGURES: dict[str, Callable[[Results, _Canvas], Figure]] = {
    "pitch_damping": _pitch_damping,
    "incidence_rate": _incidence_rate,
    "damping_sum": _damping_sum,
    "normal_force_damping": _normal_damping,
    "normal_force_slope": _against_flights("CN_alpha"),
    "moment_slope": _against_flights("Cm_alpha"),
    "roll_damping": _against_flights("Cl_p"),
    "centre_of_pressure": _centre_of_pressure,
    "moment_references": _moment_references,
    "axial_force": _axial,
    "refinement": _refinement,
    "transonic": _transonic,
    **experiment_figures.FIGURES,
}

_PICTURES: dict[str, Callable[[Results, Any], Figure | None]] = {
    "surface_pressure": surface_pressure,
    "shock_pattern": shock_pattern,
    "hysteresis": hysteresis,
    "step_responses": step_responses,
    "time_step": time_step,
}
"""Pictures of flows and histories; None where nothing to draw from is kept."""
