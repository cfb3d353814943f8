"""Experiments run in worker processes, once each, and are kept in files."""

import math
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from indicial.conventions import ReferenceQuantities
from indicial.errors import DivergenceError
from indicial.motion import AlphaStep, FlightCondition, Rates
from indicial.pipeline.experiments import ExperimentPool
from indicial.solver import Solver
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
