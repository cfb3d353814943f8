"""The sums of Eq. (13), compiled: exact for piecewise-polynomial responses and piecewise-linear inputs."""

from __future__ import annotations

import numba
import numpy as np

from indicial.conventions import Array


@numba.njit(cache=True, error_model="numpy")
def superpose(breaks: Array, integral: Array, s: Array, values: Array, at: Array) -> Array:
    r"""``sum over intervals of u'_j (J(t - s_j) - J(t - s_{j+1}))`` at every t of `at`, J the integral of F from 0.

    Beyond the end of F, J is constant: intervals that lie further back than that are not looked at.

    Parameters
    ----------
    breaks : ndarray
        Of the piecewise polynomial J, from 0, shape (n_breaks,).
    integral : ndarray
        Its coefficients in ``t - breaks[i]``, highest power first, shape (n_powers, n_breaks - 1, m).
    s, values : ndarray
        Samples of the input, shape (n,).
    at : ndarray
        Increasing instants, not before ``s[0]``, shape (k,).

    Returns
    -------
    ndarray
        Shape (k, m).
    """
    powers, _, outputs = integral.shape
    end = breaks[-1]
    total = np.zeros((at.size, outputs))
    before, now = np.empty(outputs), np.empty(outputs)
    first = 0
    for i in range(at.size):
        while first + 1 < s.size and s[first + 1] <= at[i]:
            first += 1
        before[:] = 0.0
        piece = 0
        for j in range(first, -1, -1):
            age = min(at[i] - s[j], end)
            while piece + 2 < breaks.size and breaks[piece + 1] <= age:
                piece += 1
            x = age - breaks[piece]
            slope = (values[j + 1] - values[j]) / (s[j + 1] - s[j]) if j + 1 < s.size else 0.0
            for m in range(outputs):
                value = integral[0, piece, m]
                for power in range(1, powers):
                    value = value * x + integral[power, piece, m]
                now[m] = value
                total[i, m] += slope * (value - before[m])
            if age == end:
                break
            before[:] = now
    return total
