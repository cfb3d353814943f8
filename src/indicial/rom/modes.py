r"""Deficiency functions as sums of decaying modes, with exact constraints and poles by variable projection.

``F_j(s) = sum over real poles of a_ij exp(-p_i s) + sum over pairs of exp(-sigma_i s) (a_ij cos(omega_i s) +
b_ij sin(omega_i s))``. The poles are shared by the outputs j of one input. For given poles the amplitudes are a
linear least-squares problem with the initial value (and the integral, hence Eq. 17) imposed exactly; the poles
are then a nonlinear problem of few unknowns (Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973). Their logarithms
are the unknowns, so every mode decays whatever the data.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from indicial.conventions import Array

_RATIO = 1.3


@dataclass(frozen=True)
class Modes:
    """Decaying modes: real poles and complex pairs.

    Parameters
    ----------
    rates : ndarray
        Positive decay rates p of the real modes, shape (n_real,).
    pairs : ndarray
        Decay rate sigma and frequency omega of the pairs, both positive, shape (n_pairs, 2).
    """

    rates: Array
    pairs: Array

    @property
    def order(self) -> int:
        """Number of states."""
        return int(self.rates.size + 2 * len(self.pairs))

    def basis(self, s: Array) -> Array:
        """``exp(-p s)``, then ``exp(-sigma s) cos(omega s)`` and ``exp(-sigma s) sin(omega s)``, shape (n, order)."""
        real = np.exp(-np.outer(s, self.rates))
        envelope = np.exp(-np.outer(s, self.pairs[:, 0]))
        phase = np.outer(s, self.pairs[:, 1])
        paired = np.stack([envelope * np.cos(phase), envelope * np.sin(phase)], axis=2)
        return np.hstack([real, paired.reshape(len(s), -1)])

    def integral(self, horizon: float) -> Array:
        """Integral of the basis from 0 to `horizon` (infinity allowed), shape (order,)."""
        real = -np.expm1(-self.rates * horizon) / self.rates
        z = self.pairs[:, 0] - 1j * self.pairs[:, 1]
        decay = np.zeros_like(z) if np.isinf(horizon) else np.exp(-z * horizon)
        paired = (1.0 - decay) / z
        return np.concatenate([real, np.stack([paired.real, paired.imag], axis=1).ravel()])

    def slopes(self, s: Array, horizon: float) -> tuple[Array, Array]:
        """Changes of `basis` and of `integral` with the logarithm of each rate and frequency, in the order of `bounds`.

        Returns
        -------
        basis : ndarray
            Shape (n_parameters, n, order); n_parameters is the order.
        integral : ndarray
            Shape (n_parameters, order).
        """
        n = self.rates.size
        basis, area = np.zeros((self.order, s.size, self.order)), np.zeros((self.order, self.order))
        values, integral = self.basis(s), self.integral(horizon)
        for i, p in enumerate(self.rates):
            basis[i, :, i] = -p * s * values[:, i]
            area[i, i] = -integral[i] + _end(p, horizon).real
        for i, (sigma, omega) in enumerate(self.pairs):
            j = n + 2 * i
            cosine, sine = values[:, j], values[:, j + 1]
            basis[j, :, j : j + 2] = -sigma * s[:, None] * values[:, j : j + 2]
            basis[j + 1, :, j : j + 2] = omega * np.stack([-s * sine, s * cosine], axis=1)
            z = sigma - 1j * omega
            change = (-(integral[j] + 1j * integral[j + 1]) + _end(z, horizon)) / z
            for row, direction in ((j, sigma * change), (j + 1, -1j * omega * change)):
                area[row, j : j + 2] = direction.real, direction.imag
        # real rates are parametrised by their ratios: each ratio moves all faster rates
        basis[:n] = np.cumsum(basis[:n][::-1], axis=0)[::-1]
        area[:n] = np.cumsum(area[:n][::-1], axis=0)[::-1]
        return basis, area

    def to_vector(self) -> Array:
        """Logarithms: of the slowest real rate, of the ratios of the next ones, of the pairs' rates and frequencies."""
        logs = np.log(np.sort(self.rates))
        return np.concatenate([logs[:1], np.diff(logs), np.log(self.pairs).ravel()])

    def from_vector(self, vector: Array) -> Modes:
        """Modes of the same kinds with other rates."""
        n = self.rates.size
        return Modes(np.exp(np.cumsum(vector[:n])), np.exp(vector[n:]).reshape(-1, 2))

    def bounds(self, low: float, high: float) -> tuple[Array, Array]:
        """Bounds of `to_vector`: rates within (low, high), neighbouring real rates apart by `_RATIO` at least.

        Real modes closer than that differ only by a large difference of amplitudes, which no data can show.
        """
        n = self.rates.size
        lower = np.full(self.order, np.log(low))
        upper = np.full(self.order, np.log(high))
        lower[1:n], upper[1:n] = np.log(_RATIO), np.log(high / low)
        return lower, upper

    def state_space(self, amplitudes: Array) -> tuple[Array, Array, Array]:
        """Real (A, b, C) whose response to a unit step, from rest, is ``F(0) - F(s)``.

        Parameters
        ----------
        amplitudes : ndarray
            Shape (order, n_outputs), as multiplied with `basis`.

        Returns
        -------
        A, b, C : ndarray
            Shapes (order, order), (order, 1), (n_outputs, order). A pair is the block
            ``[[-sigma, omega], [-omega, -sigma]]``; every state of a step settles at 1 (the second of a pair at 0).
        """
        a = np.zeros((self.order, self.order))
        settled = np.zeros(self.order)
        signs = np.ones(self.order)
        n = self.rates.size
        a[range(n), range(n)] = -self.rates
        settled[:n] = 1.0
        for i, (sigma, omega) in enumerate(self.pairs):
            j = n + 2 * i
            a[j : j + 2, j : j + 2] = [[-sigma, omega], [-omega, -sigma]]
            settled[j] = 1.0
            signs[j + 1] = -1.0
        return a, -(a @ settled)[:, None], (amplitudes * signs[:, None]).T


def _end(z: complex, horizon: float) -> complex:
    """``T exp(-z T)``, 0 at infinity: what the end of an integral adds to its change with log z."""
    return 0.0 if np.isinf(horizon) else complex(horizon * np.exp(-z * horizon))


@dataclass(frozen=True)
class Target:
    """A deficiency function to be matched.

    Parameters
    ----------
    s : ndarray
        Reduced time, shape (n,).
    values : ndarray
        F, shape (n, n_outputs).
    initial : ndarray
        F(0+), imposed exactly, shape (n_outputs,).
    integral : ndarray, optional
        Integral of F from 0 to `horizon`, imposed exactly, shape (n_outputs,).
    horizon : float
        End of that integral.
    weights : ndarray
        Quadrature weights of the samples, shape (n,).
    scale : ndarray
        What errors of each output are measured by, in the norm of `weights`, shape (n_outputs,).
    """

    s: Array
    values: Array
    initial: Array
    integral: Array | None
    horizon: float
    weights: Array
    scale: Array

    def residual(self, basis: Array, amplitudes: Array) -> Array:
        """Weighted, scaled misfit of a basis (n, order), shape (n, n_outputs); its squared sum is the squared error."""
        misfit = basis @ amplitudes - self.values
        scaled: Array = misfit * np.sqrt(self.weights)[:, None] / (self.scale * np.sqrt(self.scale.size))
        return scaled

    def error(self, modes: Modes, amplitudes: Array) -> float:
        """Root-mean-square error relative to `scale`, over all outputs."""
        return float(np.linalg.norm(self.residual(modes.basis(self.s), amplitudes)))


@dataclass(frozen=True)
class _Fit:
    """The linear problem at given modes: amplitudes, and what its derivative needs."""

    amplitudes: Array
    basis: Array  # at the samples, (n, order)
    constraint_inverse: Array  # right inverse of the constraints, (order, n_constraints)
    range: Array  # orthonormal range of what the data may choose, (n, n_free)


def _solve(modes: Modes, target: Target) -> _Fit:
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
    basis = modes.basis(target.s)
    weighted = root * basis
    left, singular, right = np.linalg.svd(weighted @ free, full_matrices=False)
    kept = singular > 1e-13 * np.max(singular, initial=0.0)
    left, singular, right = left[:, kept], singular[kept], right[kept]
    chosen = right.T @ ((left.T @ (root * target.values - weighted @ particular)) / singular[:, None])
    return _Fit(particular + free @ chosen, basis, inverse, left)


def fit_amplitudes(modes: Modes, target: Target) -> Array:
    """Amplitudes of least error with the initial value, and the integral, imposed; shape (order, n_outputs)."""
    return _solve(modes, target).amplitudes


def _gradient(modes: Modes, fit: _Fit, target: Target) -> Array:
    """Change of the residual with the modes' parameters, shape (n n_outputs, order).

    Kaufman's approximation (BIT 15, 1975) of the variable-projection Jacobian, with the constraints followed.
    """
    basis, area = modes.slopes(target.s, target.horizon)
    direct = basis @ fit.amplitudes
    if fit.constraint_inverse.shape[1] > 1:
        followed = fit.basis @ fit.constraint_inverse[:, 1]
        direct -= followed[:, None] * (area @ fit.amplitudes)[:, None, :]
    direct *= np.sqrt(target.weights)[:, None]
    direct -= fit.range @ (fit.range.T @ direct)
    scaled = direct / (target.scale * np.sqrt(target.scale.size))
    return np.asarray(scaled.reshape(modes.order, -1).T)


def rate_bounds(s: Array) -> tuple[float, float]:
    """Slowest and fastest rate that samples at `s` can show."""
    return 0.2 / float(s[-1]), 5.0 / float(np.min(np.diff(s)))


def clipped(modes: Modes, s: Array) -> Modes:
    """Modes moved inside `rate_bounds`, real rates spread apart where they are too close."""
    low, high = rate_bounds(s)
    rates = np.clip(np.sort(modes.rates), 1.01 * low, 0.99 * high)
    for i in range(1, rates.size):
        rates[i] = max(rates[i], 1.01 * _RATIO * rates[i - 1])
    return Modes(rates, np.clip(modes.pairs, 1.01 * low, 0.99 * high))


def refine(start: Modes, target: Target, tolerance: float = 1e-6, evaluations: int = 60) -> Modes:
    """Poles of least error near `start`, by variable projection.

    Parameters
    ----------
    start : Modes
    target : Target
    tolerance : float
        Relative change of the error, and of the poles, at which the search ends.
    evaluations : int
        Most evaluations of the misfit.
    """

    latest: dict[bytes, _Fit] = {}  # the gradient is asked for where the misfit was

    def misfit(vector: Array) -> Array:
        modes = start.from_vector(vector)
        latest.clear()
        fit = latest[vector.tobytes()] = _solve(modes, target)
        return target.residual(fit.basis, fit.amplitudes).ravel()

    def gradient(vector: Array) -> Array:
        modes = start.from_vector(vector)
        return _gradient(modes, latest.get(vector.tobytes()) or _solve(modes, target), target)

    first = clipped(start, target.s)
    bounds = first.bounds(*rate_bounds(target.s))
    options = {"xtol": tolerance, "ftol": tolerance, "gtol": 1e-15, "max_nfev": evaluations}
    found = least_squares(misfit, first.to_vector(), gradient, bounds=bounds, **options)
    return start.from_vector(found.x)
