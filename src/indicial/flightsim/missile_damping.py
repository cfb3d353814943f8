"""Damping of a missile in one report: three ways, what of, how sure, how stable, and what the flow's memory changes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from indicial.flightsim.aerodynamics import DerivativeAerodynamics
from indicial.flightsim.atmosphere import Atmosphere, ConstantAtmosphere, air_at
from indicial.flightsim.damping import DampingChange, DampingCheck, check_damping
from indicial.flightsim.damping_over_k import DampingOverK, damping_over_k
from indicial.flightsim.damping_sensitivity import NAMES, DampingSensitivity, damping_sensitivity
from indicial.flightsim.spin_stability import SpinStability, spin_stability
from indicial.flightsim.state_space import StateSpaceAerodynamics
from indicial.flightsim.vehicle import Vehicle


@dataclass(frozen=True)
class MissileDamping:
    """Everything about the damping of a missile at one speed.

    Parameters
    ----------
    check : DampingCheck
        With the derivatives: linearised, fitted to a flight, closed form.
    sensitivity : DampingSensitivity
    stability : SpinStability
    change : DampingChange or None
        From derivatives to the state-space model, if there is one.
    over_k : DampingOverK or None
    """

    check: DampingCheck
    sensitivity: DampingSensitivity
    stability: SpinStability
    change: DampingChange | None = None
    over_k: DampingOverK | None = None

    def summary(self) -> str:
        """All of it, the verdict first."""
        parts = [self.stability.summary(), self.check.summary(), self.sensitivity.summary()]
        if self.change is not None:
            parts.append(self.change.summary())
        if self.over_k is not None:
            parts.append(self.over_k.summary())
        return "\n\n".join(parts)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, schema version 1."""
        s = self.stability
        record: dict[str, Any] = {
            "schema_version": 1,
            "kind": "missile damping",
            "model": self.check.model,
            "speed_m_s": self.check.speed,
            "mach": self.check.mach,
            "roll_rate_rad_s": self.check.roll_rate,
            "slowing_1_s": self.check.slowing,
            "statically_stable": s.statically_stable,
            "dynamically_stable": s.dynamically_stable,
            "gyroscopic_factor": s.gyroscopic,
            "dynamic_factor": s.dynamic,
            "warnings": list(s.warnings),
            "arms": [],
        }
        for arm, made in zip(self.check.arms, self.sensitivity.arms, strict=True):
            record["arms"].append(
                {
                    "name": arm.name,
                    "linearised_1_s": arm.linearised.real,
                    "fitted_1_s": arm.fitted.real,
                    "closed_form_1_s": arm.closed_form.real,
                    "turning_rad_s": arm.linearised.imag,
                    "damping_ratio": made.damping_ratio,
                    "damping_standard_error_1_s": made.standard_error,
                    "damping_ratio_standard_error": made.ratio_standard_error,
                    "parts_1_s": made.parts,
                    "ratio_gradient": dict(zip(NAMES, made.ratio_gradient.tolist(), strict=True)),
                }
            )
        if self.change is not None:
            record["state_space_change"] = {"damping": self.change.damping, "frequency": self.change.frequency}
        if self.over_k is not None:
            o = self.over_k
            record["over_k"] = {
                "k": o.k.tolist(),
                "k_of_this_vehicle": o.k_here,
                "ratio_change": o.ratio_change.tolist(),
                "frequency_change": o.frequency_change.tolist(),
            }
        return record

    def plot(self) -> dict[str, Any]:
        """Figures by name."""
        figures: dict[str, Any] = {"flight": self.check.plot(), "damping_parts": self.sensitivity.plot()}
        if self.over_k is not None:
            figures["over_k"] = self.over_k.plot()
        return figures


def missile_damping(
    vehicle: Vehicle,
    derivatives: DerivativeAerodynamics,
    speed: float,
    *,
    model: StateSpaceAerodynamics | None = None,
    roll_rate: float = 0.0,
    atmosphere: Atmosphere | None = None,
    altitude: float = 0.0,
    uncertainties: Mapping[str, float] | None = None,
    correlations: Mapping[tuple[str, str], float] | None = None,
) -> MissileDamping:
    """Every check of a missile's damping.

    Parameters
    ----------
    vehicle : Vehicle
    derivatives : DerivativeAerodynamics
    speed : float
        [m/s].
    model : StateSpaceAerodynamics, optional
        What is to replace the derivatives.
    roll_rate, altitude : float
        [rad/s], [m].
    atmosphere : Atmosphere, optional
        20 C and 1 atm if not given.
    uncertainties, correlations : mapping, optional
        As `damping_sensitivity`.

    Raises
    ------
    InputError
        If the missile does not oscillate, or a value makes no sense.
    """
    air = ConstantAtmosphere() if atmosphere is None else atmosphere
    density = float(air_at(air, altitude).density)
    flown: dict[str, Any] = {"roll_rate": roll_rate, "atmosphere": air, "altitude": altitude}
    check = check_damping(vehicle, derivatives, speed, **flown)
    return MissileDamping(
        check=check,
        sensitivity=damping_sensitivity(
            vehicle, derivatives, speed, **flown, uncertainties=uncertainties, correlations=correlations
        ),
        stability=spin_stability(vehicle, derivatives, density, speed, roll_rate=roll_rate),
        change=None if model is None else DampingChange(check, check_damping(vehicle, model, speed, **flown)),
        over_k=None if model is None else damping_over_k(vehicle, model, speed, atmosphere=air, altitude=altitude),
    )
