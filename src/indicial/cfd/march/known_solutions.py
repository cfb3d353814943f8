r"""First guesses from solutions already found: systems (sigma E + J) x = b that share J and E.

For each known x, J x is known too (it is ``b - sigma E x``), so that the combination of known solutions with the least
residual at another shift, or for another right-hand side, takes no product with J: the reduced basis of a frequency
sweep. Real and imaginary parts are kept as vectors of their own: J and E are real, so each stands for the solution at
the conjugate shift as well.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from indicial.cfd.march.krylov import State
from indicial.conventions import Array


class KnownSolutions:
    """Solutions of systems with one J (or one J^T) at any shifts.

    Parameters
    ----------
    mass : callable
        ``E x`` (or ``E^T x``) of real states (nc, 5).
    most : int
        Real vectors kept, the latest; each takes two states of storage.
    """

    def __init__(self, mass: Callable[[Array], Array], most: int = 24) -> None:
        self._mass = mass
        self._most = most
        self._solutions: list[Array] = []
        self._images: list[Array] = []

    def __len__(self) -> int:
        return len(self._solutions)

    def add(self, x: State, image: State) -> None:
        """Keep x and its `image` J x = b - sigma E x, as good as the residual of x is small."""
        parts = [(x.real, image.real)]
        if np.iscomplexobj(x):
            parts.append((x.imag, image.imag))
        for solution, product in parts:
            size = float(np.linalg.norm(solution))
            if size > 0.0:
                self._solutions.append(solution / size)
                self._images.append(product / size)
        del self._solutions[: -self._most], self._images[: -self._most]

    def guess(self, b: State, shift: complex = 0.0) -> State | None:
        """The combination of known solutions whose residual ``b - (shift E + J) x`` is least; None if none is known."""
        if not self._solutions:
            return None
        known = zip(self._solutions, self._images, strict=True)
        columns = [image if shift == 0.0 else image + shift * self._mass(x) for x, image in known]
        q, r = np.linalg.qr(np.stack([column.ravel() for column in columns], axis=1))
        weights = np.linalg.lstsq(r, np.conj(q.T @ np.conj(b.ravel())), rcond=1e-12)[0]
        out = np.zeros(b.shape, weights.dtype)
        for weight, x in zip(weights, self._solutions, strict=True):
            out += weight * x
        return out
