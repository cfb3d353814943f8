"""The finite-volume solver behind its protocol: resuming, refusing, failing, and the number of threads."""

import os
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from indicial.cfd import FiniteVolumeSolver, FlowSettings
from indicial.cfd.mesh import cone_mesh, plate_mesh
from indicial.cfd.shapes import Cone
from indicial.conventions import ReferenceQuantities
from indicial.errors import DivergenceError, InputError
from indicial.history import History
from indicial.methods import forced_oscillation, indicial_response
from indicial.motion import AlphaStep, FlightCondition, PitchRateStep, Rates

CONDITION = FlightCondition(2.0)
TIMES = np.linspace(0.0, 2.0, 25) / CONDITION.speed
REFERENCE = ReferenceQuantities(1.0, 1.0)
EXACT = FlowSettings(unsteady_tolerance=1e-10)
"""Steps solved so closely that the way to their solution, which a resumed march takes anew, is not to be seen."""


def plate(folder: Path | None = None, progress: Callable[[float], None] | None = None) -> FiniteVolumeSolver:
    mesh = plate_mesh(n_chord=16, n_normal=12, height=0.4, ahead=0.2, behind=0.1)
    return FiniteVolumeSolver(mesh, REFERENCE, EXACT, folder=folder, progress=progress)


def alpha_step(solver: FiniteVolumeSolver) -> History:
    return solver.unsteady(CONDITION, AlphaStep(CONDITION, 0.01), TIMES)


def test_steps_taken_one_by_one_are_those_of_a_march() -> None:
    """Each tried twice, first with another motion: what is accepted is the march's, and a restored flow goes on."""
    solver, motion = plate(), AlphaStep(CONDITION, 0.01)
    whole = alpha_step(solver)
    flow = solver.stepping(CONDITION, motion.velocity_before, motion.rate_before)
    assert flow.loads() == pytest.approx(whole.before, abs=1e-12)
    for n in range(1, 9):
        dt = float(TIMES[n] - TIMES[n - 1])
        flow.try_step(dt, 1.001 * motion.velocity(TIMES[n]), motion.rate(TIMES[n]))
        loads = flow.try_step(dt, motion.velocity(TIMES[n]), motion.rate(TIMES[n]))
        assert loads == pytest.approx(whole.coefficients[n], abs=1e-9)
        flow.accept()
        if n == 5:
            kept = flow.arrays()
            flow = solver.stepping(CONDITION, motion.velocity_before, motion.rate_before)
            flow.restore(kept)
            assert flow.loads() == pytest.approx(whole.coefficients[n], abs=1e-9)


class KilledError(Exception):
    pass


def test_a_killed_march_resumes_and_gives_the_same_history(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A save is due at every look at the clock, as if each step took a minute."""
    clock = iter(range(0, 10**6, 60))
    monkeypatch.setattr("indicial.files.time", SimpleNamespace(monotonic=lambda: next(clock)))
    whole = alpha_step(plate())
    plate(tmp_path).start_from(CONDITION)

    def kill(fraction: float) -> None:
        if fraction > 0.5:
            raise KilledError

    with pytest.raises(KilledError):
        alpha_step(plate(tmp_path, kill))
    [kept] = tmp_path.glob("march-*.npz")
    told: list[float] = []
    resumed = alpha_step(plate(tmp_path, told.append))
    assert 8 <= len(told) <= 12, "half of the 24 steps, and no steady iterations"
    assert told[0] > 0.5
    largest = np.max(np.abs(whole.coefficients))
    assert resumed.coefficients == pytest.approx(whole.coefficients, abs=1e-9 * largest)
    assert np.array_equal(resumed.coefficients[:13], whole.coefficients[:13])
    assert not kept.exists()


def test_steady_states_are_read_back_from_the_folder(tmp_path: Path) -> None:
    first = plate(tmp_path).steady(CONDITION, Rates(q=10.0))
    told: list[float] = []
    again = plate(tmp_path, told.append).steady(CONDITION, Rates(q=10.0))
    assert told == []
    assert np.array_equal(first.coefficients, again.coefficients)
    assert first.convergence == again.convergence


def test_a_steady_state_of_another_mesh_is_not_read_back(tmp_path: Path) -> None:
    condition = FlightCondition(2.0, alpha=0.01)
    plate(tmp_path).steady(condition)
    told: list[float] = []
    mesh = plate_mesh(n_chord=17, n_normal=12, height=0.4, ahead=0.2, behind=0.1)
    FiniteVolumeSolver(mesh, REFERENCE, folder=tmp_path, progress=told.append).steady(condition)
    assert told


def test_a_steady_state_under_other_boundary_conditions_is_not_read_back(tmp_path: Path) -> None:
    condition = FlightCondition(2.0, alpha=0.01)
    plate(tmp_path).steady(condition)
    told: list[float] = []
    mesh = plate().mesh
    patches = tuple(replace(patch, kind="farfield") if patch.name == "outflow" else patch for patch in mesh.patches)
    other = replace(mesh, patches=patches)
    FiniteVolumeSolver(other, REFERENCE, EXACT, folder=tmp_path, progress=told.append).steady(condition)
    assert told


def test_the_number_of_periods_does_not_change_the_first_one() -> None:
    """Four periods among them: eighths of that record are half periods, at which a plunging body is where it was."""
    loads = [
        forced_oscillation.run(
            plate(), CONDITION, 0.005, 0.2, "plunge", periods=periods, steps_per_period=16
        ).coefficients[:17]
        for periods in (1, 4)
    ]
    assert loads[1] == pytest.approx(loads[0], abs=1e-8 * np.max(np.abs(loads[0])))


def test_a_step_that_leads_the_extrapolated_pressure_below_zero_ends_in_the_steady_state() -> None:
    step = AlphaStep(CONDITION, np.radians(20.0))
    solver = FiniteVolumeSolver(plate().mesh, REFERENCE)
    times = indicial_response.step_times(0.5, 1.12, 1.5, 12.0) / (2.0 * CONDITION.speed)
    last = solver.unsteady(CONDITION, step, times).coefficients[-1]
    final = solver.steady(*indicial_response.after(step)).coefficients
    assert last == pytest.approx(final, abs=2e-3 * np.max(np.abs(final)))


@pytest.mark.parametrize(
    ("condition", "rates"),
    [
        (CONDITION, Rates(p=1.0)),
        (CONDITION, Rates(r=1.0)),
        (FlightCondition(2.0, beta=0.01), Rates()),
    ],
    ids=["p", "r", "beta"],
)
def test_a_half_mesh_refuses_motion_through_its_mirror(condition: FlightCondition, rates: Rates) -> None:
    cone = Cone(10.0)
    solver = FiniteVolumeSolver(cone_mesh(cone, 0.4, mach=2.0), ReferenceQuantities(cone.length, cone.base_area))
    with pytest.raises(InputError, match="symmetry plane"):
        solver.steady(condition, rates)


@pytest.mark.parametrize(
    "times", [[1e-3, 2e-3], [0.0], [0.0, 1e-3, 1e-3], [[0.0, 1e-3]]], ids=["late", "one", "repeated", "table"]
)
def test_times_that_do_not_start_at_zero_and_increase_are_refused(times: list[float]) -> None:
    with pytest.raises(InputError, match="start at 0"):
        plate().unsteady(CONDITION, AlphaStep(CONDITION, 0.01), times)


def test_another_gas_is_refused() -> None:
    with pytest.raises(InputError, match=r"gamma is 1\.3"):
        plate().steady(FlightCondition(2.0, gamma=1.3))


def test_a_march_that_diverges_says_where_and_when_and_keeps_the_last_good_state(tmp_path: Path) -> None:
    solver = plate(tmp_path)
    violent = PitchRateStep(CONDITION, 20.0 * CONDITION.speed)
    with pytest.raises(DivergenceError) as caught:
        solver.unsteady(CONDITION, violent, np.linspace(0.0, 50.0, 6) / CONDITION.speed)
    message = str(caught.value)
    print(message)
    assert "step" in message
    assert " s" in message
    assert "x = " in message
    assert "smaller" in message
    [kept] = tmp_path.glob("march-*.npz")
    assert str(kept) in message
    with np.load(kept) as state:
        assert np.all(np.isfinite(state["q"]))
        assert np.all(state["q"][:, [0, 4]] > 0.0)


THREADS = """
import numba
from flow.test_solver import alpha_step, plate
assert numba.config.NUMBA_NUM_THREADS == 2
runs = []
for threads in (1, 2):
    numba.set_num_threads(threads)
    runs.append(alpha_step(plate()).coefficients)
assert (runs[0] == runs[1]).all(), abs(runs[0] - runs[1]).max()
"""


def test_a_march_is_the_same_for_one_and_two_threads() -> None:
    tests = Path(__file__).parents[1]
    environment = {**os.environ, "NUMBA_NUM_THREADS": "2", "PYTHONPATH": str(tests)}
    run = subprocess.run([sys.executable, "-c", THREADS], env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
