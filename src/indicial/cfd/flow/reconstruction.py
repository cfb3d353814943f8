r"""Second-order reconstruction: least-squares gradients and a smooth face limiter.

A face between cells i and j with centres ``d`` apart takes from cell i, variable by variable,

    q_L = q_i + g_i . r - (1 - psi(a, b)) (r.d / d^2) g_i . d,     b = q_j - q_i,     a = 2 g_i . d - b,
    psi = 2 (a b + eps) / (a^2 + b^2 + 2 eps)

with r from the cell's centre to the face's. On a straight line of cells a and b are the differences behind and
ahead and psi g.d is the limited slope of van Albada, van Leer & Roberts (1982), uncut, so that it has no corner:
Newton's iteration cycles between the sides of one. Only the change along d is limited:
to scale the change across it, too, by a factor that turns on the small differences along d makes the scheme
unstable on skewed cells. ``eps = (h/c)^3``, h the cell spacing, leaves smooth extrema alone (Venkatakrishnan 1995).
Density and pressure increments pass through ``x / sqrt(1 + (x / (beta q))^2)``, which keeps them positive and is
exact to third order.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from indicial.cfd.flow.compiled import POINTWISE
from indicial.conventions import Array, Index

SATURATION = 0.8
"""beta: the largest part of its cell value by which density or pressure may change towards a face."""


UNRESOLVED = 0.03
"""Least part of a cell's neighbours (sum of squared direction cosines, relative to the best direction) from which
a gradient is taken; below it small differences would be blown up and the scheme is unstable."""


def least_squares_weights(steps: Array, offsets: Index) -> Array:
    """Weights w of ``grad q = sum_k w_k (q_k - q)`` over face neighbours, exact for linear fields.

    Parameters
    ----------
    steps : ndarray
        From each cell's centre to that of its neighbour, in rows (entries, 3); zero where there is none.
    offsets : ndarray
        Rows of the cell-to-face table.

    Returns
    -------
    ndarray
        (entries, 3), zero on boundary entries. Directions in which a cell has next to no neighbours (the height of a
        thin prism) get no gradient.
    """
    rows = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    square = np.sum(steps * steps, axis=1)
    w = np.divide(1.0, square, out=np.zeros_like(square), where=square > 0.0)
    normal = np.zeros((len(offsets) - 1, 3, 3))
    np.add.at(normal, rows, w[:, None, None] * steps[:, :, None] * steps[:, None, :])
    inverse = np.linalg.pinv(normal, rcond=UNRESOLVED, hermitian=True)
    weights: Array = np.einsum("nij,nj->ni", inverse[rows], w[:, None] * steps)
    return weights


@njit(**POINTWISE)
def limiter(a, b, eps):  # type: ignore[no-untyped-def]
    """psi(a, b) and its two slopes."""
    den = a * a + b * b + 2.0 * eps
    psi = 2.0 * (a * b + eps) / den
    return psi, 2.0 * (b - a * psi) / den, 2.0 * (a - b * psi) / den


@njit(**POINTWISE)
def saturate(x, q):  # type: ignore[no-untyped-def]
    """``x / sqrt(1 + (x/(beta q))^2)`` and its slopes in x and q."""
    most = SATURATION * q
    root = most / np.sqrt(most * most + x * x)
    cube = root * root * root
    t = x / most
    return x * root, cube, x * t * t / q * cube
