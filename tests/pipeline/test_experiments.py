"""Experiments run in worker processes, once each, and are kept in files."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from indicial.conventions import ReferenceQuantities
from indicial.errors import DivergenceError, InputError
from indicial.motion import AlphaStep, FlightCondition, Rates
from indicial.pipeline.experiments import FrequencyExperiment, ProjectionExperiment
from indicial.pipeline.pool import ExperimentPool
from indicial.solver import FrequencySolver, Solver
from pipeline.oracle import Oracle, missile

REFERENCE = ReferenceQuantities(0.03, math.pi * 0.03**2 / 4, (0.165, 0.0, 0.0))
CONDITION = FlightCondition(2.0)
TIMES = np.linspace(0.0, 0.01, 20)


def test_results_are_those_of_the_solver_itself_and_are_not_computed_twice(tmp_path):
    factory = Oracle(REFERENCE, tmp_path / "log")
    exact = missile(REFERENCE)
    step = AlphaStep(CONDITION, math.radians(0.25))
    seen = []
    with ExperimentPool(factory, REFERENCE, tmp_path / "kept", 2, lambda *done: seen.append(done)) as pool:
        assert isinstance(pool, Solver)
        with ThreadPoolExecutor(4) as threads:
            states = list(threads.map(lambda _: pool.steady(CONDITION, Rates(q=3.0)), range(4)))
        history = pool.unsteady(CONDITION, step, TIMES)
    for state in states:
        assert np.array_equal(state.coefficients, exact.steady(CONDITION, Rates(q=3.0)).coefficients)
    assert np.allclose(history.coefficients, exact.unsteady(CONDITION, step, TIMES).coefficients, rtol=1e-14)
    assert sorted((tmp_path / "log").read_text().split("\n")) == ["", "alpha_step half", "steady half"]
    assert ("alpha step +0.25 deg", 1.0) in seen

    with ExperimentPool(factory, REFERENCE, tmp_path / "kept", 2) as pool:
        again = pool.unsteady(CONDITION, step, TIMES)
    assert np.array_equal(again.coefficients, history.coefficients)
    assert len((tmp_path / "log").read_text().splitlines()) == 2


def test_frequency_responses_are_kept_and_lateral_ones_take_half_a_body(tmp_path):
    factory, exact = Oracle(REFERENCE, tmp_path / "log"), missile(REFERENCE)
    with ExperimentPool(factory, REFERENCE, tmp_path / "kept", 1) as pool:
        assert isinstance(pool, FrequencySolver)
        response = pool.frequency_response(CONDITION, [0.0, 0.3], ("alpha", "p"))
        assert np.array_equal(response.channel("Cl", "p"), [exact.transfer(k)[3, 2] for k in (0.0, 0.3)])
    with ExperimentPool(factory, REFERENCE, tmp_path / "kept", 1) as pool:
        again = pool.frequency_response(CONDITION, [0.0, 0.3], ("alpha", "p"))
        other = pool.frequency_response(CONDITION, [0.0, 0.4], ("alpha", "p"))
    assert np.array_equal(again.values, response.values)
    assert other.k[1] == 0.4
    assert (tmp_path / "log").read_text().splitlines() == 2 * ["frequency_response half"]


def test_a_projected_model_is_kept_with_what_is_told_of_it(tmp_path):
    factory = Oracle(REFERENCE, tmp_path / "log")
    kept = []
    for _ in range(2):
        with ExperimentPool(factory, REFERENCE, tmp_path / "kept", 1) as pool:
            kept.append(pool.projection(CONDITION, 0.5, 1e-3))
    first, again = kept
    assert np.array_equal(first.model.a, again.model.a)
    assert first.facts == again.facts
    assert first.facts["met"]
    exact = missile(REFERENCE).transfer(0.3)[np.ix_([0, 2, 4], [0, 3])]
    assert np.max(np.abs(first.model.frequency_response(0.3)[0] - exact)) < 1e-3 * np.max(np.abs(exact))
    assert (tmp_path / "log").read_text().splitlines() == ["projection half"]


def test_a_solver_that_cannot_be_linearised_says_so(tmp_path):
    experiment = FrequencyExperiment(CONDITION, (0.1,), ("alpha",))
    with pytest.raises(InputError, match="LinearSystem has no frequency response: it cannot be linearised"):
        experiment.perform(missile(REFERENCE), tmp_path / "answer.nc")
    with pytest.raises(InputError, match="LinearSystem cannot be linearised: no model can be projected"):
        ProjectionExperiment(CONDITION, 0.5, 1e-3).perform(missile(REFERENCE), tmp_path / "answer.json")


def test_another_time_axis_is_another_experiment(tmp_path):
    factory = Oracle(REFERENCE, tmp_path / "log")
    step = AlphaStep(CONDITION, math.radians(0.25))
    with ExperimentPool(factory, REFERENCE, tmp_path / "kept", 1) as pool:
        pool.unsteady(CONDITION, step, TIMES)
        assert pool.unsteady(CONDITION, step, 2.0 * TIMES).time[-1] == 0.02


def test_roll_and_sideslip_are_sent_to_the_whole_model(tmp_path):
    factory = Oracle(REFERENCE, tmp_path / "log")
    with ExperimentPool(factory, REFERENCE, tmp_path / "kept", 1) as pool:
        pool.steady(CONDITION, Rates(p=100.0))
        pool.steady(FlightCondition(2.0, beta=0.01))
        pool.steady(FlightCondition(2.0, alpha=0.01))
    assert (tmp_path / "log").read_text().split() == ["steady", "whole", "steady", "whole", "steady", "half"]


def test_a_diverging_experiment_is_named_and_leaves_the_others(tmp_path):
    factory = Oracle(REFERENCE, tmp_path / "log", fails_on="alpha_step")
    with ExperimentPool(factory, REFERENCE, tmp_path / "kept", 1) as pool:
        pool.steady(CONDITION)
        with pytest.raises(DivergenceError, match=r"alpha step \+0.25 deg: residual .*; try a smaller time step"):
            pool.unsteady(CONDITION, AlphaStep(CONDITION, math.radians(0.25)), TIMES)
    assert [path.suffix for path in (tmp_path / "kept").iterdir()] == [".json"]
