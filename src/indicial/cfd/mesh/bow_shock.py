"""How far out a mesh about a pointed body in a supersonic stream must reach."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from indicial.cfd.mesh.geometry import Array
from indicial.errors import InputError

GAMMA = 1.4


def shock_angle(mach: float, half_angle: float) -> float:
    r"""Angle [rad] of the attached shock of a cone of the given half angle [rad], a little on the large side.

    ``sin^2 beta = (gamma + 1)/2 sin^2 theta_c + 1/M^2``, with gamma = 1.4: 0.2 to 1.4 degrees above the
    Taylor-Maccoll solution for half angles of 5 to 20 degrees and M 1.5 to 6.
    Source: M. L. Rasmussen, On hypersonic flow past an unyawed cone, AIAA J. 5 (1967) 1495.

    Raises
    ------
    InputError
        If the stream is not supersonic, or the shock would be detached or nearly so.
    """
    if not mach > 1.0:
        raise InputError(f"mach is {mach}, must be above 1 for a mesh that follows the bow shock")
    sine = math.sqrt(0.5 * (GAMMA + 1.0) * math.sin(half_angle) ** 2 + 1.0 / mach**2)
    if sine > math.sin(math.radians(75.0)):
        raise InputError(
            f"mach is {mach}: the bow shock of a nose of {math.degrees(half_angle):.3g} deg is (nearly) detached; "
            "take a higher Mach number or a sharper nose"
        )
    return math.asin(sine)


def outer_radius(x: ArrayLike, *, first: float, slope: float, limit: float) -> Array:
    """Radius of the outer boundary at x: a cone from radius `first` at x = 0, rounded off to the radius `limit`.

    Rounded by ``(a^-8 + b^-8)^(-1/8)`` of the two.
    """
    cone = first + slope * np.asarray(x, dtype=float)
    return np.asarray((cone**-8.0 + limit**-8.0) ** -0.125)


def influence_limit(length: float, body_radius: float, beta: float) -> float:
    """Radius beyond which nothing matters to a body of that length and largest radius (fins included).

    What leaves the nose along the shock and returned from radius r along the opposite wave meets the body again at
    ``x = r / tan(beta) + (r - body_radius) / tan(beta)``; at the limit that is the body's end.
    """
    return 0.5 * (length * math.tan(beta) + body_radius)
