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
    p, g, r = (np.ascontiguousarray(matrix) for matrix in hold_matrices(a, b, sizes))
    states: Array = _march(p, g, r, which.astype(np.intp), np.ascontiguousarray(values), start)
    return states


@numba.njit(cache=True)
def _march(p: Array, g: Array, r: Array, which: NDArray[np.intp], values: Array, start: Array) -> Array:
    count, inputs = values.shape
    order = start.size
    states = np.empty((count, order))
    states[0] = start
    for k in range(count - 1):
        w = which[k]
        for i in range(order):
            state = 0.0
            for j in range(order):
                state += p[w, i, j] * states[k, j]
            for m in range(inputs):
                state += g[w, i, m] * values[k, m] + r[w, i, m] * (values[k + 1, m] - values[k, m])
            states[k + 1, i] = state
    return states
