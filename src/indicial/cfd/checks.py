"""What a mesh cannot answer for: motions through its mirror, moments about other points, slow outflow."""

from __future__ import annotations

import numpy as np

from indicial.cfd.flow.gas import GAMMA, P
from indicial.cfd.flow.grid import OUTFLOW, SYMMETRY, Grid
from indicial.cfd.flow.residual import MeshMotion
from indicial.cfd.loads import Cut
from indicial.cfd.march.steady import SteadyState
from indicial.cfd.mesh import Mesh
from indicial.conventions import Array, Index, ReferenceQuantities
from indicial.errors import InputError


def check_moment_reference(mesh: Mesh, grid: Grid, cut: Cut, reference: ReferenceQuantities) -> None:
    """The loads of the whole follow from those of a part only about a point that the planes of symmetry share."""
    faces = _faces(grid, SYMMETRY)
    for axis in (axis for axis, there in ((1, cut.y), (2, cut.z)) if there):
        across = faces[np.abs(grid.normal[faces, axis]) > 0.5]
        gap = float(np.max(np.abs(mesh.face_centre[across, axis] - reference.moment_reference[axis])))
        if gap > 1e-6 * reference.length:
            raise InputError(
                f"the moment reference point is {gap:.3g} m off the mesh's symmetry plane along {'xyz'[axis]}: "
                "about such a point only the full mesh tells the loads"
            )


def check_symmetry(grid: Grid, motion: MeshMotion) -> None:
    """A mirrored half cannot move through its own mirror."""
    faces = _faces(grid, SYMMETRY)
    if faces.size and np.max(np.abs(_swept(grid, faces, motion))) > 1e-9:
        raise InputError("the motion crosses the mesh's symmetry plane: p, r and beta need the full mesh")


def check_outflow(grid: Grid, state: SteadyState) -> None:
    """All that leaves by an outflow patch must leave faster than sound: nothing is said there of what is behind."""
    faces = _faces(grid, OUTFLOW)
    q = state.q[grid.owner[faces]]
    through = np.sum(q[:, 1:4] * grid.normal[faces], axis=1) - _swept(grid, faces, state.motion)
    mach = through / np.sqrt(GAMMA * q[:, P] / q[:, 0])
    slow = int(np.sum(mach < 1.0))
    if slow:
        raise InputError(
            f"{slow} of {faces.size} outflow faces are not crossed at supersonic speed (least Mach number "
            f"{np.min(mach):.2f}): use a higher Mach number, or a mesh that goes on downstream"
        )


def _faces(grid: Grid, kind: int) -> Index:
    """Boundary faces of one kind."""
    return grid.n_interior + np.flatnonzero(grid.kind == kind)


def _swept(grid: Grid, faces: Index, motion: MeshMotion) -> Array:
    """Normal velocity of faces."""
    normal: Array = grid.normal[faces] @ motion.velocity + (grid.moment[faces] @ motion.omega) / grid.area[faces]
    return normal
