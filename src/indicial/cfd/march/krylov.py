"""Flexible-length GMRES with right preconditioning, so that the residual it watches is the true one."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from indicial.conventions import Array

Operator = Callable[[Array], Array]


class KrylovResult(NamedTuple):
    """Solution, its residual norm relative to the right-hand side's, and products with A spent."""

    x: Array
    relative_residual: float
    products: int


def gmres(
    apply: Operator, precondition: Operator, b: Array, tolerance: float, restart: int = 40, restarts: int = 4
) -> KrylovResult:
    """Solve ``A x = b`` by restarted GMRES (Saad & Schultz 1986), ``x = M^-1 y``.

    Classical Gram-Schmidt is run twice: as stable as the modified one and all in matrix-vector products.
    """
    shape, norm_b = b.shape, float(np.linalg.norm(b))
    x = np.zeros_like(b)
    if norm_b == 0.0:
        return KrylovResult(x, 0.0, 0)
    r, products = b.ravel().copy(), 0
    basis = np.empty((restart + 1, b.size))
    beta = norm_b
    for cycle in range(restarts):
        if cycle:
            r = (b - apply(x)).ravel()
            products += 1
            beta = float(np.linalg.norm(r))
            if beta <= tolerance * norm_b:
                break
        basis[0] = r / beta
        h = np.zeros((restart + 1, restart))
        rotations: list[tuple[float, float]] = []
        g = np.zeros(restart + 1)
        g[0] = beta
        used = 0
        for j in range(restart):
            w = apply(precondition(basis[j].reshape(shape))).ravel()
            products += 1
            v = basis[: j + 1]
            first = v @ w
            w -= first @ v
            second = v @ w
            w -= second @ v
            h[: j + 1, j] = first + second
            h[j + 1, j] = np.linalg.norm(w)
            if h[j + 1, j] > 0.0:
                basis[j + 1] = w / h[j + 1, j]
            for i, (cs, sn) in enumerate(rotations):
                h[i, j], h[i + 1, j] = cs * h[i, j] + sn * h[i + 1, j], -sn * h[i, j] + cs * h[i + 1, j]
            size = float(np.hypot(h[j, j], h[j + 1, j]))
            cs, sn = h[j, j] / size, h[j + 1, j] / size
            rotations.append((cs, sn))
            h[j, j], h[j + 1, j] = size, 0.0
            g[j], g[j + 1] = cs * g[j], -sn * g[j]
            used = j + 1
            if abs(g[used]) <= tolerance * norm_b:
                break
        y = np.linalg.solve(h[:used, :used], g[:used])
        x += precondition((y @ basis[:used]).reshape(shape))
        beta = abs(float(g[used]))
        if beta <= tolerance * norm_b:
            break
    return KrylovResult(x, beta / norm_b, products)
