r"""Deficiency functions of step responses and their integral, by the tail that is really there.

A step response tends to its final value with a deficiency ``F(s) = C(inf) - C(s)`` (Eqs. 14, 15), and
``C_jad = - integral_0^inf F_ja ds`` per ``alphadot c/2U``, s = 2Ut/c (Eq. 17). The integral exists only if F
falls faster than 1/s. In two-dimensional subsonic flow the lift's does not; in supersonic flow it settles in finite
time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator
from scipy.optimize import least_squares

from indicial.conventions import Array
from indicial.errors import InputError, NoLimitError

Tail = Literal["none", "finite", "exponential", "algebraic", "slow", "irregular"]

NO_LIMIT_EXPONENT = 1.5
"""F ~ 1/s^n is taken to have no integral below this n, half-way between the wakes of two-dimensional flow (1/s, which
reads as n = 1.0 to 1.4 over the decades that a record holds) and of a finite wing (1/s^2 or faster)."""

EXPONENTIAL_EXPONENT = 10.0
"""Above this fitted n a tail is called exponential."""

QUIET = 4.0
"""F counts as settled within this many times the noise."""

WINDOW = 12.0
"""The tail is judged from where F last was this many times its level at the end."""

SLOW_OCTAVE = 0.03
"""A tail without a limit is let pass, with its error bar, if one more octave of s would add less than this."""

MISMATCH = 0.01
"""A response may level off this much away from the final value given, of the largest F. Its own level is used then, and
the difference, times `cut`, is in the error bar."""

MISSING = 0.3
"""At most this part of the integral may be extrapolated beyond the record."""


@dataclass(frozen=True)
class DeficiencyIntegral:
    """``integral_0^inf F ds`` of one coefficient, and how far to trust it.

    Parameters
    ----------
    value : float
        The integral, `remainder` included; ``C_jad = -value`` per ``alphadot c/2U``.
    uncertainty : float
        Error bar from quadrature, final value and the tail beyond the record.
    remainder : float
        The part of `value` beyond `cut`, from the tail's own law.
    cut : float
        Reduced time up to which the samples were integrated: where F went quiet, or the end of the record.
    final : float
        C(inf) that was used.
    tail : str
        ``none`` (no deficiency above the noise), ``finite`` (settles in finite time), ``exponential``, ``algebraic``,
        ``slow`` (too slow for a limit, but too small to matter), ``irregular`` (an oscillation).
    exponent : float or None
        n of ``F ~ 1/s^n`` for an algebraic or slow tail.
    settled : bool
        Whether F fell into the noise within the record.
    noise : float
        Noise of the response, in its own units.
    reason : str
        What was found, in words.
    """

    value: float
    uncertainty: float
    remainder: float
    cut: float
    final: float
    tail: Tail
    exponent: float | None
    settled: bool
    noise: float
    reason: str

    @property
    def incidence_rate_derivative(self) -> float:
        """``C_jad = -value`` (Eq. 17) per ``alphadot c/2U``."""
        return -self.value

    def summary(self) -> str:
        """One line."""
        return f"integral of F = {self.value:.6g} +- {self.uncertainty:.2g}: {self.reason}"


def deficiency(response: ArrayLike, final: float) -> Array:
    """``F = C(inf) - C(s)`` (Eqs. 14, 15)."""
    return final - np.asarray(response, dtype=float)


def running_integral(s: ArrayLike, values: ArrayLike) -> Array:
    """``integral_0^s F`` at every sample, shape (n,), by monotone cubics (no overshoot at kinks)."""
    at = np.asarray(s, dtype=float)
    integral: Array = PchipInterpolator(at, np.asarray(values, dtype=float)).antiderivative()(at)
    return integral


def quasi_steady(
    alpha_change: ArrayLike,
    alpha_rate: ArrayLike,
    pitch_rate: ArrayLike,
    *,
    initial: float,
    alpha_final: float,
    q_final: float,
    integral: ArrayLike,
) -> Array:
    """Loads of a slow motion (Eq. 16).

    ``C_j = C_j(0) + C_ja(inf) [alpha - alpha(0)] + C_jq(inf) q - [integral_0^s F_ja] alphadot``

    Parameters
    ----------
    alpha_change : array_like
        alpha - alpha(0) [rad].
    alpha_rate, pitch_rate : array_like
        ``alphadot c/2U`` and ``q c/2U``.
    initial, alpha_final, q_final : float
        C_j(0), C_ja(inf), C_jq(inf).
    integral : array_like
        ``integral_0^s F_ja ds``: of `running_integral`, or its limit.
    """
    steady = initial + alpha_final * np.asarray(alpha_change, dtype=float)
    lag = np.asarray(integral, dtype=float) * np.asarray(alpha_rate, dtype=float)
    loads: Array = steady + q_final * np.asarray(pitch_rate, dtype=float) - lag
    return loads


def deficiency_integral(
    s: ArrayLike,
    response: ArrayLike,
    final: float | None = None,
    *,
    noise: float = 1e-4,
    final_uncertainty: float = 0.0,
    name: str = "response",
) -> DeficiencyIntegral:
    r"""Integral of the deficiency of one step response, or the reason why there is none.

    The samples are integrated up to where F goes quiet (or the record ends). Before that, over about the last decade
    of F, ``F = F0 (1 + xi (s - s0)/sigma)^(-1/xi)`` is fitted: its xi tells a tail that ends in finite time (xi < 0),
    an exponential (0), and ``1/s^n`` with n = 1/xi, whose integral has no limit for xi >= 1; the same law gives the
    remainder ``sigma F/(1 - xi)`` beyond. The fit is repeated on the later half of the window; twice the
    change is in the error bar. Where F follows no such law, as in an oscillation, no remainder is added and the error
    bar is that of an envelope that goes on falling at the window's rate.

    Parameters
    ----------
    s : array_like
        Reduced time, increasing from 0 (= 0+), shape (n,).
    response : array_like
        C(s) per unit step, shape (n,).
    final : float, optional
        C(inf), from a steady solution of the same solver after the step (see `MISMATCH`). Without it, it is estimated
        with the tail's law, which needs a record that has all but settled.
    noise : float
        What is not resolved in the response, of the largest |F|. Scatter in the record counts if it is larger.
    final_uncertainty : float
        Standard error of `final`; times `cut`, it enters the error bar.
    name : str
        For messages.

    Raises
    ------
    NoLimitError
        If F falls no faster than about 1/s, so that the integral has no limit.
    InputError
        If the record is unusable, ends before its tail can be judged, or levels off away from `final`.
    """
    at, values = _checked(s, response, name)
    scatter = _scatter(at, values)
    if final is None:
        guess = float(np.median(values[at >= 0.9 * at[-1]]))
    else:
        mismatch = _mismatch(at, final - values, max(noise * float(np.max(np.abs(final - values))), scatter), name)
        guess, final_uncertainty = final - mismatch, math.hypot(final_uncertainty, mismatch)
    for _ in range(12):
        f = guess - values
        scale = float(np.max(np.abs(f)))
        nu = max(noise * scale, scatter)
        if scale <= QUIET * nu:
            return _no_deficiency(at, f, guess, nu, final_uncertainty)
        tail = _judge(at, f, nu, free=final is None, name=name)
        shift, guess = tail.shift, guess + tail.shift
        if abs(shift) <= 0.05 * nu:
            break
    return _integrate(at, guess - values, guess, nu, tail, final_uncertainty, name, free=final is None)


def _checked(s: ArrayLike, response: ArrayLike, name: str) -> tuple[Array, Array]:
    at, values = np.asarray(s, dtype=float), np.asarray(response, dtype=float)
    if at.ndim != 1 or at.shape != values.shape or at.size < 12:
        raise InputError(f"{name}: a step response needs at least 12 samples and as many reduced times")
    if at[0] != 0.0 or not np.all(np.diff(at) > 0.0):
        raise InputError(f"{name}: reduced time must increase strictly from 0")
    if not (np.all(np.isfinite(at)) and np.all(np.isfinite(values))):
        raise InputError(f"{name}: the step response holds values that are not finite")
    return at, values


def _scatter(s: Array, values: Array) -> float:
    """Standard deviation of independent noise: late samples against the chord of their neighbours."""
    weight = (s[1:-1] - s[:-2]) / (s[2:] - s[:-2])
    off = values[1:-1] - (1.0 - weight) * values[:-2] - weight * values[2:]
    off /= np.sqrt(1.0 + weight**2 + (1.0 - weight) ** 2)
    return float(np.median(np.abs(off[-max(6, off.size // 3) :]))) / 0.6745


@dataclass(frozen=True)
class _TailLaw:
    """``F0 (1 + xi (s - start)/sigma)^(-1/xi)`` for s >= start; `shift` is what the fit adds to the final value."""

    start: float
    initial: float
    sigma: float
    xi: float
    shift: float = 0.0

    def base(self, s: ArrayLike) -> Array:
        grown: Array = np.maximum(1.0 + self.xi * (np.asarray(s, dtype=float) - self.start) / self.sigma, 0.0)
        return grown

    def __call__(self, s: ArrayLike) -> Array:
        if abs(self.xi) < 1e-6:
            decayed: Array = np.exp(-(np.asarray(s, dtype=float) - self.start) / self.sigma)
        else:
            with np.errstate(divide="ignore"):
                decayed = np.where(self.base(s) > 0.0, self.base(s) ** (-1.0 / self.xi), 0.0)
        return self.initial * decayed

    def beyond(self, s: float) -> float:
        """Integral from s to infinity, for xi < 1."""
        return float(self(s) * (self.sigma + self.xi * (s - self.start)) / (1.0 - self.xi)) if self.base(s) > 0 else 0.0

    def between(self, low: float, high: float) -> float:
        """Integral from low to high, any xi."""
        nodes = np.geomspace(max(low, 1e-12), high, 201)
        return float(np.trapezoid(self(nodes) * nodes, np.log(nodes)))


@dataclass(frozen=True)
class _Judged:
    """A fitted tail (none if irregular), where the samples stop counting, and the level there."""

    law: _TailLaw | None
    error: Callable[[float], float]
    cut: float
    start: float
    level: float
    settled: bool
    shift: float
    abrupt: bool = False


def _judge(s: Array, f: Array, nu: float, *, free: bool, name: str) -> _Judged:
    last = float(np.max(np.abs(f[s >= 0.9 * s[-1]])))
    settled = last <= QUIET * nu
    level = max(QUIET * nu, last)
    end = _last_above(f, level) + 1 if settled else s.size - 1
    end = min(max(end, 1), s.size - 1)
    first = max(_last_above(f, WINDOW * level), 0)
    window = slice(first, s.size if free else end + 1)
    if end - first < 5:
        if not settled:
            raise InputError(f"{name}: too few samples ({end - first + 1}) in the tail to judge it: use smaller steps")
        return _Judged(None, lambda _: 0.0, float(s[end]), float(s[first]), level, settled, 0.0, abrupt=True)
    law, error = _fit(s[window], f[window], nu, free)
    off = float(np.sqrt(np.mean((f[window] + law.shift - law(s[window])) ** 2)))
    if off > max(3.0 * nu, 0.1 * abs(law.initial)):
        return _Judged(None, lambda _: 0.0, float(s[end]), float(s[first]), level, settled, 0.0)
    return _Judged(law, error, float(s[end]), float(s[first]), level, settled, law.shift)


def _last_above(f: Array, level: float) -> int:
    above = np.flatnonzero(np.abs(f) > level)
    return int(above[-1]) if above.size else -1


def _mismatch(s: Array, f: Array, nu: float, name: str) -> float:
    """How far off its given final value the response levels out; 0 while it still falls, or within the noise."""
    curve, quarter = PchipInterpolator(s, f), 0.25 * float(s[-1])
    third, fourth = (float(curve.integrate(i * quarter, (i + 1) * quarter)) / quarter for i in (2, 3))
    if abs(fourth) <= QUIET * nu or abs(third - fourth) > 0.1 * abs(fourth):
        return 0.0
    if abs(fourth) > MISMATCH * float(np.max(np.abs(f))):
        raise InputError(
            f"{name}: the response levels off {fourth:.3g} away from its final value over the last half of the record: "
            f"give the final value of the same solver and step, or run far beyond s = {s[-1]:.4g}"
        )
    return fourth


def _fit(s: Array, f: Array, nu: float, free: bool) -> tuple[_TailLaw, Callable[[float], float]]:
    """Least squares of the tail's law; also the error of its integral beyond a given s."""
    weight = 1.0 / np.hypot(nu, 0.02 * np.abs(f))  # noise, and two per cent for a law that is not exact

    def law(parameters: Array, start: float = float(s[0])) -> _TailLaw:
        shift = float(parameters[3]) * nu if free else 0.0
        return _TailLaw(start, float(parameters[0]) * f0, math.exp(parameters[1]), float(parameters[2]), shift)

    f0 = float(f[0]) if f[0] != 0.0 else nu
    lower = [0.1, math.log((s[-1] - s[0]) * 1e-3), -1.0] + ([-np.inf] if free else [])
    upper = [10.0, math.log((s[-1] - s[0]) * 1e3), 5.0] + ([np.inf] if free else [])

    def solve(part: slice) -> tuple[Array, Array]:
        best = None
        for xi in (0.0, 0.8):
            start = np.array([1.0, math.log((s[-1] - s[0]) / 3.0), xi] + ([0.0] if free else []))
            found = least_squares(
                lambda p: ((f + law(p).shift - law(p)(s)) * weight)[part], start, bounds=(lower, upper), x_scale="jac"
            )
            best = found if best is None or found.cost < best.cost else best
        assert best is not None
        misfit = max(1.0, 2.0 * best.cost / max(best.fun.size - best.x.size, 1))
        return np.asarray(best.x), np.linalg.pinv(best.jac.T @ best.jac) * misfit

    parameters, covariance = solve(slice(None))
    fitted = law(parameters)

    def error(cut: float) -> float:
        late, _ = solve(slice(_half(f), None))

        def total(p: Array) -> float:
            one = law(p)
            tail = one.beyond(cut) if one.xi < 0.95 else one.between(cut, 10.0 * cut)
            return tail + one.shift * cut

        here = total(parameters)
        steps = 1e-4 * np.maximum(np.sqrt(np.diag(covariance)), 1e-8)
        slope = np.array([(total(parameters + np.eye(steps.size)[i] * h) - here) / h for i, h in enumerate(steps)])
        # twice the change: halving the window again and again would go on changing it
        return math.hypot(math.sqrt(max(float(slope @ covariance @ slope), 0.0)), 2.0 * (total(late) - here))

    return fitted, error


def _half(f: Array) -> int:
    """Where F has gone down half of its decades in a window that starts high."""
    index = int(np.searchsorted(-np.abs(f), -abs(f[0]) / math.sqrt(WINDOW)))
    return min(index, max(f.size - 6, 0))


def _no_deficiency(s: Array, f: Array, final: float, nu: float, final_uncertainty: float) -> DeficiencyIntegral:
    value = float(running_integral(s, f)[-1])
    spread = math.hypot(value, final_uncertainty * float(s[-1]))
    reason = "the response does not leave its final value by more than the noise"
    return DeficiencyIntegral(0.0, spread, 0.0, float(s[-1]), final, "none", None, True, nu, reason)


def _integrate(
    s: Array, f: Array, final: float, nu: float, judged: _Judged, final_uncertainty: float, name: str, *, free: bool
) -> DeficiencyIntegral:
    cut, law = judged.cut, judged.law
    curve = PchipInterpolator(s, f)
    inside = float(curve.integrate(0.0, cut))
    size = float(PchipInterpolator(s, np.abs(f)).integrate(0.0, cut))
    coarse = np.union1d(np.arange(0, s.size, 2), [s.size - 1])
    # all of the change from half the samples: kinks keep the rule from its full order
    quadrature = float(PchipInterpolator(s[coarse], f[coarse]).integrate(0.0, cut)) - inside
    quiet = f[s > cut]
    offset = float(np.mean(quiet)) * cut if quiet.size and judged.settled else 0.0
    tail, exponent, remainder, spread = _remainder(judged, law, size, name)
    if free and not judged.settled:
        raise InputError(
            f"{name}: the response has not settled at the end of the record, s = {s[-1]:.4g}: "
            f"run to larger s, or give its final value from a steady solution"
        )
    if abs(remainder) + spread > MISSING * size:
        raise InputError(
            f"{name}: {100.0 * (abs(remainder) + spread) / size:.0f}% of the deficiency integral lies, or may lie, "
            f"beyond the end of the record at s = {s[-1]:.4g}: run to larger s"
        )
    uncertainty = math.hypot(quadrature, offset, spread, final_uncertainty * cut)
    reason = _words(tail, exponent, judged)
    return DeficiencyIntegral(
        inside + remainder, uncertainty, remainder, cut, final, tail, exponent, judged.settled, nu, reason
    )


def _remainder(
    judged: _Judged, law: _TailLaw | None, size: float, name: str
) -> tuple[Tail, float | None, float, float]:
    """Kind of tail, exponent, integral beyond the cut and its error."""
    cut = judged.cut
    if law is None:
        spread = judged.level * (cut - judged.start) / math.log(WINDOW)
        return "finite" if judged.abrupt else "irregular", None, 0.0, spread
    exponent = 1.0 / law.xi if law.xi > 1.0 / EXPONENTIAL_EXPONENT else None
    if exponent is not None and exponent < NO_LIMIT_EXPONENT:
        octave = abs(law.between(cut, 2.0 * cut)) / size
        if octave > SLOW_OCTAVE:
            raise NoLimitError(
                f"{name}: the deficiency falls like 1/s^{exponent:.2f} up to s = {cut:.4g}, not to be told from the "
                f"1/s of a two-dimensional subsonic wake, so its integral has no limit (each doubling of s adds "
                f"{100.0 * octave:.0f}%); if the body is finite, run to larger s"
            )
        return "slow", exponent, 0.0, abs(law.between(cut, 10.0 * cut))
    kind: Tail = "algebraic" if exponent is not None else "finite" if law.xi < -0.1 else "exponential"
    return kind, exponent, law.beyond(cut), judged.error(cut)


def _words(tail: Tail, exponent: float | None, judged: _Judged) -> str:
    laws = {
        "finite": "settles in finite time",
        "exponential": "falls exponentially",
        "algebraic": f"falls like 1/s^{exponent or 0.0:.2f}",
        "slow": f"falls like 1/s^{exponent or 0.0:.2f}, formally without a limit but too small to matter",
        "irregular": "follows no simple law",
    }
    where = "goes quiet at" if judged.settled else "is cut off by the end of the record at"
    return f"the deficiency {laws[tail]} and {where} s = {judged.cut:.4g}"
