"""What output error found in several records, with its accuracy, residuals and plots."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal, Protocol

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.identification.coloured import predictors
from indicial.identification.estimate import Estimate
from indicial.identification.outliers import outlier_limit, outlying, robust_scale
from indicial.identification.problem import Manoeuvre
from indicial.identification.record import shown_unit
from indicial.identification.unit_guess import guess_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SURE = 1.96  # standard errors of a 95% interval
_LOUD = 5.0  # times the stated noise, from which a channel is told to be suspicious
_UNSEEN = 0.5  # standard error over the larger of the two values, from which nothing is said of it


@dataclass(frozen=True)
class Verdict:
    """An estimate against a value known before, such as one of CFD.

    Parameters
    ----------
    estimate : Estimate
    before, before_error : float
        The value and its standard deviation.
    verdict : {"consistent", "shifted", "unidentifiable"}
        Within 1.96 standard deviations of both together; beyond; or too uncertain (standard error above half of the
        larger value) to tell.
    """

    estimate: Estimate
    before: float
    before_error: float
    verdict: Literal["consistent", "shifted", "unidentifiable"]

    def summary(self) -> str:
        """One line."""
        return f"{self.estimate.summary()}   before {self.before:.5g} +- {self.before_error:.2g}: {self.verdict}"


class Found(Protocol):
    """Estimates by name."""

    def __getitem__(self, name: str) -> Estimate: ...


def verdicts(found: Found, before: Mapping[str, float | tuple[float, float]]) -> tuple[Verdict, ...]:
    """Estimates against values known before: numbers, or pairs of value and standard deviation."""
    made = []
    for name, given in before.items():
        value, error = given if isinstance(given, tuple) else (given, 0.0)
        estimate = found[name]
        if estimate.standard_error > _UNSEEN * max(abs(estimate.value), abs(value)):
            word: Literal["consistent", "shifted", "unidentifiable"] = "unidentifiable"
        elif abs(estimate.value - value) <= _SURE * math.hypot(estimate.standard_error, error):
            word = "consistent"
        else:
            word = "shifted"
        made.append(Verdict(estimate, value, error, word))
    return tuple(made)


@dataclass(frozen=True)
class OutputErrorFit:
    """Unknowns of several records.

    Parameters
    ----------
    parameters, start_values : tuple of Estimate
    covariance : ndarray
        Of all, parameters first: the inverse information under the noise found, shape (n, n).
    findings : tuple of str
        What the records cannot tell, and which were flown in too long steps.
    noise : dict
        Of each channel: estimated over stated standard deviation.
    memory : dict
        Of each channel: reflection coefficients of its noise, none if white.
    manoeuvres : tuple of Manoeuvre
    residuals : tuple of ndarray
        Of each record: measured less fitted, NaN where nothing was measured, (n, n_channels).
    white : dict
        Of each channel: residuals of all records in standard deviations, made white.
    states : tuple of ndarray
        Of each record: fitted states (n, nx).
    starts : dict
        Where the parameters started.
    cost : tuple of float
        J after each step.
    """

    parameters: tuple[Estimate, ...]
    start_values: tuple[Estimate, ...]
    covariance: Array
    findings: tuple[str, ...]
    noise: dict[str, float]
    memory: dict[str, Array]
    manoeuvres: tuple[Manoeuvre, ...]
    residuals: tuple[Array, ...]
    white: dict[str, Array]
    states: tuple[Array, ...]
    starts: dict[str, float]
    cost: tuple[float, ...]

    def __getitem__(self, name: str) -> Estimate:
        """A parameter or start value by name.

        Raises
        ------
        InputError
            If it was not identified.
        """
        for estimate in (*self.parameters, *self.start_values):
            if estimate.name == name:
                return estimate
        raise InputError(f"{name} was not identified; identified were {', '.join(e.name for e in self.parameters)}")

    @property
    def correlation(self) -> Array:
        """Correlations of all unknowns, shape (n, n)."""
        errors = np.sqrt(np.diag(self.covariance))
        matrix: Array = self.covariance / np.outer(errors, errors)
        return matrix

    def suspicious(self) -> tuple[str, ...]:
        """What looks wrong with the records, in words: outliers, and channels that no model of this form fits.

        An outlier is a residual so large that one among all would be so by chance in a hundred fits; its size is
        counted in a standard deviation from the median, which outliers do not move. Noise of five times the stated and
        more is told, with the unit or sign that would explain it.
        """
        found = []
        limit = outlier_limit(sum(w.size for w in self.white.values()))
        for channel, white in self.white.items():
            scale = robust_scale(white)
            number = int(np.count_nonzero(np.abs(white) > limit * scale)) if scale > 0.0 else 0
            if number:
                worst = float(np.max(np.abs(white))) / scale
                found.append(f"channel {channel}: {number} suspicious residuals, up to {worst:.1f} standard deviations")
            if self.noise[channel] > _LOUD:
                guess = self._guess(channel)
                found.append(f"channel {channel}: residuals of {self.noise[channel]:.3g} times the stated noise{guess}")
        return tuple(found)

    def without_outliers(self) -> tuple[Manoeuvre, ...]:
        """The records without what `suspicious` calls outliers (NaN), to be fitted again.

        Of several within the memory of the channel's noise only the largest goes: see what the next fit says of others.
        """
        measured = [m.measured.copy() for m in self.manoeuvres]
        total = sum(w.size for w in self.white.values())
        for channel, white in self.white.items():
            reach, scale, first = self.memory[channel].size, robust_scale(white), 0
            for m, residuals, values in zip(self.manoeuvres, self.residuals, measured, strict=True):
                if channel not in m.model.channels:
                    continue
                i = m.model.channels.index(channel)
                known = np.flatnonzero(np.isfinite(residuals[:, i]))
                part = white[first : first + known.size]
                first += known.size
                values[known[outlying(part, reach, total, scale)], i] = np.nan
        return tuple(replace(m, measured=values) for m, values in zip(self.manoeuvres, measured, strict=True))

    def _guess(self, channel: str) -> str:
        """A unit or sign by which what was measured is a multiple of what was fitted."""
        measured, fitted = [], []
        for m, residuals in zip(self.manoeuvres, self.residuals, strict=True):
            if channel in m.model.channels:
                i = m.model.channels.index(channel)
                known = np.isfinite(residuals[:, i])
                measured.append(m.measured[known, i])
                fitted.append(m.measured[known, i] - residuals[known, i])
        seen, made = np.concatenate(measured), np.concatenate(fitted)
        slope = float(seen @ made) / float(made @ made) if np.any(made) else 1.0
        words = guess_unit(slope)
        if words is not None:
            return f": it is {slope:.3g} times what the model gives, so {words}?"
        return ": outliers, or a model that lacks something?"

    def against(self, before: Mapping[str, float | tuple[float, float]]) -> tuple[Verdict, ...]:
        """The parameters against values known before: numbers, or pairs of value and standard deviation."""
        return verdicts(self, before)

    def summary(self) -> str:
        """Parameters with standard errors, noise, and what the records cannot tell."""
        count = sum(int(np.count_nonzero(np.isfinite(r))) for r in self.residuals)
        records = f"{len(self.manoeuvres)} {'record' if len(self.manoeuvres) == 1 else 'records'}"
        lines = [f"output error: {records}, {count} measurements, {len(self.cost)} steps"]
        lines += [f"  {estimate.summary()}" for estimate in self.parameters]
        for channel, factor in self.noise.items():
            memory = self.memory[channel]
            colour = "white" if memory.size == 0 else f"autoregressive, {predictors(memory)[-1][0].round(3).tolist()}"
            lines.append(f"  noise of {channel}: {factor:.3g} of the stated, {colour}")
        return "\n".join([*lines, *(f"  {text}" for text in (*self.findings, *self.suspicious()))])

    def plot(self, record: int = 0) -> Figure:
        """Measured against fitted channels of one record."""
        import matplotlib.pyplot as plt

        m, residuals = self.manoeuvres[record], self.residuals[record]
        rows = len(m.model.channels)
        figure, axes = plt.subplots(
            rows, 2, figsize=(11, 1.0 + 1.6 * rows), sharex=True, layout="constrained", squeeze=False
        )
        for i, channel in enumerate(m.model.channels):
            unit, factor = shown_unit(channel)
            measured = factor * m.measured[:, i]
            axes[i, 0].plot(m.time, measured, ".", ms=2, label="measured")
            axes[i, 0].plot(m.time, measured - factor * residuals[:, i], label="fitted")
            axes[i, 0].set(ylabel=f"{channel} [{unit}]" if unit else channel)
            sd = m.standard_deviations[i] * self.noise[channel]
            axes[i, 1].plot(m.time, residuals[:, i] / sd, ".", ms=2)
        axes[0, 0].legend(fontsize="small")
        axes[0, 1].set(title="residual [standard deviations]")
        for ax in axes[-1]:
            ax.set(xlabel="time [s]")
        return figure
