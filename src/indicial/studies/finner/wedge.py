r"""Oblique shocks of wedges: Mach numbers at which the shock attaches, and at which the flow behind it is supersonic.

The deflection of a shock at angle b to a stream of Mach number M is

    tan theta = 2 cot b (M^2 sin^2 b - 1) / (M^2 (gamma + cos 2b) + 2).

It is largest, and the flow behind it is sonic, at shock angles with (NACA Report 1135, Eqs. 167 and 168)

    sin^2 b_max   = ((gamma+1) M^2 - 4 + sqrt((gamma+1) ((gamma+1) M^4 + 8 (gamma-1) M^2 + 16))) / (4 gamma M^2),
    sin^2 b_sonic = ((gamma+1) M^2 - (3-gamma) + sqrt((gamma+1) ((gamma+1) M^4 - 2 (3-gamma) M^2 + gamma + 9)))
                    / (4 gamma M^2).
"""

from __future__ import annotations

import math
from collections.abc import Callable

from scipy.optimize import brentq

from indicial.cfd.flow.gas import GAMMA
from indicial.errors import InputError


def detachment_mach(half_angle: float) -> float:
    """Lowest Mach number of an attached shock on a wedge of the given half angle [rad]."""
    return _lowest(half_angle, _strongest)


def sonic_mach(half_angle: float) -> float:
    """Lowest Mach number at which the flow behind the attached shock is not subsonic, half angle [rad]."""
    return _lowest(half_angle, _sonic)


def deflection(mach: float, shock_angle: float) -> float:
    """Turning of the flow [rad] by a shock at an angle [rad] to the stream."""
    normal = (mach * math.sin(shock_angle)) ** 2 - 1.0
    return math.atan2(2.0 * normal, math.tan(shock_angle) * (mach**2 * (GAMMA + math.cos(2.0 * shock_angle)) + 2.0))


def _lowest(half_angle: float, angle: Callable[[float], float]) -> float:
    """Mach number whose shock at `angle` turns the flow by the half angle."""
    if not 0.0 < half_angle < math.radians(40.0):
        raise InputError(f"the wedge's half angle is {math.degrees(half_angle):.4g} deg, must lie between 0 and 40")
    return float(brentq(lambda mach: deflection(mach, angle(mach)) - half_angle, 1.0 + 1e-9, 50.0, xtol=1e-12))


def _strongest(mach: float) -> float:
    """Shock angle of the largest deflection [rad]."""
    g, m2 = GAMMA, mach**2
    root = math.sqrt((g + 1.0) * ((g + 1.0) * m2**2 + 8.0 * (g - 1.0) * m2 + 16.0))
    return math.asin(math.sqrt(((g + 1.0) * m2 - 4.0 + root) / (4.0 * g * m2)))


def _sonic(mach: float) -> float:
    """Shock angle with sonic flow behind it [rad]."""
    g, m2 = GAMMA, mach**2
    root = math.sqrt((g + 1.0) * ((g + 1.0) * m2**2 - 2.0 * (3.0 - g) * m2 + g + 9.0))
    return math.asin(math.sqrt(((g + 1.0) * m2 - (3.0 - g) + root) / (4.0 * g * m2)))
