"""The free-flight study: its kept flights are there and consistent, and a short shot flies again as it was kept."""

from pathlib import Path

import numpy as np
import pytest

from indicial.flightsim import Trajectory
from indicial.studies.freeflight import STUDY
from indicial.studies.freeflight.computing import difference
from indicial.studies.freeflight.pieces import COARSE, FLIGHTS
from indicial.studies.kept import Results

KEPT = Results.kept("freeflight", STUDY.pieces)


def test_every_piece_is_kept_and_every_figure_computed() -> None:
    assert len(KEPT) == len(STUDY.pieces)
    assert all(claim.holds for claim in STUDY.claims(KEPT))


def test_kept_differences_are_those_of_the_kept_flights() -> None:
    for result in KEPT:
        flights = {name: Trajectory.load(result.file(name)) for name in FLIGHTS}
        for name in FLIGHTS[:2]:
            again = difference(flights["flow"], flights[name])
            assert again == pytest.approx(result.provenance["against_flow"][name], rel=1e-4, abs=1e-8)


def test_small_angles_fly_alike_with_derivatives_and_with_the_flow() -> None:
    """Where the flow is linear: damping within 0.5%, though the derivatives know nothing of the flight's flow."""
    small = KEPT.select(method="shot_1deg").at(2.0)
    assert small is not None
    for name in FLIGHTS[:2]:
        assert abs(small.provenance["against_flow"][name]["damping"]) < 0.005


def test_the_flow_is_not_the_model_it_is_compared_with() -> None:
    for result in KEPT:
        flow, other = (Trajectory.load(result.file(name)) for name in ("flow", "derivatives"))
        assert flow.provenance["method"] == "in flow"
        assert not np.array_equal(flow.velocity[: len(other)], other.velocity[: len(flow)])


def test_a_short_shot_flies_again_as_it_was_kept(tmp_path: Path) -> None:
    again = STUDY.compute(COARSE, tmp_path, None)
    kept = KEPT.select(method=COARSE.method).at(2.0)
    assert kept is not None
    for name in ("Cm_alpha", "Cm_q", "Cm_alphadot"):
        assert again.derivatives.value(name) == pytest.approx(kept.derivatives.value(name), rel=1e-6)
    one, other = (Trajectory.load(result.file("flow")) for result in (again, kept))
    assert one.alpha == pytest.approx(other.alpha, abs=1e-6)
