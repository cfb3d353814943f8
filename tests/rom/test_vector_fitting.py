"""Vector fitting and frequency-domain realisation against known systems."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.frequency import FrequencyResponse
from indicial.rom import realise
from indicial.rom.vector_fitting import vector_fit
from rom.cases import COLUMNS, CONDITION, REFERENCE, ROWS, known_system

K = np.geomspace(0.01, 8.0, 30)


def known_response(k: Array = K) -> FrequencyResponse:
    """The known system's response to alpha and q, as an operator would give it."""
    system = known_system()
    values = np.array([system.transfer(float(one))[:, COLUMNS] for one in k])
    static, slope = system.step(1e6)[:, COLUMNS], system.slope()[:, COLUMNS]
    baseline = system.steady(CONDITION).coefficients
    return FrequencyResponse(
        k, ("alpha", "q"), values, static, slope, system.d[:, COLUMNS], baseline, CONDITION, REFERENCE
    )


@pytest.mark.parametrize(
    "upper", [[-0.2, -0.7], [-0.3 + 0.5j], [-1.5, -0.2, -0.3 + 0.5j], [-2.0, -0.05 + 1j, -0.02 + 0.3j]]
)
def test_poles_of_a_rational_response_are_found_to_round_off(upper: list[complex]) -> None:
    real = np.array([p.real for p in upper if np.imag(p) == 0.0])
    pairs = np.array([p for p in upper if np.imag(p) > 0.0])
    rng = np.random.default_rng(len(upper))
    poles = np.concatenate([real, pairs, pairs.conj()])
    above = rng.normal(size=(pairs.size, 3)) + 1j * rng.normal(size=(pairs.size, 3))
    residues = np.concatenate([rng.normal(size=(real.size, 3)), above, above.conj()])
    found = vector_fit(K, (1.0 / (1j * K[:, None] - poles)) @ residues, poles.size)
    np.testing.assert_allclose(np.sort(found.rates), np.sort(-real), rtol=1e-8)
    exact = sorted(zip(-pairs.real, pairs.imag, strict=True))
    np.testing.assert_allclose(found.pairs[np.argsort(found.pairs[:, 0])], np.reshape(exact, (-1, 2)), rtol=1e-8)


def test_poles_of_a_growing_response_are_flipped() -> None:
    found = vector_fit(K, (1.0 / (1j * K - 0.4))[:, None], 1)
    assert found.rates == pytest.approx([0.4], rel=1e-8)


def test_poles_do_not_depend_on_units_or_order_of_channels() -> None:
    values = known_response().values[:, ROWS, 1] - known_response().direct[ROWS, 1]
    found = vector_fit(K, values, 3)
    again = vector_fit(10.0 * K, 1e3 * values[:, ::-1], 3)
    np.testing.assert_allclose(again.rates, 10.0 * found.rates, rtol=1e-7)
    np.testing.assert_allclose(again.pairs, 10.0 * found.pairs, rtol=1e-7)


@pytest.mark.parametrize("method", ["vector fitting", "modal", "auto"])
def test_known_system_is_recovered_from_its_frequency_response(method: str) -> None:
    model = realise(known_response(), method, tolerance=1e-6)  # type: ignore[arg-type]
    assert model.order == 5
    exact = np.sort_complex(np.array([-0.2, -0.7, -0.35, -0.3 + 0.5j, -0.3 - 0.5j]))
    np.testing.assert_allclose(np.sort_complex(model.poles), exact, rtol=1e-5)
    s = np.linspace(0.0, 40.0, 60)
    for name, column in zip(("alpha", "q"), COLUMNS, strict=True):
        step = known_system().step(s)[:, ROWS, column]
        np.testing.assert_allclose(model.step(s)[name].values, step, atol=1e-5 * np.max(np.abs(step)))
    assert max(error.peak for error in model.errors) < 1e-6


@pytest.mark.parametrize("method", ["exponential", "vector fitting", "modal"])
@pytest.mark.parametrize("poles", ["separate", "shared"])
def test_limits_are_exact_and_the_model_stable_whatever_the_order(method: str, poles: str) -> None:
    data = known_response()
    for order in (1, 2, 3):
        model = realise(data, method, order, poles=poles)  # type: ignore[arg-type]
        np.testing.assert_array_equal(model.d, data.direct[ROWS])
        np.testing.assert_allclose(model.static_gain, data.static[ROWS], rtol=1e-10)
        if order > 1:
            np.testing.assert_allclose(model.rate_gain, data.slope[ROWS], rtol=1e-8)
        assert np.max(model.poles.real) < 0.0


def test_noise_leaves_the_model_stable() -> None:
    data, rng = known_response(), np.random.default_rng(1)
    noise = rng.normal(size=data.values.shape) + 1j * rng.normal(size=data.values.shape)
    for method in ("vector fitting", "modal"):
        model = realise(replace(data, values=data.values + noise), method, 4, match_integral=False)  # type: ignore[arg-type]
        assert np.max(model.poles.real) < 0.0


def test_methods_that_do_not_fit_the_data_are_refused() -> None:
    with pytest.raises(InputError, match="era reads step responses"):
        realise(known_response(), "era")
    with pytest.raises(InputError, match="needs six"):
        realise(known_response(K[:5]))
    with pytest.raises(InputError, match="cannot tell 8 poles"):
        vector_fit(K[:6], np.ones((6, 1), dtype=complex), 8)
    with pytest.raises(InputError, match="poles is 'some'"):
        realise(known_response(), poles="some")  # type: ignore[arg-type]


@pytest.mark.parametrize("part", ["values", "static", "direct"])
def test_response_of_which_a_needed_part_is_unknown_is_refused(part: str) -> None:
    response = known_response()
    holed = getattr(response, part).copy()
    holed[..., ROWS[0], 1] = np.nan
    with pytest.raises(InputError, match="response to q: H"):
        realise(replace(response, **{part: holed}))
