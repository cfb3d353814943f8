r"""A state-space model in modal form: one complex recurrence for each real pole or conjugate pair.

    dx_i/ds = lambda_i x_i + b_i u,    loads = Re(sum over i of c_i x_i) + D u

with lambda_i on or above the real axis, and c_i of a pair doubled to stand for its conjugate too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import matrix_balance

from indicial.conventions import Array
from indicial.rom.recurrence import ComplexArray, respond_modal

CONDITION_LIMIT = 1e6
"""Largest condition of the eigenvectors with which a modal form is taken: it loses about so many round-offs."""


@dataclass(frozen=True)
class ModalForm:
    """Poles and residues of a linear model.

    Parameters
    ----------
    real : int
        Number of real modes; they stand first.
    poles : ndarray
        Complex, imaginary part zero or positive, shape (n_modes,).
    b : ndarray
        Complex, shape (n_modes, n_inputs).
    c : ndarray
        Complex, shape (n_outputs, n_modes).
    d : ndarray
        Shape (n_outputs, n_inputs).
    """

    real: int
    poles: ComplexArray
    b: ComplexArray
    c: ComplexArray
    d: Array

    @classmethod
    def of(cls, a: Array, b: Array, c: Array, d: Array) -> ModalForm | None:
        """The modal form of ``(A, B, C, D)``; None if A is so near a matrix with too few eigenvectors that digits go.

        Poles that coincide are no hindrance as long as each has an eigenvector of its own.
        """
        if not len(a):
            none = np.zeros(0, dtype=complex)
            return cls(0, none, none.reshape(0, b.shape[1]), none.reshape(c.shape[0], 0), np.array(d))
        balanced, scale = matrix_balance(a, permute=False)
        poles, vectors = np.linalg.eig(balanced)
        if not np.linalg.cond(vectors) <= CONDITION_LIMIT:
            return None
        modal_b = np.linalg.solve(vectors, np.linalg.solve(scale, b)).astype(complex)
        modal_c = (c @ scale @ vectors).astype(complex)
        is_real, upper = poles.imag == 0.0, poles.imag > 0.0
        kept = np.concatenate([np.flatnonzero(is_real), np.flatnonzero(upper)])
        real = int(np.count_nonzero(is_real))
        doubled = np.where(np.arange(kept.size) < real, 1.0, 2.0)
        return cls(real, poles[kept].astype(complex), modal_b[kept], modal_c[:, kept] * doubled, np.array(d))

    def settled(self, inputs: Array) -> ComplexArray:
        """Modes at rest under constant `inputs`, shape (n_modes,)."""
        rest: ComplexArray = -(self.b @ inputs) / self.poles
        return rest

    def respond(self, s: Array, values: Array, before: Array) -> Array:
        """Loads (n, n_outputs) at reduced times `s` for inputs (n, n_inputs) linear between them, `before` before."""
        start = self.settled(before)
        loads: Array = respond_modal(
            self.real,
            self.poles,
            np.ascontiguousarray(s, dtype=float),
            np.ascontiguousarray(self.b),
            np.ascontiguousarray(self.c),
            np.ascontiguousarray(self.d),
            np.ascontiguousarray(values),
            start,
        )
        loads[0] = (self.c @ start).real + self.d @ values[0]  # a jump at the start is D to the last digit
        return loads
