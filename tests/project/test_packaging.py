"""The project as a user gets it: a wheel that holds its data, documentation that is true to the code."""

import re
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

import indicial
from indicial.case import AircraftFile, FlightTest, case_reference
from indicial.cli.commands import app
from indicial.pipeline import ALL_STAGES
from indicial.pipeline.stages import DERIVING

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))


def test_import_of_the_package_loads_nothing_heavy():
    code = "import sys, indicial; print([m for m in ('numpy', 'numba', 'casadi', 'xarray') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_command_line_loads_nothing_heavy():
    code = "import sys, indicial.cli; print([m for m in ('numba', 'casadi', 'xarray', 'scipy') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_readme_gives_the_two_commands():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "\npip install . && indicial run data/cases/basic_finner_quick.toml\n" in readme
    assert "\npip install '.[test]' && pytest\n" in readme


def test_changelog_has_the_present_version():
    assert f"## {indicial.__version__}" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_case_file_page_is_the_one_that_the_models_make():
    assert case_reference() in (ROOT / "docs" / "case_file.md").read_text(encoding="utf-8")


def test_aircraft_file_page_is_the_one_that_the_models_make():
    assert case_reference(AircraftFile) in (ROOT / "docs" / "aircraft_file.md").read_text(encoding="utf-8")


def test_flight_test_page_is_the_one_that_the_models_make():
    assert case_reference(FlightTest) in (ROOT / "docs" / "flight_test.md").read_text(encoding="utf-8")


def test_every_stage_and_command_is_in_the_guide():
    guide = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    commands = {info.name or info.callback.__name__ for info in app.registered_commands}
    commands |= {group.name for group in app.registered_groups}
    named = set(re.findall(r"^\| `(\w+)", guide, flags=re.MULTILINE))
    assert commands - {"run"} <= named
    assert {s for s in ALL_STAGES if s not in DERIVING} <= commands


def test_links_between_pages_lead_somewhere():
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    for page in pages:
        for target in re.findall(r"\]\(([^)#:]+?)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_every_package_of_the_house_is_in_the_import_contract():
    layers = PROJECT["tool"]["importlinter"]["contracts"][0]["layers"]
    named = {name.strip() for layer in layers for name in re.split(r"[:|]", layer)}
    found = {path.stem for path in (ROOT / "src" / "indicial").iterdir() if path.suffix == ".py" or path.is_dir()}
    assert found - {"__init__", "__pycache__", "_data", "py"} <= named


@pytest.mark.slow
def test_wheel_holds_cases_tables_and_the_report_template(tmp_path):
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "-w", str(tmp_path), str(ROOT)]
    subprocess.run(command, check=True)
    names = zipfile.ZipFile(next(tmp_path.glob("*.whl"))).namelist()
    for wanted in (
        "indicial/_data/cases/basic_finner_quick.toml",
        "indicial/_data/reference/basic_finner_range_multifit.csv",
        "indicial/report/report.html.jinja",
        "indicial/rom/export/fmi2.c",
        "indicial/py.typed",
    ):
        assert wanted in names
