"""A record's diagnosis: what was put in is told by name, and sound records are told to be sound."""

import math
from functools import cache

import casadi as ca
import numpy as np
import pytest

from flightsim.test_trim import aircraft
from identification.test_compatibility import NOISE, flight
from indicial.flightsim import InitialState, Signal, fly
from indicial.identification import FlightRecord, Sensor, diagnose, measure_flight
from indicial.identification.outliers import outlier_limit, outlying, spikes

SENSORS = {
    **NOISE, "pdot": 0.02, "qdot": 0.02, "rdot": 0.02, "x": 1.0, "y": 1.0, "z": 1.0, "mach": 5e-4,
    "dynamic_pressure": 10.0,
}  # fmt: skip


def seen(seed, flown=None, rate=50.0, **errors):
    dynamics, usual = flight()
    sensors = {n: Sensor(rate, white=0.0 if seed is None else sd, **errors.get(n, {})) for n, sd in SENSORS.items()}
    return measure_flight(flown or usual, dynamics.vehicle, sensors, seed=seed, thrust=1800.0)


JUMPS = np.array([1.0, 2.0, 3.0, 4.0])


@cache
def steps(aileron=0.02, rudder=0.01):
    """A flight whose elevator jumps: accelerations jump, rates have kinks."""
    dynamics = aircraft(Cm_0=-1.2 * ca.SX.sym("elevator") + 0.055)
    at = np.array([0.0, *(t + d for t in JUMPS for d in (0.0, 1e-4)), 12.0])
    elevator = Signal(at, np.array([0.0, 0.0, 0.05, 0.05, -0.05, -0.05, 0.05, 0.05, 0.0, 0.0]))
    signals = {"elevator": elevator, "aileron": aileron, "rudder": rudder, "thrust": 1800.0}
    start = InitialState.from_path(60.0, alpha=0.06, position=(0.0, 0.0, -1000.0))
    return fly(dynamics, start, 12.0, method="dop853", step=0.01, parameters=signals)


def told(record):
    return [finding.text for finding in diagnose(record).findings]


@pytest.mark.parametrize("seed", [None, 1])
def test_a_sound_record_is_told_to_be_sound(seed):
    found = diagnose(seen(seed))
    assert found.sound
    assert not found.findings
    assert "nothing is wrong" in found.summary()


def test_few_sound_records_show_a_spike_by_chance():
    """Of 300 it were 8; of 40 with that chance more than 4 have a probability of 0.4%."""
    assert sum(not diagnose(seen(seed)).sound for seed in range(100, 140)) <= 4


@pytest.mark.parametrize("rate", [25.0, 100.0])
def test_jumps_and_kinks_of_the_motion_are_no_spikes(rate):
    for seed in (None, *range(8)):
        record = seen(seed, steps(), rate)
        for name, rows in diagnose(record).spikes.items():
            off = np.abs(record.time[rows][:, None] - JUMPS)
            assert np.min(off) > 5.0 / rate, (seed, name)
    assert not diagnose(seen(None, steps(), rate)).spikes


def test_spikes_are_found_each_and_no_other_sample():
    record = seen(4)
    rows = np.array([40, 41 + 100, 300, 555, 556 + 200, 900])
    sign = np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0])
    channels = {n: record[n] + np.isin(np.arange(len(record)), rows) * 0.0 for n in ("alpha", "az", "q")}
    for name, values in channels.items():
        values[rows] += 12.0 * sign * SENSORS[name]
    found = diagnose(record.with_channels(**channels))
    assert set(found.spikes) == set(channels)
    for name in channels:
        np.testing.assert_array_equal(found.spikes[name], rows, err_msg=name)
        assert f"channel {name} has 6 spikes" in found.summary()
        assert np.isnan(found.cleaned()[name][rows]).all()
        rest = np.delete(np.arange(len(record)), rows)
        np.testing.assert_array_equal(found.cleaned()[name][rest], record[name][rest])
    figure = found.plot()
    assert sum(len(line.get_xdata()) for ax in figure.axes for line in ax.lines if line.get_marker() == "x") == 18


def test_spikes_at_uneven_instants_and_in_coarse_digits():
    random = np.random.default_rng(3)
    time = np.sort(random.uniform(0.0, 10.0, 400)) + 0.02 * np.arange(400)
    values = np.sin(time) + 0.01 * random.standard_normal(400)
    values[200] += 0.15
    mask, worst = spikes(time, values)
    np.testing.assert_array_equal(np.flatnonzero(mask), [200])
    assert 7.0 < worst < 25.0
    coarse = 0.1 * np.round(np.sin(time) / 0.1)
    assert not spikes(time, coarse)[0].any()


def test_of_outliers_side_by_side_the_largest_is_taken():
    white = np.random.default_rng(1).standard_normal(500)
    white[[100, 101, 300]] = 9.0, -12.0, 8.0
    np.testing.assert_array_equal(np.flatnonzero(outlying(white, 1)), [101, 300])
    np.testing.assert_array_equal(np.flatnonzero(outlying(white)), [100, 101, 300])
    assert outlier_limit(1) == pytest.approx(2.5758, abs=1e-3)  # two-sided 99% of one Gaussian value


def test_dead_stuck_and_missing_channels_are_named():
    record = seen(5)
    stuck, missing = record["V"].copy(), record["beta"].copy()
    stuck[200:260] = stuck[200]
    missing[500:600] = math.nan
    nothing, still = np.full(len(record), math.nan), np.full(len(record), 0.3)
    text = told(record.with_channels(V=stuck, beta=missing, ay=nothing, r=still))
    assert "channel ay has no data at all" in text
    assert "channel r does not change: is it dead?" in text
    assert "channel V is stuck from 4 to 5.18 s" in text
    assert "channel beta is missing 0.1 of the time, at most for 2.02 s" in text


@pytest.mark.parametrize(
    ("channel", "factor", "message"),
    [
        ("q", math.degrees(1.0), "is q in degrees?"),
        ("p", math.degrees(1.0), "is p in degrees?"),
        ("r", math.degrees(1.0), "is r in degrees?"),
        ("theta", math.degrees(1.0), "theta reaches 7.1"),
        ("phi", math.degrees(1.0), "is phi in degrees?"),
        ("phi", -1.0, "has phi or p the other sign?"),
        ("q", -1.0, "has theta or q the other sign?"),
        ("V", 1.0 / 0.514444, "is V in kt?"),
        ("V", 3.6, "is V in km/h?"),
        ("dynamic_pressure", 0.01, "is dynamic_pressure in hPa?"),
        ("altitude", 1.0 / 0.3048, "is altitude in ft?"),
        ("z", -1.0, "times -z: the other sign?"),
        ("qdot", math.degrees(1.0), "is qdot in degrees?"),
        ("az", -1.0, "az is positive on the whole"),
    ],
)
def test_wrong_units_and_signs_are_named(channel, factor, message):
    record = seen(6)
    text = told(record.with_channels(**{channel: factor * record[channel]}))
    assert any(message in line for line in text), text


def test_accelerations_in_g_are_named():
    record = seen(6)
    in_g = {n: record[n] / 9.80665 for n in ("ax", "ay", "az")}
    assert any("multiples of g" in line for line in told(record.with_channels(**in_g)))


@pytest.mark.parametrize(("angle", "lag"), [("phi", 0.04), ("theta", 0.06), ("psi", 0.03)])
def test_the_lag_of_an_angle_is_found_within_its_error(angle, lag):
    for seed in range(6):
        (line,) = [text for text in told(seen(seed, **{angle: {"delay": lag}})) if "later than" in text]
        assert line.startswith(f"{angle} is ")
        value, error = (float(part) for part in line.split(" is ")[1].split(" s ")[0].split(" +- "))
        assert abs(value - lag) < 4.0 * error + 5e-4, line  # the last digit shown


def test_scales_of_angles_and_rates_are_found():
    for errors, start, value in (
        ({"phi": {"scale": 0.8}}, "phi changes", 0.8),
        ({"r": {"scale": 1.25}}, "psi changes", 0.8),
    ):
        (line,) = [text for text in told(seen(1, **errors)) if text.startswith(start)]
        assert float(line.split()[2]) == pytest.approx(value, rel=0.02)


def test_a_record_of_pitching_alone_is_held_against_its_one_rate():
    record = seen(1, steps(0.0, 0.0), theta={"delay": 0.06})
    few = FlightRecord(record.time, {n: record[n] for n in ("q", "theta", "alpha", "V")})
    assert any("theta is 0.0" in line and "later than q" in line for line in told(few))
    degrees = few.with_channels(q=np.degrees(few["q"]))
    assert any("is q in degrees?" in line for line in told(degrees))
