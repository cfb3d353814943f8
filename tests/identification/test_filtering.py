"""Filters against the exact Gaussian likelihood, filterpy's own filter, the Riccati equation and the truth."""

import casadi as ca
import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from scipy.linalg import expm, solve_discrete_are
from scipy.stats import binom, chi2

from identification.test_maximum_likelihood import TRUTH, aircraft
from indicial.errors import DivergenceError, InputError
from indicial.flightsim import InitialState
from indicial.flightsim.attitude import euler_angles
from indicial.identification import FlightRecord, Process, filter_record, flight_model, flight_start, state_model
from indicial.identification.filtering import LEVEL
from indicial.identification.flight_state_model import MOTION
from indicial.identification.kalman import noise_covariance

A = np.array([[-0.8, 1.0], [-4.0, -1.2]])
B = np.array([0.0, -3.0])
INTENSITY = np.array([0.05, 0.2])
SD = {"alpha": 0.02, "q": 0.05}
STEP = 0.05
NAMES = ("w", "rate")
START = {"w": 0.0, "rate": 0.0}
ERRORS = {"w": 0.1, "rate": 0.2}


def linear_model(**options):
    w, rate, elevator = (ca.SX.sym(name) for name in ("w", "rate", "elevator"))
    rates = {"w": A[0, 0] * w + A[0, 1] * rate, "rate": A[1, 0] * w + A[1, 1] * rate + B[1] * elevator}
    options = {"intensity": dict(zip(NAMES, INTENSITY, strict=True)), "substeps": 4} | options
    return state_model(rates, {"alpha": w, "q": rate}, [w, rate, elevator], **options)


def discrete(step=STEP):
    """F and Q over a step by the matrix exponential (Van Loan)."""
    block = expm(np.block([[-A, np.diag(INTENSITY**2)], [np.zeros((2, 2)), A.T]]) * step)
    transition = block[2:, 2:].T
    return transition, transition @ block[:2, 2:]


def simulated(seed, n=200, elevator=True):
    rng = np.random.default_rng(seed)
    transition, noise = discrete()
    time = STEP * np.arange(n)
    control = 0.05 * np.sign(np.sin(1.7 * time)) if elevator else np.zeros(n)
    forced = expm(np.block([[A, B[:, None]], [np.zeros((1, 3))]]) * STEP)[:2, 2]
    states = [rng.standard_normal(2) * list(ERRORS.values())]
    for k in range(n - 1):
        # a control that is linear over a step acts as its mean, to third order
        mean = 0.5 * (control[k] + control[k + 1])
        states.append(transition @ states[-1] + forced * mean + rng.multivariate_normal([0, 0], noise))
    truth = np.array(states)
    seen = truth + rng.standard_normal((n, 2)) * list(SD.values())
    record = FlightRecord(time, {"alpha": seen[:, 0], "q": seen[:, 1]}, {"elevator": control}, SD)
    return record, truth


def test_likelihood_is_that_of_the_dense_gaussian_with_missing_values():
    record, _ = simulated(3, n=40, elevator=False)
    alpha = record["alpha"].copy()
    alpha[::3] = np.nan
    q = record["q"].copy()
    q[10:15] = np.nan
    record = record.with_channels(alpha=alpha, q=q)
    found = filter_record(linear_model(), record, START, ERRORS)
    transition, noise = discrete()
    n = 40
    covariance = np.zeros((2 * n, 2 * n))
    p = np.diag(np.array(list(ERRORS.values())) ** 2)
    for k in range(n):
        block = p
        for j in range(k, n):
            covariance[2 * j : 2 * j + 2, 2 * k : 2 * k + 2] = block
            covariance[2 * k : 2 * k + 2, 2 * j : 2 * j + 2] = block.T
            block = transition @ block
        p = transition @ p @ transition.T + noise
    covariance += np.diag(np.tile(np.array(list(SD.values())) ** 2, n))
    y = np.column_stack([alpha, q]).ravel()
    there = np.isfinite(y)
    covariance, y = covariance[np.ix_(there, there)], y[there]
    exact = -0.5 * (y @ np.linalg.solve(covariance, y) + np.linalg.slogdet(covariance)[1] + y.size * np.log(2 * np.pi))
    assert found.log_likelihood == pytest.approx(exact, abs=1e-4)


def peer(model, record):
    """filterpy's filter and smoother, given our transition matrices and noise of each interval."""
    kf = KalmanFilter(2, 2)
    kf.x, kf.P = np.zeros(2), np.diag(np.array(list(ERRORS.values())) ** 2)
    kf.H, kf.R = np.eye(2), np.diag(np.array(list(SD.values())) ** 2)
    means, covariances, transitions, noises, likelihood = [], [], [np.eye(2)], [np.zeros((2, 2))], 0.0
    for k, z in enumerate(np.column_stack([record["alpha"], record["q"]])):
        if k:
            step = record.time[k] - record.time[k - 1]
            _, kf.F, slope = model.advance(kf.x, np.zeros(1), np.zeros(1), step, record.time[k - 1])
            kf.Q = noise_covariance(np.ascontiguousarray(slope), model.intensity, step, model.substeps)
            kf.predict()
            transitions.append(kf.F)
            noises.append(kf.Q)
        kf.update(z)
        likelihood += kf.log_likelihood
        means.append(kf.x.copy())
        covariances.append(kf.P.copy())
    smooth, p_smooth, *_ = kf.rts_smoother(np.array(means), np.array(covariances), transitions, noises)
    return np.array(means), np.array(covariances), smooth, p_smooth, likelihood


def test_states_are_those_of_filterpy_to_round_off_smoothed_too_and_the_unscented_filter_agrees_on_a_linear_model():
    record, _ = simulated(5, elevator=False)
    model = linear_model()
    means, covariances, smooth, p_smooth, likelihood = peer(model, record)
    for method, tolerance in (("extended", 1e-13), ("unscented", 1e-11)):
        found = filter_record(model, record, START, ERRORS, method=method)
        np.testing.assert_allclose(found.filtered, means, atol=tolerance, rtol=0.0)
        np.testing.assert_allclose(found.filtered_covariance, covariances, atol=tolerance, rtol=0.0)
        states, p = found.smoothed
        np.testing.assert_allclose(states, smooth, atol=tolerance, rtol=0.0)
        np.testing.assert_allclose(p, p_smooth, atol=tolerance, rtol=0.0)
        assert found.log_likelihood == pytest.approx(likelihood, abs=1e-8)


def test_the_interval_is_that_of_the_matrix_exponential():
    """Fourth order: an interval half as long is 32 times as good."""
    apart = []
    for step in (STEP / 4.0, STEP / 8.0):
        _, transition, slope = linear_model(substeps=1).advance(np.zeros(2), np.zeros(1), np.zeros(1), step, 0.0)
        exact, noise = discrete(step)
        found = noise_covariance(np.ascontiguousarray(slope), INTENSITY, step)
        apart.append((np.max(np.abs(transition - exact)), np.max(np.abs(found - noise))))
    assert max(apart[0]) < 1e-6
    for coarse, fine in zip(*apart, strict=True):
        assert coarse / fine == pytest.approx(32.0, rel=0.1)


@pytest.mark.parametrize("method", ["extended", "unscented"])
def test_a_process_that_dies_out_between_instants_keeps_its_variance(method):
    """dx/dt = -x/T + w, seen every 4 T: without a word of its past, its variance is w^2 T/2 ever again."""
    intensity, constant = 0.7, 0.1
    (x,) = (ca.SX.sym("x"),)
    model = state_model({"x": -x / constant}, {"alpha": x}, [x], intensity={"x": intensity}, substeps=40)
    time = 4.0 * constant * np.arange(12)
    seen = FlightRecord(time, {"alpha": 0.01 * np.arange(12.0)}, {}, {"alpha": 0.05})
    found = filter_record(model, seen, {"x": 0.0}, {"x": intensity * np.sqrt(constant / 2.0)}, method=method)
    stationary = intensity**2 * constant / 2.0
    before = found.filtered_covariance[:-1, 0, 0]
    exact = stationary + (before - stationary) * np.exp(-8.0)
    np.testing.assert_allclose(found.made.predicted_covariance[1:, 0, 0], exact, rtol=1e-5)


def test_noise_in_pieces_is_that_of_the_matrix_exponential():
    slope, interval = 30.0 * A, 0.1
    block = expm(np.block([[-slope, np.diag(INTENSITY**2)], [np.zeros((2, 2)), slope.T]]) * interval)
    exact = block[2:, 2:].T @ block[:2, 2:]
    apart = [np.max(np.abs(noise_covariance(slope, INTENSITY, interval, n) - exact)) for n in (64, 128)]
    assert apart[0] < 1e-5 * np.max(exact)
    assert apart[0] / apart[1] == pytest.approx(16.0, rel=0.1)


def test_noise_of_one_state_leaves_no_negative_variance_in_those_that_it_reaches_late():
    """A chain of five integrators driven at its end: variances of order h, h^3, ... h^9."""
    slope = np.diag(np.ones(4), 1)
    found = noise_covariance(slope, np.array([0.0, 0.0, 0.0, 0.0, 1.0]), 0.1)
    size = np.sqrt(np.diag(found))
    assert np.min(np.linalg.eigvalsh(found / np.outer(size, size))) > -1e-14


def test_covariance_settles_at_the_solution_of_the_riccati_equation():
    record, _ = simulated(1)
    found = filter_record(linear_model(), record, START, ERRORS)
    transition, noise = discrete()
    settled = solve_discrete_are(transition.T, np.eye(2), noise, np.diag(np.array(list(SD.values())) ** 2))
    assert found.made.predicted_covariance[-1] == pytest.approx(settled, rel=1e-4)


def test_errors_and_innovations_are_as_large_as_the_filter_says():
    """Over 100 records: errors of filtered and smoothed states, and innovations, within 99% of chi-square."""
    model, runs = linear_model(), 100
    total, passed = np.zeros(3), 0
    for seed in range(runs):
        record, truth = simulated(100 + seed)
        found = filter_record(model, record, START, ERRORS)
        error = found.filtered[-1] - truth[-1]
        total[0] += error @ np.linalg.solve(found.filtered_covariance[-1], error)
        smooth, covariance = found.smoothed
        error = smooth[90] - truth[90]
        total[1] += error @ np.linalg.solve(covariance[90], error)
        total[2] += np.sum(found.standardised**2)
        passed += found.consistency().consistent
    for value, freedom in zip(total, (2 * runs, 2 * runs, 2 * 200 * runs), strict=True):
        assert chi2.ppf(0.005, freedom) < value < chi2.ppf(0.995, freedom)
    assert passed >= binom.ppf(0.005, runs, (1.0 - LEVEL) ** 2)
    wrong = linear_model(intensity={"w": 0.0, "rate": 0.02})
    assert not filter_record(wrong, record, START, ERRORS).consistency().consistent


@pytest.mark.parametrize("method", ["extended", "unscented"])
def test_a_parameter_among_the_states_is_found_within_its_error(method):
    w, rate, elevator, damping = (ca.SX.sym(name) for name in ("w", "rate", "elevator", "damping"))
    rates = {"w": A[0, 0] * w + rate, "rate": A[1, 0] * w + damping * rate + B[1] * elevator}
    model = state_model(
        rates,
        {"alpha": w, "q": rate},
        [w, rate, elevator, damping],
        intensity=dict(zip(NAMES, INTENSITY, strict=True)),
        processes={"damping": Process()},
    )
    record, _ = simulated(8, n=600)
    found = filter_record(model, record, {**START, "damping": -0.5}, {**ERRORS, "damping": 1.0}, method=method)
    (estimate,) = found.estimates
    assert estimate.standard_error < 0.5
    assert abs(estimate.value - A[1, 1]) < 3.0 * estimate.standard_error


def test_a_nonlinear_parameter_comes_out_alike_by_both_filters_and_within_its_error():
    """Stiffness that grows with the square of incidence: a state of its own; 20 records."""
    w, rate, cubic = (ca.SX.sym(name) for name in ("w", "rate", "cubic"))
    model = state_model(
        {"w": -0.8 * w + rate, "rate": -4.0 * w - cubic * w**3 - 0.4 * rate},
        {"alpha": w, "q": rate},
        [w, rate, cubic],
        intensity={"w": 0.01, "rate": 0.05},
        processes={"cubic": Process()},
        substeps=2,
    )
    start, errors = {"w": 0.5, "rate": 0.0, "cubic": 10.0}, {"w": 0.02, "rate": 0.05, "cubic": 10.0}
    total = 0.0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        x = np.array([0.5, 0.0, 20.0]) + rng.standard_normal(3) * [0.02, 0.05, 0.0]
        seen = [x[:2]]
        for _ in range(199):
            for _ in range(5):
                x = model.advance(x, np.zeros(0), np.zeros(0), STEP / 5, 0.0)[0]
                x = x + model.intensity * rng.standard_normal(3) * np.sqrt(STEP / 5)
            seen.append(x[:2])
        values = np.array(seen) + rng.standard_normal((200, 2)) * list(SD.values())
        record = FlightRecord(STEP * np.arange(200), {"alpha": values[:, 0], "q": values[:, 1]}, {}, SD)
        found = [filter_record(model, record, start, errors, method=m).estimates[0] for m in ("extended", "unscented")]
        assert abs(found[0].value - found[1].value) < 0.5 * found[0].standard_error
        total += ((found[1].value - 20.0) / found[1].standard_error) ** 2
    assert chi2.ppf(0.005, 20) < total < chi2.ppf(0.995, 20)


def test_angles_go_over_half_a_turn():
    angle = ca.SX.sym("angle")
    model = state_model({"angle": ca.SX(0.5)}, {"psi": angle}, [angle], intensity={"angle": 0.05})
    time = np.linspace(0.0, 10.0, 101)
    noise = 0.02 * np.random.default_rng(0).standard_normal(101)
    wrapped = (2.5 + 0.5 * time + noise + np.pi) % (2.0 * np.pi) - np.pi
    record = FlightRecord(time, {"psi": wrapped}, {}, {"psi": 0.02})
    for method in ("extended", "unscented"):
        found = filter_record(model, record, {"angle": 2.5}, {"angle": 0.1}, method=method)
        assert np.max(np.abs(found.filtered[:, 0] - 2.5 - 0.5 * time)) < 0.08


@pytest.mark.parametrize("method", ["extended", "unscented"])
def test_divergence_and_a_dead_channel_are_told(method):
    record, _ = simulated(1)
    with pytest.raises(InputError, match="channel q does not change in 200 values: dead"):
        filter_record(linear_model(), record.with_channels(q=np.full(200, 0.3)), START, ERRORS, method=method)
    with pytest.raises(InputError, match="channel q of the flight record has no data"):
        filter_record(linear_model(), record.with_channels(q=np.full(200, np.nan)), START, ERRORS, method=method)
    w = ca.SX.sym("w")
    wild = state_model({"w": w**3}, {"alpha": w}, [w], intensity={"w": 0.1})
    with pytest.raises(DivergenceError, match=f"the {method} filter broke down at"):
        filter_record(wild, record, {"w": 100.0}, {"w": 1e-3}, method=method)


def test_a_channel_that_freezes_on_the_way_is_not_consistent():
    record, _ = simulated(1)
    q = record["q"].copy()
    q[120:] = q[120]
    assert filter_record(linear_model(), record, START, ERRORS).consistency().consistent
    assert not filter_record(linear_model(), record.with_channels(q=q), START, ERRORS).consistency().consistent


def test_variances_stay_positive_where_the_plain_update_loses_them():
    """Noise 1e-9 of what is not known of the start: P - P h h^T P/s would keep nothing but round-off."""
    record, _ = simulated(1)
    exact = FlightRecord(record.time, dict(record.channels), dict(record.inputs), {"alpha": 1e-6, "q": 1e-6})
    found = filter_record(linear_model(), exact, START, {"w": 1e3, "rate": 1e3})
    assert np.min(np.linalg.eigvalsh(found.filtered_covariance)) > 0.0
    np.testing.assert_allclose(found.filtered_covariance[0], 1e-12 * np.eye(2), rtol=1e-4, atol=1e-16)


def test_what_is_missing_is_named():
    record, _ = simulated(1)
    with pytest.raises(InputError, match="start must name the states"):
        filter_record(linear_model(), record, {"w": 0.0}, {})
    with pytest.raises(InputError, match="positive start error of w, rate"):
        filter_record(linear_model(), record, START, {}, method="unscented")
    with pytest.raises(InputError, match="no state with noise 'beta'"):
        linear_model(intensity={"beta": 0.1})
    with pytest.raises(InputError, match="method is 'cubature'"):
        filter_record(linear_model(), record, START, ERRORS, method="cubature")


def test_the_flight_model_is_the_one_model():
    """Rates, channels and start against `Dynamics` itself, in a turning climb."""
    initial = InitialState.from_path(
        60.0, alpha=0.05, beta=0.03, path_angle=0.1, heading=0.4, bank=0.3, rate=(0.1, 0.05, -0.02)
    )
    dynamics = aircraft()
    model = flight_model(dynamics, MOTION, ("V", "alpha", "beta", "az", "psi"))
    given = np.array([{**TRUTH, "elevator": 0.02}[name] for name in model.parameter_names])
    start = flight_start(dynamics, initial, MOTION, given)
    x = np.array(list(start.values()))
    h = 0.01
    after = model.advance(x, given, given, h, 0.0)[0]
    y = dynamics.initial_vector(initial, given)
    k1 = dynamics.rate(y, given)
    k2 = dynamics.rate(y + h / 2 * k1, given)
    k3 = dynamics.rate(y + h / 2 * k2, given)
    y = y + h / 6 * (k1 + 2 * k2 + 2 * k3 + dynamics.rate(y + h * k3, given))
    yaw, pitch, roll = euler_angles(y[6:10])
    np.testing.assert_allclose(after, [*y[:6], roll, pitch, yaw, *y[10:]], atol=1e-8)
    seen, _ = model.outputs(x, given, 0.0)
    np.testing.assert_allclose(seen[[0, 1, 2, 4]], [60.0, 0.05, 0.03, start["psi"]], atol=1e-12)
    plane = flight_model(dynamics, ("u", "w", "theta", "q"), ("alpha", "q"))
    assert plane.state_names == ("u", "w", "theta", "q")
