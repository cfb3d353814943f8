r"""Damping of an aircraft's modes: how much, how sure, what of, what level.

Each mode's eigenvalue is the linear model's, the one fitted to a nonlinear flight (`mode_decay`) and that of the
classical closed form (`aircraft_closed_forms`). What an aerodynamic derivative v counts for is the exact gradient
through left and right eigenvectors, ``d lambda/dv = y^H (dA/dv) x/(y^H x)``, and ``v dRe(lambda)/dv`` is its part of
the damping. The air is held as it is at the flight's altitude, in the linear model and in the flight alike: its change
with height, which the phugoid feels, is left out as it is of the classical modes.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import casadi as ca
import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.aircraft import BodyAxisAerodynamics
from indicial.flightsim.aircraft_closed_forms import classical_modes
from indicial.flightsim.aircraft_modes import aircraft_modes
from indicial.flightsim.atmosphere import Atmosphere, ConstantAtmosphere, air_at
from indicial.flightsim.dynamics import build_dynamics
from indicial.flightsim.earth import FlatEarth
from indicial.flightsim.expressions import is_number
from indicial.flightsim.handling_qualities import HandlingQualities, rate_modes
from indicial.flightsim.linear import LinearFlight, linear_flight, matrix_derivatives
from indicial.flightsim.mode_decay import fitted_eigenvalue
from indicial.flightsim.modes import Mode, Modes
from indicial.flightsim.trim import Trim, trim
from indicial.flightsim.vehicle import Vehicle

BALANCED = ("CX_0", "CZ_0", "Cm_0")
_SMALL_PART = 0.02  # of the damping; smaller parts are not told in the summary


@dataclass(frozen=True)
class ModeDamping:
    """One mode of an aircraft.

    Parameters
    ----------
    mode : Mode
    fitted : complex or None
        Eigenvalue fitted to a nonlinear flight [1/s]; None for a neutral mode.
    closed_form : complex or None
        Eigenvalue by the classical approximation [1/s]; None for a coupled mode.
    gradient : mapping of str to complex
        d eigenvalue/d derivative [1/s].
    values : mapping of str to float
        The derivatives.
    uncertainties : mapping of str to float
        Standard errors of those that have one.
    """

    mode: Mode
    fitted: complex | None
    closed_form: complex | None
    gradient: Mapping[str, complex]
    values: Mapping[str, float]
    uncertainties: Mapping[str, float]

    @property
    def parts(self) -> dict[str, float]:
        """``v dRe/dv`` [1/s] of each derivative, the largest first."""
        parts = {name: self.values[name] * slope.real for name, slope in self.gradient.items()}
        return dict(sorted(parts.items(), key=lambda item: -abs(item[1])))

    @property
    def ratio_gradient(self) -> dict[str, float]:
        """d damping ratio/d derivative."""
        value = self.mode.eigenvalue
        size = abs(value)
        if size == 0.0:
            return dict.fromkeys(self.gradient, 0.0)
        growth = {name: (value.conjugate() * slope).real / size for name, slope in self.gradient.items()}
        return {name: -slope.real / size + value.real * growth[name] / size**2 for name, slope in self.gradient.items()}

    @property
    def standard_error(self) -> float:
        """Of the damping [1/s], from uncorrelated derivatives."""
        return math.hypot(*(self.gradient[name].real * error for name, error in self.uncertainties.items()), 0.0)

    @property
    def ratio_standard_error(self) -> float:
        """Of the damping ratio."""
        slopes = self.ratio_gradient
        return math.hypot(*(slopes[name] * error for name, error in self.uncertainties.items()), 0.0)

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""

        def pair(value: complex | None) -> list[float] | None:
            return None if value is None else [value.real, value.imag]

        return {
            "name": self.mode.name,
            "eigenvalue_1_s": pair(self.mode.eigenvalue),
            "fitted_1_s": pair(self.fitted),
            "closed_form_1_s": pair(self.closed_form),
            "damping_ratio": self.mode.damping_ratio,
            "damping_ratio_standard_error": self.ratio_standard_error,
            "damping_standard_error_1_s": self.standard_error,
            "parts_1_s": self.parts,
            "ratio_gradient": self.ratio_gradient,
        }


@dataclass(frozen=True)
class AircraftDamping:
    """All modes of an aircraft in one steady flight, and their levels.

    Parameters
    ----------
    steady : Trim
    linear : LinearFlight
    all_modes : Modes
    modes : tuple of ModeDamping
    qualities : HandlingQualities
    notes : tuple of str
        What the reader must know of the derivatives.
    """

    steady: Trim
    linear: LinearFlight
    all_modes: Modes
    modes: tuple[ModeDamping, ...]
    qualities: HandlingQualities
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> ModeDamping:
        for one in self.modes:
            if one.mode.name == name:
                return one
        raise InputError(f"no mode {name!r}; there are {', '.join(one.mode.name for one in self.modes)}")

    def summary(self) -> str:
        """Modes three ways, what their damping is made of, and the levels."""
        name, speed = self.steady.dynamics.vehicle.name, self.steady.variables["speed"]
        width = max(12, *(len(one.mode.name) for one in self.modes)) + 2
        lines = [
            f"{name}: modes at {speed:.5g} m/s, Mach {self.steady.outputs['mach']:.3g}",
            *(f"  note: {note}" for note in self.notes),
            f"  {'mode':<{width}}{'damping':>11}{'fitted':>11}{'closed form':>12}{'frequency':>11}{'ratio':>11}"
            f"{'+-':>8}  halves/doubles",
        ]
        for one in self.modes:
            m = one.mode
            fitted, few = ("-" if x is None else f"{x.real:.5g}" for x in (one.fitted, one.closed_form))
            time = f"doubles in {m.time_to_double:.3g} s" if m.damping > 0.0 else f"halves in {m.time_to_half:.3g} s"
            error = f"{one.ratio_standard_error:.2g}" if one.uncertainties else "-"
            lines.append(
                f"  {m.name:<{width}}{m.damping:>11.5g}{fitted:>11}{few:>12}{m.frequency:>11.5g}"
                f"{m.damping_ratio:>11.4g}{error:>8}  {time}"
            )
        lines.append("  damping and frequency in 1/s and rad/s; what the damping is made of, derivative by derivative:")
        for one in self.modes:
            size = max(abs(one.mode.damping), max(map(abs, one.parts.values()), default=0.0))
            told = [f"{name} {part:+.3g}" for name, part in one.parts.items() if abs(part) > _SMALL_PART * size]
            lines.append(f"  {one.mode.name:<{width}}{', '.join(told)}")
        lines.append("  and what the damping ratio changes with, for a tenth more of each derivative:")
        for one in self.modes:
            if one.mode.frequency:
                steps = {name: 0.1 * one.values[name] * slope for name, slope in one.ratio_gradient.items()}
                told = sorted((name for name in steps if abs(steps[name]) > 1e-4), key=lambda name: -abs(steps[name]))
                lines.append(f"  {one.mode.name:<{width}}{', '.join(f'{name} {steps[name]:+.2g}' for name in told)}")
        return "\n".join([*lines, self.qualities.summary()])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, schema version 1."""
        v = self.steady.variables
        return {
            "schema_version": 1,
            "kind": "aircraft damping",
            "name": self.steady.dynamics.vehicle.name,
            "speed_m_s": v["speed"],
            "altitude_m": v["altitude"],
            "mach": self.steady.outputs["mach"],
            "notes": list(self.notes),
            "modes": [one.to_dict() for one in self.modes],
            "handling_qualities": {
                "specification": "MIL-F-8785C",
                "class": self.qualities.aircraft_class,
                "category": self.qualities.category,
                "level": self.qualities.level,
                "ratings": [
                    {"what": r.what, "paragraph": r.paragraph, "value": r.value, "level": r.level}
                    for r in self.qualities.ratings
                ],
                "unrated": list(self.qualities.unrated),
            },
        }

    def plot(self) -> dict[str, Any]:
        """Figures by name: the modes, and what their damping is made of."""
        import matplotlib.pyplot as plt

        shown = [one for one in self.modes if one.mode.damping]
        figure, axes = plt.subplots(1, len(shown), figsize=(3.2 * len(shown), 3.8), layout="constrained", squeeze=False)
        for ax, one in zip(axes[0], shown, strict=True):
            parts = dict(list(one.parts.items())[:7])
            ax.barh([*parts, "whole"], [*parts.values(), one.mode.damping], color=["C0"] * len(parts) + ["0.4"])
            if one.uncertainties:
                ax.errorbar(one.mode.damping, len(parts), xerr=one.standard_error, color="k", capsize=3)
            ax.axvline(0.0, color="k", linewidth=0.8)
            ax.invert_yaxis()
            ax.set(title=one.mode.name, xlabel="damping [1/s]")
            ax.locator_params(axis="x", nbins=4)
        return {"modes": self.all_modes.plot(), "damping_parts": figure}


def aircraft_damping(
    vehicle: Vehicle,
    aerodynamics: BodyAxisAerodynamics,
    speed: float,
    *,
    atmosphere: Atmosphere,
    aircraft_class: str,
    category: str,
    altitude: float = 0.0,
    path_angle: float = 0.0,
    gravity: float = FlatEarth().g,
    uncertainties: Mapping[str, float] | None = None,
    notes: tuple[str, ...] = (),
) -> AircraftDamping:
    """Modes, damping and levels of an aircraft given by derivatives in stability axes.

    CX_0, CZ_0 and Cm_0 are what a steady flight at no incidence needs, whatever the model has there.

    Parameters
    ----------
    vehicle : Vehicle
    aerodynamics : BodyAxisAerodynamics
        With numbers.
    speed : float
        [m/s].
    atmosphere : Atmosphere
    aircraft_class, category : str
        Of MIL-F-8785C, as `rate_modes`.
    altitude, path_angle : float
        [m], [rad].
    gravity : float
        [m/s^2].
    uncertainties : mapping, optional
        Standard errors of derivatives by name.
    notes : tuple of str
        What the reader must know of the derivatives.

    Raises
    ------
    InputError
        If a derivative is not a number, or a name is unknown.
    """
    values = _derivatives(aerodynamics)
    errors = dict(uncertainties or {})
    for name in errors:
        if name not in values:
            raise InputError(f"uncertainty of {name}, which is no derivative here; there are {', '.join(values)}")
    linear = balanced_flight(
        vehicle,
        aerodynamics,
        speed,
        atmosphere=atmosphere,
        altitude=altitude,
        path_angle=path_angle,
        gravity=gravity,
    )
    modes = aircraft_modes(linear)
    n_alpha = _steady_n_alpha(linear)
    slopes = matrix_derivatives(linear, tuple(values))
    closed = classical_modes(vehicle, aerodynamics, float(air_at(atmosphere, altitude).density), speed, gravity)
    made = [
        ModeDamping(mode, _fit(linear, mode), closed.get(mode.name), gradient, values, errors)
        for mode, gradient in ((m, dict(zip(values, _gradient(linear.a, m, slopes), strict=True))) for m in modes.modes)
    ]
    qualities = rate_modes(aircraft_class, category, modes, n_alpha=n_alpha if n_alpha > 0.0 else None)
    return AircraftDamping(linear.trim, linear, modes, tuple(made), qualities, notes)


def balanced_flight(
    vehicle: Vehicle,
    aerodynamics: BodyAxisAerodynamics,
    speed: float,
    *,
    atmosphere: Atmosphere,
    altitude: float = 0.0,
    path_angle: float = 0.0,
    gravity: float = FlatEarth().g,
) -> LinearFlight:
    """Linear model of an aircraft, given by derivatives in stability axes, about the steady flight that they are of.

    CX_0, CZ_0 and Cm_0 are what that flight at no incidence needs; they and the derivatives are parameters of the
    model. The air is held as it is at the altitude. Parameters as `aircraft_damping`.
    """
    values = _derivatives(aerodynamics)
    symbols: dict[str, Any] = {name: ca.SX.sym(name) for name in (*BALANCED, *values)}
    here = air_at(atmosphere, altitude)
    air = ConstantAtmosphere(float(here.temperature), float(here.pressure))
    dynamics = build_dynamics(vehicle, replace(aerodynamics, **symbols), air, FlatEarth(gravity))
    given = {"speed": speed, "altitude": altitude, "path_angle": path_angle, **values}
    return linear_flight(trim(dynamics, unknown=BALANCED, given=given), outputs=("load_factor",))


def _steady_n_alpha(linear: LinearFlight) -> float:
    """Load factor per angle of attack [g/rad] in a steady pull-up at constant speed, as MIL-F-8785C defines n/alpha."""
    alpha, q = (linear.states.index(name) for name in ("alpha", "q"))
    turning = -linear.a[alpha, alpha] / linear.a[alpha, q]  # q per alpha that keeps alpha
    return float(linear.c[0, alpha] + linear.c[0, q] * turning)


def _derivatives(aerodynamics: BodyAxisAerodynamics) -> dict[str, float]:
    """Those that are not 0, by name."""
    found = {}
    for item in fields(aerodynamics):
        if item.name.startswith("C") and not item.name.endswith("_0"):
            value = getattr(aerodynamics, item.name)
            if not is_number(value):
                raise InputError(f"{item.name} is an expression: damping is taken apart for numbers")
            if float(value):
                found[item.name] = float(value)
    return found


def _gradient(matrix: Array, mode: Mode, slopes: Array) -> list[complex]:
    from scipy.linalg import eig

    values, left, right = eig(matrix, left=True, right=True)
    i = int(np.argmin(np.abs(values - mode.eigenvalue)))
    y, x = left[:, i].conj(), right[:, i]
    return [complex(y @ slope @ x / (y @ x)) for slope in slopes]


def _fit(linear: LinearFlight, mode: Mode) -> complex | None:
    return None if abs(mode.eigenvalue) < 1e-8 else fitted_eigenvalue(linear, mode)
