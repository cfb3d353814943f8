"""Eight shots of the Basic Finner down a range, with ten coefficients in common: a multiple fit as the ranges do it."""

from __future__ import annotations

import math
from functools import cache

import casadi as ca
import numpy as np

from indicial.flightsim import (
    TOTAL_ANGLE,
    DerivativeAerodynamics,
    Dynamics,
    InitialState,
    basic_finner_range_model,
    build_dynamics,
    fly,
)
from indicial.identification import Manoeuvre, OutputErrorFit, Parameter, SensitivityModel, fit_manoeuvres, measure
from indicial.identification.start_state import StartState

TRUTH = {
    "CA_0": 0.55,
    "CA_2": 2.0,
    "CN_alpha": 11.0,
    "CN_2": 20.0,
    "Cm_alpha": -26.0,
    "Cm_2": -30.0,
    "Cm_q": -340.0,
    "Cm_q_2": -900.0,
    "Cl_p": -22.0,
    "Cl_0": 0.02,
}
SPEED, STATIONS = 687.0, 54
FREE = ("x", "y", "z", "Vx", "Vy", "Vz", "yaw", "pitch", "roll", "p", "q", "r")


@cache
def missile() -> Dynamics:
    """Coefficients with a term in the square of the total angle."""
    body, c, square = basic_finner_range_model(), {name: ca.SX.sym(name) for name in TRUTH}, TOTAL_ANGLE**2
    model = DerivativeAerodynamics(
        reference=body.reference,
        CA_0=c["CA_0"] + c["CA_2"] * square,
        CN_alpha=c["CN_alpha"] + c["CN_2"] * square,
        Cm_alpha=c["Cm_alpha"] + c["Cm_2"] * square,
        Cm_q=c["Cm_q"] + c["Cm_q_2"] * square,
        Cl_p=c["Cl_p"],
        Cl_0=c["Cl_0"],
    )
    return build_dynamics(body, model)


@cache
def compiled() -> SensitivityModel:
    return SensitivityModel.of(missile(), ("x", "y", "z", "yaw", "pitch", "roll"))


def shot(seed: int) -> Manoeuvre:
    """Four to nine degrees of yaw, turning slowly; measured over 230 m, the start a little off."""
    random = np.random.default_rng(seed)
    size, clock = math.radians(random.uniform(4.0, 9.0)), random.uniform(0.0, 2.0 * math.pi)
    start = InitialState.from_path(
        SPEED, alpha=size * math.cos(clock), beta=size * math.sin(clock), rate=(random.uniform(-40.0, 40.0), 0.0, 0.0)
    )
    flown = fly(missile(), start, 0.34, step=2e-5, parameters=TRUTH, estimate_error=False)
    record = measure(flown, np.linspace(0.0, 228.0, STATIONS), seed=seed, roll=True)
    near = StartState.of(missile(), missile().initial_vector(start, list(TRUTH.values())), FREE)
    return Manoeuvre.of_range(record, compiled(), near, fastest=150.0, name=f"shot {seed}")


def fit(shots: list[Manoeuvre], factor: float) -> OutputErrorFit:
    return fit_manoeuvres(shots, [Parameter(name, factor * value) for name, value in TRUTH.items()])
