"""The flow across the fins on a cylinder about the body's axis, and how it lags behind a slow change of incidence."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.flow.gas import P
from indicial.cfd.mesh import Mesh
from indicial.errors import InputError
from indicial.motion import FlightCondition
from indicial.studies.finner.pitching_flow import Patch, stored_arrays, write_arrays

RADIUS = 1.0
"""Of the cylinder [calibres]: half way along the span of the fins."""

AXIAL = (8.0, 11.5)
"""x [calibres] between which faces are kept."""


@dataclass(frozen=True)
class AcrossFins:
    """Steady flow and its linear response on a cylinder of the mesh's faces.

    Parameters
    ----------
    surface : Patch
        With ``mach``, the steady Mach number relative to the body, and ``lag``, the pressure coefficient that a slow
        change of incidence adds to the quasi-steady one, per alphadot d/2V [1/rad].
    mach : float
        Of the flight.
    """

    surface: Patch
    mach: float

    @classmethod
    def of(cls, solver: FiniteVolumeSolver, condition: FlightCondition) -> Self:
        """On half a body. The lag is the pressure part of x1, ``J x1 = -E x0``, ``J x0 = -B_alpha``."""
        field, operator = solver.field(condition), solver.linearise(condition)[0]
        incidence = operator.solve(-operator.b[:, operator.inputs.index("alpha")])
        late = operator.solve(-operator.apply_mass(incidence)).reshape(-1, 5)[:, P] / (0.5 * condition.mach**2)
        mesh, diameter = solver.mesh, solver.reference.length
        faces = _cylinder(mesh, diameter)
        sides = (mesh.owner[faces], mesh.neighbour[faces])
        values = {
            name: 0.5 * (cells[sides[0]] + cells[sides[1]]) for name, cells in (("mach", field.mach), ("lag", late))
        }
        return cls(Patch.of(mesh, faces, diameter, values), condition.mach)

    def save(self, path: Path) -> None:
        """Write a compressed numpy archive in one step."""
        write_arrays(path, {"flight": self.mach, **self.surface.to_arrays("surface")})

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read what `save` wrote.

        Raises
        ------
        InputError
            If it is something else, or of another version.
        """
        with stored_arrays(path, "a flow across fins") as stored:
            return cls(Patch.from_arrays(stored, "surface", ("mach", "lag")), float(stored["flight"]))


def _cylinder(mesh: Mesh, diameter: float) -> NDArray[Any]:
    """Interior faces on the level of the mesh that is nearest the cylinder."""
    corners = [mesh.points[mesh.face_nodes(face)] / diameter for face in range(mesh.n_interior)]
    x = np.array([c[:, 0].mean() for c in corners])
    radii = [np.hypot(c[:, 1], c[:, 2]) for c in corners]
    low, high = np.array([r.min() for r in radii]), np.array([r.max() for r in radii])
    level = (high - low < 0.005) & (x > AXIAL[0]) & (x < AXIAL[1])
    if not level.any():
        raise InputError("the mesh has no faces on cylinders about the axis")
    middle = 0.5 * (low + high)
    nearest = middle[level][np.argmin(np.abs(middle[level] - RADIUS))]
    return np.flatnonzero(level & (np.abs(middle - nearest) < 0.01))
