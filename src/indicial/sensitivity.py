r"""What six steady coefficients change with: velocity, rates, their time derivatives, Mach number, moment reference."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities, turning
from indicial.errors import InputError
from indicial.motion import FlightCondition

MOTIONS = ("u", "v", "w", "p", "q", "r")
PARAMETERS = (*MOTIONS, "mach", "x_ref", "y_ref", "z_ref")

_UNITS = (
    dict.fromkeys("uvw", "per m/s")
    | dict.fromkeys("pqr", "per rad/s")
    | {"mach": "per M"}
    | dict.fromkeys(("x_ref", "y_ref", "z_ref"), "per m")
)
_UNKNOWN_IF_PLANE = ("CY", "Cl", "Cn", "v", "p", "r", "y_ref")


@dataclass(frozen=True)
class Sensitivities:
    """Derivatives of the six coefficients about one steady state.

    Parameters
    ----------
    values : ndarray
        Of (CA, CY, CN, Cl, Cm, Cn) with respect to `PARAMETERS`, shape (6, 10): V_b components [per m/s] and rates
        [per rad/s] in body axes at constant Mach number of the coefficients' dynamic pressure; Mach number at constant
        alpha, beta and rates; moment reference point [per m], mesh axes, at constant V_b and rates there.
    accelerations : ndarray
        With respect to the time derivatives of `MOTIONS` [per m/s^2, per rad/s^2], shape (6, 6): the loads of a slow
        motion behind those that its momentary velocity and rates would make steadily.
    baseline : ndarray
        The six coefficients, shape (6,).
    condition : FlightCondition
    reference : ReferenceQuantities
    plane : bool
        Whether the flow is two-dimensional: nothing is known then of lateral loads and motions, which have zeros.
    provenance : dict
        How it was made (plain values).
    """

    values: Array
    accelerations: Array
    baseline: Array
    condition: FlightCondition
    reference: ReferenceQuantities
    plane: bool = False
    provenance: dict[str, Any] = field(default_factory=dict)

    def value(self, output: str, parameter: str) -> float:
        """One derivative, in the units of `values`; parameter may be ``udot`` ... ``rdot``."""
        row = _index(COEFFICIENTS, output, "coefficient")
        if parameter.endswith("dot"):
            return float(self.accelerations[row, _index(MOTIONS, parameter[:-3], "motion")])
        return float(self.values[row, _index(PARAMETERS, parameter, "parameter")])

    def derivative(self, output: str, motion: str) -> float:
        """``C_alpha, C_beta, C_alphadot, C_betadot, C_p, C_q, C_r``, dimensionless as `reference` says."""
        row = _index(COEFFICIENTS, output, "coefficient")
        speed, scale = self.condition.speed, self.reference.rate_scale(self.condition.speed)
        if motion in ("p", "q", "r"):
            axis = "pqr".index(motion)
            return float(self.values[row, 3 + axis] / scale[axis])
        angle = motion.removesuffix("dot")
        table = self.values if angle == motion else self.accelerations
        per_radian = float(table[row, :3] @ (speed * turning(angle, self.condition.alpha, self.condition.beta)))
        return per_radian if angle == motion else per_radian / float(scale[1 if angle == "alpha" else 2])

    def summary(self) -> str:
        """A table, one coefficient a line, its derivatives with their units; of a plane flow what is known."""
        known = [name for name in PARAMETERS if not (self.plane and name in _UNKNOWN_IF_PLANE)]
        loads = [name for name in COEFFICIENTS if not (self.plane and name in _UNKNOWN_IF_PLANE)]
        rows = [
            f"derivatives at M {self.condition.mach:g}, alpha {math.degrees(self.condition.alpha):.4g} deg",
            "    " + "".join(f"{name:>12}" for name in known),
            "    " + "".join(f"{_UNITS[name]:>12}" for name in known),
        ]
        rows += [f"{load:<4}" + "".join(f"{self.value(load, name):>12.4g}" for name in known) for load in loads]
        return "\n".join(rows)


def _index(names: tuple[str, ...], name: str, what: str) -> int:
    if name not in names:
        raise InputError(f"no {what} {name!r}; there are {', '.join(names)}")
    return names.index(name)
