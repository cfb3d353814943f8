r"""Poles of frequency responses by vector fitting, relaxed, in real arithmetic.

With starting poles a_n, one linear least-squares problem for a weight ``sigma = d + sum c_n/(ik - a_n)`` shared by all
channels,

    sigma(ik) f(ik) = sum r_n/(ik - a_n),      sum over k of Re sigma = number of k,

has the zeros of sigma as better poles; those that grow are flipped to decay as fast. A few rounds do. Gustavsen and
Semlyen, IEEE Trans. Power Delivery 14 (1999) 1052; relaxed: Gustavsen, ibid. 21 (2006) 1587; channel by channel
through QR: Deschrijver et al., IEEE Microwave Wireless Comp. Lett. 18 (2008) 383. The responses are taken less
their value at infinity (the direct feedthrough), so there is no constant to find.
"""

from __future__ import annotations

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.rom.model import ComplexArray
from indicial.rom.modes import Modes

_ROUNDS = 12
_STILL = 1e-10
_LEAST_CONSTANT = 1e-8
_REAL = 1e-9


def vector_fit(k: Array, values: ComplexArray, order: int, *, weights: Array | None = None) -> Modes:
    """Decaying modes shared by all channels of a frequency response.

    Parameters
    ----------
    k : ndarray
        Reduced frequencies above 0, shape (n,).
    values : ndarray
        ``H(ik) - H(i inf)``, shape (n, n_channels), scaled so that all count alike.
    order : int
        Number of poles.
    weights : ndarray, optional
        Weight of each frequency, shape (n,).

    Raises
    ------
    InputError
        If the frequencies are fewer than the unknowns.
    """
    if 2 * k.size < 2 * order + 1:
        raise InputError(f"{k.size} frequencies cannot tell {order} poles")
    root = np.sqrt(np.ones(k.size) if weights is None else weights)
    modes = _spread(k, order)
    for _ in range(_ROUNDS):
        before, modes = modes, _relocated(modes, k, values, root)
        old, new = np.sort_complex(_poles(before)), np.sort_complex(_poles(modes))
        if np.max(np.abs(new - old)) < _STILL * np.max(np.abs(old)):
            break
    return modes


def _spread(k: Array, order: int) -> Modes:
    """Weakly damped pairs over the band, and a real pole if the order is odd."""
    low, high = float(np.min(k)), float(np.max(k))
    omega = np.geomspace(2.0 * low, 0.5 * high, max(order // 2, 1))[: order // 2]
    rates = np.full(order % 2, np.sqrt(low * high))
    return Modes(rates, np.stack([0.2 * omega, omega], axis=1))


def _poles(modes: Modes) -> ComplexArray:
    above = -modes.pairs[:, 0] + 1j * modes.pairs[:, 1]
    return np.concatenate([-modes.rates.astype(complex), above, above.conj()])


def _fractions(modes: Modes, k: Array) -> ComplexArray:
    """``1/(ik - a)`` of real poles; sum and i times the difference of those of a pair, shape (n, order)."""
    ik = 1j * k[:, None]
    upper = -modes.pairs[:, 0] + 1j * modes.pairs[:, 1]
    first, second = 1.0 / (ik - upper), 1.0 / (ik - upper.conj())
    paired = np.stack([first + second, 1j * (first - second)], axis=2).reshape(k.size, -1)
    return np.asarray(np.hstack([1.0 / (ik + modes.rates), paired]))


def _relocated(modes: Modes, k: Array, values: ComplexArray, root: Array) -> Modes:
    """The zeros of sigma."""
    n, fractions = modes.order, _fractions(modes, k)
    weight = np.append(root, root)
    sigma = np.hstack([fractions, np.ones((k.size, 1))])
    rows = []
    for f in values.T:
        both = np.hstack([fractions, -sigma * f[:, None]])
        triangle = np.linalg.qr(np.vstack([both.real, both.imag]) * weight[:, None])[1]
        rows.append(triangle[n:, n:])
    size = np.linalg.norm(values * root[:, None]) / k.size
    relaxed = np.sum(sigma.real, axis=0) * size
    matrix = np.vstack([*rows, relaxed])
    wanted = np.append(np.zeros(len(matrix) - 1), k.size * size)
    scale = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
    found = np.linalg.lstsq(matrix / scale, wanted, rcond=None)[0] / scale
    c, d = found[:n], found[n]
    if abs(d) < _LEAST_CONSTANT:  # sigma that vanishes at infinity has a zero there
        d = _LEAST_CONSTANT if d >= 0.0 else -_LEAST_CONSTANT
    a, b = modes.matrix(), np.ones(n)
    b[modes.rates.size :: 2], b[modes.rates.size + 1 :: 2] = 2.0, 0.0
    return _decaying(np.linalg.eigvals(a - np.outer(b, c) / d))


def _decaying(poles: ComplexArray) -> Modes:
    """Modes of these poles, those that grow flipped."""
    real = np.abs(poles.imag) <= _REAL * np.abs(poles)
    tiny = 1e-9 * float(np.max(np.abs(poles)))
    rates = np.maximum(np.abs(poles[real].real), tiny)
    pairs = poles[~real & (poles.imag > 0.0)]
    return Modes(rates, np.stack([np.maximum(np.abs(pairs.real), tiny), pairs.imag], axis=1))
