r"""Modes fitted to deficiency functions, in time or frequency: exact constraints, poles by variable projection.

The poles are shared by the outputs of one input. For given poles the amplitudes are a linear least-squares problem
with the initial value (and the integral, hence Eq. 17) imposed exactly; the poles are then a nonlinear problem of few
unknowns (Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973). Their logarithms are the unknowns, so every mode decays
whatever the data.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from indicial.conventions import Array
from indicial.rom.modes import SEPARATION, Modes


@dataclass(frozen=True)
class Target(ABC):
    """What modes are to match: a deficiency function, in time or in frequency.

    Parameters
    ----------
    values : ndarray
        Shape (n, n_outputs).
    initial : ndarray
        F(0+), imposed exactly, shape (n_outputs,).
    integral : ndarray, optional
        Integral of F from 0 to `horizon`, imposed exactly, shape (n_outputs,).
    horizon : float
        End of that integral.
    weights : ndarray
        Weight of each row of `values`, shape (n,).
    scale : ndarray
        What errors of each output are measured by, in the norm of `weights`, shape (n_outputs,).
    """

    values: Array
    initial: Array
    integral: Array | None
    horizon: float
    weights: Array
    scale: Array

    @abstractmethod
    def basis(self, modes: Modes) -> Array:
        """What each mode of unit amplitude gives, shape (n, order)."""

    @abstractmethod
    def slopes(self, modes: Modes) -> Array:
        """Changes of `basis` with each entry of the modes' vector, shape (order, n, order)."""

    @abstractmethod
    def rate_bounds(self) -> tuple[float, float]:
        """Slowest and fastest rate that the data can show."""

    def residual(self, basis: Array, amplitudes: Array) -> Array:
        """Weighted, scaled misfit of a basis (n, order), shape (n, n_outputs); its squared sum is the squared error."""
        misfit = basis @ amplitudes - self.values
        scaled: Array = misfit * np.sqrt(self.weights)[:, None] / (self.scale * np.sqrt(self.scale.size))
        return scaled

    def error(self, modes: Modes, amplitudes: Array) -> float:
        """Root-mean-square error relative to `scale`, over all outputs."""
        return float(np.linalg.norm(self.residual(self.basis(modes), amplitudes)))


@dataclass(frozen=True)
class TimeTarget(Target):
    """F at reduced times `s`, shape (n,)."""

    s: Array

    def basis(self, modes: Modes) -> Array:
        return modes.basis(self.s)

    def slopes(self, modes: Modes) -> Array:
        return modes.basis_slopes(self.s)

    def rate_bounds(self) -> tuple[float, float]:
        return 0.2 / float(self.s[-1]), 5.0 / float(np.min(np.diff(self.s)))


@dataclass(frozen=True)
class FrequencyTarget(Target):
    """``H(0) - H(ik)``, which is ik times the transform of F: real parts at `k`, shape (n/2,), then imaginary ones."""

    k: Array

    def basis(self, modes: Modes) -> Array:
        transform = modes.transform(self.k)
        return np.vstack([transform.real, transform.imag])

    def slopes(self, modes: Modes) -> Array:
        slopes = modes.transform_slopes(self.k)
        return np.concatenate([slopes.real, slopes.imag], axis=1)

    def rate_bounds(self) -> tuple[float, float]:
        return 0.2 * float(np.min(self.k)), 5.0 * float(np.max(self.k))


@dataclass(frozen=True)
class LinearFit:
    """The linear problem at given modes: amplitudes, and what its derivative needs."""

    amplitudes: Array
    basis: Array  # at the samples, (n, order)
    constraint_inverse: Array  # right inverse of the constraints, (order, n_constraints)
    range: Array  # orthonormal range of what the data may choose, (n, n_free)


def solve(modes: Modes, target: Target) -> LinearFit:
    """The linear problem at given modes: least error with the constraints imposed."""
    rows, values = [modes.basis(np.zeros(1))[0]], [target.initial]
    if target.integral is not None and modes.order > 1:
        rows.append(modes.integral(target.horizon))
        values.append(target.integral)
    # minimum-norm solution of the constraints, and the null space in which the data choose
    q, r = np.linalg.qr(np.array(rows).T, mode="complete")
    rank = len(rows)
    inverse = q[:, :rank] @ np.linalg.inv(r[:rank].T)
    particular, free = inverse @ np.array(values), q[:, rank:]
    root = np.sqrt(target.weights)[:, None]
    basis = target.basis(modes)
    weighted = root * basis
    left, singular, right = np.linalg.svd(weighted @ free, full_matrices=False)
    kept = singular > 1e-13 * np.max(singular, initial=0.0)
    left, singular, right = left[:, kept], singular[kept], right[kept]
    chosen = right.T @ ((left.T @ (root * target.values - weighted @ particular)) / singular[:, None])
    return LinearFit(particular + free @ chosen, basis, inverse, left)


def fit_amplitudes(modes: Modes, target: Target) -> Array:
    """Amplitudes of least error with the initial value, and the integral, imposed; shape (order, n_outputs)."""
    return solve(modes, target).amplitudes


def joint_error(modes: Modes, targets: Sequence[Target]) -> float:
    """Root-mean-square error of the best amplitudes over several targets."""
    errors = [target.error(modes, fit_amplitudes(modes, target)) for target in targets]
    return float(np.linalg.norm(errors) / np.sqrt(len(errors)))


def gradient_of(modes: Modes, fit: LinearFit, target: Target) -> Array:
    """Change of the residual with the modes' parameters, shape (n n_outputs, order).

    Kaufman's approximation (BIT 15, 1975) of the variable-projection Jacobian, with the constraints followed.
    """
    direct = target.slopes(modes) @ fit.amplitudes
    if fit.constraint_inverse.shape[1] > 1:
        followed = fit.basis @ fit.constraint_inverse[:, 1]
        area = modes.integral_slopes(target.horizon)
        direct -= followed[:, None] * (area @ fit.amplitudes)[:, None, :]
    direct *= np.sqrt(target.weights)[:, None]
    direct -= fit.range @ (fit.range.T @ direct)
    scaled = direct / (target.scale * np.sqrt(target.scale.size))
    return np.asarray(scaled.reshape(modes.order, -1).T)


def rate_bounds(targets: Sequence[Target]) -> tuple[float, float]:
    """Slowest and fastest rate that any of the targets can show."""
    low, high = zip(*(target.rate_bounds() for target in targets), strict=True)
    return min(low), max(high)


def clipped(modes: Modes, targets: Sequence[Target]) -> Modes:
    """Modes moved inside `rate_bounds`, real rates spread apart where they are too close."""
    low, high = rate_bounds(targets)
    rates = np.clip(np.sort(modes.rates), 1.01 * low, 0.99 * high)
    for i in range(1, rates.size):
        rates[i] = max(rates[i], 1.01 * SEPARATION * rates[i - 1])
    return Modes(rates, np.clip(modes.pairs, 1.01 * low, 0.99 * high))


def refine(start: Modes, targets: Sequence[Target], tolerance: float = 1e-6, evaluations: int = 60) -> Modes:
    """Poles of least error near `start`, by variable projection.

    Parameters
    ----------
    start : Modes
    targets : sequence of Target
        Each with amplitudes of its own; the poles are shared by all.
    tolerance : float
        Relative change of the error, and of the poles, at which the search ends.
    evaluations : int
        Most evaluations of the misfit.
    """

    latest: dict[bytes, list[LinearFit]] = {}  # the gradient is asked for where the misfit was

    def fits(vector: Array) -> list[LinearFit]:
        if vector.tobytes() not in latest:
            latest.clear()
            latest[vector.tobytes()] = [solve(start.from_vector(vector), target) for target in targets]
        return latest[vector.tobytes()]

    def misfit(vector: Array) -> Array:
        pairs = zip(targets, fits(vector), strict=True)
        return np.concatenate([target.residual(fit.basis, fit.amplitudes).ravel() for target, fit in pairs])

    def gradient(vector: Array) -> Array:
        modes = start.from_vector(vector)
        return np.vstack([gradient_of(modes, fit, one) for one, fit in zip(targets, fits(vector), strict=True)])

    first = clipped(start, targets)
    bounds = first.bounds(*rate_bounds(targets))
    options = {"xtol": tolerance, "ftol": tolerance, "gtol": 1e-15, "max_nfev": evaluations}
    found = least_squares(misfit, first.to_vector(), gradient, bounds=bounds, **options)
    return start.from_vector(found.x)
