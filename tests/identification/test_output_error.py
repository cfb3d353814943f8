import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from flightsim.support import FINNER, derivative_model, first_order_lag
from identification.support import MODEL, TRUTH, flight, fly_range, output_model, truth
from indicial.errors import DivergenceError, InputError
from indicial.identification import (
    FREE_FLIGHT,
    Precision,
    build_output_model,
    estimate,
    identify,
    measure,
    reduce_linearly,
    start_values,
)


def first_station(trajectory, initial):
    """True unknowns of the first station."""
    yaw, pitch, roll = trajectory.euler[0]
    names = ("x", "y", "z", "Vx", "Vy", "Vz", "yaw", "pitch", "roll", "p", "q", "r")
    values = (*trajectory.position[0], *trajectory.earth_velocity[0], yaw, pitch, roll, *trajectory.rate[0])
    return np.array([dict(zip(names, values, strict=True))[name] for name in initial])


def test_the_output_model_at_the_truth_sees_the_flight():
    model = output_model()
    record = measure(flight(), seed=None)
    unknowns = np.concatenate([truth(model.derivatives), first_station(flight(), model.initial)])
    seen = model.outputs(unknowns, record.time)
    np.testing.assert_allclose(seen, record.values, atol=3e-7)
    np.testing.assert_array_equal(seen, model.sensitivities(unknowns, record.time)[0])


def test_sensitivities_equal_finite_differences_with_roll_and_every_derivative_free():
    free = ("CA_0", "CN_alpha", "Cm_alpha", "Cm_q", "Cm_alphadot", "CN_q+CN_alphadot", "Cl_p", "Cl_0")
    spun = fly_range(replace(MODEL, Cl_0=0.02), roll_rate=60.0)
    record = measure(spun, 20, seed=None, roll=True)
    model = build_output_model(FINNER, MODEL, free, stations=20, substeps=20, roll=True)
    values = TRUTH | {"Cm_q": -300.0, "Cm_alphadot": -60.0, "CN_q+CN_alphadot": 130.0, "Cl_0": 0.02}
    unknowns = np.concatenate([[values[n] for n in model.derivatives], first_station(spun, model.initial)])
    _, exact = model.sensitivities(unknowns, record.time)
    for j, name in enumerate(model.names):
        # five points: error of fourth order, so that the step can be large against round-off
        step = np.zeros_like(unknowns)
        step[j] = 1e-3 * max(0.1, abs(unknowns[j]))
        near, far = (
            model.outputs(unknowns + n * step, record.time) - model.outputs(unknowns - n * step, record.time)
            for n in (1, 2)
        )
        difference = (8.0 * near - far) / (12.0 * step[j])
        # what changes a channel by less than a tenth of its noise in all is lost in round-off of x
        unseen = 0.1 * record.standard_deviations / max(0.1, abs(unknowns[j]))
        scale = np.maximum(np.max(np.abs(exact[..., j]), axis=0), unseen)
        np.testing.assert_allclose(difference / scale, exact[..., j] / scale, atol=2e-5, err_msg=name)


@pytest.mark.parametrize("noise", ["stated", "estimated"])
def test_a_record_without_noise_gives_its_derivatives_back(noise):
    result = identify(measure(flight(), seed=None), FINNER, MODEL, noise=noise)
    for name in FREE_FLIGHT:
        assert result[name].value == pytest.approx(TRUTH[name], rel=1e-5), name
    np.testing.assert_allclose(result.fitted.position, flight().at_stations(result.record.x).position, atol=1e-6)


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


def normalised_errors(seeds, substeps):
    """Errors over reported standard errors (n, 4), and the errors and reported errors themselves."""
    model = output_model(substeps)
    true = truth(model.derivatives)
    errors, reported = [], []
    for seed in seeds:
        record = measure(flight(), seed=seed)
        result = estimate(record, model, start_values(model, reduce_linearly(record, FINNER), MODEL))
        errors.append([e.value for e in result.derivatives] - true)
        reported.append([e.standard_error for e in result.derivatives])
    return np.array(errors) / np.array(reported), np.array(errors), np.array(reported)


def test_errors_have_unit_variance_and_no_bias_in_reported_standard_errors():
    n = 30
    scaled, _, _ = normalised_errors(range(n), substeps=4)
    low, high = chi2.ppf([0.0005, 0.9995], n) / n
    assert np.all((np.mean(scaled**2, axis=0) > low) & (np.mean(scaled**2, axis=0) < high))
    assert np.all(np.abs(scaled.mean(axis=0)) < 3.5 / math.sqrt(n))


@pytest.mark.slow
def test_over_200_records_standard_errors_match_the_scatter_and_intervals_cover():
    scaled, errors, reported = normalised_errors(range(200), substeps=6)
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
    text = "\n".join(both.accuracy.findings)
    assert "cannot separate Cm_q and Cm_alphadot" in text or "cannot separate Cm_alphadot and Cm_q" in text
    assert "identify the sum" in text
    alone = identify(record, FINNER, MODEL)
    assert alone.accuracy.findings == ()
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
    assert min(far.cost) == pytest.approx(far.cost[-1], abs=1e-2)


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
    model = build_output_model(FINNER, MODEL, stations=20, substeps=2)
    start = start_values(model, reduce_linearly(record, FINNER), MODEL)
    with pytest.raises(InputError, match="20 stations, the record 54"):
        estimate(record, model, start)


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
