r"""Numerical fluxes through one face, per unit area, on a moving mesh (theory: docs/theory.md, Eqs. 18-22).

All functions take the outward unit normal n and the normal mesh velocity u_g of the face, and return
``F = W (v.n - u_g) + p (0, n, v.n)``. They are written for real and complex arguments alike (branches look at
real parts only), so that the Jacobian is the complex step of these very lines.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from indicial.cfd.flow.gas import GAMMA

GM1 = GAMMA - 1.0


@njit(cache=True, error_model="numpy")
def physical_flux(r, u, v, w, p, nx, ny, nz, ug):  # type: ignore[no-untyped-def]
    """The flux of one state: supersonic outflow."""
    un = u * nx + v * ny + w * nz
    m = r * (un - ug)
    energy = p / GM1 + 0.5 * r * (u * u + v * v + w * w)
    return m, m * u + p * nx, m * v + p * ny, m * w + p * nz, energy * (un - ug) + p * un


@njit(cache=True, error_model="numpy")
def hllc(rl, ul, vl, wl, pl, rr, ur, vr, wr, pr, nx, ny, nz, ug):  # type: ignore[no-untyped-def]
    """HLLC (Toro, Spruce & Speares 1994) with the wave speeds of Einfeldt, in the frame of the moving face."""
    unl = ul * nx + vl * ny + wl * nz
    unr = ur * nx + vr * ny + wr * nz
    ql = unl - ug
    qr = unr - ug
    cl = np.sqrt(GAMMA * pl / rl)
    cr = np.sqrt(GAMMA * pr / rr)
    el = pl / GM1 + 0.5 * rl * (ul * ul + vl * vl + wl * wl)
    er = pr / GM1 + 0.5 * rr * (ur * ur + vr * vr + wr * wr)

    # Roe averages bound the signal speeds: exact for a lone shock
    sl_w = np.sqrt(rl)
    sr_w = np.sqrt(rr)
    total = sl_w + sr_w
    q_roe = (sl_w * ql + sr_w * qr) / total
    jump = qr - ql
    c_roe = np.sqrt((sl_w * cl * cl + sr_w * cr * cr) / total + 0.5 * GM1 * sl_w * sr_w / (total * total) * jump * jump)
    s_l = ql - cl
    if (q_roe - c_roe).real < s_l.real:
        s_l = q_roe - c_roe
    s_r = qr + cr
    if (q_roe + c_roe).real > s_r.real:
        s_r = q_roe + c_roe

    if s_l.real >= 0.0:
        m = rl * ql
        return m, m * ul + pl * nx, m * vl + pl * ny, m * wl + pl * nz, el * ql + pl * unl
    if s_r.real <= 0.0:
        m = rr * qr
        return m, m * ur + pr * nx, m * vr + pr * ny, m * wr + pr * nz, er * qr + pr * unr
    ml = rl * (s_l - ql)
    mr = rr * (s_r - qr)
    s_m = (pr - pl + ql * ml - qr * mr) / (ml - mr)
    if s_m.real >= 0.0:
        # the star pressure makes F* = W* s_m + p* (0, n, s_m + u_g)
        ps = pl + ml * (s_m - ql)
        rs = ml / (s_l - s_m)
        du = s_m - ql
        es = rs * (el / rl + du * (s_m + ug + pl / ml))
        m = rs * s_m
        return (
            m,
            m * (ul + du * nx) + ps * nx,
            m * (vl + du * ny) + ps * ny,
            m * (wl + du * nz) + ps * nz,
            es * s_m + ps * (s_m + ug),
        )
    ps = pr + mr * (s_m - qr)
    rs = mr / (s_r - s_m)
    du = s_m - qr
    es = rs * (er / rr + du * (s_m + ug + pr / mr))
    m = rs * s_m
    return (
        m,
        m * (ur + du * nx) + ps * nx,
        m * (vr + du * ny) + ps * ny,
        m * (wr + du * nz) + ps * nz,
        es * s_m + ps * (s_m + ug),
    )


@njit(cache=True, error_model="numpy")
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


@njit(cache=True, error_model="numpy")
def wall_flux(r, u, v, w, p, nx, ny, nz, ug):  # type: ignore[no-untyped-def]
    """No mass passes: pressure, and the work that the moving wall does."""
    ps = wall_pressure(r, u, v, w, p, nx, ny, nz, ug)
    return 0.0 * ps, ps * nx, ps * ny, ps * nz, ps * ug
