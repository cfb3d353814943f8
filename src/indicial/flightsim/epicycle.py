r"""Epicyclic (tricyclic) fit of angular motion: two damped arms and a constant trim.

    xi(s) = K_F exp(lambda_F s) + K_S exp(lambda_S s) + K_T

with xi = beta + i alpha in axes that do not roll, and s the distance flown [m]. Over distance, and not over time, the
motion of a missile with constant coefficients has constant lambda while drag slows it down. Murphy, "Free Flight
Motion of Symmetric Missiles", BRL R-1216 (1963); McCoy, "Modern Exterior Ballistics" (1999), ch. 11.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.trajectory import Trajectory

Complex = NDArray[np.complex128]

_SAMPLES = 300  # of the start value, which takes a few a turn; the fit itself takes every one given
_PENCIL = 120


@dataclass(frozen=True)
class Arm:
    """One arm of an epicycle.

    Parameters
    ----------
    amplitude : complex
        K [rad] at s = 0.
    eigenvalue : complex
        lambda [1/m]: damping (negative) and, positive in the sense from y to z, turning rate.
    """

    amplitude: complex
    eigenvalue: complex


@dataclass(frozen=True)
class EpicyclicFit:
    """Two arms and a trim, fitted by least squares.

    Parameters
    ----------
    fast, slow : Arm
        The faster and slower turning; at zero roll they turn as fast, and `fast` turns from y to z.
    trim : complex
        K_T [rad]; 0 if it was not fitted.
    residual : float
        Root mean square of |fit - data| [rad].
    """

    fast: Arm
    slow: Arm
    trim: complex
    residual: float

    def __call__(self, distance: ArrayLike) -> Complex:
        """xi at distances s [m]."""
        s = np.asarray(distance, dtype=float)
        arms = (arm.amplitude * np.exp(arm.eigenvalue * s) for arm in (self.fast, self.slow))
        total: Complex = sum(arms, start=np.full(s.shape, self.trim, dtype=complex))
        return total

    def summary(self) -> str:
        """Amplitude, damping and wavelength of both arms."""
        lines = [
            f"{name} arm: amplitude {np.degrees(abs(arm.amplitude)):.4g} deg, damping {arm.eigenvalue.real:.5g} 1/m, "
            f"turning {arm.eigenvalue.imag:.5g} rad/m"
            for name, arm in (("fast", self.fast), ("slow", self.slow))
        ]
        return "\n".join(
            [*lines, f"trim {np.degrees(abs(self.trim)):.3g} deg, residual {np.degrees(self.residual):.2g} deg"]
        )


def fit_trajectory(trajectory: Trajectory, *, trim: bool = True, skip: float = 0.0) -> EpicyclicFit:
    """The epicycle of a flight, over the distance flown.

    Parameters
    ----------
    trajectory : Trajectory
    trim : bool
        Fit K_T too (gravity makes one).
    skip : float
        Distance [m] left out at the start, where aerodynamic transients die out; s still counts from the start.
    """
    distance = trajectory.distance
    kept = distance >= skip
    return fit_epicycle(distance[kept], trajectory.non_rolling_incidence[kept], trim=trim)


def fit_epicycle(distance: ArrayLike, incidence: Any, *, trim: bool = True) -> EpicyclicFit:
    """The two arms (and trim) that fit complex incidence best.

    A matrix pencil on evenly spaced samples (Hua & Sarkar, IEEE Trans. ASSP 38, 1990) gives the eigenvalues to start
    from, nonlinear least squares with the amplitudes eliminated (variable projection) the result.

    Parameters
    ----------
    distance : array_like
        Increasing s [m], shape (n,).
    incidence : array_like
        xi [rad], complex, shape (n,).

    Raises
    ------
    InputError
        If there are fewer than 12 samples or both arms cannot be told.
    """
    from scipy.interpolate import CubicSpline
    from scipy.optimize import least_squares

    s, xi = np.asarray(distance, dtype=float), np.asarray(incidence, dtype=complex)
    if s.size < 12 or s.shape != xi.shape:
        raise InputError(f"an epicyclic fit needs at least 12 samples of distance and incidence, has {s.size}")
    grid = np.linspace(s[0], s[-1], _SAMPLES)
    start = _matrix_pencil(CubicSpline(s, xi)(grid), grid[1] - grid[0], trim)
    scale = s[-1] - s[0]
    origin = s[0]

    def basis(values: Array) -> Complex:
        arms = [np.exp((values[2 * i] + 1j * values[2 * i + 1]) / scale * (s - origin)) for i in range(2)]
        return np.stack([*arms, np.ones_like(arms[0])] if trim else arms, axis=1)

    def misfit(values: Array) -> Array:
        columns = basis(values)
        error = columns @ np.linalg.lstsq(columns, xi, rcond=None)[0] - xi
        return np.concatenate([error.real, error.imag])

    first = np.array([part for value in start for part in (value.real * scale, value.imag * scale)])
    result = least_squares(misfit, first, method="lm", xtol=1e-14, ftol=1e-14, gtol=1e-14)
    if not np.all(np.isfinite(result.x)):
        raise InputError("the two arms of this motion cannot be told: give a longer flight or a larger initial angle")
    weights = np.linalg.lstsq(basis(result.x), xi, rcond=None)[0]
    arms = []
    for i in range(2):
        eigenvalue = complex(result.x[2 * i], result.x[2 * i + 1]) / scale
        arms.append(Arm(complex(weights[i] * np.exp(-eigenvalue * origin)), eigenvalue))
    fast, slow = order_arms(arms[0].eigenvalue, arms[1].eigenvalue)
    by_value = {arm.eigenvalue: arm for arm in arms}
    return EpicyclicFit(
        fast=by_value[fast],
        slow=by_value[slow],
        trim=complex(weights[2]) if trim else 0j,
        residual=float(np.sqrt(2.0 * np.mean(misfit(result.x) ** 2))),
    )


def order_arms(one: complex, other: complex) -> tuple[complex, complex]:
    """(fast, slow): by rate of turning; turning equally fast (to 1e-9), the one from y to z is called fast."""
    if abs(abs(one.imag) - abs(other.imag)) <= 1e-6 * max(abs(one.imag), abs(other.imag)):
        return (one, other) if one.imag >= other.imag else (other, one)
    return (one, other) if abs(one.imag) > abs(other.imag) else (other, one)


def _matrix_pencil(samples: Complex, spacing: float, trim: bool) -> list[complex]:
    """Eigenvalues [1/m] of two exponentials (and a constant) in evenly spaced samples."""
    order = 3 if trim else 2
    hankel = np.lib.stride_tricks.sliding_window_view(samples, _PENCIL + 1)
    with threadpool_limits(limits=1, user_api="blas"):  # small matrices: threads would only fight
        _, _, right = np.linalg.svd(hankel, full_matrices=False)
    span = right[:order].T
    ratios = np.linalg.eigvals(np.linalg.lstsq(span[:-1], span[1:], rcond=None)[0])
    values = np.log(ratios) / spacing
    if trim:
        values = np.delete(values, np.argmin(np.abs(values)))
    return [complex(value) for value in values]
