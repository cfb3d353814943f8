r"""Markov parameters from general motions by an observer, OKID.

Juang, Phan, Horta and Longman, J. Guidance 16 (1993) 320. An observer with all its poles near zero remembers only
the last q samples:

    y[i] = D u[i] + sum_{j=1}^{q} (Y1[j] u[i-j] + Y2[j] y[i-j]),

a linear least-squares problem whatever the motion and however lightly damped the system. Its coefficients give those of
the system itself, ``Y[0] = D``, ``Y[n] = Y1[n] + sum_{j=1}^{min(n, q)} Y2[j] Y[n-j]``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError


def observer_markov(
    inputs: Sequence[Array], outputs: Sequence[Array], memory: int, cutoff: float = 1e-11
) -> tuple[Array, Array, Array]:
    """Coefficients of the observer from records that all start from rest.

    Parameters
    ----------
    inputs, outputs : sequence of ndarray
        Uniform samples of each record, shapes (n, n_inputs) and (n, n_outputs).
    memory : int
        q, samples that the observer remembers.
    cutoff : float
        Singular values of the regressors below this, relative to the largest, are left out: what smooth motions
        do not tell.

    Returns
    -------
    direct, from_inputs, from_outputs : ndarray
        D, Y1 and Y2, shapes (n_outputs, n_inputs), (q, n_outputs, n_inputs), (q, n_outputs, n_outputs).

    Raises
    ------
    InputError
        If the records have fewer samples than there are coefficients.
    """
    m, p = inputs[0].shape[1], outputs[0].shape[1]
    rows = np.vstack([_regressors(u, y, memory) for u, y in zip(inputs, outputs, strict=True)])
    if len(rows) < rows.shape[1]:
        raise InputError(f"{len(rows)} samples cannot tell the {rows.shape[1]} coefficients of an observer")
    size = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    found = np.linalg.lstsq(rows / size, np.vstack(outputs), rcond=cutoff)[0] / size[:, None]
    direct, past = found[:m].T, found[m:].reshape(memory, m + p, p).transpose(0, 2, 1)
    return direct, past[..., :m], past[..., m:]


def system_markov(direct: Array, from_inputs: Array, from_outputs: Array, count: int) -> Array:
    """``D, CB, CAB, ...`` of the system, from the observer's coefficients, shape (count, n_outputs, n_inputs)."""
    memory = len(from_inputs)
    markov = [direct]
    for n in range(1, count):
        total = from_inputs[n - 1].copy() if n <= memory else np.zeros_like(direct)
        for j in range(1, min(n, memory) + 1):
            total += from_outputs[j - 1] @ markov[n - j]
        markov.append(total)
    return np.array(markov)


def _regressors(u: Array, y: Array, memory: int) -> Array:
    """``u[i], (u[i-1], y[i-1]), ..., (u[i-q], y[i-q])`` for every i, zero before the record, shape (n, ...)."""
    both = np.hstack([u, y])
    lagged = [np.vstack([np.zeros((j, both.shape[1])), both[: len(both) - j]]) for j in range(1, memory + 1)]
    return np.hstack([u, *lagged])
