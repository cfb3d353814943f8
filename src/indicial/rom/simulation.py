r"""Exact simulation of a linear system whose inputs are linear between samples (first-order hold)."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from indicial.conventions import Array


def hold_matrices(a: Array, b: Array, steps: Array) -> tuple[Array, Array, Array]:
    r"""Exact discretisation: ``x+ = P x + G u + R (u+ - u)`` for u linear over a step.

    The exponential of ``[[A h, B h, 0], [0, 0, I], [0, 0, 0]]`` holds P, G and R in its first block row
    (Van Loan, IEEE Trans. Automatic Control 23, 1978).

    Parameters
    ----------
    a, b : ndarray
        Shapes (n, n) and (n, m).
    steps : ndarray
        Step sizes h, shape (N,).

    Returns
    -------
    P, G, R : ndarray
        Shapes (N, n, n), (N, n, m), (N, n, m).
    """
    n, m = b.shape
    big = np.zeros((steps.size, n + 2 * m, n + 2 * m))
    big[:, :n, :n] = steps[:, None, None] * a
    big[:, :n, n : n + m] = steps[:, None, None] * b
    big[:, n : n + m, n + m :] = np.eye(m)
    held = expm(big)
    return held[:, :n, :n], held[:, :n, n : n + m], held[:, :n, n + m :]


def simulate(a: Array, b: Array, s: Array, values: Array, start: Array) -> Array:
    """States at every sample, shape (n_samples, n), from `start`, for inputs `values` (n_samples, m) at times `s`."""
    if s.size == 1 or a.shape[0] == 0:
        return np.repeat(start[None], s.size, axis=0)
    step = np.diff(s)
    # steps that differ by round-off only share one matrix exponential
    digits = 11 - np.floor(np.log10(step)).astype(int)
    scale = 10.0 ** digits.astype(float)
    sizes, which = np.unique(np.round(step * scale) / scale, return_inverse=True)
    transition, gain, ramp = hold_matrices(a, b, sizes)
    forcing = np.einsum("kij,kj->ki", gain[which], values[:-1])
    forcing += np.einsum("kij,kj->ki", ramp[which], np.diff(values, axis=0))
    states: Array = _march(transition, which.astype(np.intp), forcing, start)
    return states


@numba.njit(cache=True)
def _march(transition: Array, which: NDArray[np.intp], forcing: Array, start: Array) -> Array:
    count, order = forcing.shape
    states = np.empty((count + 1, order))
    states[0] = start
    for k in range(count):
        phi = transition[which[k]]
        for i in range(order):
            value = forcing[k, i]
            for j in range(order):
                value += phi[i, j] * states[k, j]
            states[k + 1, i] = value
    return states
