r"""Axial force of the Basic Finner: what an inviscid flow has not, by documented estimates, each apart.

Skin friction: turbulent from the leading edge on flat plates of the body's length and of the fins' chord, van Driest's
second transformation of Karman and Schoenherr's law (E. R. van Driest, "The problem of aerodynamic heating", Aero. Eng.
Review 15(10), 1956; as given by E. J. Hopkins and M. Inouye, AIAA J. 9 (1971) 993). With ``m = (gamma-1)/2 M^2``,
``F = Tw/T``, recovery factor r, ``A^2 = r m/F``, ``B = (1 + r m)/F - 1``:

    F_c = r m / (asin((2 A^2 - B)/sqrt(4 A^2 + B^2)) + asin(B/sqrt(4 A^2 + B^2)))^2,   F_Re = mu/(mu_w F_c),
    C_F = C_Fi/F_c,   0.242/sqrt(C_Fi) = log10(F_Re Re C_Fi).

Base pressure: ``C_Db = 0.12 + 0.13 M^2`` (M < 1), ``0.25/M`` (M >= 1) of the base's area (S. Niskanen, "OpenRocket
technical documentation", 2013, Eq. 3.94), on the flat base and on the blunt trailing edges of the fins alike. The
latter is crude: a base between two flat faces sucks more than a round one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from scipy.optimize import brentq

from indicial.cfd.flow.gas import GAMMA
from indicial.cfd.shapes import FinnedBody
from indicial.errors import InputError

RANGE_TEMPERATURE, RANGE_PRESSURE = 293.15, 101325.0
"""Air of the range [K, Pa]."""

RECOVERY = 0.88
"""Recovery factor of a turbulent boundary layer (Hopkins and Inouye)."""

GAS_CONSTANT = 287.05287


@dataclass(frozen=True)
class AxialForce:
    """Axial force coefficient at zero yaw, by parts, of S = pi d^2/4.

    Parameters
    ----------
    forebody_and_fins : float
        Inviscid pressure, base and trailing edges left out.
    friction : float
        With the wall as cold as the air: flights of a fraction of a second do not heat the metal.
    friction_adiabatic : float
        With the wall at recovery temperature: the other end of what it can be.
    base : float
    trailing_edges : float
    """

    forebody_and_fins: float
    friction: float
    friction_adiabatic: float
    base: float
    trailing_edges: float

    @property
    def total(self) -> float:
        """All together."""
        return self.forebody_and_fins + self.friction + self.base + self.trailing_edges


def axial_force(body: FinnedBody, mach: float, inviscid: float) -> AxialForce:
    """The parts at a Mach number, with the inviscid coefficient that CFD gave."""
    area = body.base_area
    edges = 0.0
    if body.fins is not None:
        fins = body.fins
        edges = fins.number * fins.thickness_ratio * fins.root_chord * fins.span * body.diameter**2
    cold, hot = (friction(body, mach, wall) for wall in (1.0, 1.0 + RECOVERY * 0.5 * (GAMMA - 1.0) * mach**2))
    base = base_drag(mach)
    return AxialForce(inviscid, cold, hot, base, base * edges / area)


def friction(body: FinnedBody, mach: float, wall: float) -> float:
    """Skin friction of body and fins, of the base area; `wall` is the wall's temperature over the stream's."""
    area, length = body.base_area, body.length * body.diameter
    total = body.lateral_area * mean_skin_friction(reynolds_number(mach, length), mach, wall)
    if body.fins is not None:
        chord = body.fins.root_chord * body.diameter
        faces = 2.0 * body.fins.number * body.fin_planform_area
        total += faces * mean_skin_friction(reynolds_number(mach, chord), mach, wall)
    return total / area


def base_drag(mach: float) -> float:
    """Base drag coefficient of the base's area."""
    return 0.12 + 0.13 * mach * mach if mach < 1.0 else 0.25 / mach


def reynolds_number(mach: float, length: float) -> float:
    """In the range's air, on a length [m]."""
    speed = mach * math.sqrt(GAMMA * GAS_CONSTANT * RANGE_TEMPERATURE)
    density = RANGE_PRESSURE / (GAS_CONSTANT * RANGE_TEMPERATURE)
    return density * speed * length / viscosity(RANGE_TEMPERATURE)


def viscosity(temperature: float) -> float:
    """Of air by Sutherland's law [Pa s]."""
    return 1.458e-6 * temperature * math.sqrt(temperature) / (temperature + 110.4)


def mean_skin_friction(reynolds: float, mach: float, wall: float) -> float:
    """Mean turbulent skin-friction coefficient C_F of one side of a flat plate, by van Driest's second transformation.

    Parameters
    ----------
    reynolds : float
        On the plate's length, of the stream.
    mach : float
    wall : float
        Wall temperature over stream temperature.

    Raises
    ------
    InputError
        If an argument is out of range.
    """
    if not (reynolds > 1e4 and mach >= 0.0 and wall > 0.0):
        raise InputError(f"skin friction needs Re above 1e4, M >= 0 and Tw/T > 0, not {reynolds:g}, {mach:g}, {wall:g}")
    f_c = _van_driest(mach, wall)
    f_re = viscosity(RANGE_TEMPERATURE) / viscosity(RANGE_TEMPERATURE * wall) / f_c
    return karman_schoenherr(f_re * reynolds) / f_c


def karman_schoenherr(reynolds: float) -> float:
    """Incompressible mean skin friction: ``0.242/sqrt(C_F) = log10(Re C_F)``."""
    return float(brentq(lambda c: 0.242 / math.sqrt(c) - math.log10(reynolds * c), 1e-4, 0.1, xtol=1e-14))


def _van_driest(mach: float, wall: float) -> float:
    """F_c."""
    recovered = RECOVERY * 0.5 * (GAMMA - 1.0) * mach**2
    if recovered < 1e-9:
        # the limit without heating by friction
        return ((1.0 + math.sqrt(wall)) / 2.0) ** 2
    a2, b = recovered / wall, (1.0 + recovered) / wall - 1.0
    root = math.sqrt(4.0 * a2 + b * b)
    return recovered / (math.asin((2.0 * a2 - b) / root) + math.asin(b / root)) ** 2
