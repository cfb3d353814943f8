"""Figures of the linearised flow: frequency responses with marched oscillations on them, step responses of models."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array
from indicial.frequency import FrequencyResponse
from indicial.report.loads import PAIR
from indicial.report.style import BLACK, BLUE, GREY, ORANGE, VERMILION, figure_style, symbol
from indicial.rom import StateSpaceModel, StepResponses

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Oscillations = Mapping[str, Mapping[str, tuple[float, float]]]
"""In phase and out of phase over k, by motion (``"pitch"``, ``"plunge"``) and coefficient."""

_MOTIONS = {"plunge": "plunging", "pitch": "pitching"}
_PARTS = ("in phase", "out of phase / k")


def frequency_figure(
    response: FrequencyResponse, model: StateSpaceModel | None, band: float, oscillations: Oscillations, k: float
) -> Figure:
    """H(ik) of plunging, ``H_a``, and of pitching, ``H_a + ik H_q``: in phase, and out of phase over k.

    Parameters
    ----------
    response : FrequencyResponse
        Of alpha and q at least.
    model : StateSpaceModel, optional
        Drawn as a line.
    band : float
        Up to which k the model is good.
    oscillations : mapping
        What forced oscillations at `k` gave.
    k : float
    """
    order = np.argsort(response.k)
    moving = order[response.k[order] > 0.0]
    ks = response.k[moving]
    fine = np.linspace(0.0, band, 201)[1:]
    curves = None if model is None else model.frequency_response(fine)
    with figure_style() as plt:
        figure: Figure
        figure, panels = plt.subplots(2, 4, figsize=(12.0, 5.6), sharex=True)
        for row, name in enumerate(PAIR):
            static, slope = response.at_zero(name, "alpha")
            damping = response.at_zero(name, "q")[0]
            for column, motion in enumerate(_MOTIONS):
                pitching = motion == "pitch"
                solved = _parts(
                    response.channel(name, "alpha")[moving], response.channel(name, "q")[moving], ks, pitching
                )
                for part, label in enumerate(_PARTS):
                    axes = panels[row, 2 * column + part]
                    if model is not None and curves is not None:
                        h = curves[:, model.outputs.index(name)][:, [model.inputs.index(i) for i in ("alpha", "q")]]
                        line = _parts(h[:, 0], h[:, 1], fine, pitching)
                        axes.plot(fine, line[part], color=BLUE, lw=1.0, label="projected model")
                    axes.plot(ks, solved[part], "o", color=BLUE, ms=5, label="operator")
                    limit = (static, slope + damping * pitching)[part]
                    axes.plot(0.0, limit, "D", color=BLACK, ms=5, label="operator, k = 0")
                    axes.plot(k, oscillations[motion][name][part], "x", color=ORANGE, ms=9, mew=2, label="FOM")
                    axes.set_title(f"{symbol(name)}, {_MOTIONS[motion]}, {label}", fontsize=9)
        for axes in panels[1]:
            axes.set_xlabel("reduced frequency k = ωd/2V")
        for axes in panels[:, 0]:
            axes.set_ylabel("per rad")
        figure.legend(*panels[0, 0].get_legend_handles_labels(), fontsize=8, loc="outside lower center", ncols=4)
        return figure


def _parts(
    alpha: NDArray[np.complex128], q: NDArray[np.complex128], k: Array, pitching: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """In phase, and out of phase over k."""
    h = alpha + 1j * k * q if pitching else alpha
    return h.real, h.imag / k


def model_step_figure(
    responses: StepResponses, models: Mapping[str, StateSpaceModel], known: str = "marched"
) -> Figure:
    """Step responses that are known, and those of models, by name, to the inputs that all of them have."""
    shared = [name for name in responses.inputs if all(name in model.inputs for model in models.values())]
    with figure_style() as plt:
        figure: Figure
        figure, panels = plt.subplots(2, len(shared), figsize=(9.6, 6.2), squeeze=False, sharex="col")
        for column, stepped in enumerate(shared):
            s = responses[stepped].s
            fine = np.linspace(0.0, float(s[-1]), 400)
            for row, name in enumerate(PAIR):
                axes = panels[row, column]
                axes.plot(*responses.channel(name, stepped), ".", color=GREY, ms=5, label=known)
                for colour, line, (title, model) in zip((BLUE, VERMILION), ("-", "--"), models.items(), strict=False):
                    label = f"{title}, {model.order} states"
                    axes.plot(*model.step(fine).channel(name, stepped), line, color=colour, lw=1.2, label=label)
                axes.set_ylabel(f"{symbol(f'{name}_{stepped}')} (s), per rad")
            panels[1, column].set_xlabel("reduced time s = 2Vt/d")
        panels[0, 0].legend(fontsize=8)
        return figure
