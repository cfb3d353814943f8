"""Damping of a missile in one report: four ways, what of, how sure, how stable, and what the flow's memory changes."""

from __future__ import annotations

import math
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
    check : DampingCheck or None
        With the derivatives: linearised, read from a flight twice, closed form; None if the angles do not oscillate.
    sensitivity : DampingSensitivity
    stability : SpinStability
        At its roll rate.
    without_roll : SpinStability
    change : DampingChange or None
        From derivatives to the state-space model, if there is one.
    over_k : DampingOverK or None
    notes : tuple of str
        What a reader has to know of the source.
    """

    check: DampingCheck | None
    sensitivity: DampingSensitivity
    stability: SpinStability
    without_roll: SpinStability
    change: DampingChange | None = None
    over_k: DampingOverK | None = None
    notes: tuple[str, ...] = ()

    def summary(self) -> str:
        """All of it, the verdict first."""
        verdicts = [self.without_roll, *([self.stability] if self.stability.roll_rate else [])]
        parts = ["\n".join([*(one.summary() for one in verdicts), *(f"  note: {note}" for note in self.notes)])]
        if self.check is None:
            parts.append("the angles do not oscillate: there is no decay to be fitted")
        else:
            parts += [self.check.modes.summary(), self.check.summary()]
        parts.append(self.sensitivity.summary())
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
            "speed_m_s": s.speed,
            "roll_rate_rad_s": s.roll_rate,
            "statically_stable": s.statically_stable,
            "dynamically_stable": s.dynamically_stable,
            "dynamically_stable_without_roll": self.without_roll.dynamically_stable,
            "gyroscopic_factor": _finite(s.gyroscopic),
            "dynamic_factor": _finite(s.dynamic),
            "warnings": list(s.warnings),
            "notes": list(self.notes),
            "oscillates": self.check is not None,
            "arms": [],
        }
        if self.check is not None:
            record |= {"model": self.check.model, "mach": self.check.mach, "slowing_1_s": self.check.slowing}
        for i, made in enumerate(self.sensitivity.arms):
            arm = None if self.check is None else self.check.arms[i]
            read = {} if arm is None else {"decay_1_s": arm.decay, "fitted_1_s": arm.fitted.real}
            record["arms"].append(
                {
                    "name": made.name,
                    "linearised_1_s": made.damping,
                    **read,
                    "closed_form_1_s": (self.stability.roots[i] * s.speed).real,
                    "turning_rad_s": made.eigenvalue.imag,
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
        figures: dict[str, Any] = {"damping_parts": self.sensitivity.plot()}
        if self.check is not None:
            figures |= {"flight": self.check.plot(), "modes": self.check.modes.plot()}
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
    notes: tuple[str, ...] = (),
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
    notes : tuple of str
        Kept for the summary.

    Raises
    ------
    InputError
        If a value makes no sense.
    """
    air = ConstantAtmosphere() if atmosphere is None else atmosphere
    density = float(air_at(air, altitude).density)
    flown: dict[str, Any] = {"roll_rate": roll_rate, "atmosphere": air, "altitude": altitude}
    rolling, still = (spin_stability(vehicle, derivatives, density, speed, roll_rate=p) for p in (roll_rate, 0.0))
    turns = rolling.statically_stable and all(root.imag for root in rolling.roots)
    oscillates = turns or rolling.gyroscopic > 1.0
    check = check_damping(vehicle, derivatives, speed, **flown) if oscillates else None
    return MissileDamping(
        check=check,
        sensitivity=damping_sensitivity(
            vehicle, derivatives, speed, **flown, uncertainties=uncertainties, correlations=correlations
        ),
        stability=rolling,
        without_roll=still,
        change=None
        if model is None or check is None
        else DampingChange(check, check_damping(vehicle, model, speed, **flown)),
        over_k=None
        if model is None or not still.statically_stable
        else damping_over_k(vehicle, model, speed, atmosphere=air, altitude=altitude),
        notes=notes,
    )


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
