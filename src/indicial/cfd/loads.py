"""From forces on the walls of a mesh to the six coefficients of the whole body."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from indicial.cfd.flow.gas import GAMMA
from indicial.cfd.flow.grid import SYMMETRY, Grid
from indicial.conventions import Array, ReferenceQuantities
from indicial.errors import InputError
from indicial.motion import FlightCondition

AMBIENT_PRESSURE = 1.0 / GAMMA
"""Of the still air, in the solver's units."""

_KEPT_BY_Y = np.array([1.0, 0.0, 1.0, 0.0, 1.0, 0.0])
_KEPT_BY_Z = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 1.0])


@dataclass(frozen=True)
class Cut:
    """Which planes of symmetry leave only a part of the body in the mesh.

    Parameters
    ----------
    y, z : bool
        Plane y = 0 (half a body), plane z = 0 (with the other, a quarter).
    plane : bool
        One layer of cells between two symmetry patches: a two-dimensional flow.
    """

    y: bool
    z: bool
    plane: bool

    @classmethod
    def of(cls, grid: Grid) -> Cut:
        """A patch that closes a part of a body has none opposite, so its areas do not balance.

        Raises
        ------
        InputError
            If a symmetry plane is neither y = 0 nor z = 0.
        """
        faces = grid.n_interior + np.flatnonzero(grid.kind == SYMMETRY)
        if not faces.size:
            return cls(False, False, False)
        left_over = np.abs(np.sum(grid.normal[faces] * grid.area[faces, None], axis=0)) / grid.area[faces].sum()
        x, y, z = (bool(part > 1e-6) for part in left_over)
        if x:
            raise InputError("a symmetry patch closes the body at a plane across x: planes y = 0 and z = 0 may")
        return cls(y, z, not (y or z))

    @property
    def factor(self) -> Array:
        """What loads of the part are multiplied with to be those of the whole, shape (6,)."""
        # a layer of a plane flow has no lateral loads: its own moments about x and z only tell how thick it is
        factor = _KEPT_BY_Y.copy() if self.plane else np.ones(6)
        for cut, kept in ((self.y, _KEPT_BY_Y), (self.z, _KEPT_BY_Z)):
            if cut:
                factor = 2.0 * kept * factor
        return factor


def coefficients(
    force: Array, moment: Array, cut: Cut, condition: FlightCondition, reference: ReferenceQuantities
) -> Array:
    """(CA, CY, CN, Cl, Cm, Cn) of the whole body, shape (..., 6), from loads in the solver's units and mesh axes."""
    c = reference.length
    pressure_area = 0.5 * condition.mach**2 * reference.area / c**2
    arms = reference.moment_lengths / c
    out: Array = np.concatenate([force, moment * [-1.0, 1.0, -1.0] / arms], axis=-1) / pressure_area * cut.factor
    return out
