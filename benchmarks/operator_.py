"""All longitudinal derivatives by the operator: against its steady solution, and against forced oscillation.

The Basic Finner at Mach 2, half a body, quick mesh. The steady solution starts impulsively. Forced oscillation is that
of the published settings: k = 0.025, U dt/d = 0.05, two periods, of which the second is read. Of its steps a stretch is
timed and the rest reckoned from it, unless INDICIAL_WHOLE_OSCILLATION is set.
"""

from __future__ import annotations

import os
import time

import numpy as np
from figures import Figure

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import finned_body_mesh
from indicial.cfd.shapes import FinnedBody
from indicial.methods import forced_oscillation, operator
from indicial.motion import FlightCondition

CONDITION = FlightCondition(2.0)
K, STEP, PERIODS, AMPLITUDE = 0.025, 0.05, 2, np.radians(1.0)
TIMED_STEPS = 60


def measure() -> list[Figure]:
    """Time the steady solution, the operator and the march on one mesh."""
    body = FinnedBody.basic_finner()
    mesh = finned_body_mesh(body, "quick", mach=CONDITION.mach)
    # once over, so that nothing compiles while the clock runs
    warm = FiniteVolumeSolver(finned_body_mesh(body, 0.4, mach=CONDITION.mach), body.reference(5.5))
    operator.run(warm, CONDITION)
    _march(warm, 3)

    steady, linear = [], []
    for _ in range(3):
        solver = FiniteVolumeSolver(mesh, body.reference(5.5))
        start = time.perf_counter()
        solver.steady(CONDITION)
        between = time.perf_counter()
        response = operator.run(solver, CONDITION)
        steady.append(between - start)
        linear.append(time.perf_counter() - between)
    steps = PERIODS * round(np.pi / K / STEP)
    whole = bool(os.environ.get("INDICIAL_WHOLE_OSCILLATION"))
    timed = steps if whole else TIMED_STEPS
    start = time.perf_counter()
    _march(solver, timed)
    marched = (time.perf_counter() - start) * steps / timed
    table = operator.derivatives(response)
    return [
        Figure("cells", mesh.n_cells, ""),
        Figure("steady solution", min(steady), "s"),
        Figure("operator: all longitudinal derivatives", min(linear), "s"),
        Figure(f"forced oscillation, {steps} steps, {'run' if whole else 'from'} {timed}", marched, "s"),
        Figure("Cm_q+Cm_alphadot by the operator", table.value("Cm_q+Cm_alphadot", k=None), ""),
        Figure.at_most("operator over steady solution", min(linear) / min(steady), 1.0),
        Figure.at_least("forced oscillation over operator", marched / min(linear), 100.0),
    ]


def _march(solver: FiniteVolumeSolver, steps: int) -> None:
    """The first `steps` steps of the oscillation."""
    oscillation = forced_oscillation.experiment(CONDITION, solver.reference, AMPLITUDE, K)
    dt = oscillation.period / round(np.pi / K / STEP)
    solver.unsteady(CONDITION, oscillation, dt * np.arange(steps + 1))
