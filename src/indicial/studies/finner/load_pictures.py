"""Pictures of loads in time: hysteresis loops, step responses, convergence with the time step."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from indicial.conventions import Array
from indicial.history import History
from indicial.methods import forced_oscillation, indicial_response
from indicial.reference_data import read_table
from indicial.report.style import BLACK, BLUE, GREY, ORANGE, SKY, VERMILION, symbol
from indicial.studies.finner.pieces import FORCED, REDUCED_FREQUENCIES, STEPS_PER_PERIOD
from indicial.studies.finner.selection import derivative
from indicial.studies.kept import Results
from indicial.studies.piece import PieceResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

LOADS = ("CN", "Cm")

SETTLED = 50.0
"""Reduced time up to which step responses are shown."""

FINEST_STEP = min(STEPS_PER_PERIOD)


def hysteresis(results: Results, plt: Any) -> Figure | None:
    """Loops of forced oscillations in pitch at two frequencies, with the first harmonic of each."""
    loops = {
        k: {r.piece.mach: History.from_netcdf(r.file("loop")) for r in results.select(method=f"loop_k{k:g}")}
        for k in REDUCED_FREQUENCIES
    }
    machs = sorted({mach for found in loops.values() for mach in found})
    if not machs:
        return None
    figure: Figure
    figure, panels = plt.subplots(2, len(machs), figsize=(4.2 * len(machs), 7.0), squeeze=False, sharex=True)
    for column, mach in zip(panels.T, machs, strict=True):
        for (k, found), colour in zip(loops.items(), (BLUE, ORANGE), strict=True):
            if mach in found:
                for axes, name in zip(column, LOADS, strict=True):
                    _loop(axes, found[mach], name, f"k = {k:g}", colour)
        column[0].set_title(f"M {mach:g}")
        column[1].set_xlabel("angle of attack [deg]")
    for row, name in zip(panels, LOADS, strict=True):
        row[0].set_ylabel(symbol(name))
    panels[0, 0].legend(fontsize=8)
    figure.suptitle(
        "Forced oscillation in pitch: last period (dots), its first harmonic (lines), the way round (arrows).\n"
        "The moment's loops run counter-clockwise: the air takes energy out of the motion."
    )
    return figure


def _loop(axes: Axes, history: History, name: str, label: str, colour: str) -> None:
    reading = forced_oscillation.fourier(history, 1)
    phase = np.linspace(0.0, 2.0 * np.pi, 400)
    omega = float(history.motion["omega"])
    last = history.time >= history.time[-1] - 2.0 * np.pi / omega * (1.0 + 1e-9)
    mean = float(np.mean(history[name][last][:-1]))
    in_phase, out_of_phase = reading.value(name, "in_phase"), reading.value(name)
    # k of the reading is that of Eq. 5; rates per q d/2V make the out-of-phase part k times the derivative
    ellipse = mean + reading.amplitude * (in_phase * np.sin(phase) + reading.k * out_of_phase * np.cos(phase))
    angle = np.degrees(history.condition.alpha + reading.amplitude * np.sin(phase))
    axes.fill(angle, ellipse, color=colour, alpha=0.10, lw=0.0)
    axes.plot(angle, ellipse, color=colour, lw=1.4, label=label)
    axes.plot(np.degrees(history.alpha[last]), history[name][last], ".", ms=3.0, color=colour)
    for there in (0, 200):
        axes.annotate(
            "", (angle[there + 12], ellipse[there + 12]), (angle[there], ellipse[there]),
            arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.4},
        )  # fmt: skip


def step_responses(results: Results, plt: Any) -> Figure | None:
    """Responses to unit steps in alpha and in q; what is missing of the final value shaded."""
    found = sorted(results.select(method="steps"), key=lambda r: r.piece.mach)
    if not found:
        return None
    figure: Figure
    figure, panels = plt.subplots(4, len(found), figsize=(4.4 * len(found), 11.0), squeeze=False, sharex=True)
    for column, result in zip(panels.T, found, strict=True):
        column[0].set_title(f"M {result.piece.mach:g}")
        for axes, (response, name) in zip(column, _responses(result), strict=True):
            _step(axes, response, name, result)
        column[-1].set_xlabel("reduced time s = 2Vt/d")
    for row, kind in zip((0, 2), ("rad", "unit q d/2V"), strict=True):
        for axes in panels[row : row + 2, 0]:
            axes.set_ylabel(f"{axes.get_ylabel()}, per {kind}")
    panels[0, -1].legend(fontsize=8)
    figure.suptitle(
        "Responses to steps in α (above) and in q (below). Shaded: what is missing of the final value;\n"
        "after a step in α its area, with the other sign, is the derivative of dα/dt."
    )
    return figure


def _responses(result: PieceResult) -> Iterator[tuple[indicial_response.StepResponse, str]]:
    """Each response with each load."""
    for kind in ("alpha", "q"):
        final = {name: derivative(result, f"{name}_{kind}") for name in LOADS}
        response = indicial_response.read(History.from_netcdf(result.file(kind)), final)
        yield from ((response, name) for name in LOADS)


def _step(axes: Axes, response: indicial_response.StepResponse, name: str, result: PieceResult) -> None:
    final, values = response.limit(name)[0], response[name]
    axes.axhline(final, color=GREY, lw=0.9, ls="--", label="final value")
    axes.fill_between(response.s, values, final, color=SKY, alpha=0.35, lw=0.0, label="deficiency")
    axes.plot(response.s, values, color=BLUE, lw=1.5)
    axes.plot(0.0, values[0], "o", color=BLACK, ms=4, clip_on=False, label="first instant")
    axes.set_xlim(0.0, SETTLED)
    axes.set_ylabel(symbol(f"{name}_{response.kind}"))
    said = f"{symbol(f'{name}_{response.kind}')} = {final:.4g}"
    lag = f"{name}_alphadot"
    if response.kind == "alpha":
        known = result.derivatives.select(name=lag).records
        said += f"\n{symbol(lag)} = {known[0].value:.3g}" if known else f"\nno {symbol(lag)}"
    axes.text(0.97, 0.5, said, transform=axes.transAxes, ha="right", va="center", fontsize=9)


def time_step(results: Results, plt: Any) -> Figure | None:
    """Rate derivatives against the time step of a forced oscillation: values, and changes beside the paper's."""
    steps, values = _time_steps(results)
    if FINEST_STEP not in steps:
        return None
    paper = read_table("basic_finner_paper_time_step")
    figure: Figure
    figure, panels = plt.subplots(2, 2, figsize=(10.0, 6.6), sharex=True)
    for column, (name, found) in zip(panels.T, values.items(), strict=True):
        best = found[steps.index(FINEST_STEP)]
        column[0].plot(steps, found, "o-", color=BLUE, label="FOM, second period")
        for method, wanted, style, label in _WITHOUT_START:
            for limit in results.select(method=method):
                column[0].axhline(derivative(limit, name, **wanted), color=GREY, ls=style, label=label)
        column[0].set_ylabel(f"{symbol(name)} [1/rad]")
        column[0].set_ylim(sorted((0.97 * best, 1.03 * best)))
        column[1].plot(
            paper.numbers("time_step"), paper.numbers(name), "s-", color=VERMILION, label="the paper, Table 1"
        )
        change = 100.0 * (found / best - 1.0)
        column[1].plot(
            steps, change, "o-", color=BLUE, label=f"this code, at most {np.max(np.abs(change)):.1g}% either way"
        )
        column[1].set_ylabel(f"change of {symbol(name)} from U Δt/d = 0.05 [%]")
        column[1].set_xlabel("time step U Δt/d")
        for axes in column:
            axes.legend(fontsize=8)
    figure.suptitle("Forced pitch rate at M 1, k = 0.025: convergence with the time step")
    return figure


_WITHOUT_START: tuple[tuple[str, dict[str, object], str, str], ...] = (
    ("fom_pitch_rate_longer", {}, ":", "FOM, second to sixth period, U Δt/d = 1.05"),
    ("operator_without_steps", {"k": FORCED["k"]}, "--", "operator at k: no start, no time step"),
)


def _time_steps(results: Results) -> tuple[list[float], dict[str, Array]]:
    """Time steps of which there are results, and the derivatives found with each."""
    quick = results.select(level="quick")
    found = {step: result for step in STEPS_PER_PERIOD for result in quick.select(method=f"time_step_{step:g}")}
    return list(found), {name: np.array([derivative(r, name) for r in found.values()]) for name in ("Cm_q", "CN_q")}
