"""What cutting a record costs, on responses whose integral is known."""

from __future__ import annotations

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.rom import DeficiencyIntegral, record_length
from theory.plate import incidence_derivatives, supersonic_step


def exponential(end: float, rate: float = 0.4) -> tuple[np.ndarray, np.ndarray]:
    s = np.linspace(0.0, end, 161)
    return s, 2.0 - 1.5 * np.exp(-rate * s)


def test_both_ways_of_cutting_an_exponential_are_what_calculus_says():
    s, values = exponential(40.0)
    found = record_length(s, values, 2.0)
    tail = np.exp(-0.4 * found.s)
    np.testing.assert_allclose(found.with_final, 1.5 / 0.4 * (1.0 - tail), rtol=2e-4)
    # the last sample is too low by the deficiency there, over all of the record
    np.testing.assert_allclose(found.with_last, 1.5 / 0.4 * (1.0 - tail) - 1.5 * tail * found.s, rtol=2e-4, atol=2e-4)


def test_the_length_needed_is_where_what_is_left_falls_below_the_tolerance():
    s, values = exponential(40.0)
    found = record_length(s, values, 2.0)
    # (1 + rate s) exp(-rate s) = 1% at rate s = 6.64
    assert found.shortest(0.01) == pytest.approx(6.64 / 0.4, rel=0.05)


@pytest.mark.parametrize("case", ["exponential", "plate"])
def test_no_record_claims_an_error_bar_that_leaves_the_truth_out(case):
    if case == "exponential":
        (s, values), exact = exponential(40.0), 1.5 / 0.4
    else:
        s = np.linspace(0.0, 8.0, 161)
        values, exact = supersonic_step(2.0, s)[:, 0], -2.0 * incidence_derivatives(2.0)[0]
    found = record_length(s, values)
    bars = [one for _, one in found.judged if isinstance(one, DeficiencyIntegral)]
    refused = [reason for _, reason in found.judged if isinstance(reason, str)]
    assert bars
    assert refused  # the shortest records cannot know
    for one in bars:
        if one.tail == "none":
            # the plate's lift does not change at all until s = 4/3: a record that ends there cannot know of the rest
            assert case == "plate"
            assert one.cut < 4.0 / 3.0
            continue
        assert abs(one.value - exact) < 3.0 * one.uncertainty + 1e-4 * exact


def test_a_wake_without_a_limit_says_so_whatever_the_length():
    s = np.linspace(0.0, 400.0, 400)
    values = 1.0 - 1.0 / (1.0 + s)
    found = record_length(s, values, 1.0, name="CN_alphadot")
    assert "no limit" in found.summary()
    with pytest.raises(InputError, match="no limit"):
        found.shortest()
    # and the partial integral goes on growing like log s
    late = found.s > 40.0
    np.testing.assert_allclose(found.with_final[late], np.log1p(found.s[late]), rtol=0.02)
