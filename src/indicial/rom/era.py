r"""The eigensystem realisation algorithm, for free decays and for Markov parameters.

Juang and Pappa, J. Guidance 8 (1985) 620. The Hankel matrix of shifted samples has the rank of the system; its leading
singular vectors are the observability matrix, and the shift that this is invariant under is the state matrix.

A deficiency function is itself a free decay, ``F(s) = -C exp(A s) A^{-1} B``: its samples fill the Hankel
matrix, no differences of the step response are taken, and the direct feedthrough and the final value never enter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.rom.model import ComplexArray
from indicial.rom.modes import Modes

_SETTLED = 1e-3
_GONE = 1e-12


@dataclass(frozen=True)
class Sampled:
    """``x[i+1] = A x[i] + B u[i]``, ``y[i] = C x[i] + D u[i]``.

    Parameters
    ----------
    a, b, c, d : ndarray
        Shapes (n, n), (n, n_inputs), (n_outputs, n), (n_outputs, n_inputs).
    hankel : ndarray
        Singular values of the Hankel matrix it came from.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    hankel: Array

    def markov(self, count: int) -> Array:
        """``D, CB, CAB, ...``: the response to a unit pulse, shape (count, n_outputs, n_inputs)."""
        state, values = self.b, [self.d]
        for _ in range(count - 1):
            values.append(self.c @ state)
            state = self.a @ state
        return np.array(values)


def settling_time(s: Array, deficiency: Array) -> float:
    """Last reduced time at which an output is further than 0.1% of its largest deficiency from settled."""
    peak = np.max(np.abs(deficiency), axis=0)
    late = np.nonzero(np.any(np.abs(deficiency) > _SETTLED * peak, axis=1))[0]
    return float(s[min(late[-1] + 1, s.size - 1)]) if late.size else float(s[-1])


def hankel(samples: Array) -> Array:
    """Block Hankel matrix of samples (n, p) or (n, p, m): block (i, j) is ``samples[i + j]``; shape (p n/2, m n/2)."""
    blocks = samples.reshape(*samples.shape[:2], -1)
    n, p, m = blocks.shape
    rows, columns = n // 2, n - n // 2 + 1
    index = np.add.outer(np.arange(rows), np.arange(columns))
    return np.asarray(blocks[index].transpose(0, 2, 1, 3).reshape(rows * p, columns * m))


def era(markov: Array, order: int) -> Sampled:
    """The system of `order` states nearest to Markov parameters, in the sense of their Hankel matrix.

    Parameters
    ----------
    markov : ndarray
        ``D, CB, CAB, ...``, shape (n, n_outputs, n_inputs). The Hankel matrix is as large as they fill: all of them
        count, which is what averages noise out.
    order : int

    Raises
    ------
    InputError
        If the Markov parameters cannot tell `order` states.
    """
    _, n_outputs, n_inputs = markov.shape
    blocks = hankel(markov[1:])
    if not 1 <= order <= min(blocks.shape) - n_outputs:
        raise InputError(f"order is {order}, must be from 1 to {min(blocks.shape) - n_outputs} for these samples")
    left, singular, right = np.linalg.svd(blocks, full_matrices=False)
    root = np.sqrt(singular[:order])
    observability, controllability = left[:, :order] * root, root[:, None] * right[:order]
    shift = _shift(observability, n_outputs)
    return Sampled(shift, controllability[:, :n_inputs], observability[:n_outputs], markov[0], singular)


def era_modes(samples: Array, step: float, order: int) -> Modes:
    """Modes of a free decay sampled uniformly.

    Parameters
    ----------
    samples : ndarray
        F at 0, step, 2 step, ..., shape (n, n_outputs), scaled so that all outputs count alike. Those of several inputs
        stand side by side: they share the poles, not the residues.
    step : float
        Reduced time between samples.
    order : int
        Number of states, see `stable_modes`.
    """
    left, singular, _ = np.linalg.svd(hankel(samples), full_matrices=False)
    shift = _shift(left[:, :order] * np.sqrt(singular[:order]), samples.shape[1])
    return stable_modes(np.asarray(np.linalg.eigvals(shift), dtype=np.complex128), step)


def stable_modes(z: ComplexArray, step: float) -> Modes:
    """Decaying modes of eigenvalues z of a state matrix from one sample to the next.

    Real eigenvalues become real modes, the others pairs. A growing mode is reflected to decay as fast; one that
    alternates from sample to sample is not resolved and left out.
    """
    z = z[(np.abs(z) > _GONE) & ~((np.abs(z.imag) < 1e-9) & (z.real < 0.0))]
    pole = np.log(z.astype(complex)) / step
    real = np.abs(pole.imag) < 1e-9
    tiny = 1e-6 / step
    rates = np.maximum(np.abs(pole[real].real), tiny)
    pairs = pole[~real & (pole.imag > 0.0)]
    return Modes(rates, np.stack([np.maximum(np.abs(pairs.real), tiny), pairs.imag], axis=1))


def _shift(observability: Array, n_outputs: int) -> Array:
    """The state matrix from one sample to the next, of least squared error."""
    return np.asarray(np.linalg.lstsq(observability[:-n_outputs], observability[n_outputs:], rcond=None)[0])
