r"""The exact Jacobian J = dR/dq of the second-order residual, as factors.

The residual depends on cell states and on gradients, each of them face-local, so

    J x = sum_f [ D_L (a_L x + b_L G x) + D_R (a_R x + b_R G x) ] + source,

with ``D_L, D_R`` the derivatives of the numerical flux with respect to the two face states (complex step through
the flux itself, so exact to round-off), ``a, b`` those of the reconstruction, and G the least-squares gradient.
The limiter and the flux have corners (a sign change, a wave speed through zero); there the branch taken by the
state itself is differentiated.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from indicial.cfd.flow.flux import hllc
from indicial.cfd.flow.reconstruction import limiter, saturate
from indicial.cfd.flow.residual import MeshMotion, Residual, boundary_flux, gather, gradients
from indicial.conventions import Array, Index

_H = 1e-40


@njit(cache=True, error_model="numpy")
def _linearise_side(q, g, c, other, k, rx, ry, rz, dx, dy, dz, eps, out):  # type: ignore[no-untyped-def]
    """Value of variable k at the face and its slopes: own cell, other cell, dg.r, dg.d."""
    b = q[other, k] - q[c, k]
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
    q, g, velocity, omega, owner, neighbour, kind, normal, area, moment, ri, rj, eps, far, dl, dr, lin
):
    """Flux derivatives dl, dr (nf, 5, 5), (ni, 5, 5) and reconstruction slopes lin (nf, 2, 5, 4)."""
    ni = neighbour.shape[0]
    ambient = far.astype(np.complex128)
    for f in prange(owner.shape[0]):
        i = owner[f]
        nx, ny, nz, s = normal[f, 0], normal[f, 1], normal[f, 2], area[f]
        ug = velocity[0] * nx + velocity[1] * ny + velocity[2] * nz
        ug += (omega[0] * moment[f, 0] + omega[1] * moment[f, 1] + omega[2] * moment[f, 2]) / s
        rx, ry, rz = ri[f, 0], ri[f, 1], ri[f, 2]
        z = np.empty(10, dtype=np.complex128)
        if f < ni:
            j = neighbour[f]
            sx, sy, sz = rj[f, 0], rj[f, 1], rj[f, 2]
            dx, dy, dz = rx - sx, ry - sy, rz - sz
            for k in range(5):
                z[k] = _linearise_side(q, g, i, j, k, rx, ry, rz, dx, dy, dz, eps[f], lin[f, 0, k])
                z[5 + k] = _linearise_side(q, g, j, i, k, sx, sy, sz, -dx, -dy, -dz, eps[f], lin[f, 1, k])
            for k in range(10):
                z[k] += 1j * _H
                d = hllc(z[0], z[1], z[2], z[3], z[4], z[5], z[6], z[7], z[8], z[9], nx, ny, nz, ug)
                z[k] = z[k].real
                for m in range(5):
                    if k < 5:
                        dl[f, m, k] = d[m].imag / _H * s
                    else:
                        dr[f, m, k - 5] = d[m].imag / _H * s
        else:
            for k in range(5):
                x = g[i, k, 0] * rx + g[i, k, 1] * ry + g[i, k, 2] * rz
                slope = 1.0
                own = 0.0
                if k == 0 or k == 4:
                    x, slope, own = saturate(x, q[i, k])
                z[k] = q[i, k] + x
                lin[f, 0, k, 0] = 1.0 + own
                lin[f, 0, k, 2] = slope
            for k in range(5):
                z[k] += 1j * _H
                e = boundary_flux(kind[f - ni], z[0], z[1], z[2], z[3], z[4], ambient, nx, ny, nz, ug)
                z[k] = z[k].real
                for m in range(5):
                    dl[f, m, k] = e[m].imag / _H * s


@njit(cache=True, parallel=True, error_model="numpy")
def _linear_fluxes(x, g, owner, neighbour, ri, rj, dl, dr, lin, out):  # type: ignore[no-untyped-def]
    """Change of every face's flux for a change x of the cells with gradients g."""
    ni = neighbour.shape[0]
    for f in prange(owner.shape[0]):
        i = owner[f]
        rx, ry, rz = ri[f, 0], ri[f, 1], ri[f, 2]
        t0 = t1 = t2 = t3 = t4 = 0.0
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
        else:
            for k in range(5):
                y = lin[f, 0, k, 0] * x[i, k]
                y += lin[f, 0, k, 2] * (g[i, k, 0] * rx + g[i, k, 1] * ry + g[i, k, 2] * rz)
                t0 += dl[f, 0, k] * y
                t1 += dl[f, 1, k] * y
                t2 += dl[f, 2, k] * y
                t3 += dl[f, 3, k] * y
                t4 += dl[f, 4, k] * y
        out[f, 0] = t0
        out[f, 1] = t1
        out[f, 2] = t2
        out[f, 3] = t3
        out[f, 4] = t4


@njit(cache=True, parallel=True, error_model="numpy")
def _compact_blocks(offsets, faces, signs, slots, diagonal, extra, dl, dr, out):  # type: ignore[no-untyped-def]
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


class Jacobian:
    """J at one state and motion; apply it, or take its compact part for a preconditioner.

    Parameters
    ----------
    residual : Residual
        Whose Jacobian; its gradient array is refreshed at q.
    q : ndarray
        State (nc, 5).
    motion : MeshMotion
    """

    def __init__(self, residual: Residual, q: Array, motion: MeshMotion) -> None:
        g = residual.grid
        nf, ni = len(g.owner), g.n_interior
        self.grid = g
        self.second_order = residual.second_order
        self.flux_left: Array = np.empty((nf, 5, 5))
        self.flux_right: Array = np.empty((max(ni, 1), 5, 5))
        self.slopes: Array = np.zeros((nf, 2, 5, 4))
        self._gradient: Array = np.zeros((g.n_cells, 5, 3))
        self._flux: Array = np.empty((nf, 5))
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
            self.slopes,
        )
        self.source = _source_jacobian(q, motion, g.volume)

    def apply(self, x: Array) -> Array:
        """J x, shape (nc, 5)."""
        g = self.grid
        if self.second_order:
            gradients(x, g.offsets, g.cells, g.weights, self._gradient)
        _linear_fluxes(
            x,
            self._gradient,
            g.owner,
            g.neighbour,
            g.to_owner,
            g.to_neighbour,
            self.flux_left,
            self.flux_right,
            self.slopes,
            self._flux,
        )
        out = np.empty((g.n_cells, 5))
        gather(self._flux, g.offsets, g.faces, g.signs, out)
        if self.source is not None:
            out += np.einsum("nij,nj->ni", self.source, x)
        return out

    def compact_blocks(self, extra: Array, slots: Index, diagonal: Index, count: int) -> Array:
        """First-order blocks in the sparse pattern given by `slots` and `diagonal`, shape (count, 5, 5)."""
        g = self.grid
        out = np.empty((count, 5, 5))
        added = extra if self.source is None else extra + self.source
        _compact_blocks(g.offsets, g.faces, g.signs, slots, diagonal, added, self.flux_left, self.flux_right, out)
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
