"""GMRES with right preconditioning, so that the residual it watches is the true one; real and complex."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from indicial.errors import DivergenceError, InputError

State = NDArray[Any]
"""Real or complex values of every cell, (nc, 5)."""

Operator = Callable[[Any], Any]
"""A linear map of states to states."""


class KrylovResult(NamedTuple):
    """Solution, its residual norm relative to the right-hand side's, and products with A spent."""

    x: State
    relative_residual: float
    products: int


def gmres(
    apply: Operator,
    precondition: Operator,
    b: State,
    tolerance: float,
    restart: int = 40,
    restarts: int = 4,
    *,
    start: State | None = None,
) -> KrylovResult:
    """Solve ``A x = b`` by restarted GMRES (Saad & Schultz 1986), ``x = x0 + M^-1 y``.

    Classical Gram-Schmidt is run twice: as stable as the modified one and all in matrix-vector products. Where the
    tolerance is not met, by a singular matrix or by too few restarts, the residual returned is computed afresh from
    the solution returned: the caller judges.

    Parameters
    ----------
    apply, precondition : callable
        ``A x`` and ``M^-1 x`` of states.
    b : ndarray
        Right-hand side, any shape. The solution is complex if `b` or `start` is; A and M may be complex only then.
    tolerance : float
        Wanted residual norm relative to that of b.
    restart, restarts : int
        Vectors between restarts, and cycles of so many.
    start : ndarray, optional
        First guess x0; zero without it.

    Raises
    ------
    InputError
        If b or x0 is not finite.
    DivergenceError
        If a product with A or M^-1 is not finite.
    """
    dtype = np.result_type(b, np.float64) if start is None else np.result_type(b, start, np.float64)
    shape, norm_b = b.shape, float(np.linalg.norm(b))
    if not np.isfinite(norm_b):
        raise InputError("the right-hand side of a linear system is not finite")
    x = np.zeros(shape, dtype=dtype)
    if norm_b == 0.0:
        return KrylovResult(x, 0.0, 0)
    target, products = tolerance * norm_b, 0
    r = b.astype(dtype)
    if start is not None:
        if not np.all(np.isfinite(start)):
            raise InputError("the first guess of a linear system's solution is not finite")
        x += start
        r -= apply(x)
        products += 1
    beta = float(np.linalg.norm(r))
    basis = np.empty((restart + 1, b.size), dtype=dtype)
    for _ in range(restarts):
        if beta <= target:
            break
        basis[0] = r.ravel() / beta
        y, estimate = _arnoldi(apply, precondition, basis, shape, beta, target)
        products += len(y)
        x += precondition((y @ basis[: len(y)]).reshape(shape))
        if estimate <= target:
            beta = estimate
            break
        r = b - apply(x)
        products += 1
        before, beta = beta, float(np.linalg.norm(r))
        if beta >= (1.0 - 1e-12) * before:
            break
    return KrylovResult(x, beta / norm_b, products)


def _arnoldi(
    apply: Operator, precondition: Operator, basis: State, shape: tuple[int, ...], beta: float, target: float
) -> tuple[State, float]:
    """One cycle from ``basis[0]``, a residual of norm `beta`: coefficients y of the basis, and the residual then."""
    restart = len(basis) - 1
    h = np.zeros((restart + 1, restart), dtype=basis.dtype)
    # the residual is beta e1 projected on the null vector of H^H, which grows by one entry with each column
    null = np.zeros(restart + 1, dtype=basis.dtype)
    null[0] = 1.0
    for j in range(restart):
        product = apply(precondition(basis[j].reshape(shape))).ravel()
        column, basis[j + 1] = orthogonalise(basis[: j + 1], product)
        h[: j + 2, j] = column
        if abs(column[-1]) <= 1e-14 * float(np.linalg.norm(column)):
            # nothing new in the product: the space holds the solution, or the matrix is singular
            break
        null[j + 1] = -(np.conj(column[:-1]) @ null[: j + 1]) / column[-1]
        if beta <= target * np.linalg.norm(null):
            break
    used = j + 1
    h, start = h[: used + 1, :used], np.zeros(used + 1)
    start[0] = beta
    y: State = np.linalg.lstsq(h, start, rcond=1e-14)[0]
    return y, float(np.linalg.norm(start - h @ y))


def orthogonalise(basis: State, w: State) -> tuple[State, State]:
    """Components of w along the orthonormal rows of `basis`, then the norm of the rest; and the rest made unit.

    Raises
    ------
    DivergenceError
        If w is not finite.
    """
    components = np.zeros(len(basis) + 1, dtype=basis.dtype)
    for _ in range(2):
        along = np.conj(basis @ np.conj(w))  # never a conjugate of the whole basis
        w = w - along @ basis
        components[:-1] += along
    size = float(np.linalg.norm(w))
    if not np.isfinite(size):
        raise DivergenceError("a product with the matrix of a linear system, or with its preconditioner, is not finite")
    components[-1] = size
    return components, w / size if size > 0.0 else w
