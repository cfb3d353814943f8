"""The pages: what they link to is there, the commands they show exist, and their Python runs."""

import re
import shlex
import textwrap
from pathlib import Path

import casadi as ca
import matplotlib.pyplot as plt
import numpy as np
import pytest
import typer

from indicial.cli import app
from indicial.conventions import ReferenceQuantities
from indicial.flightsim import (
    BodyAxisAerodynamics,
    DeficiencyAerodynamics,
    DeficiencyTerm,
    DerivativeAerodynamics,
    InitialState,
    Signal,
    SteadyWind,
    Vehicle,
    basic_finner_range_model,
    build_dynamics,
    fly,
    missile_mode_sweep,
)
from indicial.identification import Manoeuvre, Parameter, Sensor, measure_flight
from indicial.motion import FlightCondition
from indicial.rom import StateSpaceModel

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
TRUTH = {"CZ_alpha": -5.0, "Cm_alpha": -0.8, "Cm_q": -14.0}
NOISE = {"alpha": 0.002, "q": 0.003, "theta": 0.002, "az": 0.1}


def fenced(page: Path, language: str) -> list[str]:
    return [textwrap.dedent(text) for text in re.findall(rf"```{language}\n(.*?)```", page.read_text(), re.DOTALL)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_and_paths_are_there(page):
    text = page.read_text(encoding="utf-8")
    for link in re.findall(r"\]\(([^)#\s]+)", text):
        assert "://" in link or (page.parent / link).exists(), link
    for path in re.findall(r"`((?:benchmarks|data|docs|examples|src|tests)/[^`*\s]+)`", text):
        assert (ROOT / path).exists(), path
    named = {path.name for path in (ROOT / "tests").rglob("test_*.py")}
    assert set(re.findall(r"`(?:\S*/)?(test_\w+\.py)`", text)) <= named


def test_every_page_is_in_the_contents():
    contents = re.search(r"```{toctree}\n(.*?)```", (ROOT / "docs" / "index.md").read_text(), re.DOTALL)
    assert contents is not None
    listed = {line for line in contents[1].splitlines() if line and not line.startswith(":")}
    pages = {str(page.relative_to(ROOT / "docs").with_suffix("")) for page in PAGES[1:]}
    assert listed == pages - {"index"}


def options_of(words: list[str]) -> set[str] | None:
    """Options of the command that these words begin with; None if they name none."""
    command = typer.main.get_command(app)
    for word in words:
        if not hasattr(command, "commands"):
            break
        command = command.commands.get(word) or command.commands.get("stage")
        if command is None:
            return None
    return {option for parameter in command.params for option in parameter.opts}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_that_are_shown_exist(page):
    text = page.read_text(encoding="utf-8")
    shown = re.findall(r"`indicial ([^`\n]+)`", text)
    shown += [line for block in fenced(page, "") for line in re.findall(r"^(?:.*&& )?indicial (.+)", block, re.M)]
    for line in shown:
        words = shlex.split(line)
        if words[0].startswith("-"):
            continue
        options = options_of(words)
        assert options is not None, line
        assert {word for word in words if re.match(r"--?[a-z]", word)} <= options, line


def test_what_no_command_is_would_be_seen():
    assert options_of(["bogus"]) is None
    assert "--staton" not in (options_of(["flights", "a", "b"]) or ())


REFERENCE = ReferenceQuantities(1.5, 16.0, lateral_length=11.0)
VEHICLE = Vehicle("light aircraft", 1000.0, np.diag([1200.0, 1800.0, 2700.0]), REFERENCE, (0.0, 0.0, 0.0))
ALL = NOISE | {"ax": 0.02, "ay": 0.02, "p": 1e-3, "r": 1e-3, "V": 0.1, "beta": 1e-3, "dynamic_pressure": 5.0}
TIME = np.linspace(0.0, 10.0, 251)
ELEVATOR = Signal.multistep(0.03, 0.7, 0.5)


def light_aircraft(**free):
    return BodyAxisAerodynamics(
        reference=REFERENCE, CD_0=0.05, CZ_0=-0.03, **free, Cm_0=0.04 - 1.2 * ca.SX.sym("elevator")
    )


def flown(noise=NOISE):
    """Names that pages take for granted: a light aircraft, its flight with a 3-2-1-1, and what was measured of it."""
    free = {name: ca.SX.sym(name) for name in TRUTH}
    dynamics, initial = build_dynamics(VEHICLE, light_aircraft(**free)), InitialState.from_path(60.0, alpha=0.05)
    flight = fly(dynamics, initial, 10.0, method="dop853", step=0.04, parameters={**TRUTH, "elevator": ELEVATOR})
    sensors = {name: Sensor(25.0, white=deviation) for name, deviation in noise.items()}
    record = measure_flight(flight, VEHICLE, sensors, seed=1, inputs={"elevator": ELEVATOR})
    return {"np": np, "reference": REFERENCE, "vehicle": VEHICLE, "dynamics": dynamics, "initial": initial} | {
        "trajectory": flight,
        "record": record,
    }


def flight_records():
    """A table of instruments with its map, in the working folder, besides."""
    given = flown(ALL)
    record = given["record"]
    columns = {"time": TIME, **record.channels, "elevator": record.inputs["elevator"]}
    np.savetxt(
        "flight.csv", np.stack(list(columns.values()), axis=1), delimiter=",", header=",".join(columns), comments=""
    )
    named = "".join(f'{name} = "{name}"\n' for name in ALL)
    Path("map.toml").write_text(
        f'[time]\ncolumn = "time"\nunit = "s"\n[channels]\n{named}[inputs.elevator]\ncolumn = "elevator"\n'
    )
    return given


def damping():
    """The Basic Finner with a table of made-up derivatives."""
    body = basic_finner_range_model()
    loads = DerivativeAerodynamics(
        reference=body.reference, CA_0=0.5, CN_alpha=11.0, Cm_alpha=-25.0, Cm_q=-355.0, Cl_p=-21.0
    )
    return {"np": np, "body": body, "model": loads, "missile_mode_sweep": missile_mode_sweep}


def lattice():
    return {"condition": FlightCondition(mach=0.1, alpha=0.05)}


def export():
    """A model in the working folder."""
    one = np.ones((1, 1))
    StateSpaceModel(-one, one, one, one, ("alpha",), ("CN",), np.zeros(6), FlightCondition(2.0), REFERENCE).to_json(
        "model.json"
    )
    return {}


def lag_states():
    """Manoeuvres of the model without lag, on a dynamics that has it."""
    free = {name: ca.SX.sym(name) for name in TRUTH}
    term = DeficiencyTerm(rate=ca.SX.sym("b"), CN=ca.SX.sym("a_N"), Cm=ca.SX.sym("a_m"))
    dynamics = build_dynamics(VEHICLE, DeficiencyAerodynamics(base=light_aircraft(**free), terms=(term,)))
    given = flown()
    start = InitialState.from_path(60.0, alpha=0.05, lag=np.array([np.sin(0.05)]))
    record = given["record"]
    seen = Manoeuvre.of_flight(
        record, dynamics, start, channels=tuple(NOISE), free_start=("alpha", "theta", "q"), steps_per_interval=2
    )
    parameters = [Parameter(name, value) for name, value in TRUTH.items()]
    return given | {"manoeuvres": [seen], "parameters": parameters}


def filters():
    """Only Cm_q unknown; turbulence of a scale."""
    aerodynamics = light_aircraft(CZ_alpha=-5.0, Cm_alpha=-0.8, Cm_q=ca.SX.sym("Cm_q"))
    dynamics = build_dynamics(VEHICLE, aerodynamics)
    gusty = {"scale": 200.0, "speed": 60.0, "sigma_w": 1.0, "channels": ("alpha", "q"), "SteadyWind": SteadyWind}
    named = {"ca": ca, "build_dynamics": build_dynamics, "aerodynamics": aerodynamics, "dynamics": dynamics}
    return flown() | gusty | named | {"parameters": [-14.0, 0.0]}


CONTEXTS = {
    "damping": damping,
    "export": export,
    "filters": filters,
    "flight": dict,
    "flight_records": flight_records,
    "lag_states": lag_states,
    "lattice": lattice,
    "README": dict,
}
SKETCHES = {"architecture": 1, "results_schema": 1, "export": 1}
"""Blocks that are no program by themselves: the last ones of a page."""


def test_every_page_with_python_is_run():
    assert {page.stem for page in PAGES if fenced(page, "python")} == CONTEXTS.keys() | SKETCHES.keys()


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name == "README" else ()) for name in CONTEXTS]
)
def test_python_of_the_pages_runs(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    page = next(page for page in PAGES if page.stem == name)
    names = CONTEXTS[name]()
    blocks = fenced(page, "python")
    for block in blocks[: len(blocks) - SKETCHES.get(name, 0)]:
        exec(block, names)
        plt.close("all")
