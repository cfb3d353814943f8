r"""The flow linearised about a steady state: one operator from which every dynamic derivative is read.

With q the disturbance of the flow and u that of the motion, in reduced time ``s = 2Vt/c``,

    E dq/ds + J q = -B u,    loads - baseline = C q + D u,    E = 2 M V dW/dq,
    H(ik) = D - C (ik E + J)^{-1} B.

J, B, C and D are the exact derivatives of the discrete residual and of its loads (`indicial.cfd.flow.Jacobian`). D is
the piston jump: a wall's pressure answers at once to its own motion. At k = 0 no complex solve is needed:

    J x0 = -B,    J x1 = -E x0,    H(0) = D + C x0,    H'(0) = C x1.

About a symmetric flow on half a body the symmetric inputs (alpha, q) and the antisymmetric ones (beta, p, r) part into
two operators that differ only in the sign of the images behind the symmetry plane.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from indicial.cfd.flow.gas import conservative_jacobian
from indicial.cfd.flow.jacobian import Jacobian
from indicial.cfd.march.ilu import Pattern
from indicial.cfd.march.krylov import gmres
from indicial.cfd.march.preconditioner import TwoLevel
from indicial.cfd.march.steady import SteadyState, local_time_step
from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities, mesh_from_body, turning
from indicial.errors import DivergenceError, InputError
from indicial.motion import FlightCondition

log = logging.getLogger(__name__)

SYMMETRIC, ANTISYMMETRIC = 1.0, -1.0

KRYLOV_VECTORS = 160
"""Of a cycle of GMRES. Most solutions take 20 to 60; on wide meshes at transonic speed some take more than 80, and
begun again after so few they stall."""

SHARED = 0.02
"""Difference of two shifts, over the rate at which waves cross the large cells, for which one factorisation will do."""

_INPUTS = {SYMMETRIC: ("alpha", "q"), ANTISYMMETRIC: ("beta", "p", "r")}
_OUTPUTS = {SYMMETRIC: ("CA", "CN", "Cm"), ANTISYMMETRIC: ("CY", "Cl", "Cn")}


@dataclass(frozen=True)
class SolveCount:
    """What an operator has spent.

    Parameters
    ----------
    solves : int
        Linear systems solved.
    products : int
        Products with ``shift E + J`` in them.
    factorisations : int
        Incomplete factorisations made for all of them.
    """

    solves: int = 0
    products: int = 0
    factorisations: int = 0

    def __add__(self, other: SolveCount) -> SolveCount:
        return SolveCount(
            self.solves + other.solves, self.products + other.products, self.factorisations + other.factorisations
        )


class FlowOperator:
    """The linearised flow about one steady state; satisfies `indicial.solver.LinearisedFlow`.

    Parameters
    ----------
    jacobian : Jacobian
        At `state`; both halves of a symmetric flow share it.
    pattern : Pattern
        `Pattern.wide` of the grid.
    state : SteadyState
        Converged: the operator inherits its error.
    baseline : ndarray
        Its six coefficients.
    condition : FlightCondition
    reference : ReferenceQuantities
    symmetry : {None, 1, -1}
        None where nothing cuts the body; on half a body, 1 for the symmetric operator, -1 for the antisymmetric one.
    plane : bool
        A two-dimensional flow: inputs alpha and q only.
    tolerance : float
        Residual of a solution relative to its right-hand side.

    Notes
    -----
    Inputs are alpha, beta [rad] and ``q c/2V, p b/2V, r b/2V``, whatever `reference` says of rates: state-space
    models in reduced time share this.
    """

    def __init__(
        self,
        jacobian: Jacobian,
        pattern: Pattern,
        state: SteadyState,
        baseline: Array,
        condition: FlightCondition,
        reference: ReferenceQuantities,
        *,
        symmetry: float | None = None,
        plane: bool = False,
        tolerance: float = 1e-8,
    ) -> None:
        if not 0.0 < tolerance < 1.0:
            raise InputError(f"the operator's tolerance is {tolerance}, must lie between 0 and 1")
        self.condition, self.reference, self.baseline = condition, reference, baseline
        self.tolerance = tolerance
        self.spent = SolveCount()
        self._pattern, self._parity = pattern, SYMMETRIC if symmetry is None else symmetry
        self._halved, self.plane = symmetry is not None, plane
        self._motion = state.motion
        self._grid = jacobian.grid
        self.jacobian = jacobian
        self._mass = (2.0 * condition.mach * self._grid.volume)[:, None, None] * conservative_jacobian(state.q)
        self._preconditioners: dict[complex, TwoLevel] = {}
        step = 2.0 * condition.mach * local_time_step(self._grid, state.q, state.motion)
        self._slow_rate = 1.0 / float(np.quantile(step, 0.95))
        if symmetry is None:
            both = _INPUTS[SYMMETRIC] + _INPUTS[ANTISYMMETRIC]
            self.inputs: tuple[str, ...] = _INPUTS[SYMMETRIC] if plane else both
            self.outputs: tuple[str, ...] = _OUTPUTS[SYMMETRIC] if plane else COEFFICIENTS
        else:
            self.inputs, self.outputs = _INPUTS[symmetry], _OUTPUTS[symmetry]

    @property
    def size(self) -> int:
        """Number of unknowns n, five a cell."""
        return 5 * self._grid.n_cells

    @property
    def omega(self) -> Array:
        """Rate of the steady state, mesh axes, solver units, (3,)."""
        return self._motion.omega

    @property
    def allowed_axes(self) -> NDArray[np.bool_]:
        """Which components of (V_b, omega), mesh axes, belong to this operator, (6,)."""
        symmetric = np.array([True, False, True, False, True, False])
        if self.plane:
            return symmetric
        if not self._halved:
            return np.ones(6, dtype=bool)
        return symmetric if self._parity == SYMMETRIC else ~symmetric

    @cached_property
    def motions(self) -> tuple[Array, Array]:
        """What a unit of each input does to V_b and omega, mesh axes, solver units, each (3, n_inputs)."""
        c, mach = self.condition, self.condition.mach
        velocity, omega = np.zeros((3, len(self.inputs))), np.zeros((3, len(self.inputs)))
        for j, name in enumerate(self.inputs):
            if name in ("alpha", "beta"):
                velocity[:, j] = mach * mesh_from_body(turning(name, c.alpha, c.beta))
            else:
                axis = "pqr".index(name)
                arm = float(self.reference.moment_lengths[axis]) / self.reference.length
                omega[:, j] = mesh_from_body(np.eye(3)[axis]) * 2.0 * mach / arm
        return velocity, omega

    @cached_property
    def velocity_and_rate(self) -> tuple[Array, Array]:
        """dR/dV_b and dR/domega, mesh axes, solver units, each (n, 3)."""
        velocity, omega = self.jacobian.inputs()
        return velocity.reshape(-1, 3), omega.reshape(-1, 3)

    @cached_property
    def b(self) -> Array:
        """(n, n_inputs)."""
        (velocity, omega), (v, w) = self.velocity_and_rate, self.motions
        combined: Array = velocity @ v + omega @ w
        return combined

    @cached_property
    def _load_faces(self) -> Array:
        """How each output weighs the momentum fluxes of the wall faces, (n_outputs, walls, 3)."""
        g, c = self._grid, self.reference.length
        normal, area = g.normal[g.wall_faces], g.area[g.wall_faces]
        scale = (1.0 + self._halved) / (0.5 * self.condition.mach**2 * self.reference.area / c**2)
        arms = self.reference.moment_lengths / c * [-1.0, 1.0, -1.0]
        pressure = np.concatenate([normal, g.moment[g.wall_faces] / area[:, None] / arms], axis=1)
        chosen = [COEFFICIENTS.index(name) for name in self.outputs]
        rows: Array = scale * pressure.T[chosen, :, None] * normal
        return rows

    @cached_property
    def c(self) -> Array:
        """(n_outputs, n)."""
        rows = np.empty((len(self.outputs), self.size))
        for row, weights in zip(rows, self._load_faces, strict=True):
            phi = np.zeros((len(self._grid.owner), 5))
            phi[self._grid.wall_faces, 1:4] = weights
            row[:] = self.jacobian.face_fluxes_transposed(phi, self._parity).ravel()
        return rows

    @cached_property
    def direct(self) -> tuple[Array, Array]:
        """Direct part of the loads in V_b and in omega, mesh axes, solver units, each (n_outputs, 3)."""
        g = self._grid
        weights = np.sum(self._load_faces * self.jacobian.flux_swept[g.wall_faces, 1:4], axis=2)
        return weights @ g.normal[g.wall_faces], weights @ (g.moment[g.wall_faces] / g.area[g.wall_faces, None])

    @cached_property
    def d(self) -> Array:
        """(n_outputs, n_inputs)."""
        (velocity, omega), (v, w) = self.direct, self.motions
        combined: Array = velocity @ v + omega @ w
        return combined

    def wall_loads(self, x: Array, motion: str | None = None) -> Array:
        """What each wall face adds to the loads of a real disturbance x (n,), shape (n_outputs, walls).

        With the direct part of a unit of the input `motion`; in the order of the mesh's wall faces. Their sum is
        ``C x + D u``.
        """
        g, weights = self._grid, self._load_faces
        change = self.jacobian.face_fluxes(x.reshape(-1, 5), self._parity)[g.wall_faces, 1:4].copy()
        if motion is not None:
            velocity, omega = (m[:, self.inputs.index(motion)] for m in self.motions)
            swept = g.normal[g.wall_faces] @ velocity + g.moment[g.wall_faces] @ omega / g.area[g.wall_faces]
            change += swept[:, None] * self.jacobian.flux_swept[g.wall_faces, 1:4]
        loads: Array = np.einsum("owk,wk->ow", weights, change)
        return loads

    def apply(self, x: NDArray[Any], *, transposed: bool = False) -> NDArray[Any]:
        """``J x``, or ``J^T x``; x real or complex, (n,)."""
        product = self.jacobian.apply_transposed if transposed else self.jacobian.apply
        return product(x.reshape(-1, 5), self._parity).ravel()

    def apply_mass(self, x: NDArray[Any], *, transposed: bool = False) -> NDArray[Any]:
        """``E x``, or ``E^T x``."""
        out: NDArray[Any] = np.einsum(
            "nji,nj->ni" if transposed else "nij,nj->ni", self._mass, x.reshape(-1, 5)
        ).ravel()
        return out

    def solve(
        self,
        rhs: NDArray[Any],
        shift: complex = 0.0,
        *,
        transposed: bool = False,
        start: NDArray[Any] | None = None,
    ) -> NDArray[Any]:
        """x with ``(shift E + J) x = rhs``, or with its transpose (nothing conjugated), (n,).

        Raises
        ------
        DivergenceError
            If the tolerance is not reached: the steady state is not one, or the flow is close to unstable.
        """
        if complex(shift).imag == 0.0:
            shift = complex(shift).real  # a real system, of whatever type its shift is
        preconditioner = self._preconditioner(shift)
        mass = shift * self._mass
        letters = "nji,nj->ni" if transposed else "nij,nj->ni"
        product = self.jacobian.apply_transposed if transposed else self.jacobian.apply

        def apply(x: NDArray[Any]) -> NDArray[Any]:
            y = product(x, self._parity)
            if shift:
                y = y + np.einsum(letters, mass, x)
            return y

        solution = gmres(
            apply,
            preconditioner.solve_transposed if transposed else preconditioner.solve,
            (rhs.astype(complex) if isinstance(shift, complex) else rhs).reshape(-1, 5),
            self.tolerance,
            restart=KRYLOV_VECTORS,
            restarts=4,
            start=None if start is None else start.reshape(-1, 5),
        )
        self.spent += SolveCount(1, solution.products)
        log.debug("shift %s: %d products, residual %.1e", shift, solution.products, solution.relative_residual)
        if not solution.relative_residual <= self.tolerance:
            raise DivergenceError(
                f"the linearised flow was solved to {solution.relative_residual:.1e} only (wanted {self.tolerance:.1e})"
                f" after {solution.products} products, at a shift of {shift:.4g}"
            )
        return solution.x.ravel()

    def _preconditioner(self, shift: complex) -> TwoLevel:
        """The factorisation for a shift, or one for a shift that differs by little beside the cells' own rates."""
        for other, made in self._preconditioners.items():
            # a real system wants real factors; those serve a complex one as well
            if abs(shift - other) <= SHARED * self._slow_rate and (np.imag(other) == 0.0 or np.imag(shift) != 0.0):
                return made
        # beside that of k = 0, which serves all low frequencies, keep the last one only
        for other in [other for other in self._preconditioners if other != 0.0]:
            del self._preconditioners[other]
        extra = shift * self._mass if shift else None
        made = TwoLevel(self.jacobian, self._pattern, extra, parity=self._parity)
        self._preconditioners[shift] = made
        self.spent += SolveCount(factorisations=1)
        return made
