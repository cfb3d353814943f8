"""The example's files are the exact plate, and one command makes of them what theory says."""

from __future__ import annotations

import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from indicial.conventions import Array, ReferenceQuantities, time_from_reduced
from indicial.history import History
from indicial.motion import AlphaStep, FlightCondition, PitchOscillation, PitchRateStep
from indicial.readers import read_table
from indicial.rom import StateSpaceModel
from readers.files import fluent
from theory.plate import SupersonicPlate, incidence_derivatives, steady_response

FOLDER = Path(__file__).resolve().parents[2] / "examples" / "fluent_plate"
REFERENCE = ReferenceQuantities(length=1.0, area=1.0)
CONDITION = FlightCondition(mach=2.0)


def at(s: Array) -> Array:
    return np.asarray(time_from_reduced(s, CONDITION.speed, 1.0))


def exact_histories() -> dict[str, History]:
    plate = SupersonicPlate(REFERENCE)
    steps = at(np.linspace(0.0, 6.0, 121))
    wave = PitchOscillation.from_reduced_frequency(CONDITION, REFERENCE, math.radians(1.0), 0.2)
    motions = {
        "alpha_step": (AlphaStep(CONDITION, math.radians(1.0)), steps),
        "q_step": (PitchRateStep(CONDITION, 0.01 * 2.0 * CONDITION.speed), steps),
        "oscillation": (wave, np.linspace(0.0, 2.0 * wave.period, 161)),
    }
    return {name: plate.unsteady(CONDITION, motion, times) for name, (motion, times) in motions.items()}


def columns(name: str, history: History) -> dict[str, Array]:
    """As Fluent would write them with its reference values in the map: along x aft, z up."""
    scale = CONDITION.dynamic_pressure / (0.5 * 1.225 * 680.0**2 * 2.0)
    steps = np.arange(float(history.time.size))
    found = {"Time Step": steps, "cz": scale * history["CN"], "flow-time": history.time, "cm": scale * history["Cm"]}
    if name != "oscillation":
        found["cz"][0] = found["cm"][0] = 0.0  # the row of the initial data, before the step
    return found


def write() -> None:
    """Make the files anew."""
    for name, history in exact_histories().items():
        fluent(FOLDER / f"{name}-rfile.out", columns(name, history), title=name)


@pytest.mark.parametrize("name", ["alpha_step", "q_step", "oscillation"])
def test_the_files_hold_the_exact_plate(name):
    table = read_table(FOLDER / f"{name}-rfile.out")
    for column, values in columns(name, exact_histories()[name]).items():
        np.testing.assert_allclose(table[column], values, rtol=1e-9, atol=1e-12)


def command(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    code = "from indicial.cli import main; main()"
    return subprocess.run(
        [sys.executable, "-c", code, "rom", *arguments], capture_output=True, text=True, cwd=cwd, check=False
    )


def test_one_command_from_report_files_to_derivatives_model_and_plots(tmp_path):
    files = [str(FOLDER / f"{name}-rfile.out") for name in ("alpha_step", "q_step", "oscillation")]
    done = command("build", *files, "--map", str(FOLDER / "map.toml"), "-o", "built", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "predicts pitch_oscillation" in done.stdout
    table = json.loads((tmp_path / "built" / "derivatives.json").read_text())["derivatives"]
    found = {one["name"]: one for one in table}
    cl_a, _, _, cm_q = steady_response(2.0)
    cl_ad, cm_ad = incidence_derivatives(2.0)
    for name, exact in {"CN_alpha": cl_a, "Cm_q": 2.0 * cm_q}.items():
        assert found[name]["value"] == pytest.approx(exact, rel=1e-3)
    for name, exact in {"CN_alphadot": 2.0 * cl_ad, "Cm_alphadot": 2.0 * cm_ad}.items():
        # the error bar that the tail and the samples give holds the truth
        assert abs(found[name]["value"] - exact) < 2.0 * found[name]["uncertainty"] < 0.02 * abs(exact)
    for figure in ("model", "record_length", "quasi_steady", "check_1_pitch_oscillation"):
        assert (tmp_path / "built" / f"{figure}.png").stat().st_size > 5000
    model = StateSpaceModel.from_json(tmp_path / "built" / "model.json")
    assert model.inputs == ("alpha", "q")
    history = "built/histories/3_pitch_oscillation.nc"
    checked = command("check", "built/model.json", history, "-o", "check.png", cwd=tmp_path)
    assert checked.returncode == 0, checked.stderr
    assert "Cm: off by" in checked.stdout
    assert (tmp_path / "check.png").is_file()


def test_files_without_a_map_are_asked_for_one_in_one_line(tmp_path):
    done = command("build", str(FOLDER / "alpha_step-rfile.out"), cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "needs --map" in done.stderr


if __name__ == "__main__":
    write()
