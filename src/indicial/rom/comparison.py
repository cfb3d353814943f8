r"""All realisations of the same data side by side, judged by motions that none of them has seen.

Everything starts from step responses. What another realisation reads is made from them by superposition (Eq. 13),
which is exact, unless it is given: a frequency response for vector fitting, a history of a general motion for OKID.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from indicial.conventions import COEFFICIENTS, Array, time_from_reduced, velocity_from_angles
from indicial.errors import DivergenceError, InputError
from indicial.frequency import FrequencyResponse
from indicial.history import History
from indicial.motion import TabulatedMotion
from indicial.rom.balancing import METHOD as BALANCED
from indicial.rom.balancing import hankel_values, truncate
from indicial.rom.check import PredictionCheck, check_prediction
from indicial.rom.convolution import ConvolutionModel
from indicial.rom.era import settling_time
from indicial.rom.identification import METHOD as IDENTIFIED
from indicial.rom.identification import identify
from indicial.rom.projection import project
from indicial.rom.realisation import channel_errors, realise
from indicial.rom.response import StepResponses
from indicial.rom.signals import rate_factor
from indicial.rom.state_space import StateSpaceModel
from indicial.solver import LinearisedFlow

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ENOUGH = 1.25
_NOISE_SAMPLES, _NOISE_STEPS = 600, 60  # of the made motion: in all, and until a step response has settled
_NOISE_ANGLE, _NOISE_MEMORY = 2e-3, 0.8
_BAND = (0.08, 40.0)  # reduced frequencies of the made frequency response, times the settling time
_FREQUENCIES = 40


@dataclass(frozen=True)
class Compared:
    """One realisation.

    Parameters
    ----------
    method : str
    model : StateSpaceModel
        Its order chosen by held-out error.
    residual : float
        Largest error of its step responses, relative to the peak of the channel.
    checks : tuple of PredictionCheck
        Its predictions of the motions not seen.
    """

    method: str
    model: StateSpaceModel
    residual: float
    checks: tuple[PredictionCheck, ...]

    @property
    def error(self) -> float:
        """Largest error over the motions not seen, relative to the largest unsteady load."""
        return max(check.worst_peak for check in self.checks)


@dataclass(frozen=True)
class Comparison:
    """Realisations of the same step responses.

    Parameters
    ----------
    data : StepResponses
    rows : tuple of Compared
    refused : dict
        Realisations that could not be made, with the reason.
    """

    data: StepResponses
    rows: tuple[Compared, ...]
    refused: dict[str, str] = field(default_factory=dict)

    def __getitem__(self, method: str) -> Compared:
        """One realisation by name."""
        for row in self.rows:
            if row.method == method:
                return row
        raise InputError(f"{method!r} was not compared; there are {', '.join(row.method for row in self.rows)}")

    @property
    def best(self) -> Compared:
        """The fewest states of those within a quarter of the least error on motions not seen."""
        enough = _ENOUGH * min(row.error for row in self.rows)
        return min((row for row in self.rows if row.error <= enough), key=lambda row: (row.model.order, row.error))

    def summary(self) -> str:
        """A table: states, error of the step responses, error on motions not seen."""
        count = len(self.rows[0].checks)
        lines = [
            f"realisations at M {self.data.condition.mach:g}, errors relative to the peak load; "
            f"{count} {'motion' if count == 1 else 'motions'} not seen",
            f"  {'method':<26} {'states':>6} {'fit of steps':>13} {'not seen':>10}",
        ]
        lines += [
            f"  {row.method:<26} {row.model.order:>6} {row.residual:>13.3%} {row.error:>10.3%}"
            f"{'  <- best' if row is self.best else ''}"
            for row in self.rows
        ]
        lines += [f"  {method}: refused, {reason}" for method, reason in self.refused.items()]
        return "\n".join(lines)

    def plot(self) -> Figure:
        """Poles, Hankel singular values, residuals of the step responses, and errors against numbers of states."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(2, 2, figsize=(10.0, 7.5), layout="constrained")
        for i, row in enumerate(self.rows):
            style = {"color": f"C{i}", "label": row.method}
            poles, values = row.model.poles, hankel_values(row.model)
            axes[0, 0].plot(poles.real, poles.imag, "osv^Dx+*"[i % 8], fillstyle="none", **style)
            axes[0, 1].semilogy(np.arange(1, values.size + 1), values, ".-", **style)
            self._draw_residual(axes[1, 0], row, **style)
            axes[1, 1].semilogy(row.model.order, row.error, "osv^Dx+*"[i % 8], **style)
        labels = {
            (0, 0): ("real part of pole, per 2V/c", "imaginary part"),
            (0, 1): ("state", "Hankel singular value"),
            (1, 0): ("reduced time s = 2Vt/c", "error of step responses / peak"),
            (1, 1): ("number of states", "error on motions not seen / peak load"),
        }
        for place, (across, up) in labels.items():
            axes[place].set_xlabel(across)
            axes[place].set_ylabel(up)
        axes[0, 0].legend(fontsize="small")
        return figure

    def _draw_residual(self, axes: Axes, row: Compared, color: str, label: str) -> None:
        """Largest error over the outputs, for each input."""
        for number, response in enumerate(self.data.responses):
            found = row.model.step(response.s)[response.input].values
            peak = np.maximum(np.max(np.abs(response.values), axis=0), 1e-300)
            wrong = np.max(np.abs(found - response.values) / peak, axis=1)
            axes.semilogy(response.s[1:], np.maximum(wrong[1:], 1e-9), ["-", "--", ":", "-."][number % 4], color=color)


def compare(
    data: StepResponses,
    unseen: Sequence[History],
    *,
    response: FrequencyResponse | None = None,
    motions: Sequence[History] = (),
    flow: LinearisedFlow | None = None,
    k_max: float | None = None,
    max_order: int = 6,
) -> Comparison:
    """Every realisation of `data`, its order chosen by held-out error, and its error on motions not seen.

    Parameters
    ----------
    data : StepResponses
    unseen : sequence of History
        Motions that no model is made from: oscillations at other k, multisines, chirps.
    response : FrequencyResponse, optional
        For vector fitting; that of `data` if not given.
    motions : sequence of History
        For OKID; if there are none, the loads that `data` give under low-passed noise.
    flow : LinearisedFlow, optional
        To be projected, if given, with `k_max`.
    k_max : float, optional
        Highest reduced frequency that matters to balanced truncation and projection; 3 over the settling time if not
        given.
    max_order : int
        Most poles for each input.

    Raises
    ------
    InputError
        If no motion is given to judge by, or a model cannot follow one.
    """
    if not unseen:
        raise InputError("no motion to judge by: give histories that no model is made from")
    settled = max(settling_time(r.s, r.deficiency) for r in data.responses)
    band = 3.0 / settled if k_max is None else k_max
    makers = _makers(data, response, motions, flow, settled, band, max_order)
    rows, refused = [], {}
    for method, make in makers.items():
        try:
            model = make()
        except (InputError, DivergenceError) as error:
            refused[method] = str(error)
            continue
        residual = max(error.peak for error in channel_errors(model, data))
        rows.append(Compared(method, model, residual, tuple(check_prediction(model, history) for history in unseen)))
    if not rows:
        raise InputError("; ".join(f"{method}: {reason}" for method, reason in refused.items()))
    return Comparison(data, tuple(rows), refused)


def _makers(
    data: StepResponses,
    response: FrequencyResponse | None,
    motions: Sequence[History],
    flow: LinearisedFlow | None,
    settled: float,
    k_max: float,
    max_order: int,
) -> dict[str, Callable[[], StateSpaceModel]]:
    """How each model is made."""

    def fitted() -> StateSpaceModel:
        k = np.geomspace(_BAND[0], _BAND[1], _FREQUENCIES) / settled
        given = response if response is not None else frequency_response(data, k)
        return realise(given, "vector fitting", outputs=data.outputs, max_order=max_order)

    def identified() -> StateSpaceModel:
        if motions:
            return identify(motions, data.inputs, data.outputs, direct=data.initial)
        noise = noise_history(data, settled / _NOISE_STEPS)
        return identify([noise], data.inputs, data.outputs, direct=data.initial, substeps=1)

    def truncated() -> StateSpaceModel:
        full = realise(data, "modal", max_order)
        # to leave states out shall cost no more than the fit did
        return truncate(full, tolerance=max(error.peak for error in full.errors), k_max=k_max).model

    makers = {
        "exponential": lambda: realise(data, "exponential", max_order=max_order),
        "exponential, shared poles": lambda: realise(data, "exponential", poles="shared", max_order=max_order),
        "modal": lambda: realise(data, "modal", max_order=max_order),
        "modal, shared poles": lambda: realise(data, "modal", poles="shared", max_order=max_order),
        "era": lambda: realise(data, "era", max_order=max_order),
        "vector fitting": fitted,
        IDENTIFIED: identified,
        BALANCED: truncated,
    }
    if flow is not None:
        makers["projection"] = lambda: project(flow, k_max).model
    return makers


def frequency_response(data: StepResponses, k: Array) -> FrequencyResponse:
    """H(ik) of step responses, exact for their interpolation in time (`ConvolutionModel`)."""
    model = ConvolutionModel(data)
    rows = [COEFFICIENTS.index(name) for name in data.outputs]
    refused = data.without_limit()
    slope = model.rate_gain.copy()
    for i, output in enumerate(data.outputs):
        for j, name in enumerate(data.inputs):
            if f"{output}_{name}dot" in refused:
                slope[i, j] = np.nan

    def full(part: Array) -> Array:
        six = np.zeros((6, len(data.inputs)))
        six[rows] = part
        return six

    values = np.zeros((k.size, 6, len(data.inputs)), dtype=np.complex128)
    values[:, rows] = model.frequency_response(k)
    return FrequencyResponse(
        k, data.inputs, values, full(model.static_gain), full(slope), full(data.initial),
        data.baseline, data.condition, data.reference, provenance={"source": "step responses"},
    )  # fmt: skip


def noise_history(data: StepResponses, step: float, seed: int = 0) -> History:
    """Loads under low-passed noise in every input, linear between samples `step` apart, by convolution.

    Raises
    ------
    InputError
        If there are inputs other than alpha and the rates.
    """
    if "beta" in data.inputs:
        raise InputError("noise in beta is not made; give motions")
    rng = np.random.default_rng(seed)
    noise = np.zeros((_NOISE_SAMPLES, len(data.inputs)))
    for i in range(1, _NOISE_SAMPLES):
        noise[i] = _NOISE_MEMORY * noise[i - 1] + _NOISE_ANGLE * rng.normal(size=len(data.inputs))
    condition, reference = data.condition, data.reference
    times = np.asarray(time_from_reduced(step * np.arange(_NOISE_SAMPLES), condition.speed, reference.length))
    alpha, rate = np.full(_NOISE_SAMPLES, condition.alpha), np.zeros((_NOISE_SAMPLES, 3))
    for j, name in enumerate(data.inputs):
        if name == "alpha":
            alpha = alpha + noise[:, j]
        else:
            rate[:, "pqr".index(name)] = noise[:, j] / rate_factor(name, condition.speed, reference)
    velocity = np.array([velocity_from_angles(condition.speed, float(a), condition.beta) for a in alpha])
    return ConvolutionModel(data).predict(TabulatedMotion(times, velocity, rate), times, substeps=1)
