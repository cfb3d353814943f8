"""Figures of CFD experiments: convergence, hysteresis loops, step responses, predictions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from indicial.conventions import COEFFICIENTS, Array
from indicial.history import History
from indicial.report.style import BLACK, BLUE, GREEN, GREY, ORANGE, PURPLE, SKY, VERMILION, figure_style, symbol

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from indicial.cfd import ConvergenceHistory

PAIR = ("CN", "Cm")


def convergence_figure(histories: Mapping[str, ConvergenceHistory]) -> Figure:
    """Residual over Newton steps and over products with J, one line for each steady state.

    Parameters
    ----------
    histories : mapping
        By the experiment's label.
    """
    with figure_style() as plt:
        figure: Figure
        figure, panels = plt.subplots(1, 2, sharey=True, figsize=(9.0, 4.2))
        for label, history in histories.items():
            history.plot((panels[0], panels[1]), label)
        figure.suptitle("Steady states: dotted, the first-order phase of a start from rest")
        figure.legend(fontsize=8, loc="outside right center")
        return figure


def loop_figure(loops: Mapping[str, History], reductions: Mapping[str, Mapping[str, tuple[float, float]]]) -> Figure:
    """Hysteresis loops of forced oscillations, with the ellipse that the reduction makes of each.

    Parameters
    ----------
    loops : mapping
        History of each motion, by its title; a column of panels each.
    reductions : mapping
        For each title and coefficient, the in-phase and out-of-phase derivative per rad: the ellipse is
        ``C_0 + A (in_phase sin + k out_of_phase cos)``.
    """
    with figure_style() as plt:
        figure: Figure
        figure, panels = plt.subplots(2, len(loops), figsize=(4.4 * len(loops), 6.4), squeeze=False, sharex="col")
        phase = np.linspace(0.0, 2.0 * np.pi, 200)
        for column, (title, history) in enumerate(loops.items()):
            amplitude, omega = float(history.motion["amplitude"]), float(history.motion["omega"])
            k = omega * history.reference.length / (2.0 * history.condition.speed)
            driving = history.condition.alpha + amplitude * np.sin(omega * history.time)
            settled = history.time >= history.time[-1] - 2.0 * np.pi / omega * (1.0 + 1e-9)
            for row, name in enumerate(PAIR):
                axes = panels[row, column]
                values = history[name]
                axes.plot(np.degrees(driving), values, color=SKY, lw=0.8, label="CFD, transient")
                axes.plot(
                    np.degrees(driving[settled]), values[settled], ".", ms=4, color=BLUE, label="CFD, last period"
                )
                in_phase, out_of_phase = reductions[title][name]
                mean = float(np.mean(values[settled][:-1]))
                ellipse = mean + amplitude * (in_phase * np.sin(phase) + k * out_of_phase * np.cos(phase))
                angle = np.degrees(history.condition.alpha + amplitude * np.sin(phase))
                axes.plot(angle, ellipse, color=VERMILION, lw=1.2, label="first harmonic")
                axes.set_ylabel(symbol(name))
            panels[0, column].set_title(f"{title}, k = {k:.3g}")
            panels[1, column].set_xlabel("A sin(ωt) + mean angle [deg]")
        panels[0, 0].legend(fontsize=8)
        return figure


def step_figure(steps: Mapping[str, Sequence[History]]) -> Figure:
    """Step responses per unit step; what is missing of the final value (the deficiency) shaded.

    Parameters
    ----------
    steps : mapping
        Histories of the steps, by what was stepped: ``"alpha"`` or ``"q"``.
    """
    names = {"alpha": "step in α", "q": "step in q"}
    with figure_style() as plt:
        figure: Figure
        figure, panels = plt.subplots(2, len(steps), figsize=(4.8 * len(steps), 6.4), squeeze=False, sharex="col")
        for column, (stepped, histories) in enumerate(steps.items()):
            for row, name in enumerate(PAIR):
                axes = panels[row, column]
                for colour, history in zip((BLUE, ORANGE, GREEN, PURPLE), histories, strict=False):
                    response = unit_response(history, name)
                    axes.plot(history.s, response, color=colour, lw=1.4, label=f"response to {_step_size(history)}")
                first, response = histories[0], unit_response(histories[0], name)
                axes.axhline(response[-1], color=GREY, lw=0.8, ls="--", label="final value")
                axes.fill_between(first.s, response, response[-1], color=BLUE, alpha=0.15, label="deficiency")
                axes.plot(0.0, response[0], "o", color=BLACK, ms=5, label="first instant")
                axes.set_ylabel(f"{symbol(f'{name}_{stepped}')} (s), per rad")
            panels[0, column].set_title(names.get(stepped, stepped))
            panels[0, column].legend(fontsize=8)
            panels[1, column].set_xlabel("reduced time s = 2Vt/d")
        return figure


def _step(history: History) -> float:
    """What was stepped: alpha [rad], or q c/2V."""
    if history.motion["kind"] == "alpha_step":
        return float(history.motion["amplitude"])
    return float(history.reduced_rate[-1, 1])


def _step_size(history: History) -> str:
    step = _step(history)
    return f"{np.degrees(step):+.3g}°" if history.motion["kind"] == "alpha_step" else f"q d/2V = {step:+.3g}"


def unit_response(history: History, name: str) -> Array:
    """Response per unit step: of alpha per rad, of q per ``q c/2V``, shape (n,)."""
    response: Array = (history[name] - history.initial(name)) / _step(history)
    return response


def prediction_figure(checks: Mapping[str, tuple[History, Mapping[str, Array]]]) -> Figure:
    """What models that have not seen a CFD history predict of it.

    Parameters
    ----------
    checks : mapping
        By title: the CFD history, and by model the predicted coefficients, shape (n, 6).
    """
    # The models lie on top of one another: a broad light line under a thin dashed one shows both.
    lines = ((SKY, "-", 3.0), (VERMILION, "--", 1.2), (GREEN, ":", 1.2))
    with figure_style() as plt:
        figure: Figure
        figure, panels = plt.subplots(2, len(checks), figsize=(4.8 * len(checks), 6.2), squeeze=False, sharex="col")
        for column, (title, (history, models)) in enumerate(checks.items()):
            for row, name in enumerate(PAIR):
                axes, index = panels[row, column], COEFFICIENTS.index(name)
                axes.plot(history.s, history[name], ".", color=BLACK, ms=4, zorder=3, label="CFD")
                for (colour, line, width), (model, values) in zip(lines, models.items(), strict=False):
                    axes.plot(history.s, values[:, index], line, color=colour, lw=width, label=model)
                axes.set_ylabel(symbol(name))
            panels[0, column].set_title(title)
            panels[1, column].set_xlabel("reduced time s = 2Vt/d")
        panels[0, 0].legend(fontsize=8)
        return figure
