"""The fly stage: the same flight with derivatives and with the reduced-order model in the loop, and its damping."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import NoLimitError
from indicial.flightsim import (
    ConstantAtmosphere,
    DerivativeAerodynamics,
    End,
    InitialState,
    StateSpaceAerodynamics,
    SymmetricMissile,
    Trajectory,
    Vehicle,
    axisymmetric_inertia,
    simulate,
)
from indicial.flightsim.comparison import TrajectoryComparison, compare
from indicial.flightsim.damping import DampingCheck, check_damping
from indicial.pipeline.context import Context, Outcome
from indicial.pipeline.reducing import load_model

FLIGHTS = ("derivatives", "rom")

_SOURCES = {"mrf": ("CA_0", "CN_alpha", "CN_q", "Cm_alpha", "Cm_q", "Cl_p"), "irm": ("CN_alphadot", "Cm_alphadot")}


def flown_derivatives(context: Context) -> DerivativeTable:
    """The derivatives that are flown: static and rate derivatives by moving frame, those of alphadot by step response.

    Raises
    ------
    NoLimitError
        If a derivative of alphadot has no limit, so that there is no derivative model.
    """
    chosen: list[Derivative] = []
    refused = context.folder.read("irm")["refused"]
    for stage, names in _SOURCES.items():
        table = context.derivatives(stage)
        for name in names:
            if name in refused:
                raise NoLimitError(f"no derivative model can be flown, {name} was refused: {refused[name]}")
            chosen.append(table.one(name))
    return DerivativeTable(tuple(chosen))


def vehicle(context: Context) -> Vehicle:
    """The vehicle of the case; its centre of gravity is the moment reference point."""
    case = context.case
    reference = case.reference_quantities
    mass = case.vehicle
    return Vehicle(
        case.title,
        mass.mass_kg,
        axisymmetric_inertia(mass.axial_inertia_kg_m2, mass.transverse_inertia_kg_m2),
        reference,
        reference.moment_reference,
    )


def aerodynamics(context: Context) -> tuple[DerivativeAerodynamics, StateSpaceAerodynamics]:
    """The two aerodynamic models: derivatives, and state space with the same axial force and roll damping."""
    derivatives = DerivativeAerodynamics.from_table(flown_derivatives(context))
    model = load_model(context)
    lagging = StateSpaceAerodynamics(
        reference=model.reference, CA_0=derivatives.CA_0, Cl_p=derivatives.Cl_p, system=model.system
    )
    return derivatives, lagging


def fly_twice(context: Context) -> Outcome:
    """Fly, keep the flights, and check the damping."""
    body, models = vehicle(context), dict(zip(FLIGHTS, aerodynamics(context), strict=True))
    flights, checks = dict[str, Trajectory](), dict[str, DampingCheck]()
    for done, (name, model) in enumerate(models.items()):
        context.reporter.update(done / 3.0, f"flight with {name}")
        flights[name] = _fly(context, body, model)
        flights[name].save(context.folder.histories / f"flight_{name}.nc")
        flights[name].save(context.folder.histories / f"flight_{name}.csv")
        checks[name] = _damping(context, body, model)
    comparison = compare(flights["derivatives"], flights["rom"])
    results = {
        "damping": {name: _damping_record(check) for name, check in checks.items()},
        "flights": {name: _flight_record(flight) for name, flight in flights.items()},
        "comparison": _comparison_record(comparison),
        "flown": flown_derivatives(context).to_records(),
    }
    arm = checks["derivatives"].arms[0]
    change = checks["rom"].arms[0].linearised.real / arm.linearised.real - 1.0
    return Outcome(results, f"damping {arm.linearised.real:.3g} 1/s with derivatives, {change:+.2%} with the model")


def load_flights(context: Context) -> dict[str, Trajectory]:
    """The flights that the stage kept."""
    context.folder.read("fly")
    return {name: Trajectory.load(context.folder.histories / f"flight_{name}.nc") for name in FLIGHTS}


def atmosphere(context: Context) -> ConstantAtmosphere:
    """The still air of the case."""
    return ConstantAtmosphere(context.case.condition.temperature_K, context.case.condition.pressure_Pa)


def _fly(context: Context, body: Vehicle, model: SymmetricMissile) -> Trajectory:
    flight, condition = context.case.flight, context.case.flight_condition
    start = InitialState.from_path(
        condition.speed,
        alpha=math.radians(flight.initial_alpha_deg),
        beta=math.radians(flight.initial_beta_deg),
        rate=(math.radians(flight.roll_rate_deg_s), 0.0, 0.0),
    )
    # Long enough for a missile that loses half of its speed; the flight ends at the range's.
    duration = 2.0 * flight.distance_m / condition.speed
    return simulate(body, model, start, duration, end=End(x=flight.distance_m), atmosphere=atmosphere(context))


def _damping(context: Context, body: Vehicle, model: SymmetricMissile) -> DampingCheck:
    return check_damping(
        body,
        model,
        context.case.flight_condition.speed,
        roll_rate=math.radians(context.case.flight.roll_rate_deg_s),
        atmosphere=atmosphere(context),
    )


def _damping_record(check: DampingCheck) -> dict[str, Any]:
    return {
        "model": check.model,
        "slowing_1_s": check.slowing,
        "stable": all(arm.linearised.real < 0.0 for arm in check.arms),
        "arms": [
            {
                "name": arm.name,
                "linearised_1_s": arm.linearised.real,
                "decay_1_s": arm.decay,
                "fitted_1_s": arm.fitted.real,
                "closed_form_1_s": arm.closed_form.real,
                "turning_rad_s": arm.linearised.imag,
            }
            for arm in check.arms
        ],
    }


def _flight_record(flight: Trajectory) -> dict[str, Any]:
    return {
        "duration_s": float(flight.time[-1]),
        "final_mach": float(flight.mach[-1]),
        "final_position_m": flight.position[-1].tolist(),
        "largest_angle_deg": math.degrees(float(np.max(flight.total_angle))),
        "outside_range": bool(np.any(flight.outside_range)),
        "provenance": flight.provenance,
    }


def _comparison_record(comparison: TrajectoryComparison) -> dict[str, Any]:
    return {
        "rms_position_m": comparison.rms_position.tolist(),
        "rms_incidence_deg": math.degrees(comparison.rms_incidence),
        "arms": [asdict(arm) for arm in comparison.arms],
        "summary": comparison.summary(),
    }
