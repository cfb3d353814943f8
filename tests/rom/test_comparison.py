"""All realisations of the same data side by side."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.history import History
from indicial.motion import FlightCondition, PitchOscillation
from indicial.rom import Comparison, ConvolutionModel, compare
from indicial.rom.comparison import frequency_response, noise_history
from indicial.solver import Solver
from rom.cases import COLUMNS, CONDITION, OUTPUTS, REFERENCE, ROWS, graded, known_system, responses
from rom.linearised import known_flow

METHODS = {
    "exponential", "exponential, shared poles", "modal", "modal, shared poles", "era", "vector fitting", "okid + era",
    "balanced truncation",
}  # fmt: skip


def oscillation(solver: Solver, condition: FlightCondition, k: float) -> History:
    motion = PitchOscillation.from_reduced_frequency(condition, solver.reference, 0.01, k)
    return solver.unsteady(condition, motion, np.linspace(0.0, 2.0 * motion.period, 121))


@pytest.fixture(scope="module")
def compared() -> Comparison:
    data = responses(known_system(), CONDITION, graded(120.0, 200))
    return compare(data, [oscillation(known_system(), CONDITION, k) for k in (0.1, 0.4)], max_order=4)


def test_every_realisation_is_made_stable_and_keeps_the_feedthrough(compared: Comparison) -> None:
    assert {row.method for row in compared.rows} == METHODS
    assert compared.refused == {}
    for row in compared.rows:
        assert np.max(row.model.poles.real) < 0.0
        np.testing.assert_array_equal(row.model.d, compared.data.initial)


def test_those_that_can_hold_the_system_predict_what_they_have_not_seen(compared: Comparison) -> None:
    for method in ("modal", "vector fitting", "okid + era", "balanced truncation"):
        assert compared[method].error < 5e-3, compared.summary()


def test_the_best_has_about_the_least_error(compared: Comparison) -> None:
    assert compared.best.error <= 1.25 * min(row.error for row in compared.rows)
    assert compared.summary().count("<- best") == 1
    assert len(compared.plot().axes) == 4


def test_frequency_response_made_of_steps_is_that_of_the_system() -> None:
    data = responses(known_system(), CONDITION, graded(150.0, 400))
    k = np.array([0.05, 0.3, 1.0])
    made = frequency_response(data, k)
    for one, values in zip(k, made.values, strict=True):
        exact = known_system().transfer(float(one))[np.ix_(ROWS, COLUMNS)]
        np.testing.assert_allclose(values[ROWS], exact, atol=2e-3 * np.max(np.abs(exact)))
    np.testing.assert_array_equal(made.direct[ROWS], data.initial)


def test_made_noise_moves_every_input_and_has_the_loads_of_convolution() -> None:
    data = responses(known_system(), CONDITION, graded(60.0, 100))
    noise = noise_history(data, 0.3)
    assert np.ptp(noise.alpha) > 0.0
    assert np.ptp(noise.rate[:, 1]) > 0.0
    again = ConvolutionModel(data).predict(noise, substeps=1)
    np.testing.assert_allclose(again.coefficients, noise.coefficients, atol=1e-10)


def test_a_realisation_that_cannot_be_made_is_told_with_the_reason() -> None:
    data = responses(known_system(), CONDITION, graded(60.0, 100))
    seen = oscillation(known_system(), CONDITION, 0.2)
    short = replace(seen, **{name: getattr(seen, name)[:20] for name in ("time", "coefficients", "velocity", "rate")})
    found = compare(data, [seen], motions=[short], max_order=2)
    assert "20 samples" in found.refused["okid + era"]
    assert "okid + era: refused" in found.summary()
    with pytest.raises(InputError, match="no motion to judge by"):
        compare(data, [])
    with pytest.raises(InputError, match="was not compared"):
        found["projection"]
    assert found.data.outputs == OUTPUTS
    assert found.data.reference == REFERENCE


def test_a_linearised_flow_is_projected_beside_the_others() -> None:
    data = responses(known_system(), CONDITION, graded(120.0, 150))
    seen, baseline = oscillation(known_system(), CONDITION, 0.2), known_flow().baseline
    # the flow's own loads in the steady state
    shift = baseline - data.baseline
    seen = replace(seen, coefficients=seen.coefficients + shift, before=seen.before + shift)
    found = compare(replace(data, baseline=baseline), [seen], flow=known_flow(), k_max=1.0, max_order=2)
    assert found["projection"].error < 2e-3
