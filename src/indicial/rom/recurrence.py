r"""Compiled recurrences of a linear model in modal form, exact for inputs that are linear between samples.

A mode ``dx/ds = lambda x + v``, with v going linearly from v0 to v1 over a step h, ends it at

    x1 = e^z x0 + h (phi1(z) - phi2(z)) v0 + h phi2(z) v1,   z = lambda h,

``phi1(z) = (e^z - 1)/z``, ``phi2(z) = (e^z - 1 - z)/z^2`` (Hochbruck and Ostermann, Acta Numerica 19, 2010). All run
on one thread, so that a result does not depend on how many there are; of fast mathematics only the fused multiply-add
is allowed, so that sums are as written.
"""

from __future__ import annotations

import math

import numba
import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array

ComplexArray = NDArray[np.complex128]

_BLOCK = 128  # samples that stay in the first cache
_SERIES = 0.02  # |z| below which phi2 is summed as a series: its closed form loses digits as 1/|z|
_TERMS = 7


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def hold_factors(pole: complex, step: float) -> tuple[complex, complex, complex]:
    """``e^z``, ``h (phi1 - phi2)`` and ``h phi2`` of one mode over one step, to round-off for any z."""
    z = complex(pole.real * step, pole.imag * step)
    growth, sine, cosine = math.expm1(z.real), 0.0, 1.0
    if z.imag != 0.0:
        sine, cosine = math.sin(0.5 * z.imag), math.cos(0.5 * z.imag)
    versed = 2.0 * sine * sine
    # e^z - 1 without cancellation
    less_one = complex(growth * (1.0 - versed) - versed, (growth + 1.0) * 2.0 * sine * cosine)
    size = z.real * z.real + z.imag * z.imag
    if size < _SERIES * _SERIES:
        phi2 = complex(1.0 / (_TERMS + 1.0), 0.0)
        for n in range(_TERMS, 1, -1):
            phi2 = (1.0 + z * phi2) / n
        phi1 = 1.0 + z * phi2
    else:
        inverse = complex(z.real / size, -z.imag / size)
        phi1 = less_one * inverse
        phi2 = (phi1 - 1.0) * inverse
    return 1.0 + less_one, step * (phi1 - phi2), step * phi2


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def respond_modal(
    real: int,
    poles: ComplexArray,
    s: Array,
    b: ComplexArray,
    c: ComplexArray,
    d: Array,
    values: Array,
    start: ComplexArray,
) -> Array:
    r"""Loads ``Re(sum over modes of c_i x_i) + D u`` at every sample.

    Samples are taken in blocks: each mode is marched through a block by itself, and all but the recurrence itself
    runs along time in vector registers.

    Parameters
    ----------
    real : int
        So many modes, the first, are real.
    poles : ndarray
        Shape (n_modes,).
    s : ndarray
        Increasing reduced time, shape (n,). Steps that differ by its round-off only are taken for equal.
    b, c : ndarray
        Shapes (n_modes, n_inputs) and (n_outputs, n_modes), c of a pair doubled.
    d : ndarray
        Shape (n_outputs, n_inputs).
    values : ndarray
        Inputs, shape (n, n_inputs).
    start : ndarray
        Modes at the first sample, shape (n_modes,).

    Returns
    -------
    ndarray
        Shape (n, n_outputs).
    """
    count, inputs = values.shape
    modes, outputs = poles.size, d.shape[0]
    c_re, c_im = c.real.copy(), c.imag.copy()
    loads = np.empty((count, outputs))
    state = start.copy()
    u = np.empty((inputs, _BLOCK + 1))
    y = np.empty((outputs, _BLOCK))
    path = np.empty((2, _BLOCK))
    grown, after = np.empty(modes, dtype=np.complex128), np.empty(modes, dtype=np.complex128)
    gain_re, gain_im, direct = np.empty((modes, inputs)), np.empty((modes, inputs)), np.empty((outputs, inputs))
    roundoff = 4.0 * np.finfo(np.float64).eps * max(abs(s[0]), abs(s[-1]))
    held_step = -1.0
    for first in range(0, count, _BLOCK):
        size = min(_BLOCK, count - first)
        known = min(size + 1, count - first)  # the next block's first sample ends this one's last step
        # slices, for an index that counts from 0 is known to be none from the end, and the loop becomes a vector's
        given, found = values[first : first + known], loads[first : first + size]
        for m in range(inputs):
            for t in range(known):
                u[m, t] = given[t, m]
            u[m, known : size + 1] = u[m, known - 1]
        step = _common_step(s[first : first + known], roundoff)
        if step > 0.0 and abs(step - held_step) > roundoff:
            held_step = step
            _hold_block(poles, step, b, c, d, grown, after, gain_re, gain_im, direct)
        for j in range(outputs):
            _combine(direct if step > 0.0 else d, j, u, size, y, j)
        for i in range(modes):
            if step > 0.0:
                _combine(gain_re, i, u, size, path, 0)
                if i >= real:
                    _combine(gain_im, i, u, size, path, 1)
                held = state[i] - after[i] * _driven(b, i, u, 0)
                state[i] = _march_even(i < real, held, grown[i], size, path) + after[i] * _driven(b, i, u, size)
            else:
                state[i] = _march_uneven(state[i], poles[i], s, first, known, b, i, u, size, path)
            _add(c_re, c_im, i, i < real, path, size, y)
        for t in range(size):
            for j in range(outputs):
                found[t, j] = y[j, t]
    return loads


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def _hold_block(
    poles: ComplexArray,
    step: float,
    b: ComplexArray,
    c: ComplexArray,
    d: Array,
    grown: ComplexArray,
    after: ComplexArray,
    gain_re: Array,
    gain_im: Array,
    direct: Array,
) -> None:
    r"""Equal steps: with ``xi = x - beta v`` in place of x only one input a step is left.

    ``x1 = P x0 + alpha v0 + beta v1`` becomes ``xi1 = P xi0 + (P beta + alpha) v0``, and ``c x = c xi + c beta v``.
    """
    direct[:] = d
    for i in range(poles.size):
        grown[i], before, after[i] = hold_factors(poles[i], step)
        for m in range(b.shape[1]):
            gain = (grown[i] * after[i] + before) * b[i, m]
            gain_re[i, m], gain_im[i, m] = gain.real, gain.imag
            for j in range(d.shape[0]):
                direct[j, m] += (c[j, i] * after[i] * b[i, m]).real


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def _driven(b: ComplexArray, mode: int, u: Array, t: int) -> complex:
    """``b_i u`` at one sample."""
    total = complex(0.0, 0.0)
    for m in range(u.shape[0]):
        total += b[mode, m] * u[m, t]
    return total


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def _common_step(s: Array, roundoff: float) -> float:
    """The step between samples, 0 if steps differ."""
    steps = s.size - 1
    if steps < 1:
        return 0.0
    mean = (s[steps] - s[0]) / steps
    different = 0
    for t in range(steps):
        if abs(s[t + 1] - s[t] - mean) > roundoff:
            different += 1
    return 0.0 if different else float(mean)


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def _combine(weights: Array, row: int, u: Array, size: int, into: Array, into_row: int) -> None:
    """``into[into_row] = weights[row] u`` for the first `size` samples."""
    weight = weights[row, 0]
    for t in range(size):
        into[into_row, t] = weight * u[0, t]
    for m in range(1, weights.shape[1]):
        weight = weights[row, m]
        for t in range(size):
            into[into_row, t] += weight * u[m, t]


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def _add(c_re: Array, c_im: Array, mode: int, real: bool, path: Array, size: int, y: Array) -> None:
    """Add what one mode gives to the loads of a block."""
    for j in range(y.shape[0]):
        weight, other = c_re[j, mode], c_im[j, mode]
        if real:
            for t in range(size):
                y[j, t] += weight * path[0, t]
        else:
            for t in range(size):
                y[j, t] += weight * path[0, t] - other * path[1, t]


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def _march_even(real: bool, x: complex, grown: complex, size: int, path: Array) -> complex:
    """States of a mode at each sample of a block, in place of what drives them; returns the one after it."""
    p, q = grown.real, grown.imag
    a, b = x.real, x.imag
    if real:
        square = p * p
        cube, fourth = square * p, square * square
        last = size - size % 4
        for t in range(0, last, 4):  # four samples at a time: the recurrence is bound by its latency
            w0, w1, w2, w3 = path[0, t], path[0, t + 1], path[0, t + 2], path[0, t + 3]
            x2 = p * w0 + w1
            x3 = square * w0 + (p * w1 + w2)
            x4 = (cube * w0 + square * w1) + (p * w2 + w3)
            path[0, t] = a
            path[0, t + 1] = p * a + w0
            path[0, t + 2] = square * a + x2
            path[0, t + 3] = cube * a + x3
            a = fourth * a + x4
        for t in range(last, size):
            a, path[0, t] = p * a + path[0, t], a
        return complex(a, b)
    for t in range(size):
        forced, turned = path[0, t], path[1, t]
        path[0, t], path[1, t] = a, b
        a, b = p * a - q * b + forced, p * b + q * a + turned
    return complex(a, b)


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def _march_uneven(
    x: complex,
    pole: complex,
    s: Array,
    first: int,
    known: int,
    b: ComplexArray,
    mode: int,
    u: Array,
    size: int,
    path: Array,
) -> complex:
    """States of a mode at each sample of a block of different steps; returns the one after it."""
    v = _driven(b, mode, u, 0)
    for t in range(size):
        path[0, t], path[1, t] = x.real, x.imag
        if t + 1 < known:  # no step follows the last sample of all
            grown, before, after = hold_factors(pole, s[first + t + 1] - s[first + t])
            ahead = _driven(b, mode, u, t + 1)
            x = grown * x + before * v + after * ahead
            v = ahead
    return x
