r"""The loop of the extended Kalman filter, compiled, and the Rauch-Tung-Striebel smoother.

Measurements of one instant have independent noise and are taken in one after the other, each a scalar: no matrix is
inverted, a channel that is missing is passed over, and with each innovation ``nu_i`` and its variance ``s_i`` given the
channels before it, ``sum nu_i^2/s_i = nu^T S^-1 nu`` and ``sum ln s_i = ln det S`` exactly. Outputs are linearised once
an instant, at the predicted state. Covariances are updated in Joseph's form, ``(I - k h) P (I - k h)^T + k r k^T``,
which keeps them positive where round-off would not. Source: Bierman, "Factorization Methods for Discrete Sequential
Estimation" (1977), ch. 2; Rauch, Tung & Striebel, AIAA J. 3 (1965) 1445.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from indicial.conventions import Array
from indicial.flightsim.compiled import Code, evaluate_code

_LOST = 1e-8  # of a variance: how far below zero round-off may take it


class Filtered(NamedTuple):
    """What a filter makes of a record."""

    predicted: Array
    """States before the measurements of an instant, shape (n, nx)."""
    predicted_covariance: Array
    """Shape (n, nx, nx)."""
    filtered: Array
    """States after them, shape (n, nx)."""
    filtered_covariance: Array
    """Shape (n, nx, nx)."""
    cross_covariance: Array
    """Of the filtered state one instant before with the predicted one, shape (n, nx, nx); the first is 0."""
    innovations: Array
    """Measured less predicted, NaN where missing, shape (n, nc)."""
    errors: Array
    """Innovations given those of the channels before, shape (n, nc): independent of each other."""
    variances: Array
    """Of `errors`, shape (n, nc)."""

    @classmethod
    def empty(cls, n: int, nx: int, nc: int) -> Filtered:
        """Room for n instants, nx states and nc channels."""
        states, matrices = np.zeros((2, n, nx)), np.zeros((3, n, nx, nx))
        seen = np.full((3, n, nc), np.nan)
        return cls(states[0], matrices[0], states[1], matrices[1], matrices[2], *seen)

    @property
    def standardised(self) -> Array:
        """`errors` in standard deviations, shape (n, nc)."""
        scaled: Array = self.errors / np.sqrt(self.variances)
        return scaled

    @property
    def log_likelihood(self) -> float:
        """Of the record."""
        z = self.standardised
        return float(-0.5 * np.nansum(z**2 + np.log(2.0 * np.pi * self.variances)))


@njit(cache=True, nogil=True, error_model="numpy")
def noise_covariance(slope: Array, intensity: Array, interval: float, pieces: int = 1) -> Array:
    """``int exp(A s) W exp(A^T s) ds`` over an interval [s], by Gauss's rule with two nodes, shape (nx, nx).

    Its error is of fifth order in the interval, and it is never negative in any direction, as a series cut off can be.
    In equal pieces, one after the other, it is as good as their length: a process that dies out within the interval
    needs them as the state's own steps do.
    """
    total = np.zeros_like(slope)
    piece = interval / pieces
    for side in (-1.0, 1.0):
        root = _exponential(slope, np.diag(intensity), 0.5 * piece * (1.0 + side / np.sqrt(3.0)))
        total += 0.5 * piece * (root @ root.T)
    if pieces > 1:
        first, across = total.copy(), _exponential(slope, np.eye(len(slope)), piece)
        for _ in range(pieces - 1):
            total = first + across @ total @ across.T
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def _exponential(slope: Array, matrix: Array, length: float) -> Array:
    """``exp(A length)`` times a matrix, to fourth order."""
    term = matrix
    total = matrix.copy()
    for k in range(1, 5):
        term = slope @ term * (length / k)
        total += term
    return total


@njit(cache=True, nogil=True, error_model="numpy")
def extended_filter(
    step: Code,
    view: Code,
    time: Array,
    parameters: Array,
    measured: Array,
    turning: NDArray[np.bool_],
    variance: Array,
    intensity: Array,
    substeps: int,
    mean: Array,
    spread: Array,
    made: Filtered,
) -> int:
    """Filter a record into `made`; the instant at which it broke down, or -1.

    Parameters
    ----------
    step, view : Code
        Of a `StateModel`.
    time : ndarray
        Shape (n,).
    parameters : ndarray
        At each instant, shape (n, np).
    measured : ndarray
        NaN where missing, shape (n, nc).
    turning : ndarray of bool
        Channels that are angles, of which innovations are taken within half a turn, shape (nc,).
    variance : ndarray
        Of the noise of channels, shape (nc,).
    intensity : ndarray
        Square roots of W, which is diagonal, shape (nx,).
    substeps : int
        Of the model's.
    mean, spread : ndarray
        Of the state before the first measurement, shapes (nx,) and (nx, nx).
    """
    n, nc, nx, count = time.size, variance.size, mean.size, parameters.shape[1]
    stepped, seen, given = np.empty(nx + 2 * nx * nx), np.empty(nc * (1 + nx)), np.empty(2 * count + 1)
    gain, column, left = np.empty(nx), np.empty(nx), np.empty(nx)
    x, p = mean.copy(), spread.copy()
    for k in range(n):
        if k > 0:
            interval = time[k] - time[k - 1]
            given[:count], given[count : 2 * count], given[2 * count] = parameters[k - 1], parameters[k], interval
            evaluate_code(step, x, given, time[k - 1], stepped)
            x[:] = stepped[:nx]
            transition = stepped[nx : nx + nx * nx].reshape((nx, nx))
            slope = stepped[nx + nx * nx :].reshape((nx, nx))
            across = p @ transition.T
            made.cross_covariance[k] = across
            p = transition @ across + noise_covariance(slope, intensity, interval, substeps)
        made.predicted[k], made.predicted_covariance[k] = x, p
        evaluate_code(view, x, parameters[k], time[k], seen)
        for i in range(nc):
            if np.isnan(measured[k, i]):
                continue
            difference = measured[k, i] - seen[i]
            if turning[i]:
                difference = (difference + np.pi) % (2.0 * np.pi) - np.pi
            row, s, error = seen[nc + i * nx : nc + (i + 1) * nx], variance[i], difference
            for a in range(nx):
                column[a] = 0.0
                for b in range(nx):
                    column[a] += p[a, b] * row[b]
                s += row[a] * column[a]
                error -= row[a] * (x[a] - made.predicted[k, a])
            if not (s > 0.0 and np.isfinite(s) and np.isfinite(error)):
                return k
            made.innovations[k, i], made.errors[k, i], made.variances[k, i] = difference, error, s
            for a in range(nx):
                gain[a] = column[a] / s
                x[a] += gain[a] * error
            for a in range(nx):
                left[a] = -variance[i] * gain[a]
                for b in range(nx):
                    p[a, b] -= gain[a] * column[b]
                    left[a] += p[a, b] * row[b]
            for a in range(nx):
                for b in range(nx):
                    p[a, b] -= left[a] * gain[b]
        p = 0.5 * (p + p.T)
        for a in range(nx):
            if not (np.isfinite(x[a]) and p[a, a] >= -_LOST * made.predicted_covariance[k, a, a]):
                return k
        made.filtered[k], made.filtered_covariance[k] = x, p
    return -1


def smoothed(made: Filtered) -> tuple[Array, Array]:
    """Rauch-Tung-Striebel: ``C = P_k,k+1 P-_k+1^-1``, ``x_k += C (x^s - x-)``, ``P_k += C (P^s - P-) C^T``.

    Singular covariances (states known exactly) take the pseudo-inverse.
    """
    x, p = made.filtered.copy(), made.filtered_covariance.copy()
    for k in range(len(x) - 2, -1, -1):
        ahead = made.predicted_covariance[k + 1]
        size = np.sqrt(np.maximum(np.diag(ahead), np.finfo(float).tiny))
        inverse = np.linalg.pinv(ahead / np.outer(size, size), rcond=1e-14, hermitian=True)
        gain = made.cross_covariance[k + 1] @ (inverse / np.outer(size, size))
        x[k] += gain @ (x[k + 1] - made.predicted[k + 1])
        p[k] += gain @ (p[k + 1] - ahead) @ gain.T
    return x, p
