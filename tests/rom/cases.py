"""Exact cases for the reduced-order models: a known linear system and the supersonic plate."""

from __future__ import annotations

import numpy as np

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities, time_from_reduced
from indicial.history import History
from indicial.motion import AlphaStep, FlightCondition, PitchRateStep
from indicial.rom import StepResponses
from indicial.solver import Solver
from theory.linear import LinearSystem
from theory.plate import SupersonicPlate

REFERENCE = ReferenceQuantities(length=0.5, area=0.2, moment_reference=(0.3, 0.0, 0.0))
CONDITION = FlightCondition(mach=2.0, alpha=0.05)
OUTPUTS = ("CN", "Cm")
ROWS = [COEFFICIENTS.index(name) for name in OUTPUTS]
COLUMNS = [0, 3]  # alpha, q of the linear system's inputs


def known_system() -> LinearSystem:
    """Loads of alpha (real poles 0.2 and 0.7) and of q (0.35 and the pair 0.3 +- 0.5i), with direct feedthrough."""
    poles = np.array([-0.2, -0.7, -0.35, -0.3 + 0.5j])
    b, c, d = np.zeros((4, 5)), np.zeros((6, 4)), np.zeros((6, 5))
    b[:2, 0], b[2:, 3] = 1.0, 1.0
    c[ROWS] = [[0.8, -0.9, 0.6, 0.5], [-0.3, 0.7, -1.1, 0.4]]
    d[np.ix_(ROWS, COLUMNS)] = [[3.0, 1.5], [-2.0, -6.0]]
    offset = np.array([0.02, 0.0, 0.1, 0.0, -0.04, 0.0])
    return LinearSystem(REFERENCE, poles, b, c, d, offset)


def plate(arm: float = 0.0) -> tuple[SupersonicPlate, FlightCondition]:
    """The supersonic plate of chord 1 about a point `arm` chords ahead of mid-chord, reference length one chord."""
    reference = ReferenceQuantities(1.0, 1.0, (0.5 - arm, 0.0, 0.0))
    return SupersonicPlate(reference), FlightCondition(mach=2.0)


def steps(solver: Solver, condition: FlightCondition, s: Array, amplitude: float = 0.01) -> list[History]:
    """Steps in alpha [rad] and in q (of the same size as q c/2V) at reduced times s."""
    times = time_from_reduced(s, condition.speed, solver.reference.length)
    rate = amplitude * 2.0 * condition.speed / solver.reference.length
    return [
        solver.unsteady(condition, AlphaStep(condition, amplitude), times),
        solver.unsteady(condition, PitchRateStep(condition, rate), times),
    ]


def responses(solver: Solver, condition: FlightCondition, s: Array) -> StepResponses:
    return StepResponses.from_histories(steps(solver, condition, s), OUTPUTS)


def graded(end: float, count: int) -> Array:
    """Reduced times from 0, closer together at first, as a solver takes them."""
    grid: Array = end * np.linspace(0.0, 1.0, count) ** 1.7
    return grid
