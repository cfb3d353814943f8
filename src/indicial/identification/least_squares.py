r"""Linear least squares with covariances that hold for coloured residuals.

Of ``z = X theta + v``, v of covariance ``s^2 P``, the estimate ``D X^T z`` with ``D = (X^T X)^-1`` has the covariance
``s^2 D X^T P X D`` (Klein & Morelli, "Aircraft System Identification" (2006), sec. 5.2). In time P is Toeplitz; they
sample its autocorrelations, which leaves errors too small in short records. Here an autoregressive model of the
residuals gives them, by Burg's method, of the order up to 30 that Schwarz's criterion likes best (Kay, "Modern Spectral
Estimation" (1988), ch. 7), and s^2 is free of bias for this P:

    s^2 = v^T v/(N - trace(D X^T P X)).

In frequency the data of different frequencies are independent but not equally noisy: the power of the noise at each is
that of the residuals at it and its neighbours, a quarter of the band together, over the degrees of freedom
``sum (1 - h)`` that the fit leaves them, h the leverages (in the spirit of MacKinnon & White, J. Econometrics 29
(1985), HC2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError

_MOST_ORDER = 30


def check_regressors(names: Sequence[str], columns: Array) -> None:
    """Raise InputError, naming them, if columns (n, p) do not change or depend on one another."""
    centred = columns - columns.mean(axis=0)
    size = np.linalg.norm(centred, axis=0)
    for name, one, whole in zip(names, size, np.linalg.norm(columns, axis=0), strict=True):
        if one <= 1e-12 * whole:
            raise InputError(f"regressor {name} does not change in the record, so its effect cannot be identified")
    if not names:
        return
    _, singular, rows = np.linalg.svd(centred / size, full_matrices=False)
    if singular[-1] <= 1e-10 * singular[0]:
        together = [name for name, part in zip(names, rows[-1], strict=True) if abs(part) > 0.1]
        raise InputError(f"regressors {', '.join(together)} depend linearly on one another in this record")


def solve(columns: Array, response: Array) -> tuple[Array, Array]:
    """Least-squares estimate (p,) and ``D = (X^T X)^-1`` (p, p), from scaled columns."""
    size = np.linalg.norm(columns, axis=0)
    left, singular, rows = np.linalg.svd(columns / size, full_matrices=False)
    half = rows.T / singular / size[:, None]
    return half @ (left.T @ response), half @ half.T


def coloured_covariance(columns: Array, residuals: Array, inverse: Array) -> tuple[Array, Array]:
    """Covariance of the estimate (p, p) and autocorrelation of the noise (n,), of evenly spaced residuals (n,)."""
    from scipy.signal import fftconvolve

    n = residuals.size
    correlation = autocorrelation(residuals)
    both = np.concatenate([correlation[:0:-1], correlation])
    spread = fftconvolve(both[:, None], columns, axes=0)[n - 1 : 2 * n - 1]
    middle = columns.T @ spread
    variance = float(residuals @ residuals) / (n - float(np.trace(inverse @ middle)))
    return variance * (inverse @ middle @ inverse), correlation


def spectral_covariance(columns: Array, residuals: Array, inverse: Array) -> Array:
    """Covariance of the estimate (p, p) if the power of the noise changes slowly with frequency.

    Columns (2n, p) and residuals (2n,) are real parts, then imaginary parts, at n rising frequencies.
    """
    free = np.sum((1.0 - np.einsum("ni,ij,nj->n", columns, inverse, columns)).reshape(2, -1), axis=0)
    power = np.sum((residuals**2).reshape(2, -1), axis=0)
    half = max(3, power.size // 8)
    window = np.ones(2 * half + 1)
    inside = slice(half, half + power.size)
    level = np.convolve(power, window)[inside] / np.maximum(np.convolve(free, window)[inside], 1e-12)
    middle = (columns * np.tile(level, 2)[:, None]).T @ columns
    covariance: Array = inverse @ middle @ inverse
    return covariance


def autocorrelation(residuals: Array) -> Array:
    """Autocorrelation of an autoregressive model of residuals, at lags 0 to n - 1, shape (n,)."""
    n = residuals.size
    forward, backward, best = residuals, residuals, 0.0
    predictor, chosen, log_variance = np.ones(1), np.ones(1), 0.0
    for order in range(1, min(_MOST_ORDER, n // 10) + 1):
        ahead, behind = forward[1:], backward[:-1]
        power = float(ahead @ ahead + behind @ behind)
        if power == 0.0:
            break
        k = 2.0 * float(ahead @ behind) / power
        forward, backward = ahead - k * behind, behind - k * ahead
        longer = np.append(predictor, 0.0)
        predictor = longer - k * longer[::-1]
        log_variance += math.log(max(1.0 - k * k, 1e-12))
        criterion = n * log_variance + math.log(n) * order
        if criterion < best:
            best, chosen = criterion, predictor
    spectrum = 1.0 / np.abs(np.fft.rfft(chosen, 16 * n)) ** 2
    covariance: Array = np.fft.irfft(spectrum)[:n]
    covariance /= covariance[0]
    return covariance
