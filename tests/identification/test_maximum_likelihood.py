"""Output error of several records: an aircraft's longitudinal motion, its derivatives as free symbols."""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import least_squares

from flightsim.support import FINNER
from identification.support import MODEL
from indicial.conventions import ReferenceQuantities
from indicial.errors import DivergenceError, InputError
from indicial.flightsim import ALPHA, BodyAxisAerodynamics, InitialState, Signal, Vehicle, build_dynamics, fly
from indicial.flightsim.signals import Schedule
from indicial.identification import (
    FlightRecord,
    Installation,
    Manoeuvre,
    Parameter,
    SensitivityModel,
    Sensor,
    fit_manoeuvres,
    maximum_likelihood,
    measure_flight,
)
from indicial.identification.coloured import autocorrelations, predictors, whiten
from indicial.identification.maximum_likelihood import Problem
from indicial.identification.start_state import StartState

TRUTH = {"CZ_alpha": -5.0, "Cm_alpha": -0.8, "Cm_q": -14.0, "Cm_elevator": -1.2}
CHANNELS = ("alpha", "q", "theta", "az")
NOISE = {"alpha": 0.002, "q": 0.003, "theta": 0.002, "az": 0.1}
START = InitialState.from_path(60.0, alpha=0.05)


@cache
def aircraft(twice=False):
    """With a derivative of the elevator that stands there twice, if asked."""
    reference = ReferenceQuantities(length=1.5, area=16.0, lateral_length=11.0, moment_reference=(0.0, 0.0, 0.0))
    vehicle = Vehicle(
        name="light aircraft",
        reference=reference,
        mass=1000.0,
        inertia=np.diag([1200.0, 1800.0, 2700.0]),
        centre_of_gravity=(0.0, 0.0, 0.0),
    )
    free = {name: ca.SX.sym(name) for name in TRUTH}
    model = BodyAxisAerodynamics(
        reference=reference,
        CD_0=0.05,
        CZ_0=-0.03,
        CZ_alpha=free["CZ_alpha"],
        Cm_alpha=free["Cm_alpha"],
        Cm_q=free["Cm_q"],
        Cm_0=0.04 + (free["Cm_elevator"] + (ca.SX.sym("Cm_tab") if twice else 0.0)) * ca.SX.sym("elevator"),
    )
    return build_dynamics(vehicle, model)


@cache
def compiled():
    return SensitivityModel.of(aircraft(), CHANNELS)


def simulated(seed=None, memory=0.0, truth=TRUTH, samples=250, duration=10.0, amplitude=0.03):
    """A record of a 3-2-1-1, its noise of first order with this correlation of neighbours."""
    time = np.linspace(0.0, duration, samples)
    sampled = Signal(time, Signal.multistep(amplitude, 0.7, 0.5).at(time))
    names = compiled().parameter_names
    schedule = Schedule.of(names, {**truth, "elevator": sampled})
    start = StartState.of(aircraft(), START, ())
    steps = np.ones(samples - 1, dtype=np.int64)
    none = np.full(len(names), -1, dtype=np.int64)
    state, _ = start.state(np.zeros(0))
    made = compiled().march(
        (state, np.zeros((state.size, 0))), schedule.at(0.0)[:, 0], schedule.drive, none, time, steps
    )
    outputs = made.outputs.copy()
    if seed is not None:
        rng = np.random.default_rng(seed)
        noise = rng.standard_normal(outputs.shape)
        for i in range(1, samples):
            noise[i] = memory * noise[i - 1] + np.sqrt(1.0 - memory**2) * noise[i]
        outputs += noise * np.array([NOISE[c] for c in CHANNELS])
    channels = {c: outputs[:, i] for i, c in enumerate(CHANNELS)}
    return FlightRecord(time, channels, {"elevator": sampled.value}, NOISE)


def manoeuvre(record, segments=1, name="record", free=("alpha", "theta", "q")):
    return Manoeuvre.of_flight(
        record, aircraft(), START, free_start=free, segments=segments, model=compiled(), name=name
    )


def parameters(factor=1.0, **changes):
    return [Parameter(name, factor * value, **changes) for name, value in TRUTH.items()]


def test_the_march_is_the_flight_that_fly_gives():
    record = simulated()
    signal = Signal(record.time, record["elevator"])
    flown = fly(aircraft(), START, record.time[-1], method="dop853", parameters={**TRUTH, "elevator": signal})
    last = flown.rate[-1, 1]
    assert record["q"][-1] == pytest.approx(last, abs=1e-6)


def test_sensitivities_equal_differences_of_high_order():
    problem = Problem([manoeuvre(simulated(), free=("V", "alpha", "theta", "q"))], parameters())
    slopes = problem.look(problem.start, None).marched[0].slopes
    exact = slopes[..., np.argsort(problem.records[0].where)]
    for j, value in enumerate(problem.start):
        h = np.zeros_like(problem.start)
        h[j] = 1e-3 * max(0.1, abs(value))
        near, far = (
            problem.look(problem.start + n * h, None).marched[0].outputs
            - problem.look(problem.start - n * h, None).marched[0].outputs
            for n in (1, 2)
        )
        difference = (8.0 * near - far) / (12.0 * h[j])
        scale = np.max(np.abs(exact[..., j]), axis=0)
        np.testing.assert_allclose(difference / scale, exact[..., j] / scale, atol=1e-7, err_msg=problem.names[j])


def test_what_the_engine_finds_is_what_scipy_finds():
    """Same weights, no noise model: one and the same least-squares problem."""
    problem = Problem([manoeuvre(simulated(1))], parameters())
    found = fit_manoeuvres([manoeuvre(simulated(1))], parameters(), estimate_noise=False)
    sigma = np.array([NOISE[c] for c in CHANNELS])

    def residuals(x):
        return (problem.residuals(problem.look(x, None), 0) / sigma).ravel()

    best = least_squares(
        residuals, problem.start, x_scale=np.maximum(np.abs(problem.start), 0.1), xtol=1e-14, ftol=1e-14
    )
    values = [e.value for e in (*found.parameters, *found.start_values)]
    errors = np.sqrt(np.diag(found.covariance))
    np.testing.assert_allclose((values - best.x) / errors, 0.0, atol=2e-3)
    np.testing.assert_allclose(errors, np.sqrt(np.diag(np.linalg.inv(best.jac.T @ best.jac))), rtol=1e-3)


def test_parameters_of_one_effect_are_fitted_as_their_sum_and_named():
    """Exactly the same sensitivities: the fit is that of the sum, whose error is told beside the two that are lost."""
    record = simulated(seed=4)
    alone = fit_manoeuvres([manoeuvre(record)], parameters(1.1), threads=1)
    both = Manoeuvre.of_flight(record, aircraft(twice=True), START, free_start=("alpha", "theta", "q"))
    found = fit_manoeuvres([both], [*parameters(1.1), Parameter("Cm_tab", 0.3)], threads=1)
    total, error = found["Cm_elevator"].value + found["Cm_tab"].value, alone["Cm_elevator"].standard_error
    assert total == pytest.approx(alone["Cm_elevator"].value, abs=1e-2 * error)
    for name in ("CZ_alpha", "Cm_alpha", "Cm_q"):
        assert found[name].value == pytest.approx(alone[name].value, abs=1e-2 * alone[name].standard_error)
        assert found[name].standard_error == pytest.approx(alone[name].standard_error, rel=1e-2)
    (finding,) = found.findings
    assert all(part in finding for part in ("cannot separate", "Cm_elevator", "Cm_tab"))
    told = float(finding.split("sum, +- ")[1].split(":")[0])
    assert told == pytest.approx(error, rel=0.1)
    assert min(found["Cm_tab"].standard_error, found["Cm_elevator"].standard_error) > 1e4 * error


def test_steps_too_long_for_the_motion_are_told_with_those_that_are_not():
    """Of a record every 0.25 s of an exact flight: one step an interval misses the truth, the number told finds it."""
    fine = simulated(samples=801, duration=20.0)
    channels = {c: fine[c][::10] for c in CHANNELS}
    record = FlightRecord(fine.time[::10], channels, {"elevator": fine["elevator"][::10]}, NOISE)
    known = {"elevator": Signal(fine.time, fine["elevator"])}

    def fitted(steps):
        coarse = replace(record, inputs={})
        m = Manoeuvre.of_flight(coarse, aircraft(), START, known=known, model=compiled(), steps_per_interval=steps)
        return fit_manoeuvres([m], parameters(1.05), estimate_noise=False, threads=1)

    def off(found):
        return max(abs(found[n].value - v) / found[n].standard_error for n, v in TRUTH.items())

    long = fitted(1)
    (finding,) = long.findings
    enough = int(finding.rsplit(" ", 1)[1])
    short = fitted(2 * enough)
    assert "steps of record are long" in finding
    assert not short.findings
    assert off(short) < 0.2 < 0.5 < off(long)  # what is left is the jumps of the control, on which no step ends


@pytest.mark.parametrize("factor", [1.0 / 3.0, 3.0])
@pytest.mark.parametrize("segments", [1, 10])
def test_a_start_a_factor_three_off_finds_the_truth_of_records_without_noise(factor, segments):
    found = fit_manoeuvres([manoeuvre(simulated(), segments)], parameters(factor), estimate_noise=False)
    for name, value in TRUTH.items():
        assert found[name].value == pytest.approx(value, rel=1e-5), name


def corner(signs):
    """Each derivative three times too large or too small."""
    return [Parameter(n, v * (3.0 if signs >> i & 1 else 1.0 / 3.0)) for i, (n, v) in enumerate(TRUTH.items())]


@pytest.mark.parametrize("signs", range(16))
def test_from_all_starts_a_factor_three_off_segments_find_the_estimate_and_a_single_shot_finds_it_or_says_no(signs):
    record = simulated(8)
    wanted = fit_manoeuvres([manoeuvre(record)], parameters())
    found = [fit_manoeuvres([manoeuvre(record, 10)], corner(signs))]
    try:
        found.append(fit_manoeuvres([manoeuvre(record)], corner(signs)))
    except DivergenceError as error:
        assert "divide the record into segments" in str(error)  # noqa: PT017
    for fit in found:
        for name in TRUTH:
            assert abs(fit[name].value - wanted[name].value) < 0.01 * wanted[name].standard_error, name


def test_multiple_shooting_of_an_unstable_aircraft_finds_what_a_single_shot_finds():
    """From a start that takes the aircraft for stable: seams change the way to the estimate, not the estimate."""
    unstable = TRUTH | {"Cm_alpha": 0.5}
    record = simulated(3, truth=unstable, samples=300, duration=2.5, amplitude=0.005)
    start = [Parameter(name, -0.8 if name == "Cm_alpha" else value) for name, value in TRUTH.items()]
    one, many = (fit_manoeuvres([manoeuvre(record, segments)], start) for segments in (1, 12))
    for name, value in unstable.items():
        error = one[name].standard_error
        assert abs(many[name].value - value) < 4.0 * error, name
        assert many[name].value == pytest.approx(one[name].value, abs=1e-3 * error), name


def held_by_feedback(duration, samples, seed):
    """A record of an unstable aircraft whose elevator answers to the angle of attack; the elevator is recorded."""
    truth, gain = TRUTH | {"Cm_alpha": 0.5}, 1.2
    values = {name: value for name, value in truth.items() if name != "Cm_elevator"}
    moving = ca.SX.sym("excitation") + gain * (ALPHA - 0.05)
    held = replace(aircraft().aerodynamics, **values, Cm_0=0.04 + truth["Cm_elevator"] * moving)
    time = np.linspace(0.0, duration, samples)
    excitation = Signal(time, 0.02 * np.sin(1.3 * time) + 0.015 * np.sin(2.9 * time + 1.0))
    flown = fly(
        build_dynamics(aircraft().vehicle, held),
        START,
        duration,
        method="dop853",
        step=duration / (samples - 1),
        tolerance=1e-11,
        parameters={"excitation": excitation},
    ).at_times(time)
    exact = {"alpha": flown.alpha, "q": flown.rate[:, 1], "theta": flown.euler[:, 1], "V": flown.speed}
    exact["az"] = flown.force[:, 2] / aircraft().vehicle.mass
    noise = NOISE | {"V": 0.1}
    rng = np.random.default_rng(seed)
    channels = {c: values + noise[c] * rng.standard_normal(samples) for c, values in exact.items()}
    return FlightRecord(time, channels, {"elevator": excitation.at(time) + gain * (flown.alpha - 0.05)}, noise), truth


def test_segments_save_a_long_record_of_an_unstable_aircraft_where_one_shot_is_lost():
    record, truth = held_by_feedback(20.0, 1001, seed=1)
    model = SensitivityModel.of(aircraft(), tuple(record.channels))
    start = [Parameter(name, 0.8 * value) for name, value in truth.items()]

    def shot(segments):
        free = ("alpha", "theta", "q", "V")
        return Manoeuvre.of_flight(record, aircraft(), START, free_start=free, segments=segments, model=model)

    with pytest.raises(DivergenceError, match="segments"):
        fit_manoeuvres([shot(1)], start)
    found = fit_manoeuvres([shot(40)], start)
    for name, value in truth.items():
        assert abs(found[name].value - value) < 4.0 * found[name].standard_error, name


def test_records_share_parameters_and_threads_change_nothing():
    records = [manoeuvre(simulated(seed), name=f"r{seed}") for seed in (1, 2, 3)]
    one = fit_manoeuvres(records, parameters(), threads=1)
    two = fit_manoeuvres(records, parameters(), threads=2)
    np.testing.assert_array_equal(one.covariance, two.covariance)
    alone = fit_manoeuvres(records[:1], parameters())
    ratio = alone["Cm_q"].standard_error / one["Cm_q"].standard_error
    assert ratio == pytest.approx(np.sqrt(3.0), rel=0.2)
    own = fit_manoeuvres(records, [*parameters()[:3], Parameter("Cm_elevator", -1.0, per_record=True)])
    assert own["Cm_elevator[r2]"].value == pytest.approx(-1.2, abs=4 * own["Cm_elevator[r2]"].standard_error)


def test_a_prior_and_a_record_weigh_as_two_measurements_do():
    """A prior far tighter than the record gives its own mean and error back; a loose one changes nothing."""
    tight = [*parameters()[:3], Parameter("Cm_elevator", -1.2, prior=(-1.25, 1e-6))]
    found = fit_manoeuvres([manoeuvre(simulated(1))], tight)
    assert found["Cm_elevator"].value == pytest.approx(-1.25, abs=1e-5)
    assert found["Cm_elevator"].standard_error == pytest.approx(1e-6, rel=1e-3)
    loose = [*parameters()[:3], Parameter("Cm_elevator", -1.2, prior=(-1.25, 1e3))]
    without = fit_manoeuvres([manoeuvre(simulated(1))], parameters())
    assert fit_manoeuvres([manoeuvre(simulated(1))], loose)["Cm_elevator"].value == pytest.approx(
        without["Cm_elevator"].value, rel=1e-6
    )


@pytest.mark.parametrize("reflection", [[0.9], [0.9, -0.5], [0.7, 0.2, -0.6]])
def test_the_filter_makes_coloured_noise_white_exactly(reflection):
    """Its matrix W satisfies W C W' = 1 for the noise's covariance C, the first samples and gaps included."""
    n, reflection = 14, np.array(reflection)
    known = np.ones(n, dtype=bool)
    known[[1, 5, 8, 9, 10]] = False
    filtering = whiten(np.eye(n), reflection, known)[known][:, known]
    phi, _ = predictors(reflection)[-1]
    lags = list(autocorrelations(reflection))
    while len(lags) < n:
        lags.append(sum(c * lags[-i] for i, c in enumerate(phi, start=1)))
    covariance = np.array(lags)[np.abs(np.subtract.outer(np.arange(n), np.arange(n)))][np.ix_(known, known)]
    np.testing.assert_allclose(filtering @ covariance @ filtering.T, np.eye(n - 5), atol=1e-12)
    np.testing.assert_allclose(np.triu(filtering, 1), 0.0)  # from those before


def test_predictors_solve_the_equations_of_yule_and_walker():
    phi, variance = predictors(np.array([0.8, -0.3]))[-1]
    rho1 = phi[0] / (1.0 - phi[1])
    rho2 = phi[0] * rho1 + phi[1]
    assert rho1 == pytest.approx(0.8)
    assert variance == pytest.approx(1.0 - phi[0] * rho1 - phi[1] * rho2)


def scaled_errors(seeds, memory):
    errors, reported = [], []
    for seed in seeds:
        found = fit_manoeuvres([manoeuvre(simulated(seed, memory, samples=500))], parameters(), threads=1)
        errors.append([found[n].value - v for n, v in TRUTH.items()])
        reported.append([found[n].standard_error for n in TRUTH])
    return np.array(errors), np.array(reported)


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_errors_are_of_the_size_reported(memory):
    from scipy.stats import chi2

    n = 24
    errors, reported = scaled_errors(range(n), memory)
    low, high = chi2.ppf([0.0005, 0.9995], n) / n
    size = np.mean((errors / reported) ** 2, axis=0)
    assert np.all((size > low) & (size < high))


@pytest.mark.slow
@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_intervals_cover_and_standard_errors_match_the_scatter(memory):
    errors, reported = scaled_errors(range(1000, 1200), memory)
    coverage = np.mean(np.abs(errors / reported) < 1.96, axis=0)
    assert np.all((coverage >= 0.90) & (coverage <= 0.98))
    np.testing.assert_allclose(reported.mean(axis=0), errors.std(axis=0), rtol=0.15)


def test_dropouts_outliers_and_a_bias():
    record = simulated(5)
    alpha = record["alpha"] + 0.01
    alpha[40:60] = np.nan
    q = record["q"].copy()
    q[100] += 0.1
    spoilt = record.with_channels(alpha=alpha, q=q)
    model = SensitivityModel.of(aircraft(), CHANNELS, ["alpha"])
    m = Manoeuvre.of_flight(
        spoilt, aircraft(), START, free_start=("alpha", "theta", "q"), biases=["alpha"], model=model
    )
    found = fit_manoeuvres([m], [*parameters(), Parameter("bias_alpha", 0.0)])
    assert found["bias_alpha"].value == pytest.approx(0.01, abs=4 * found["bias_alpha"].standard_error)
    assert any("channel q" in text for text in found.suspicious())
    assert found.against({"Cm_q": -14.0, "CZ_alpha": -9.0, "Cm_alpha": (-0.8, 0.1)})[1].verdict == "shifted"
    assert "Cm_q" in found.summary()


def spoilt_record(seed, memory=0.0):
    """Each channel with 3% of its samples off by 8 to 30 standard deviations."""
    record, random = simulated(seed, memory, samples=500), np.random.default_rng(seed)
    channels = {}
    for name, sd in NOISE.items():
        rows = random.choice(len(record), 15, replace=False)
        channels[name] = record[name].copy()
        channels[name][rows] += sd * random.uniform(8.0, 30.0, 15) * random.choice([-1.0, 1.0], 15)
    return record, record.with_channels(**channels)


def fitted_without_outliers(record):
    """Outliers left out until none is told, as a user would."""
    fit = fit_manoeuvres([manoeuvre(record)], parameters())
    for _ in range(6):
        records = fit.without_outliers()
        if all(
            np.array_equal(a.measured, b.measured, equal_nan=True) for a, b in zip(records, fit.manoeuvres, strict=True)
        ):
            return fit
        fit = fit_manoeuvres(records, parameters())
    return fit


@pytest.mark.parametrize(("memory", "worse"), [(0.0, 2.0), (0.9, 1.0)])
def test_without_outliers_a_fit_is_that_of_the_sound_record(memory, worse):
    sound, spoilt = spoilt_record(3, memory)
    clean = fit_manoeuvres([manoeuvre(sound)], parameters())
    kept = fit_manoeuvres([manoeuvre(spoilt)], parameters())
    found = fitted_without_outliers(spoilt)
    gone = np.isnan(found.manoeuvres[0].measured)
    put = manoeuvre(spoilt).measured != manoeuvre(sound).measured
    assert np.count_nonzero(gone & ~put) <= 0.01 * put.size
    assert np.count_nonzero(put & ~gone) <= 2  # 60 of 8 standard deviations, less what noise took
    for name in TRUTH:
        error = clean[name].standard_error
        assert abs(found[name].value - clean[name].value) < 1.0 * error
        assert found[name].standard_error == pytest.approx(error, rel=0.25)
    assert sum(kept[n].standard_error for n in TRUTH) > worse * sum(clean[n].standard_error for n in TRUTH)


def test_outliers_of_one_record_are_taken_from_that_record():
    sound = [simulated(seed) for seed in (11, 12)]
    q = sound[1]["q"].copy()
    q[77] += 0.2
    records = [manoeuvre(sound[0], name="a"), manoeuvre(sound[1].with_channels(q=q), name="b")]
    left = fit_manoeuvres(records, parameters()).without_outliers()
    assert not np.isnan(left[0].measured).any()
    np.testing.assert_array_equal(np.argwhere(np.isnan(left[1].measured)), [[77, CHANNELS.index("q")]])


@pytest.mark.slow
@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_intervals_cover_without_outliers(memory):
    errors, reported = [], []
    for seed in range(200):
        found = fitted_without_outliers(spoilt_record(seed, memory)[1])
        errors.append([found[n].value - v for n, v in TRUTH.items()])
        reported.append([found[n].standard_error for n in TRUTH])
    errors, reported = np.array(errors), np.array(reported)
    held = np.mean(np.abs(errors / reported) < 1.96, axis=0)
    ratio = reported.mean(axis=0) / errors.std(axis=0)
    assert np.all((held >= 0.90) & (held <= 0.98)), (held, ratio)
    np.testing.assert_allclose(ratio, 1.0, rtol=0.15, err_msg=str(held))


def test_wrong_units_and_signs_are_told():
    record = simulated(5)
    in_g = fit_manoeuvres([manoeuvre(record.with_channels(az=record["az"] / 9.80665))], parameters())
    (told,) = [text for text in in_g.suspicious() if "times the stated" in text]
    assert "channel az" in told
    assert "multiples of g" in told
    turned = fit_manoeuvres([manoeuvre(record.with_channels(az=-record["az"]))], parameters())
    assert any("az" in text and "the other sign" in text for text in turned.suspicious())
    with pytest.raises(InputError, match=r"alpha reaches .* are they deg"):
        manoeuvre(record.with_channels(alpha=np.degrees(record["alpha"])))
    spoilt = record["q"].copy()
    spoilt[::25] += 0.5
    outliers = fit_manoeuvres([manoeuvre(record.with_channels(q=spoilt))], parameters())
    assert any("channel q: 10 suspicious residuals" in text for text in outliers.suspicious())
    assert abs(outliers["Cm_q"].value - TRUTH["Cm_q"]) < 4.0 * outliers["Cm_q"].standard_error


def test_what_cannot_be_fitted_is_refused_in_words():
    record = simulated(5)
    with pytest.raises(InputError, match="Cm_q of record is neither known nor unknown"):
        fit_manoeuvres([manoeuvre(record)], [p for p in parameters() if p.name != "Cm_q"])
    with pytest.raises(InputError, match="in no record's model"):
        fit_manoeuvres([manoeuvre(record)], [*parameters(), Parameter("Cn_r", 1.0)])
    dead = record.with_channels(q=np.zeros(len(record)))
    with pytest.raises(InputError, match="channel q of record does not change"):
        fit_manoeuvres([manoeuvre(dead)], parameters())
    still = simulated(5, amplitude=0.0)
    with pytest.raises(InputError, match="Cm_elevator has no effect"):
        fit_manoeuvres([manoeuvre(still)], parameters())
    with pytest.raises(InputError, match="no start value Vx2"):
        manoeuvre(record, free=("Vx2",))


def test_a_range_model_is_seen_through_the_same_channels():
    dynamics = build_dynamics(FINNER, MODEL)
    model = SensitivityModel.of(dynamics, ("x", "yaw", "pitch"))
    state = dynamics.initial_vector(InitialState.from_path(686.0, alpha=0.02))
    assert model.view(state, ())[:3] == pytest.approx([0.0, 0.0, 0.02])


def test_noise_that_has_not_settled_is_told(monkeypatch):
    """Cut off after one round, in which colour is found for the first time."""
    m = manoeuvre(simulated(4, 0.9))
    assert not any("settled" in finding for finding in fit_manoeuvres([m], parameters()).findings)
    monkeypatch.setattr(maximum_likelihood, "_ROUNDS", 1)
    assert any("not settled" in finding for finding in fit_manoeuvres([m], parameters()).findings)


def test_instruments_at_their_place_show_what_a_measured_flight_has_there():
    """A rolling, sideslipping flight: accelerometers and vanes off the centre of gravity, upwash and sidewash."""
    vehicle = aircraft().vehicle
    place = Installation((0.4, -0.2, 0.3), (2.0, 0.5, -0.4), upwash=1.1, sidewash=0.95)
    start = InitialState.from_path(60.0, alpha=0.05, beta=0.03, rate=(0.4, 0.1, -0.2))
    schedule = Signal(np.linspace(0.0, 4.0, 5), 0.02 * np.array([0.0, 1.0, -1.0, 1.0, 0.0]))
    flight = fly(aircraft(), start, 4.0, method="rk4", step=0.01, parameters={**TRUTH, "elevator": schedule})
    seen = ("V", "alpha", "beta", "p", "q", "r", "ax", "ay", "az", "dynamic_pressure")
    sensors = {name: Sensor(100.0) for name in seen}
    record = measure_flight(flight, vehicle, sensors, seed=None, inputs={"elevator": schedule}, installation=place)
    m = Manoeuvre.of_flight(record, aircraft(), start, channels=seen, known=TRUTH, installation=place)
    values, drive = m.schedule([])
    shown = m.fly(values, drive, np.full(values.size, -1, dtype=np.int64), np.zeros(0)).outputs
    for i, name in enumerate(seen):
        np.testing.assert_allclose(shown[:, i], record[name], rtol=1e-9, atol=1e-9, err_msg=name)
