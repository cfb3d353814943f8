"""The nonlinear indicial model: linear where nothing bends, on the static curve when slow, right at large angles."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from indicial.conventions import Array, ReferenceQuantities, reduced_time, time_from_reduced
from indicial.errors import InputError
from indicial.history import History
from indicial.motion import AlphaStep, FlightCondition, PitchOscillation
from indicial.rom import NonlinearModel, StepResponse, StepResponses, check_prediction, nonlinear_model, realise
from rom.cases import known_system, responses

REFERENCE = ReferenceQuantities(length=0.5, area=0.2)
CONDITION = FlightCondition(mach=2.0)
ANGLES = np.radians(np.linspace(-16.0, 16.0, 9))
RATES = np.array([0.25, 0.9])
Q_RATE = 0.5


def static(a: Array) -> Array:
    """CN, Cm: softening normal force, moment that turns round."""
    return np.stack([3.0 * np.sin(a) - 8.0 * a**3, -0.6 * a + 6.0 * a**3], axis=-1)


def static_slope(a: float) -> Array:
    return np.array([3.0 * np.cos(a) - 24.0 * a**2, -0.6 + 18.0 * a**2])


def lagging(a: Array) -> Array:
    """What lags, for each rate: curves of alpha, shape a.shape + (lags, outputs)."""
    first = np.stack([0.8 * a + 4.0 * a**3, -0.3 * a + 2.0 * a**3], axis=-1)
    second = np.stack([-0.5 * a + 0.0 * a, 0.2 * a + 1.0 * a**2], axis=-1)
    return np.stack([first, second], axis=-2)


def lagging_slope(a: float) -> Array:
    return np.array([[0.8 + 12.0 * a**2, -0.3 + 6.0 * a**2], [-0.5, 0.2 + 2.0 * a]])


def q_gain(a: Array) -> tuple[Array, Array]:
    """Settled response to q and the part of it that lags."""
    return np.stack([4.0 + a, -9.0 + 5.0 * a**2], axis=-1), np.stack([1.0 - a**2, -2.0 + a], axis=-1)


def small_steps(a: float) -> StepResponses:
    """Exact responses to small steps about an angle."""
    s = 40.0 * np.linspace(0.0, 1.0, 81) ** 2
    values = static_slope(a) - np.exp(-np.outer(s, RATES)) @ lagging_slope(a)
    settled, lag = q_gain(np.array(a))
    both = (
        StepResponse("alpha", s, values, final=static_slope(a)),
        StepResponse("q", s, settled - np.exp(-Q_RATE * s)[:, None] * lag, final=settled),
    )
    baseline = np.zeros(6)
    baseline[[2, 4]] = static(np.array(a))
    return StepResponses(both, ("CN", "Cm"), baseline, replace(CONDITION, alpha=a), REFERENCE)


@cache
def model() -> NonlinearModel:
    return nonlinear_model([small_steps(float(a)) for a in ANGLES], order=2)


def plant(history_motion: PitchOscillation, times: Array) -> Array:
    """The plant's loads, lags integrated by fourth-order Runge-Kutta, shape (n, 2)."""
    s = reduced_time(times, CONDITION.speed, REFERENCE.length)
    scale = REFERENCE.length / (2.0 * CONDITION.speed)

    def driven(at: float) -> tuple[Array, Array, Array]:
        t = np.asarray(at * scale)
        a, q = history_motion.alpha(t), history_motion.rate(t)[1] * scale
        settled, lag = q_gain(a)
        return static(a) + settled * q, lagging(a), lag * q

    fast, slow = RATES[:, None], Q_RATE
    # at rest: q too is that before the motion
    t0 = driven(0.0)
    w, v = t0[1].copy(), t0[2].copy()
    loads = [t0[0]]
    for s0, s1 in pairwise(s):
        for x0 in np.linspace(s0, s1, 4)[:-1]:
            h = (s1 - s0) / 3.0
            ends = [driven(x0), driven(x0 + 0.5 * h), driven(x0 + 0.5 * h), driven(x0 + h)]
            kw, kv, dw, dv = [], [], 0.0 * w, 0.0 * v
            for part, (weight, one) in enumerate(zip((0.0, 0.5, 0.5, 1.0), ends, strict=True)):
                shift_w = weight * h * kw[-1] if part else dw
                shift_v = weight * h * kv[-1] if part else dv
                kw.append(fast * (one[1] - w - shift_w))
                kv.append(slow * (one[2] - v - shift_v))
            w = w + h * (kw[0] + 2.0 * kw[1] + 2.0 * kw[2] + kw[3]) / 6.0
            v = v + h * (kv[0] + 2.0 * kv[1] + 2.0 * kv[2] + kv[3]) / 6.0
        now = driven(s1)
        loads.append(now[0] - (now[1] - w).sum(axis=0) - (now[2] - v))
    return np.array(loads)


def oscillation(k: float, amplitude: float, mean: float = 0.0) -> PitchOscillation:
    condition = replace(CONDITION, alpha=mean)
    return PitchOscillation.from_reduced_frequency(condition, REFERENCE, amplitude, k)


@pytest.mark.parametrize("k", [0.05, 0.3, 1.0])
def test_a_bent_plant_is_followed_through_fifteen_degrees(k):
    motion = oscillation(k, np.radians(15.0))
    times = np.linspace(0.0, 2.0 * motion.period, 161)
    exact = plant(motion, times)
    found = model().predict(motion, times)
    loads = np.stack([found["CN"], found["Cm"]], axis=1)
    off = np.max(np.abs(loads - exact) / np.max(np.abs(exact), axis=0))
    assert off < 0.005
    # and no linear model could
    linear = realise(small_steps(0.0), order=2).predict(motion, times)
    assert np.max(np.abs(linear["Cm"] - exact[:, 1])) > 10.0 * off * np.max(np.abs(exact[:, 1]))


def test_where_nothing_depends_on_the_angle_it_is_the_linear_model():
    system = known_system()
    base = FlightCondition(mach=2.0)
    s = 40.0 * np.linspace(0.0, 1.0, 101) ** 2
    angles = (-0.1, 0.0, 0.1)
    points = [responses(system, replace(base, alpha=a), s) for a in angles]
    bent, linear = nonlinear_model(points, order=3), realise(points[1], order=3)
    motion = PitchOscillation.from_reduced_frequency(base, system.reference, 0.08, 0.2)
    times = np.linspace(0.0, motion.period, 120)
    for name in ("CN", "Cm"):
        peak = np.ptp(linear.predict(motion, times)[name])
        assert np.max(np.abs(bent.predict(motion, times)[name] - linear.predict(motion, times)[name])) < 2e-3 * peak


def test_a_slow_motion_runs_along_the_static_curve():
    motion = oscillation(1e-5, np.radians(15.0))
    motion = replace(motion, rotates=False)
    times = np.linspace(0.0, motion.period, 200)
    found = model().predict(motion, times)
    angle = motion.alpha(times)
    np.testing.assert_allclose(found["CN"], model().static_curve(angle)[:, 0], atol=1e-4)
    np.testing.assert_allclose(found["CN"], static(angle)[:, 0], atol=1e-3)


def test_a_large_step_jumps_by_the_sum_of_the_small_jumps_and_settles_on_the_curve():
    start, size = float(np.radians(-10.0)), float(np.radians(20.0))
    times = time_from_reduced(np.linspace(0.0, 60.0, 200), CONDITION.speed, REFERENCE.length)
    found = model().predict(AlphaStep(replace(CONDITION, alpha=start), size), times)
    ends = np.array([start, start + size])
    jump = np.diff(static(ends) - lagging(ends).sum(axis=1), axis=0)[0]
    np.testing.assert_allclose(found.coefficients[0, [2, 4]] - found.before[[2, 4]], jump, rtol=2e-3)
    np.testing.assert_allclose(found.coefficients[-1, [2, 4]], static(ends)[1], rtol=2e-3)


def test_steady_states_that_contradict_the_steps_are_seen():
    good = model()
    assert np.max(good.mismatch()) < 0.02
    wrong = replace(good, baselines=1.5 * good.baselines)
    assert np.min(wrong.mismatch()) > 0.05


def test_a_prediction_is_checked_like_that_of_any_model():
    motion = oscillation(0.3, np.radians(12.0))
    times = np.linspace(0.0, motion.period, 80)
    predicted = model().predict(motion, times)
    measured = replace(predicted, coefficients=predicted.coefficients * 1.01)
    assert isinstance(measured, History)
    assert 0.005 < check_prediction(model(), measured).worst_peak < 0.02


def test_the_file_gives_the_same_loads_to_the_last_digit(tmp_path):
    model().to_json(tmp_path / "model.json")
    again = NonlinearModel.from_json(tmp_path / "model.json")
    motion = oscillation(0.3, np.radians(12.0))
    times = np.linspace(0.0, motion.period, 30)
    np.testing.assert_array_equal(
        again.predict(motion, times).coefficients, model().predict(motion, times).coefficients
    )
    assert again.summary() == model().summary()


def test_angles_beyond_the_known_ones_are_refused():
    motion = oscillation(0.3, np.radians(20.0))
    with pytest.raises(InputError, match="from alpha -20 to 20 deg"):
        model().predict(motion, np.linspace(0.0, motion.period, 81))


def test_a_history_of_other_reference_quantities_is_refused():
    motion = oscillation(0.3, np.radians(5.0))
    history = model().predict(motion, np.linspace(0.0, motion.period, 30))
    other = replace(history, reference=replace(history.reference, length=2.0 * history.reference.length))
    with pytest.raises(InputError, match="differ in reference quantities"):
        model().predict(other)


def test_a_damaged_file_is_named_with_what_it_lacks(tmp_path):
    path = tmp_path / "model.json"
    model().to_json(path)
    path.write_text(path.read_text().replace('"baselines"', '"base_lines"'))
    with pytest.raises(InputError, match=r"model\.json: damaged, a part is missing \(baselines\)"):
        NonlinearModel.from_json(path)
