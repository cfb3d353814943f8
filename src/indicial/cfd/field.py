"""A steady flow as fields, for pictures and for checks against theory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from indicial.cfd.flow.gas import GAMMA, P
from indicial.cfd.flow.grid import Grid
from indicial.cfd.march.steady import SteadyState
from indicial.cfd.mesh import Mesh
from indicial.conventions import Array, Index, ReferenceQuantities
from indicial.motion import FlightCondition


@dataclass(frozen=True)
class FlowField:
    """Cell and wall values of a steady flow, mesh axes.

    Parameters
    ----------
    mesh : Mesh
    condition : FlightCondition
    density, pressure : ndarray
        Relative to the still air's (nc,).
    velocity : ndarray
        Absolute velocity over the still air's speed of sound (nc, 3).
    mach : ndarray
        Mach number relative to the body (nc,).
    wall_faces : ndarray
        Indices of the wall faces.
    wall_cp : ndarray
        Pressure coefficient on them.
    """

    mesh: Mesh
    condition: FlightCondition
    density: Array
    pressure: Array
    velocity: Array
    mach: Array
    wall_faces: Index
    wall_cp: Array

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        grid: Grid,
        reference: ReferenceQuantities,
        condition: FlightCondition,
        state: SteadyState,
        face_flux: Array,
    ) -> FlowField:
        """The fields of a converged state; wall pressures from the fluxes that made the loads."""
        q = state.q
        arm = (mesh.cell_centre - np.asarray(reference.moment_reference)) / reference.length
        relative = q[:, 1:4] - state.motion.velocity - np.cross(state.motion.omega, arm)
        mach = np.linalg.norm(relative, axis=1) / np.sqrt(GAMMA * q[:, P] / q[:, 0])
        faces = grid.wall_faces
        pressure = np.sum(face_flux[faces, 1:4] * grid.normal[faces], axis=1) / grid.area[faces]
        cp = (pressure - 1.0 / GAMMA) / (0.5 * condition.mach**2)
        return cls(mesh, condition, q[:, 0].copy(), GAMMA * q[:, P], q[:, 1:4].copy(), mach, faces, cp)

    @property
    def cp(self) -> Array:
        """Pressure coefficient of the cells."""
        return np.asarray((self.pressure - 1.0) / (0.5 * GAMMA * self.condition.mach**2))
