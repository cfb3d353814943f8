"""Linearised flows small enough to be solved directly: exact frequency and step responses of any of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import block_diag, expm, lu_factor, lu_solve

from indicial.conventions import Array, ReferenceQuantities
from indicial.motion import FlightCondition
from rom.cases import COLUMNS, CONDITION, OUTPUTS, REFERENCE, ROWS, known_system


@dataclass(frozen=True)
class DenseFlow:
    """``E dx/ds + J x = -B u``, ``y = C x + D u`` by dense algebra; a `LinearisedFlow`."""

    mass: Array
    jacobian: Array
    b: Array
    c: Array
    d: Array
    inputs: tuple[str, ...] = ("alpha", "q")
    outputs: tuple[str, ...] = OUTPUTS
    condition: FlightCondition = CONDITION
    reference: ReferenceQuantities = REFERENCE
    plane: bool = False
    noise: float = 0.0  # relative error of every solution, as an iterative solver leaves it

    @property
    def baseline(self) -> Array:
        return np.array([0.02, 0.0, 0.1, 0.0, -0.04, 0.0])

    def apply(self, x: NDArray[Any], *, transposed: bool = False) -> NDArray[Any]:
        product: NDArray[Any] = (self.jacobian.T if transposed else self.jacobian) @ x
        return product

    def apply_mass(self, x: NDArray[Any], *, transposed: bool = False) -> NDArray[Any]:
        product: NDArray[Any] = (self.mass.T if transposed else self.mass) @ x
        return product

    def solve(
        self,
        rhs: NDArray[Any],
        shift: complex = 0.0,
        *,
        transposed: bool = False,
        start: NDArray[Any] | None = None,
    ) -> NDArray[Any]:
        matrix = shift * self.mass + self.jacobian
        x: NDArray[Any] = np.linalg.solve(matrix.T if transposed else matrix, rhs)
        if self.noise:
            wrong = np.random.default_rng(3).normal(size=x.shape)
            x = x + self.noise * np.linalg.norm(x) / np.linalg.norm(wrong) * wrong
        return x

    def transfer(self, k: ArrayLike) -> NDArray[np.complex128]:
        """``H(ik)``, shape (n_k, n_outputs, n_inputs)."""
        values = [self.d - self.c @ np.linalg.solve(1j * w * self.mass + self.jacobian, self.b) for w in np.ravel(k)]
        return np.array(values, dtype=np.complex128)

    def static(self) -> Array:
        """``H(0)``."""
        return self.transfer([0.0])[0].real

    def rate(self) -> Array:
        """``H'(0) = C J^-1 E J^-1 B``."""
        factors = lu_factor(self.jacobian)
        slope: Array = self.c @ lu_solve(factors, self.mass @ lu_solve(factors, self.b))
        return slope

    def step(self, end: float, count: int) -> tuple[Array, Array]:
        """Reduced times (count,) from 0 to `end`, and exact unit-step responses (count, n_outputs, n_inputs)."""
        s = np.linspace(0.0, end, count)
        settled = -np.linalg.solve(self.jacobian, self.b)
        advance = expm(-np.linalg.solve(self.mass, self.jacobian) * s[1])
        state, values = -settled, []
        for _ in s:
            values.append(self.c @ (settled + state) + self.d)
            state = advance @ state
        return s, np.array(values)


def random_flow(n: int = 200, seed: int = 1, outputs: tuple[str, ...] = OUTPUTS, noise: float = 0.0) -> DenseFlow:
    """A stable, strongly non-normal descriptor system with mass of 5 x 5 blocks of very different size."""
    rng = np.random.default_rng(seed)
    size = np.exp(rng.uniform(-4.0, 4.0, n // 5))
    mass = block_diag(*(volume * (np.eye(5) + 0.2 * rng.normal(size=(5, 5))) for volume in size))
    decay = np.zeros((n, n))
    position = 0
    while position < n:  # rates from 0.05 to 30 per unit of s, every third with a frequency
        rate, frequency = np.exp(rng.uniform(np.log(0.05), np.log(30.0))), rng.uniform(0.0, 3.0)
        if position % 3 or position == n - 1:
            decay[position, position] = rate
            position += 1
        else:
            decay[position : position + 2, position : position + 2] = [[rate, frequency], [-frequency, rate]]
            position += 2
    upper = np.triu(rng.normal(size=(n, n)), 2) * 0.3 * np.minimum.outer(np.diag(decay), np.diag(decay))
    turn = np.linalg.qr(rng.normal(size=(n, n)))[0]
    jacobian = mass @ turn @ (decay + upper) @ turn.T
    b = mass @ rng.normal(size=(n, 2)) / np.sqrt(n)
    c, d = rng.normal(size=(len(outputs), n)) / np.sqrt(n), rng.normal(size=(len(outputs), 2))
    return DenseFlow(mass, jacobian, b, c, d, outputs=outputs, noise=noise)


def pipe(cells: int = 100, mach: float = 0.3, reflection: float = 0.6) -> DenseFlow:
    """Sound in a flow through a pipe of unit length, upwind finite volumes of graded size.

    Waves f and g run with ``1 + M`` and ``-(1 - M)``; f starts from the inflow as `reflection` times g and what alpha
    sends in, g from the outflow as `reflection` times f; q forces both all along. The loads are the mean
    pressure ``f + g`` and its first moment.
    """
    edges = np.linspace(0.0, 1.0, cells + 1) ** 1.5
    size, centre = np.diff(edges), (edges[:-1] + edges[1:]) / 2.0
    difference = np.eye(cells) - np.eye(cells, k=-1)
    jacobian = np.block([
        [(1.0 + mach) * difference, np.zeros((cells, cells))],
        [np.zeros((cells, cells)), (1.0 - mach) * difference.T],
    ])  # fmt: skip
    jacobian[0, cells] = -(1.0 + mach) * reflection
    jacobian[-1, cells - 1] = -(1.0 - mach) * reflection
    b = np.zeros((2 * cells, 2))
    b[0, 0] = -(1.0 + mach)
    b[:, 1] = -np.concatenate([size * centre, -size * (1.0 - centre)])
    c = np.array([np.tile(size, 2), np.tile(size * (centre - 0.4), 2)])
    return DenseFlow(np.diag(np.tile(size, 2)), jacobian, b, c, np.array([[0.8, 0.1], [-0.2, 0.3]]))


def known_flow(n: int = 40) -> DenseFlow:
    """The five-state known system, in the middle of states that no input moves or no load sees."""
    system, rng = known_system(), np.random.default_rng(5)
    a = np.diag([-0.2, -0.7, -0.35, -0.3, -0.3])
    a[3, 4], a[4, 3] = 0.5, -0.5
    b = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0], [0.0, 0.0]])
    c = np.hstack([system.c[ROWS].real, np.zeros((2, 1))])
    rest = n - 5
    all_a = np.block([[a, np.zeros((5, rest))], [rng.normal(size=(rest, 5)), -np.diag(rng.uniform(0.1, 9.0, rest))]])
    all_b = np.vstack([b, rng.normal(size=(rest, 2))])
    all_c = np.hstack([c, np.zeros((2, rest))])
    mass, turn = np.diag(rng.uniform(0.5, 2.0, n)), np.linalg.qr(rng.normal(size=(n, n)))[0]
    d = system.d[np.ix_(ROWS, COLUMNS)]
    return DenseFlow(mass, -mass @ turn @ all_a @ turn.T, -mass @ turn @ all_b, all_c @ turn.T, d)
