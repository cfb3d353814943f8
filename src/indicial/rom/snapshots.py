r"""Solutions of a linearised flow at a few shifts, and the spaces that they span.

Forward solutions ``X(s) = (s E + J)^{-1} B`` say what the inputs excite, adjoint ones ``Y(s) = (s E + J)^{-T} C^T``
what the loads see; s = ik for oscillations. Real and imaginary parts span real spaces; everything a reduced model
needs is the flow's operator between the two.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array
from indicial.rom.model import ComplexArray
from indicial.solver import LinearisedFlow

_TOLERANCE = 1e-8  # of the flow's solver: relative residuals, and new parts of a unit vector, below it are noise
_PROBES = 8


@dataclass(frozen=True)
class Operators:
    """A flow seen from test space (rows) and trial space (columns), both with orthonormal bases.

    Parameters
    ----------
    mass, jacobian : ndarray
        E and J, shape (n_test, n_trial).
    b, c : ndarray
        Shapes (n_test, n_inputs), (n_outputs, n_trial).
    d : ndarray
    """

    mass: Array
    jacobian: Array
    b: Array
    c: Array
    d: Array


class Snapshots:
    """Solutions at several shifts from one side, forward or adjoint, and an orthonormal basis Q of their span.

    Parameters
    ----------
    flow : LinearisedFlow
    adjoint : bool
        Solve with the transposed operator from the loads, instead of from the inputs.
    """

    def __init__(self, flow: LinearisedFlow, *, adjoint: bool = False) -> None:
        self.flow = flow
        self.adjoint = adjoint
        self.rhs: Array = np.ascontiguousarray(flow.c.T if adjoint else flow.b)
        n = len(self.rhs)
        self.shifts: list[complex] = []
        self.basis: Array = np.zeros((n, 0))
        self.mass: Array = np.zeros((n, 0))  # E Q, or E^T Q
        self.jacobian: Array = np.zeros((n, 0))
        self.solves = 0
        self._coordinates: list[NDArray[np.complex128]] = []
        self._weight = 1.0 / np.sqrt(_row_size(flow, transposed=adjoint))[:, None]

    @property
    def size(self) -> int:
        """Dimension of the space."""
        return int(self.basis.shape[1])

    def solve(self, shift: complex, guess: ComplexArray | None = None) -> ComplexArray:
        """Solutions at a shift for every right-hand side, shape (n, m); real work for a real shift.

        They are started from coordinates `guess` (size, m) in the basis.
        """
        real = shift.imag == 0.0
        solutions = np.empty(self.rhs.shape, dtype=complex)
        for j, column in enumerate(self.rhs.T):
            start = None if guess is None else self.basis @ (guess[:, j].real if real else guess[:, j])
            at = shift.real if real else shift
            solutions[:, j] = self.flow.solve(column, at, transposed=self.adjoint, start=start)
        self.solves += self.rhs.shape[1]
        return solutions

    def extend(self, shift: complex, solutions: ComplexArray) -> bool:
        """Take the solutions at a shift into the space; whether it grew."""
        fresh: list[Array] = []
        for column in np.hstack([solutions.real, solutions.imag]).T:
            length = np.linalg.norm(column)
            if length == 0.0:
                continue
            rest = column / length
            for _ in range(2):  # Gram and Schmidt, twice is enough
                rest = rest - self.basis @ (self.basis.T @ rest)
                for other in fresh:
                    rest = rest - other * (other @ rest)
            outside = np.linalg.norm(rest)
            if outside > _TOLERANCE:
                fresh.append(rest / outside)
        if fresh:
            self.basis = np.column_stack([self.basis, *fresh])
            self.mass = np.column_stack([self.mass, *(self._apply_mass(q) for q in fresh)])
            self.jacobian = np.column_stack([self.jacobian, *(self._apply(q) for q in fresh)])
        self.shifts.append(shift)
        self._coordinates.append(self.basis.T @ solutions)
        return bool(fresh)

    def coordinates(self, shift: complex) -> ComplexArray:
        """The solutions kept at a shift in the basis, shape (size, m)."""
        kept = self._coordinates[self.shifts.index(shift)]
        return np.vstack([kept, np.zeros((self.size - len(kept), kept.shape[1]))])

    def gramian_factor(self) -> Array:
        r"""Z in coordinates, ``Z Z^T = 1/2pi int X X^* dk`` over all frequencies, shape (size, n_columns).

        By the trapezoidal rule over the size of the shifts, with solutions that fall as its inverse beyond the last.
        """
        shifts = sorted(self.shifts, key=abs)
        k = np.abs(shifts)
        weights = np.zeros(k.size)
        weights[:-1] += np.diff(k) / 2.0
        weights[1:] += np.diff(k) / 2.0
        weights[-1] += k[-1]
        parts = [np.sqrt(w / np.pi) * self.coordinates(shift) for w, shift in zip(weights, shifts, strict=True)]
        return np.hstack([np.hstack([part.real, part.imag]) for part in parts])

    def residual_factor(self) -> Array:
        r"""R of the QR factors of ``W [F, E Q, J Q]``, F the right-hand sides: residual norms from coordinates alone.

        W divides by the square root of the mass of each equation, so that the norm is that of a density over space
        and small cells count as small.
        """
        return np.asarray(np.linalg.qr(self._weight * np.hstack([self.rhs, self.mass, self.jacobian]), mode="r"))

    def _apply(self, x: Array) -> Array:
        return self.flow.apply(x, transposed=self.adjoint)

    def _apply_mass(self, x: Array) -> Array:
        return self.flow.apply_mass(x, transposed=self.adjoint)


def operators(forward: Snapshots, adjoint: Snapshots) -> Operators:
    """The flow between the adjoint space (test) and the forward space (trial)."""
    flow, test = forward.flow, adjoint.basis
    return Operators(
        mass=test.T @ forward.mass,
        jacobian=test.T @ forward.jacobian,
        b=test.T @ forward.rhs,
        c=flow.c @ forward.basis,
        d=flow.d,
    )


def residual_norms(factor: Array, k: Array, states: ComplexArray) -> Array:
    """Norms of ``F - (ik E + J) Q states``, shape (n_k, m), from `Snapshots.residual_factor`.

    Those below the solver's tolerance say nothing and count as it does.

    Parameters
    ----------
    factor : ndarray
    k : ndarray
        Shape (n_k,).
    states : ndarray
        Coordinates, shape (n_k, size, m).
    """
    m = states.shape[2]
    unit = np.broadcast_to(np.eye(m), (k.size, m, m))
    combined = np.concatenate([unit, -1j * k[:, None, None] * states, -states], axis=1)
    norms = np.linalg.norm(factor @ combined, axis=1)
    return np.asarray(np.maximum(norms, _TOLERANCE * np.linalg.norm(factor[:, :m], axis=0)))


def _row_size(flow: LinearisedFlow, *, transposed: bool) -> Array:
    """Root of the mean square of each row of E (of E^T), shape (n,), from products with vectors of signs."""
    signs = np.random.default_rng(0).choice([-1.0, 1.0], size=(_PROBES, len(flow.b)))
    squares = [flow.apply_mass(sign, transposed=transposed) ** 2 for sign in signs]
    size = np.sqrt(np.mean(squares, axis=0))
    # an equation without mass is an algebraic one: it counts as the average equation does
    return np.asarray(np.where(size > 0.0, size, np.mean(size)))
