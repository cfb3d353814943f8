"""Flight with a solver in the loop: its order against flights of the same loads in the equations, resuming, ends."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from flightsim.support import FINNER, SPEED, derivative_model, first_order_lag
from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.flightsim import (
    ConstantAtmosphere,
    End,
    FlatEarth,
    InitialState,
    LoadFunction,
    Vehicle,
    build_dynamics,
    fly,
    fly_in_flow,
)
from indicial.motion import FlightCondition

LAG = first_order_lag(0.5)
START = InitialState.from_path(SPEED, alpha=0.05, rate=(0.0, 3.0, 0.0))
DURATION = 0.04


def quasi_steady(velocity: Array, rate: Array) -> list[float]:
    """Coefficients of the model below, for rates per c/2V, incidence sine-like."""
    speed = float(np.linalg.norm(velocity))
    e_y, e_z = velocity[1:] / speed
    p, q, r = rate * FINNER.reference.length / (2.0 * speed)
    normal, side = 12.0 * e_z + 100.0 * q, 12.0 * e_y - 100.0 * r
    return [0.55, -side, normal, -22.0 * p, -28.0 * e_z - 300.0 * q, 28.0 * e_y - 300.0 * r]


class LagFlow:
    """`LAG` in one plane as a solver: exact over a step for incidence and rate linear in it."""

    def __init__(self) -> None:
        self.reference = FINNER.reference

    def stepping(self, condition: FlightCondition, velocity: Array, rate: Array) -> "LagFlow":
        self.speed = condition.speed
        a, b, _, _ = LAG.matrices
        self.inputs = self.trial_inputs = self._inputs(velocity, rate)
        self.state = self.trial_state = -np.linalg.solve(a, b @ self.inputs[:2])
        return self

    def _inputs(self, velocity: Array, rate: Array) -> Array:
        speed = float(np.linalg.norm(velocity))
        return np.array([velocity[2] / speed, rate[1] * FINNER.reference.length / (2.0 * speed), speed])

    def _loads(self, state: Array, inputs: Array) -> Array:
        _, _, c, d = LAG.matrices
        normal, moment = c @ state + d @ inputs[:2]
        return np.array([0.55, 0.0, normal, 0.0, moment, 0.0]) * (inputs[2] / self.speed) ** 2

    def loads(self) -> Array:
        return self._loads(self.state, self.inputs)

    def try_step(self, dt: float, velocity: Array, rate: Array) -> Array:
        self.trial_inputs = self._inputs(velocity, rate)
        a, b, _, _ = LAG.matrices
        s = (self.inputs[2] + self.trial_inputs[2]) / FINNER.reference.length * dt
        slope = (self.trial_inputs[:2] - self.inputs[:2]) / s
        # x' = A x + B (u0 + slope s): x and the inputs as one homogeneous system
        n = len(a)
        whole = np.zeros((n + 2, n + 2))
        whole[:n, :n], whole[:n, n], whole[:n, n + 1] = a, b @ self.inputs[:2], b @ slope
        whole[n + 1, n] = 1.0
        self.trial_state = (expm(whole * s) @ np.concatenate([self.state, [1.0, 0.0]]))[:n]
        return self._loads(self.trial_state, self.trial_inputs)

    def accept(self) -> None:
        self.state, self.inputs = self.trial_state, self.trial_inputs

    def arrays(self) -> dict[str, Array]:
        return {"state": self.state, "inputs": self.inputs}

    def restore(self, arrays: Mapping[str, Array]) -> None:
        self.state, self.inputs = arrays["state"], arrays["inputs"]


def errors(solver: Any, model: Any, steps: tuple[int, ...]) -> list[float]:
    exact = fly(build_dynamics(FINNER, model), START, DURATION, method="dop853", step=DURATION, estimate_error=False)
    found = []
    for n in steps:
        flight = fly_in_flow(FINNER, solver, START, DURATION, DURATION / n, tolerance=1e-10)
        found.append(float(np.linalg.norm(flight.rate[-1] - exact.rate[-1])))
    return found


def test_loads_without_memory_are_flown_to_third_order() -> None:
    coarse, middle, fine = errors(
        LoadFunction(FINNER.reference, quasi_steady), derivative_model(CN_alphadot=0.0, Cm_alphadot=0.0), (40, 80, 160)
    )
    assert np.log2(coarse / middle) > 2.7
    assert np.log2(middle / fine) > 2.7
    assert fine < 1e-4  # of 6 rad/s


def test_a_flow_with_memory_is_flown_to_its_own_order_without_lagging() -> None:
    """Inputs linear over a step make the flow's steps of second order."""
    coarse, middle, fine = errors(LagFlow(), LAG, (200, 400, 800))
    assert np.log2(coarse / middle) > 1.8
    assert np.log2(middle / fine) > 1.8
    assert fine < 1e-4


def test_moments_are_taken_to_the_centre_of_gravity_and_the_point_moves_as_it_does() -> None:
    """A centre of gravity half a calibre ahead: the same flight as the equations' own transfer gives."""
    behind = FINNER.reference.moment_reference[0] - 0.5 * FINNER.reference.length
    vehicle = Vehicle("other", FINNER.mass, FINNER.inertia, FINNER.reference, (behind, 0.0, 0.0))
    model = derivative_model(CN_alphadot=0.0, Cm_alphadot=0.0)
    exact = fly(build_dynamics(vehicle, model), START, 0.02, method="dop853", step=0.02, estimate_error=False)
    flight = fly_in_flow(vehicle, LoadFunction(FINNER.reference, quasi_steady), START, 0.02, 1e-4, tolerance=1e-10)
    assert flight.rate[-1] == pytest.approx(exact.rate[-1], abs=1e-4)
    assert flight.moment[-1] == pytest.approx(exact.moment[-1], rel=1e-5, abs=1e-6)


def test_a_flight_ends_where_it_is_told_to() -> None:
    solver = LoadFunction(FINNER.reference, quasi_steady)
    flight = fly_in_flow(FINNER, solver, START, 1.0, 1e-3, end=End(x=20.0))
    assert flight.position[-1, 0] == pytest.approx(20.0, abs=1e-9)
    assert flight.time[-1] < 0.031
    assert flight.force[-1] == pytest.approx(flight.force[-2], rel=0.2, abs=1.0)


class Failing(LagFlow):
    """Diverges at its 30th trial."""

    calls = 0

    def try_step(self, dt: float, velocity: Array, rate: Array) -> Array:
        self.calls += 1
        if self.calls == 30:
            raise DivergenceError("the flow burst")
        return super().try_step(dt, velocity, rate)


def test_a_flight_that_failed_goes_on_from_its_last_good_state(tmp_path: Path) -> None:
    path = tmp_path / "flight.npz"
    whole = fly_in_flow(FINNER, LagFlow(), START, DURATION, 1e-3)
    with pytest.raises(DivergenceError, match=r"after t = .* the flow burst; the last good state is in"):
        fly_in_flow(FINNER, Failing(), START, DURATION, 1e-3, checkpoint=path)
    assert path.is_file()
    resumed = fly_in_flow(FINNER, LagFlow(), START, DURATION, 1e-3, checkpoint=path)
    assert resumed.velocity == pytest.approx(whole.velocity, abs=1e-12)
    assert resumed.rate == pytest.approx(whole.rate, abs=1e-12)
    assert not path.is_file()


def test_a_step_too_long_to_agree_says_so() -> None:
    def wild(velocity: Array, rate: Array) -> list[float]:
        return [0.0, 0.0, 0.0, 0.0, 1e7 * rate[1], 0.0]

    with pytest.raises(DivergenceError, match="smaller time step"):
        fly_in_flow(FINNER, LoadFunction(FINNER.reference, wild), START, DURATION, 1e-2)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"step": 0.0}, "positive"),
        ({"step": 1.0}, "the smaller"),
        ({"initial": InitialState.from_path(SPEED, lag=np.ones(2))}, "no lag states"),
        ({"initial": InitialState(np.zeros(3), [1, 0, 0, 0], np.zeros(3), np.zeros(3))}, "at rest"),
    ],
)
def test_what_cannot_be_flown_is_refused(options: dict[str, Any], words: str) -> None:
    given = {"initial": START, "step": 1e-3} | options
    with pytest.raises(InputError, match=words):
        fly_in_flow(
            FINNER,
            LoadFunction(FINNER.reference, quasi_steady),
            given["initial"],
            0.01,
            given["step"],
            atmosphere=ConstantAtmosphere(),
            earth=FlatEarth(),
        )
    with pytest.raises(InputError, match="six finite"):
        fly_in_flow(FINNER, LoadFunction(FINNER.reference, lambda v, w: [1.0]), START, 0.01, 1e-3)
