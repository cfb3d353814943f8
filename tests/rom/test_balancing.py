"""Balanced truncation: bounds, exact limits, invariance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.rom import StateSpaceModel, truncate
from indicial.rom.balancing import hankel_values
from rom.cases import CONDITION, OUTPUTS, REFERENCE
from rom.test_state_space import known_model


def large_model(n: int = 14, seed: int = 4) -> StateSpaceModel:
    rng = np.random.default_rng(seed)
    a = -np.diag(np.exp(rng.uniform(-3.0, 1.0, n))) + 0.4 * np.triu(rng.normal(size=(n, n)), 1)
    turn = np.linalg.qr(rng.normal(size=(n, n)))[0]
    b, c, d = rng.normal(size=(n, 2)), rng.normal(size=(2, n)), rng.normal(size=(2, 2))
    names = ("alpha", "q"), OUTPUTS
    return StateSpaceModel(turn @ a @ turn.T, turn @ b, c @ turn.T, d, *names, np.zeros(6), CONDITION, REFERENCE)


@pytest.mark.parametrize("order", [2, 5, 9])
def test_error_is_at_no_frequency_above_twice_the_singular_values_left_out(order: int) -> None:
    model = large_model()
    cut = truncate(model, order)
    assert cut.bound is not None
    assert 0.0 < cut.error <= cut.bound
    assert np.max(cut.model.poles.real) < 0.0
    np.testing.assert_array_equal(cut.model.d, model.d)


def test_a_single_lag_has_half_its_gain_as_hankel_value() -> None:
    model = replace(known_model(), a=np.array([[-0.3]]), b=np.array([[0.3, 0.0]]), c=np.array([[1.0], [0.0]]),
                    d=np.array([[0.0, 1.0], [1.0, 0.0]]))  # fmt: skip
    assert hankel_values(model) == pytest.approx([0.5], rel=1e-12)


def test_hankel_values_do_not_depend_on_the_coordinates_of_the_states() -> None:
    model = large_model()
    turn = np.random.default_rng(0).normal(size=(14, 14))
    turned = replace(model, a=turn @ model.a @ np.linalg.inv(turn), b=turn @ model.b, c=model.c @ np.linalg.inv(turn))
    np.testing.assert_allclose(hankel_values(turned), hankel_values(model), atol=1e-9 * hankel_values(model)[0])


def test_states_that_nothing_excites_or_shows_are_left_out_at_no_cost() -> None:
    known = known_model()
    a = np.block([[known.a, np.zeros((5, 2))], [np.ones((2, 5)), -np.eye(2)]])
    model = replace(known, a=a, b=np.vstack([known.b, np.ones((2, 2))]), c=np.hstack([known.c, np.zeros((2, 2))]))
    cut = truncate(model, tolerance=1e-9)
    assert cut.model.order == 5
    np.testing.assert_allclose(np.sort_complex(cut.model.poles), np.sort_complex(known.poles), rtol=1e-7)


@pytest.mark.parametrize("order", [4, 6, 10])
def test_within_a_band_all_derivatives_at_zero_frequency_are_kept(order: int) -> None:
    model = large_model()
    cut = truncate(model, order, k_max=0.5)
    assert np.max(cut.model.poles.real) < 0.0
    np.testing.assert_array_equal(cut.model.d, model.d)
    np.testing.assert_allclose(cut.model.static_gain, model.static_gain, rtol=1e-8)
    np.testing.assert_allclose(cut.model.rate_gain, model.rate_gain, rtol=1e-8)


def test_the_fewest_states_within_the_tolerance_are_taken() -> None:
    cut = truncate(large_model(), tolerance=0.02, k_max=1.0)
    assert cut.error <= 0.02
    assert all(trial.error > 0.02 for trial in cut.trials[:-1])
    assert "<- chosen" in cut.summary()
    assert len(cut.plot().axes) == 1


def test_states_without_effect_do_not_stand_in_the_way_of_any_order() -> None:
    """Their Hankel singular values are nothing but round-off, by which no coordinates can be divided."""
    known = known_model()
    a = np.block([[known.a, np.zeros((5, 2))], [np.ones((2, 5)), -np.eye(2)]])
    model = replace(known, a=a, b=np.vstack([known.b, np.ones((2, 2))]), c=np.hstack([known.c, np.zeros((2, 2))]))
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(7, 7)))[0]
    turned = replace(model, a=turn @ model.a @ turn.T, b=turn @ model.b, c=model.c @ turn.T)
    for one in (model, turned):
        for order in (5, 6, 7):
            cut = truncate(one, order)
            assert cut.error < 1e-9
            assert cut.bound is not None
            assert cut.error <= cut.bound
        assert truncate(one, tolerance=1e-15).error <= 1e-15


def test_orders_out_of_range_are_refused() -> None:
    none = replace(known_model(), a=np.zeros((0, 0)), b=np.zeros((0, 2)), c=np.zeros((2, 0)))
    with pytest.raises(InputError, match="no states"):
        truncate(none)
    with pytest.raises(InputError, match="order is 3"):
        truncate(large_model(), 3, k_max=0.5)
    with pytest.raises(InputError, match="order is 15"):
        truncate(large_model(), 15)
    with pytest.raises(InputError, match="k_max is -1"):
        truncate(large_model(), k_max=-1.0)
    with pytest.raises(InputError, match="tolerance is nan"):
        truncate(large_model(), tolerance=float("nan"))


def test_a_tolerance_that_no_order_meets_is_said(caplog: pytest.LogCaptureFixture) -> None:
    truncate(large_model(), tolerance=0.02, k_max=1.0)
    truncate(large_model(), 4, tolerance=0.0)
    assert not caplog.text
    # all states in other coordinates are right to round-off, not exactly
    cut = truncate(large_model(), tolerance=0.0, k_max=1.0)
    assert cut.error > 0.0
    assert "no order meets the tolerance" in caplog.text
