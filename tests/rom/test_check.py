"""The prediction check: what it measures, on loads whose error is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.history import History
from indicial.motion import AlphaStep, PitchOscillation
from indicial.rom import check_prediction
from rom.cases import CONDITION, REFERENCE, known_system
from rom.test_state_space import known_model

K, AMPLITUDE = 0.25, 0.02


def oscillation(cycles: float = 3.0, **half: bool) -> History:
    motion = PitchOscillation.from_reduced_frequency(CONDITION, REFERENCE, AMPLITUDE, K, **half)
    return known_system().unsteady(CONDITION, motion, np.linspace(0.0, cycles * motion.period, int(80 * cycles) + 1))


def test_exact_model_is_found_exact() -> None:
    check = check_prediction(known_model(), oscillation())
    assert check.worst < 1e-4


def test_motion_between_samples_is_followed_not_cut() -> None:
    history = oscillation()
    cut = check_prediction_linear(history)
    assert check_prediction(known_model(), history).worst < 0.1 * cut


def check_prediction_linear(history: History) -> float:
    """Worst relative error with the motion linear between samples, over the outputs."""
    found = known_model().predict(history, substeps=1)
    errors = [np.sqrt(np.mean((found[n] - history[n]) ** 2)) / np.std(history[n]) for n in ("CN", "Cm")]
    return float(max(errors))


@pytest.mark.parametrize(("half", "column"), [({}, None), ({"rotates": False}, 0), ({"varies_alpha": False}, 3)])
def test_damping_part_is_that_of_the_transfer_function(half: dict[str, bool], column: int | None) -> None:
    history = oscillation(6.0, **half)
    # from the fourth cycle on, transients are gone
    check = check_prediction(known_model(), history, since=history.s[240])
    h = known_system().transfer(K)[4]
    exact = {None: h[0].imag / K + h[3].real, 0: h[0].imag / K, 3: h[3].real}[column]
    assert check["Cm"].damping_measured == pytest.approx(exact, rel=2e-3)
    assert check["Cm"].damping_predicted == pytest.approx(exact, rel=4e-3)


def test_known_error_is_measured() -> None:
    """A load error of 0.01 sin against an unsteady part whose size is known."""
    history = oscillation(1.0)
    wave = 0.01 * np.sin(2.0 * np.pi * history.time / history.time[-1])
    loads = history.coefficients.copy()
    loads[:, 2] = known_model().predict(history)["CN"] + wave
    check = check_prediction(known_model(), replace(history, coefficients=loads))["CN"]
    assert check.rms == pytest.approx(0.01 / np.sqrt(2.0), rel=1e-3)
    assert check.peak == pytest.approx(0.01, rel=1e-3)
    # the motion is A sin in alpha, so the error is in phase: the damping part does not see it
    assert check.damping_measured == pytest.approx(check.damping_predicted, abs=1e-3)


def test_wrong_mean_counts() -> None:
    history = oscillation()
    loads = history.coefficients.copy()
    loads[:, 2] += 0.05
    check = check_prediction(known_model(), replace(history, coefficients=loads))["CN"]
    assert check.rms == pytest.approx(0.05, rel=1e-3)


def test_wrong_damping_is_told() -> None:
    model = known_model()
    wrong = replace(model, d=model.d * [[1.0, 1.0], [1.0, 1.1]])
    check = check_prediction(wrong, oscillation())
    assert check["Cm"].damping_error is not None
    gain = abs(check["Cm"].damping_predicted - check["Cm"].damping_measured)  # type: ignore[operator]
    assert gain == pytest.approx(0.6, rel=0.02)
    assert "damping part" in check.summary()
    assert "Cm: off by" in check.summary()


def test_step_has_no_damping_part() -> None:
    step = known_system().unsteady(CONDITION, AlphaStep(CONDITION, 0.01), np.linspace(0.0, 0.01, 50))
    check = check_prediction(known_model(), step)["CN"]
    assert check.damping_measured is None
    assert check.damping_error is None
    assert check.relative_rms < 1e-10


def test_mismatches_are_refused() -> None:
    history = oscillation()
    with pytest.raises(InputError, match="reference quantities"):
        check_prediction(known_model(), replace(history, reference=replace(REFERENCE, area=0.3)))
    with pytest.raises(InputError, match="fewer than three samples"):
        check_prediction(known_model(), history, since=1e9)
    with pytest.raises(InputError, match="was not checked"):
        check_prediction(known_model(), history)["CA"]


def test_plot_shows_history_and_loop_of_each_coefficient() -> None:
    assert len(check_prediction(known_model(), oscillation(1.0)).plot().axes) == 4
