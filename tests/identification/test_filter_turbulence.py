"""An aircraft through the field of Dryden turbulence, and filters that know of the gust as a random process."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from scipy.stats import chi2

from identification.test_maximum_likelihood import CHANNELS, NOISE, START, TRUTH, aircraft, parameters
from indicial.errors import InputError
from indicial.flightsim import DrydenTurbulence, Signal, SteadyWind, build_dynamics, fly
from indicial.identification import (
    Parameter,
    Process,
    Sensor,
    filter_error,
    filter_record,
    flight_model,
    flight_start,
    measure_flight,
    state_model,
)

SIGMA, SCALE, SPEED = 1.5, 150.0, 56.2  # m/s, m, and the mean speed of the flights, which lose some [m/s]
LAG = SCALE / SPEED
STATES = ("u", "w", "theta", "q")
GUST = {"gust_a": 1.0, "gust_b": 1.0}


def field(seed):
    return DrydenTurbulence((0.0, 0.0, SIGMA), (300.0, 300.0, SCALE), seed)


@cache
def flight(seed):
    """20 s at 25 samples a second, and the trajectory."""
    own = aircraft()
    time = np.linspace(0.0, 20.0, 501)
    elevator = Signal(time, Signal.multistep(0.03, 0.7, 0.5).at(time))
    gusty = build_dynamics(own.vehicle, own.aerodynamics, wind=field(seed))
    flown = fly(gusty, START, 20.0, parameters={**TRUTH, "elevator": elevator}, step=0.01)
    sensors = {channel: Sensor(25.0, white=sd) for channel, sd in NOISE.items()}
    return measure_flight(flown, own.vehicle, sensors, seed=seed, inputs={"elevator": elevator}), flown


@cache
def gust_dynamics():
    a, b = ca.SX.sym("gust_a"), ca.SX.sym("gust_b")
    down = np.sqrt(3.0) * a + (1.0 - np.sqrt(3.0)) * b
    return build_dynamics(aircraft().vehicle, aircraft().aerodynamics, wind=SteadyWind((0.0, 0.0, down)))


@cache
def gust_model(joint=False):
    unknown = {name: Process() for name in TRUTH} if joint else {}
    gust = {"gust_a": Process(SIGMA / np.sqrt(LAG), LAG), "gust_b": Process(0.0, LAG, follows="gust_a")}
    return flight_model(gust_dynamics(), STATES, CHANNELS, processes={**gust, **unknown})


def start():
    known = flight_start(gust_dynamics(), START, STATES, np.zeros(len(gust_dynamics().parameter_names)))
    return {**known, **dict.fromkeys(GUST, 0.0)}


def gust(states):
    a, b = (states[:, gust_model().state_names.index(name)] for name in GUST)
    return np.sqrt(3.0) * a + (1.0 - np.sqrt(3.0)) * b


def test_the_process_has_the_spectrum_and_the_variance_of_dryden():
    """Its transfer function against MIL-F-8785C, Phi_w over frequency: one-sided, over pi and V."""
    slope = np.array([[-1.0 / LAG, 0.0], [1.0 / LAG, -1.0 / LAG]])
    model = gust_model()
    full = model.advance(np.array([*start().values()]), np.zeros(5), np.zeros(5), 0.01, 0.0)[2]
    np.testing.assert_allclose(full[-2:, -2:], slope, atol=1e-12)
    omega = np.geomspace(0.01, 100.0, 50)
    weights = np.array([np.sqrt(3.0), 1.0 - np.sqrt(3.0)])
    transfer = np.array([weights @ np.linalg.solve(1j * w * np.eye(2) - slope, model.intensity[-2:]) for w in omega])
    wave = LAG * omega
    expected = SIGMA**2 * LAG / np.pi * (1.0 + 3.0 * wave**2) / (1.0 + wave**2) ** 2
    np.testing.assert_allclose(np.abs(transfer) ** 2 / np.pi, expected, rtol=1e-12)


def test_derivatives_the_intensity_of_turbulence_and_the_gust_itself_come_out_of_flights_through_the_field():
    """8 flights: errors of all derivatives together within 99.8% of chi-square; sigma_w within 10% on the mean (the
    field ends at 1000 wave numbers over L); the smoothed gust within a tenth of its size."""
    total, found_sigma = 0.0, []
    for seed in range(8):
        record, flown = flight(seed)
        own = [*parameters(1.1), Parameter("intensity_gust_a", 0.5)]
        found = filter_error(gust_model(), [record], [start()], own, start_errors=GUST)
        apart = np.array([found[name].value - value for name, value in TRUTH.items()])
        total += apart @ np.linalg.solve(found.covariance[:4, :4], apart)
        found_sigma.append(found["intensity_gust_a"].value * np.sqrt(LAG))
        true = field(seed).components(np.interp(record.time, flown.time, flown.position[:, 0]))[:, 2]
        assert np.std(gust(found.filters[0].smoothed[0]) - true) < 0.1 * np.std(true)
    assert chi2.ppf(0.001, 32) < total < chi2.ppf(0.999, 32)
    assert np.mean(found_sigma) == pytest.approx(SIGMA, rel=0.1)


def test_derivatives_as_states_come_out_by_both_filters_and_the_gust_smoothed():
    record, flown = flight(3)
    first = {**start(), **{name: 1.2 * value for name, value in TRUTH.items()}}
    errors = {**GUST, **dict.fromkeys(STATES, 1e-3), **{name: 0.3 * abs(value) for name, value in TRUTH.items()}}
    true = field(3).components(np.interp(record.time, flown.time, flown.position[:, 0]))[:, 2]
    results = []
    for method in ("extended", "unscented"):
        found = filter_record(gust_model(joint=True), record, first, errors, method=method)
        results.append({e.name: e for e in found.estimates})
        for name, value in TRUTH.items():
            assert abs(results[-1][name].value - value) < 4.0 * results[-1][name].standard_error
            assert results[-1][name].standard_error < 0.1 * abs(value)
        assert np.std(gust(found.smoothed[0]) - true) < 0.1 * np.std(true)
    for name in TRUTH:
        apart = abs(results[0][name].value - results[1][name].value)
        assert apart < results[0][name].standard_error


def test_a_process_to_follow_must_be_there_and_take_its_time():
    w, a = ca.SX.sym("w"), ca.SX.sym("a")
    with pytest.raises(InputError, match="no process to follow 'b'"):
        state_model({"w": a - w}, {"alpha": w}, [w, a], processes={"a": Process(0.1, 1.0, follows="b")})
    with pytest.raises(InputError, match="needs a finite time constant"):
        Process(0.1, follows="b")
