"""The cone at small incidence against exact conical flow: Taylor-Maccoll and its first-order (Stone) perturbation."""

from functools import cache

import numpy as np
import pytest

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import cone_mesh
from indicial.cfd.shapes import Cone
from indicial.conventions import ReferenceQuantities
from indicial.methods import moving_frame
from indicial.motion import FlightCondition
from indicial.reference_data import read_table

HALF_ANGLE = 10.0


def exact(mach: float) -> dict[str, float]:
    """CA (the flat base left out), CN_alpha on the base area, Cm_alpha about the apex on the length."""
    table = read_table("cone_exact")
    [row] = np.flatnonzero((table.numbers("sigma_deg") == HALF_ANGLE) & (table.numbers("M") == mach))
    names = {"CA_0": "cp0", "CN_alpha": "CNalpha", "Cm_alpha": "Cm_alpha_apex_per_l"}
    return {name: float(table.numbers(column)[row]) for name, column in names.items()}


@cache
def errors(mach: float, fineness: float) -> dict[str, float]:
    """Relative errors on a mesh with `fineness` times the cells of the quick one along each direction."""
    cone = Cone(HALF_ANGLE)
    solver = FiniteVolumeSolver(cone_mesh(cone, fineness, mach=mach), ReferenceQuantities(cone.length, cone.base_area))
    found = moving_frame.run(solver, FlightCondition(mach), ("alpha",), second=None)
    relative = {name: found[name] / value - 1.0 for name, value in exact(mach).items()}
    print(f"M {mach}, {solver.mesh.n_cells} cells: {relative}")
    return relative


@pytest.mark.parametrize("mach", [2.0, 3.0])
def test_cone_loads_equal_conical_flow_theory(mach: float) -> None:
    found = errors(mach, 1.0)
    assert abs(found["CA_0"]) < 0.005
    assert abs(found["CN_alpha"]) < 0.03
    assert abs(found["Cm_alpha"]) < 0.03


@pytest.mark.parametrize(
    ("mach", "coarse", "fine", "allowed"),
    [(2.0, 0.5, 1.0, 0.03), (3.0, 0.5, 1.0, 0.03), pytest.param(2.0, 1.0, 2.0, 0.01, marks=pytest.mark.slow)],
)
def test_cone_loads_converge_to_theory_with_second_order(
    mach: float, coarse: float, fine: float, allowed: float
) -> None:
    """Errors fall at least with the 1.6th power of the cells' size: by three where it is halved."""
    before, after = errors(mach, coarse), errors(mach, fine)
    for name in ("CN_alpha", "Cm_alpha"):
        assert abs(after[name]) < allowed
        assert abs(after[name]) < abs(before[name]) * (coarse / fine) ** 1.6
    assert abs(after["CA_0"]) < 0.005
