"""Derivatives of the face fluxes and of the reconstruction, face by face: the factors of the Jacobian.

Those of the flux are the complex step through the flux itself, so exact to round-off.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from indicial.cfd.flow.compiled import KERNEL
from indicial.cfd.flow.face_flux import boundary_flux, mirrored
from indicial.cfd.flow.flux import hllc
from indicial.cfd.flow.grid import SYMMETRY
from indicial.cfd.flow.reconstruction import limiter, saturate

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


@njit(**KERNEL)
def linearise_faces(  # type: ignore[no-untyped-def]
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
