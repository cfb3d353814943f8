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

from indicial.cfd.flow.flux import hllc, physical_flux, wall_flux
from indicial.cfd.flow.gas import STILL_AIR
from indicial.cfd.flow.grid import FARFIELD, MIRROR, OUTFLOW, SYMMETRY, Grid
from indicial.cfd.flow.reconstruction import limiter, saturate
from indicial.conventions import Array


@njit(cache=True, error_model="numpy")
def mirrored(u, v, w, nx, ny, nz):  # type: ignore[no-untyped-def]
    """A velocity reflected in a plane of unit normal n."""
    t = 2.0 * (u * nx + v * ny + w * nz)
    return u - t * nx, v - t * ny, w - t * nz


@njit(cache=True, parallel=True, error_model="numpy")
def gradients(q, offsets, faces, cells, weights, normal, parity, out):  # type: ignore[no-untyped-def]
    """Least-squares gradients of every variable, out (nc, 5, 3).

    `parity` is the sign of the images behind symmetry planes: 1, or -1 for an antisymmetric disturbance.
    """
    for c in prange(q.shape[0]):
        for k in range(5):
            for x in range(3):
                out[c, k, x] = 0.0
        for e in range(offsets[c], offsets[c + 1]):
            n = cells[e]
            wx, wy, wz = weights[e, 0], weights[e, 1], weights[e, 2]
            if n >= 0:
                for k in range(5):
                    dq = q[n, k] - q[c, k]
                    out[c, k, 0] += wx * dq
                    out[c, k, 1] += wy * dq
                    out[c, k, 2] += wz * dq
            elif n == MIRROR:
                m = normal[faces[e]]
                u, v, w = mirrored(q[c, 1], q[c, 2], q[c, 3], m[0], m[1], m[2])
                image = (q[c, 0], u, v, w, q[c, 4])
                for k in range(5):
                    dq = parity * image[k] - q[c, k]
                    out[c, k, 0] += wx * dq
                    out[c, k, 1] += wy * dq
                    out[c, k, 2] += wz * dq


@njit(cache=True, error_model="numpy")
def _increment(own, other, gx, gy, gz, rx, ry, rz, dx, dy, dz, eps):  # type: ignore[no-untyped-def]
    """Change of a variable from a cell's centre to a face; (dx, dy, dz) leads to the cell behind the face."""
    b = other - own
    along = gx * dx + gy * dy + gz * dz
    psi, _, _ = limiter(2.0 * along - b, b, eps)
    t = (rx * dx + ry * dy + rz * dz) / (dx * dx + dy * dy + dz * dz)
    return gx * rx + gy * ry + gz * rz - (1.0 - psi) * t * along


@njit(cache=True, error_model="numpy")
def _face_state(q, o, g, rx, ry, rz, dx, dy, dz, eps):  # type: ignore[no-untyped-def]
    """State q of a cell, with gradients g, at the face that it shares with a cell of state o."""
    x0 = _increment(q[0], o[0], g[0, 0], g[0, 1], g[0, 2], rx, ry, rz, dx, dy, dz, eps)
    x1 = _increment(q[1], o[1], g[1, 0], g[1, 1], g[1, 2], rx, ry, rz, dx, dy, dz, eps)
    x2 = _increment(q[2], o[2], g[2, 0], g[2, 1], g[2, 2], rx, ry, rz, dx, dy, dz, eps)
    x3 = _increment(q[3], o[3], g[3, 0], g[3, 1], g[3, 2], rx, ry, rz, dx, dy, dz, eps)
    x4 = _increment(q[4], o[4], g[4, 0], g[4, 1], g[4, 2], rx, ry, rz, dx, dy, dz, eps)
    return q[0] + saturate(x0, q[0])[0], q[1] + x1, q[2] + x2, q[3] + x3, q[4] + saturate(x4, q[4])[0]


@njit(cache=True, error_model="numpy")
def _boundary_state(q, g, rx, ry, rz):  # type: ignore[no-untyped-def]
    """State q of a cell, with gradients g, extrapolated to a boundary face."""
    x0 = g[0, 0] * rx + g[0, 1] * ry + g[0, 2] * rz
    x1 = g[1, 0] * rx + g[1, 1] * ry + g[1, 2] * rz
    x2 = g[2, 0] * rx + g[2, 1] * ry + g[2, 2] * rz
    x3 = g[3, 0] * rx + g[3, 1] * ry + g[3, 2] * rz
    x4 = g[4, 0] * rx + g[4, 1] * ry + g[4, 2] * rz
    return q[0] + saturate(x0, q[0])[0], q[1] + x1, q[2] + x2, q[3] + x3, q[4] + saturate(x4, q[4])[0]


@njit(cache=True, error_model="numpy")
def boundary_flux(kind, r, u, v, w, p, far, nx, ny, nz, ug):  # type: ignore[no-untyped-def]
    """Flux through a boundary face with nothing behind it."""
    if kind == FARFIELD:
        return hllc(r, u, v, w, p, far[0], far[1], far[2], far[3], far[4], nx, ny, nz, ug)
    if kind == OUTFLOW:
        return physical_flux(r, u, v, w, p, nx, ny, nz, ug)
    return wall_flux(r, u, v, w, p, nx, ny, nz, ug)


@njit(cache=True, parallel=True, error_model="numpy")
def _face_fluxes(q, g, velocity, omega, owner, neighbour, kind, normal, area, moment, ri, rj, eps, far, out):  # type: ignore[no-untyped-def]
    """Flux times area of every face, out (nf, 5)."""
    ni = neighbour.shape[0]
    for f in prange(owner.shape[0]):
        i = owner[f]
        nx, ny, nz, s = normal[f, 0], normal[f, 1], normal[f, 2], area[f]
        ug = velocity[0] * nx + velocity[1] * ny + velocity[2] * nz
        ug += (omega[0] * moment[f, 0] + omega[1] * moment[f, 1] + omega[2] * moment[f, 2]) / s
        rx, ry, rz = ri[f, 0], ri[f, 1], ri[f, 2]
        if f < ni:
            j = neighbour[f]
            sx, sy, sz = rj[f, 0], rj[f, 1], rj[f, 2]
            dx, dy, dz = rx - sx, ry - sy, rz - sz
            e = eps[f]
            rl, ul, vl, wl, pl = _face_state(q[i], q[j], g[i], rx, ry, rz, dx, dy, dz, e)
            rr, ur, vr, wr, pr = _face_state(q[j], q[i], g[j], sx, sy, sz, -dx, -dy, -dz, e)
            f0, f1, f2, f3, f4 = hllc(rl, ul, vl, wl, pl, rr, ur, vr, wr, pr, nx, ny, nz, ug)
        elif kind[f - ni] == SYMMETRY:
            d = 2.0 * (rx * nx + ry * ny + rz * nz)
            u, v, w = mirrored(q[i, 1], q[i, 2], q[i, 3], nx, ny, nz)
            image = (q[i, 0], u, v, w, q[i, 4])
            rl, ul, vl, wl, pl = _face_state(q[i], image, g[i], rx, ry, rz, d * nx, d * ny, d * nz, eps[f])
            ur, vr, wr = mirrored(ul, vl, wl, nx, ny, nz)
            f0, f1, f2, f3, f4 = hllc(rl, ul, vl, wl, pl, rl, ur, vr, wr, pl, nx, ny, nz, ug)
        else:
            rl, ul, vl, wl, pl = _boundary_state(q[i], g[i], rx, ry, rz)
            f0, f1, f2, f3, f4 = boundary_flux(kind[f - ni], rl, ul, vl, wl, pl, far, nx, ny, nz, ug)
        out[f, 0] = f0 * s
        out[f, 1] = f1 * s
        out[f, 2] = f2 * s
        out[f, 3] = f3 * s
        out[f, 4] = f4 * s


@njit(cache=True, parallel=True, error_model="numpy")
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
        _face_fluxes(
            q,
            self.gradient,
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
            self.far,
            self.face_flux,
        )
        out = np.empty((g.n_cells, 5), dtype)
        gather(self.face_flux, g.offsets, g.faces, g.signs, out)
        if np.any(motion.omega):
            momentum = (g.volume * q[:, 0])[:, None] * q[:, 1:4]
            out[:, 1:4] += np.cross(motion.omega, momentum)
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
