"""The whole line on a linear system with known answers: what comes out is what went in."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from indicial.case import Case, parse_case
from indicial.derivatives import DerivativeTable
from indicial.errors import DivergenceError, InputError
from indicial.frequency import FrequencyResponse
from indicial.pipeline import ALL_STAGES, RunFolder, run_stages
from indicial.pipeline.damping import damping_of_run
from indicial.reference_data import find_case
from indicial.rom import StateSpaceModel
from pipeline.oracle import Oracle, missile


def quick_text() -> str:
    return find_case("basic_finner_quick").read_text(encoding="utf-8").replace("resolution = 1.0", "resolution = 0.5")


def quick_case() -> Case:
    return parse_case(quick_text())


def make_oracle(case: Case, folder: RunFolder) -> Oracle:
    return Oracle(case.reference_quantities, folder.path / "log")


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> RunFolder:
    folder = RunFolder(tmp_path_factory.mktemp("run"))
    run_stages(quick_case(), folder, make_factory=make_oracle)
    return folder


@pytest.fixture(scope="module")
def results(run):
    return json.loads((run.path / "results.json").read_text())


def test_every_method_returns_the_derivatives_of_the_system(results):
    system = missile(quick_case().reference_quantities)
    settled, slope = system.step(1e4), system.slope()
    table = DerivativeTable.from_records(results["derivatives"])
    exact = {
        "CN_alpha": settled[2, 0],
        "Cm_alpha": settled[4, 0],
        "CN_q": settled[2, 3],
        "Cm_q": settled[4, 3],
        "CN_alphadot": slope[2, 0],
        "Cm_alphadot": slope[4, 0],
        "Cl_p": settled[3, 2],
        "CA_0": system.offset[0],
    }
    mrf, irm, rom = (table.select(method=m) for m in ("mrf", "irm", "rom"))
    for name in ("CN_alpha", "Cm_alpha", "CN_q", "Cm_q", "Cl_p", "CA_0"):
        assert mrf.value(name) == pytest.approx(exact[name], rel=1e-9), name
    for name in ("CN_alpha", "Cm_alpha", "CN_q", "Cm_q"):
        assert irm.value(name) == pytest.approx(exact[name], rel=1e-9), name
    for name in ("CN_alphadot", "Cm_alphadot"):
        assert irm.value(name) == pytest.approx(exact[name], rel=3e-3), name
        assert rom.value(name) == pytest.approx(exact[name], rel=3e-3), name


def test_forced_oscillation_returns_the_transfer_function_at_k(results):
    case = quick_case()
    k = case.forced_oscillation.k
    h = missile(case.reference_quantities).transfer(k)
    fom = DerivativeTable.from_records(results["derivatives"]).select(method="fom", reduction="fourier")
    for row, load in ((2, "CN"), (4, "Cm")):
        exact = np.imag(h[row, 0] + 1j * k * h[row, 3]) / k
        assert fom.value(f"{load}_q+{load}_alphadot") == pytest.approx(exact, rel=1e-4)
        assert fom.value(f"{load}_alphadot") == pytest.approx(np.imag(h[row, 0]) / k, rel=1e-3)


def test_the_operator_gives_the_derivatives_at_zero_and_at_every_k(results):
    system, columns = missile(quick_case().reference_quantities), {"alpha": 0, "q": 3, "p": 2}
    table = DerivativeTable.from_records(results["derivatives"]).select(method="operator")
    ks = sorted({*quick_case().operator.k, quick_case().forced_oscillation.k})
    assert {record.k for record in table} == {None, *ks}
    for k in (None, *ks):
        at_k = table.select(k=k)
        h = system.transfer(k or 0.0)
        for load, motion in (("CN", "alpha"), ("Cm", "alpha"), ("CN", "q"), ("Cm", "q"), ("Cl", "p")):
            row = ("CA", "CY", "CN", "Cl", "Cm", "Cn").index(load)
            assert at_k.value(f"{load}_{motion}") == pytest.approx(h[row, columns[motion]].real, rel=1e-12)
        lag = system.slope()[4, 0] if k is None else h[4, 0].imag / k
        assert at_k.value("Cm_alphadot") == pytest.approx(lag, rel=1e-12)


def test_the_other_methods_agree_with_the_operator(results):
    pairs = [entry for entry in results["agreement"] if "operator" in entry["what"]]
    assert len(pairs) == 9
    for entry in pairs:
        assert abs(entry["difference"]) < 1e-3, entry


def test_the_projected_model_is_kept_and_repeats_steps_and_oscillations_it_was_not_made_of(run, results):
    projected, fitted = (
        StateSpaceModel.from_json(run.path / "rom" / f"{name}.json") for name in ("projected", "model")
    )
    facts = results["operator"]["projection"]
    assert facts["met"]
    assert facts["order"] == projected.order <= fitted.order
    steps = {entry["model"]: entry for entry in results["rom"]["steps"]}
    as_many = steps.get("state space, as many states", steps["state space"])
    assert as_many["order"] - projected.order in (0, 1)
    # as good as its error over the band, relative to the peak: the unsteady part is half of these loads
    assert max(channel["rms"] for channel in steps["projected"]["channels"]) < 3.0 * facts["tolerance"]
    worst = [check["worst"] for check in results["rom"]["checks"] if check["model"] == "projected"]
    assert len(worst) == 2
    assert max(worst) < 0.01


def test_the_frequency_response_is_kept_with_the_run(run):
    response = FrequencyResponse.from_netcdf(run.path / "histories" / "frequency_response.nc")
    assert response.inputs == ("alpha", "q", "p")
    assert quick_case().forced_oscillation.k in response.k


def test_without_a_band_no_model_is_projected(tmp_path):
    case = quick_case()
    case = case.model_copy(update={"operator": case.operator.model_copy(update={"k_max": 0.0})})
    folder = RunFolder(tmp_path)
    run_stages(case, folder, ("mesh", "fom", "irm", "operator", "rom"), make_factory=make_oracle)
    assert folder.read("operator")["projection"] is None
    assert [entry["model"] for entry in folder.read("rom")["steps"]] == ["state space"]
    assert not (tmp_path / "rom" / "projected.json").exists()
    assert "projection" not in (tmp_path / "log").read_text()


def test_model_predicts_the_oscillations_it_has_not_seen(results):
    for check in results["rom"]["checks"]:
        if check["model"] != "deficiency, Eq. 16":
            assert check["worst"] < 0.01, check["model"]


def test_damping_is_the_same_three_ways(results):
    for record in results["damping"].values():
        assert record["stable"]
        for arm in record["arms"]:
            assert arm["fitted_1_s"] == pytest.approx(arm["linearised_1_s"], rel=0.02)


def test_identified_derivatives_are_those_flown_within_their_standard_errors(results):
    found = {entry["name"]: entry for entry in results["identification"]["against_flown"]}
    assert set(found) == {"CA_0", "CN_alpha", "Cm_alpha", "Cm_q+Cm_alphadot", "Cl_p"}
    for entry in found.values():
        assert abs(entry["standard_errors_off"]) < 3.5, entry
        assert entry["standard_error"] < 0.15 * abs(entry["flown"]), entry


def test_records_hold_every_field_of_the_schema(results):
    fields = {
        "name", "method", "mach", "alpha_deg", "beta_deg", "k", "amplitude_deg", "reduction", "value", "uncertainty",
        "axes", "source", "reference_length_m", "reference_area_m2", "moment_reference_m", "rate_normalisation",
    }  # fmt: skip
    assert results["schema_version"] == 1
    for record in results["derivatives"]:
        assert set(record) == fields
        assert record["rate_normalisation"] == "c/2V"
        assert record["moment_reference_m"] == pytest.approx([5.5 * 0.03, 0.0, 0.0])
    methods = {record["method"] for record in results["derivatives"]}
    assert {"mrf", "fom", "irm", "operator", "rom", "identified", "measured"} <= methods


def test_report_is_one_file_that_needs_nothing_else(run, results):
    page = (run.path / "report.html").read_text(encoding="utf-8")
    assert results["statement"].split(":")[0] in page
    assert page.count("data:image/png;base64,") == len(list(run.figures.glob("*.png"))) >= 8
    for outside in ("http://", "https://", "<script", "<link", 'src="/', "url("):
        assert outside not in page


def test_a_second_run_computes_nothing_again(run):
    before = (run.path / "log").read_text()
    written = {path: path.stat().st_mtime_ns for path in run.path.glob("*.json")}
    run_stages(quick_case(), run, make_factory=make_oracle)
    assert (run.path / "log").read_text() == before
    assert {path: path.stat().st_mtime_ns for path in run.path.glob("*.json")} == written


def test_a_lost_stage_is_made_again_from_kept_experiments(run):
    before = (run.path / "log").read_text()
    derivatives = run.read("fom")["derivatives"]
    run.forget("fom")
    run_stages(quick_case(), run, ("mesh", "fom"), make_factory=make_oracle)
    assert (run.path / "log").read_text() == before
    assert run.read("fom")["derivatives"] == derivatives


def test_a_stage_says_what_it_misses(tmp_path):
    with pytest.raises(InputError, match=r"fom\.json: not there yet; run `indicial derive --method fom` first"):
        run_stages(quick_case(), RunFolder(tmp_path), ("rom",), make_factory=make_oracle)


def test_results_of_another_case_are_not_taken(run):
    other = quick_case().model_copy(update={"condition": quick_case().condition.model_copy(update={"mach": 2.5})})
    with pytest.raises(InputError, match="belong to another case"):
        run_stages(other, run, ("rom",), make_factory=make_oracle)


def test_a_diverging_solver_leaves_what_was_done_and_a_resumable_folder(tmp_path):
    def failing(case: Case, folder: RunFolder) -> Oracle:
        return Oracle(case.reference_quantities, folder.path / "log", fails_on="plunge_oscillation")

    folder = RunFolder(tmp_path)
    with pytest.raises(DivergenceError, match=r"plunge oscillation .*: residual .*; try a smaller time step"):
        run_stages(quick_case(), folder, ("mesh", "fom"), make_factory=failing)
    kept = sorted(Path(path).name for path in folder.experiments.iterdir())
    assert any(name.startswith("steady") for name in kept)
    assert not (folder.path / "fom.json").exists()
    run_stages(quick_case(), folder, ("mesh", "fom"), make_factory=make_oracle)
    assert folder.read("fom")["derivatives"]
    assert (folder.path / "log").read_text().count("steady") == 1


def test_all_stages_have_been_run(run):
    assert [name for name in ALL_STAGES if not (run.path / f"{name}.json").is_file()] == []
    assert math.isfinite(run.read("irm")["seconds"])


def test_damping_of_a_run_is_that_of_its_flight_and_its_model(run, results):
    (run.path / "case.toml").write_text(quick_text(), encoding="utf-8")
    found = damping_of_run(run.path)
    assert found.check is not None
    flown = json.loads((run.path / "fly.json").read_text())["damping"]["derivatives"]["arms"][0]
    assert found.check.arms[0].linearised.real == pytest.approx(flown["linearised_1_s"], rel=1e-12)
    assert found.change is not None
    assert found.over_k is not None
    rolling = damping_of_run(run.path, roll_rate=30.0)
    assert rolling.stability.roll_rate == 30.0
    record = json.loads(json.dumps(rolling.to_dict()))
    assert record["kind"] == "missile damping"
    assert record["arms"][0]["parts_1_s"]["Cm_q"] < 0.0
    assert set(rolling.plot()) == {"flight", "modes", "damping_parts", "over_k"}
    held = damping_of_run(run.path / "results.json", mach=2.2)
    assert any("held at Mach 2.2" in note for note in held.notes)
    thin = damping_of_run(run.path, altitude=10000.0)
    assert thin.check is not None
    assert abs(thin.check.arms[0].linearised.real) < abs(found.check.arms[0].linearised.real)
