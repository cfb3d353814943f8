"""Damping of what a run has found, and of aircraft files."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from indicial.case import AircraftFile, read_aircraft
from indicial.errors import InputError
from indicial.flightsim import (
    AircraftDamping,
    Atmosphere,
    BodyAxisAerodynamics,
    ConstantAtmosphere,
    MissileDamping,
    Modes,
    ModeSweep,
    StandardAtmosphere,
    air_at,
    aircraft_damping,
    aircraft_modes,
    balanced_flight,
    missile_damping,
    missile_mode_sweep,
    sweep_modes,
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
    context = _context(target)
    case, body = context.case, vehicle(context)
    derivatives, model = aerodynamics(context)
    air, height = _air(altitude, atmosphere(context))
    speed = case.flight_condition.speed
    if mach is not None or altitude is not None:
        speed = _positive(case.condition.mach if mach is None else mach) * float(air_at(air, height).speed_of_sound)
    about = "uncertainties are those of the methods (amplitude, scatter, quadrature), not of mesh and gas model"
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
        notes=(about, *_held(mach, case.condition.mach)),
    )


def sweep_of_run(
    target: str | Path, machs: Sequence[float], altitudes: Sequence[float], *, roll_rate: float | None = None
) -> ModeSweep:
    """Modes of the missile of a run over Mach number and altitude [m] in the standard atmosphere.

    The derivatives stay those of the run. The roll rate [rad/s] is the case's if not given.
    """
    context = _context(target)
    derivatives, _ = aerodynamics(context)
    spin = math.radians(context.case.flight.roll_rate_deg_s) if roll_rate is None else roll_rate
    swept = missile_mode_sweep(vehicle(context), derivatives, machs, altitudes, roll_rate=spin)
    return replace(swept, notes=_kept(context.case.condition.mach))


def _kept(mach: float) -> tuple[str, ...]:
    return (f"derivatives are those of Mach {mach:.3g}, held over the sweep",)


def _context(target: str | Path) -> Context:
    """A run by its folder, case file or results."""
    given = Path(target)
    case, folder = open_run(given.parent if given.name == "results.json" and given.is_file() else target)
    return Context(case, folder, 1, LogReporter(), finite_volume)


def damping_of_aircraft(
    path: str | Path, *, mach: float | None = None, altitude: float | None = None
) -> AircraftDamping:
    """Modes, damping and levels of an aircraft file.

    Parameters
    ----------
    path : path
    mach, altitude : float, optional
        Instead of the file's Mach number and air; the loads are balanced anew, and the derivatives stay, but for
        ``CX_alpha = CL - CD_alpha``, which is taken in proportion to the lift coefficient (a parabolic polar).

    Raises
    ------
    InputError
        If the file is wrong, or a value makes no sense.
    """
    file = read_aircraft(path)
    here = file.condition
    own, own_mach = _own_air(file)
    air, height = _air(altitude, own)
    speed = here.speed_m_s
    if mach is not None or altitude is not None:
        number = own_mach if mach is None else _positive(mach)
        speed = number * float(air_at(air, height).speed_of_sound)
    return aircraft_damping(
        file.vehicle,
        _moved(file, speed, float(air_at(air, height).density)),
        speed,
        atmosphere=air,
        aircraft_class=file.aircraft_class,
        category=file.category,
        altitude=height if altitude is not None else here.altitude_m,
        path_angle=math.radians(here.path_angle_deg),
        gravity=here.gravity_m_s2,
        uncertainties=file.uncertainties,
        notes=_held(mach, own_mach),
    )


def sweep_of_aircraft(path: str | Path, machs: Sequence[float], altitudes: Sequence[float]) -> ModeSweep:
    """Modes of an aircraft file over Mach number and altitude [m] in the standard atmosphere.

    What changes with the condition is as in `damping_of_aircraft`.
    """
    file = read_aircraft(path)
    air = StandardAtmosphere()

    def modes_at(mach: float, altitude: float) -> Modes:
        here = air_at(air, altitude)
        speed = mach * float(here.speed_of_sound)
        loads = _moved(file, speed, float(here.density))
        flown = {"path_angle": math.radians(file.condition.path_angle_deg), "gravity": file.condition.gravity_m_s2}
        return aircraft_modes(balanced_flight(file.vehicle, loads, speed, atmosphere=air, altitude=altitude, **flown))

    return replace(sweep_modes(modes_at, machs, altitudes), notes=_kept(_own_air(file)[1]))


def _own_air(file: AircraftFile) -> tuple[ConstantAtmosphere, float]:
    """The air of an aircraft file, and its Mach number in it."""
    here = file.condition
    own = ConstantAtmosphere(here.temperature_K, here.density_kg_m3 * GAS_CONSTANT * here.temperature_K)
    return own, here.speed_m_s / float(air_at(own, 0.0).speed_of_sound)


def _moved(file: AircraftFile, speed: float, density: float) -> BodyAxisAerodynamics:
    """The file's derivatives at another dynamic pressure."""
    here = file.condition
    lift = here.density_kg_m3 * here.speed_m_s**2 / (density * speed**2)
    loads = file.aerodynamics(speed)
    return replace(loads, CX_alpha=lift * loads.CX_alpha)


def _held(mach: float | None, own: float) -> tuple[str, ...]:
    """What must be known of derivatives that are flown at another Mach number than their own."""
    if mach is None or abs(mach - own) < 5e-3:  # as files round it
        return ()
    return (f"derivatives are those of Mach {own:.3g}, held at Mach {mach:g}",)


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
