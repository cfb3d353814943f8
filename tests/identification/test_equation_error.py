"""Equation error on records made so that the equations hold exactly: the control is what the motion asks for."""

import math

import numpy as np
import pytest

from indicial.conventions import ReferenceQuantities
from indicial.derivatives import DerivativeTable
from indicial.errors import InputError
from indicial.flightsim import Vehicle
from indicial.identification import FlightRecord, aerodynamic_coefficient, diagnose, differentiate, equation_error
from indicial.identification.coefficients import polynomial_terms, regressor
from indicial.identification.instruments import gauss_markov
from indicial.identification.least_squares import coloured_covariance, solve

REFERENCE = ReferenceQuantities(2.0, 16.0, moment_reference=(3.1, 0.1, 0.2), lateral_length=8.0)
INERTIA = np.array([[1000.0, 20.0, -150.0], [20.0, 3000.0, 30.0], [-150.0, 30.0, 3500.0]])
PLANE = Vehicle("plane", 1200.0, INERTIA, REFERENCE, (3.0, 0.0, 0.0))
TRUTH = {"Cm_0": 0.03, "Cm_alpha": -0.8, "Cm_q": -12.0, "Cm_elevator": -1.1}
LIFT = {"CZ_0": -0.2, "CZ_alpha": -4.5, "CZ_elevator": -0.4}
THRUST = 2500.0
REGRESSORS = ("alpha", "q", "elevator")
BAND = (0.12, 1.6)


def waves(time, *parts):
    """Sums of ``amplitude sin(2 pi f t + phase)`` and their slopes."""
    value = sum(a * np.sin(2.0 * math.pi * f * time + g) for a, f, g in parts)
    slope = sum(a * 2.0 * math.pi * f * np.cos(2.0 * math.pi * f * time + g) for a, f, g in parts)
    return value, slope


def manoeuvre(number=400, duration=10.0, exact_rates=False):
    """Motion in all axes, moments by Euler's equations, and the elevator that these moments ask for."""
    time = np.arange(number) * duration / number
    rates = [
        waves(time, (0.3, 0.31, 0.2), (0.1, 0.9, 1.0)),
        waves(time, (0.2, 0.47, 0.0), (0.1, 0.83, 2.0), (0.05, 1.3, 0.5)),
        waves(time, (0.1, 0.2, 0.7)),
    ]
    omega, turning = (np.stack([rate[i] for rate in rates], axis=1) for i in (0, 1))
    alpha, _ = waves(time, (0.05, 0.39, 0.4), (0.03, 1.1, 1.9))
    speed = 60.0 + 2.0 * np.sin(0.7 * time)
    loads = 0.6 * speed**2 * REFERENCE.area
    # CZ holds the elevator, which holds the moment of the force about the reference point: solve the two together.
    force_x, force_y = loads * -0.05 + 100.0 * np.sin(time), 50.0 * np.cos(1.7 * time)
    about_cg = turning @ INERTIA + np.cross(omega, omega @ INERTIA)
    arm = np.array([-0.1, 0.1, -0.2])  # reference point from the centre of gravity, body axes
    rest = TRUTH["Cm_0"] + TRUTH["Cm_alpha"] * alpha + TRUTH["Cm_q"] * omega[:, 1] * 2.0 / (2.0 * speed)
    scale = loads * REFERENCE.length
    # (r x F)_y = r_z F_x - r_x F_z, F_z = loads (CZ_0 + CZ_alpha alpha + CZ_elevator e)
    without = loads * (LIFT["CZ_0"] + LIFT["CZ_alpha"] * alpha)
    known = about_cg[:, 1] - (arm[2] * force_x - arm[0] * without) - scale * rest
    elevator = known / (scale * TRUTH["Cm_elevator"] - arm[0] * loads * LIFT["CZ_elevator"])
    force_z = without + loads * LIFT["CZ_elevator"] * elevator
    channels = {"V": speed, "dynamic_pressure": 0.6 * speed**2, "alpha": alpha, "mach": speed / 340.0}
    channels |= dict(zip("pqr", omega.T, strict=True))
    channels |= {"ax": (force_x + THRUST) / 1200.0, "ay": force_y / 1200.0, "az": force_z / 1200.0}
    if exact_rates:
        channels |= dict(zip(("pdot", "qdot", "rdot"), turning.T, strict=True))
    return FlightRecord(time, channels, {"elevator": elevator})


def fit(record, coefficient="Cm", regressors=REGRESSORS, **options):
    return equation_error(record, PLANE, coefficient, regressors, thrust=THRUST, **options)


def errors_of(result, truth):
    return np.array([e.value - truth[e.name] for e in result.estimates])


def test_slopes_are_exact_for_cubics_at_uneven_samples_around_dropouts():
    time = np.sort(np.random.default_rng(1).uniform(0.0, 3.0, 60)) + 0.05 * np.arange(60)
    values = 1e3 + 2.0 * time - time**2 + 0.3 * time**3
    values[[0, 20, 40]] = np.nan
    slopes = differentiate("q", time, values)
    known = np.isfinite(slopes)
    assert not known[[0, 20, 40]].any()
    assert known.sum() == 57
    np.testing.assert_allclose(slopes[known], (2.0 - 2.0 * time + 0.9 * time**2)[known], rtol=1e-9, atol=1e-9)


def test_slopes_converge_with_fourth_order_inside_and_third_at_the_ends():
    worst = []
    for number in (100, 200, 400):
        time = np.linspace(0.0, 2.0, number + 1)
        error = np.abs(differentiate("q", time, np.sin(3.0 * time)) - 3.0 * np.cos(3.0 * time))
        worst.append((np.max(error[3:-3]), np.max(error)))
    orders = np.log2(np.array(worst[:-1]) / np.array(worst[1:]))
    np.testing.assert_allclose(orders[:, 0], 4.0, atol=0.1)
    assert np.all(orders[:, 1] > 2.9)


def test_noise_of_slopes_is_what_is_said():
    noise = np.random.default_rng(2).standard_normal(200_000)
    slopes = differentiate("q", 0.1 * np.arange(noise.size), noise)
    assert np.var(slopes) == pytest.approx(0.263 * 100.0, rel=0.02)


@pytest.mark.parametrize("band", [None, BAND])
def test_exact_angular_accelerations_give_exact_derivatives(band):
    for coefficient, names, truth in (("Cm", REGRESSORS, TRUTH), ("CZ", ("alpha", "elevator"), LIFT)):
        result = fit(manoeuvre(exact_rates=True), coefficient, names, band=band)
        assert [e.name for e in result.estimates] == list(truth)[0 if band is None else 1 :]
        np.testing.assert_allclose(errors_of(result, truth), 0.0, atol=1e-10)
        assert result.r_squared == pytest.approx(1.0)


@pytest.mark.parametrize("band", [None, BAND])
def test_derivatives_converge_with_the_order_of_the_slopes(band):
    sizes = [np.linalg.norm(errors_of(fit(manoeuvre(n), band=band), TRUTH)) for n in (200, 400, 800)]
    assert np.all(np.log2(np.divide(sizes[:-1], sizes[1:])) > 3.0)
    assert sizes[-1] < 1e-3


def scatter(record, draw, coefficient, names, truth, seeds=200, **options):
    """Scatter of estimates, their mean reported variance as errors, and how often 1.96 of it holds the truth."""
    errors, reported = [], []
    for seed in range(seeds):
        noisy = record.with_channels(**draw(record, np.random.default_rng(seed)))
        result = fit(noisy, coefficient, names, **options)
        errors.append(errors_of(result, truth))
        reported.append([e.standard_error for e in result.estimates])
    errors, reported = np.array(errors), np.array(reported)
    rms = np.sqrt(np.mean(errors**2, axis=0))
    return rms, np.sqrt(np.mean(reported**2, axis=0)), np.mean(np.abs(errors) < 1.96 * reported, axis=0)


def white(record, random):
    return {"az": record["az"] + 0.3 * random.standard_normal(len(record))}


def coloured(record, random):
    return {"az": record["az"] + 0.3 * gauss_markov(len(record), -math.log(0.9), random)}


@pytest.mark.parametrize("band", [None, BAND])
@pytest.mark.parametrize("noise", [white, coloured])
def test_reported_errors_are_the_scatter(noise, band):
    # 200 seeds know a scatter within 5% (one standard deviation).
    record = manoeuvre(1500, 30.0)
    rms, reported, held = scatter(record, noise, "CZ", ("alpha", "elevator"), LIFT, band=band)
    np.testing.assert_allclose(reported, rms, rtol=0.15)
    assert np.all((held >= 0.90) & (held <= 0.98))


def test_errors_of_a_short_record_with_white_noise_are_those_of_white_noise():
    """A fit takes power from the residuals where its regressors have theirs; no colour is read into that."""
    t = 0.02 * np.arange(250)
    columns = np.column_stack([np.ones(250), np.sin(2.5 * t), np.cos(2.5 * t) + 0.4 * np.sin(6.9 * t), np.sin(1.7 * t)])
    scaled = []
    for seed in range(400):
        noise = np.random.default_rng(seed).standard_normal(250)
        values, inverse = solve(columns, noise)
        covariance, _ = coloured_covariance(columns, noise - columns @ values, inverse)
        scaled.append(values / np.sqrt(np.diag(covariance)))
    size = np.sqrt(np.mean(np.square(scaled), axis=0))
    assert np.all(np.abs(size - 1.0) < 0.12), size  # known within 3.5%


def test_white_errors_would_be_too_small_for_coloured_residuals():
    record = manoeuvre(1500, 30.0)
    noisy = record.with_channels(**coloured(record, np.random.default_rng(0)))
    result = fit(noisy, "CZ", ("alpha", "elevator"))
    columns = np.column_stack([np.ones(1500), record["alpha"], record["elevator"]])
    plain = np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)) * np.var(result.residuals))
    assert result.neighbours == pytest.approx(0.9, abs=0.03)
    assert all(e.standard_error > 1.5 * p for e, p in zip(result.estimates, plain, strict=True))


def test_dropouts_are_left_out():
    record = manoeuvre(800, exact_rates=True)
    alpha = record["alpha"].copy()
    alpha[100:130] = np.nan
    holed = record.with_channels(alpha=alpha)
    result = fit(holed)
    assert result.axis.size == 770
    np.testing.assert_allclose(errors_of(result, TRUTH), 0.0, atol=1e-9)
    with pytest.raises(InputError, match="evenly sampled, without dropouts"):
        fit(holed, band=BAND)


def test_coefficients_have_the_signs_and_lengths_of_the_convention():
    record = manoeuvre(exact_rates=True)
    at_cg = Vehicle("plane", 1200.0, INERTIA, REFERENCE.about((3.0, 0.0, 0.0)), (3.0, 0.0, 0.0))
    omega = np.stack([record[n] for n in "pqr"], axis=1)
    turning = np.stack([record[n + "dot"] for n in "pqr"], axis=1)
    moment = turning @ INERTIA + np.cross(omega, omega @ INERTIA)
    loads = record["dynamic_pressure"] * 16.0
    for axis, (name, length) in enumerate((("Cl", 8.0), ("Cm", 2.0), ("Cn", 8.0))):
        np.testing.assert_allclose(aerodynamic_coefficient(record, at_cg, name) * loads * length, moment[:, axis])
    axial = aerodynamic_coefficient(record, PLANE, "CA", thrust=THRUST)
    np.testing.assert_allclose(-axial * loads + THRUST, 1200.0 * record["ax"])


def test_regressors_are_products_of_powers():
    record = manoeuvre()
    made = regressor(record, "alpha^2*q*elevator", REFERENCE)
    expected = record["alpha"] ** 2 * record["q"] * 2.0 / (2.0 * record["V"]) * record["elevator"]
    np.testing.assert_allclose(made, expected, rtol=1e-12)
    assert polynomial_terms(("alpha", "q"), 2) == ("alpha", "q", "alpha^2", "alpha*q", "q^2")


def test_results_read_well():
    result = fit(manoeuvre())
    assert "Cm_alpha" in result.summary()
    table = result.table()
    assert isinstance(table, DerivativeTable)
    assert [d.name for d in table] == list(TRUTH)
    assert result["Cm_q"].value == pytest.approx(-12.0, rel=1e-3)
    for one in (result, fit(manoeuvre(), band=BAND)):
        assert len(one.plot().axes) == 2
    with pytest.raises(InputError, match="CZ_q was not estimated"):
        result["CZ_q"]


def test_without_regressors_the_coefficient_is_its_mean():
    record = manoeuvre()
    (constant,) = equation_error(record, PLANE, "Cm", ()).estimates
    assert constant.name == "Cm_0"
    assert constant.value == pytest.approx(np.nanmean(aerodynamic_coefficient(record, PLANE, "Cm")), rel=1e-12)


DEAD = np.full(400, np.nan)


@pytest.mark.parametrize(
    ("channels", "changes", "message"),
    [
        ({"beta": np.full(400, 0.01)}, {"regressors": ("alpha", "beta")}, "regressor beta does not change"),
        ({"beta": np.zeros(400)}, {"regressors": ("alpha", "beta")}, "regressor beta does not change"),
        ({"alpha": DEAD}, {}, "channel alpha of the flight record has no data"),
        ({"az": DEAD}, {}, "channel az of the flight record has no data"),
        ({"az": np.zeros(400)}, {"coefficient": "CZ"}, "CZ does not change in the record"),
        ({}, {"regressors": ("aoa",)}, "lacks aoa; it has V, dynamic_pressure"),
        ({}, {"regressors": (), "band": (0.1, 2.0)}, "in a band needs at least one regressor"),
        ({}, {"regressors": ("alpha", "alpha")}, "once each, not alpha, alpha"),
        ({}, {"regressors": ("alpha^-1",)}, "must be a whole number from 1, not '-1'"),
        ({}, {"coefficient": "CM"}, "'CM' is none of CX, CY"),
        ({}, {"band": (0.0, 2.0)}, "must lie within 0 and 20 Hz"),
        ({}, {"band": (0.1, 0.4)}, "needs 8 frequencies k/T between 0.1 and 0.4 Hz, not 4"),
        (
            {"V": np.full(400, 60.0), "q": np.sin(np.arange(400))},
            {"regressors": ("q", "q*V")},
            "q, q\\*V depend linearly",
        ),
        ({"dynamic_pressure": np.full(400, -1.0)}, {}, "must be positive"),
    ],
)
def test_bad_input_is_named_in_one_line(channels, changes, message):
    with pytest.raises(InputError, match=message) as caught:
        fit(manoeuvre().with_channels(**channels), **changes)
    assert "\n" not in str(caught.value)


def test_accelerometers_elsewhere_are_refused():
    record = manoeuvre()
    record.provenance["installation"] = {"accelerometers": (1.0, 0.0, 0.0)}
    with pytest.raises(InputError, match="az was measured at"):
        fit(record, "CZ", ("alpha",))


def outlying(record, random):
    """White noise, every thirtieth sample off by 10 to 30 times as much."""
    spoilt = white(record, random)["az"]
    rows = random.choice(len(record), len(record) // 30, replace=False)
    spoilt[rows] += 0.3 * random.uniform(10.0, 30.0, rows.size) * random.choice([-1.0, 1.0], rows.size)
    return {"az": spoilt}


def outlying_coloured(record, random):
    spoilt = coloured(record, random)["az"]
    rows = random.choice(len(record), len(record) // 60, replace=False)
    spoilt[rows] += 0.3 * random.uniform(10.0, 30.0, rows.size) * random.choice([-1.0, 1.0], rows.size)
    return {"az": spoilt}


# White outliers add (10 to 30)^2/3 times a white variance of 1/30 of the samples: errors 3.8 times as large; noise that
# remembers by 0.9 weighs 19 times as much at low frequency, of 1/60 they make 1.17 times as much.
@pytest.mark.parametrize(("draw", "sound", "worse"), [(outlying, white, 3.0), (outlying_coloured, coloured, 1.0)])
def test_without_outliers_errors_are_those_of_sound_records(draw, sound, worse):
    record = manoeuvre(1500, 30.0)
    names = ("alpha", "elevator")
    rms, reported, held = scatter(record, draw, "CZ", names, LIFT, leave_out_outliers=True)
    np.testing.assert_allclose(reported, rms, rtol=0.15)
    assert np.all((held >= 0.90) & (held <= 0.98))
    clean, *_ = scatter(record, sound, "CZ", names, LIFT)
    assert np.all(rms < 1.15 * clean)
    kept, *_ = scatter(record, draw, "CZ", names, LIFT, seeds=50)
    assert np.all(kept > worse * rms)


def test_outliers_are_told_and_named_when_left_out():
    record = manoeuvre(1500, 30.0)
    noisy = record.with_channels(**white(record, np.random.default_rng(3)))
    az = noisy["az"].copy()
    az[[200, 700, 701]] += 3.0, -4.0, 5.0
    spoilt = noisy.with_channels(az=az)
    kept = fit(spoilt, "CZ", ("alpha", "elevator"))
    assert kept.outliers == 2  # of the two side by side one hides behind the other
    assert "2 residuals look like outliers" in kept.summary()
    gone = fit(spoilt, "CZ", ("alpha", "elevator"), leave_out_outliers=True)
    np.testing.assert_allclose(gone.left_out, record.time[[200, 700, 701]])
    assert gone.outliers == 0
    assert "3 outliers left out, first at 4 s" in gone.summary()
    sound = fit(noisy, "CZ", ("alpha", "elevator"), leave_out_outliers=True)
    assert sound.left_out.size == 0
    with pytest.raises(InputError, match="in time only"):
        fit(spoilt, "CZ", ("alpha",), band=BAND, leave_out_outliers=True)
    az[::8] += 30.0
    with pytest.raises(InputError, match="of 1500 samples look like outliers"):
        fit(noisy.with_channels(az=az), "CZ", ("alpha", "elevator"), leave_out_outliers=True)


def test_spikes_of_regressors_and_rates_are_taken_out_of_the_record_first():
    record = manoeuvre(1500, 30.0)
    random = np.random.default_rng(4)
    sizes = {"alpha": 1e-4, "q": 1e-4, "az": 0.05}
    noisy = record.with_channels(**{n: record[n] + s * random.standard_normal(1500) for n, s in sizes.items()})
    spoilt = {n: noisy[n].copy() for n in sizes}
    for name, rows in (("alpha", [100, 800]), ("q", [400, 1200]), ("az", [600])):
        spoilt[name][rows] += 2000.0 * sizes[name]
    bad = noisy.with_channels(**spoilt)
    cleaned = diagnose(bad).cleaned()
    wanted = fit(noisy, regressors=REGRESSORS)
    errors = np.array([e.standard_error for e in wanted.estimates])
    values = np.array([e.value for e in wanted.estimates])
    off = [np.abs(np.array([e.value for e in fit(r).estimates]) - values) / errors for r in (bad, cleaned)]
    assert np.max(off[0]) > 10.0
    assert np.max(off[1]) < 1.0


def test_a_regressor_without_effect_is_found_to_have_none():
    held = 0
    for seed in range(40):
        noisy = (record := manoeuvre(1500, 30.0)).with_channels(**white(record, np.random.default_rng(seed)))
        one = fit(noisy, "CZ", ("alpha", "elevator", "r"))["CZ_r"]
        held += abs(one.value) < 1.96 * one.standard_error
    assert 34 <= held <= 40
