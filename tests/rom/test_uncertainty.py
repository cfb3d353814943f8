"""Uncertainty of models: exact in the linear case, and true in repeated trials."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.history import History
from indicial.motion import AlphaStep, PitchRateStep, TabulatedMotion
from indicial.rom import StateSpaceModel, refine_model
from indicial.rom.identification import record_of
from indicial.rom.modal_system import Parameters, load_slopes
from indicial.rom.uncertainty import _as_model, _as_system, autocovariance
from rom.cases import CONDITION, OUTPUTS, REFERENCE
from rom.test_identification import noise_motion
from rom.test_state_space import known_model

NAMES = ("Cm_q", "Cm_alphadot", "CN_alpha", "CN_q")


def two_states() -> StateSpaceModel:
    a, b = np.diag([-0.2, -0.8]), np.array([[1.0, 0.3], [0.2, 1.0]])
    c, d = np.array([[0.8, -0.5], [-0.6, 1.1]]), np.array([[3.0, 1.5], [-2.0, -6.0]])
    return StateSpaceModel(a, b, c, d, ("alpha", "q"), OUTPUTS, np.zeros(6), CONDITION, REFERENCE)


def noisy(exact: History, seed: int, memory: float, level: float = 0.05) -> History:
    """First-order coloured noise of correlation `memory` from sample to sample."""
    rng = np.random.default_rng(seed)
    white = rng.normal(size=exact.coefficients.shape) * np.sqrt(1.0 - memory**2)
    noise = np.zeros_like(white)
    noise[0] = rng.normal(size=6)
    for i in range(1, len(white)):
        noise[i] = memory * noise[i - 1] + white[i]
    return replace(exact, coefficients=exact.coefficients + level * np.std(exact.coefficients, axis=0) * noise)


def covered(memory: float, trials: int, *, known_start: bool = True) -> tuple[float, float]:
    """Share of derivatives, and of loads under a motion not seen, that lie within their 95% intervals.

    A start that is not known is as noisy as the loads are.
    """
    true = two_states()
    exact = true.predict(*noise_motion(3, 300), substeps=1)
    table = true.derivatives()
    unseen = noise_motion(8, 120)
    wanted = true.predict(*unseen)
    inside, within = [], []
    for seed in range(trials):
        history = noisy(exact, seed, memory)
        if not known_start:
            wrong = 0.05 * np.std(exact.coefficients, axis=0) * np.random.default_rng((seed, 1)).normal(size=6)
            history = replace(history, before=history.before + wrong)
        found = refine_model(true, [history], known_start=known_start, substeps=1)
        records = {record.name: record for record in found.derivatives()}
        for name in NAMES:
            assert records[name].uncertainty is not None
            inside.append(abs(records[name].value - table.value(name)) < 1.96 * records[name].uncertainty)
        band = found.predict(*unseen)
        for output in OUTPUTS:
            low, high = band.limits(output)
            # the first sample is the steady state before the motion, which every model has right
            within.append(np.mean(((low <= wanted[output]) & (wanted[output] <= high))[1:]))
    return float(np.mean(inside)), float(np.mean(within))


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_intervals_of_95_percent_hold_the_truth_about_as_often(memory: float) -> None:
    derivatives, loads = covered(memory, 30)
    # three standard deviations of a share of 95% among two independent loads of thirty trials
    least = 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / 60.0)
    assert least < derivatives
    assert least < loads


def test_intervals_hold_the_truth_where_the_start_is_noisy_too() -> None:
    derivatives, loads = covered(0.0, 30, known_start=False)
    least = 0.95 - 3.0 * np.sqrt(0.95 * 0.05 / 60.0)
    assert least < derivatives
    assert least < loads


def test_slopes_of_the_loads_are_those_of_differences() -> None:
    system = _as_system(known_model())
    record = record_of(known_model().predict(*noise_motion(1, 60), substeps=1), ("alpha", "q"), OUTPUTS, 1)
    scale = np.ones(2)
    slopes = load_slopes(system, record, scale, free_direct=True)
    which = Parameters(system, free_direct=True)
    at = which.pack(system)
    for j in range(at.size):
        change = np.zeros_like(at)
        change[j] = 1e-5
        up, down = (which.unpack(at + sign * change).respond(record.inputs) for sign in (1.0, -1.0))
        np.testing.assert_allclose(slopes[:, :, j], (up - down) / 2e-5, atol=1e-6)


def test_modal_form_is_the_same_model() -> None:
    again = _as_model(known_model(), _as_system(known_model()))
    k = np.array([0.0, 0.2, 1.0])
    np.testing.assert_allclose(again.frequency_response(k), known_model().frequency_response(k), atol=1e-12)


def spread(level: float) -> Array:
    exact = two_states().predict(*noise_motion(3, 200), substeps=1)
    found = refine_model(two_states(), [noisy(exact, 1, 0.0, level)], substeps=1)
    return np.array([record.uncertainty for record in found.derivatives()], dtype=float)


def test_uncertainty_is_proportional_to_the_noise() -> None:
    np.testing.assert_allclose(spread(2e-4), 2.0 * spread(1e-4), rtol=1e-3)


def test_derivative_of_a_model_without_lag_has_the_variance_of_linear_regression() -> None:
    """D alone is to be found: ``sigma^2 (U^T U)^-1``, in closed form."""
    model = replace(two_states(), a=np.array([[-50.0]]), b=np.zeros((1, 2)), c=np.zeros((2, 1)))
    exact = model.predict(*noise_motion(3, 400), substeps=1)
    history = noisy(exact, 2, 0.0)
    found = refine_model(model, [history], substeps=1)
    u = np.stack([history.alpha - CONDITION.alpha, history.rate[:, 1] * REFERENCE.length / (2.0 * CONDITION.speed)], 1)
    variance = np.linalg.inv(u.T @ u)[0, 0] * found.noise[0] ** 2
    record = found.derivatives().one("CN_alpha")
    assert record.uncertainty == pytest.approx(np.sqrt(variance), rel=0.25)


def test_summary_plot_and_refusals() -> None:
    exact = two_states().predict(*noise_motion(3, 100), substeps=1)
    found = refine_model(two_states(), [noisy(exact, 0, 0.0)], substeps=1, known_direct=True)
    np.testing.assert_array_equal(found.model.d, two_states().d)
    assert "Cm_q = " in found.summary()
    band = found.predict(exact)
    assert "95% bands" in band.summary()
    assert len(band.plot().axes) == 2
    assert found.frequency_deviation([0.1]).shape == (2, 1, 2, 2)
    with pytest.raises(InputError, match="level is 2"):
        band.limits("CN", 2.0)
    with pytest.raises(InputError, match="no histories"):
        refine_model(two_states(), [])


def test_autocovariance_is_that_of_the_process() -> None:
    rng = np.random.default_rng(5)
    white = rng.normal(size=20000)
    # to the accuracy of 20,000 samples
    np.testing.assert_allclose(autocovariance([white]), [1.0], atol=0.03)
    coloured = white.copy()
    for i in range(1, white.size):
        coloured[i] += 0.8 * coloured[i - 1]
    found = autocovariance([coloured[:12000], coloured[12000:]])
    exact = 0.8 ** np.arange(15) / (1.0 - 0.64)
    np.testing.assert_allclose(found[:15], exact, atol=0.15)


def test_uneven_steps_are_taken_as_white_only() -> None:
    data = [two_states().unsteady(CONDITION, motion, np.geomspace(1.0, 1.2, 80) - 1.0) for motion in (
        AlphaStep(CONDITION, 0.01), PitchRateStep(CONDITION, 20.0))]  # fmt: skip
    steps = [noisy(one, seed, 0.0, 0.01) for seed, one in enumerate(data)]
    with pytest.raises(InputError, match="uneven time step"):
        refine_model(two_states(), steps)
    found = refine_model(two_states(), steps, white=True)
    record = found.derivatives().one("Cm_q")
    assert record.uncertainty is not None
    assert abs(record.value - two_states().derivatives().value("Cm_q")) < 4.0 * record.uncertainty


def test_what_the_histories_cannot_tell_apart_is_infinitely_uncertain() -> None:
    """With q always in proportion to alpha, what is of either is anybody's guess."""
    true = two_states()
    exact = true.predict(*noise_motion(3, 300), substeps=1)
    rate = np.zeros_like(exact.rate)
    rate[:, 1] = (exact.alpha - exact.alpha[0]) * 2.0 * CONDITION.speed / REFERENCE.length
    motion = TabulatedMotion(exact.time, exact.velocity, rate)
    history = noisy(true.predict(motion, exact.time, substeps=1), 0, 0.0)
    found = refine_model(true, [history], substeps=1)
    assert all(np.isinf(record.uncertainty or 0.0) for record in found.derivatives() if record.name in NAMES)
    same, other = found.predict(history), found.predict(*noise_motion(8, 60))
    assert np.all(np.isfinite(same.deviation))
    assert np.all(np.isinf(other.deviation[5:]))
