"""Every format gives the exact plate back, whatever order its columns are in and whatever its runs went through."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.readers import parse_mapping, read_history, read_table
from readers.files import (
    CODE_AREA,
    CODE_LENGTH,
    CODE_SPEED,
    base_map,
    code_coefficients,
    fluent,
    history,
    openfoam,
    seconds,
    su2,
)

S = np.linspace(0.0, 8.0, 81)
STEPS = np.arange(1.0, 81.0)


def plate_columns(names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Columns under these names, for the samples after the step."""
    one = history("alpha", seconds(S))
    c = code_coefficients(one)[1:]
    known = {
        "Time Step": STEPS, "flow-time": seconds(S)[1:], "cz": c[:, 2], "cm": c[:, 4], "cx": c[:, 0],
        "Time_Iter": STEPS - 1.0, "Cur_Time": seconds(S)[1:], "CFz": c[:, 2], "CMy": c[:, 4], "Time(sec)": 7.0 * STEPS,
        "Time": seconds(S)[1:], "Cl": c[:, 2], "Cd": c[:, 0], "Cm": c[:, 4], "CmPitch": c[:, 4], "Cl(f)": 0.5 * c[:, 2],
    }  # fmt: skip
    return {name: known[name] for name in names}


def assert_is_the_plate(paths: list[Path], **changes: object) -> None:
    mapping = parse_mapping(base_map(**changes))
    found = read_history(paths, mapping, mapping.histories[0])
    exact = history("alpha", seconds(S))
    assert found.outputs == ("CN", "Cm")
    np.testing.assert_allclose(found.history.s, S, atol=1e-9)
    np.testing.assert_allclose(found.history.coefficients[1:], exact.coefficients[1:], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    "names", [("Time Step", "cz", "cm", "flow-time"), ("Time Step", "flow-time", "cm", "cx", "cz")]
)
def test_fluent_columns_are_found_by_name_wherever_they_stand(tmp_path, names):
    assert_is_the_plate([fluent(tmp_path / "loads-rfile.out", plate_columns(names))])


def test_fluent_files_of_one_quantity_each_are_joined_by_step(tmp_path):
    columns = plate_columns(("Time Step", "cz", "cm", "flow-time"))
    lift = fluent(tmp_path / "cz.out", {name: columns[name] for name in ("Time Step", "cz", "flow-time")})
    moment = fluent(tmp_path / "cm.out", {name: columns[name][::-1][:80][::-1] for name in ("Time Step", "cm")})
    assert_is_the_plate([lift, moment])


def test_a_fluent_restart_makes_what_was_written_after_its_start_obsolete(tmp_path):
    columns = plate_columns(("Time Step", "cz", "cm", "flow-time"))
    # the first run went to step 60 and wrong from 40 on; it is continued from 40, and only to 50, then to the end
    parts = [slice(0, 60), slice(40, 50), slice(50, 80)]
    written = {name: np.concatenate([values[part] for part in parts]) for name, values in columns.items()}
    written["cz"][40:60] = 99.0
    path = fluent(tmp_path / "loads.out", written)
    assert_is_the_plate([path])
    assert "20 row(s) repeated" in " ".join(read_table(path).notes)


def test_a_restart_that_stops_early_leaves_no_rows_of_the_run_that_was_given_up(tmp_path):
    columns = plate_columns(("Time Step", "cz", "flow-time"))
    written = {name: np.concatenate([values, values[40:50]]) for name, values in columns.items()}
    assert read_table(fluent(tmp_path / "loads.out", written))["Time Step"][-1] == 50.0


def test_a_row_cut_short_and_a_last_number_without_its_digits_are_left_out(tmp_path):
    path = fluent(tmp_path / "loads.out", plate_columns(("Time Step", "cz", "cm", "flow-time")))
    path.write_text(path.read_text() + "81 0.1\n82 0.1 0.1 0.0")
    assert_is_the_plate([path])
    notes = " ".join(read_table(path).notes)
    assert "1 row(s) cut short" in notes
    assert "last row is left out" in notes


def test_a_steady_fluent_file_is_refused_as_such(tmp_path):
    path = tmp_path / "cl.out"
    path.write_text('"cl-rfile"\n"Iteration" "cz etc.."\n("Iteration" "cz" "cm")\n1 0.1 0.1\n2 0.1 0.1\n3 0.1 0.1\n')
    mapping = parse_mapping(base_map())
    with pytest.raises(InputError, match="iterations of a steady solution"):
        read_history([path], mapping, mapping.histories[0])


@pytest.mark.parametrize("clock", ["Cur_Time", "step_s"])
def test_su2_keeps_the_last_inner_iteration_and_never_takes_wall_time(tmp_path, clock):
    names = ("Time_Iter", "CMy", "CFz", "Time(sec)") + (("Cur_Time",) if clock == "Cur_Time" else ())
    columns = plate_columns(names)
    inner = {name: np.repeat(values, 3) for name, values in columns.items()}
    late = np.arange(240) % 3 == 2
    for name in ("CMy", "CFz"):
        inner[name] = np.where(late, inner[name], -5.0)
    whole = {"Time_Iter": inner.pop("Time_Iter"), "Inner_Iter": np.tile([0.0, 1.0, 2.0], 80), **inner}
    path = su2(tmp_path / "history.csv", whole)
    time = {"unit": "s"}
    motion = {"kind": "alpha_step", "amplitude_deg": 0.5, "start": 0.0}
    if clock == "step_s":
        # without a column of time, step 0 is at time 0: the step of alpha is one time step before it
        time["step_s"] = float(seconds(S)[1])
        motion["start"] = -time["step_s"]
    histories = [{"motion": motion, "before": {"CN": 0.0, "Cm": 0.0}}]
    assert_is_the_plate([path], time=time, columns={"Cz": "CFz", "Cmy": "CMy"}, histories=histories)


def test_su2_restarts_in_files_of_their_own_follow_one_another(tmp_path):
    columns = plate_columns(("Time_Iter", "CFz", "CMy", "Cur_Time"))
    first = su2(tmp_path / "history.csv", {name: values[:50] for name, values in columns.items()})
    second = su2(tmp_path / "history_00040.csv", {name: values[40:] for name, values in columns.items()})
    assert_is_the_plate([first, second], columns={"Cz": "CFz", "Cmy": "CMy"})


def test_a_steady_su2_file_is_refused_as_such(tmp_path):
    columns = {"Time_Iter": np.zeros(9), "Inner_Iter": np.arange(9.0), "CFz": np.ones(9), "CMy": np.ones(9)}
    mapping = parse_mapping(base_map(columns={"Cz": "CFz", "Cmy": "CMy"}))
    with pytest.raises(InputError, match="iterations of a steady solution"):
        read_history([su2(tmp_path / "history.csv", columns)], mapping, mapping.histories[0])


OLD = {"magUInf": CODE_SPEED, "lRef": CODE_LENGTH, "Aref": CODE_AREA}
DIRECTIONS = {"dragDir": (1.0, 0.0, 0.0), "liftDir": (0.0, 0.0, 1.0), "pitchAxis": (0.0, 1.0, 0.0)}
WIND = {"frame": "drag, side, lift", "body_pitch_deg": 0.0}


@pytest.mark.parametrize(
    ("file", "names"),
    [
        ("forceCoeffs.dat", ("Time", "Cm", "Cd", "Cl", "Cl(f)")),
        ("coefficient.dat", ("Time", "Cd", "Cl", "Cl(f)", "CmPitch")),
    ],
)
def test_openfoam_old_and_new_headers_with_overlapping_restart_folders(tmp_path, file, names):
    columns = plate_columns(names)
    folder = tmp_path / "postProcessing" / "forceCoeffs1"
    # given up from row 50 on: the folder that begins at row 40 counts; folders sort by number, not by letter
    first, second = {n: v[:60].copy() for n, v in columns.items()}, {n: v[40:] for n, v in columns.items()}
    first["Cl"][50:] = 99.0
    openfoam(folder / "0" / file, {**OLD, **DIRECTIONS}, first)
    openfoam(folder / f"{seconds(S)[41]:.6g}" / file, {**OLD, **DIRECTIONS}, second)
    moment = "Cm" if "Cm" in names else "CmPitch"
    # the file states lengths and speed itself, only the density is asked for
    assert_is_the_plate([folder], axes=WIND, columns={"CL": "Cl", "CmPitch": moment}, made_with={"density_kg_m3": 1.1})


def test_openfoam_pitch_axis_to_the_left_turns_the_sign_of_the_moment(tmp_path):
    columns = plate_columns(("Time", "Cm", "Cd", "Cl"))
    columns["Cm"] = -columns["Cm"]
    header = {"dragDir": (1.0, 0.0, 0.0), "liftDir": (0.0, 1.0, 0.0), "pitchAxis": (0.0, 0.0, 1.0)}
    path = openfoam(tmp_path / "0" / "forceCoeffs.dat", {**OLD, **header}, columns)
    assert_is_the_plate([path], axes=WIND, columns={"CL": "Cl", "CmPitch": "Cm"}, made_with={"density_kg_m3": 1.1})


def test_a_reference_that_the_file_states_otherwise_is_refused(tmp_path):
    path = openfoam(tmp_path / "0" / "coefficient.dat", {**OLD, **DIRECTIONS}, plate_columns(("Time", "Cl", "CmPitch")))
    mapping = parse_mapping(base_map(axes=WIND, columns={"CL": "Cl"}, made_with={"density_kg_m3": 1.1, "area_m2": 0.5}))
    with pytest.raises(InputError, match="states Aref = 2"):
        read_history([path], mapping, mapping.histories[0])


@pytest.mark.parametrize(("delimiter", "decimal"), [(",", "."), (";", ","), ("\t", "."), ("  ", ".")])
def test_plain_tables_with_any_separator_and_decimal_commas(tmp_path, delimiter, decimal):
    columns = plate_columns(("Time", "cz", "cm"))
    rows = [[f"{v:.12g}".replace(".", decimal) for v in row] for row in zip(*columns.values(), strict=True)]
    lines = ["# made by hand", delimiter.join(columns), *(delimiter.join(row) for row in rows)]
    (tmp_path / "loads.csv").write_text("\n".join(lines))
    assert_is_the_plate([tmp_path / "loads.csv"], time={"unit": "s", "column": "Time"})


def test_a_missing_column_names_those_that_there_are(tmp_path):
    path = fluent(tmp_path / "loads.out", plate_columns(("Time Step", "cz", "cm", "flow-time")))
    mapping = parse_mapping(base_map(columns={"Cz": "lift"}))
    with pytest.raises(InputError, match="no column 'lift'; there are 'Time Step', 'cz', 'cm', 'flow-time'"):
        read_history([path], mapping, mapping.histories[0])
