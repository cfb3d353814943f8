"""Models projected from the linearised flow beside models fitted to marched steps, at equal order.

Half a Basic Finner at Mach 2 on a coarse mesh, alpha and q to CN and Cm. The error is the largest over 0 <= k <= 0.5
and over the four channels, relative to each channel's peak, against H(ik) solved at frequencies that neither model has
seen. Step errors are against the marched step responses: mean over reduced time, relative to the mean response.
"""

from __future__ import annotations

import numpy as np
from figures import Figure

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import finned_body_mesh
from indicial.cfd.shapes import FinnedBody
from indicial.conventions import COEFFICIENTS
from indicial.methods import indicial_response
from indicial.motion import FlightCondition
from indicial.rom import StateSpaceModel, StepResponses, project, realise

CONDITION, FACTOR, K_MAX, AMPLITUDE = FlightCondition(2.0), 0.6, 0.5, 2e-4
ORDERS = (4, 8, 12)
LOADS = ("CN", "Cm")


def measure() -> list[Figure]:
    """Make both kinds of model at each order and compare them."""
    body = FinnedBody.basic_finner()
    solver = FiniteVolumeSolver(finned_body_mesh(body, FACTOR, mach=CONDITION.mach), body.reference(5.5))
    s = indicial_response.step_times(0.1, 1.05, 0.5, 60.0)
    steps = StepResponses.from_histories(
        [indicial_response.run(solver, CONDITION, AMPLITUDE, s, kind) for kind in ("alpha", "q")]
    )
    exact = solver.frequency_response(CONDITION, np.linspace(0.03, K_MAX - 0.013, 9), ("alpha", "q"))
    rows = [COEFFICIENTS.index(load) for load in LOADS]
    wanted = exact.values[:, rows]
    flow = solver.linearise(CONDITION)[0]
    figures = [Figure("cells", solver.mesh.n_cells, "")]
    for order in ORDERS:
        projection = project(flow, K_MAX, order=order)
        models = {"projected": projection.model, "fitted": realise(steps, order=order // 2)}
        errors = {}
        for name, model in models.items():
            # a projected model has CA among its outputs
            kept = [model.outputs.index(load) for load in LOADS]
            found = model.frequency_response(exact.k)[:, kept]
            errors[name] = float(np.max(np.max(np.abs(found - wanted), axis=0) / np.max(np.abs(wanted), axis=0)))
            figures.append(Figure(f"{name}, {model.order} states: error over the band", errors[name], ""))
            figures.append(Figure(f"{name}, {model.order} states: error of the steps", _step_error(model, steps), ""))
        figures.append(Figure(f"projected, {order} states: error by its own estimate", projection.estimated_error, ""))
    return figures


def _step_error(model: StateSpaceModel, steps: StepResponses) -> float:
    """Largest over the channels of the mean difference from the marched steps, relative to the mean response."""
    worst = 0.0
    for name in steps.inputs:
        s = steps[name].s
        own = model.step(s)
        for load in LOADS:
            (_, found), (_, wanted) = own.channel(load, name), steps.channel(load, name)
            error = np.trapezoid(np.abs(found - wanted), s) / np.trapezoid(np.abs(wanted), s)
            worst = max(worst, float(error))
    return worst
