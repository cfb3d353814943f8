"""Modal recurrences and streaming against closed forms, matrix exponentials and python-control."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import control
import numba
import numpy as np
import pytest

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.rom import StateSpaceModel
from indicial.rom.modal import ModalForm
from indicial.rom.recurrence import hold_factors
from indicial.rom.signals import MotionInputs
from indicial.rom.simulation import simulate
from indicial.rom.streaming import Stream, advance, stream
from rom.cases import CONDITION, REFERENCE

OUTPUTS = ("CA", "CY", "CN", "Cl", "Cm", "Cn")


def random_model(order: int = 10, seed: int = 0) -> StateSpaceModel:
    """Real poles and pairs, mixed by a random change of coordinates; 3 inputs, 6 outputs."""
    rng = np.random.default_rng(seed)
    a = np.diag(-rng.uniform(0.05, 2.0, order))
    for i in range(order % 3, order - 1, 3):
        a[i : i + 2, i : i + 2] = [[-0.1 * (i + 1), 0.3 * (i + 1)], [-0.3 * (i + 1), -0.1 * (i + 1)]]
    turn = rng.normal(size=(order, order))
    a = turn @ a @ np.linalg.inv(turn)
    b, c, d = rng.normal(size=(order, 3)), rng.normal(size=(6, order)), rng.normal(size=(6, 3))
    return StateSpaceModel(a, b, c, d, ("alpha", "p", "q"), OUTPUTS, rng.normal(size=6), CONDITION, REFERENCE)


def walk(n: int, seed: int = 1) -> Array:
    """Inputs without any smoothness."""
    path: Array = np.cumsum(np.random.default_rng(seed).normal(size=(n, 3)), axis=0)
    return path


def by_exponentials(model: StateSpaceModel, s: Array, values: Array, before: Array) -> Array:
    states = simulate(model.a, model.b, s, values, -np.linalg.solve(model.a, model.b @ before))
    loads: Array = states @ model.c.T + values @ model.d.T
    return loads


GRIDS = {
    "uniform": 0.07 * np.arange(700),
    "uneven": np.append(0.0, np.cumsum(np.random.default_rng(5).uniform(1e-4, 0.3, 699))),
    "two steps": np.append(0.05 * np.arange(350), 17.5 + 0.2 * np.arange(350)),
    "block and one": 0.07 * np.arange(129),
    "one": np.zeros(1),
}


@pytest.mark.parametrize("grid", GRIDS)
def test_modal_form_equals_matrix_exponentials(grid: str) -> None:
    model, s = random_model(), GRIDS[grid]
    values, before = walk(s.size), np.array([0.3, -0.2, 0.1])
    modal = ModalForm.of(model.a, model.b, model.c, model.d)
    assert modal is not None
    assert 0 < modal.real < modal.poles.size
    exact = by_exponentials(model, s, values, before)
    np.testing.assert_allclose(modal.respond(s, values, before), exact, atol=1e-11 * np.max(np.abs(exact)))


def test_response_equals_that_of_control() -> None:
    model, s, values = random_model(), GRIDS["uniform"], walk(700)
    found = model.respond(MotionInputs(s, values, np.zeros(3)))
    _, exact = control.forced_response(model.system, s, values.T)
    np.testing.assert_allclose(found, exact.T, atol=1e-10 * np.max(np.abs(exact)))


@pytest.mark.parametrize("pole", [-1.0, -1e-9, -0.3 + 2.0j, -1e-7 + 1e-5j, -40.0 + 3.0j])
@pytest.mark.parametrize("step", [1e-6, 0.0999, 0.1001, 3.0])
def test_hold_factors_are_the_integrals_that_define_them(pole: complex, step: float) -> None:
    grown, before, after = hold_factors(complex(pole), step)
    # Gauss-Legendre over the step, in pieces short against the decay
    nodes, weights = np.polynomial.legendre.leggauss(20)
    edges = np.linspace(0.0, step, 30)
    half = 0.5 * np.diff(edges)[:, None]
    tau = edges[:-1, None] + half * (1.0 + nodes)
    kernel = half * weights * np.exp(pole * (step - tau))
    assert grown == pytest.approx(np.exp(pole * step), rel=1e-14)
    assert before == pytest.approx(np.sum(kernel * (1.0 - tau / step)), rel=1e-13)
    assert after == pytest.approx(np.sum(kernel * tau / step), rel=1e-13)


def double_pole() -> StateSpaceModel:
    model = random_model(2)
    return replace(model, a=np.array([[-0.5, 1.0], [0.0, -0.5]]))


def test_double_pole_has_no_modal_form_and_is_answered_by_exponentials() -> None:
    model = double_pole()
    s = np.linspace(0.0, 20.0, 101)
    unit = np.zeros((101, 3))
    unit[:, 0] = 1.0
    # x' = a x + b from rest: x2 = 2 b2 (1 - e), x1 = 2 (b1 + 2 b2)(1 - e) - 2 b2 s e, e = exp(-s/2)
    (b1, b2), e = model.b[:, 0], np.exp(-0.5 * s)
    exact = np.stack([2.0 * (b1 + 2.0 * b2) * (1.0 - e) - 2.0 * b2 * s * e, 2.0 * b2 * (1.0 - e)], axis=1) @ model.c.T
    found = model.respond(MotionInputs(s, unit, np.zeros(3)))
    np.testing.assert_allclose(found, exact + model.d[:, 0], atol=1e-12)
    with pytest.raises(InputError, match="no modal form"):
        stream(model)


def test_poles_shared_by_channels_keep_their_modal_form() -> None:
    model = replace(random_model(4), a=-0.5 * np.eye(4))
    s, values = GRIDS["uniform"], walk(700)
    found = ModalForm.of(model.a, model.b, model.c, model.d)
    assert found is not None
    exact = by_exponentials(model, s, values, np.zeros(3))
    np.testing.assert_allclose(found.respond(s, values, np.zeros(3)), exact, atol=1e-11 * np.max(np.abs(exact)))


def test_model_without_states_is_its_feedthrough() -> None:
    model = random_model(0)
    values = walk(300)
    found = model.respond(MotionInputs(np.arange(300.0), values, np.zeros(3)))
    np.testing.assert_allclose(found, values @ model.d.T, atol=1e-12)


@numba.njit
def run(flow: Stream, s: Array, values: Array, loads: Array) -> None:
    """A compiled simulation that advances the model by itself."""
    for k in range(s.size):
        advance(flow, values[k], s[k] - s[max(k - 1, 0)], loads[k])


@pytest.mark.parametrize("grid", GRIDS)
def test_streaming_from_compiled_code_equals_the_response(grid: str) -> None:
    model, s = random_model(), GRIDS[grid]
    values, before, loads = walk(s.size), np.array([0.3, -0.2, 0.1]), np.empty((s.size, 6))
    run(stream(model, before), s, values, loads)  # the first step, ds = 0, is the jump
    exact = model.baseline + model.respond(MotionInputs(s, values, before))
    np.testing.assert_allclose(loads, exact, atol=1e-12 * np.max(np.abs(exact)))


def test_streams_of_one_model_do_not_share_their_memory() -> None:
    model, loads = random_model(), np.empty(6)
    first, second = stream(model), stream(model)
    advance(first, np.ones(3), 0.5, loads)
    advance(second, np.zeros(3), 0.5, loads)
    np.testing.assert_array_equal(loads, model.baseline)


def test_varying_speed_is_followed_in_reduced_time() -> None:
    """dx/dt = (2V/c)(A x + B u) with V(t) linear, by a fine Runge-Kutta march."""
    model, c = random_model(4), REFERENCE.length
    t = np.linspace(0.0, 0.02, 41)

    def speed(time: float) -> float:
        return 400.0 * (1.0 - 20.0 * time)

    def inputs(time: float) -> Array:
        # linear in the distance flown, as the stream takes it
        flown = 2.0 / c * (400.0 * time - 4000.0 * time**2)
        return np.array([0.01, -0.02, 0.03]) * flown

    def rate(time: float, x: Array) -> Array:
        found: Array = 2.0 * speed(time) / c * (model.a @ x + model.b @ inputs(time))
        return found

    flow, loads, x = stream(model), np.empty(6), np.zeros(4)
    for begin, end in pairwise(t):
        for piece in range(40):
            h, now = (end - begin) / 40, begin + piece * (end - begin) / 40
            k1 = rate(now, x)
            k2 = rate(now + h / 2, x + h / 2 * k1)
            k3 = rate(now + h / 2, x + h / 2 * k2)
            x = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + rate(now + h, x + h * k3))
        advance(flow, inputs(end), (speed(begin) + speed(end)) / c * (end - begin), loads)
    np.testing.assert_allclose(loads, model.baseline + model.c @ x + model.d @ inputs(t[-1]), rtol=1e-8)
    assert not math.isclose(loads[0], model.baseline[0], rel_tol=0.1)


def test_inputs_before_that_do_not_fit_are_refused() -> None:
    with pytest.raises(InputError, match="shape \\(3,\\)"):
        stream(random_model(), [0.1])


def test_steps_that_do_not_fit_the_model_are_refused() -> None:
    flow = stream(random_model())
    for inputs, ds, loads in ((3, 0.1, 7), (3, 0.1, 2), (2, 0.1, 6), (3, -0.1, 6)):
        with pytest.raises(InputError, match="step"):
            advance(flow, np.zeros(inputs), ds, np.empty(loads))
