"""Products with the Jacobian's factors, plain and transposed, and its blocks of nearest neighbours.

`parity` is the sign of the images behind symmetry planes: 1, or -1 for an antisymmetric disturbance.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from indicial.cfd.flow.compiled import KERNEL
from indicial.cfd.flow.face_flux import mirrored
from indicial.cfd.flow.grid import MIRROR, SYMMETRY


@njit(**KERNEL)
def linear_fluxes(x, g, owner, neighbour, kind, normal, parity, ri, rj, dl, dr, lin, out):  # type: ignore[no-untyped-def]
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


@njit(**KERNEL)
def spread_states(phi, neighbour, kind, normal, parity, dl, dr, out):  # type: ignore[no-untyped-def]
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


@njit(**KERNEL)
def collect_states(y, offsets, faces, signs, cells, normal, parity, ri, rj, lin, out, g):  # type: ignore[no-untyped-def]
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


@njit(**KERNEL)
def spread_gradients(g, offsets, faces, cells, twins, weights, normal, parity, out):  # type: ignore[no-untyped-def]
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


@njit(**KERNEL)
def compact_blocks(offsets, faces, signs, cells, slots, diagonal, normal, parity, extra, dl, dr, out):  # type: ignore[no-untyped-def]
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
