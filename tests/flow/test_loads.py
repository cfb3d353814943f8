"""Loads of the whole body from a part of it."""

import numpy as np
import pytest

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import finned_body_mesh
from indicial.cfd.mesh.sectors import Extent
from indicial.cfd.shapes import FinnedBody
from indicial.errors import InputError
from indicial.motion import FlightCondition

CONDITION = FlightCondition(2.0)


def solver(sector: Extent) -> FiniteVolumeSolver:
    body = FinnedBody.basic_finner()
    return FiniteVolumeSolver(finned_body_mesh(body, 0.45, mach=2.0, sector=sector), body.reference(5.5))


def test_half_and_quarter_of_a_body_have_the_axial_force_of_the_whole() -> None:
    whole, half, quarter = (solver(sector).steady(CONDITION).coefficients for sector in ("full", "half", "quarter"))
    assert whole[0] > 0.05
    for part in (half, quarter):
        assert part[0] == pytest.approx(whole[0], rel=1e-8)
        assert np.max(np.abs(part[1:])) < 1e-8


def test_a_quarter_of_a_body_is_not_linearised() -> None:
    with pytest.raises(InputError, match="quarter"):
        solver("quarter").linearise(CONDITION)
