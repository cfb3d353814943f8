import math

import numpy as np
import pytest

from flightsim.support import FINNER
from identification.support import flight
from indicial.errors import InputError
from indicial.flightsim import WGS84, Signal, Trajectory
from indicial.flightsim.turbulence import DrydenTurbulence
from indicial.identification import Installation, Sensor, measure_flight

PLAIN = Sensor(1000.0)


def steady(duration=1.0, rate=(0.0, 0.0, 0.0), moment=(0.0, 0.0, 0.0), speed=100.0):
    """Two instants of a flight along x whose rates, loads and attitude do not change."""
    constant = {"velocity": (speed, 0.0, 0.0), "quaternion": (1.0, 0.0, 0.0, 0.0), "rate": rate, "moment": moment}
    return Trajectory(
        time=np.array([0.0, duration]),
        position=np.array([[0.0, 0.0, -50.0], [speed * duration, 0.0, -50.0]]),
        **{name: np.tile(values, (2, 1)) for name, values in constant.items()},
        force=np.zeros((2, 3)),
        density=np.full(2, 1.2),
        speed_of_sound=np.full(2, 340.0),
        lag=np.zeros((2, 0)),
        outside_range=np.zeros(2, dtype=bool),
        reference=FINNER.reference,
    )


def test_without_errors_instruments_show_the_flight():
    names = ("x", "y", "altitude", "V", "alpha", "beta", "mach", "p", "q", "r", "ax", "ay", "az", "theta", "psi")
    names = (*names, "dynamic_pressure")
    record = measure_flight(flight(), FINNER, dict.fromkeys(names, PLAIN), seed=1)
    true = flight().at_times(record.time)
    expected = {"V": true.speed, "alpha": true.alpha, "beta": true.beta, "mach": true.mach, "x": true.position[:, 0]}
    expected |= {"y": true.position[:, 1], "altitude": -true.position[:, 2]}
    expected |= {"psi": true.euler[:, 0], "theta": true.euler[:, 1]}
    expected |= dict(zip(("p", "q", "r"), true.rate.T, strict=True))
    expected |= dict(zip(("ax", "ay", "az"), true.force.T / FINNER.mass, strict=True))
    expected |= {"dynamic_pressure": 0.5 * true.density * true.speed**2}
    assert set(expected) == set(names)
    for name, values in expected.items():
        np.testing.assert_allclose(record[name], values, rtol=1e-7, atol=1e-7, err_msg=name)


def test_over_a_round_earth_altitude_is_above_the_ellipsoid():
    """Straight on for 100 km, the ground falls away by some 780 m."""
    earth = WGS84(latitude=0.7, azimuth=1.0)
    sensors = dict.fromkeys(("x", "y", "z", "altitude"), Sensor(1.0))
    record = measure_flight(steady(1000.0), FINNER, sensors, seed=None, earth=earth)
    ends = np.stack([record[name] for name in "xyz"], axis=1)[[0, -1]]
    altitude = record["altitude"][[0, -1]]
    np.testing.assert_allclose(altitude, earth.geodetic(ends)[2], atol=1e-6)
    assert altitude[1] - altitude[0] == pytest.approx(1e5**2 / (2.0 * 6.371e6), rel=0.01)


def test_angular_accelerations_are_the_slopes_of_the_rates():
    record = measure_flight(flight(), FINNER, {"q": Sensor(5000.0), "qdot": Sensor(5000.0)}, seed=None)
    slope = np.gradient(record["q"], record.time)[1:-1]
    np.testing.assert_allclose(record["qdot"][1:-1], slope, atol=1e-3 * np.max(np.abs(slope)))


def test_accelerometers_off_the_centre_of_gravity_feel_rotation_and_its_change():
    ix = FINNER.inertia[0, 0]
    turning = steady(rate=(10.0, 0.0, 0.0), moment=(7.0 * ix, 0.0, 0.0))
    place = Installation(accelerometers=(3.0, 0.2, -0.1))
    record = measure_flight(turning, FINNER, dict.fromkeys(("ax", "ay", "az"), PLAIN), seed=None, installation=place)
    np.testing.assert_allclose(record["ax"], 0.0, atol=1e-9)
    np.testing.assert_allclose(record["ay"], -100.0 * 0.2 - 7.0 * -0.1)
    np.testing.assert_allclose(record["az"], -100.0 * -0.1 + 7.0 * 0.2)


def test_vanes_see_the_turning_and_the_upwash_at_their_place():
    place = Installation(vanes=(2.0, 0.0, 0.0), upwash=1.2, sidewash=1.1)
    turning = steady(rate=(0.0, 5.0, 8.0))
    record = measure_flight(turning, FINNER, dict.fromkeys(("alpha", "beta"), PLAIN), seed=None, installation=place)
    w, v = -5.0 * 2.0, 8.0 * 2.0
    np.testing.assert_allclose(record["alpha"], 1.2 * math.atan2(w, 100.0))
    np.testing.assert_allclose(record["beta"], 1.1 * math.asin(v / math.sqrt(100.0**2 + v**2 + w**2)))


def test_bias_scale_and_delay_do_what_they_say():
    sensor = Sensor(1000.0, bias=0.01, scale=0.93, delay=0.02)
    record = measure_flight(flight(), FINNER, {"alpha": sensor}, seed=None)
    assert np.all(np.isnan(record["alpha"][:20]))
    true = flight().at_times(record.time[20:] - 0.02)
    np.testing.assert_allclose(record["alpha"][20:], 0.93 * true.alpha + 0.01, atol=1e-8)


def test_coloured_noise_has_the_variance_and_autocorrelation_stated():
    sensor = Sensor(100.0, coloured=0.5, correlation_time=0.1)
    noise = measure_flight(steady(2000.0), FINNER, {"p": sensor}, seed=3)["p"]
    # the variance of an estimate from N = T/(2 tau) independent values: 1% here
    assert np.std(noise) == pytest.approx(0.5, rel=0.04)
    for lag in (1, 5, 10, 20):
        correlation = np.mean(noise[lag:] * noise[:-lag]) / np.mean(noise**2)
        assert correlation == pytest.approx(math.exp(-lag / 10.0), abs=0.04)


def test_white_noise_has_the_deviation_stated_and_none_between_neighbours():
    record = measure_flight(steady(1000.0), FINNER, {"p": Sensor(100.0, white=0.2)}, seed=3)
    noise = record["p"]
    assert np.std(noise) == pytest.approx(0.2, rel=0.01)
    assert np.mean(noise[1:] * noise[:-1]) / np.var(noise) == pytest.approx(0.0, abs=0.015)
    assert record.standard_deviations == {"p": 0.2}


def test_dropouts_come_as_often_and_last_as_long_as_stated():
    sensor = Sensor(100.0, dropout=0.01, burst=5.0)
    lost = np.isnan(measure_flight(steady(5000.0), FINNER, {"p": sensor}, seed=4)["p"])
    # a sample is there if none of the bursts that may have started j samples ago (and last longer) did
    there = np.prod(1.0 - 0.01 * (1.0 - 1.0 / 5.0) ** np.arange(400))
    assert np.mean(lost) == pytest.approx(1.0 - there, rel=0.06)


def test_readings_have_the_resolution_stated():
    record = measure_flight(flight(), FINNER, {"alpha": Sensor(1000.0, resolution=1e-3)}, seed=None)
    steps = record["alpha"] / 1e-3
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-9)
    assert np.max(np.abs(record["alpha"] - flight().at_times(record.time).alpha)) <= 0.5e-3 + 1e-8


def test_another_channel_changes_nothing_and_another_seed_everything():
    noisy = Sensor(1000.0, white=1e-3, coloured=1e-3, dropout=0.01, burst=3.0)
    one = measure_flight(flight(), FINNER, {"q": noisy}, seed=5)
    two = measure_flight(flight(), FINNER, {"alpha": noisy, "q": noisy}, seed=5)
    np.testing.assert_array_equal(one["q"], two["q"])
    other = measure_flight(flight(), FINNER, {"q": noisy}, seed=6)
    both = one.measured("q") & other.measured("q")
    assert np.all(one["q"][both] != other["q"][both])
    errors = [two[n] - measure_flight(flight(), FINNER, {n: PLAIN}, seed=None)[n] for n in ("q", "alpha")]
    known = two.measured("q", "alpha")
    assert abs(np.corrcoef(errors[0][known], errors[1][known])[0, 1]) < 0.3


def test_a_slower_instrument_is_silent_between_its_samples_and_controls_are_recorded():
    elevator = Signal.step(0.1, at=0.5)
    sensors = {"q": Sensor(100.0), "x": Sensor(20.0)}
    record = measure_flight(steady(), FINNER, sensors, seed=None, inputs={"elevator": elevator})
    assert np.all(record.measured("q"))
    np.testing.assert_array_equal(np.flatnonzero(record.measured("x")), np.arange(0, 101, 5))
    np.testing.assert_array_equal(record["elevator"], elevator.at(record.time))


def test_turbulence_is_seen_by_the_air_data_alone():
    gusts = DrydenTurbulence((1.0, 1.0, 1.0), (200.0, 200.0, 50.0), seed=2)
    still, channels = steady(), dict.fromkeys(("V", "alpha", "az"), Sensor(1.0))
    record = measure_flight(still, FINNER, channels, seed=None, turbulence=gusts)
    along, across, down = gusts.components(100.0 * record.time)[:, :3].T
    np.testing.assert_allclose(record["V"], np.sqrt((100.0 - along) ** 2 + across**2 + down**2))
    np.testing.assert_allclose(record["alpha"], np.arctan2(-down, 100.0 - along))
    np.testing.assert_allclose(record["az"], 0.0, atol=1e-12)


def test_what_cannot_be_measured_is_refused():
    with pytest.raises(InputError, match="rate of x, 30 Hz, is no whole part"):
        measure_flight(steady(), FINNER, {"q": Sensor(100.0), "x": Sensor(30.0)}, seed=None)
    with pytest.raises(InputError, match="'aoa' is not a channel"):
        measure_flight(steady(), FINNER, {"aoa": Sensor(100.0)}, seed=None)
    with pytest.raises(InputError, match="too short for 100 Hz"):
        measure_flight(steady(1e-3), FINNER, {"q": Sensor(100.0)}, seed=None)
    with pytest.raises(InputError, match="white of a sensor is -1"):
        Sensor(100.0, white=-1.0)
