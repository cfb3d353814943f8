"""From histories to a model in one call: what is made of which histories, and what is said when it cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.motion import Multisine, PitchOscillation
from indicial.rom import build_model
from rom.cases import CONDITION, REFERENCE, known_system, steps
from rom.test_state_space import known_model

TIMES = REFERENCE.length / (2.0 * CONDITION.speed) * np.arange(0.0, 60.0, 0.25)


def oscillation():
    motion = PitchOscillation.from_reduced_frequency(CONDITION, REFERENCE, 0.01, 0.2)
    return known_system().unsteady(CONDITION, motion, np.linspace(0.0, 3.0 * motion.period, 150))


def test_steps_make_the_model_and_other_motions_judge_it(tmp_path):
    s = 40.0 * np.linspace(0.0, 1.0, 101) ** 1.7
    built = build_model([*steps(known_system(), CONDITION, s), oscillation()], max_order=3)
    assert len(built.checks) == 1
    assert built.checks[0].worst_peak < 0.01
    files = {path.name for path in built.write(tmp_path)}
    assert {"model.json", "model.nc", "derivatives.json", "step_responses.nc", "summary.txt", "model.png"} <= files
    assert all((tmp_path / name).stat().st_size > 0 for name in files)


def test_without_steps_the_model_is_identified_from_the_motions():
    k = 0.2 * np.arange(1, 19)  # to well beyond the fastest lag, for D is found too
    wave = Multisine.from_reduced_frequencies(CONDITION, REFERENCE, k, 0.004, 0.004)
    plant = known_model()
    built = build_model([plant.predict(wave, TIMES)], unseen=[plant.predict(oscillation())])
    assert built.responses is None
    assert built.checks[0].worst_peak < 0.02


def test_with_alpha_alone_there_is_a_model_but_no_word_on_pitching():
    s = 80.0 * np.linspace(0.0, 1.0, 101) ** 1.7
    built = build_model(steps(known_system(), CONDITION, s)[:1], max_order=2)
    assert built.model.inputs == ("alpha",)
    assert built.quasi_steady is None
    assert "no prediction check" in built.summary()
    assert built.derivatives.one("CN_alphadot").uncertainty is not None


def test_realisations_side_by_side_need_a_motion_to_judge_them_by():
    s = 40.0 * np.linspace(0.0, 1.0, 101) ** 1.7
    with pytest.raises(InputError, match="judged by motions they have not seen"):
        build_model(steps(known_system(), CONDITION, s), side_by_side=True)
