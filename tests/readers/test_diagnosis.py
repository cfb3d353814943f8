"""What is wrong with a history is said in words; with a good one nothing is."""

from __future__ import annotations

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.readers import Reading, parse_mapping, read_history
from readers.files import ALPHA, PERIOD, base_map, code_coefficients, fluent, history, seconds

S = np.linspace(0.0, 8.0, 81)
Q = {"kind": "pitch_rate_step", "reduced_rate": 0.01, "start": 0.0}
PITCH = {"kind": "pitch_oscillation", "amplitude_deg": 0.5, "k": 0.2, "start": 0.0}


def read(folder, times, loads, **changes) -> Reading:
    steps = np.arange(1.0, len(times) + 1.0)
    path = fluent(folder / "loads.out", {"Time Step": steps, "cz": loads[:, 2], "cm": loads[:, 4], "flow-time": times})
    mapping = parse_mapping(base_map(**changes))
    return read_history([path], mapping, mapping.histories[0])


def alpha(s=S, kind: str = "alpha"):
    """Times and loads after a step, at reduced times from 0 of which the first is left out."""
    return seconds(s)[1:], code_coefficients(history(kind, seconds(s)))[1:]


def words(reading: Reading) -> str:
    return "; ".join(one.text for one in reading.warnings)


def step(motion=ALPHA):
    return [{"motion": motion, "before": {"CN": 0.0, "Cm": 0.0}}]


@pytest.mark.parametrize(("kind", "motion"), [("alpha", ALPHA), ("q", Q)])
def test_nothing_is_wrong_with_a_good_step(tmp_path, kind, motion):
    reading = read(tmp_path, *alpha(kind=kind), histories=step(motion))
    assert not reading.warnings
    assert "extrapolated" in reading.summary()


def test_nan_is_refused_with_the_place_where_it_begins(tmp_path):
    times, loads = alpha()
    loads[70:, 4] = np.nan
    with pytest.raises(InputError, match=r"'cm' is not a number in 10 of 80 rows, first in row 71"):
        read(tmp_path, times, loads)


def test_a_clock_that_was_reset_and_one_that_stands_are_refused(tmp_path):
    times, loads = alpha()
    times[40:] -= times[39]
    with pytest.raises(InputError, match=r"time goes back .* in row 41 .* reset at a restart"):
        read(tmp_path, times, loads)
    times, loads = alpha()
    times[40] = times[39]
    with pytest.raises(InputError, match=r"is there twice \(rows 40 and 41\)"):
        read(tmp_path, times, loads)


def test_a_late_start_is_told(tmp_path):
    times, loads = alpha()
    reading = read(tmp_path, times[20:], loads[20:])
    assert "starts late: its first sample is 21.0 time steps after the step, at s = 2.1" in words(reading)


def test_a_value_at_the_start_that_the_steps_are_too_large_for_is_told(tmp_path):
    # every twelfth sample: the corner of the response lies before the second
    times, loads = alpha()
    reading = read(tmp_path, times[11::12], loads[11::12])
    assert "values at 0+ are extrapolated" in words(reading)
    assert "uncertain" in words(reading)


def test_an_end_before_it_has_settled_is_told(tmp_path):
    times, loads = alpha()
    reading = read(tmp_path, times[:30], loads[:30])
    assert "CN has not settled when the record ends at s = 3" in words(reading)
    # what is not told: the whole of the same record
    assert "settled" not in words(read(tmp_path, times, loads))


def test_gaps_and_uneven_steps_are_told_apart(tmp_path):
    times, loads = alpha()
    kept = np.r_[0:40, 60:80]
    reading = read(tmp_path, times[kept], loads[kept])
    assert "there is a gap" in words(reading)
    assert "21 time steps long" in words(reading)
    growing = 8.0 * np.linspace(0.0, 1.0, 81) ** 1.5
    reading = read(tmp_path, *alpha(growing))
    assert not reading.warnings
    assert "the time step is not uniform" in reading.summary()


def test_lift_that_falls_with_alpha_is_told_and_so_is_a_moment_that_drives_the_rate(tmp_path):
    times, loads = alpha()
    assert "wrong sign: CN jumps" in words(read(tmp_path, times, -loads))
    times, loads = alpha(kind="q")
    assert "wrong sign: Cm jumps" in words(read(tmp_path, times, -loads, histories=step(Q)))
    times = np.linspace(0.0, 2.0 * PERIOD, 200)
    loads = code_coefficients(history("pitch", times))
    histories = [{"motion": PITCH}]
    assert "CN falls where alpha rises" in words(read(tmp_path, times, -loads, histories=histories))
    assert not read(tmp_path, times, loads, histories=histories).warnings


@pytest.mark.parametrize(("slope", "told"), [(0.0, False), (0.05, True)])
def test_drift_before_the_step_is_told(tmp_path, slope, told):
    times, loads = alpha()
    earlier = np.arange(-20, 0) * times[0]
    # `slope`: of the later change of CN, over the record before
    still = slope * loads[-1] * (np.linspace(0.0, 1.0, 20)[:, None] - 1.0)
    # the motion begins within a time step, no row is at its start
    reading = read(
        tmp_path, np.concatenate([earlier - 0.5 * times[0], times]), np.vstack([still, loads]),
        histories=[{"motion": ALPHA}],
    )  # fmt: skip
    assert ("CN drifts before the motion begins" in words(reading)) is told


@pytest.mark.parametrize(("unit", "told"), [("s", False), ("us", True)])
def test_a_wrong_unit_of_time_makes_an_implausible_length(tmp_path, unit, told):
    reading = read(tmp_path, *alpha(), time={"unit": unit})
    assert ("are the unit of time and the reference length right?" in words(reading)) is told


def test_an_oscillation_without_a_period_is_told(tmp_path):
    times = np.linspace(0.0, 0.4 * PERIOD, 60)
    loads = code_coefficients(history("pitch", times))
    assert "0.40 of a period" in words(read(tmp_path, times, loads, histories=[{"motion": PITCH}]))


def test_iterations_taken_for_time_are_told(tmp_path):
    _, loads = alpha()
    found = words(read(tmp_path, np.arange(1.0, 81.0), loads))
    assert "iterations of a steady run?" in found
