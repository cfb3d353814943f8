r"""Noise that remembers: autoregressive models of residuals, and the filters that make them white.

    v_i = phi_1 v_i-1 + ... + phi_p v_i-p + e_i,        e white

The reflection coefficients are Burg's, which keep the model stable, over any number of stretches together; the order is
the one of least ``n ln var(e) + p ln n`` (Schwarz). The filter predicts each sample from all known ones before it,
across gaps and from the first on, so that no sample is lost and the likelihood is exact (Jones, Technometrics 22 (1980)
389).
Source: Kay, "Modern Spectral Estimation" (1988), ch. 7; Box & Jenkins, "Time Series Analysis" (1976), ch. 7.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numba
import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array

MOST_ORDER = 6
_MOST = 0.995  # reflection coefficient


def reflections(stretches: Sequence[Array], orders: int = MOST_ORDER) -> Array:
    """Burg's reflection coefficients, for the order that describes the stretches best, shape (p,).

    Parameters
    ----------
    stretches : sequence of ndarray
        Residuals without gaps, each (n,).
    orders : int
        Highest order.
    """
    n = sum(s.size for s in stretches)
    orders = min(orders, max(0, n // 10))
    forward, backward = [s.copy() for s in stretches], [s.copy() for s in stretches]
    found: list[float] = []
    best, chosen, variance = 0.0, 0, 1.0
    for p in range(1, orders + 1):
        ahead, behind = [f[1:] for f in forward], [b[:-1] for b in backward]
        power = sum(float(f @ f + b @ b) for f, b in zip(ahead, behind, strict=True))
        if power == 0.0:
            break
        k = 2.0 * sum(float(f @ b) for f, b in zip(ahead, behind, strict=True)) / power
        k = max(-_MOST, min(_MOST, k))
        forward = [f - k * b for f, b in zip(ahead, behind, strict=True)]
        backward = [b - k * f for f, b in zip(ahead, behind, strict=True)]
        found.append(k)
        variance *= 1.0 - k * k
        criterion = n * math.log(variance) + p * math.log(n)
        if criterion < best:
            best, chosen = criterion, p
    return np.array(found[:chosen])


def predictors(reflection: Array) -> list[tuple[Array, float]]:
    """Coefficients and error variance (of unit variance of v) of the predictor of each order from 0 to p."""
    made: list[tuple[Array, float]] = [(np.zeros(0), 1.0)]
    for k in reflection:
        before, variance = made[-1]
        made.append((np.append(before - k * before[::-1], k), variance * (1.0 - k * k)))
    return made


def autocorrelations(reflection: Array) -> Array:
    """Autocorrelation of the model at lags 0 to p, shape (p + 1,): Yule and Walker's equations, order by order."""
    found = [1.0]
    for order, (coefficients, _) in enumerate(predictors(reflection)[1:], start=1):
        found.append(sum(c * found[order - lag] for lag, c in enumerate(coefficients, start=1)))
    return np.array(found)


def whiten(values: Array, reflection: Array, known: NDArray[np.bool_]) -> Array:
    """Prediction errors of unit variance, for columns of unit variance and this memory.

    Parameters
    ----------
    values : ndarray
        Shape (n, ...); what is not known is passed over.
    reflection : ndarray
        Shape (p,); none leaves values as they are.
    known : ndarray of bool
        Shape (n,); behind a gap the prediction is from what there was before it, and less sure.
    """
    if reflection.size == 0:
        return values
    correlation = autocorrelations(reflection)[:-1]
    lags = np.abs(np.subtract.outer(np.arange(reflection.size), np.arange(reflection.size)))
    coefficients, variance = predictors(reflection)[-1]
    columns = np.ascontiguousarray(values.reshape(len(values), -1))
    result: Array = _innovations(columns, known, coefficients, variance, correlation[lags]).reshape(values.shape)
    return result


@numba.njit(cache=True)
def _innovations(
    columns: Array, known: NDArray[np.bool_], coefficients: Array, variance: float, covariance: Array
) -> Array:
    """By the p samples before where all are known; else by a Kalman filter whose state is the noise now and then."""
    n, m = columns.shape
    p = coefficients.size
    state, result = np.zeros((p, m)), np.zeros((n, m))
    transition = np.zeros((p, p))
    transition[0] = coefficients
    for i in range(1, p):
        transition[i, i - 1] = 1.0
    streak = 0  # known samples up to this one
    for i in range(n):
        if streak >= p and known[i]:
            for c in range(m):
                error = columns[i, c]
                for lag in range(p):
                    error -= coefficients[lag] * columns[i - 1 - lag, c]
                result[i, c] = error / np.sqrt(variance)
            continue
        if streak >= p:  # a gap begins: all before is known without error
            state = transition @ np.ascontiguousarray(columns[i - p : i][::-1])
            covariance = np.zeros((p, p))
            covariance[0, 0] = variance
        streak = streak + 1 if known[i] else 0
        if known[i]:
            error_here = columns[i] - state[0]
            result[i] = error_here / np.sqrt(covariance[0, 0])
            gain = covariance[:, 0] / covariance[0, 0]
            for k in range(p):
                state[k] += gain[k] * error_here
            covariance = covariance - np.outer(gain, covariance[0])
        state = transition @ state
        covariance = transition @ covariance @ transition.T
        covariance[0, 0] += variance
    return result


def runs(known: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and one past the last of each stretch without gaps."""
    edges = np.diff(np.concatenate([[False], known, [False]]).astype(int))
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))
