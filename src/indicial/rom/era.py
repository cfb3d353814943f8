r"""Poles of a sampled deficiency function by the eigensystem realisation algorithm.

Juang and Pappa, J. Guidance 8 (1985) 620. The deficiency function itself is a free decay,
``F(s) = -C exp(A s) A^{-1} B``, so its samples fill the Hankel matrix: no differences of the step response are
taken, and the direct feedthrough and the final value never enter.
"""

from __future__ import annotations

import numpy as np

from indicial.conventions import Array
from indicial.rom.modes import Modes

_SETTLED = 1e-3


def settling_time(s: Array, deficiency: Array) -> float:
    """Last reduced time at which an output is further than 0.1% of its largest deficiency from settled."""
    peak = np.max(np.abs(deficiency), axis=0)
    late = np.nonzero(np.any(np.abs(deficiency) > _SETTLED * peak, axis=1))[0]
    return float(s[min(late[-1] + 1, s.size - 1)]) if late.size else float(s[-1])


def hankel(samples: Array) -> Array:
    """Block Hankel matrix of samples (n, m): entry (i, j) is the column ``samples[i + j]``; shape (m n/2, n/2)."""
    n, m = samples.shape
    rows, columns = n // 2, n - n // 2 + 1
    index = np.add.outer(np.arange(rows), np.arange(columns))
    return samples[index].transpose(0, 2, 1).reshape(rows * m, columns)


def era_modes(samples: Array, step: float, order: int) -> Modes:
    """Modes of a free decay sampled uniformly.

    Parameters
    ----------
    samples : ndarray
        F at 0, step, 2 step, ..., shape (n, n_outputs), scaled so that all outputs count alike.
    step : float
        Reduced time between samples.
    order : int
        Number of states; real eigenvalues become real modes, the others pairs. A growing mode is reflected to
        decay as fast; one that alternates from sample to sample is not resolved and left out.
    """
    n_outputs = samples.shape[1]
    left, singular, _ = np.linalg.svd(hankel(samples), full_matrices=False)
    observability = left[:, :order] * np.sqrt(singular[:order])
    shift = np.linalg.lstsq(observability[:-n_outputs], observability[n_outputs:], rcond=None)[0]
    z = np.linalg.eigvals(shift)
    z = z[(np.abs(z) > 1e-12) & ~((np.abs(z.imag) < 1e-9) & (z.real < 0.0))]
    pole = np.log(z.astype(complex)) / step
    real = np.abs(pole.imag) < 1e-9
    tiny = 1e-6 / step
    rates = np.maximum(np.abs(pole[real].real), tiny)
    pairs = pole[~real & (pole.imag > 0.0)]
    return Modes(rates, np.stack([np.maximum(np.abs(pairs.real), tiny), pairs.imag], axis=1))
