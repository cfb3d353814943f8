"""State-space models scheduled over the Mach number: the models of the nodes at the nodes, and flight between them."""

from typing import Any

import control
import numpy as np
import pytest

from flightsim.support import FINNER, SPEED, derivative_model, first_order_lag
from indicial.errors import InputError
from indicial.flightsim import (
    FlatEarth,
    InitialState,
    ScheduledStateSpaceAerodynamics,
    build_dynamics,
    fly,
)

SLOW, QUICK = first_order_lag(0.3).system, first_order_lag(0.5).system


def scheduled(*systems: control.StateSpace, machs: tuple[float, ...] = (1.5, 2.5), **changed: Any) -> Any:
    shared = {"reference": FINNER.reference, "CA_0": 0.55, "Cl_p": -22.0}
    return ScheduledStateSpaceAerodynamics(machs=machs, systems=systems, **(shared | changed))


def test_at_a_node_loads_and_lags_are_those_of_its_model() -> None:
    model = build_dynamics(FINNER, scheduled(SLOW, QUICK))
    for mach, system in ((1.5, SLOW), (2.5, QUICK), (1.1, SLOW), (2.9, QUICK)):
        plain = build_dynamics(FINNER, first_order_lag(0.3, system=system))
        sound = 343.0  # only the ratio counts: the node is met exactly below
        start = InitialState.from_path(mach * sound, alpha=0.03, beta=-0.01, rate=(50.0, 2.0, 1.0), lag=np.ones(2))
        state = plain.initial_vector(start)
        speed_of_sound = float(np.array(plain.loads(state, [], 0.0)[3]).item())
        state[3:6] *= speed_of_sound / sound
        assert model.rate(state) == pytest.approx(plain.rate(state), rel=1e-9, abs=1e-8)


def test_between_nodes_the_matrices_are_linear() -> None:
    middle = scheduled(SLOW, QUICK).at(2.0)
    a, _, c, _ = middle.matrices
    assert a[0, 0] == pytest.approx(-0.4)
    assert c[1, 0] == pytest.approx(0.5 * (SLOW.C[1, 0] + QUICK.C[1, 0]))
    mixed = build_dynamics(FINNER, scheduled(SLOW, QUICK))
    plain = build_dynamics(FINNER, middle)
    state = plain.initial_vector(InitialState.from_path(SPEED, alpha=0.03, lag=np.array([0.01, 0.02])))
    state[3:6] *= 2.0 * float(np.array(plain.loads(state, [], 0.0)[3]).item()) / SPEED
    assert mixed.rate(state) == pytest.approx(plain.rate(state), rel=1e-9, abs=1e-9)


def test_a_schedule_of_one_model_flies_as_that_model() -> None:
    start = InitialState.from_path(SPEED, alpha=0.05, rate=(100.0, 0.0, 0.0))
    options = {"step": 2e-5, "every": 100, "estimate_error": False}
    one, other = (
        fly(build_dynamics(FINNER, model, earth=FlatEarth(0.0)), start, 0.05, **options)
        for model in (scheduled(SLOW, SLOW), first_order_lag(0.3))
    )
    assert one.velocity == pytest.approx(other.velocity, abs=1e-9)
    assert one.lag == pytest.approx(other.lag, abs=1e-12)


def test_derivatives_at_k_0_follow_the_mach_number() -> None:
    """The lags were made to have the same derivatives at k = 0 as the derivative model, at every node."""
    model = build_dynamics(FINNER, scheduled(SLOW, QUICK).quasi_steady())
    plain = build_dynamics(FINNER, derivative_model())
    for speed in (400.0, SPEED, 900.0):
        state = plain.initial_vector(InitialState.from_path(speed, alpha=0.03, rate=(0.0, 2.0, 0.0)))
        assert model.rate(state) == pytest.approx(plain.rate(state), rel=1e-9, abs=1e-9)


def test_flights_beyond_the_schedule_are_flagged() -> None:
    model = build_dynamics(FINNER, scheduled(SLOW, QUICK, machs=(1.5, 1.9)), earth=FlatEarth(0.0))
    flight = fly(model, InitialState.from_path(SPEED), 0.01)
    assert np.all(flight.outside_range)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: scheduled(SLOW, machs=(1.5,)), "two or more"),
        (lambda: scheduled(SLOW, QUICK, machs=(2.0, 1.0)), "increasing"),
        (lambda: scheduled(SLOW, control.ss([], [], [], np.eye(2))), "one order"),
        (lambda: scheduled(SLOW, QUICK).at(3.0), "reaches from Mach"),
    ],
)
def test_schedules_that_make_no_sense_are_refused(make: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()


def test_a_schedule_unstable_between_its_nodes_is_refused() -> None:
    """Two stable matrices whose mean has an eigenvalue of +4.5."""
    input_, output, direct = np.eye(2), np.eye(2), np.zeros((2, 2))
    one = control.ss([[-0.5, 10.0], [0.0, -0.5]], input_, output, direct)
    other = control.ss([[-0.5, 0.0], [10.0, -0.5]], input_, output, direct)
    with pytest.raises(InputError, match="not stable between"):
        scheduled(one, other)
