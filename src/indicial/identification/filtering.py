r"""State and parameters from a record of a flight with process noise: extended and unscented filters, smoothed.

Unknown constants are states of the model that do not change (`state_model.Process`), so one filter estimates both.
Jazwinski, "Stochastic Processes and Filtering Theory" (1970), ch. 8; Julier & Uhlmann, Proc. IEEE 92 (2004) 401;
Bar-Shalom, Li & Kirubarajan, "Estimation with Applications to Tracking and Navigation" (2001), sec. 5.4 (consistency).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.flightsim.signals import Parameters, Schedule, Signal
from indicial.identification.channels import ANGLES
from indicial.identification.estimate import Estimate
from indicial.identification.kalman import Filtered, extended_filter, smoothed
from indicial.identification.record import FlightRecord
from indicial.identification.state_model import StateModel
from indicial.identification.unscented import unscented_filter

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STUCK = 10
"""Values of a channel from which on it must have more than one."""

LEVEL = 0.01
"""Probability at which a test of consistency is failed."""


@dataclass(frozen=True)
class Consistency:
    """Whether innovations are what the model says they are.

    Parameters
    ----------
    nis : float
        Normalised innovation squared, ``sum nu^T S^-1 nu``, over its degrees of freedom: 1 for a true model.
    nis_bounds : tuple of float
        Within which it is 95% of the time (chi-square).
    nis_probability : float
        Of a value so far out, on either side.
    whiteness : mapping of str to float
        Probability of so large correlations of each channel's innovations, were they white (Ljung-Box).
    lags : int
        Correlations that it takes in.
    """

    nis: float
    nis_bounds: tuple[float, float]
    nis_probability: float
    whiteness: Mapping[str, float]
    lags: int

    @property
    def consistent(self) -> bool:
        """Whether all pass, at a level of 1% over channels together."""
        white = all(p > LEVEL / len(self.whiteness) for p in self.whiteness.values())
        return white and self.nis_probability > LEVEL

    def summary(self) -> str:
        """Both tests."""
        low, high = self.nis_bounds
        white = ", ".join(f"{name} {p:.2g}" for name, p in self.whiteness.items())
        verdict = "consistent" if self.consistent else "not consistent"
        return (
            f"innovations {verdict}: NIS {self.nis:.3f} (95% within {low:.3f} to {high:.3f}); probability if white, "
            f"{self.lags} lags: {white}"
        )


@dataclass(frozen=True)
class FilterResult:
    """States over time with their covariance.

    Parameters
    ----------
    model : StateModel
    time : ndarray
        [s], shape (n,).
    made : Filtered
        States, covariances and innovations.
    method : {"extended", "unscented"}
    """

    model: StateModel
    time: Array
    made: Filtered
    method: str

    @property
    def filtered(self) -> Array:
        """States given the measurements up to each instant, SI units, shape (n, nx)."""
        return self.made.filtered

    @property
    def filtered_covariance(self) -> Array:
        """Shape (n, nx, nx)."""
        return self.made.filtered_covariance

    @property
    def innovations(self) -> Array:
        """Measured less predicted, NaN where missing, shape (n, nc)."""
        return self.made.innovations

    @property
    def standardised(self) -> Array:
        """Innovations made independent and of unit variance, in the order of channels, shape (n, nc)."""
        return self.made.standardised

    @property
    def log_likelihood(self) -> float:
        """Of the record given the model."""
        return self.made.log_likelihood

    @cached_property
    def smoothed(self) -> tuple[Array, Array]:
        """States (n, nx) and covariances (n, nx, nx) given the whole record, by Rauch, Tung and Striebel."""
        return smoothed(self.made)

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """Processes (unknown constants among them) at the end of the record."""
        errors = np.sqrt(np.diag(self.filtered_covariance[-1]))
        return tuple(
            Estimate(name, float(self.filtered[-1, i]), float(errors[i]))
            for i, name in enumerate(self.model.state_names)
            if i >= self.model.motion
        )

    def consistency(self, lags: int = 20) -> Consistency:
        """Test the innovations, each channel over its own instants.

        Raises
        ------
        InputError
            If no channel has values enough for so many lags.
        """
        from scipy.stats import chi2

        known = self.standardised[np.isfinite(self.standardised)]
        dof, total = known.size, float(known @ known)
        tail = float(min(chi2.cdf(total, dof), chi2.sf(total, dof)))
        bounds = (float(chi2.ppf(0.025, dof) / dof), float(chi2.ppf(0.975, dof) / dof))
        white: dict[str, float] = {}
        for i, name in enumerate(self.model.channels):
            z = self.standardised[:, i]
            z = z[np.isfinite(z)]
            if z.size > 2 * lags:
                correlation = np.array([z[k:] @ z[:-k] for k in range(1, lags + 1)]) / (z @ z)
                statistic = z.size * (z.size + 2) * np.sum(correlation**2 / (z.size - np.arange(1, lags + 1)))
                white[name] = float(chi2.sf(statistic, lags))
        if not white:
            raise InputError(f"no channel has more than {2 * lags} values: too few to test {lags} lags")
        return Consistency(total / dof, bounds, min(1.0, 2.0 * tail), white, lags)

    def summary(self) -> str:
        """Estimates and consistency."""
        lines = [f"{self.method} filter, {self.time.size} instants, log likelihood {self.log_likelihood:.2f}"]
        return "\n".join([*lines, *(e.summary() for e in self.estimates), self.consistency().summary()])

    def plot(self) -> Figure:
        """States over time with two standard deviations, filtered and smoothed; SI units."""
        import matplotlib.pyplot as plt

        names = self.model.state_names
        states, covariances = self.smoothed
        figure, axes = plt.subplots(
            len(names), 1, figsize=(8, 1.6 * len(names)), sharex=True, layout="constrained", squeeze=False
        )
        for i, (ax, name) in enumerate(zip(axes[:, 0], names, strict=True)):
            band = 2.0 * np.sqrt(np.maximum(covariances[:, i, i], 0.0))
            ax.plot(self.time, self.filtered[:, i], lw=0.7, label="filtered")
            ax.plot(self.time, states[:, i], label="smoothed")
            ax.fill_between(self.time, states[:, i] - band, states[:, i] + band, alpha=0.3)
            ax.set(ylabel=name)
        axes[0, 0].legend(fontsize="small")
        axes[-1, 0].set(xlabel="time [s]")
        return figure


@dataclass(frozen=True)
class FilterInput:
    """A record as filters take it.

    Parameters
    ----------
    model : StateModel
    time, parameters, measured : ndarray
        Shapes (n,), (n, np), (n, nc).
    variance : ndarray
        Of the noise of channels, shape (nc,).
    intensity : ndarray
        Square root of the noise density of states, shape (nx,).
    mean, errors : ndarray
        Of the state before the first measurement, shape (nx,).
    """

    model: StateModel
    time: Array
    parameters: Array
    measured: Array
    variance: Array
    intensity: Array
    mean: Array
    errors: Array

    @classmethod
    def of(
        cls,
        model: StateModel,
        record: FlightRecord,
        start: Mapping[str, float],
        start_errors: Mapping[str, float],
        known: Parameters,
    ) -> FilterInput:
        """Gather and check what `filter_record` says."""
        record.require(*model.channels)
        lacking = [name for name in model.channels if name not in record.standard_deviations]
        if lacking:
            raise InputError(f"the record gives no standard deviation of {', '.join(lacking)}")
        for name in model.channels:
            values = record[name][np.isfinite(record[name])]
            if values.size >= _STUCK and np.ptp(values) == 0.0:
                raise InputError(f"channel {name} does not change in {values.size} values: dead? leave it out")
        inputs = {n: Signal(record.time, v) for n, v in record.inputs.items() if n in model.parameter_names}
        values = Schedule.of(model.parameter_names, {**inputs, **known}).at(record.time).T
        mean, errors = _start(model, start, start_errors)
        return cls(
            model=model,
            time=np.ascontiguousarray(record.time),
            parameters=np.ascontiguousarray(values),
            measured=np.column_stack([record[name] for name in model.channels]),
            variance=np.array([record.standard_deviations[name] ** 2 for name in model.channels]),
            intensity=model.intensity,
            mean=mean,
            errors=errors,
        )

    def run(self, method: str = "extended") -> tuple[int, Filtered]:
        """Filter: the instant at which it broke down, or -1; and what it made."""
        made = Filtered.empty(self.time.size, self.mean.size, self.variance.size)
        turning = np.array([name in ANGLES for name in self.model.channels])
        given = (self.time, self.parameters, self.measured, turning, self.variance)
        gaussian = (self.mean, np.diag(self.errors**2))
        if method == "extended":
            step, view = self.model.step.code, self.model.view.code
            return extended_filter(step, view, *given, self.intensity, self.model.substeps, *gaussian, made), made
        return unscented_filter(self.model, *given, self.intensity, *gaussian, made), made


def filter_record(
    model: StateModel,
    record: FlightRecord,
    start: Mapping[str, float],
    start_errors: Mapping[str, float],
    *,
    known: Parameters | None = None,
    method: Literal["extended", "unscented"] = "extended",
) -> FilterResult:
    """Filter a record.

    Parameters
    ----------
    model : StateModel
    record : FlightRecord
        Must have the model's channels, and the standard deviations of their noise. Values may be missing (NaN).
    start : mapping of str to float
        Every state before the first measurement.
    start_errors : mapping of str to float
        Their standard errors, independent; 0 (known exactly) where not given.
    known : mapping of str to float or Signal, optional
        Parameters of the model that are not inputs of the record.
    method : {"extended", "unscented"}
        Unscented is filterpy's; every start error must then be positive.

    Raises
    ------
    InputError
        If something is missing or unknown, or a channel is dead.
    DivergenceError
        If the filter leaves the numbers, or a covariance is not positive any more.
    """
    if method not in ("extended", "unscented"):
        raise InputError(f"method is {method!r}, must be 'extended' or 'unscented'")
    given = FilterInput.of(model, record, start, start_errors, known or {})
    unsure = [name for name, e in zip(model.state_names, given.errors, strict=True) if e == 0.0]
    if method == "unscented" and unsure:
        raise InputError(f"the unscented filter needs a positive start error of {', '.join(unsure)}")
    broken, made = given.run(method)
    if broken >= 0:
        time = float(record.time[broken])
        raise DivergenceError(
            f"the {method} filter broke down at {time:.6g} s (a state not finite, or a variance not positive): start "
            "nearer to the flight with honest start errors, or take shorter steps (substeps)",
            time=time,
        )
    return FilterResult(model, record.time, made, method)


def _start(model: StateModel, start: Mapping[str, float], errors: Mapping[str, float]) -> tuple[Array, Array]:
    """State before the first measurement and its standard errors, shape (nx,)."""
    if set(start) != set(model.state_names) or not set(errors) <= set(start):
        raise InputError(
            f"start must name the states ({', '.join(model.state_names)}), not ({', '.join(start)}); its errors some"
        )
    mean = np.array([float(start[name]) for name in model.state_names])
    spread = np.array([float(errors.get(name, 0.0)) for name in model.state_names])
    if not (np.all(np.isfinite(mean)) and np.all(np.isfinite(spread)) and np.all(spread >= 0.0)):
        raise InputError("start must be finite, its errors finite and not negative")
    return mean, spread
