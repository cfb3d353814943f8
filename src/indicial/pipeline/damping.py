"""Damping of what a run has found, and of aircraft files."""

from __future__ import annotations

import math
from pathlib import Path

from indicial.case import read_aircraft
from indicial.errors import InputError
from indicial.flightsim import (
    AircraftDamping,
    Atmosphere,
    ConstantAtmosphere,
    MissileDamping,
    StandardAtmosphere,
    air_at,
    aircraft_damping,
    missile_damping,
)
from indicial.flightsim.atmosphere import GAS_CONSTANT
from indicial.flightsim.damping_sensitivity import NAMES
from indicial.pipeline.context import Context
from indicial.pipeline.flying import aerodynamics, atmosphere, flown_derivatives, vehicle
from indicial.pipeline.folder import open_run
from indicial.pipeline.progress import LogReporter
from indicial.pipeline.stages import finite_volume


def damping_of_run(
    target: str | Path, *, roll_rate: float | None = None, mach: float | None = None, altitude: float | None = None
) -> MissileDamping:
    """Damping of the missile of a run, with its derivatives and its model.

    Parameters
    ----------
    target : path
        A run folder, its ``results.json``, or the case file of one.
    roll_rate : float, optional
        [rad/s]; the case's if not given.
    mach, altitude : float, optional
        The case's Mach number and air if not given; with an altitude [m], the standard atmosphere there. The
        derivatives stay those of the run.

    Raises
    ------
    InputError
        If the run lacks the stages `mrf`, `irm` or `rom`.
    """
    given = Path(target)
    case, folder = open_run(given.parent if given.name == "results.json" and given.is_file() else target)
    context = Context(case, folder, 1, LogReporter(), finite_volume)
    body = vehicle(context)
    derivatives, model = aerodynamics(context)
    air, height = _air(altitude, atmosphere(context))
    speed = case.flight_condition.speed
    if mach is not None or altitude is not None:
        speed = _positive(case.condition.mach if mach is None else mach) * float(air_at(air, height).speed_of_sound)
    notes = ["uncertainties are those of the methods (amplitude, scatter, quadrature), not of mesh and gas model"]
    if mach is not None and mach != case.condition.mach:
        notes.append(f"derivatives and model are those of Mach {case.condition.mach:g}, held at Mach {mach:g}")
    known = {r.name: r.uncertainty for r in flown_derivatives(context) if r.uncertainty is not None}
    return missile_damping(
        body,
        derivatives,
        speed,
        model=model,
        roll_rate=math.radians(case.flight.roll_rate_deg_s) if roll_rate is None else roll_rate,
        atmosphere=air,
        altitude=height,
        uncertainties={name: error for name, error in known.items() if name in NAMES},
        notes=tuple(notes),
    )


def damping_of_aircraft(
    path: str | Path, *, mach: float | None = None, altitude: float | None = None
) -> AircraftDamping:
    """Modes, damping and levels of an aircraft file.

    Parameters
    ----------
    path : path
    mach, altitude : float, optional
        Instead of the file's Mach number and air; the derivatives stay, and the loads are balanced anew.

    Raises
    ------
    InputError
        If the file is wrong, or a value makes no sense.
    """
    file = read_aircraft(path)
    here = file.condition
    own = ConstantAtmosphere(here.temperature_K, here.density_kg_m3 * GAS_CONSTANT * here.temperature_K)
    air, height = _air(altitude, own)
    speed = here.speed_m_s
    if mach is not None or altitude is not None:
        number = speed / float(air_at(own, 0.0).speed_of_sound) if mach is None else _positive(mach)
        speed = number * float(air_at(air, height).speed_of_sound)
    return aircraft_damping(
        file.vehicle,
        file.aerodynamics(speed),
        speed,
        atmosphere=air,
        aircraft_class=file.aircraft_class,
        category=file.category,
        altitude=height if altitude is not None else here.altitude_m,
        path_angle=math.radians(here.path_angle_deg),
        gravity=here.gravity_m_s2,
        uncertainties=file.uncertainties,
    )


def _positive(mach: float) -> float:
    if not mach > 0.0:
        raise InputError(f"Mach number is {mach}, must be positive")
    return mach


def _air(altitude: float | None, own: ConstantAtmosphere) -> tuple[Atmosphere, float]:
    if altitude is None:
        return own, 0.0
    air = StandardAtmosphere()
    air_at(air, altitude)  # refuses what is beyond it
    return air, altitude
