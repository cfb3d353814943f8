r"""Decaying modes, real ones and pairs: their values in time and frequency, and their changes with the poles.

A deficiency function is a sum of them, ``F_j(s) = sum over real poles of a_ij exp(-p_i s) + sum over pairs of
exp(-sigma_i s) (a_ij cos(omega_i s) + b_ij sin(omega_i s))``, with amplitudes for each output j.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array
from indicial.rom.model import ComplexArray

SEPARATION = 1.3
"""Least ratio of neighbouring real rates."""


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

    def transform(self, k: Array) -> ComplexArray:
        """``ik`` times the integral of ``basis(s) exp(-iks)`` from 0 to infinity, shape (n, order)."""
        ik = 1j * k[:, None]
        real = ik / (ik + self.rates)
        w, omega = ik + self.pairs[:, 0], self.pairs[:, 1]
        q = w * w + omega**2
        paired = np.stack([ik * w / q, ik * omega / q], axis=2)
        return np.asarray(np.hstack([real, paired.reshape(k.size, -1)]))

    def basis_slopes(self, s: Array) -> Array:
        """Changes of `basis` with each entry of `to_vector`, shape (order, n, order)."""
        n = self.rates.size
        slopes, values = np.zeros((self.order, s.size, self.order)), self.basis(s)
        for i, p in enumerate(self.rates):
            slopes[i, :, i] = -p * s * values[:, i]
        for i, (sigma, omega) in enumerate(self.pairs):
            j = n + 2 * i
            cosine, sine = values[:, j], values[:, j + 1]
            slopes[j, :, j : j + 2] = -sigma * s[:, None] * values[:, j : j + 2]
            slopes[j + 1, :, j : j + 2] = omega * np.stack([-s * sine, s * cosine], axis=1)
        return self._of_ratios(slopes)

    def transform_slopes(self, k: Array) -> ComplexArray:
        """Changes of `transform` with each entry of `to_vector`, shape (order, n, order)."""
        n, ik = self.rates.size, 1j * k
        slopes = np.zeros((self.order, k.size, self.order), dtype=np.complex128)
        for i, p in enumerate(self.rates):
            slopes[i, :, i] = -p * ik / (ik + p) ** 2
        for i, (sigma, omega) in enumerate(self.pairs):
            j, w = n + 2 * i, ik + sigma
            q2 = (w * w + omega**2) ** 2
            even, odd = ik * (omega**2 - w * w) / q2, -2.0 * ik * w * omega / q2
            slopes[j, :, j : j + 2] = sigma * np.stack([even, odd], axis=1)
            slopes[j + 1, :, j : j + 2] = omega * np.stack([odd, -even], axis=1)
        return self._of_ratios(slopes)

    def integral_slopes(self, horizon: float) -> Array:
        """Changes of `integral` with each entry of `to_vector`, shape (order, order)."""
        n = self.rates.size
        slopes, integral = np.zeros((self.order, self.order)), self.integral(horizon)
        for i, p in enumerate(self.rates):
            slopes[i, i] = -integral[i] + _end(p, horizon).real
        for i, (sigma, omega) in enumerate(self.pairs):
            j, z = n + 2 * i, sigma - 1j * omega
            change = (-(integral[j] + 1j * integral[j + 1]) + _end(z, horizon)) / z
            for row, direction in ((j, sigma * change), (j + 1, -1j * omega * change)):
                slopes[row, j : j + 2] = direction.real, direction.imag
        return self._of_ratios(slopes)

    def _of_ratios(self, slopes: NDArray[Any]) -> NDArray[Any]:
        """Real rates are parametrised by their ratios: each ratio moves all faster rates."""
        n = self.rates.size
        slopes[:n] = np.cumsum(slopes[:n][::-1], axis=0)[::-1]
        return slopes

    def to_vector(self) -> Array:
        """Logarithms: of the slowest real rate, of the ratios of the next ones, of the pairs' rates and frequencies."""
        logs = np.log(np.sort(self.rates))
        return np.concatenate([logs[:1], np.diff(logs), np.log(self.pairs).ravel()])

    def from_vector(self, vector: Array) -> Modes:
        """Modes of the same kinds with other rates."""
        n = self.rates.size
        return Modes(np.exp(np.cumsum(vector[:n])), np.exp(vector[n:]).reshape(-1, 2))

    def bounds(self, low: float, high: float) -> tuple[Array, Array]:
        """Bounds of `to_vector`: rates within (low, high), neighbouring real rates apart by `SEPARATION` at least.

        Real modes closer than that differ only by a large difference of amplitudes, which no data can show.
        """
        n = self.rates.size
        lower = np.full(self.order, np.log(low))
        upper = np.full(self.order, np.log(high))
        lower[1:n], upper[1:n] = np.log(SEPARATION), np.log(high / low)
        return lower, upper

    def matrix(self) -> Array:
        """State matrix (order, order): ``-p`` on the diagonal, ``[[-sigma, omega], [-omega, -sigma]]`` a pair."""
        a = np.zeros((self.order, self.order))
        n = self.rates.size
        a[range(n), range(n)] = -self.rates
        for i, (sigma, omega) in enumerate(self.pairs):
            j = n + 2 * i
            a[j : j + 2, j : j + 2] = [[-sigma, omega], [-omega, -sigma]]
        return a

    def state_space(self, amplitudes: Array) -> tuple[Array, Array, Array]:
        """Real (A, b, C) whose response to a unit step, from rest, is ``F(0) - F(s)``.

        Parameters
        ----------
        amplitudes : ndarray
            Shape (order, n_outputs), as multiplied with `basis`.

        Returns
        -------
        A, b, C : ndarray
            Shapes (order, order), (order, 1), (n_outputs, order). A is `matrix`; every state of a step settles at 1
            (the second of a pair at 0).
        """
        a = self.matrix()
        settled, signs = np.ones(self.order), np.ones(self.order)
        second = self.rates.size + 1 + 2 * np.arange(len(self.pairs))
        settled[second], signs[second] = 0.0, -1.0
        return a, -(a @ settled)[:, None], (amplitudes * signs[:, None]).T


def _end(z: complex, horizon: float) -> complex:
    """``T exp(-z T)``, 0 at infinity: what the end of an integral adds to its change with log z."""
    return 0.0 if np.isinf(horizon) else complex(horizon * np.exp(-z * horizon))
