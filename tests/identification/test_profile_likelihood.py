"""Profiles: the bound's parabola where the model is linear, other than it where it is not, and coverage there."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from identification.test_lag_support import FREE, TRUTH, compiled, exact, manoeuvre
from identification.test_lag_support import NOISE as LAG_NOISE
from identification.test_maximum_likelihood import CHANNELS, START, aircraft, parameters, simulated
from indicial.errors import DivergenceError, InputError
from indicial.identification import Manoeuvre, Parameter, SensitivityModel, fit_manoeuvres, profile_likelihood
from indicial.identification.profile_likelihood import _Walk


def test_of_an_offset_the_profile_is_the_bound_s_parabola():
    """A bias of theta adds to one channel: with the start of theta known the model is linear in it."""
    model = SensitivityModel.of(aircraft(), CHANNELS, ["theta"])
    m = Manoeuvre.of_flight(simulated(5), aircraft(), START, biases=["theta"], model=model)
    unknown = [*parameters(), Parameter("bias_theta", 0.0)]
    fit = fit_manoeuvres([m], unknown)
    found = profile_likelihood(fit, unknown, "bias_theta")
    assert found.lower == pytest.approx(found.bound[0], abs=0.02 * fit["bias_theta"].standard_error)
    assert found.upper == pytest.approx(found.bound[1], abs=0.02 * fit["bias_theta"].standard_error)
    assert found.trusts_bound
    assert "the bound agrees" in found.summary()
    assert found.plot().axes[0].get_xlabel() == "bias_theta"


def test_of_a_well_determined_derivative_it_is_the_bound_too():
    from identification.test_maximum_likelihood import manoeuvre as whole

    fit = fit_manoeuvres([whole(simulated(3))], parameters())
    found = profile_likelihood(fit, parameters(), "Cm_q", level=0.9)
    assert found.trusts_bound
    assert np.all(found.statistic >= 0.0)


LAG, UNKNOWN = (0.9, -0.27, 0.3), [*(Parameter(n, v) for n, v in TRUTH.items())]


def lag_fit(seed):
    noise = np.random.default_rng(seed).standard_normal(exact(*LAG).shape) * np.array(list(LAG_NOISE.values()))
    unknown = [*UNKNOWN, Parameter("b", LAG[2], positive=True), Parameter("a_N", LAG[0]), Parameter("a_m", LAG[1])]
    return fit_manoeuvres([manoeuvre(exact(*LAG) + noise, free_start=FREE)], unknown, threads=1), unknown


def test_of_a_lag_hardly_determined_the_profile_is_not_the_bound():
    """Rate and amplitude trade against each other: the interval is open or lopsided where the bound's is even."""
    assert compiled().parameter_names
    fit, unknown = lag_fit(1)
    found = profile_likelihood(fit, unknown, "b", threads=1)
    assert not found.trusts_bound
    assert found.lower < LAG[2] < found.upper
    assert found.upper - found.estimate > 1.3 * (found.estimate - found.lower)


@pytest.mark.slow
def test_the_profile_covers_where_the_bound_does_not():
    held, bound = 0, 0
    count = 60
    for seed in range(count):
        fit, unknown = lag_fit(100 + seed)
        found = profile_likelihood(fit, unknown, "b", threads=1)
        held += found.lower <= LAG[2] <= found.upper
        bound += found.bound[0] <= LAG[2] <= found.bound[1]
    assert binom.cdf(held, count, 0.95) > 0.005, (held, bound)


class Known(_Walk):
    """A walk along a D that is known."""

    def __init__(self, cost, centre, positive=False):
        self.seen, self.better, self.centre, self.least, self.cost = {centre: 0.0}, {}, centre, 0.0, cost
        self.chosen = Parameter("b", centre, positive=positive)

    def _held(self, value):
        return self.cost(value), {}


def logarithmic(width):
    """J of an estimate that is normal in its logarithm, about 1; it has no value at 0 or below."""

    def cost(value):
        assert value > 0.0, "flown with a value that is not positive"
        return 0.5 * (math.log(value) / width) ** 2

    return cost


def test_ends_of_a_known_likelihood_are_found():
    walk = Known(logarithmic(0.5), 1.0, positive=True)
    assert walk.end(-1.0, 1.96, 0.5) == pytest.approx(math.exp(-0.98), rel=0.02)
    assert walk.end(1.0, 1.96, 0.5) == pytest.approx(math.exp(0.98), rel=0.02)


def test_a_positive_parameter_is_never_flown_below_zero_and_its_interval_ends_there():
    """With a standard error as large as the value the bound's interval would begin at -0.96."""
    assert Known(logarithmic(1.0), 1.0, positive=True).end(-1.0, 1.96, 1.0) == pytest.approx(math.exp(-1.96), rel=0.03)
    assert Known(logarithmic(50.0), 1.0, positive=True).end(-1.0, 1.96, 1.0) == 0.0


def test_where_fits_cease_to_converge_the_interval_is_open():
    def cost(value):
        if value > 1.4:
            raise DivergenceError("lost")
        return 0.5 * (value - 1.0) ** 2

    walk = Known(cost, 1.0)
    assert walk.end(1.0, 1.96, 1.0) == math.inf
    assert walk.end(-1.0, 1.96, 1.0) == pytest.approx(-0.96, rel=0.02)


def test_a_fit_that_was_not_at_its_minimum_is_told():
    from identification.test_maximum_likelihood import manoeuvre as whole

    fit = fit_manoeuvres([whole(simulated(3))], parameters())
    moved = tuple(replace(e, value=e.value + 3.0 * e.standard_error) if e.name == "Cm_q" else e for e in fit.parameters)
    found = profile_likelihood(replace(fit, parameters=moved), parameters(), "Cm_q")
    straight = profile_likelihood(fit, parameters(), "Cm_q")
    assert "local minimum" in found.summary()
    assert found.better["Cm_q"] == pytest.approx(fit["Cm_q"].value, abs=1.5 * fit["Cm_q"].standard_error)
    assert found.lower < straight.lower
    assert found.upper > straight.upper
    assert not straight.better


def test_of_two_minima_the_interval_holds_both():
    """J is least at 3, and the fit ended at 1; between them J rises, but not to the level of 95%."""

    def cost(value):
        return 0.5 * min((value - 1.0) ** 2, (value - 3.0) ** 2 - 0.4)

    walk = Known(cost, 1.0)
    assert walk.end(1.0, 1.96, 1.0) == pytest.approx(3.0 + math.sqrt(1.96**2 + 0.4), rel=0.02)
    assert walk.end(-1.0, 1.96, 1.0) == pytest.approx(-0.96, rel=0.02)
    assert walk.better == {"b": pytest.approx(3.0, abs=0.7)}


def test_what_cannot_be_profiled_is_refused():
    from identification.test_maximum_likelihood import manoeuvre as whole

    unknown = [*parameters()[:3], Parameter("Cm_elevator", -1.2, prior=(-1.2, 0.1))]
    fit = fit_manoeuvres([whole(simulated(3))], unknown)
    with pytest.raises(InputError, match="no parameter 'Cn_r'"):
        profile_likelihood(fit, unknown, "Cn_r")
    with pytest.raises(InputError, match="a prior"):
        profile_likelihood(fit, unknown, "Cm_elevator")
    with pytest.raises(InputError, match="level"):
        profile_likelihood(fit, unknown, "Cm_q", level=1.0)
