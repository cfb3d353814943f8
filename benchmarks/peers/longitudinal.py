"""A light aircraft's 3-2-1-1 and four of its derivatives: one record for output error, ours and aeroid's.

Both fit one model: velocity, pitch rate and pitch angle under the same loads; 500 samples of alpha, q, theta and az.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from indicial.conventions import Array, ReferenceQuantities
from indicial.flightsim import BodyAxisAerodynamics, Dynamics, InitialState, Signal, Vehicle, build_dynamics
from indicial.identification import FlightRecord, Manoeuvre, OutputErrorFit, Parameter, SensitivityModel, fit_manoeuvres

TRUTH = {"CZ_alpha": -5.0, "Cm_alpha": -0.8, "Cm_q": -14.0, "Cm_elevator": -1.2}
NOISE = {"alpha": 0.002, "q": 0.003, "theta": 0.002, "az": 0.1}
CHANNELS = tuple(NOISE)
START = InitialState.from_path(60.0, alpha=0.05)
TIME = np.linspace(0.0, 10.0, 500)
ELEVATOR: Array = Signal.multistep(0.03, 0.7, 0.5).at(TIME)
CHORD, AREA, MASS, PITCH_INERTIA, CD_0, CZ_0, CM_0, GRAVITY = 1.5, 16.0, 1000.0, 1800.0, 0.05, -0.03, 0.04, 9.80665


@cache
def aircraft() -> Dynamics:
    reference = ReferenceQuantities(length=CHORD, area=AREA, lateral_length=11.0, moment_reference=(0.0, 0.0, 0.0))
    vehicle = Vehicle(
        name="light aircraft",
        reference=reference,
        mass=MASS,
        inertia=np.diag([1200.0, PITCH_INERTIA, 2700.0]),
        centre_of_gravity=(0.0, 0.0, 0.0),
    )
    free = {name: ca.SX.sym(name) for name in TRUTH}
    model = BodyAxisAerodynamics(
        reference=reference,
        CD_0=CD_0,
        CZ_0=CZ_0,
        CZ_alpha=free["CZ_alpha"],
        Cm_alpha=free["Cm_alpha"],
        Cm_q=free["Cm_q"],
        Cm_0=CM_0 + free["Cm_elevator"] * ca.SX.sym("elevator"),
    )
    return build_dynamics(vehicle, model)


@cache
def compiled() -> SensitivityModel:
    return SensitivityModel.of(aircraft(), CHANNELS)


@cache
def exact() -> Array:
    """What the instruments would see without noise, shape (500, 4)."""
    blank = FlightRecord(TIME, {c: np.zeros(TIME.size) for c in CHANNELS}, {"elevator": ELEVATOR}, NOISE)
    m = Manoeuvre.of_flight(blank, aircraft(), START, model=compiled(), known=TRUTH)
    values, drive = m.schedule([])
    seen: Array = m.fly(values, drive, np.full(values.size, -1, dtype=np.int64), np.zeros(0)).outputs
    return seen


def record(seed: int, memory: float) -> FlightRecord:
    """With Gaussian noise of first order, `memory` the correlation of neighbouring samples."""
    noise = np.random.default_rng(seed).standard_normal(exact().shape)
    for i in range(1, len(noise)):
        noise[i] = memory * noise[i - 1] + math.sqrt(1.0 - memory**2) * noise[i]
    seen = exact() + noise * np.array(list(NOISE.values()))
    return FlightRecord(TIME, dict(zip(CHANNELS, seen.T, strict=True)), {"elevator": ELEVATOR}, NOISE)


def fit(seen: FlightRecord, *, start_known: bool = False, factor: float = 1.0) -> OutputErrorFit:
    """Output error with noise and its colour estimated, from `factor` times the truth."""
    free = () if start_known else ("alpha", "theta", "q")
    manoeuvre = Manoeuvre.of_flight(seen, aircraft(), START, free_start=free, model=compiled())
    return fit_manoeuvres([manoeuvre], [Parameter(n, factor * v) for n, v in TRUTH.items()], threads=1)


_SCALAR = (math.sqrt, math.atan2, math.sin, math.cos)
"""Quicker than numpy's for one number."""


@cache
def _peer_model(gradient: str) -> Any:
    """The same motion for aeroid, by numpy or by JAX; the record holds no sideways motion."""
    import aeroid

    xp: Any = importlib.import_module("jax.numpy" if gradient == "jax" else "numpy")

    density = aircraft().atmosphere.air(0.0).density
    density = float(ca.DM(density)) if not isinstance(density, float) else density

    root, arctan2, sin, cos = (xp.sqrt, xp.arctan2, xp.sin, xp.cos) if gradient == "jax" else _SCALAR

    def loads(x: Array, u: Array, p: Mapping[str, float]) -> tuple[float, float, float]:
        speed = root(x[0] ** 2 + x[1] ** 2)
        if gradient != "jax" and speed == 0.0:  # as the peer tries its model once
            return 0.0, 0.0, 0.0
        push = 0.5 * density * speed**2 * AREA
        incidence, drag = x[1] / speed, 0.5 * density * speed * AREA * CD_0
        force_z = push * (CZ_0 + p["CZ_alpha"] * incidence) - drag * x[1]
        coefficient = (
            CM_0 + p["Cm_elevator"] * u[0] + p["Cm_alpha"] * incidence + p["Cm_q"] * x[2] * CHORD / (2.0 * speed)
        )
        return -drag * x[0] / MASS, force_z / MASS, push * CHORD * coefficient

    def dynamics(t: float, x: Array, u: Array, p: Mapping[str, float]) -> Array:
        along, down, moment = loads(x, u, p)
        sine, cosine = sin(x[3]), cos(x[3])
        return xp.array(
            [
                along - GRAVITY * sine - x[2] * x[1],
                down + GRAVITY * cosine + x[2] * x[0],
                moment / PITCH_INERTIA,
                x[2],
            ]
        )

    def measurement(t: float, x: Array, u: Array, p: Mapping[str, float]) -> Array:
        return xp.array([arctan2(x[1], x[0]), x[2], x[3], loads(x, u, p)[1]])

    return aeroid.Model(
        states=("u", "w", "pitch_rate", "pitch_angle"),
        controls=("elevator",),
        parameters=dict(TRUTH),
        dynamics=dynamics,
        outputs=CHANNELS,
        measurement=measurement,
    )


def peer_fit(seen: FlightRecord, factor: float = 1.0, gradient: str = "fd") -> Any:
    """aeroid's output error of the same record from the same start values, the initial state known.

    Derivatives by differences of an adaptive integrator's flights ("fd", as it comes), or by JAX from Runge-Kutta steps
    from sample to sample ("jax"), as ours are.
    """
    import aeroid

    data = aeroid.FlightData(seen.time, {"elevator": ELEVATOR, **{c: seen[c] for c in CHANNELS}})
    start = [60.0 * math.cos(0.05), 60.0 * math.sin(0.05), 0.0, 0.05]
    return aeroid.identify(
        _peer_model(gradient),
        data,
        list(TRUTH),
        initial_guess={n: factor * v for n, v in TRUTH.items()},
        weights={c: 1.0 / size for c, size in NOISE.items()},
        x0=start,
        gradient=gradient,
    )
