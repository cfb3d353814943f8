"""The Basic Finner with a sting for its wake: supersonic, where nothing comes back from behind, and at M 1."""

from functools import cache

import numpy as np
import pytest

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import WideDomain, finned_body_mesh
from indicial.cfd.shapes import FinnedBody
from indicial.methods import moving_frame
from indicial.motion import FlightCondition
from indicial.reference_data import FINNER_MOMENT_REFERENCE, read_table

FINNER = FinnedBody.basic_finner()
SLOPES = ("CN_alpha", "Cm_alpha")


@cache
def slopes(mach: float, fineness: float, domain: WideDomain | None = None) -> dict[str, float]:
    """With a sting in that domain, or without a wake."""
    if domain is None:
        mesh = finned_body_mesh(FINNER, fineness, mach=mach)
    else:
        mesh = finned_body_mesh(FINNER, fineness, wake="sting", domain=domain)
    solver = FiniteVolumeSolver(mesh, FINNER.reference(FINNER_MOMENT_REFERENCE))
    found = moving_frame.run(solver, FlightCondition(mach), ("alpha",), second=None)
    print(f"M {mach}, {mesh.n_cells} cells, {domain}: { ({name: round(found[name], 4) for name in SLOPES}) }")
    return {name: found[name] for name in SLOPES}


def test_in_a_supersonic_stream_the_length_of_the_sting_does_not_matter() -> None:
    """Planes up to the base are the same; what reaches them from behind does so in the fins' small dead water only."""
    long, short = (slopes(2.0, 0.5, WideDomain(4.0, downstream, 12.0)) for downstream in (20.0, 5.0))
    for name in SLOPES:
        assert short[name] == pytest.approx(long[name], rel=1e-4)


@pytest.mark.slow
def test_at_mach_2_a_mesh_with_a_sting_gives_the_loads_of_one_without_a_wake() -> None:
    for name, value in slopes(2.0, 1.0).items():
        assert slopes(2.0, 1.0, WideDomain(4.0, 4.0, 12.0))[name] == pytest.approx(value, rel=0.03)


@pytest.mark.slow
def test_the_slopes_at_mach_1_do_not_hang_on_the_domain_and_are_those_of_free_flights() -> None:
    """Within 5% between domains of which one is twice the other; within 15% of the flights at M 1.06."""
    table = read_table("basic_finner_range_shots")
    near = table.numbers("mach") < 1.1
    measured = {name: np.mean(table.numbers(column)[near]) for name, column in zip(SLOPES, ("cna", "cma"), strict=True)}
    found, wider = (slopes(1.0, 0.7, WideDomain(20.0 * f, 20.0 * f, 30.0 * f)) for f in (1.0, 2.0))
    for name in SLOPES:
        assert found[name] == pytest.approx(wider[name], rel=0.05)
        assert found[name] == pytest.approx(measured[name], rel=0.15)
