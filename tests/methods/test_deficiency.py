"""The deficiency integral by the tail that is there: exact integrals, refusals, noise."""

from __future__ import annotations

import numpy as np
import pytest

from indicial.errors import InputError, NoLimitError
from indicial.methods.indicial_response import step_times
from indicial.rom.deficiency import deficiency_integral, quasi_steady, running_integral
from theory.linear import wagner
from theory.plate import incidence_derivatives, steady_response, supersonic_step


def record(end: float) -> np.ndarray:
    return step_times(end * 1e-4, 1.04, end * 0.02, end)


def noisy(values: np.ndarray, level: float) -> np.ndarray:
    return values + level * np.ptp(values) * np.random.default_rng(3).normal(size=values.shape)


@pytest.mark.parametrize("mach", [1.1, 2.0, 4.0])
@pytest.mark.parametrize("level", [0.0, 1e-4])
def test_supersonic_plate_gives_minus_two_and_four_thirds_over_beta_cubed(mach: float, level: float) -> None:
    s = record(2.0 * 2.0 * mach / (mach - 1.0))
    for column, derivative in enumerate(incidence_derivatives(mach)):
        response = noisy(supersonic_step(mach, s)[:, column], level)
        found = deficiency_integral(s, response, steady_response(mach)[column])
        assert found.settled
        assert found.tail == "finite"
        # per c/2U double of per c/U; and without the final value the same
        assert found.incidence_rate_derivative == pytest.approx(2.0 * derivative, rel=1e-3)
        assert deficiency_integral(s, response).incidence_rate_derivative == pytest.approx(2.0 * derivative, rel=2e-3)


def test_exponential_tail_is_carried_beyond_the_record_exactly() -> None:
    s = record(4.0)
    found = deficiency_integral(s, 1.0 - np.exp(-s), 1.0)
    assert not found.settled
    assert found.tail == "exponential"
    assert found.remainder == pytest.approx(np.exp(-4.0), rel=1e-3)
    assert found.value == pytest.approx(1.0, abs=1e-4)


def test_algebraic_tail_is_named_and_carried_beyond_the_record() -> None:
    s = record(50.0)
    found = deficiency_integral(s, 1.0 - (1.0 + s / 2.0) ** -2.0, 1.0)
    assert found.tail == "algebraic"
    assert found.exponent == pytest.approx(2.0, rel=1e-3)
    assert found.value == pytest.approx(2.0, rel=1e-4)


@pytest.mark.parametrize("level", [0.0, 1e-4, 1e-3])
def test_error_bar_holds_the_truth(level: float) -> None:
    cases = [
        (record(8.0), lambda s: 0.7 * np.exp(-s) + 0.3 * np.exp(-0.5 * s), 1.3),
        (record(60.0), lambda s: (1.0 + s / 2.0) ** -2.0, 2.0),
        (record(40.0), lambda s: np.exp(-0.3 * s) * np.cos(s), 0.3 / 1.09),
    ]
    for s, deficiency, exact in cases:
        found = deficiency_integral(s, noisy(1.0 - deficiency(s), level), 1.0)
        assert abs(found.value - exact) <= 3.0 * found.uncertainty
        assert found.uncertainty < 0.2 * exact


@pytest.mark.parametrize("end", [15.0, 50.0, 200.0, 20000.0])
@pytest.mark.parametrize("level", [0.0, 1e-4, 1e-3])
def test_wagner_tail_is_refused_however_long_or_noisy_the_record(end: float, level: float) -> None:
    s = record(end)
    response = noisy(wagner(s), level)
    with pytest.raises(NoLimitError, match="no limit"):
        deficiency_integral(s, response, 1.0)
    # without the final value it may also be refused as not settled, but never given
    with pytest.raises((NoLimitError, InputError), match=r"no limit|has not settled"):
        deficiency_integral(s, response)


def test_slow_tail_too_small_to_matter_is_let_pass_with_its_error_bar() -> None:
    s = record(50.0)
    deficiency = np.exp(-s) + 0.003 / (1.0 + s)
    found = deficiency_integral(s, 1.0 - deficiency, 1.0, noise=1e-6)
    assert found.tail == "slow"
    assert found.value == pytest.approx(1.0 + 0.003 * np.log(51.0), rel=1e-3)
    # it holds what a tenfold record would add
    assert found.uncertainty >= 0.8 * 0.003 * np.log(10.0)


def test_record_that_ends_too_early_is_refused() -> None:
    s = record(1.0)
    with pytest.raises(InputError, match="run to larger s"):
        deficiency_integral(s, 1.0 - np.exp(-s), 1.0)
    with pytest.raises(InputError, match="has not settled"):
        deficiency_integral(s, 1.0 - np.exp(-3.0 * s))


def test_final_value_that_the_record_does_not_approach_is_refused() -> None:
    s = record(40.0)
    with pytest.raises(InputError, match="levels off"):
        deficiency_integral(s, 1.0 - np.exp(-s), 1.02)


def test_small_mismatch_of_the_final_value_goes_into_the_error_bar() -> None:
    s = record(40.0)
    response = noisy(1.0 - np.exp(-s), 1e-4)
    found = deficiency_integral(s, response, 1.002)
    assert found.final == pytest.approx(1.0, abs=1e-4)
    assert abs(found.value - 1.0) < found.uncertainty
    assert found.uncertainty == pytest.approx(0.002 * found.cut, rel=0.2)


def test_response_without_deficiency_has_none() -> None:
    s = record(10.0)
    response = 2.0 + 1e-5 * np.random.default_rng(0).normal(size=s.size)
    found = deficiency_integral(s, response, 2.0)
    assert found.tail == "none"
    assert found.value == 0.0


def test_deficiency_integral_refuses_unusable_records() -> None:
    s = record(10.0)
    for at, values in ((s[:5], s[:5]), (s + 1.0, s), (s, s[:-1]), (s, np.where(s > 5.0, np.nan, s))):
        with pytest.raises(InputError):
            deficiency_integral(at, values, 1.0)


def test_quasi_steady_form_equals_superposition_of_a_slow_ramp() -> None:
    # alpha = rate * s: Eq. (13) gives C = rate * integral of the step response
    mach, rate = 2.0, 0.01
    s = record(20.0)
    response = supersonic_step(mach, s)[:, 0]
    final = float(steady_response(mach)[0])
    lag = running_integral(s, final - response)
    loads = quasi_steady(
        rate * s, np.full_like(s, rate), np.zeros_like(s), initial=0.1, alpha_final=final, q_final=5.0, integral=lag
    )
    np.testing.assert_allclose(loads, 0.1 + rate * running_integral(s, response), atol=1e-12)
    assert lag[-1] == pytest.approx(-2.0 * incidence_derivatives(mach)[0], rel=1e-4)
