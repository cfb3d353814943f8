r"""Gyroscopic and dynamic stability of a missile with or without spin, in the terms of exterior ballistics.

Of ``lambda^2 + (H - iP) lambda - (M + iPT) = 0`` (`damping`), both roots die out exactly if

    H > 0  and  4M/P^2 < Sd (2 - Sd),    Sg = P^2/4M,  Sd = 2T/H

(without spin: H > 0 and M < 0). A Magnus moment ``Cn_p_alpha`` (per rad and rad of ``p c/2V``, as the rates of the
table) adds to ``T = (rho S/2m)(CL_alpha + (m c^2/f Ix) Cn_p_alpha)``, f = 2 for rates per c/2V. Source: Murphy, BRL
R-1216 (1963); McCoy, "Modern Exterior Ballistics" (1999), sec. 10.4 to 10.7.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from indicial.errors import InputError
from indicial.flightsim.aerodynamics import DerivativeAerodynamics
from indicial.flightsim.epicycle import order_arms
from indicial.flightsim.vehicle import Vehicle

RESONANCE_BAND = 0.2
"""Roll rates within this share of the pitching frequency are told as near to roll resonance."""


@dataclass(frozen=True)
class SpinStability:
    """Stability of a missile's angular motion.

    Parameters
    ----------
    H, P, T : float
        [1/m].
    M : float
        [1/m^2], negative for static stability.
    speed, roll_rate : float
        [m/s], [rad/s].
    """

    H: float
    P: float
    M: float
    T: float
    speed: float
    roll_rate: float

    @property
    def statically_stable(self) -> bool:
        """Whether the moment turns the nose back."""
        return self.M < 0.0

    @property
    def gyroscopic(self) -> float:
        """Sg; above 1 (or negative: static stability) the arms turn without growing apart."""
        return self.P**2 / (4.0 * self.M) if self.M else math.inf

    @property
    def dynamic(self) -> float:
        """Sd."""
        return 2.0 * self.T / self.H if self.H else math.inf

    @property
    def dynamically_stable(self) -> bool:
        """Whether both arms die out."""
        if self.H <= 0.0:
            return False
        if self.P == 0.0:
            return self.M < 0.0
        return self.dynamic * (2.0 - self.dynamic) > 4.0 * self.M / self.P**2

    @property
    def roots(self) -> tuple[complex, complex]:
        """Eigenvalues [1/m] of the fast and slow arm."""
        middle = -(self.H - 1j * self.P) / 2.0
        root = np.sqrt(middle**2 + self.M + 1j * self.P * self.T)
        return order_arms(complex(middle + root), complex(middle - root))

    @property
    def pitch_frequency(self) -> float:
        """``V sqrt(-M)`` [rad/s]: the roll rate of resonance of a slender missile; 0 without static stability."""
        return self.speed * math.sqrt(max(-self.M, 0.0))

    @property
    def resonance_ratio(self) -> float:
        """Roll rate over `pitch_frequency`; infinite without static stability."""
        return abs(self.roll_rate) / self.pitch_frequency if self.pitch_frequency else math.inf

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the linear verdict does not settle."""
        told = []
        if self.statically_stable and abs(self.resonance_ratio - 1.0) <= RESONANCE_BAND:
            told.append(
                f"roll resonance: the roll rate is {self.resonance_ratio:.3g} of the pitching frequency "
                f"{self.pitch_frequency:.4g} rad/s; any asymmetry makes a large trim, and lock-in is possible"
            )
        elif self.statically_stable and self.resonance_ratio > 1.0:
            told.append(
                f"the roll rate is {self.resonance_ratio:.3g} of the pitching frequency: if spun up from rest it has "
                "passed resonance, where it could have locked in"
            )
        return tuple(told)

    def summary(self) -> str:
        """The factors and the verdict."""
        static = "statically stable" if self.statically_stable else "statically unstable"
        verdict = "dynamically stable" if self.dynamically_stable else "dynamically UNSTABLE"
        lines = [
            f"{static}, {verdict} at {self.speed:.5g} m/s, roll rate {self.roll_rate:.4g} rad/s",
            f"  Sg {self.gyroscopic:z.4g}, Sd {self.dynamic:.4g}, Sd(2 - Sd) {self.dynamic * (2 - self.dynamic):.4g}",
        ]
        return "\n".join([*lines, *(f"  warning: {line}" for line in self.warnings)])


def spin_stability(
    vehicle: Vehicle,
    derivatives: DerivativeAerodynamics,
    density: float,
    speed: float,
    *,
    roll_rate: float = 0.0,
    Cn_p_alpha: float = 0.0,
) -> SpinStability:
    """Stability factors of a missile from its derivatives, moved to the centre of gravity first.

    Parameters
    ----------
    vehicle : Vehicle
    derivatives : DerivativeAerodynamics
    density, speed : float
        [kg/m^3], [m/s].
    roll_rate : float
        [rad/s].
    Cn_p_alpha : float
        Magnus moment about the centre of gravity; the flown model has none.

    Raises
    ------
    InputError
        If density or speed are not positive.
    """
    for name, value in (("density", density), ("speed", speed)):
        if not (math.isfinite(value) and value > 0.0):
            raise InputError(f"{name} is {value}, must be positive and finite")
    at = derivatives.about(vehicle.centre_of_gravity)
    axial, transverse = float(vehicle.inertia[0, 0]), float(vehicle.inertia[1, 1])
    area, length = at.reference.area, at.reference.length
    factor = 2.0 if at.reference.rate_normalisation == "c/2V" else 1.0
    size = vehicle.mass * length**2 / factor
    slope = at.CN_alpha - at.CA_0
    lift = density * area / (2.0 * vehicle.mass)
    return SpinStability(
        H=lift * (slope - at.CA_0 - size / transverse * (at.Cm_q + at.Cm_alphadot)),
        P=axial / transverse * roll_rate / speed,
        M=density * area * length / (2.0 * transverse) * at.Cm_alpha,
        T=lift * (slope + size / axial * Cn_p_alpha),
        speed=speed,
        roll_rate=roll_rate,
    )
