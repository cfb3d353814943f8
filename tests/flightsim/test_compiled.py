"""Compiled models against CasADi's own evaluation, and the compiled adaptive march against SciPy's."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flightsim.support import FINNER, SPEED, derivative_model, first_order_lag
from indicial.errors import DivergenceError, InputError
from indicial.flightsim import ConstantAtmosphere, End, InitialState, StandardAtmosphere, build_dynamics, fly, simulate
from indicial.flightsim.compiled import compile_function, write_source

START = InitialState.from_path(SPEED, alpha=0.03, beta=0.01, path_angle=0.2, rate=(200.0, 1.0, -2.0))


def function_of(result: Any, *inputs: Any) -> Any:
    return ca.Function("function", [*inputs], [ca.densify(result)])


@pytest.mark.parametrize("model", [derivative_model(), first_order_lag(0.3)])
def test_compiled_equations_equal_casadis_at_random_states(model: Any) -> None:
    dynamics = build_dynamics(FINNER, model, StandardAtmosphere())
    kernel, random = dynamics.rate_kernel, np.random.default_rng(7)
    for _ in range(50):
        state = random.standard_normal(len(dynamics.state_names)) * 10.0 ** random.uniform(-2, 2)
        state[2] = -random.uniform(0.0, 80e3)
        exact = dynamics.rate(state)
        assert kernel(state) == pytest.approx(exact, rel=1e-12, abs=1e-13 * np.max(np.abs(exact)))


def test_every_elementary_operation_is_casadis() -> None:
    y, p, t = ca.SX.sym("y", 3), ca.SX.sym("p", 1), ca.SX.sym("t")
    a, b, c = ca.vertsplit(y)
    inside = ca.tanh(a)
    one = [ca.exp, ca.sin, ca.cos, ca.tan, ca.atan, ca.floor, ca.ceil, ca.erf, ca.sinh, ca.cosh, ca.asinh, ca.fabs]
    values = [f(a) for f in (*one, ca.sign, ca.expm1)] + [f(inside) for f in (ca.asin, ca.acos, ca.atanh)]
    values += [ca.log(b * b), ca.sqrt(b * b + 1), ca.acosh(1 + b * b), ca.log1p(b * b), (b * b) ** c, (b * b) ** 1.7]
    values += [ca.atan2(a, b), ca.fmod(a, b), ca.fmin(a, b), ca.fmax(a, b), ca.hypot(a, b), ca.copysign(a, b), 1 / a]
    values += [a < b, a <= b, a == b, a != b, ca.logic_and(a > 0, b > 0), ca.logic_or(a > 0, b > 0)]
    values += [ca.logic_not(a > 0), ca.if_else(a > b, p * t, -c), 2 * a, -a, a - b]
    function = function_of(ca.vertcat(*values), y, p, t)
    kernel, random = compile_function(function), np.random.default_rng(3)
    for _ in range(30):
        state, parameter, time = random.standard_normal(3), random.standard_normal(1), random.uniform()
        exact = np.array(function(state, parameter, time)).ravel()
        assert kernel(state, parameter, time) == pytest.approx(exact, rel=1e-13, abs=1e-15)


def test_models_that_differ_in_numbers_are_one_code() -> None:
    one, other = (build_dynamics(FINNER, derivative_model(Cm_q=value)) for value in (-300.0, -211.0))
    assert write_source(one.derivative)[0] == write_source(other.derivative)[0]
    assert not np.array_equal(write_source(one.derivative)[1], write_source(other.derivative)[1])


def test_what_cannot_be_compiled_is_refused() -> None:
    y, p, t = ca.SX.sym("y", 2), ca.SX.sym("p", 0), ca.SX.sym("t")
    with pytest.raises(InputError, match="one result"):
        compile_function(ca.Function("f", [y], [y]))
    with pytest.raises(InputError, match="dense"):
        compile_function(ca.Function("f", [y, p, t], [ca.SX(2, 1)]))
    with pytest.raises(InputError, match="states"):
        compile_function(ca.Function("f", [y, p, t], [y]))([1.0, 2.0, 3.0])


def test_a_second_process_finds_the_code_kept(tmp_path: Path) -> None:
    program = (
        "import casadi as ca, numba; from indicial.flightsim.compiled import compile_function;"
        "y, t = ca.SX.sym('y', 1), ca.SX.sym('t');"
        "f = compile_function(ca.Function('f', [y, ca.SX.sym('p', 0), t], [y * t + 3]));"
        "print(f([2.0], [], 5.0)[0], f.owner.cache_hits)"
    )
    environment = {**os.environ, "INDICIAL_CACHE_DIR": str(tmp_path)}
    environment.pop("NUMBA_CACHE_DIR", None)
    said = [
        subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
        for _ in range(2)
    ]
    assert [run.stdout.split() for run in said] == [["13.0", "0"], ["13.0", "1"]]


@pytest.mark.parametrize("model", [derivative_model(), first_order_lag(0.3)])
def test_adaptive_flight_equals_scipys_at_every_instant(model: Any) -> None:
    dynamics = build_dynamics(FINNER, model, StandardAtmosphere())
    flight = fly(dynamics, START, 0.5, step=0.01, method="dop853", tolerance=1e-10, estimate_error=False)
    start = dynamics.initial_vector(START)
    truth = solve_ivp(
        lambda time, y: dynamics.rate(y, (), time), (0.0, 0.5), start, "DOP853", flight.time, rtol=1e-12, atol=1e-13
    )
    assert flight.position == pytest.approx(truth.y[:3].T, abs=1e-7)
    assert flight.rate == pytest.approx(truth.y[10:13].T, abs=1e-5)


def test_error_of_an_adaptive_flight_falls_with_the_tolerance() -> None:
    dynamics = build_dynamics(FINNER, derivative_model())
    truth = fly(dynamics, START, 0.2, step=0.2, method="dop853", tolerance=1e-14, estimate_error=False).rate[-1]
    errors = [
        np.linalg.norm(fly(dynamics, START, 0.2, step=0.2, method="dop853", tolerance=t).rate[-1] - truth)
        for t in (1e-5, 1e-7, 1e-9)
    ]
    assert errors[0] > 20.0 * errors[1] > 400.0 * errors[2]


def test_adaptive_flight_with_a_rate_that_grows_without_bound_is_an_error() -> None:
    with pytest.raises(DivergenceError, match="adaptive"):
        simulate(FINNER, derivative_model(Cl_p=3e4), START, 2.0, step=1e-2, method="dop853")


@pytest.mark.parametrize("method", ["rk4", "dop853"])
def test_flight_ends_at_the_apogee_of_a_vacuum_arc(method: Any) -> None:
    start = InitialState.from_path(100.0, path_angle=0.5)
    flight = simulate(
        FINNER,
        derivative_model(),
        start,
        20.0,
        step=0.01,
        end=End(apogee=True),
        method=method,
        atmosphere=ConstantAtmosphere(pressure=0.0),
    )
    climb = 100.0 * np.sin(0.5)
    assert flight.time[-1] == pytest.approx(climb / 9.80665, abs=1e-9)
    assert -flight.position[-1, 2] == pytest.approx(climb**2 / (2.0 * 9.80665), abs=1e-9)
