"""Motions that do not tell alpha from q are said to be so; others are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from indicial.conventions import time_from_reduced
from indicial.history import History
from indicial.motion import Motion, Multisine, PitchOscillation, TabulatedMotion
from indicial.rom import identify
from rom.cases import CONDITION, REFERENCE
from rom.test_identification import noise_motion
from rom.test_state_space import known_model


def measured(motion: Motion, noise: float, end: float = 149.5, count: int = 300) -> History:
    times = time_from_reduced(np.linspace(0.0, end, count), CONDITION.speed, REFERENCE.length)
    exact = known_model().predict(motion, times)
    wrong = np.random.default_rng(5).normal(size=exact.coefficients.shape)
    return replace(exact, coefficients=exact.coefficients + noise * np.std(exact.coefficients, axis=0) * wrong)


def proportional() -> Motion:
    """Random alpha, and q c/2V = 0.3 alpha."""
    motion, _ = noise_motion(1, 300)
    alpha = np.arctan2(motion.velocities[:, 2], motion.velocities[:, 0]) - CONDITION.alpha
    rates = np.zeros((300, 3))
    rates[:, 1] = 0.3 * alpha * 2.0 * CONDITION.speed / REFERENCE.length
    return TabulatedMotion(motion.times, motion.velocities, rates)


@pytest.mark.parametrize("noise", [0.0, 0.02])
@pytest.mark.parametrize("which", ["one oscillation", "q proportional to alpha"])
def test_motions_that_do_not_tell_alpha_from_q_give_a_warning(
    which: str, noise: float, caplog: pytest.LogCaptureFixture
) -> None:
    one = PitchOscillation.from_reduced_frequency(CONDITION, REFERENCE, 0.02, 0.3)
    identify([measured(one if which == "one oscillation" else proportional(), noise)], order=2)
    assert "do not tell alpha and q apart" in caplog.text
    assert "Multisine" in caplog.text


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_alpha_and_q_with_frequencies_of_their_own_give_none(noise: float, caplog: pytest.LogCaptureFixture) -> None:
    motion = Multisine.from_reduced_frequencies(CONDITION, REFERENCE, 0.05 * np.arange(1, 9), 0.01, 0.01)
    model = identify([measured(motion, noise)], order=5)
    np.testing.assert_allclose(model.static_gain, known_model().static_gain, rtol=0.1)
    assert "apart" not in caplog.text
