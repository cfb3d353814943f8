"""The command line: one clear line for whatever is wrong, and the exit code that says whose fault it is."""

import subprocess
import sys

import pytest
from typer.testing import CliRunner

import indicial
from indicial.cli.commands import app
from indicial.reference_data import find_case

COMMANDS = ("run", "mesh", "derive", "rom", "fly", "identify", "compare", "report", "study", "damping", "flights")


def indicial_command(*arguments: str, cwd=None) -> subprocess.CompletedProcess:
    code = "from indicial.cli import main; main()"
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, cwd=cwd, check=False
    )


def test_version_is_the_package_version():
    assert CliRunner().invoke(app, ["--version"]).stdout.strip() == f"indicial {indicial.__version__}"


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_every_command_has_an_example(command):
    result = CliRunner().invoke(app, [command, "--help"], env={"COLUMNS": "200"})
    assert result.exit_code == 0
    assert f"indicial {command}" in result.stdout


def test_wrong_input_gives_one_line_and_exit_code_2(tmp_path):
    quick = find_case("basic_finner_quick").read_text(encoding="utf-8")
    (tmp_path / "typo.toml").write_text(quick.replace("mach =", "mahc ="))
    (tmp_path / "empty.toml").write_text("")
    (tmp_path / "folder").mkdir()
    wrong = {
        ("run", "nothing.toml"): "no such case file",
        ("run", "typo.toml"): "condition.mahc: unknown key; did you mean 'mach'?",
        ("run", "empty.toml"): "missing",
        ("mesh", "folder"): "not a run folder",
        ("fly", "basic_finner_quick"): "not there yet",
        ("run", "basic_finner_quick", "--output", "typo.toml"): "is a file; --output must name a folder",
        ("run",): "Missing argument 'CASE'",
        ("run", ""): "no case is named",
        ("run", "basic_finner_quick", "--worker", "2"): "No such option: --worker",
        (
            "derive",
            "basic_finner_quick",
            "--method",
            "magic",
        ): "'magic' is not one of 'mrf', 'fom', 'irm', 'operator', 'all'",
        ("bogus",): "No such command 'bogus'",
        ("damping", "nothing"): "packaged aircraft: boeing_747.toml",
        ("damping", "basic_finner_quick"): "run `indicial derive --method irm` first",
        ("damping", "boeing_747", "--json", "folder"): "folder is a folder; --json must name a file",
        ("damping", "boeing_747", "--json", "typo.toml/j.json"): "typo.toml is a file; --json cannot be in it",
        ("damping", "boeing_747", "--figures", "typo.toml"): "typo.toml is a file; --figures must name a folder",
        ("flights", "a.nc", "b.nc", "--csv", "folder"): "folder is a folder; --csv must name a file",
        ("study", "range", "--figures", "typo.toml"): "typo.toml is a file; --figures must name a folder",
        ("study", "range", "--check", "--folder", "typo.toml"): "typo.toml is a file; --folder must name a folder",
        ("rom", "expor", "model.json"): "No such command 'expor'. Did you mean 'export'? (see indicial rom --help)",
        ("rom", "build", "--map", "nothing.toml"): "nothing.toml: cannot be read (No such file or directory)",
        ("damping", "boeing_747", "--mach", "-1"): "Mach number is -1.0, must be positive",
        ("damping", "boeing_747", "--roll-rate", "3"): "--roll-rate is for missiles",
        ("damping", "boeing_747", "--altitude", "1e6"): "altitude must be within",
        ("damping", "boeing_747", "--machs", "0.6-0.9"): "--machs is '0.6-0.9', must be FROM:TO:NUMBER",
        ("damping", "boeing_747", "--altitudes", "0:1:2"): "--altitudes needs --machs",
        ("damping", "boeing_747", "--mach", "0.8", "--machs", "0.6:0.9:3"): "give either",
    }
    for arguments, message in wrong.items():
        done = indicial_command(*arguments, cwd=tmp_path)
        assert done.returncode == 2, arguments
        assert message in done.stderr, arguments
        assert len(done.stderr.splitlines()) == 1, done.stderr
        assert done.stdout == ""


def test_a_refused_case_leaves_nothing_behind(tmp_path):
    (tmp_path / "bad.toml").write_text("title = 3")
    indicial_command("run", "bad.toml", cwd=tmp_path)
    indicial_command("rom", "basic_finner_quick", cwd=tmp_path)  # nothing that it could read has been made
    assert [path.name for path in tmp_path.iterdir()] == ["bad.toml"]


def test_mesh_stage_runs_away_from_the_checkout(tmp_path):
    done = indicial_command("mesh", "data/cases/basic_finner_quick.toml", "--output", "here", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "here" / "mesh" / "half.npz").is_file()
    assert "cells (half)" in done.stderr


def test_rom_is_a_stage_or_a_command_on_model_files(tmp_path):
    import numpy as np

    from indicial.rom import StateSpaceModel
    from indicial.rom.export import FORMATS
    from rom.cases import CONDITION, REFERENCE

    one = np.ones((1, 1))
    model = StateSpaceModel(-one, one, one, one, ("alpha",), ("CN",), np.zeros(6), CONDITION, REFERENCE)
    model.to_json(tmp_path / "model.json")
    arguments = ["rom", "export", str(tmp_path / "model.json"), "-o", str(tmp_path / "model.nc"), "--to"]
    done = CliRunner().invoke(app, [*arguments, "netcdf"])
    assert (done.exit_code, "model.nc" in done.stdout) == (0, True)
    assert StateSpaceModel.from_netcdf(tmp_path / "model.nc").to_dict() == model.to_dict()
    wrong = {
        ("rom",): "Missing argument 'CASE'. (see indicial rom --help)",
        ("rom", "nothing.toml"): "no such case file",
        ("rom", "export", "nothing.json", "--to", "c", "-o", "x.c"): "nothing.json",
        (*arguments, "excel"): " is not one of " + ", ".join(f"'{name}'" for name in FORMATS),
        (*arguments, "fmu"): "must end in .fmu",
    }
    for given, message in wrong.items():
        done = indicial_command(*given, cwd=tmp_path)
        assert done.returncode == 2, given
        assert message in done.stderr, given
