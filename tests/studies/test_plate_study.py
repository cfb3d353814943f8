"""The study of realisations: its kept numbers are those of the code, and its check reads them."""

import numpy as np
import pytest
from typer.testing import CliRunner

from indicial.cli import app
from indicial.pipeline.progress import LogReporter
from indicial.rom import check_prediction
from indicial.studies import find_study
from indicial.studies.claim import summarise
from indicial.studies.computing import recompute
from indicial.studies.kept import Results
from indicial.studies.plate.agreement import FINNER_ERROR, exact_derivatives, methods
from indicial.studies.plate.computing import finner_files, finner_model, finner_unseen, plate_data, plate_solver
from indicial.studies.plate.exact import frequency_response
from indicial.studies.plate.pieces import PLATE

STUDY = find_study("plate")
KEPT = Results.kept("plate", STUDY.pieces)
FINNER = KEPT.select(mesh="finner")


def test_kept_numbers_are_those_of_the_code():
    for one in recompute(STUDY, "coarse", 1, LogReporter()):
        assert one.agrees, one.summary()


def test_every_realisation_is_kept_at_every_mach_number():
    assert len(KEPT) == len(STUDY.pieces)
    assert len(methods(KEPT.select(mesh="plate"))) == 8
    for result in KEPT:
        assert result.provenance["refused"] == {}
        for row in result.provenance["realisations"].values():
            assert max(real for real, _ in row["poles"]) < 0.0
            assert len(row["poles"]) == row["order"]


def test_closed_forms_of_the_derivatives_are_the_limits_of_the_exact_frequency_response():
    axis, k = plate_solver(PLATE).axis, 1e-4
    cl_a, cm_a, cl_q, cm_q = frequency_response(2.0, k, axis)
    exact = exact_derivatives(2.0)
    assert exact["Cm_q"] == pytest.approx(2.0 * cm_q.real, rel=1e-6)
    assert exact["CN_q"] == pytest.approx(2.0 * cl_q.real, rel=1e-6)
    assert exact["Cm_alphadot"] == pytest.approx(cm_a.imag / k, rel=1e-5)
    assert exact["CN_alphadot"] == pytest.approx(cl_a.imag / k, rel=1e-5)


def test_motions_not_seen_begin_in_the_steady_state_that_models_assume():
    data, unseen = plate_data(2.0, PLATE)
    assert list(unseen) == ["k = 0.05", "k = 0.2", "k = 0.5", "k = 2", "multisine", "pulse"]
    for name in ("multisine", "pulse"):
        np.testing.assert_allclose(unseen[name].before, data.baseline, atol=1e-12)


def test_finner_model_made_again_from_the_kept_flow_predicts_the_kept_marches():
    result = FINNER.results[0]
    histories, response = finner_files(result)
    model = finner_model(response, result.piece.settings)
    assert model.order <= 6
    for history in finner_unseen(histories).values():
        assert check_prediction(model, history).worst_peak < FINNER_ERROR


def test_check_prints_every_asked_figure_and_its_exit_code_says_whether_all_hold():
    done = CliRunner().invoke(app, ["study", "plate", "--check"])
    claims = STUDY.claims(KEPT)
    assert summarise(claims) in done.stdout
    assert done.exit_code == (0 if all(claim.holds for claim in claims) else 1)


def test_nothing_computed_is_said_so():
    assert all(not claim.holds for claim in STUDY.claims(Results(())))


def test_figures_are_drawn_from_what_is_kept(tmp_path):
    paths = STUDY.draw(KEPT, tmp_path)
    assert [path.name for path in paths] == ["errors.png", "poles.png", "finner.png"]
    assert all(path.stat().st_size > 5000 for path in paths)
