"""What filter error found in several records, with its accuracy, residuals and plots."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.identification.estimate import Estimate
from indicial.identification.filtering import FilterResult
from indicial.identification.fit import Verdict, verdicts

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class FilterErrorFit:
    """Unknowns of several records with process noise.

    Parameters
    ----------
    estimates : tuple of Estimate
        Parameters, ``intensity_STATE``, ``noise_CHANNEL``, ``start_STATE``.
    covariance : ndarray
        Of all, in their order: the inverse information, shape (n, n).
    findings : tuple of str
        What the records cannot tell.
    filters : tuple of FilterResult
        Of each record, at the estimate; their `smoothed` are the states.
    measured : tuple of ndarray
        Of each record, NaN where nothing was measured, shape (n_times, n_channels).
    starts : mapping
        Where the parameters started.
    cost : tuple of float
        J after each step.
    """

    estimates: tuple[Estimate, ...]
    covariance: Array
    findings: tuple[str, ...]
    filters: tuple[FilterResult, ...]
    measured: tuple[Array, ...]
    starts: Mapping[str, float]
    cost: tuple[float, ...]

    def __getitem__(self, name: str) -> Estimate:
        """An estimate by name.

        Raises
        ------
        InputError
            If it was not identified.
        """
        for estimate in self.estimates:
            if estimate.name == name:
                return estimate
        raise InputError(f"{name} was not identified; identified were {', '.join(e.name for e in self.estimates)}")

    @property
    def log_likelihood(self) -> float:
        """Of all records at the estimate."""
        return sum(f.log_likelihood for f in self.filters)

    @property
    def correlation(self) -> Array:
        """Correlations of all unknowns, shape (n, n)."""
        errors = np.sqrt(np.diag(self.covariance))
        matrix: Array = self.covariance / np.outer(errors, errors)
        return matrix

    def against(self, before: Mapping[str, float | tuple[float, float]]) -> tuple[Verdict, ...]:
        """Estimates against values known before: numbers, or pairs of value and standard deviation."""
        return verdicts(self, before)

    def summary(self) -> str:
        """Estimates with standard errors, what the records cannot tell, and whether innovations are white."""
        count = sum(int(np.count_nonzero(np.isfinite(m))) for m in self.measured)
        records = f"{len(self.measured)} {'record' if len(self.measured) == 1 else 'records'}"
        lines = [f"filter error: {records}, {count} measurements, {len(self.cost)} steps"]
        lines += [f"  {e.summary()}" for e in self.estimates]
        lines += [f"  {text}" for text in self.findings]
        return "\n".join([*lines, *(f"  record {k}: {f.consistency().summary()}" for k, f in enumerate(self.filters))])

    def plot(self, record: int = 0) -> Figure:
        """Measured channels of one record against what was predicted from one instant to the next; innovations."""
        import matplotlib.pyplot as plt

        found, measured = self.filters[record], self.measured[record]
        rows = len(found.model.channels)
        figure, axes = plt.subplots(
            rows, 2, figsize=(11, 1.0 + 1.6 * rows), sharex=True, layout="constrained", squeeze=False
        )
        for i, channel in enumerate(found.model.channels):
            axes[i, 0].plot(found.time, measured[:, i], ".", ms=2, label="measured")
            axes[i, 0].plot(found.time, measured[:, i] - found.innovations[:, i], label="predicted")
            axes[i, 0].set(ylabel=channel)
            axes[i, 1].plot(found.time, found.standardised[:, i], ".", ms=2)
        axes[0, 0].legend(fontsize="small")
        axes[0, 1].set(title="innovation [standard deviations]")
        for ax in axes[-1]:
            ax.set(xlabel="time [s]")
        return figure
