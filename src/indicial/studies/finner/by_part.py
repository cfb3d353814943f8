"""Which part of the body carries a derivative: loads of the linearised flow, summed over parts of the walls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.shapes import FinnedBody
from indicial.motion import FlightCondition

LOADS = ("CN", "Cm")


def derivatives_by_part(
    solver: FiniteVolumeSolver, condition: FlightCondition, body: FinnedBody
) -> dict[str, dict[str, float]]:
    """CN and Cm derivatives at k = 0 by part of the body, then by derivative; the parts add up to the whole."""
    operator = solver.linearise(condition)[0]
    incidence = operator.solve(-operator.b[:, operator.inputs.index("alpha")])
    disturbances = {
        "alpha": operator.wall_loads(incidence, "alpha"),
        "alphadot": operator.wall_loads(operator.solve(-operator.apply_mass(incidence))),
        "q": operator.wall_loads(operator.solve(-operator.b[:, operator.inputs.index("q")]), "q"),
    }
    rows = [operator.outputs.index(load) for load in LOADS]
    return {
        part: {
            f"{load}_{motion}": float(by_face[row][there].sum())
            for motion, by_face in disturbances.items()
            for load, row in zip(LOADS, rows, strict=True)
        }
        for part, there in _parts(solver, body).items()
    }


def _parts(solver: FiniteVolumeSolver, body: FinnedBody) -> dict[str, NDArray[np.bool_]]:
    """Which wall faces belong to each part."""
    mesh, walls = solver.mesh, solver.grid.wall_faces
    x = mesh.face_centre[walls, 0] / body.diameter
    on_body = np.isin(walls, np.arange(mesh.n_faces)[mesh.patch("body").faces])
    if body.fins is None:
        return {"body": on_body}
    fins = body.fins
    front = x < 0.5 * (fins.root_leading_edge + fins.trailing_edge)
    return {
        "body ahead of the fins": on_body & (x < fins.root_leading_edge),
        "body between the fins": on_body & (x >= fins.root_leading_edge),
        "fins, front half": ~on_body & front,
        "fins, rear half": ~on_body & ~front,
    }
