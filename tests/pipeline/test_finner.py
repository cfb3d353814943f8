"""The Basic Finner itself, on a mesh far too coarse to trust, through the real line: what must hold on any mesh."""

import json
import re

import pytest

from indicial.case import parse_case
from indicial.derivatives import DerivativeTable
from indicial.pipeline import ALL_STAGES, RunFolder, run_stages
from indicial.reference_data import find_case


@pytest.fixture(scope="module", params=["basic_finner_quick", "basic_finner_transonic"])
def results(request, tmp_path_factory) -> dict:
    text = find_case(request.param).read_text(encoding="utf-8")
    case = parse_case(re.sub(r"resolution = [\d.]+", "resolution = 0.5", text))
    folder = RunFolder(tmp_path_factory.mktemp("finner"))
    run_stages(case, folder, ALL_STAGES, workers=1)
    return json.loads((folder.path / "results.json").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def table(results) -> DerivativeTable:
    return DerivativeTable.from_records(results["derivatives"])


def test_steps_settle_at_the_moving_frame_values(results):
    """Both read H(0) of the same flow: they differ by iteration, amplitude and the end of the record alone."""
    ends = [e["difference"] for e in results["agreement"] if e["what"].startswith("end of the step")]
    assert len(ends) == 4
    assert max(map(abs, ends)) < 2e-3


@pytest.mark.parametrize("load", ["CN", "Cm"])
def test_the_three_reductions_of_the_oscillation_agree(table, load):
    name = f"{load}_q+{load}_alphadot"
    values = [table.value(name, method="fom", reduction=r) for r in ("phase_angle", "regression", "fourier")]
    assert max(values) == pytest.approx(min(values), rel=5e-3)


def test_the_model_made_of_steps_predicts_the_damping_of_the_oscillation(results):
    """FOM at k against the state-space model at the same k: two time marches of one linear flow."""
    errors = [
        abs(e["difference"]) for e in results["agreement"] if e["what"].startswith("sum at the same k: FOM, reduced")
    ]
    assert len(errors) == 2
    assert max(errors) < 0.01


def test_the_operator_agrees_with_every_march_at_its_own_frequency(results):
    """One linear flow, one mesh: they differ by amplitude, time step and tolerance alone."""
    pairs = {(e["what"], e["name"]): abs(e["difference"]) for e in results["agreement"] if "operator" in e["what"]}
    assert len(pairs) == 9
    assert max(pairs.values()) < 5e-3


def test_the_projected_model_repeats_the_oscillation_within_its_stated_error(results):
    facts = results["operator"]["projection"]
    assert facts["met"]
    worst = [check["worst"] for check in results["rom"]["checks"] if check["model"] == "projected"]
    assert max(worst) < facts["tolerance"]


def test_every_method_shows_that_the_answer_is_linear(results):
    assert {entry["method"] for entry in results["linearity"]} == {"mrf", "fom", "irm"}
    assert max(abs(entry["change"]) for entry in results["linearity"]) < 0.01


def test_the_missile_is_stable_damped_and_loses_roll(table):
    assert table.value("Cm_alpha", method="mrf") < 0.0 < table.value("CN_alpha", method="mrf")
    assert table.value("Cm_q+Cm_alphadot", method="irm") < 0.0
    assert table.value("Cl_p", method="mrf") < 0.0


def test_what_is_identified_from_the_flight_is_what_was_flown(table):
    """Four standard errors: the noise of one seed."""
    for name in ("CN_alpha", "Cm_alpha", "Cm_q+Cm_alphadot"):
        estimate = table.one(name, method="identified")
        flown = table.value(name, method="irm")
        assert estimate.value == pytest.approx(flown, abs=4.0 * estimate.uncertainty)
