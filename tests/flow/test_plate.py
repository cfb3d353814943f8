"""The supersonic flat plate: whole indicial histories and derivatives against exact linear theory."""

import numpy as np
import pytest

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import plate_mesh
from indicial.conventions import ReferenceQuantities
from indicial.history import History
from indicial.motion import AlphaStep, FlightCondition, PitchRateStep
from theory.plate import SupersonicPlate

REFERENCE = ReferenceQuantities(1.0, 1.0, (0.0, 0.0, 0.0))
AMPLITUDE = 1e-3


def solver(mach: float, cells: int) -> FiniteVolumeSolver:
    """A domain just tall enough that nothing comes back from its top within the plate."""
    height = 0.62 / np.sqrt(mach**2 - 1.0)
    mesh = plate_mesh(n_chord=cells, n_normal=int(0.75 * cells), height=height, ahead=0.1, behind=0.05)
    return FiniteVolumeSolver(mesh, REFERENCE)
