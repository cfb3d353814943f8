r"""The exact derivatives of the second-order residual and of the face fluxes, as factors.

The residual depends on cell states and on gradients, each of them face-local, so

    J x = dR/dq x = sum_f [ D_L (a_L x + b_L G x) + D_R (a_R x + b_R G x) ] + source,

with ``D_L, D_R`` the derivatives of the numerical flux with respect to the two face states (complex step through
the flux itself, so exact to round-off), ``a, b`` those of the reconstruction, and G the least-squares gradient. The
transpose runs the same factors backwards. The derivative of the flux with respect to the face's normal velocity u_g
gives the input matrices: ``u_g A = V_b.A_f + omega.M_f``, so

    dR/dV_b = sum_f F'(u_g) A_f,    dR/domega = sum_f F'(u_g) M_f + V (e x rho v).

On a mesh cut by a symmetry plane a disturbance of a symmetric flow is symmetric (`parity` 1) or antisymmetric (-1);
the sign is that of the images behind the plane, so both are found on the same half.

The limiter and the flux have corners (a sign change, a wave speed through zero); there the branch taken by the
state itself is differentiated.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from indicial.cfd.flow import products
from indicial.cfd.flow.linearise import linearise_faces
from indicial.cfd.flow.residual import MeshMotion, Residual, gather, gradients
from indicial.conventions import Array, Index


class Jacobian:
    """Derivatives of the residual and of the face fluxes at one state and motion.

    Parameters
    ----------
    residual : Residual
        Whose derivatives; its gradient array is refreshed at q.
    q : ndarray
        State (nc, 5).
    motion : MeshMotion

    Attributes
    ----------
    flux_left, flux_right : ndarray
        ``D_L, D_R`` of every face, times its area (nf, 5, 5); flux_right is zero where nothing lies behind the face.
    flux_swept : ndarray
        ``F'(u_g)`` of every face, times its area (nf, 5).
    slopes : ndarray
        Of the reconstruction on both sides: own cell, other cell, along r, along d (nf, 2, 5, 4).
    """

    def __init__(self, residual: Residual, q: Array, motion: MeshMotion) -> None:
        g = residual.grid
        nf = len(g.owner)
        self.grid = g
        self.second_order = residual.second_order
        self.flux_left: Array = np.empty((nf, 5, 5))
        self.flux_right: Array = np.zeros((nf, 5, 5))
        self.flux_swept: Array = np.empty((nf, 5))
        self.slopes: Array = np.zeros((nf, 2, 5, 4))
        self._work: dict[str, Array] = {}
        residual.update_gradient(q)
        linearise_faces(
            q,
            residual.gradient,
            motion.velocity,
            motion.omega,
            g.owner,
            g.neighbour,
            g.kind,
            g.normal,
            g.area,
            g.moment,
            g.to_owner,
            g.to_neighbour,
            g.softening,
            residual.far,
            self.flux_left,
            self.flux_right,
            self.flux_swept,
            self.slopes,
        )
        self._momentum = g.volume[:, None] * q[:, :1] * q[:, 1:4]
        self.source = _source_jacobian(q, motion, g.volume)

    def _array(self, name: str, shape: tuple[int, ...], dtype: np.dtype[Any]) -> Array:
        """A work array, kept from call to call."""
        found = self._work.get(name)
        if found is None or found.dtype != dtype:
            found = self._work[name] = np.zeros(shape, dtype)
        return found

    def face_fluxes(self, x: Array, parity: float = 1.0) -> Array:
        """Change of the face fluxes times area for a change x of the cells, (nf, 5); a work array."""
        g = self.grid
        gradient = self._array("gradient", (g.n_cells, 5, 3), x.dtype)
        flux = self._array("flux", (len(g.owner), 5), x.dtype)
        if self.second_order:
            gradients(x, g.offsets, g.faces, g.cells, g.weights, g.normal, parity, gradient)
        else:
            gradient[:] = 0.0
        products.linear_fluxes(
            x,
            gradient,
            g.owner,
            g.neighbour,
            g.kind,
            g.normal,
            parity,
            g.to_owner,
            g.to_neighbour,
            self.flux_left,
            self.flux_right,
            self.slopes,
            flux,
        )
        return flux

    def apply(self, x: Array, parity: float = 1.0) -> Array:
        """J x, shape (nc, 5), real or complex."""
        g = self.grid
        flux = self.face_fluxes(x, parity)
        out = np.empty((g.n_cells, 5), x.dtype)
        gather(flux, g.offsets, g.faces, g.signs, out)
        if self.source is not None:
            out += np.einsum("nij,nj->ni", self.source, x)
        return out

    def face_fluxes_transposed(self, phi: Array, parity: float = 1.0) -> Array:
        """What cells receive, (nc, 5), from sensitivities phi (nf, 5) of the face fluxes times area."""
        g = self.grid
        states = self._array("states", (len(g.owner), 2, 5), phi.dtype)
        gradient = self._array("gradient", (g.n_cells, 5, 3), phi.dtype)
        out = np.empty((g.n_cells, 5), phi.dtype)
        products.spread_states(phi, g.neighbour, g.kind, g.normal, parity, self.flux_left, self.flux_right, states)
        products.collect_states(
            states,
            g.offsets,
            g.faces,
            g.signs,
            g.cells,
            g.normal,
            parity,
            g.to_owner,
            g.to_neighbour,
            self.slopes,
            out,
            gradient,
        )
        if self.second_order:
            products.spread_gradients(gradient, g.offsets, g.faces, g.cells, g.twins, g.weights, g.normal, parity, out)
        return out

    def apply_transposed(self, y: Array, parity: float = 1.0) -> Array:
        """J^T y, shape (nc, 5), real or complex."""
        g = self.grid
        phi = y[g.owner]
        phi[: g.n_interior] -= y[g.neighbour]
        out = self.face_fluxes_transposed(phi, parity)
        if self.source is not None:
            out += np.einsum("nji,nj->ni", self.source, y)
        return out

    def inputs(self) -> tuple[Array, Array]:
        """dR/dV_b and dR/domega, each (nc, 5, 3): the last axis is the component in mesh axes."""
        g = self.grid
        velocity, omega = np.empty((g.n_cells, 5, 3)), np.empty((g.n_cells, 5, 3))
        for matrix, arm in ((velocity, g.normal), (omega, g.moment / g.area[:, None])):
            for x in range(3):
                column = np.empty((g.n_cells, 5))
                gather(self.flux_swept * arm[:, x, None], g.offsets, g.faces, g.signs, column)
                matrix[..., x] = column
        omega[:, 1:4] += np.cross(np.eye(3)[None], self._momentum[:, None, :]).transpose(0, 2, 1)
        return velocity, omega

    def compact_blocks(
        self, extra: NDArray[Any], slots: Index, diagonal: Index, count: int, parity: float = 1.0
    ) -> NDArray[Any]:
        """First-order blocks in the sparse pattern given by `slots` and `diagonal`, shape (count, 5, 5)."""
        g = self.grid
        added = extra if self.source is None else extra + self.source
        out = np.empty((count, 5, 5), added.dtype)
        products.compact_blocks(
            g.offsets,
            g.faces,
            g.signs,
            g.cells,
            slots,
            diagonal,
            g.normal,
            parity,
            added,
            self.flux_left,
            self.flux_right,
            out,
        )
        return out


def _source_jacobian(q: Array, motion: MeshMotion, volume: Array) -> Array | None:
    """d(V omega x (rho v))/dq, or None without rotation."""
    if not np.any(motion.omega):
        return None
    wx, wy, wz = motion.omega
    spin = np.array([[0.0, -wz, wy], [wz, 0.0, -wx], [-wy, wx, 0.0]])
    out = np.zeros((len(volume), 5, 5))
    out[:, 1:4, 0] = volume[:, None] * (q[:, 1:4] @ spin.T)
    out[:, 1:4, 1:4] = (volume * q[:, 0])[:, None, None] * spin
    return out
