r"""Loads of any rigid body from derivatives in body axes, longitudinal and lateral, about one flight condition."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import casadi as ca

from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.flightsim.aerodynamics import AerodynamicLoads, FlowState, Validity
from indicial.flightsim.expressions import free_symbols


@dataclass(frozen=True, kw_only=True)
class BodyAxisAerodynamics:
    r"""Coefficients linear in the motion, every value 0 unless given, a number or a casadi symbol.

    With ``e = (v, w)/V``, ``vhat = (V - V0)/V0`` and rates made dimensionless by c/2V (q) and b/2V (p, r),

    ``CX = CX_0 + CX_u vhat + CX_alpha e_z + CX_q qhat``, CZ and Cm likewise and with ``alphadot c/2V``;
    ``CY = CY_0 + CY_beta e_y + CY_p phat + CY_r rhat``, Cl and Cn likewise.

    Drag ``CD_0`` acts against the velocity, whatever the attitude. There is no division by V: at rest all loads are 0.

    Parameters
    ----------
    reference : ReferenceQuantities
        Length c, `lateral_length` b, area, and the moment reference point.
    speed : float, optional
        V0 [m/s], needed by the derivatives with respect to speed.
    rates_in : {"air", "inertial space"}
        Which rates the derivatives are of. The air turns with the earth; some programs leave that out, a difference of
        0.004 deg/s.
    validity : Validity
    """

    reference: ReferenceQuantities
    speed: float | None = None
    CD_0: Any = 0.0
    CX_0: Any = 0.0
    CX_u: Any = 0.0
    CX_alpha: Any = 0.0
    CX_q: Any = 0.0
    CZ_0: Any = 0.0
    CZ_u: Any = 0.0
    CZ_alpha: Any = 0.0
    CZ_q: Any = 0.0
    CZ_alphadot: Any = 0.0
    Cm_0: Any = 0.0
    Cm_u: Any = 0.0
    Cm_alpha: Any = 0.0
    Cm_q: Any = 0.0
    Cm_alphadot: Any = 0.0
    CY_0: Any = 0.0
    CY_beta: Any = 0.0
    CY_p: Any = 0.0
    CY_r: Any = 0.0
    Cl_0: Any = 0.0
    Cl_beta: Any = 0.0
    Cl_p: Any = 0.0
    Cl_r: Any = 0.0
    Cn_0: Any = 0.0
    Cn_beta: Any = 0.0
    Cn_p: Any = 0.0
    Cn_r: Any = 0.0
    rates_in: Literal["air", "inertial space"] = "air"
    validity: Validity = field(default_factory=Validity)

    def __post_init__(self) -> None:
        if self.speed is None and any(_given(getattr(self, name)) for name in ("CX_u", "CZ_u", "Cm_u")):
            raise InputError("derivatives with respect to speed need the speed that they are taken about")
        if self.rates_in not in ("air", "inertial space"):
            raise InputError(f"rates_in is {self.rates_in!r}, must be 'air' or 'inertial space'")
        if self.speed is not None and not (math.isfinite(self.speed) and self.speed > 0.0):
            raise InputError(f"speed is {self.speed} m/s, must be positive and finite")

    @property
    def parameters(self) -> tuple[Any, ...]:
        """Free casadi symbols among the values, in the order of the fields."""
        return free_symbols(getattr(self, item.name) for item in fields(self))

    @property
    def lag_names(self) -> tuple[str, ...]:
        """None."""
        return ()

    def lag_rate(self, flow: FlowState, lag: Any) -> Any:
        """Nothing."""
        del flow, lag
        return ca.SX(0, 1)

    def loads(self, flow: FlowState, lag: Any) -> AerodynamicLoads:
        """Force and moment about the moment reference point."""
        del lag
        pressure = 0.5 * flow.density * self.reference.area * flow.speed**2
        factor = 2.0 if self.reference.rate_normalisation == "c/2V" else 1.0
        rate_pressure = 0.5 * flow.density * self.reference.area * flow.speed / factor
        rate = flow.rate if self.rates_in == "air" else flow.inertial_rate
        lateral, chord, _ = (float(length) for length in self.reference.moment_lengths)
        p, q, r = (rate_pressure * rate[i] * length for i, length in enumerate((lateral, chord, lateral)))
        lag_term = 0.5 * flow.density * self.reference.area / factor * chord * flow.turning[1]
        beta, alpha = pressure * flow.incidence[0], pressure * flow.incidence[1]
        excess = 0.0 if self.speed is None else pressure * (flow.speed / self.speed - 1.0)

        def longitudinal(name: str) -> Any:
            slow = getattr(self, f"{name}_0") * pressure + getattr(self, f"{name}_u") * excess
            fast = getattr(self, f"{name}_alpha") * alpha + getattr(self, f"{name}_q") * q
            return slow + fast + getattr(self, f"{name}_alphadot", 0.0) * lag_term

        def sideways(name: str) -> Any:
            terms = {"0": pressure, "beta": beta, "p": p, "r": r}
            return sum(getattr(self, f"{name}_{key}") * value for key, value in terms.items())

        force = ca.vertcat(longitudinal("CX"), sideways("CY"), longitudinal("CZ"))
        drag = 0.5 * flow.density * self.reference.area * self.CD_0 * flow.speed * flow.velocity
        moment = ca.vertcat(lateral * sideways("Cl"), chord * longitudinal("Cm"), lateral * sideways("Cn"))
        return AerodynamicLoads(force - drag, moment)

    def summary(self) -> str:
        """The values that are not 0, in one line."""
        names = [item.name for item in fields(self) if item.name.startswith("C") and _given(getattr(self, item.name))]
        return "body-axis derivatives: " + ", ".join(f"{name} {getattr(self, name)!s:.8}" for name in names)


def _given(value: Any) -> bool:
    return isinstance(value, ca.SX) or float(value) != 0.0
