"""The Basic Finner's study: its kept numbers are those of the code, and its check reads them."""

import pytest
from typer.testing import CliRunner

from indicial.cli import app
from indicial.conventions import transfer_longitudinal
from indicial.pipeline.progress import LogReporter
from indicial.studies import find_study
from indicial.studies.claim import summarise
from indicial.studies.computing import recompute
from indicial.studies.finner.agreement import SUM, flights
from indicial.studies.finner.meshes import FINENESS
from indicial.studies.finner.selection import about, derivative, finest
from indicial.studies.kept import Results

STUDY = find_study("finner")
KEPT = Results.kept("finner", STUDY.pieces)


def test_kept_numbers_are_those_of_the_code():
    for one in recompute(STUDY, "coarse", 1, LogReporter()):
        assert one.agrees, one.summary()


def test_pieces_have_names_of_their_own_and_meshes_that_exist():
    names = [piece.name for piece in STUDY.pieces]
    assert len(set(names)) == len(names)
    assert all(piece.level in FINENESS[piece.mesh] for piece in STUDY.pieces)


def test_the_sweep_has_the_flights_own_mach_numbers_on_three_meshes_and_more_than_twenty_in_all():
    sweep = [piece for piece in STUDY.pieces if piece.method == "operator"]
    for level in ("quick", "coarse", "medium"):
        machs = {piece.mach for piece in sweep if piece.level == level}
        assert len(machs) >= 20
        assert set(flights(SUM, 1.0)) <= machs


def test_every_kept_result_says_how_it_was_made():
    assert len(KEPT) > 0
    for result in KEPT:
        known = result.provenance
        assert result.piece.name in known["command"]
        assert known["cells"] > 1000
        assert known["steady"]["residual"] < result.piece.settings.get("steady_tolerance", 1e-8)
        assert {"version", "mesh", "wall_s", "cpu_s"} <= known.keys()


def test_moving_the_moment_reference_and_back_changes_nothing():
    result = next(iter(finest(KEPT)))
    there = about(result, 6.1)
    back = transfer_longitudinal(there, -0.6)
    for name, value in back.items():
        assert value == pytest.approx(derivative(result, name, k=None), rel=1e-12)


def test_check_prints_every_asked_figure_and_its_exit_code_says_whether_all_hold():
    done = CliRunner().invoke(app, ["study", "finner", "--check"])
    claims = STUDY.claims(KEPT)
    assert summarise(claims) in done.stdout
    assert done.exit_code == (0 if all(claim.holds for claim in claims) else 1)


def test_figures_are_drawn_from_what_is_kept(tmp_path):
    paths = STUDY.draw(KEPT, tmp_path)
    assert len(paths) >= 17
    assert all(path.stat().st_size > 5000 for path in paths)
