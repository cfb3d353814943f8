"""A flight test file: what is wrong is said in a line; the packaged one gives back what was flown, in its files too."""

import importlib.util
import json
import math
import re
import shutil
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.stats import binom
from typer.testing import CliRunner

from indicial.case import read_flight_test
from indicial.cli import app
from indicial.errors import DivergenceError, InputError
from indicial.flightsim import Motor, Signal
from indicial.identification import Installation
from indicial.pipeline.flight_test import reduce_flight_test
from indicial.reference_data import find_flight_test


def made_by():
    """The example that made the packaged files."""
    path = Path(__file__).resolve().parents[2] / "examples" / "16_flight_test_file.py"
    spec = importlib.util.spec_from_file_location("flight_test_example", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


TRUTH = made_by().TRUTH
PACKAGED = find_flight_test("light_aircraft")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    into = tmp_path_factory.mktemp("flight_test")
    for path in PACKAGED.parent.iterdir():
        shutil.copy(path, into / path.name)
    return into


@pytest.fixture(scope="module")
def result():
    return reduce_flight_test(PACKAGED)


def changed(folder, right, wrong):
    text = (folder / "light_aircraft.toml").read_text(encoding="utf-8")
    assert right in text
    file = folder / "changed.toml"
    file.write_text(text.replace(right, wrong, 1), encoding="utf-8")
    return file


def test_every_coefficient_that_was_flown_is_found(result):
    derivatives = {one.name for one in result.fit.parameters if not one.name.startswith("bias_")}
    assert derivatives == set(TRUTH)
    for name, value in TRUTH.items():
        assert abs(result.fit[name].value - value) < 4.5 * result.fit[name].standard_error, name


def test_biases_are_taken_out_and_boom_and_accelerometers_moved(result):
    for one in result.records:
        assert abs(one.compatibility["bias_q"].value - 4e-3) < 4.0 * one.compatibility["bias_q"].standard_error
        assert any("alpha is biased" in finding for finding in one.compatibility.findings)


def test_a_wrong_handbook_value_is_called_shifted_and_right_ones_consistent(result):
    words = {v.estimate.name: v.verdict for v in result.verdicts}
    assert words.pop("Cm_q") == "shifted"
    assert set(words.values()) == {"consistent"}


def test_the_command_writes_numbers_text_figures_and_a_page(folder):
    done = CliRunner().invoke(app, ["identify", str(folder / "light_aircraft.toml"), "--output", str(folder / "out")])
    assert done.exit_code == 0, done.output
    told = json.loads((folder / "out" / "flight_test.json").read_text(encoding="utf-8"))
    assert told["schema_version"] == 1
    found = {one["name"]: one for one in told["parameters"]}
    assert found["Cm_q"]["verdict"] == "shifted"
    assert "Cm_q" in (folder / "out" / "summary.txt").read_text(encoding="utf-8")
    page = (folder / "out" / "report.html").read_text(encoding="utf-8")
    assert page.count("data:image/png") == 7
    assert "Shifted: Cm_q" in page
    assert len(list((folder / "out" / "figures").glob("*.png"))) == 7


def test_in_the_plane_of_symmetry_a_record_needs_no_lateral_channel(tmp_path, monkeypatch):
    """Then neither compatibility nor equation error of the moment can be had: Cm starts from what is expected."""
    maker = made_by()
    monkeypatch.setattr(maker, "BOOM", Installation())
    file = maker.write_files(tmp_path)
    text = re.sub(r"\[(lateral|instruments)\].*?\n\n", "", file.read_text(encoding="utf-8"), flags=re.DOTALL)
    text = re.sub(r"\[expected\].*", "", text, flags=re.DOTALL).replace(', "light_aircraft_roll.csv"', "")
    expected = {name: 0.8 * value for name, value in TRUTH.items() if name.startswith("Cm")}
    told = "\n".join(f"{name} = {value}" for name, value in expected.items())
    file.write_text(f'{text}[output_error]\nbiases = ["q", "alpha"]\n\n[expected]\n{told}\n', encoding="utf-8")
    columns = (tmp_path / "light_aircraft_map.toml").read_text(encoding="utf-8")
    for gone in ("beta", "p", "r", "ay", "phi", "psi", "dynamic_pressure"):
        columns = re.sub(rf"\[channels\.{gone}\]\n.*?\n\n", "", columns, flags=re.DOTALL)
    columns = re.sub(r"\[inputs\.(aileron|rudder)\]\n.*?(\n\n|\Z)", "", columns, flags=re.DOTALL)
    (tmp_path / "light_aircraft_map.toml").write_text(columns, encoding="utf-8")
    found = reduce_flight_test(file)
    (record,) = found.records
    assert record.compatibility is None
    assert any("compatibility of the instruments not checked" in note for note in record.notes)
    assert any("no equation error of Cm" in note for note in record.notes)
    assert any("dynamic pressure was not measured" in note for note in record.notes)
    for name, value in TRUTH.items():
        if name[:2] in ("CX", "CZ", "Cm"):
            assert abs(found.fit[name].value - value) < 4.5 * found.fit[name].standard_error, name
    assert {v.estimate.name for v in found.verdicts} == set(expected)


def with_columns(folder, name, edit):
    """The packaged test with the cells of a column, by its name's start, changed by `edit(value, row)`."""
    for table in ("light_aircraft_pitch", "light_aircraft_roll"):
        head, *rows = [line.split(",") for line in (PACKAGED.parent / f"{table}.csv").read_text().splitlines()]
        column = next(i for i, text in enumerate(head) if text.startswith(name))
        for k, row in enumerate(rows):
            row[column] = edit(row[column], k)
        (folder / f"{table}.csv").write_text("\n".join(",".join(row) for row in [head, *rows]))
    for file in ("light_aircraft.toml", "light_aircraft_map.toml"):
        shutil.copy(PACKAGED.parent / file, folder / file)
    return folder / "light_aircraft.toml"


def holds(found, most=4.5):
    for name, value in TRUTH.items():
        assert abs(found.fit[name].value - value) < most * found.fit[name].standard_error, name


def test_a_dead_channel_is_told_and_left_out(tmp_path):
    found = reduce_flight_test(with_columns(tmp_path, "THETA", lambda cell, row: "3.0"))
    assert "theta does not change" in found.summary()
    assert all("theta" not in m.model.channels for m in found.fit.manoeuvres)
    holds(found)


def test_spikes_and_gaps_are_told_and_harmless(tmp_path):
    """Every 37th reading of the vane is 8 degrees off, every 11th is missing."""

    def edit(cell, row):
        return "" if row % 11 == 5 else f"{float(cell) + 8.0}" if row % 37 == 20 else cell

    found = reduce_flight_test(with_columns(tmp_path, "AOA", edit))
    assert "channel alpha has" in found.summary()
    holds(found)


def test_altitude_that_was_not_measured_is_that_of_the_density(tmp_path):
    file = with_columns(tmp_path, "ALT", lambda cell, row: "")
    columns = (tmp_path / "light_aircraft_map.toml").read_text(encoding="utf-8")
    columns = re.sub(r"\[channels\.altitude\]\n.*?\n\n", "", columns, flags=re.DOTALL)
    (tmp_path / "light_aircraft_map.toml").write_text(columns, encoding="utf-8")
    found = reduce_flight_test(file)
    for one in found.records:
        (note,) = (note for note in one.notes if note.startswith("altitude was not measured"))
        assert float(re.search(r"([\d.]+) m", note)[1]) == pytest.approx(1200.0, abs=30.0)
    holds(found)


def test_a_fit_that_fails_tells_what_was_found_of_the_records(tmp_path):
    with pytest.raises(DivergenceError, match=r"of the records, light_aircraft_pitch: theta changes 57.* in degrees\?"):
        reduce_flight_test(with_columns(tmp_path, "Q [", lambda cell, row: f"{float(cell) * math.pi / 180.0}"))


def test_thrust_of_a_record_is_a_force_and_no_control(tmp_path, monkeypatch):
    """An engine that is opened in the middle of the manoeuvre: CX stays what it was."""
    maker = made_by()
    plain, fly, measure = maker.term_model, maker.fly, maker.measure_flight
    push = Signal(np.array([0.0, 4.0, 5.0, 12.0]), np.array([500.0, 500.0, 2500.0, 2500.0]))
    motor = Motor(ca.SX.sym("thrust"), maker.VEHICLE.centre_of_gravity)
    monkeypatch.setattr(maker, "term_model", lambda *given: plain(*given, [motor]))
    monkeypatch.setattr(
        maker, "fly", lambda *given, parameters, **how: fly(*given, parameters={**parameters, "thrust": push}, **how)
    )
    monkeypatch.setattr(
        maker,
        "measure_flight",
        lambda flight, *given, **how: measure(flight, *given, thrust=push.at(flight.time), **how),
    )
    file = maker.write_files(tmp_path)
    for table in ("light_aircraft_pitch.csv", "light_aircraft_roll.csv"):
        head, *rows = (tmp_path / table).read_text().splitlines()
        rows = [f"{row},{push.at(float(row.split(',')[0]) / 1000.0) / 1000.0:.6f}" for row in rows]
        (tmp_path / table).write_text("\n".join([f"{head},T [kN]", *rows]))
    with (tmp_path / "light_aircraft_map.toml").open("a") as stream:
        stream.write('\n[inputs.thrust]\ncolumn = "T [kN]"\nunit = "kN"\n')
    found = reduce_flight_test(file)
    holds(found)
    for one in found.records:
        estimate = one.equation_errors["CX"]["CX_0"]
        assert abs(estimate.value - TRUTH["CX_0"]) < 5.0 * estimate.standard_error


@pytest.mark.slow
def test_over_60_flight_tests_intervals_cover(tmp_path):
    """Biases found, boom, accelerometers off the centre of gravity: errors of all that are in the standard errors."""
    maker, errors = made_by(), []
    write = maker.fly_and_write
    for number in range(60):
        maker.fly_and_write = lambda folder, name, moves, seed, n=number: write(
            folder, name, moves, 1000 + 10 * n + seed
        )
        fit = reduce_flight_test(maker.write_files(tmp_path)).fit
        errors.append([(fit[name].value - value) / fit[name].standard_error for name, value in TRUTH.items()])
    held = np.mean(np.abs(errors) < 1.96, axis=0)
    assert 0.93 < held.mean() < 0.985
    assert np.all(binom.cdf(held * 60, 60, 0.95) > 1e-3), dict(zip(TRUTH, held, strict=True))


@pytest.mark.parametrize(
    ("right", "wrong", "message"),
    [
        ("schema_version = 1", "schema_version = 2", r"schema_version: is 2; allowed: 1"),
        ('Cm = ["alpha", "q", "elevator"]', 'Cm = ["alpha", "q", "elevatr"]', r"'elevatr' in term .* no factor"),
        ("Cm_q = -17.0", "Cm_r = -17.0", r"expected\.Cm_r: no such term; allowed: CX_0, "),
        ("Cm_q = 1.0", "CZ_q = 1.0", r"expected_errors\.CZ_q: is of a value not expected"),
        ("vanes_m = [1.8, 0.0, 0.0]", "vanes_m = [1.8, 0.0]", r"instruments\.vanes_m: is \[1\.8, 0\.0\]"),
        ("light_aircraft_roll.csv", "light_aircraft_rol.csv", r"light_aircraft_rol\.csv"),
        ("[instruments]", "[instrument]", r"instrument: unknown key; did you mean 'instruments'"),
        ("records = ", 'prior = ["Cl_r"]\nrecords = ', r"prior: Cl_r has no expected value with an error; allowed"),
        ("[lateral]", '[output_error]\nchannels = ["gamma"]\n[lateral]', r"lacks gamma; it has V, "),
        ("[lateral]", '[output_error]\nbiases = ["gamma"]\n[lateral]', r"gamma"),
    ],
)
def test_what_is_wrong_is_said(folder, right, wrong, message):
    with pytest.raises(InputError, match=message) as caught:
        reduce_flight_test(changed(folder, right, wrong))
    assert "\n" not in str(caught.value)


def test_fixed_and_prior_values_are_taken_as_said(folder):
    file = changed(folder, "[expected] ", "[fixed]\nCl_r = 0.11\n\n[expected] ")
    text = file.read_text(encoding="utf-8").replace("schema_version = 1\n", 'schema_version = 1\nprior = ["Cn_r"]\n')
    file.write_text(text.replace('"light_aircraft_pitch.csv", ', ""), encoding="utf-8")
    assert read_flight_test(file).fixed == {"Cl_r": 0.11}
    text = file.read_text(encoding="utf-8").replace('"elevator"]', "]").replace('"q", ]', '"q"]')
    file.write_text(text, encoding="utf-8")
    found = reduce_flight_test(file)
    names = [one.name for one in found.fit.parameters]
    assert "Cl_r" not in names
    assert "Cn_r" in names
    assert "Cn_r" not in {v.estimate.name for v in found.verdicts}
    assert "fixed" in found.to_dict()
