"""Filter error against the dense Gaussian likelihood, output error, and the truth over many records."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from scipy.stats import binom

from identification.test_filtering import ERRORS, INTENSITY, NAMES, SD, START, STEP, A, B, linear_model, simulated
from identification.test_maximum_likelihood import CHANNELS, NOISE, TRUTH, aircraft, manoeuvre
from identification.test_maximum_likelihood import START as FLIGHT_START
from identification.test_maximum_likelihood import parameters as flight_parameters
from identification.test_maximum_likelihood import simulated as still_air
from indicial.errors import DivergenceError, InputError
from indicial.flightsim import Signal
from indicial.identification import (
    FlightRecord,
    Parameter,
    filter_error,
    filter_record,
    fit_manoeuvres,
    flight_model,
    flight_start,
    state_model,
)

TRUE = {"stiffness": A[1, 0], "damping": A[1, 1], "power": B[1]}
IN_PLANE = ("u", "w", "theta", "q")


@cache
def short_period(**noise):
    w, rate, elevator, *free = (ca.SX.sym(name) for name in ("w", "rate", "elevator", *TRUE))
    stiffness, damping, power = free
    return state_model(
        {"w": A[0, 0] * w + rate, "rate": stiffness * w + damping * rate + power * elevator},
        {"alpha": w, "q": rate},
        [w, rate, elevator, *free],
        intensity=noise,
        substeps=2,
    )


def unknowns(factor=1.0, intensities=True):
    own = [Parameter(name, factor * value) for name, value in TRUE.items()]
    if intensities:
        own += [Parameter(f"intensity_{name}", factor * value) for name, value in zip(NAMES, INTENSITY, strict=True)]
    return own


def fit(record, intensities=True, factor=1.0, **options):
    return filter_error(
        short_period(), [record], [START], unknowns(factor, intensities), start_errors=ERRORS, **options
    )


def likelihood(record, values):
    """Of a record with these values, by the filter that `test_filtering` holds against the dense Gaussian."""
    model = short_period(**{name: values[f"intensity_{name}"] for name in NAMES})
    noise = {channel: values[f"noise_{channel}"] for channel in SD}
    changed = FlightRecord(record.time, dict(record.channels), dict(record.inputs), noise)
    known = {name: values[name] for name in TRUE}
    return filter_record(model, changed, START, ERRORS, known=known).log_likelihood


def test_the_estimate_is_where_the_likelihood_is_largest_and_its_information_the_curvature():
    """Gradient zero at the estimate; curvature over information 1 on the mean of records, within 4 of its errors."""
    runs, bent = 30, np.zeros((30, 7))
    for seed in range(runs):
        record, _ = simulated(seed, n=300)
        found = fit(record, factor=1.2)
        values = {e.name: e.value for e in found.estimates}
        assert likelihood(record, values) == pytest.approx(found.log_likelihood, abs=1e-8)
        information = np.diag(np.linalg.inv(found.covariance))
        for j, e in enumerate(found.estimates):
            h = 0.03 * e.standard_error
            at = [likelihood(record, {**values, e.name: e.value + sign * h}) for sign in (-1.0, 0.0, 1.0)]
            assert abs(at[2] - at[0]) / (2.0 * h) * e.standard_error < 0.01
            bent[seed, j] = -(at[2] - 2.0 * at[1] + at[0]) / h**2 / information[j]
    error = bent.std(axis=0, ddof=1) / np.sqrt(runs)
    assert np.all(error < 0.05)
    assert np.all(np.abs(bent.mean(axis=0) - 1.0) < 4.0 * error)


def test_missing_samples_are_passed_over_and_two_records_are_one_sum():
    first, second = simulated(1)[0], simulated(2)[0]
    alpha = first["alpha"].copy()
    alpha[::4] = np.nan
    first = first.with_channels(alpha=alpha)
    found = filter_error(short_period(), [first, second], [START, START], unknowns(), start_errors=ERRORS)
    values = {e.name: e.value for e in found.estimates}
    total = likelihood(first, values) + likelihood(second, values)
    assert found.log_likelihood == pytest.approx(total, abs=1e-8)
    for name, true in TRUE.items():
        assert abs(found[name].value - true) < 4.0 * found[name].standard_error
    assert "filter error: 2 records, 750 measurements" in found.summary()
    found.plot()
    near, far = found.against({"damping": A[1, 1]}), found.against({"damping": (A[1, 1] - 10.0, 0.1)})
    assert [v.verdict for v in (*near, *far)] == ["consistent", "shifted"]


@pytest.mark.parametrize("free", [False, True])
def test_without_process_noise_it_is_output_error(free):
    """The figures of `fit_manoeuvres`: the same problem in other coordinates."""
    record = still_air(4)
    names = ("V", "alpha", "theta", "q") if free else ()
    expected = fit_manoeuvres([manoeuvre(record, free=names)], flight_parameters(1.1), estimate_noise=False)
    model = flight_model(aircraft(), IN_PLANE, CHANNELS)
    start = flight_start(aircraft(), FLIGHT_START, IN_PLANE, np.zeros(len(aircraft().parameter_names)))
    found = filter_error(
        model,
        [record],
        [start],
        flight_parameters(1.1),
        free_start=IN_PLANE if free else (),
        estimate_noise=False,
    )
    for name in TRUTH:
        apart = (found[name].value - expected[name].value) / expected[name].standard_error
        assert abs(apart) < 2e-3
        assert found[name].standard_error == pytest.approx(expected[name].standard_error, rel=1e-3)


def test_process_noise_that_is_not_there_is_found_to_be_none():
    w, rate = (np.zeros(400) for _ in range(2))
    model = short_period()
    time = STEP * np.arange(400)
    control = 0.05 * np.sign(np.sin(1.7 * time))
    x, states = np.zeros(2), []
    given = np.array([control, *(np.full(400, v) for v in TRUE.values())]).T
    for k in range(400):
        states.append(x)
        if k < 399:
            x = model.advance(x, given[k], given[k + 1], STEP, 0.0)[0]
    w, rate = np.array(states).T
    rng = np.random.default_rng(3)
    channels = {"alpha": w + SD["alpha"] * rng.standard_normal(400), "q": rate + SD["q"] * rng.standard_normal(400)}
    record = FlightRecord(time, channels, {"elevator": control}, SD)
    found = fit(record)
    none = fit(record, intensities=False)
    for name in TRUE:
        assert abs(found[name].value - none[name].value) < none[name].standard_error
    small = [f for f in found.findings if "show no intensity" in f]
    left = [e for e in found.estimates if e.name.startswith("intensity") and e.value > 2.0 * e.standard_error]
    assert small
    assert not left


def coverage(found_of, names, runs, truth):
    """How often 95% intervals hold the truth, and standard errors over scatter, of each name."""
    values, errors = np.zeros((2, runs, len(names)))
    for seed in range(runs):
        found = found_of(seed)
        values[seed] = [found[name].value for name in names]
        errors[seed] = [found[name].standard_error for name in names]
    true = np.array([truth[name] for name in names])
    held = np.abs(values - true) <= 1.96 * errors
    return np.count_nonzero(held, axis=0), errors.mean(axis=0) / values.std(axis=0, ddof=1)


def test_in_turbulence_intervals_of_filter_error_hold_and_those_of_output_error_do_not():
    """40 and 15 records of a short period; binomial bounds at 0.1% a parameter."""
    runs, fewer = 40, 15
    held, _ = coverage(lambda seed: fit(simulated(seed, n=300)[0]), list(TRUE), runs, TRUE)
    assert np.all(held >= binom.ppf(0.001, runs, 0.95))
    plain, _ = coverage(lambda seed: fit(simulated(seed, n=300)[0], intensities=False), list(TRUE), fewer, TRUE)
    assert np.min(plain) < binom.ppf(0.001, fewer, 0.95)


TURBULENCE = {"w": 0.3, "q": 0.02}


@cache
def turbulent_model():
    return flight_model(aircraft(), IN_PLANE, CHANNELS, intensity=TURBULENCE)


def turbulent(seed, samples=250, duration=10.0):
    """The light aircraft's 3-2-1-1 with white accelerations, added 20 times an interval."""
    model, rng, fine = turbulent_model(), np.random.default_rng(seed), 20
    time = np.linspace(0.0, duration, samples)
    sampled = Signal(time, Signal.multistep(0.03, 0.7, 0.5).at(time)).value
    known = {**TRUTH, "elevator": 0.0}
    given = np.array([np.full(samples, known[name]) for name in model.parameter_names]).T
    given[:, model.parameter_names.index("elevator")] = sampled
    start = flight_start(aircraft(), FLIGHT_START, IN_PLANE, np.zeros(len(model.parameter_names)))
    x, seen = np.array(list(start.values())), []
    h = duration / (samples - 1) / fine
    for k in range(samples):
        seen.append(model.outputs(x, given[k], 0.0)[0])
        for i in range(fine if k < samples - 1 else 0):
            ends = [given[k] + share * (given[k + 1] - given[k]) for share in (i / fine, (i + 1) / fine)]
            x = model.advance(x, *ends, h, 0.0)[0] + model.intensity * np.sqrt(h) * rng.standard_normal(4)
    values = np.array(seen) + rng.standard_normal((samples, 4)) * [NOISE[c] for c in CHANNELS]
    return FlightRecord(time, {c: values[:, i] for i, c in enumerate(CHANNELS)}, {"elevator": sampled}, NOISE), start


def turbulent_fit(seed):
    record, start = turbulent(seed)
    own = [*flight_parameters(), *(Parameter(f"intensity_{name}", 0.7 * value) for name, value in TURBULENCE.items())]
    return filter_error(turbulent_model(), [record], [start], own)


def test_the_derivatives_of_an_aircraft_come_out_of_turbulence():
    found = turbulent_fit(0)
    for name, true in {**TRUTH, **{f"intensity_{n}": v for n, v in TURBULENCE.items()}}.items():
        assert abs(found[name].value - true) < 4.0 * found[name].standard_error
    assert found.filters[0].consistency().consistent


@pytest.mark.slow
def test_coverage_in_turbulence_over_200_records():
    """An aircraft's derivatives: filter error 90 to 98%, standard errors within 15% of the scatter; output error,
    white or with a model of its residuals' memory, not."""
    runs, names = 200, list(TRUTH)
    held, ratio = coverage(turbulent_fit, names, runs, TRUTH)
    print("filter error", dict(zip(names, zip(held / runs, ratio, strict=True), strict=True)))
    for colour in (False, True):

        def output_error(seed, colour=colour):
            return fit_manoeuvres([manoeuvre(turbulent(seed)[0], free=())], flight_parameters(), colour=colour)

        plain, apart = coverage(output_error, names, runs, TRUTH)
        print("output error", colour, dict(zip(names, zip(plain / runs, apart, strict=True), strict=True)))
        assert np.min(plain) < 0.9 * runs
    assert np.all(held >= 0.9 * runs)
    assert np.all(held <= 0.985 * runs)
    np.testing.assert_allclose(ratio, 1.0, atol=0.15)


def test_a_parameter_of_each_record_and_a_prior():
    first, second = simulated(1)[0], simulated(2)[0]
    own = [Parameter("stiffness", -4.0), Parameter("damping", -1.2, per_record=True), Parameter("power", -3.0)]
    own[2] = Parameter("power", -2.0, prior=(-2.0, 1e-4))
    found = filter_error(
        linear_noise(), [first, second], [START, START], own, start_errors=ERRORS, estimate_noise=False
    )
    assert [e.name for e in found.estimates] == ["stiffness", "damping[0]", "damping[1]", "power"]
    assert abs(found["power"].value + 2.0) < 2e-4
    assert found["power"].standard_error == pytest.approx(1e-4, rel=1e-3)
    alone = filter_error(
        linear_noise(),
        [first],
        [START],
        [own[1]],
        start_errors=ERRORS,
        estimate_noise=False,
        known={"stiffness": found["stiffness"].value, "power": found["power"].value},
    )
    assert alone["damping"].value == pytest.approx(
        found["damping[0]"].value, abs=0.01 * alone["damping"].standard_error
    )


def linear_noise():
    return short_period(**dict(zip(NAMES, INTENSITY, strict=True)))


def test_what_is_wrong_is_told():
    record, _ = simulated(1)
    with pytest.raises(InputError, match="no parameter 'stifness'"):
        filter_error(short_period(), [record], [START], [Parameter("stifness", 1.0)], known=TRUE)
    with pytest.raises(InputError, match="both known and unknown"):
        filter_error(short_period(), [record], [START], unknowns(), known={"damping": 1.0})
    with pytest.raises(InputError, match="start of intensity_w is -1"):
        filter_error(short_period(), [record], [START], [Parameter("intensity_w", -1.0)], known=TRUE)
    with pytest.raises(InputError, match="channel q does not change"):
        fit(record.with_channels(q=np.zeros(200)))
    still = FlightRecord(record.time, dict(record.channels), {"elevator": np.zeros(200)}, SD)
    with pytest.raises(InputError, match="power has no effect"):
        fit(still)
    with pytest.raises(DivergenceError, match="breaks down at the start values"):
        filter_error(
            short_period(), [record], [START], [Parameter("stiffness", 1e9)], known={"damping": 1e9, "power": 1e9}
        )
    with pytest.raises(InputError, match="something unknown"):
        filter_error(linear_model(), [record], [START], [], estimate_noise=False)


@pytest.mark.parametrize("factor", [1.0 / 3.0, 3.0])
def test_a_start_far_off_leads_to_the_same_estimate(factor):
    record, _ = simulated(7, n=300)
    near, far = fit(record), fit(record, factor=factor)
    for e in near.estimates:
        assert abs(far[e.name].value - e.value) < 0.01 * e.standard_error
