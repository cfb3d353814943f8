"""Numerical flux times area of every face: reconstruct the states on both sides, meet them in the Riemann solver.

Faces go through in blocks. What belongs to a block's cells is first laid out with a face to a column, so that the
arithmetic, which is most of the work of a residual, runs through the vector registers of the processor.
"""

from __future__ import annotations

import numpy as np
from numba import njit, prange

from indicial.cfd.flow.compiled import KERNEL, POINTWISE
from indicial.cfd.flow.flux import hllc, physical_flux, wall_flux
from indicial.cfd.flow.grid import BLOCK, FARFIELD, OUTFLOW, SYMMETRY
from indicial.cfd.flow.reconstruction import limiter, saturate

_CELL = 20
"""Rows of a cell's column: 5 variables, then the 3 components of the gradient of each."""


@njit(**POINTWISE)
def mirrored(u, v, w, nx, ny, nz):  # type: ignore[no-untyped-def]
    """A velocity reflected in a plane of unit normal n."""
    t = 2.0 * (u * nx + v * ny + w * nz)
    return u - t * nx, v - t * ny, w - t * nz


@njit(**POINTWISE)
def _lay_out(q, g, c, out, col):  # type: ignore[no-untyped-def]
    """State and gradients of cell c into column col."""
    for k in range(5):
        out[k, col] = q[c, k]
        for x in range(3):
            out[5 + 3 * k + x, col] = g[c, k, x]


@njit(**POINTWISE)
def _slope(cell, k, col, x, y, z):  # type: ignore[no-untyped-def]
    """Change of variable k along (x, y, z)."""
    return cell[5 + 3 * k, col] * x + cell[6 + 3 * k, col] * y + cell[7 + 3 * k, col] * z


@njit(**POINTWISE)
def _increment(own, other, k, col, rx, ry, rz, dx, dy, dz, t, eps):  # type: ignore[no-untyped-def]
    """Change of a variable from a cell's centre to a face; d leads to the cell behind it, ``t = r.d / d^2``."""
    gap = other[k, col] - own[k, col]
    along = _slope(own, k, col, dx, dy, dz)
    psi, _, _ = limiter(2.0 * along - gap, gap, eps)
    return _slope(own, k, col, rx, ry, rz) - (1.0 - psi) * t * along


@njit(**POINTWISE)
def _face_state(own, other, col, rx, ry, rz, dx, dy, dz, t, eps):  # type: ignore[no-untyped-def]
    """State of the cell in column col of `own` at the face that it shares with the one in `other`."""
    x0 = _increment(own, other, 0, col, rx, ry, rz, dx, dy, dz, t, eps)
    x1 = _increment(own, other, 1, col, rx, ry, rz, dx, dy, dz, t, eps)
    x2 = _increment(own, other, 2, col, rx, ry, rz, dx, dy, dz, t, eps)
    x3 = _increment(own, other, 3, col, rx, ry, rz, dx, dy, dz, t, eps)
    x4 = _increment(own, other, 4, col, rx, ry, rz, dx, dy, dz, t, eps)
    return _changed(own, col, x0, x1, x2, x3, x4)


@njit(**POINTWISE)
def _boundary_state(own, col, rx, ry, rz):  # type: ignore[no-untyped-def]
    """State of the cell in column col extrapolated to a boundary face."""
    x0 = _slope(own, 0, col, rx, ry, rz)
    x1 = _slope(own, 1, col, rx, ry, rz)
    x2 = _slope(own, 2, col, rx, ry, rz)
    x3 = _slope(own, 3, col, rx, ry, rz)
    x4 = _slope(own, 4, col, rx, ry, rz)
    return _changed(own, col, x0, x1, x2, x3, x4)


@njit(**POINTWISE)
def _changed(own, col, x0, x1, x2, x3, x4):  # type: ignore[no-untyped-def]
    """The state in column col changed by x, with density and pressure kept positive."""
    r, u, v, w, p = own[0, col], own[1, col], own[2, col], own[3, col], own[4, col]
    return r + saturate(x0, r)[0], u + x1, v + x2, w + x3, p + saturate(x4, p)[0]


@njit(**POINTWISE)
def boundary_flux(kind, r, u, v, w, p, far, nx, ny, nz, ug):  # type: ignore[no-untyped-def]
    """Flux through a boundary face with nothing behind it."""
    if kind == FARFIELD:
        return hllc(r, u, v, w, p, far[0], far[1], far[2], far[3], far[4], nx, ny, nz, ug)
    if kind == OUTFLOW:
        return physical_flux(r, u, v, w, p, nx, ny, nz, ug)
    return wall_flux(r, u, v, w, p, nx, ny, nz, ug)


@njit(**KERNEL)
def interior_fluxes(q, g, velocity, omega, owner, neighbour, blocks, out):  # type: ignore[no-untyped-def]
    """Flux times area of the faces between two cells, the first rows of out (nf, 5).

    Parameters
    ----------
    q, g : ndarray
        States (nc, 5) and gradients (nc, 5, 3), real or complex.
    velocity, omega : ndarray
        V_b and omega (3,).
    owner, neighbour : ndarray
        The cells of the faces.
    blocks : ndarray
        Geometry of the faces, `Grid.blocks`.
    """
    ni = neighbour.shape[0]
    vx, vy, vz = velocity[0], velocity[1], velocity[2]
    wx, wy, wz = omega[0], omega[1], omega[2]
    for block in prange(blocks.shape[0]):
        first = block * BLOCK
        count = min(BLOCK, ni - first)
        left, right = np.empty((_CELL, BLOCK), q.dtype), np.empty((_CELL, BLOCK), q.dtype)
        face, flux = np.empty((14, BLOCK)), np.empty((5, BLOCK), q.dtype)
        # a copy of fixed shape, of which the compiler knows that its rows do not overlap
        for k in range(14):
            for col in range(BLOCK):
                face[k, col] = blocks[block, k, col]
        for col in range(count):
            _lay_out(q, g, owner[first + col], left, col)
            _lay_out(q, g, neighbour[first + col], right, col)
        # columns beyond `count` are computed for nothing, and go nowhere
        for col in range(BLOCK):
            nx, ny, nz, s = face[0, col], face[1, col], face[2, col], face[3, col]
            ug = vx * nx + vy * ny + vz * nz + (wx * face[4, col] + wy * face[5, col] + wz * face[6, col]) / s
            rx, ry, rz = face[7, col], face[8, col], face[9, col]
            sx, sy, sz = face[10, col], face[11, col], face[12, col]
            dx, dy, dz, eps = rx - sx, ry - sy, rz - sz, face[13, col]
            t = (rx * dx + ry * dy + rz * dz) / (dx * dx + dy * dy + dz * dz)
            rl, ul, vl, wl, pl = _face_state(left, right, col, rx, ry, rz, dx, dy, dz, t, eps)
            rr, ur, vr, wr, pr = _face_state(right, left, col, sx, sy, sz, -dx, -dy, -dz, 1.0 - t, eps)
            f0, f1, f2, f3, f4 = hllc(rl, ul, vl, wl, pl, rr, ur, vr, wr, pr, nx, ny, nz, ug)
            flux[0, col] = f0 * s
            flux[1, col] = f1 * s
            flux[2, col] = f2 * s
            flux[3, col] = f3 * s
            flux[4, col] = f4 * s
        for col in range(count):
            for k in range(5):
                out[first + col, k] = flux[k, col]


@njit(**KERNEL)
def boundary_fluxes(q, g, velocity, omega, owner, kind, normal, area, moment, to_owner, eps, far, out):  # type: ignore[no-untyped-def]
    """Flux times area of the faces with one cell, the last rows of out (nf, 5); arguments as in `Grid`."""
    ni = owner.shape[0] - kind.shape[0]
    for block in prange((kind.shape[0] + BLOCK - 1) // BLOCK):
        own, image = np.empty((_CELL, BLOCK), q.dtype), np.empty((_CELL, BLOCK), q.dtype)
        first = ni + block * BLOCK
        for col in range(min(BLOCK, owner.shape[0] - first)):
            f = first + col
            _lay_out(q, g, owner[f], own, col)
            nx, ny, nz, s = normal[f, 0], normal[f, 1], normal[f, 2], area[f]
            ug = velocity[0] * nx + velocity[1] * ny + velocity[2] * nz
            ug += (omega[0] * moment[f, 0] + omega[1] * moment[f, 1] + omega[2] * moment[f, 2]) / s
            rx, ry, rz = to_owner[f, 0], to_owner[f, 1], to_owner[f, 2]
            if kind[f - ni] == SYMMETRY:
                d = 2.0 * (rx * nx + ry * ny + rz * nz)
                image[0, col], image[4, col] = own[0, col], own[4, col]
                image[1, col], image[2, col], image[3, col] = mirrored(
                    own[1, col], own[2, col], own[3, col], nx, ny, nz
                )
                # the face lies half way to the image
                r, u, v, w, p = _face_state(own, image, col, rx, ry, rz, d * nx, d * ny, d * nz, 0.5, eps[f])
                ui, vi, wi = mirrored(u, v, w, nx, ny, nz)
                f0, f1, f2, f3, f4 = hllc(r, u, v, w, p, r, ui, vi, wi, p, nx, ny, nz, ug)
            else:
                r, u, v, w, p = _boundary_state(own, col, rx, ry, rz)
                f0, f1, f2, f3, f4 = boundary_flux(kind[f - ni], r, u, v, w, p, far, nx, ny, nz, ug)
            out[f, 0] = f0 * s
            out[f, 1] = f1 * s
            out[f, 2] = f2 * s
            out[f, 3] = f3 * s
            out[f, 4] = f4 * s
