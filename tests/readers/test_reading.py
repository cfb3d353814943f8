"""Axes, units, motions: every way to write the flat plate down gives the same history; what is missing is asked for."""

from __future__ import annotations

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.readers import parse_mapping, read_history
from readers.files import (
    ALPHA,
    AMPLITUDE,
    CONDITION,
    PERIOD,
    RATE,
    REFERENCE,
    base_map,
    code_coefficients,
    fluent,
    history,
    newtons,
    seconds,
)

S = np.linspace(0.0, 8.0, 81)


def read(path, **changes):
    mapping = parse_mapping(base_map(**changes))
    return read_history([path], mapping, mapping.histories[0], path.parent)


def written(path, times, **columns):
    steps = np.arange(1.0, len(times) + 1.0)
    return fluent(path / "loads.out", {"Time Step": steps, **columns, "flow-time": times})


@pytest.mark.parametrize("frame", ["x aft, z up", "x aft, y up", "x forward, z down", "drag, side, lift"])
def test_lift_up_and_nose_up_of_a_flat_plate_in_every_frame(tmp_path, frame):
    exact = history("alpha", seconds(S))
    loads = newtons(exact)[1:]
    lift, moment = loads[:, 2], loads[:, 4]
    # lift points up and the moment is nose up, in the words of each frame
    names = {
        "x aft, z up": {"Fz": lift, "My": moment},
        "x aft, y up": {"Fy": lift, "Mz": -moment},
        "x forward, z down": {"Fz": -lift, "My": moment},
        "drag, side, lift": {"Fz": lift, "My": moment},
    }[frame]
    path = written(tmp_path, seconds(S)[1:], **names)
    axes = {"frame": frame, "body_pitch_deg": 0.0, "pitch_axis": "right"}
    found = read(path, axes=axes, columns={name: name for name in names}, made_with={})
    assert found.outputs == ("CN", "Cm")
    np.testing.assert_allclose(found.history.coefficients[1:], exact.coefficients[1:], rtol=1e-12, atol=1e-14)
    assert not found.warnings


def test_roll_and_yaw_change_sign_from_mesh_axes_and_pitch_does_not(tmp_path):
    ones = {name: np.full(20, value) for name, value in zip(("Mx", "My", "Mz"), (1.0, 2.0, 3.0), strict=True)}
    path = written(tmp_path, seconds(np.linspace(0.1, 8.0, 20)), **ones)
    before = {"Cl": 0.0, "Cm": 0.0, "Cn": 0.0}
    found = read(path, columns={name: name for name in ones}, histories=[{"motion": ALPHA, "before": before}])
    scale = CONDITION.dynamic_pressure * REFERENCE.area * REFERENCE.length
    np.testing.assert_allclose(found.history.coefficients[-1, 3:] * scale, [-1.0, 2.0, -3.0])


def test_lift_and_drag_are_turned_onto_a_body_at_incidence(tmp_path):
    n, a = 20, np.radians(12.0)
    axial, normal = 0.3, 1.7
    lift, drag = normal * np.cos(a) - axial * np.sin(a), normal * np.sin(a) + axial * np.cos(a)
    path = written(tmp_path, seconds(np.linspace(0.1, 8.0, n)), cl=np.full(n, lift), cd=np.full(n, drag))
    made = {"length_m": 0.5, "area_m2": 0.3, "density_kg_m3": CONDITION.density, "speed_m_s": CONDITION.speed}
    changes = {
        "axes": {"frame": "drag, side, lift", "body_pitch_deg": 12.0},
        "made_with": made,
        "histories": [{"motion": ALPHA, "before": {"CN": 0.0, "CA": 0.0}}],
    }
    found = read(path, columns={"CL": "cl", "CD": "cd"}, **changes)
    np.testing.assert_allclose(found.history.coefficients[-1, [0, 2]], [axial, normal])
    with pytest.raises(InputError, match="both components in the plane of pitch are needed"):
        read(path, columns={"CL": "cl"}, **changes)


def test_axes_that_stay_while_the_body_pitches_are_turned_after_it(tmp_path):
    times = np.linspace(0.0, 2.0 * PERIOD, 200)
    exact = history("pitch", times)
    loads = newtons(exact)
    loads[:, 0] = 50.0  # a constant axial force: its component across the still axes follows the pitch angle
    theta = AMPLITUDE * np.sin(2.0 * np.pi * times / PERIOD)
    x = loads[:, 0] * np.cos(theta) + loads[:, 2] * np.sin(theta)
    z = -loads[:, 0] * np.sin(theta) + loads[:, 2] * np.cos(theta)
    path = written(tmp_path, times, Fx=x, Fz=z, My=loads[:, 4])
    motion = {"kind": "pitch_oscillation", "amplitude_deg": 0.5, "frequency_Hz": 1.0 / PERIOD, "start": 0.0}
    changes = {"columns": {"Fx": "Fx", "Fz": "Fz", "Cm": "My"}, "histories": [{"motion": motion}]}
    with pytest.raises(InputError, match="in the frame 'x aft, z up' there are"):
        read(path, **changes)
    changes["columns"] = {"Fx": "Fx", "Fz": "Fz", "My": "My"}
    axes = {"frame": "x aft, z up", "body_pitch_deg": 0.0}
    with pytest.raises(InputError, match="turn_with_body must say"):
        read(path, axes=axes, **changes)
    found = read(path, axes={**axes, "turn_with_body": False}, **changes)
    np.testing.assert_allclose(found.history["CN"], exact["CN"], atol=1e-12)
    assert np.ptp(found.history["CA"]) < 1e-12


@pytest.mark.parametrize("size", [{"rate_deg_s": float(np.degrees(RATE))}, {"reduced_rate": 0.01}])
def test_a_step_in_pitch_rate_by_either_size(tmp_path, size):
    exact = history("q", seconds(S))
    c = code_coefficients(exact)[1:]
    path = written(tmp_path, seconds(S)[1:] + 0.25, cz=c[:, 2], cm=c[:, 4])
    motion = {"kind": "pitch_rate_step", "start": 0.25, **size}
    found = read(path, histories=[{"motion": motion, "before": {"CN": 0.0, "Cm": 0.0}}]).history
    np.testing.assert_allclose(found.coefficients[1:], exact.coefficients[1:], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.rate[:, 1], RATE)


@pytest.mark.parametrize(
    ("unit", "per_second"),
    [("ms", 1e3), ("us", 1e6), ("2Vt/c", 2.0 * CONDITION.speed / 0.5), ("Vt/c", CONDITION.speed / 0.5)],
)
def test_units_of_time(tmp_path, unit, per_second):
    exact = history("alpha", seconds(S))
    c = code_coefficients(exact)[1:]
    path = written(tmp_path, per_second * seconds(S)[1:], cz=c[:, 2], cm=c[:, 4])
    np.testing.assert_allclose(read(path, time={"unit": unit}).history.s, S, atol=1e-9)


def test_a_motion_in_a_table_of_its_own(tmp_path):
    times = np.linspace(0.0, 2.0 * PERIOD, 400)
    exact = history("pitch", times)
    loads = newtons(exact)
    path = written(tmp_path, times, Fz=loads[:, 2], My=loads[:, 4])
    alpha, q = np.degrees(exact.alpha), np.degrees(exact.rate[:, 1])
    lines = ["t,alpha,q", *(",".join(f"{v:.15g}" for v in row) for row in zip(times, alpha, q, strict=True))]
    (tmp_path / "motion.csv").write_text("\n".join(lines))
    motion = {"kind": "table", "file": "motion.csv", "time": "t", "alpha": "alpha", "q": "q", "start": 0.0}
    motion["angle_unit"] = "deg"
    found = read(path, columns={"Fz": "Fz", "My": "My"}, histories=[{"motion": motion}]).history
    np.testing.assert_allclose(found.velocity, exact.velocity, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.rate, exact.rate, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.coefficients, exact.coefficients, rtol=1e-9, atol=1e-12)


def test_the_row_at_the_step_is_before_it_or_after_it_as_the_map_says(tmp_path):
    exact = history("alpha", seconds(S))
    c = code_coefficients(exact)
    path = written(tmp_path, seconds(S), cz=c[:, 2], cm=c[:, 4])
    motion = {**ALPHA, "row_at_start": "after"}
    histories = [{"motion": motion, "before": {"CN": 0.0, "Cm": 0.0}}]
    np.testing.assert_allclose(read(path, histories=histories).history["CN"], exact["CN"], rtol=1e-9)
    still = c.copy()
    still[0] = 0.0
    path = written(tmp_path, seconds(S), cz=still[:, 2], cm=still[:, 4])
    found = read(path, histories=[{"motion": {**ALPHA, "row_at_start": "before"}}]).history
    # the plate's CN does not change at first: extrapolated to 0+ it is what it is
    np.testing.assert_allclose(found["CN"], exact["CN"], rtol=1e-9)
    assert found.initial("CN") == 0.0
    with pytest.raises(InputError, match="row_at_start must say"):
        read(path)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"condition": {"mach": 2.0, "alpha_deg": 0.0, "pressure_Pa": 9e4}}, "condition.temperature_K: missing"),
        ({"time": {"unit": "minutes"}}, "time.unit"),
        ({"axes": {"frame": "x up", "body_pitch_deg": 0.0}}, "allowed: 'x aft, z up'"),
        ({"axes": {"frame": "x aft, z up", "body_pitch": 0.0}}, "axes.body_pitch: unknown key"),
        ({"histories": [{"motion": {"kind": "pitch_rate_step", "start": 0.0}}]}, "either rate_deg_s or reduced_rate"),
        ({"format": "tecplot"}, "allowed: fluent, su2, openfoam, csv"),
    ],
)
def test_a_wrong_map_is_refused_with_the_key_and_what_is_allowed(changes, message):
    with pytest.raises(InputError, match=message):
        parse_mapping(base_map(**changes))


def test_quantities_that_the_file_cannot_say_are_asked_for(tmp_path):
    c = code_coefficients(history("alpha", seconds(S)))[1:]
    path = written(tmp_path, seconds(S)[1:], cz=c[:, 2], cm=c[:, 4])
    with pytest.raises(InputError, match=r"made_with must say .*density_kg_m3"):
        read(path, made_with={"length_m": 1.0, "area_m2": 1.0, "speed_m_s": 300.0})
    with pytest.raises(InputError, match="has no row before the step"):
        read(path, histories=[{"motion": ALPHA}])
