"""Models identified from general motions: exact systems, noise, what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.history import History
from indicial.motion import TabulatedMotion
from indicial.rom import StateSpaceModel, identify
from indicial.rom.era import Sampled, era
from indicial.rom.okid import observer_markov, system_markov
from rom.cases import CONDITION, OUTPUTS, REFERENCE
from rom.test_state_space import known_model

STEP = 0.5


def random_model(seed: int) -> StateSpaceModel:
    """Two to six states, natural frequencies from 0.1 to 1.5, damping ratios of pairs from 0.03 to 0.7."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 7))
    a, i = np.zeros((n, n)), 0
    while i < n:
        frequency = np.exp(rng.uniform(np.log(0.1), np.log(1.5)))
        if i + 1 < n and rng.random() < 0.6:
            damping = rng.uniform(0.03, 0.7)
            turn = np.sqrt(1.0 - damping**2)
            a[i : i + 2, i : i + 2] = frequency * np.array([[-damping, turn], [-turn, -damping]])
            i += 2
        else:
            a[i, i] = -frequency
            i += 1
    b, c, d = rng.normal(size=(n, 2)), rng.normal(size=(2, n)), rng.normal(size=(2, 2))
    return StateSpaceModel(a, b, c, d, ("alpha", "q"), OUTPUTS, np.zeros(6), CONDITION, REFERENCE)


def noise_motion(seed: int, count: int, start: float = 0.0) -> tuple[TabulatedMotion, Array]:
    """Low-passed noise in alpha and q, linear between samples."""
    rng = np.random.default_rng(seed)
    x = np.zeros((count, 2))
    for i in range(1, count):
        x[i] = 0.7 * x[i - 1] + 0.01 * rng.normal(size=2)
    alpha = CONDITION.alpha + start + x[:, 0]
    times = np.arange(count) * STEP * REFERENCE.length / (2.0 * CONDITION.speed)
    velocity = CONDITION.speed * np.stack([np.cos(alpha), np.zeros(count), np.sin(alpha)], axis=1)
    rate = np.zeros((count, 3))
    rate[:, 1] = x[:, 1] * 2.0 * CONDITION.speed / REFERENCE.length
    return TabulatedMotion(times, velocity, rate), times


def history(model: StateSpaceModel, seed: int, count: int, noise: float = 0.0, start: float = 0.0) -> History:
    exact = model.predict(*noise_motion(seed, count, start), substeps=1)
    loads = exact.coefficients
    wrong = np.random.default_rng(seed + 1000).normal(size=loads.shape)
    return replace(exact, coefficients=loads + noise * np.std(loads, axis=0) * wrong)


def fit(model: StateSpaceModel, true: StateSpaceModel) -> float:
    """1 - NRMSE of the worse load, against the noise-free response to a motion not seen."""
    motion = noise_motion(77, 500)
    found, exact = model.predict(*motion, substeps=1), true.predict(*motion, substeps=1)
    return min(1.0 - float(np.std(found[o] - exact[o]) / np.std(exact[o])) for o in OUTPUTS)


def test_known_system_is_recovered_from_random_motion_without_noise() -> None:
    model = identify([history(known_model(), 1, 400)], order=5, substeps=1)
    exact = np.sort_complex(known_model().poles)
    np.testing.assert_allclose(np.sort_complex(model.poles), exact, rtol=1e-6)
    np.testing.assert_allclose(model.d, known_model().d, rtol=1e-7)
    np.testing.assert_allclose(model.static_gain, known_model().static_gain, rtol=1e-6)
    np.testing.assert_allclose(model.baseline, known_model().baseline, atol=1e-9)


def test_motion_from_another_steady_state_gives_the_same_model() -> None:
    model = identify([history(known_model(), 1, 400, start=0.03)], order=5, substeps=1)
    np.testing.assert_allclose(model.static_gain, known_model().static_gain, rtol=1e-6)
    np.testing.assert_allclose(model.baseline, known_model().baseline, atol=1e-8)


def test_several_histories_count_together_and_known_feedthrough_is_kept() -> None:
    parts = [history(known_model(), seed, 150, noise=0.01) for seed in (1, 2, 3)]
    model = identify(parts, order=5, direct=known_model().d, substeps=1)
    np.testing.assert_array_equal(model.d, known_model().d)
    assert fit(model, known_model()) > 0.99


def random_fits(seeds: range) -> list[float]:
    fits = []
    for seed in seeds:
        true = random_model(seed)
        model = identify([history(true, seed, 700, noise=0.02)], substeps=1, max_order=7)
        assert np.max(model.poles.real) < 0.0
        fits.append(fit(model, true))
    return fits


def test_random_systems_with_2_percent_noise_are_stable_and_predicted_to_97_percent() -> None:
    assert np.median(random_fits(range(3))) > 0.97


@pytest.mark.slow
def test_twenty_random_systems_with_2_percent_noise_are_stable_and_predicted_to_97_percent() -> None:
    assert np.median(random_fits(range(20))) > 0.97


def test_data_without_a_system_still_give_a_stable_model_and_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    measured = history(known_model(), 1, 120)
    growing = measured.before + np.exp(0.05 * measured.s)[:, None] * np.random.default_rng(2).normal(size=(120, 6))
    model = identify([replace(measured, coefficients=growing)], max_order=3, substeps=1)
    assert np.max(model.poles.real) < 0.0
    assert "do not trust it" in caplog.text


def test_outputs_in_another_order_or_unit_give_the_same_model() -> None:
    measured = history(known_model(), 1, 300, noise=0.01)
    scaled = measured.coefficients * np.array([1.0, 1.0, 5.0, 1.0, 0.1, 1.0])
    other = replace(measured, coefficients=scaled, before=measured.before * [1.0, 1.0, 5.0, 1.0, 0.1, 1.0])
    one = identify([measured], order=5, substeps=1)
    two = identify([other], outputs=("Cm", "CN"), order=5, substeps=1)
    h, again = one.frequency_response([0.1, 0.7]), two.frequency_response([0.1, 0.7])
    np.testing.assert_allclose(again[:, 1] / 5.0, h[:, 0], rtol=1e-4)
    np.testing.assert_allclose(again[:, 0] * 10.0, h[:, 1], rtol=1e-4)


def sampled_system(seed: int = 3) -> Sampled:
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(4, 4))
    a *= 0.95 / np.max(np.abs(np.linalg.eigvals(a)))
    return Sampled(a, rng.normal(size=(4, 2)), rng.normal(size=(3, 4)), rng.normal(size=(3, 2)), np.zeros(0))


def test_era_keeps_feedthrough_and_markov_parameters() -> None:
    exact = sampled_system().markov(60)
    found = era(exact[:41], 4)
    np.testing.assert_array_equal(found.d, exact[0])
    np.testing.assert_allclose(found.markov(60), exact, atol=1e-9)
    assert found.hankel[4] < 1e-10 * found.hankel[0]
    with pytest.raises(InputError, match="order is 99"):
        era(exact, 99)


def test_observer_gives_the_markov_parameters_of_the_system() -> None:
    system, rng = sampled_system(), np.random.default_rng(0)
    u = rng.normal(size=(200, 2))
    state, y = np.zeros(4), []
    for now in u:
        y.append(system.c @ state + system.d @ now)
        state = system.a @ state + system.b @ now
    found = system_markov(*observer_markov([u], [np.array(y)], 6), 30)
    np.testing.assert_allclose(found, system.markov(30), atol=1e-8)


def test_what_cannot_be_identified_is_refused() -> None:
    measured = history(known_model(), 1, 120)
    with pytest.raises(InputError, match="no histories"):
        identify([])
    with pytest.raises(InputError, match="max_order is 0"):
        identify([measured], max_order=0)
    uneven = replace(measured, time=measured.time * (1.0 + 0.01 * np.linspace(0.0, 1.0, 120)))
    with pytest.raises(InputError, match="uneven"):
        identify([uneven])
    with pytest.raises(InputError, match="12 samples"):
        identify([history(known_model(), 1, 12)])
    still = replace(measured, rate=np.zeros_like(measured.rate))
    with pytest.raises(InputError, match="no history moves q"):
        identify([still])
    with pytest.raises(InputError, match="CA does not change"):
        identify([measured], outputs=("CN", "CA"))
