"""Equation error: a coefficient of the flight fitted by least squares of regressors, in time or in frequency."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array, ReferenceQuantities
from indicial.derivatives import DerivativeTable
from indicial.errors import InputError
from indicial.flightsim import Vehicle
from indicial.identification.coefficients import aerodynamic_coefficient, regressor
from indicial.identification.coloured import reflections, whiten
from indicial.identification.estimate import Estimate, identified_table
from indicial.identification.least_squares import check_regressors, coloured_covariance, solve, spectral_covariance
from indicial.identification.outliers import outlying
from indicial.identification.record import FlightRecord
from indicial.motion import FlightCondition

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Domain = Literal["time", "frequency"]

_MOST_LEFT_OUT = 0.1


@dataclass(frozen=True)
class EquationError:
    """A coefficient as a sum of regressors.

    Parameters
    ----------
    coefficient : str
    domain : {"time", "frequency"}
    estimates : tuple of Estimate
        ``Cm_alpha``, ...; in time also ``Cm_0``, the value where all regressors are 0. Standard errors hold for
        coloured residuals.
    covariance : ndarray
        Of the estimates, shape (p, p).
    axis : ndarray
        Time [s] or frequency [Hz] of the data used, shape (n,).
    measured, fitted : ndarray
        The coefficient, in frequency its finite Fourier transform (complex, [s]), shape (n,).
    neighbours : float
        Correlation of the residuals of neighbouring samples; in frequency NaN.
    mach : float or None
        Mean of the record, if it has it.
    reference : ReferenceQuantities
    left_out : ndarray
        Instants left out as outliers [s], shape (m,).
    outliers : int
        Residuals so large that one in a hundred fits would have one by chance; they are in the fit. In frequency 0.
    """

    coefficient: str
    domain: Domain
    estimates: tuple[Estimate, ...]
    covariance: Array
    axis: Array
    measured: Array
    fitted: Array
    neighbours: float
    mach: float | None
    reference: ReferenceQuantities
    left_out: Array = field(default_factory=lambda: np.zeros(0))
    outliers: int = 0

    def __getitem__(self, name: str) -> Estimate:
        """One estimate by name.

        Raises
        ------
        InputError
            If it was not estimated.
        """
        for estimate in self.estimates:
            if estimate.name == name:
                return estimate
        raise InputError(f"{name} was not estimated; estimated were {', '.join(e.name for e in self.estimates)}")

    @property
    def residuals(self) -> Array:
        """Measured less fitted, shape (n,)."""
        return self.measured - self.fitted

    @property
    def r_squared(self) -> float:
        """Part of the variance (in frequency: of the power in the band) that the regressors explain."""
        power = np.sum(np.abs(self.measured - (self.measured.mean() if self.domain == "time" else 0.0)) ** 2)
        return float(1.0 - np.sum(np.abs(self.residuals) ** 2) / power)

    @property
    def correlation(self) -> Array:
        """Correlations of the estimates, shape (p, p)."""
        errors = np.sqrt(np.diag(self.covariance))
        matrix: Array = self.covariance / np.outer(errors, errors)
        return matrix

    def table(self, condition: FlightCondition | None = None, source: str = "equation error") -> DerivativeTable:
        """The estimates as records of method ``identified``, at the mean Mach number of the record unless told.

        Raises
        ------
        InputError
            If the record has no Mach number and no condition is given.
        """
        if condition is None:
            if self.mach is None:
                raise InputError("the flight record has no channel mach: give the table a condition")
            condition = FlightCondition(self.mach)
        return identified_table(self.estimates, condition, self.reference, source)

    def summary(self) -> str:
        """Estimates with standard errors, how well they fit and how coloured the residuals are."""
        low, high = self.axis[[0, -1]]
        where = f"{low:.4g} to {high:.4g} {'s' if self.domain == 'time' else 'Hz'}"
        lines = [
            f"equation error of {self.coefficient} in {self.domain}, {self.axis.size} values from {where}, "
            f"R^2 = {self.r_squared:.4f}"
        ]
        lines += [f"  {estimate.summary()}" for estimate in self.estimates]
        if self.domain == "time":
            lines.append(f"  neighbouring residuals correlate by {self.neighbours:.2f}: standard errors allow for it")
        if self.left_out.size:
            lines.append(f"  {self.left_out.size} outliers left out, first at {self.left_out[0]:.4g} s")
        if self.outliers:
            lines.append(f"  {self.outliers} residuals look like outliers and are in the fit: leave_out_outliers?")
        return "\n".join(lines)

    def plot(self) -> Figure:
        """Measured and fitted coefficient, and residuals; of transforms the amplitudes."""
        import matplotlib.pyplot as plt

        figure, (top, bottom) = plt.subplots(2, 1, figsize=(9, 5), sharex=True, layout="constrained")
        shown = np.abs if self.domain == "frequency" else np.real
        top.plot(self.axis, shown(self.measured), ".", ms=3, label="measured")
        top.plot(self.axis, shown(self.fitted), label="fitted")
        bottom.plot(self.axis, shown(self.residuals), ".-", ms=3, lw=0.7)
        name = self.coefficient if self.domain == "time" else f"|{self.coefficient}| [s]"
        top.set(ylabel=name)
        bottom.set(ylabel="residual", xlabel="time [s]" if self.domain == "time" else "frequency [Hz]")
        top.legend()
        return figure


def equation_error(
    record: FlightRecord,
    vehicle: Vehicle,
    coefficient: str,
    regressors: Sequence[str],
    *,
    band: tuple[float, float] | None = None,
    thrust: ArrayLike = 0.0,
    leave_out_outliers: bool = False,
) -> EquationError:
    r"""Least squares of an aerodynamic coefficient on regressors.

    In time, ``C(t) = C_0 + sum C_x x(t) + v(t)``. With a band, the same equation of the finite Fourier transforms at
    those frequencies k/T, T the length of the record, that lie in it: ``C~(f) = sum C_x x~(f) + v~(f)``, constants and
    everything outside the band left out (Klein & Morelli, "Aircraft System Identification" (2006), sec. 5.2 and 7.2).
    Noise of regressors biases the estimates towards 0, in a band less than in time.

    Parameters
    ----------
    record : FlightRecord
        As `aerodynamic_coefficient` needs. In time, samples with a dropout in anything used are left out.
    vehicle : Vehicle
        With mass properties in numbers.
    coefficient : str
        One of CX CY CZ CA CN Cl Cm Cn.
    regressors : sequence of str
        As `regressor` reads them: ``alpha``, ``q`` (dimensionless), ``elevator``, ``alpha^2``, ``alpha*elevator``.
        None, in time: the coefficient is a constant.
    band : tuple of float, optional
        Lowest and highest frequency [Hz]; the record must be evenly sampled without dropouts.
    thrust : array_like
        Force along x through the centre of gravity, besides the aerodynamic one [N], scalar or (n,).
    leave_out_outliers : bool
        Whether samples whose white residual no Gaussian noise would leave are taken out and the rest is fitted again,
        until none is left; in time only. Outliers of regressors pull the fit to themselves and may hide: take them out
        of the record first (`diagnose`).

    Raises
    ------
    InputError
        If a name is not known, a channel is lacking or dead, a regressor does not change or depends on the others,
        there is too little data, or every tenth sample is an outlier.
    """
    response, columns = read_equation(record, vehicle, coefficient, regressors, thrust)
    known = np.isfinite(response) & np.all(np.isfinite(columns), axis=1)
    labels = [f"{coefficient}_{name}" for name in regressors]
    neighbours, outliers, left_out = float("nan"), 0, np.zeros(0)
    if band is None:
        axis, measured, columns = record.time[known], response[known], columns[known]
        _enough(axis.size, len(labels), "samples with all of its channels")
        check_regressors(regressors, columns)
        columns = np.column_stack([np.ones(axis.size), columns])
        labels = [f"{coefficient}_0", *labels]
        sound = _sound(columns, measured) if leave_out_outliers else np.ones(axis.size, dtype=bool)
        left_out, axis, columns, measured = axis[~sound], axis[sound], columns[sound], measured[sound]
        values, inverse = solve(columns, measured)
        fitted = columns @ values
        outliers = int(np.count_nonzero(_loud(measured - fitted)))
        covariance, correlation = coloured_covariance(columns, measured - fitted, inverse)
        neighbours = float(correlation[1])
    else:
        if leave_out_outliers:
            raise InputError("outliers can be left out in time only: a band needs every sample")
        if not regressors:
            raise InputError("equation error in a band needs at least one regressor: the constant is left out there")
        axis, measured, transforms = _transformed(record, response, columns, known, band, regressors)
        stacked = np.concatenate([transforms.real, transforms.imag])
        values, inverse = solve(stacked, np.concatenate([measured.real, measured.imag]))
        fitted = transforms @ values
        residuals = np.concatenate([(measured - fitted).real, (measured - fitted).imag])
        covariance = spectral_covariance(stacked, residuals, inverse)
    errors = np.sqrt(np.diag(covariance))
    estimates = tuple(Estimate(n, float(v), float(e)) for n, v, e in zip(labels, values, errors, strict=True))
    mach = float(np.nanmean(record["mach"])) if np.any(np.isfinite(record.channels.get("mach", np.nan))) else None
    domain: Domain = "time" if band is None else "frequency"
    return EquationError(
        *(coefficient, domain, estimates, covariance, axis, measured, fitted, neighbours, mach, vehicle.reference),
        *(left_out, outliers),
    )


def _sound(columns: Array, measured: Array) -> Any:
    """Samples that are no outliers of a fit to themselves, bool of shape (n,)."""
    sound = np.ones(measured.size, dtype=bool)
    while True:
        values, _ = solve(columns[sound], measured[sound])
        loud = _loud(measured[sound] - columns[sound] @ values)
        if not np.any(loud):
            return sound
        sound[np.flatnonzero(sound)[loud]] = False
        gone = np.count_nonzero(~sound)
        if gone > _MOST_LEFT_OUT * measured.size:
            raise InputError(
                f"{gone} of {measured.size} samples look like outliers: the model lacks something, or a channel is bad"
            )


def _loud(residuals: Array) -> Any:
    """Outliers among residuals, bool of shape (n,)."""
    memory = reflections([residuals])
    white = whiten(residuals, memory, np.ones(residuals.size, dtype=bool))
    return outlying(white, memory.size)


def read_equation(
    record: FlightRecord, vehicle: Vehicle, coefficient: str, regressors: Sequence[str], thrust: ArrayLike = 0.0
) -> tuple[Array, Array]:
    """The coefficient (n,) and its regressors (n, p) at every sample, NaN where unknown."""
    if len(set(regressors)) < len(regressors):
        raise InputError(f"regressors must be there once each, not {', '.join(regressors)}")
    response = aerodynamic_coefficient(record, vehicle, coefficient, thrust=thrust)
    known = response[np.isfinite(response)]
    if known.size and np.ptp(known) == 0.0:
        raise InputError(f"{coefficient} does not change in the record: is a channel of it dead?")
    columns = [regressor(record, name, vehicle.reference) for name in regressors]
    return response, np.stack(columns, axis=1) if columns else np.zeros((response.size, 0))


def _transformed(
    record: FlightRecord, response: Array, columns: Array, known: Array, band: tuple[float, float], names: Sequence[str]
) -> tuple[Any, Any, Any]:
    """Frequencies in the band [Hz], transforms of the coefficient (m,) and of the regressors (m, p) there."""
    low, high = band
    highest = 0.5 / record.interval
    if not 0.0 < low < high < highest:
        raise InputError(f"band {low:g} to {high:g} Hz must lie within 0 and {highest:g} Hz, half the sampling rate")
    if not record.evenly_sampled or not np.all(known):
        raise InputError("equation error in a band needs a record evenly sampled, without dropouts in what it uses")
    check_regressors(names, columns)
    frequencies = np.fft.rfftfreq(len(record), record.interval)
    chosen = (frequencies >= low * (1.0 - 1e-9)) & (frequencies <= high * (1.0 + 1e-9))
    _enough(int(np.count_nonzero(chosen)), len(names), f"frequencies k/T between {low:g} and {high:g} Hz")
    centred = np.column_stack([response, columns])
    transforms = record.interval * np.fft.rfft(centred - centred.mean(axis=0), axis=0)[chosen]
    return frequencies[chosen], transforms[:, 0], transforms[:, 1:]


def _enough(data: int, unknowns: int, what: str) -> None:
    if data < 2 * (unknowns + 1):
        raise InputError(f"equation error of {unknowns} regressors needs {2 * (unknowns + 1)} {what}, not {data}")
