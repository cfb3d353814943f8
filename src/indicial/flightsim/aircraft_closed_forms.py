r"""The classical approximations of an aircraft's modes, in closed form.

With dimensional derivatives over mass and inertia (``Z_w``, ``M_q``, ...; L and N with the product of inertia solved
for), in straight level flight in stability axes:

    short period   lambda^2 - (Z_w + M_q + M_wdot u0) lambda + (Z_w M_q - u0 M_w) = 0
    phugoid        lambda^2 - X_u lambda - g Z_u/u0 = 0
    Dutch roll     lambda^2 - (Y_v + N_r) lambda + (Y_v N_r + u0 N_v) = 0
    roll           lambda = L_p
    spiral         lambda = -g (L_v N_r - L_r N_v)/(u0 (L_v N_p - L_p N_v) - g L_v)

Source: Etkin and Reid, Dynamics of Flight (1996), chapter 6. They come from the derivatives alone: how far each is
from the mode of the linear model tells what the approximation leaves out.
"""

from __future__ import annotations

import cmath

import numpy as np

from indicial.flightsim.aircraft import BodyAxisAerodynamics
from indicial.flightsim.vehicle import Vehicle


def classical_modes(
    vehicle: Vehicle, loads: BodyAxisAerodynamics, density: float, speed: float, gravity: float
) -> dict[str, complex]:
    """Eigenvalues [1/s] by this module's approximations, of a pair the one with positive frequency.

    Parameters
    ----------
    vehicle : Vehicle
    loads : BodyAxisAerodynamics
        With numbers, in stability axes about the centre of gravity; lift carries the weight, whatever its CZ_0.
    density, speed, gravity : float
        [kg/m^3], [m/s], [m/s^2].
    """
    reference = vehicle.reference
    pressure = 0.5 * density * speed * reference.area  # times V: a force
    chord, span = reference.length, float(reference.moment_lengths[0])
    factor = 2.0 if reference.rate_normalisation == "c/2V" else 1.0
    mass, pitch = float(vehicle.mass), float(vehicle.inertia[1, 1])
    x_u = pressure * loads.CX_u / mass
    z_u = pressure * loads.CZ_u / mass - 2.0 * gravity / speed
    z_w = pressure * loads.CZ_alpha / mass
    m_w, m_q = (pressure * chord * d / pitch for d in (loads.Cm_alpha, loads.Cm_q * chord / factor))
    m_lag = pressure * chord**2 / factor * loads.Cm_alphadot / pitch  # M_wdot u0
    y_v = pressure * loads.CY_beta / mass
    moments = np.array([[loads.Cl_beta, loads.Cl_p, loads.Cl_r], [loads.Cn_beta, loads.Cn_p, loads.Cn_r]], dtype=float)
    moments[:, 1:] *= span / factor
    (l_v, l_p, l_r), (n_v, n_p, n_r) = np.linalg.solve(vehicle.inertia[::2, ::2], pressure * span * moments)
    slow, fast = -gravity * (l_v * n_r - l_r * n_v), speed * (l_v * n_p - l_p * n_v) - gravity * l_v
    spiral = {"spiral": complex(slow / fast)} if fast else {}  # without l_v and l_p n_v there is no such mode
    return {
        "short period": _upper_root(-(z_w + m_q + m_lag), z_w * m_q - speed * m_w),
        "phugoid": _upper_root(-x_u, -gravity * z_u / speed),
        "Dutch roll": _upper_root(-(y_v + n_r), y_v * n_r + speed * n_v),
        "roll": complex(l_p),
        **spiral,
    }


def _upper_root(b: float, c: float) -> complex:
    """Of ``x^2 + b x + c``, the root with the larger imaginary, or real, part."""
    return (-b + cmath.sqrt(b * b - 4.0 * c)) / 2.0
