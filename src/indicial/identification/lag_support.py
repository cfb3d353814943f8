r"""Does a flight record support lag states? A test that does not need to know their rate, then the fit.

Without a lag (amplitudes a = 0) its rate b means nothing, so the usual tables for likelihood ratios do not hold. For
each b of a range the score test of a = 0 is exact to first order: with v the white residuals of the fit without lag,
S_b their sensitivities to the amplitudes and Q_b an orthonormal basis of what no other unknown explains of S_b,

    T(b) = |Q_b^T v|^2,      chi-squared with as many degrees of freedom as amplitudes.

The largest of all T(b) is compared with the largest of the same functions of white noise, drawn many times.
Source: Davies, Biometrika 74 (1987) 33, for the question; Hansen, Econometrica 64 (1996) 413, for the answer.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.flightsim.dynamics import RIGID_STATES
from indicial.identification.fit import OutputErrorFit
from indicial.identification.maximum_likelihood import Noise, Problem, fit_manoeuvres
from indicial.identification.problem import Manoeuvre, Parameter

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_EXPLAINED = 1e-8  # of a sensitivity's size: what is left below it, other unknowns explain
_SURE = 1.96
_LONGEST = 2.5  # of a step, over the time of the lag; at 2.79 the classical Runge-Kutta method grows


@dataclass(frozen=True)
class LagSupport:
    """What a record says of lag states.

    Parameters
    ----------
    without : OutputErrorFit
        The fit without lag.
    with_lag : OutputErrorFit or None
        The fit of amplitudes and rate, started at the rate that the test likes best; None where it did not converge.
    rate : str
    amplitudes : tuple of str
    rates : ndarray
        Rates looked at, shape (n,).
    statistic : ndarray
        T(b), shape (n,).
    limit : float
        What the largest T exceeds by chance in `level` of records without lag.
    level : float
    probability : float
        Of a largest T as large or larger, without lag.
    """

    without: OutputErrorFit
    with_lag: OutputErrorFit | None
    rate: str
    amplitudes: tuple[str, ...]
    rates: Array
    statistic: Array
    limit: float
    level: float
    probability: float

    @property
    def supported(self) -> bool:
        """Whether a lag is there, at `level`."""
        return self.probability < self.level

    @property
    def verdict(self) -> str:
        """In words."""
        if not self.supported:
            return (
                f"the record does not support a lag: probability {self.probability:.2g} of as much without one; keep "
                "the model without"
            )
        found = f"a lag is there: probability {self.probability:.2g} of as much without one"
        if self.with_lag is None:
            return f"{found}; the fit of its amplitude and rate does not converge"
        rate = self.with_lag[self.rate]
        if rate.value - _SURE * rate.standard_error <= 0.0:
            return (
                f"{found}; its rate {rate.value:.3g} +- {rate.standard_error:.2g} is not determined: of a and b the "
                "record knows a combination only, such as the derivative in alphadot, -a/b"
            )
        return f"{found}, of rate {rate.value:.3g} +- {rate.standard_error:.2g} per unit of 2Vt/c"

    def summary(self) -> str:
        """The verdict and what was fitted."""
        lines = [self.verdict]
        if self.supported and self.with_lag is not None:
            lines += [f"  {self.with_lag[name].summary()}" for name in (self.rate, *self.amplitudes)]
        return "\n".join(lines)

    def plot(self) -> Figure:
        """T over the rate, with what chance does."""
        from matplotlib.figure import Figure

        figure = Figure(figsize=(6.4, 4.0), layout="constrained")
        axes = figure.add_subplot()
        axes.semilogx(self.rates, self.statistic, "o-", label="record")
        axes.axhline(
            self.limit, color="0.4", ls="--", label=f"exceeded by {self.level:.0%} of records without lag, somewhere"
        )
        if self.with_lag is not None and self.supported:
            axes.axvline(self.with_lag[self.rate].value, color="C1", label="rate of the fit")
        axes.set_xlabel("rate b of the lag, per unit of s = 2Vt/c")
        axes.set_ylabel("score statistic T(b)")
        axes.set_ylim(bottom=0.0)
        axes.set_title("Does the record support a lag?")
        axes.legend()
        return figure


def lag_support(
    manoeuvres: Sequence[Manoeuvre],
    parameters: Sequence[Parameter],
    *,
    rate: str,
    amplitudes: Sequence[str],
    rates: ArrayLike,
    level: float = 0.05,
    draws: int = 20_000,
    seed: int = 0,
    threads: int | None = None,
) -> LagSupport:
    """Test records for lag states, and fit them.

    Parameters
    ----------
    manoeuvres : sequence of Manoeuvre
        Of a model with lag states, such as `flightsim.DeficiencyAerodynamics`; `rate` and `amplitudes` are among its
        free symbols, and not among what the manoeuvres know. Records start settled, or the lag states' start is free.
    parameters : sequence of Parameter
        What else is unknown. With ``Cm_alphadot`` among them the question is whether there is more than that.
    rate : str
        Symbol of b.
    amplitudes : sequence of str
        Symbols of a, in the units of the coefficient; without a lag all are 0.
    rates : array_like
        Rates b to look at, positive, shape (n,): from about the slowest motion's reduced frequency to ten times the
        fastest's.
    level : float
        Chance of finding a lag that is not there.
    draws, seed : int
        Of the distribution of the largest statistic.
    threads : int, optional
        As `fit_manoeuvres`.

    Raises
    ------
    InputError
        If a name is unknown or already known, rates are not positive or too quick for the manoeuvres' steps, or the
        lag has no effect of its own.
    DivergenceError
        If the fit without lag does not converge.
    """
    looked = np.atleast_1d(np.asarray(rates, dtype=float))
    _check(manoeuvres, parameters, rate, amplitudes, looked, level)
    held = [_holding_lags(m) for m in manoeuvres]
    silent = {**dict.fromkeys(amplitudes, 0.0), rate: float(looked[0])}
    without = fit_manoeuvres([_knowing(m, silent) for m in held], parameters, threads=threads)
    extra = [Parameter(name, 0.0) for name in amplitudes]
    bases, scores, sizes = [], [], []
    for value in looked:
        problem = Problem([_knowing(m, {rate: float(value)}) for m in held], [*parameters, *extra], threads)
        _check_steps(problem, rate, float(value))
        basis, white, size = _unexplained(problem, without, amplitudes)
        bases.append(basis)
        sizes.append(size)
        scores.append(float(np.sum((basis.T @ white) ** 2)))
    statistic = np.array(scores)
    largest = _largest_by_chance(bases, draws, seed)
    best = int(np.argmax(statistic))
    return LagSupport(
        without=without,
        with_lag=_fitted(manoeuvres, parameters, without, rate, float(looked[best]), sizes[best], threads),
        rate=rate,
        amplitudes=tuple(amplitudes),
        rates=looked,
        statistic=statistic,
        limit=float(np.quantile(largest, 1.0 - level)),
        level=level,
        probability=float((1 + np.count_nonzero(largest >= statistic[best])) / (1 + largest.size)),
    )


def _check(
    manoeuvres: Sequence[Manoeuvre],
    parameters: Sequence[Parameter],
    rate: str,
    amplitudes: Sequence[str],
    rates: Array,
    level: float,
) -> None:
    if not rates.size or not np.all(np.isfinite(rates)) or not np.all(rates > 0.0):
        raise InputError("rates to look at must be positive and finite")
    if not 0.0 < level < 1.0:
        raise InputError(f"level is {level}, must be between 0 and 1")
    if not amplitudes:
        raise InputError("a lag needs at least one amplitude")
    taken = {p.name for p in parameters}
    for name in (rate, *amplitudes):
        if name in taken or any(name in m.known for m in manoeuvres):
            raise InputError(f"{name} belongs to the lag: it can be neither a parameter nor known")
        if not any(name in m.model.parameter_names for m in manoeuvres):
            raise InputError(f"{name} is in no record's model")


def _check_steps(problem: Problem, rate: str, value: float) -> None:
    """Refuse steps that are too long for the lag, whose states would grow without bound and unseen."""
    first = len(RIGID_STATES)
    for record in problem.records:
        m = record.manoeuvre
        state, _ = m.start.state(m.start.unknowns)
        lags = m.model.dynamics.jacobian(state, record.values[: len(m.model.dynamics.parameter_names)])[first:, first:]
        step = float(np.max(np.diff(m.time) / m.substeps))
        fastest = float(np.max(np.abs(np.linalg.eigvals(lags))))
        if step * fastest > _LONGEST:
            raise InputError(
                f"{rate} = {value:g} is too quick for Runge-Kutta steps of {step:.3g} s in {m.name}: at least "
                f"{math.ceil(float(np.max(np.diff(m.time))) * fastest / _LONGEST)} steps an interval are needed"
            )


def _knowing(manoeuvre: Manoeuvre, values: dict[str, float]) -> Manoeuvre:
    here = {name: value for name, value in values.items() if name in manoeuvre.model.parameter_names}
    return replace(manoeuvre, known={**manoeuvre.known, **here})


def _holding_lags(manoeuvre: Manoeuvre) -> Manoeuvre:
    """Without unknown start values of lag states, which have no effect where there is no lag."""
    start = manoeuvre.start
    lags = manoeuvre.model.dynamics.state_names[len(RIGID_STATES) :]
    return replace(manoeuvre, start=replace(start, free=tuple(name for name in start.free if name not in lags)))


def _unexplained(
    problem: Problem, without: OutputErrorFit, amplitudes: Sequence[str]
) -> tuple[Array, Array, dict[str, float]]:
    """Basis of the amplitudes' effect that nothing else explains, white residuals, amplitudes to first order."""
    known = {e.name: e.value for e in (*without.parameters, *without.start_values)}
    at = np.array([known.get(name, 0.0) for name in problem.names])
    point = problem.look(at, None)
    if point is None:
        raise DivergenceError("the flight of the fit without lag is not finite from the start values found")
    slopes, white = problem.system(point, Noise(without.noise, without.memory))
    own = [problem.names.index(name) for name in amplitudes]
    others = np.delete(slopes, own, axis=1)
    left, singular, _ = np.linalg.svd(others / np.linalg.norm(others, axis=0), full_matrices=False)
    left = left[:, singular > 1e-12 * singular[0]]
    effect = slopes[:, own]
    alone = effect - left @ (left.T @ effect)
    size = np.linalg.norm(effect, axis=0)
    for name, whole, rest in zip(amplitudes, size, np.linalg.norm(alone, axis=0), strict=True):
        if rest <= _EXPLAINED * whole:
            raise InputError(f"{name} has no effect of its own on these records: leave it out, or give other flights")
    basis, triangle = np.linalg.qr(alone)
    estimate = np.linalg.solve(triangle, basis.T @ white)
    return basis, white, dict(zip(amplitudes, estimate.tolist(), strict=True))


def _largest_by_chance(bases: list[Array], draws: int, seed: int) -> Array:
    """Largest of all T(b) for white noise, drawn in the few dimensions that the bases span, shape (draws,)."""
    stacked = np.hstack(bases)
    triangle = np.asarray(np.linalg.qr(stacked, mode="r"))
    noise = np.random.default_rng(seed).standard_normal((draws, triangle.shape[0]))
    parts = (noise @ triangle).reshape(draws, len(bases), -1)
    largest: Array = np.max(np.sum(parts**2, axis=2), axis=1)
    return largest


def _fitted(
    manoeuvres: Sequence[Manoeuvre],
    parameters: Sequence[Parameter],
    without: OutputErrorFit,
    rate: str,
    at: float,
    amplitudes: dict[str, float],
    threads: int | None,
) -> OutputErrorFit | None:
    known = {e.name: e.value for e in without.parameters}
    start = [replace(p, start=known.get(p.name, p.start)) for p in parameters]
    lag = [Parameter(rate, at, positive=True), *(Parameter(n, v) for n, v in amplitudes.items())]
    try:
        return fit_manoeuvres(manoeuvres, [*start, *lag], threads=threads)
    except DivergenceError:
        return None
