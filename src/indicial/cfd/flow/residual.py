r"""The residual R(q; V_b, omega) of the Euler equations on a rigidly moving mesh (Eqs. 18-22).

In body (mesh) axes, v the absolute velocity and ``u_g = V_b + omega x r`` the mesh velocity,

    V dW/dt + R = 0,   R = sum_f [ W (v.n - u_g.n) + p (0, n, v.n) ] A + V omega x (rho v).

The volume swept by a face is exactly ``V_b.A_f + omega.M_f``, so still air has R = 0 to round-off under any
motion. A cell on a symmetry plane has its own mirror image for a neighbour, so half a body gives to round-off what
the whole one gives; no motion may cross such a plane. Viscous fluxes will join the convective ones face by face: the
cells' gradients are at hand there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from indicial.cfd.flow.compiled import KERNEL
from indicial.cfd.flow.face_flux import boundary_fluxes, interior_fluxes, mirrored
from indicial.cfd.flow.gas import STILL_AIR
from indicial.cfd.flow.grid import MIRROR, Grid
from indicial.conventions import Array


@njit(**KERNEL)
def gradients(q, offsets, faces, cells, weights, normal, parity, out):  # type: ignore[no-untyped-def]
    """Least-squares gradients of every variable, out (nc, 5, 3).

    `parity` is the sign of the images behind symmetry planes: 1, or -1 for an antisymmetric disturbance.
    """
    for c in prange(q.shape[0]):
        q0, q1, q2, q3, q4 = q[c, 0], q[c, 1], q[c, 2], q[c, 3], q[c, 4]
        # sums in registers: through `out` each would wait for the one before
        x0 = x1 = x2 = x3 = x4 = q.dtype.type(0.0)
        y0 = y1 = y2 = y3 = y4 = q.dtype.type(0.0)
        z0 = z1 = z2 = z3 = z4 = q.dtype.type(0.0)
        for e in range(offsets[c], offsets[c + 1]):
            n = cells[e]
            if n >= 0:
                d0, d1, d2, d3, d4 = q[n, 0] - q0, q[n, 1] - q1, q[n, 2] - q2, q[n, 3] - q3, q[n, 4] - q4
            elif n == MIRROR:
                f = faces[e]
                u, v, w = mirrored(q1, q2, q3, normal[f, 0], normal[f, 1], normal[f, 2])
                d0, d4 = parity * q0 - q0, parity * q4 - q4
                d1, d2, d3 = parity * u - q1, parity * v - q2, parity * w - q3
            else:
                continue
            wx, wy, wz = weights[e, 0], weights[e, 1], weights[e, 2]
            x0, x1, x2, x3, x4 = x0 + wx * d0, x1 + wx * d1, x2 + wx * d2, x3 + wx * d3, x4 + wx * d4
            y0, y1, y2, y3, y4 = y0 + wy * d0, y1 + wy * d1, y2 + wy * d2, y3 + wy * d3, y4 + wy * d4
            z0, z1, z2, z3, z4 = z0 + wz * d0, z1 + wz * d1, z2 + wz * d2, z3 + wz * d3, z4 + wz * d4
        out[c, 0, 0], out[c, 0, 1], out[c, 0, 2] = x0, y0, z0
        out[c, 1, 0], out[c, 1, 1], out[c, 1, 2] = x1, y1, z1
        out[c, 2, 0], out[c, 2, 1], out[c, 2, 2] = x2, y2, z2
        out[c, 3, 0], out[c, 3, 1], out[c, 3, 2] = x3, y3, z3
        out[c, 4, 0], out[c, 4, 1], out[c, 4, 2] = x4, y4, z4


@njit(**KERNEL)
def gather(flux, offsets, faces, signs, out):  # type: ignore[no-untyped-def]
    """Sum of the fluxes out of each cell, in a fixed order whatever the number of threads."""
    for c in prange(offsets.shape[0] - 1):
        r0 = r1 = r2 = r3 = r4 = 0.0
        for e in range(offsets[c], offsets[c + 1]):
            f = faces[e]
            s = float(signs[e])
            r0 += s * flux[f, 0]
            r1 += s * flux[f, 1]
            r2 += s * flux[f, 2]
            r3 += s * flux[f, 3]
            r4 += s * flux[f, 4]
        out[c, 0] = r0
        out[c, 1] = r1
        out[c, 2] = r2
        out[c, 3] = r3
        out[c, 4] = r4


@njit(**KERNEL)
def _add_turning(q, volume, omega, out):  # type: ignore[no-untyped-def]
    """The turning of momentum with the axes: out += V omega x (rho v)."""
    for c in prange(volume.shape[0]):
        m = volume[c] * q[c, 0]
        u, v, w = m * q[c, 1], m * q[c, 2], m * q[c, 3]
        out[c, 1] += omega[1] * w - omega[2] * v
        out[c, 2] += omega[2] * u - omega[0] * w
        out[c, 3] += omega[0] * v - omega[1] * u


@dataclass(frozen=True)
class MeshMotion:
    """V_b and omega, mesh axes, in speeds of sound and reference lengths; each of shape (3,)."""

    velocity: Array
    omega: Array


class Residual:
    """The residual on one grid, with its work arrays.

    Parameters
    ----------
    grid : Grid
    second_order : bool
        False drops the gradients: the robust first-order scheme of a start.
    far : ndarray
        The state at infinity, shape (5,); still air unless a test says otherwise.
    """

    def __init__(self, grid: Grid, *, second_order: bool = True, far: Array = STILL_AIR) -> None:
        self.grid = grid
        self.second_order = second_order
        self.far = np.asarray(far, dtype=float)
        self.gradient: Array = np.zeros((grid.n_cells, 5, 3))
        self.face_flux: Array = np.empty((len(grid.owner), 5))

    def __call__(self, q: Array, motion: MeshMotion) -> Array:
        """R, shape (nc, 5); leaves the face fluxes in `face_flux`.

        A complex q or motion gives a complex R, for derivatives by the complex step.
        """
        g = self.grid
        dtype = np.result_type(q, motion.velocity, motion.omega)
        if self.face_flux.dtype != dtype:
            self.gradient, self.face_flux = self.gradient.astype(dtype), self.face_flux.astype(dtype)
        q = q.astype(dtype, copy=False)
        self.update_gradient(q)
        swept = motion.velocity, motion.omega
        interior_fluxes(q, self.gradient, *swept, g.owner, g.neighbour, g.blocks, self.face_flux)
        boundary_fluxes(
            q,
            self.gradient,
            *swept,
            g.owner,
            g.kind,
            g.normal,
            g.area,
            g.moment,
            g.to_owner,
            g.softening,
            self.far,
            self.face_flux,
        )
        out = np.empty((g.n_cells, 5), dtype)
        gather(self.face_flux, g.offsets, g.faces, g.signs, out)
        if np.any(motion.omega):
            _add_turning(q, g.volume, motion.omega, out)
        return out

    def update_gradient(self, q: Array) -> None:
        """Gradients of q into `gradient`."""
        if self.second_order:
            g = self.grid
            gradients(q, g.offsets, g.faces, g.cells, g.weights, g.normal, 1.0, self.gradient)
        else:
            self.gradient[:] = 0.0

    def forces(self, ambient_pressure: float) -> tuple[Array, Array]:
        """Force and moment of the gauge pressure on the walls from the last evaluation, mesh axes, each (3,).

        Both are in units of rho a^2 c^2 (and c); the moment is about the moment reference point.
        """
        faces = self.grid.wall_faces
        normal, area = self.grid.normal[faces], self.grid.area[faces]
        gauge = np.sum(self.face_flux[faces, 1:4] * normal, axis=1) / area - ambient_pressure
        return (gauge * area) @ normal, gauge @ self.grid.moment[faces]
