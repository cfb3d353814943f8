"""Range reduction by output error: one shot and several, coefficients that grow with the angle, true errors."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest
from scipy.stats import chi2

from flightsim.support import FINNER, derivative_model, first_order_lag
from identification.support import MODEL, TRUTH, flight, fly_range, range_model, truth
from indicial.errors import DivergenceError, InputError
from indicial.flightsim import TOTAL_ANGLE, End, InitialState, simulate
from indicial.identification import FREE_FLIGHT, Precision, RangeModel, identify, measure


@pytest.mark.parametrize("noise", ["stated", "estimated"])
def test_a_record_without_noise_gives_its_derivatives_back(noise):
    result = identify(measure(flight(), seed=None), FINNER, MODEL, noise=noise)
    for name in FREE_FLIGHT:
        assert result[name].value == pytest.approx(TRUTH[name], rel=1e-5), name
    np.testing.assert_allclose(result.fitted[0].position, flight().at_stations(result.records[0].x).position, atol=1e-6)


def test_roll_damping_and_cant_are_identified_from_roll():
    spun = fly_range(replace(MODEL, Cl_0=0.02), roll_rate=60.0)
    record = measure(spun, seed=None, roll=True)
    result = identify(record, FINNER, MODEL, (*FREE_FLIGHT, "Cl_p", "Cl_0"), noise="stated")
    for name, value in (TRUTH | {"Cl_0": 0.02}).items():
        assert result[name].value == pytest.approx(value, rel=1e-5), name
    assert "Cl_0" not in result.table().names()
    assert result["p"].value == pytest.approx(60.0, rel=1e-5)


def test_derivatives_about_another_point_than_the_centre_of_gravity_are_identified_there():
    reference = FINNER.reference.about((6.1 * 0.03, 0.0, 0.0))
    moved = derivative_model(reference=reference, Cm_alpha=-20.0)
    result = identify(measure(fly_range(moved), seed=None), FINNER, moved, noise="stated")
    assert result["Cm_alpha"].value == pytest.approx(-20.0, rel=1e-5)
    assert result["Cm_q+Cm_alphadot"].value == pytest.approx(-360.0, rel=1e-5)
    assert result.table().one("Cm_alpha").moment_reference_m == reference.moment_reference


def test_what_is_held_at_nought_for_want_of_knowledge_hardly_matters():
    """Nothing known at all: CN_q, CN_alphadot and the part of Cm_alphadot are held at 0."""
    result = identify(measure(flight(), seed=None), FINNER, noise="stated")
    for name in FREE_FLIGHT:
        assert abs(result[name].value - TRUTH[name]) < 0.3 * result[name].standard_error, name


def test_a_flight_with_lag_states_gives_the_derivatives_of_its_model_at_low_frequency():
    lagging = first_order_lag(0.15)
    low = lagging.quasi_steady()
    result = identify(measure(fly_range(lagging), seed=None), FINNER, low, noise="stated")
    wanted = {"CA_0": low.CA_0, "CN_alpha": low.CN_alpha, "Cm_alpha": low.Cm_alpha}
    wanted |= {"Cm_q+Cm_alphadot": low.Cm_q + low.Cm_alphadot}
    for name, value in wanted.items():
        assert result[name].value == pytest.approx(value, rel=2e-3), name
        assert abs(result[name].value - value) < 0.1 * result[name].standard_error, name


def normalised_errors(seeds):
    """Errors over reported standard errors (n, 4), and the errors and reported errors themselves."""
    true = truth(range_model().free)
    errors, reported = [], []
    for seed in seeds:
        result = identify(measure(flight(), seed=seed), FINNER, model=range_model(), threads=1)
        errors.append([e.value for e in result.derivatives] - true)
        reported.append([e.standard_error for e in result.derivatives])
    return np.array(errors) / np.array(reported), np.array(errors), np.array(reported)


def test_errors_have_unit_variance_and_no_bias_in_reported_standard_errors():
    n = 30
    scaled, _, _ = normalised_errors(range(n))
    low, high = chi2.ppf([0.0005, 0.9995], n) / n
    assert np.all((np.mean(scaled**2, axis=0) > low) & (np.mean(scaled**2, axis=0) < high))
    assert np.all(np.abs(scaled.mean(axis=0)) < 3.5 / math.sqrt(n))


@pytest.mark.slow
def test_over_200_records_standard_errors_match_the_scatter_and_intervals_cover():
    scaled, errors, reported = normalised_errors(range(200))
    np.testing.assert_allclose(reported.mean(axis=0), errors.std(axis=0), rtol=0.15)
    coverage = np.mean(np.abs(scaled) < 1.96, axis=0)
    assert np.all((coverage >= 0.90) & (coverage <= 0.98))


def test_noise_is_estimated_as_large_as_it_is_whatever_was_stated():
    true = Precision(position=2e-3, angle=math.radians(0.05))
    record = replace(measure(flight(), seed=5, precision=true), precision=Precision())
    noise = identify(record, FINNER, MODEL).noise
    # the standard deviation of some 50 numbers is known to 10%
    np.testing.assert_allclose(noise, true.of(record.channels), rtol=0.35)


def test_freeing_both_parts_of_the_damping_sum_is_told_apart_from_knowing_it():
    record = measure(flight(), seed=7)
    both = identify(record, FINNER, MODEL, ("CA_0", "CN_alpha", "Cm_alpha", "Cm_q", "Cm_alphadot"))
    text = "\n".join(both.fit.findings)
    assert "cannot separate Cm_q and Cm_alphadot" in text or "cannot separate Cm_alphadot and Cm_q" in text
    assert "identify the sum" in text
    alone = identify(record, FINNER, MODEL)
    assert alone.fit.findings == ()
    assert both["Cm_q"].standard_error > 20.0 * alone["Cm_q+Cm_alphadot"].standard_error
    total = both["Cm_q"].value + both["Cm_alphadot"].value
    assert total == pytest.approx(alone["Cm_q+Cm_alphadot"].value, abs=alone["Cm_q+Cm_alphadot"].standard_error)


@pytest.mark.parametrize("factor", [1.0 / 3.0, 3.0])
def test_a_start_far_from_the_truth_converges_or_says_so(factor):
    record = measure(flight(), seed=8)
    near = identify(record, FINNER, MODEL)
    start = {name: factor * TRUTH[name] for name in ("CA_0", "CN_alpha", "Cm_q+Cm_alphadot")}
    far = identify(record, FINNER, MODEL, start=start)
    for name in FREE_FLIGHT:
        assert far[name].value == pytest.approx(near[name].value, abs=1e-2 * near[name].standard_error), name


def test_a_hopeless_start_is_an_error_in_one_line():
    record = measure(flight(), seed=8)
    with pytest.raises(DivergenceError, match="start values") as caught:
        identify(record, FINNER, MODEL, start={"Cm_alpha": 4e3, "Vx": 1e-3})
    assert "\n" not in str(caught.value)


def test_what_cannot_be_identified_is_refused_in_words():
    record = measure(flight(), seed=1)
    with pytest.raises(InputError, match="Cl_p has no effect"):
        identify(record, FINNER, MODEL, (*FREE_FLIGHT, "Cl_p"))
    with pytest.raises(InputError, match="no derivative 'Cm_u'"):
        identify(record, FINNER, MODEL, ("Cm_u",))
    with pytest.raises(InputError, match="a sum without its parts"):
        identify(record, FINNER, MODEL, ("Cm_q", "Cm_q+Cm_alphadot"))
    with pytest.raises(InputError, match="start values of Cm_q given"):
        identify(record, FINNER, MODEL, start={"Cm_q": -300.0})
    with pytest.raises(InputError, match="noise is 'none'"):
        identify(record, FINNER, MODEL, noise="none")
    with pytest.raises(InputError, match="whether roll is measured"):
        identify(measure(flight(), seed=1, roll=True), FINNER, model=range_model())
    with pytest.raises(InputError, match="at least one record"):
        identify([], FINNER)


def test_the_result_speaks_for_itself():
    import matplotlib.pyplot as plt

    result = identify(measure(flight(), seed=1), FINNER, MODEL)
    assert "Cm_q+Cm_alphadot" in result.summary()
    assert "white" in result.summary()
    np.testing.assert_allclose(np.diag(result.correlation), 1.0)
    table = result.table()
    assert table.names() == tuple(e.name for e in result.derivatives)
    record = table.one("Cm_q+Cm_alphadot", method="identified")
    assert record.uncertainty == result["Cm_q+Cm_alphadot"].standard_error
    assert record.mach == pytest.approx(np.mean(flight().mach), rel=2e-3)
    figure = result.plot()
    assert len(figure.axes) == 3
    plt.close(figure)
    with pytest.raises(InputError, match="Cl_p was not identified"):
        result["Cl_p"]


GROWING = {"Cm_alpha3": -120.0, "CA_alpha2": 6.0}


def steep_shots(count, seed=None):
    """Shots at 4 to 9 degrees of a missile whose drag and restoring moment grow with the angle."""
    grown = ca.sin(TOTAL_ANGLE) ** 2
    model = replace(MODEL, Cm_alpha=MODEL.Cm_alpha + GROWING["Cm_alpha3"] * grown, CA_0=0.55 + 6.0 * grown)
    shots = []
    for i in range(count):
        start = InitialState.from_path(686.0, alpha=math.radians(4.0 + 5.0 * i / max(1, count - 1)), beta=0.02 * i)
        flown = simulate(FINNER, model, start, 1.0, step=2e-4, end=End(x=230.0), estimate_error=False)
        shots.append(measure(flown, seed=None if seed is None else seed + i))
    return shots


def test_several_shots_give_coefficients_in_common_that_grow_with_the_angle():
    free = (*FREE_FLIGHT, *GROWING)
    result = identify(steep_shots(3), FINNER, MODEL, free, noise="stated")
    for name, value in ({n: TRUTH[n] for n in FREE_FLIGHT} | GROWING).items():
        assert result[name].value == pytest.approx(value, rel=1e-4), name
    assert result["x[shot 2]"].value == pytest.approx(0.0, abs=1e-6)
    assert "3 shots" in result.summary()
    assert set(result.table().names()) == set(FREE_FLIGHT)


def test_shots_together_are_surer_than_each_alone_and_agree_with_them():
    shots = steep_shots(3, seed=40)
    free = (*FREE_FLIGHT, *GROWING)
    together = identify(shots, FINNER, MODEL, free)
    alone = identify(shots[2], FINNER, MODEL, free)
    for name, value in ({n: TRUTH[n] for n in FREE_FLIGHT} | GROWING).items():
        assert together[name].standard_error < alone[name].standard_error, name
        assert abs(together[name].value - value) < 4.0 * together[name].standard_error, name
    assert together.probable_error("Cm_alpha") == pytest.approx(0.6745 * together["Cm_alpha"].standard_error, rel=1e-4)
    assert together.mean_square_yaw > 0.0


def test_a_model_serves_any_number_of_records():
    model = RangeModel.of(FINNER, MODEL)
    record = measure(flight(), seed=3)
    one, other = identify(record, FINNER, model=model), identify(record, FINNER, MODEL)
    assert one["Cm_alpha"].value == other["Cm_alpha"].value
