r"""Numerical fluxes through one face, per unit area, on a moving mesh (theory: docs/theory.md, Eqs. 18-22).

All functions take the outward unit normal n and the normal mesh velocity u_g of the face, and return
``F = W (v.n - u_g) + p (0, n, v.n)``. They are written for real and complex arguments alike (choices look at
real parts only), so that the Jacobian is the complex step of these very lines.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from indicial.cfd.flow.compiled import POINTWISE
from indicial.cfd.flow.gas import GAMMA

GM1 = GAMMA - 1.0


@njit(**POINTWISE)
def physical_flux(r, u, v, w, p, nx, ny, nz, ug):  # type: ignore[no-untyped-def]
    """The flux of one state: supersonic outflow."""
    un = u * nx + v * ny + w * nz
    m = r * (un - ug)
    energy = p / GM1 + 0.5 * r * (u * u + v * v + w * w)
    return m, m * u + p * nx, m * v + p * ny, m * w + p * nz, energy * (un - ug) + p * un


@njit(**POINTWISE)
def hllc(rl, ul, vl, wl, pl, rr, ur, vr, wr, pr, nx, ny, nz, ug):  # type: ignore[no-untyped-def]
    """HLLC (Toro, Spruce & Speares 1994) with the wave speeds of Einfeldt, in the frame of the moving face.

    Choices are between two values, never between two ways: a loop over faces runs through vector registers.
    """
    unl = ul * nx + vl * ny + wl * nz
    unr = ur * nx + vr * ny + wr * nz
    ql = unl - ug
    qr = unr - ug
    tl = pl / rl
    tr = pr / rr
    cl = np.sqrt(GAMMA * tl)
    cr = np.sqrt(GAMMA * tr)

    # Roe averages bound the signal speeds: exact for a lone shock
    ratio = np.sqrt(rr / rl)
    of_l = 1.0 / (1.0 + ratio)
    of_r = ratio * of_l
    jump = qr - ql
    q_roe = ql + of_r * jump
    c_roe = np.sqrt(GAMMA * (of_l * tl + of_r * tr) + 0.5 * GM1 * of_l * of_r * jump * jump)
    s_l = q_roe - c_roe if (q_roe - c_roe).real < (ql - cl).real else ql - cl
    s_r = q_roe + c_roe if (q_roe + c_roe).real > (qr + cr).real else qr + cr

    ml = rl * (s_l - ql)
    mr = rr * (s_r - qr)
    s_m = (pr - pl + ql * ml - qr * mr) / (ml - mr)
    from_left = (s_l.real >= 0.0) | ((s_m.real >= 0.0) & (s_r.real > 0.0))
    r = rl if from_left else rr
    u = ul if from_left else ur
    v = vl if from_left else vr
    w = wl if from_left else wr
    p = pl if from_left else pr
    t = tl if from_left else tr
    q = ql if from_left else qr
    s = s_l if from_left else s_r

    # all waves to one side: the star state with no jump is the state itself
    beyond = (s_l.real >= 0.0) | (s_r.real <= 0.0)
    s_m = q if beyond else s_m
    du = s_m - q
    # the star pressure makes F* = W* s_m + p* (0, n, s_m + u_g)
    lag = r * (s - q)
    ps = p + lag * du
    m = lag / (s - s_m) * s_m
    push = m * du + ps
    energy = t / GM1 + 0.5 * (u * u + v * v + w * w) + du * (s_m + ug + p / lag)
    return m, m * u + push * nx, m * v + push * ny, m * w + push * nz, m * energy + ps * (s_m + ug)


@njit(**POINTWISE)
def wall_pressure(r, u, v, w, p, nx, ny, nz, ug):  # type: ignore[no-untyped-def]
    """Pressure on a slip wall that moves at u_g: the exact Riemann problem of the state and its mirror image.

    Its linear part ``p + rho a (v.n - u_g)`` is the piston jump of an indicial response. The shock branch is
    used on compression, the isentropic one on expansion (to a tenth of the way to vacuum); value and slope
    agree where they meet.
    """
    c = np.sqrt(GAMMA * p / r)
    m = (u * nx + v * ny + w * nz - ug) / c
    if m.real >= 0.0:
        h = 0.25 * (GAMMA + 1.0) * m
        return p * (1.0 + GAMMA * m * (h + np.sqrt(1.0 + h * h)))
    base = 1.0 + 0.5 * GM1 * m
    if base.real < 0.1:
        base = 0.1 + 0.0 * base
    return p * base ** (2.0 * GAMMA / GM1)


@njit(**POINTWISE)
def wall_flux(r, u, v, w, p, nx, ny, nz, ug):  # type: ignore[no-untyped-def]
    """No mass passes: pressure, and the work that the moving wall does."""
    ps = wall_pressure(r, u, v, w, p, nx, ny, nz, ug)
    return 0.0 * ps, ps * nx, ps * ny, ps * nz, ps * ug
