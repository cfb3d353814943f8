"""The multisine: its frequencies, its start, what it refuses."""

from __future__ import annotations

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.motion import Multisine
from rom.cases import CONDITION, REFERENCE

K = 0.05 * np.arange(1, 9)


def test_alpha_and_rate_hold_the_frequencies_dealt_to_them_and_no_others() -> None:
    motion = Multisine.from_reduced_frequencies(CONDITION, REFERENCE, K, 0.01, 0.002)
    period = 2.0 * np.pi / 0.05
    s = np.arange(512) * period / 512
    t = s * REFERENCE.length / (2.0 * CONDITION.speed)
    rate = motion.rate(t)[:, 1] * REFERENCE.length / (2.0 * CONDITION.speed)
    for values, of, amplitude in ((motion.alpha(t) - CONDITION.alpha, K[::2], 0.01), (rate, K[1::2], 0.002)):
        lines = 2.0 * np.abs(np.fft.rfft(values)) / 512
        wanted = np.zeros_like(lines)
        wanted[np.rint(of / 0.05).astype(int)] = amplitude
        np.testing.assert_allclose(lines, wanted, atol=1e-12)


def test_it_starts_from_the_condition() -> None:
    motion = Multisine.from_reduced_frequencies(CONDITION, REFERENCE, K, 0.01, 0.002)
    np.testing.assert_allclose(motion.velocity_before, CONDITION.velocity, atol=1e-9)
    np.testing.assert_allclose(motion.rate_before, 0.0, atol=1e-9)


def test_repeated_or_missing_frequencies_are_refused() -> None:
    for k in ([], [0.1, 0.1], [0.1, -0.2]):
        with pytest.raises(InputError, match=r"frequenc|k is"):
            Multisine.from_reduced_frequencies(CONDITION, REFERENCE, k, 0.01, 0.002)
