"""Instruments against each other: errors put in are found, records without are found without, units are noticed."""

import math
from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest

from flightsim.test_trim import aircraft
from indicial.errors import InputError
from indicial.flightsim import InitialState, Signal, fly
from indicial.identification import (
    Installation,
    Sensor,
    check_compatibility,
    diagnose,
    measure_flight,
    to_centre_of_gravity,
)
from indicial.identification.compatibility import IMU, OUTPUTS
from indicial.identification.kinematics import block_responses, integrate

NOISE = {
    "ax": 0.02, "ay": 0.02, "az": 0.02, "p": 1e-3, "q": 1e-3, "r": 1e-3,
    "V": 0.1, "alpha": 2e-3, "beta": 2e-3, "phi": 2e-3, "theta": 2e-3, "psi": 2e-3, "altitude": 0.3,
}  # fmt: skip
RATE = 50.0


@cache
def flight():
    """Twenty seconds of a light aircraft with all controls moving."""
    dynamics = aircraft(Cm_0=-1.2 * ca.SX.sym("elevator") + 0.055)
    signals = {
        "elevator": Signal.sampled(lambda t: 0.03 * np.sin(1.1 * t) + 0.01 * np.sin(2.7 * t), 20.0, 0.02),
        "aileron": Signal.sampled(lambda t: 0.05 * np.sin(0.8 * t + 0.3), 20.0, 0.02),
        "rudder": Signal.sampled(lambda t: 0.05 * np.sin(1.7 * t), 20.0, 0.02),
        "thrust": 1800.0,
    }
    start = InitialState.from_path(60.0, alpha=0.06, position=(0.0, 0.0, -1000.0))
    return dynamics, fly(dynamics, start, 20.0, method="dop853", step=0.01, tolerance=1e-10, parameters=signals)


def record(seed, channels=(*IMU, *OUTPUTS), installation=None, rate=RATE, **errors):
    """As instruments show it: errors by ``alpha={"bias": 0.01}``; without a seed no noise."""
    dynamics, flown = flight()
    sensors = {n: Sensor(rate, white=0.0 if seed is None else NOISE[n], **errors.get(n, {})) for n in channels}
    return measure_flight(flown, dynamics.vehicle, sensors, seed=seed, installation=installation, thrust=1800.0)


def test_integrated_kinematics_tend_to_the_flight_with_the_square_of_the_interval():
    worst = []
    for rate in (50.0, 100.0, 200.0):
        seen = record(None, rate=rate)
        imu = np.stack([seen[n] for n in IMU], axis=1)
        exact = flight()[1].at_times(seen.time)
        start = np.concatenate([exact.velocity[0], exact.euler[0][::-1], [1000.0]])
        found = integrate(seen.time, imu, start[None], np.zeros((1, 6)), np.ones((1, 6)), 9.80665)[0]
        errors = (found[:, :3] - exact.velocity, 60.0 * (found[:, 3:6] - np.unwrap(exact.euler, axis=0)[:, ::-1]))
        worst.append(max(float(np.max(np.abs(e))) for e in errors))
        assert np.max(np.abs(found[:, 6] + exact.position[:, 2])) < 0.05
    assert worst[0] < 0.02
    np.testing.assert_allclose([worst[0] / worst[1], worst[1] / worst[2]], 4.0, rtol=0.15)


def test_block_responses_are_differences_of_integrations():
    seen = record(None)
    imu = np.stack([seen[n] for n in IMU], axis=1)
    start = np.array([[60.0, 0.0, 3.0, 0.0, 0.05, 0.0, 1000.0]])
    base = integrate(seen.time, imu, start, np.zeros((1, 6)), np.ones((1, 6)), 9.80665)[0]
    edges = np.array([0, 300, 700, len(seen)])
    size = np.full(6, 1e-5)
    found = block_responses(seen.time, imu, base, 9.80665, edges, size)
    changed = imu.copy()
    changed[300:700, 4] += 1e-5
    other = integrate(seen.time, changed, start, np.zeros((1, 6)), np.ones((1, 6)), 9.80665)[0]
    np.testing.assert_allclose(found[1, 4], (other - base) / 1e-5, atol=1e-6 * np.max(np.abs(found[1, 4])))


def test_a_record_without_errors_is_found_consistent():
    found = check_compatibility(record(1))
    assert found.consistent, found.summary()
    assert "agree with each other" in found.summary()
    np.testing.assert_array_equal(found.corrected()["alpha"], found.record["alpha"])


def test_errors_put_in_are_found_and_taken_out():
    put = {"ax": {"bias": 0.2}, "q": {"bias": 0.01}, "alpha": {"scale": 1.15, "bias": 0.02}, "beta": {"scale": 0.9}}
    found = check_compatibility(record(2, **put))
    for name, value in {
        "bias_ax": 0.2, "bias_q": 0.01, "scale_alpha": 1.15, "bias_alpha": 0.02, "scale_beta": 0.9,
    }.items():  # fmt: skip
        assert abs(found[name].value - value) < 4.0 * found[name].standard_error, name
    text = "\n".join(found.findings)
    assert "ax is biased by 0.2" in text
    assert "alpha shows 1.1" in text
    clean = record(2)
    corrected = found.corrected()
    for name in ("ax", "q", "alpha", "beta"):
        off = np.sqrt(np.mean((corrected[name] - clean[name]) ** 2))
        assert off < 0.5 * np.sqrt(np.mean((found.record[name] - clean[name]) ** 2)), name


def test_a_delay_is_found():
    found = check_compatibility(
        record(3, alpha={"delay": 0.06}), errors=["delay_alpha", "delay_theta", *(f"bias_{n}" for n in IMU)]
    )
    assert found["delay_alpha"].value == pytest.approx(0.06, abs=4.0 * found["delay_alpha"].standard_error)
    assert abs(found["delay_theta"].value) < 4.0 * found["delay_theta"].standard_error
    assert "late" in " ".join(found.findings)


def coverage(seeds):
    put = {"ax": {"bias": 0.1}, "p": {"bias": -0.005}, "alpha": {"scale": 1.1, "bias": 0.01}}
    truth = {"bias_ax": 0.1, "bias_p": -0.005, "scale_alpha": 1.1, "bias_alpha": 0.01, "bias_az": 0.0, "bias_r": 0.0}
    scaled = []
    for seed in seeds:
        found = check_compatibility(record(seed, **put))
        scaled.append([(found[n].value - v) / found[n].standard_error for n, v in truth.items()])
    return np.array(scaled)


def test_errors_of_estimates_are_of_the_size_reported():
    """The noise of the gyros is integrated: what vanes and attitude leave is coloured, and the errors allow for it."""
    size = np.mean(coverage(range(100, 106)) ** 2, axis=0)
    assert np.all(size < 3.5), size


@pytest.mark.slow
def test_over_100_records_intervals_cover():
    scaled = coverage(range(1000, 1100))
    held = np.mean(np.abs(scaled) < 1.96, axis=0)
    assert np.all((held >= 0.90) & (held <= 0.99)), held  # 100 records know it within 2%


def test_records_without_errors_are_seldom_accused():
    accused = sum(not check_compatibility(record(seed)).consistent for seed in range(200, 208))
    assert accused <= 2


def test_off_the_centre_of_gravity_is_refused_and_moved_there():
    place = Installation(accelerometers=(0.4, 0.1, -0.2), vanes=(2.0, 0.3, 0.1), upwash=1.1, sidewash=1.05)
    away = record(None, channels=(*IMU, "pdot", "qdot", "rdot", *OUTPUTS), installation=place)
    with pytest.raises(InputError, match="to_centre_of_gravity"):
        check_compatibility(away)
    there, true = to_centre_of_gravity(away), record(None)
    for name in ("ax", "ay", "az", "V", "alpha", "beta"):
        np.testing.assert_allclose(there[name], true[name], atol=1e-9, err_msg=name)
    assert there.provenance["moved_from"]["vanes"] == [2.0, 0.3, 0.1] or tuple(
        there.provenance["moved_from"]["vanes"]
    ) == (2.0, 0.3, 0.1)
    by_slopes = to_centre_of_gravity(record(None, installation=place))
    known = np.isfinite(by_slopes["az"])
    np.testing.assert_allclose(by_slopes["az"][known], true["az"][known], atol=2e-3)
    with pytest.raises(InputError, match="nothing says"):
        to_centre_of_gravity(replace(away, provenance={}))


def test_wrong_units_and_gaps_are_noticed():
    good = record(5)
    degrees = good.with_channels(q=np.degrees(good["q"]))
    with pytest.raises(InputError, match=r"q turns the vehicle .* deg/s"):
        check_compatibility(degrees)
    in_g = good.with_channels(**{n: good[n] / 9.80665 for n in ("ax", "ay", "az")})
    with pytest.raises(InputError, match="multiples of g"):
        check_compatibility(in_g)
    with pytest.raises(InputError, match="az is positive"):
        check_compatibility(good.with_channels(az=-good["az"]))
    gap = good["ax"].copy()
    gap[10:12] = math.nan
    with pytest.raises(InputError, match="ax has dropouts"):
        check_compatibility(good.with_channels(ax=gap))
    with pytest.raises(InputError, match="no error 'bias_mach'"):
        check_compatibility(good, errors=["bias_mach"])


def test_spikes_are_taken_out_and_bridged_before_the_check():
    good = record(7)
    spoilt = {name: good[name].copy() for name in ("q", "az", "alpha")}
    for name, row in (("q", 300), ("az", 500), ("alpha", 640)):
        spoilt[name][row] += 200.0 * NOISE[name]
    diagnosis = diagnose(good.with_channels(**spoilt))
    assert set(diagnosis.spikes) == set(spoilt)
    found, wanted = check_compatibility(diagnosis.cleaned()), check_compatibility(good)
    assert found.consistent, found.summary()
    assert np.isnan(found.corrected()["q"][300])
    for one, other in zip(found.errors, wanted.errors, strict=True):
        assert abs(one.value - other.value) < 0.2 * other.standard_error, one.name
