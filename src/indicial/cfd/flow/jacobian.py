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
from numba import njit, prange
from numpy.typing import NDArray

from indicial.cfd.flow.face_flux import boundary_flux, mirrored
from indicial.cfd.flow.flux import hllc
from indicial.cfd.flow.grid import MIRROR, SYMMETRY
from indicial.cfd.flow.reconstruction import limiter, saturate
from indicial.cfd.flow.residual import MeshMotion, Residual, gather, gradients
from indicial.conventions import Array, Index

_H = 1e-40


@njit(cache=True, error_model="numpy")
def _linearise_side(q, g, c, other, k, rx, ry, rz, dx, dy, dz, eps, out):  # type: ignore[no-untyped-def]
    """Value of variable k at the face and its slopes: own cell, other cell, dg.r, dg.d. `other` is a value."""
    b = other - q[c, k]
    gd = g[c, k, 0] * dx + g[c, k, 1] * dy + g[c, k, 2] * dz
    psi, psi_a, psi_b = limiter(2.0 * gd - b, b, eps)
    t = (rx * dx + ry * dy + rz * dz) / (dx * dx + dy * dy + dz * dz)
    x = g[c, k, 0] * rx + g[c, k, 1] * ry + g[c, k, 2] * rz - (1.0 - psi) * t * gd
    along = t * gd * (psi_b - psi_a)
    slope = 1.0
    own = 0.0
    if k == 0 or k == 4:
        x, slope, own = saturate(x, q[c, k])
    out[0] = 1.0 + own - slope * along
    out[1] = slope * along
    out[2] = slope
    out[3] = slope * t * (2.0 * gd * psi_a - (1.0 - psi))
    return q[c, k] + x


@njit(cache=True, parallel=True, error_model="numpy")
def _linearise_faces(  # type: ignore[no-untyped-def]
    q, g, velocity, omega, owner, neighbour, kind, normal, area, moment, ri, rj, eps, far, dl, dr, du, lin
):
    """Flux derivatives dl, dr (nf, 5, 5), du (nf, 5) times area, and reconstruction slopes lin (nf, 2, 5, 4)."""
    ni = neighbour.shape[0]
    ambient = far.astype(np.complex128)
    for f in prange(owner.shape[0]):
        i = owner[f]
        nx, ny, nz, s = normal[f, 0], normal[f, 1], normal[f, 2], area[f]
        ug = velocity[0] * nx + velocity[1] * ny + velocity[2] * nz
        ug += (omega[0] * moment[f, 0] + omega[1] * moment[f, 1] + omega[2] * moment[f, 2]) / s
        rx, ry, rz = ri[f, 0], ri[f, 1], ri[f, 2]
        # the two states, and the normal velocity of the face
        z = np.zeros(11, dtype=np.complex128)
        z[10] = ug
        two_sided = True
        if f < ni:
            j = neighbour[f]
            sx, sy, sz = rj[f, 0], rj[f, 1], rj[f, 2]
            dx, dy, dz = rx - sx, ry - sy, rz - sz
            for k in range(5):
                z[k] = _linearise_side(q, g, i, q[j, k], k, rx, ry, rz, dx, dy, dz, eps[f], lin[f, 0, k])
                z[5 + k] = _linearise_side(q, g, j, q[i, k], k, sx, sy, sz, -dx, -dy, -dz, eps[f], lin[f, 1, k])
        elif kind[f - ni] == SYMMETRY:
            d = 2.0 * (rx * nx + ry * ny + rz * nz)
            u, v, w = mirrored(q[i, 1], q[i, 2], q[i, 3], nx, ny, nz)
            image = (q[i, 0], u, v, w, q[i, 4])
            for k in range(5):
                z[k] = _linearise_side(q, g, i, image[k], k, rx, ry, rz, d * nx, d * ny, d * nz, eps[f], lin[f, 0, k])
            z[5], z[9] = z[0], z[4]
            z[6], z[7], z[8] = mirrored(z[1], z[2], z[3], nx, ny, nz)
        else:
            two_sided = False
            for k in range(5):
                x = g[i, k, 0] * rx + g[i, k, 1] * ry + g[i, k, 2] * rz
                slope = 1.0
                own = 0.0
                if k == 0 or k == 4:
                    x, slope, own = saturate(x, q[i, k])
                z[k] = q[i, k] + x
                lin[f, 0, k, 0] = 1.0 + own
                lin[f, 0, k, 2] = slope
        for k in range(11):
            if not two_sided and 5 <= k < 10:
                continue
            z[k] += 1j * _H
            if two_sided:
                e = hllc(z[0], z[1], z[2], z[3], z[4], z[5], z[6], z[7], z[8], z[9], nx, ny, nz, z[10])
            else:
                e = boundary_flux(kind[f - ni], z[0], z[1], z[2], z[3], z[4], ambient, nx, ny, nz, z[10])
            z[k] = z[k].real
            for m in range(5):
                slope = e[m].imag / _H * s
                if k < 5:
                    dl[f, m, k] = slope
                elif k < 10:
                    dr[f, m, k - 5] = slope
                else:
                    du[f, m] = slope


@njit(cache=True, parallel=True, error_model="numpy")
def _linear_fluxes(x, g, owner, neighbour, kind, normal, parity, ri, rj, dl, dr, lin, out):  # type: ignore[no-untyped-def]
    """Change of every face's flux for a change x of the cells with gradients g."""
    ni = neighbour.shape[0]
    for f in prange(owner.shape[0]):
        i = owner[f]
        rx, ry, rz = ri[f, 0], ri[f, 1], ri[f, 2]
        t0 = t1 = t2 = t3 = t4 = 0.0 * x[i, 0]
        if f < ni:
            j = neighbour[f]
            sx, sy, sz = rj[f, 0], rj[f, 1], rj[f, 2]
            dx, dy, dz = rx - sx, ry - sy, rz - sz
            for k in range(5):
                c = lin[f, 0, k]
                y = c[0] * x[i, k] + c[1] * x[j, k]
                y += g[i, k, 0] * (c[2] * rx + c[3] * dx)
                y += g[i, k, 1] * (c[2] * ry + c[3] * dy)
                y += g[i, k, 2] * (c[2] * rz + c[3] * dz)
                c = lin[f, 1, k]
                z = c[0] * x[j, k] + c[1] * x[i, k]
                z += g[j, k, 0] * (c[2] * sx - c[3] * dx)
                z += g[j, k, 1] * (c[2] * sy - c[3] * dy)
                z += g[j, k, 2] * (c[2] * sz - c[3] * dz)
                t0 += dl[f, 0, k] * y + dr[f, 0, k] * z
                t1 += dl[f, 1, k] * y + dr[f, 1, k] * z
                t2 += dl[f, 2, k] * y + dr[f, 2, k] * z
                t3 += dl[f, 3, k] * y + dr[f, 3, k] * z
                t4 += dl[f, 4, k] * y + dr[f, 4, k] * z
        elif kind[f - ni] == SYMMETRY:
            nx, ny, nz = normal[f, 0], normal[f, 1], normal[f, 2]
            d = 2.0 * (rx * nx + ry * ny + rz * nz)
            u, v, w = mirrored(x[i, 1], x[i, 2], x[i, 3], nx, ny, nz)
            image = (x[i, 0], u, v, w, x[i, 4])
            y = np.empty(5, dtype=x.dtype)
            for k in range(5):
                c = lin[f, 0, k]
                y[k] = c[0] * x[i, k] + c[1] * parity * image[k]
                y[k] += g[i, k, 0] * (c[2] * rx + c[3] * d * nx)
                y[k] += g[i, k, 1] * (c[2] * ry + c[3] * d * ny)
                y[k] += g[i, k, 2] * (c[2] * rz + c[3] * d * nz)
            u, v, w = mirrored(y[1], y[2], y[3], nx, ny, nz)
            image = (y[0], u, v, w, y[4])
            for k in range(5):
                z = parity * image[k]
                t0 += dl[f, 0, k] * y[k] + dr[f, 0, k] * z
                t1 += dl[f, 1, k] * y[k] + dr[f, 1, k] * z
                t2 += dl[f, 2, k] * y[k] + dr[f, 2, k] * z
                t3 += dl[f, 3, k] * y[k] + dr[f, 3, k] * z
                t4 += dl[f, 4, k] * y[k] + dr[f, 4, k] * z
        else:
            for k in range(5):
                y0 = lin[f, 0, k, 0] * x[i, k]
                y0 += lin[f, 0, k, 2] * (g[i, k, 0] * rx + g[i, k, 1] * ry + g[i, k, 2] * rz)
                t0 += dl[f, 0, k] * y0
                t1 += dl[f, 1, k] * y0
                t2 += dl[f, 2, k] * y0
                t3 += dl[f, 3, k] * y0
                t4 += dl[f, 4, k] * y0
        out[f, 0] = t0
        out[f, 1] = t1
        out[f, 2] = t2
        out[f, 3] = t3
        out[f, 4] = t4


@njit(cache=True, parallel=True, error_model="numpy")
def _spread_states(phi, neighbour, kind, normal, parity, dl, dr, out):  # type: ignore[no-untyped-def]
    """What the face states receive from the face sensitivities phi (nf, 5), out (nf, 2, 5): D^T phi."""
    ni = neighbour.shape[0]
    for f in prange(phi.shape[0]):
        for k in range(5):
            a = 0.0 * phi[f, 0]
            b = 0.0 * phi[f, 0]
            for m in range(5):
                a += dl[f, m, k] * phi[f, m]
                b += dr[f, m, k] * phi[f, m]
            out[f, 0, k] = a
            out[f, 1, k] = b
        if f >= ni and kind[f - ni] == SYMMETRY:
            b = out[f, 1]
            u, v, w = mirrored(b[1], b[2], b[3], normal[f, 0], normal[f, 1], normal[f, 2])
            out[f, 0, 0] += parity * b[0]
            out[f, 0, 1] += parity * u
            out[f, 0, 2] += parity * v
            out[f, 0, 3] += parity * w
            out[f, 0, 4] += parity * b[4]


@njit(cache=True, parallel=True, error_model="numpy")
def _collect_states(y, offsets, faces, signs, cells, normal, parity, ri, rj, lin, out, g):  # type: ignore[no-untyped-def]
    """What cells (nc, 5) and their gradients g (nc, 5, 3) receive from the face states."""
    for c in prange(out.shape[0]):
        for k in range(5):
            out[c, k] = 0.0
            for x in range(3):
                g[c, k, x] = 0.0
        for e in range(offsets[c], offsets[c + 1]):
            f = faces[e]
            if cells[e] >= 0:
                a = 0 if signs[e] > 0 else 1
                dx, dy, dz = ri[f, 0] - rj[f, 0], ri[f, 1] - rj[f, 1], ri[f, 2] - rj[f, 2]
                rx, ry, rz = ri[f, 0], ri[f, 1], ri[f, 2]
                if a == 1:
                    dx, dy, dz = -dx, -dy, -dz
                    rx, ry, rz = rj[f, 0], rj[f, 1], rj[f, 2]
                for k in range(5):
                    own, t = lin[f, a, k], y[f, a, k]
                    out[c, k] += own[0] * t + lin[f, 1 - a, k, 1] * y[f, 1 - a, k]
                    g[c, k, 0] += t * (own[2] * rx + own[3] * dx)
                    g[c, k, 1] += t * (own[2] * ry + own[3] * dy)
                    g[c, k, 2] += t * (own[2] * rz + own[3] * dz)
            else:
                nx, ny, nz = normal[f, 0], normal[f, 1], normal[f, 2]
                d = 0.0
                if cells[e] == MIRROR:
                    d = 2.0 * (ri[f, 0] * nx + ri[f, 1] * ny + ri[f, 2] * nz)
                    t = lin[f, 0, :, 1] * y[f, 0]
                    u, v, w = mirrored(t[1], t[2], t[3], nx, ny, nz)
                    out[c, 0] += parity * t[0]
                    out[c, 1] += parity * u
                    out[c, 2] += parity * v
                    out[c, 3] += parity * w
                    out[c, 4] += parity * t[4]
                for k in range(5):
                    own, s = lin[f, 0, k], y[f, 0, k]
                    out[c, k] += own[0] * s
                    g[c, k, 0] += s * (own[2] * ri[f, 0] + own[3] * d * nx)
                    g[c, k, 1] += s * (own[2] * ri[f, 1] + own[3] * d * ny)
                    g[c, k, 2] += s * (own[2] * ri[f, 2] + own[3] * d * nz)


@njit(cache=True, parallel=True, error_model="numpy")
def _spread_gradients(g, offsets, faces, cells, twins, weights, normal, parity, out):  # type: ignore[no-untyped-def]
    """Add what the cells receive from the gradients: out += G^T g."""
    for c in prange(out.shape[0]):
        for e in range(offsets[c], offsets[c + 1]):
            n = cells[e]
            if n >= 0:
                t = twins[e]
                for k in range(5):
                    out[c, k] += (
                        weights[t, 0] * g[n, k, 0]
                        + weights[t, 1] * g[n, k, 1]
                        + weights[t, 2] * g[n, k, 2]
                        - weights[e, 0] * g[c, k, 0]
                        - weights[e, 1] * g[c, k, 1]
                        - weights[e, 2] * g[c, k, 2]
                    )
            elif n == MIRROR:
                m = normal[faces[e]]
                t = weights[e, 0] * g[c, :, 0] + weights[e, 1] * g[c, :, 1] + weights[e, 2] * g[c, :, 2]
                u, v, w = mirrored(t[1], t[2], t[3], m[0], m[1], m[2])
                out[c, 0] += parity * t[0] - t[0]
                out[c, 1] += parity * u - t[1]
                out[c, 2] += parity * v - t[2]
                out[c, 3] += parity * w - t[3]
                out[c, 4] += parity * t[4] - t[4]


@njit(cache=True, parallel=True, error_model="numpy")
def _compact_blocks(offsets, faces, signs, cells, slots, diagonal, normal, parity, extra, dl, dr, out):  # type: ignore[no-untyped-def]
    """Blocks of the compact (nearest-neighbour) Jacobian plus `extra` on the diagonal."""
    for c in prange(offsets.shape[0] - 1):
        d = diagonal[c]
        for a in range(5):
            for b in range(5):
                out[d, a, b] = extra[c, a, b]
        for e in range(offsets[c], offsets[c + 1]):
            f = faces[e]
            n = slots[e]
            # entry by entry: assigning whole blocks compiles ten times longer
            for a in range(5):
                for b in range(5):
                    if signs[e] < 0:
                        out[d, a, b] -= dr[f, a, b]
                        out[n, a, b] = -dl[f, a, b]
                    else:
                        out[d, a, b] += dl[f, a, b]
                        if n >= 0:
                            out[n, a, b] = dr[f, a, b]
            if cells[e] == MIRROR:
                for a in range(5):
                    u, v, w = mirrored(dr[f, a, 1], dr[f, a, 2], dr[f, a, 3], normal[f, 0], normal[f, 1], normal[f, 2])
                    out[d, a, 0] += parity * dr[f, a, 0]
                    out[d, a, 1] += parity * u
                    out[d, a, 2] += parity * v
                    out[d, a, 3] += parity * w
                    out[d, a, 4] += parity * dr[f, a, 4]


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
        _linearise_faces(
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
        _linear_fluxes(
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
        _spread_states(phi, g.neighbour, g.kind, g.normal, parity, self.flux_left, self.flux_right, states)
        _collect_states(
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
            _spread_gradients(gradient, g.offsets, g.faces, g.cells, g.twins, g.weights, g.normal, parity, out)
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
        _compact_blocks(
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
