r"""Noise that remembers: autoregressive models of residuals, and the filters that make them white.

    v_i = phi_1 v_i-1 + ... + phi_p v_i-p + e_i,        e white

The reflection coefficients are Burg's, which keep the model stable, over any number of stretches together; the order is
the one of least ``n ln var(e) + p ln n`` (Schwarz). The filter predicts the first samples of a stretch from those that
there are, with the predictors of lower order, so that no sample is lost and the likelihood is exact.
Source: Kay, "Modern Spectral Estimation" (1988), ch. 7; Box & Jenkins, "Time Series Analysis" (1976), ch. 7.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

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


def whiten(values: Array, reflection: Array, known: NDArray[np.bool_]) -> Array:
    """Prediction errors of unit variance, for columns of unit variance and this memory.

    Parameters
    ----------
    values : ndarray
        Shape (n, ...); what is not known is passed over.
    reflection : ndarray
        Shape (p,); none leaves values as they are.
    known : ndarray of bool
        Shape (n,); memory starts anew behind a gap.
    """
    if reflection.size == 0:
        return values
    result = np.zeros_like(values)
    made = predictors(reflection)
    for first, stop in runs(known):
        part = values[first:stop]
        for order, (coefficients, variance) in enumerate(made):
            last = order == len(made) - 1
            here = slice(order, None) if last else slice(order, min(order + 1, len(part)))
            if order >= len(part):
                break
            error = part[here].copy()
            size = error.shape[0]
            for lag, c in enumerate(coefficients, start=1):
                error -= c * part[order - lag : order - lag + size]
            result[first:stop][here] = error / math.sqrt(variance)
    return result


def runs(known: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and one past the last of each stretch without gaps."""
    edges = np.diff(np.concatenate([[False], known, [False]]).astype(int))
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))
