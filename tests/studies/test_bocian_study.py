"""The glider's study: its dimensions, its polars, its kept numbers, and its free motion in roll."""

import math
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from indicial.cfd.lattice import Lattice, LatticeSolver, NeuralFoil
from indicial.cli import app
from indicial.motion import Rates
from indicial.pipeline.progress import LogReporter
from indicial.reference_data import read_table
from indicial.studies import find_study
from indicial.studies.bocian.glider import ROOT, TRIPPED, USUAL, Glider, dimensions, flight, polars, solver
from indicial.studies.bocian.rocking import release
from indicial.studies.claim import summarise
from indicial.studies.computing import recompute
from indicial.studies.kept import Results

STUDY = find_study("bocian")
KEPT = Results.kept("bocian", STUDY.pieces)
SMALL = {"panels": [2, 5], "polars": TRIPPED, "changes": {"tail": False}}


def test_kept_numbers_are_those_of_the_code() -> None:
    for one in recompute(STUDY, "coarse", 1, LogReporter()):
        assert one.agrees, one.summary()


def test_estimated_chords_and_published_area_agree() -> None:
    glider, given = Glider.published(), dimensions()
    assert glider.root_chord == pytest.approx(given["wing_root_chord"], rel=1e-3)
    wing = glider.surfaces()[0]
    assert wing.area * math.cos(glider.dihedral) == pytest.approx(given["wing_area"], rel=1e-3)
    assert wing.span == given["wing_span"]


def test_every_dimension_says_whether_it_is_published() -> None:
    assert set(read_table("szd9_bocian").text("status")) == {"published", "estimated", "inferred"}


def test_paper_s_half_span_makes_derivatives_four_times_the_usual_ones() -> None:
    glider = Glider.published()
    lattice = Lattice.of(glider.surfaces(), chordwise=2, spanwise={"wing": 5, "tailplane": 3})
    whole = replace(glider.reference, lateral_length=glider.span)
    slopes = []
    for reference in (glider.reference, whole):
        loads = LatticeSolver(lattice, reference).steady(flight(2.0), Rates(p=0.2))
        slopes.append(loads["Cl"] / (0.2 * float(reference.rate_scale(flight(2.0).speed)[0])))
    assert slopes[1] / slopes[0] == pytest.approx(USUAL, rel=1e-12)


def test_kept_polars_are_the_network_s() -> None:
    pytest.importorskip("neuralfoil")
    kept = polars(TRIPPED).polars[ROOT.name][-1]
    again = NeuralFoil(size="xlarge", transition=0.1)(ROOT, kept.reynolds)
    np.testing.assert_allclose(np.interp(kept.alpha, again.alpha, again.cl), kept.cl, atol=1e-4)


def test_glider_let_go_in_attached_flow_stops_rolling() -> None:
    one, inertia = solver(SMALL), dimensions()["roll_inertia"]
    calm = release(one, flight(4.0), inertia, 0.05, 1.0, 0.02)
    assert not calm.autorotates
    assert calm.growth < 0.0
    assert abs(calm.rate[-1]) < 0.01 * calm.rate[0]


def test_free_motion_in_roll_is_that_of_its_own_moment() -> None:
    """Twice the inertia, so much that the flow is all but steady: the rate falls half as quickly."""
    one, inertia = solver(SMALL), dimensions()["roll_inertia"]
    quick, slow = (release(one, flight(4.0), scale * inertia, 0.05, 0.6, 0.02) for scale in (100.0, 200.0))
    assert quick.growth / slow.growth == pytest.approx(2.0, rel=0.02)


def test_all_pieces_are_kept_and_check_prints_every_figure() -> None:
    assert len(KEPT) == len(STUDY.pieces)
    done = CliRunner().invoke(app, ["study", "bocian", "--check"])
    claims = STUDY.claims(KEPT)
    assert summarise(claims) in done.stdout
    assert done.exit_code == (0 if all(claim.holds for claim in claims) else 1)


def test_one_sided_and_central_differences_of_a_symmetric_glider_are_the_same() -> None:
    for row in KEPT.select(method="frame", level="coarse").results[0].provenance["rows"]:
        assert row["one_sided"] == pytest.approx(row["central"], rel=1e-6)


def test_nothing_computed_is_said_so() -> None:
    assert all(not claim.holds for claim in STUDY.claims(Results(())))


def test_figures_are_drawn_from_what_is_kept(tmp_path) -> None:
    paths = STUDY.draw(KEPT, tmp_path)
    assert {path.name for path in paths} >= {"incidence.png", "frequency.png", "loops.png", "separation.png"}
    assert all(path.stat().st_size > 5000 for path in paths)


def test_the_shortfall_at_four_degrees_is_accounted_for() -> None:
    """Its parts, each from a case of its own, make up the whole; panels, strips and steps are no part of it."""
    [claim] = [one for one in STUDY.claims(KEPT) if one.name == "the same: what its parts leave unexplained"]
    assert claim.value is not None
    assert claim.value < 1e-3
    rows = KEPT.select(method="shortfall").results[0].provenance["rows"]
    for case in ("20 strips a half", "6 panels along the chord", "96 steps a period"):
        assert rows[case] == pytest.approx(rows["base"], rel=2e-3)
