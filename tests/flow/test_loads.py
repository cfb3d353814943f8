"""Loads of the whole body from a part of it."""

import numpy as np
import pytest

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import finned_body_mesh, plate_mesh
from indicial.cfd.mesh.sectors import Extent
from indicial.cfd.shapes import FinnedBody
from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.motion import FlightCondition, Rates

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


@pytest.mark.parametrize("sector", ["half", "quarter"])
def test_a_moment_reference_off_the_symmetry_plane_is_refused(sector: Extent) -> None:
    """About such a point the whole body has roll and yaw moments that a mirrored part cannot tell."""
    body = FinnedBody.basic_finner()
    mesh, reference = finned_body_mesh(body, 0.45, mach=2.0, sector=sector), body.reference(5.5)
    x, _, _ = reference.moment_reference
    with pytest.raises(InputError, match="off the mesh's symmetry plane"):
        FiniteVolumeSolver(mesh, reference.about((x, 0.5 * reference.length, 0.0)))
    if sector == "half":
        FiniteVolumeSolver(mesh, reference.about((x, 0.0, 0.5 * reference.length)))


def layer() -> FiniteVolumeSolver:
    mesh = plate_mesh(n_chord=8, n_normal=6, height=0.4, ahead=0.25, behind=0.25)
    return FiniteVolumeSolver(mesh, ReferenceQuantities(1.0, 1.0))


def test_a_plane_flow_has_no_lateral_loads() -> None:
    found = layer().steady(FlightCondition(2.0, alpha=0.02))
    assert found["CN"] > 0.03
    assert [found[name] for name in ("CY", "Cl", "Cn")] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_motion_that_is_not_finite_is_refused(bad: float) -> None:
    with pytest.raises(InputError, match="must be finite"):
        layer().steady(CONDITION, Rates(q=bad))
    with pytest.raises((InputError, ValueError)):
        layer().steady(FlightCondition(2.0, alpha=bad))
