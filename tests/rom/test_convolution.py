"""Convolution (Eq. 13) and the quasi-steady form (Eq. 16) against closed forms."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from indicial.conventions import Array, time_from_reduced, velocity_from_angles
from indicial.derivatives import DerivativeTable
from indicial.errors import InputError, NoLimitError
from indicial.motion import AlphaStep, FlightCondition, PitchOscillation, Rates, TabulatedMotion
from indicial.rom import (
    ConvolutionModel,
    QuasiSteadyModel,
    StateSpaceModel,
    StepResponse,
    StepResponses,
    quasi_steady_error,
)
from indicial.rom.response import Interpolation
from indicial.rom.signals import MotionInputs
from indicial.solver import Solver
from rom.cases import CONDITION, OUTPUTS, REFERENCE, ROWS, graded, known_system, plate, responses
from theory.linear import incompressible_airfoil

GRID = graded(60.0, 300)


def piecewise_linear() -> tuple[StepResponses, Array, Array]:
    """A response to alpha with three straight pieces, constant after s = 4."""
    s, a = np.array([0.0, 1.0, 2.5, 4.0]), np.array([3.0, 2.0, 4.0, 5.0])
    response = StepResponse("alpha", s, a[:, None])
    return StepResponses((response,), ("CN",), np.zeros(6), CONDITION, REFERENCE), s, a


def test_ramp_through_piecewise_linear_response_is_exact() -> None:
    data, s, a = piecewise_linear()
    model = ConvolutionModel(data, "linear")
    at = np.sort(np.random.default_rng(3).uniform(0.0, 9.0, 40))
    at[0] = 0.0
    # alpha = 0.7 s: the response is 0.7 times the running integral of the step response
    inputs = MotionInputs(at, 0.7 * at[:, None], np.zeros(1))
    # exact integral from 0 to each instant: the corners are put among the nodes
    nodes = [np.sort(np.append(s[s < end], end)) for end in at]
    exact = [0.7 * np.trapezoid(np.interp(x, s, a), x) for x in nodes]
    np.testing.assert_allclose(model.respond(inputs)[:, 0], exact, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
@pytest.mark.parametrize(("samples", "step"), [(2, 0.5), (700, 0.11), (700, 2.0), (700, 70.0)])
def test_transforms_give_the_numbers_of_the_direct_sum(interpolation: Interpolation, samples: int, step: float) -> None:
    # grids within the response, beyond its end, and with the whole of it in one step
    data = responses(known_system(), CONDITION, GRID)
    rng = np.random.default_rng(8)
    inputs = MotionInputs(step * np.arange(samples), rng.normal(size=(samples, 2)), rng.normal(size=2))
    direct = ConvolutionModel(data, interpolation, "direct").respond(inputs)
    fast = ConvolutionModel(data, interpolation, "fft").respond(inputs)
    np.testing.assert_allclose(fast, direct, atol=1e-12 * np.max(np.abs(direct)))


def test_transforms_are_refused_on_uneven_instants() -> None:
    model = ConvolutionModel(piecewise_linear()[0], evaluation="fft")
    with pytest.raises(InputError, match="uniform"):
        model.respond(MotionInputs(np.array([0.0, 1.0, 1.5]), np.zeros((3, 1)), np.zeros(1)))
    with pytest.raises(InputError, match="must be 'auto'"):
        ConvolutionModel(piecewise_linear()[0], evaluation="magic")  # type: ignore[arg-type]


def test_recursion_agrees_with_superposition_of_the_same_exponentials() -> None:
    a, b, c = np.diag([-0.2, -0.7]), np.ones((2, 1)), np.array([[1.0, -0.4]])
    recursive = StateSpaceModel(a, b, c, np.ones((1, 1)), ("alpha",), ("CN",), np.zeros(6), CONDITION, REFERENCE)
    rng = np.random.default_rng(9)
    for s in (0.05 * np.arange(900), np.sort(rng.uniform(0.0, 50.0, 900))):
        inputs = MotionInputs(s, np.cumsum(rng.normal(size=(900, 1)), axis=0), np.zeros(1))
        errors = []
        for count in (400, 800):
            model = ConvolutionModel(recursive.step(graded(150.0, count)))
            errors.append(np.max(np.abs(model.respond(inputs) - recursive.respond(inputs))))
        # what is left is the interpolation of the step responses
        assert errors[1] < 1e-6 * np.max(np.abs(inputs.values))
        assert errors[0] / errors[1] > 8.0


def test_jump_at_the_start_gives_the_step_response_itself() -> None:
    data, s, a = piecewise_linear()
    model = ConvolutionModel(data, "linear")
    at = np.linspace(0.0, 8.0, 33)
    found = model.respond(MotionInputs(at, np.full((33, 1), 0.3), np.full(1, 0.1)))
    # settled at 0.1 before, then 0.2 more
    np.testing.assert_allclose(found[:, 0], 0.1 * a[-1] + 0.2 * np.interp(at, s, a), atol=1e-14)


def test_step_history_predicts_itself() -> None:
    model = ConvolutionModel(responses(known_system(), CONDITION, GRID))
    step = known_system().unsteady(CONDITION, AlphaStep(CONDITION, 0.02), time_from_reduced(GRID, CONDITION.speed, 0.5))
    found = model.predict(step)
    np.testing.assert_allclose(found.coefficients, step.coefficients, atol=1e-12)
    np.testing.assert_allclose(found.before, step.before, atol=1e-12)


def sine(k: float, instants: int) -> tuple[PitchOscillation, Array]:
    motion = PitchOscillation.from_reduced_frequency(CONDITION, REFERENCE, 0.02, k)
    return motion, np.linspace(0.0, 2.0 * motion.period, instants)


def test_sampled_sine_converges_at_second_order() -> None:
    # an exact response at fine steps, so that the input's sampling alone is seen
    model = ConvolutionModel(responses(known_system(), CONDITION, graded(60.0, 3000)))
    errors = []
    for instants in (21, 41, 81):
        motion, times = sine(0.2, instants)
        exact = known_system().unsteady(CONDITION, motion, times)
        errors.append(np.max(np.abs(model.predict(exact, substeps=1)["Cm"] - exact["Cm"])))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert np.all(np.abs(orders - 2.0) < 0.25), orders


@pytest.mark.parametrize(("interpolation", "least"), [("linear", 1.9), ("cubic", 3.8)])
def test_sampled_response_converges(interpolation: str, least: float) -> None:
    errors = []
    for count in (80, 160, 320):
        data = responses(known_system(), CONDITION, graded(150.0, count))
        h = ConvolutionModel(data, interpolation).frequency_response(0.3)[0]  # type: ignore[arg-type]
        errors.append(np.max(np.abs(h - known_system().transfer(0.3)[np.ix_(ROWS, [0, 3])])))
    assert np.log2(errors[0] / errors[2]) / 2.0 > least


@pytest.mark.parametrize("k", [1e-6, 0.01, 0.3, 5.0])
@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_frequency_response_equals_brute_force_quadrature(k: float, interpolation: str) -> None:
    data = responses(known_system(), CONDITION, graded(30.0, 25))
    model = ConvolutionModel(data, interpolation)  # type: ignore[arg-type]
    fine = np.unique(
        np.concatenate([np.linspace(a, b, 801) for a, b in zip(data["q"].s[:-1], data["q"].s[1:], strict=True)])
    )
    f = data["q"].curve(interpolation)(fine)[:, 1]  # type: ignore[arg-type]
    exact = data.final[1, 1] - 1j * k * np.trapezoid(f * np.exp(-1j * k * fine), fine)
    assert model.frequency_response([k])[0, 1, 1] == pytest.approx(exact, abs=2e-5 * abs(exact))


def test_small_k_of_the_frequency_response_is_the_derivatives() -> None:
    model = ConvolutionModel(responses(known_system(), CONDITION, GRID))
    k = 1e-5
    h = model.frequency_response(k)[0]
    np.testing.assert_allclose(h.real, model.static_gain, rtol=1e-8)
    np.testing.assert_allclose(h.imag / k, model.rate_gain, rtol=1e-6)


def test_non_uniform_instants_agree_with_uniform_ones() -> None:
    model = ConvolutionModel(responses(known_system(), CONDITION, GRID))
    motion, _ = sine(0.2, 2)
    common = 0.7 * motion.period
    uniform = np.linspace(0.0, common, 400)
    uneven = common * np.linspace(0.0, 1.0, 400) ** 1.5
    ends = [model.predict(motion, times)["CN"][-1] for times in (uniform, uneven)]
    assert ends[0] == pytest.approx(ends[1], rel=1e-6)


def test_plate_oscillation_from_its_steps() -> None:
    solver, condition = plate(arm=3.0)
    grid = np.union1d(np.linspace(0.0, 4.4, 200), 4.0 / 3.0)
    model = ConvolutionModel(responses(solver, condition, grid))
    motion = PitchOscillation.from_reduced_frequency(condition, solver.reference, 0.01, 0.4)
    times = np.linspace(0.0, 2.0 * motion.period, 120)
    exact = solver.unsteady(condition, motion, times)
    found = model.predict(motion, times)
    for name in OUTPUTS:
        assert np.max(np.abs(found[name] - exact[name])) < 1e-4 * np.max(np.abs(exact[name]))


def test_tabulated_motion_with_corners_is_followed_exactly() -> None:
    data, s, a = piecewise_linear()
    instants = time_from_reduced([0.0, 2.0, 3.0, 10.0], CONDITION.speed, REFERENCE.length)
    angles = CONDITION.alpha + np.array([0.0, 1e-3, 1e-3, 0.0])
    velocities = np.stack([velocity_from_angles(CONDITION.speed, angle) for angle in angles])
    motion = TabulatedMotion(instants, velocities, np.zeros((4, 3)))
    model = ConvolutionModel(data, "linear")
    found = model.predict(motion, instants, substeps=1)["CN"]
    fine = np.linspace(0.0, 10.0, 20001)

    def running(end: float) -> float:
        x = np.unique(np.append(np.clip(np.concatenate([fine, s]), 0.0, end), end))
        return float(np.trapezoid(np.interp(x, s, a), x))

    slopes, corners = (5e-4, 0.0, -1e-3 / 7.0), (0.0, 2.0, 3.0, 10.0)
    exact = [
        sum(
            slope * (running(max(t - begin, 0.0)) - running(max(t - end, 0.0)))
            for slope, begin, end in zip(slopes, corners[:-1], corners[1:], strict=True)
        )
        for t in corners
    ]
    np.testing.assert_allclose(found, exact, atol=1e-12)


def test_model_is_a_solver_with_the_same_steady_loads() -> None:
    model = ConvolutionModel(responses(known_system(), CONDITION, GRID))
    assert isinstance(model, Solver)
    tilted = replace(CONDITION, alpha=CONDITION.alpha + 0.01)
    for condition, rates in ((CONDITION, Rates(q=30.0)), (tilted, Rates()), (tilted, Rates(q=-20.0))):
        exact = known_system().steady(condition, rates).coefficients
        np.testing.assert_allclose(model.steady(condition, rates).coefficients, exact, atol=1e-5)


def test_what_a_model_cannot_follow_is_refused() -> None:
    model = ConvolutionModel(responses(known_system(), CONDITION, GRID))
    only_alpha = ConvolutionModel(replace(model.responses, responses=model.responses.responses[:1]))
    motion, times = sine(0.2, 21)
    with pytest.raises(InputError, match="varies q"):
        only_alpha.predict(motion, times)
    assert only_alpha.predict(motion, times, neglect=("q",)).time.size == 21
    with pytest.raises(InputError, match="the state has p"):
        model.steady(CONDITION, Rates(p=1.0))
    with pytest.raises(InputError, match="Mach 2"):
        model.steady(FlightCondition(2.5))
    with pytest.raises(InputError, match="times is missing"):
        model.predict(motion)
    # its reduced time and its rates are made with another length
    other = replace(model.predict(motion, times), reference=replace(model.reference, length=2.0))
    with pytest.raises(InputError, match="reference quantities"):
        model.predict(other)


@pytest.mark.parametrize(
    ("s", "values", "before", "reason"),
    [
        ([0.0, 1.0, 1.0], np.zeros((3, 2)), np.zeros(2), "strictly increasing"),
        ([0.0, np.nan, 1.0], np.zeros((3, 2)), np.zeros(2), "strictly increasing"),
        ([0.0, 1.0, 2.0], np.zeros((2, 2)), np.zeros(2), "do not fit 3 samples"),
        ([0.0, 1.0, 2.0], np.zeros((3, 2)), np.zeros(1), "do not fit 3 samples"),
        ([0.0, 1.0, 2.0], np.full((3, 2), np.nan), np.zeros(2), "not finite"),
    ],
)
def test_inputs_that_are_none_are_refused(s: list[float], values: Array, before: Array, reason: str) -> None:
    with pytest.raises(InputError, match=reason):
        MotionInputs(np.array(s), values, before)


def test_quasi_steady_model_is_the_tangent_of_the_full_response() -> None:
    data = responses(known_system(), CONDITION, graded(90.0, 400))
    quasi = QuasiSteadyModel.from_responses(data)
    exact = known_system().slope()[np.ix_(ROWS, [0])]
    np.testing.assert_allclose(quasi.rates[:, [0]], exact, rtol=2e-4)
    np.testing.assert_array_equal(quasi.rates[:, 1], 0.0)
    # Eq. (16) on a slow ramp, once transients have died
    ramp = MotionInputs(np.linspace(0.0, 200.0, 2001), np.linspace(0.0, 0.1, 2001)[:, None] * [[1.0, 0.0]], np.zeros(2))
    full = ConvolutionModel(data).respond(ramp)[-1]
    np.testing.assert_allclose(quasi.respond(ramp)[-1], full, rtol=1e-5)


def test_quasi_steady_form_fails_first_where_the_exact_plate_does() -> None:
    solver, condition = plate()
    data = responses(solver, condition, np.linspace(0.0, 8.0, 500))
    k = np.geomspace(0.01, 2.0, 40)
    error = quasi_steady_error(QuasiSteadyModel.from_responses(data), ConvolutionModel(data), k)
    h = np.stack([solver.frequency_response(condition, float(x)) for x in k])
    damping = np.imag(h[:, :, 0] + 1j * k[:, None] * h[:, :, 1]) / k[:, None]
    np.testing.assert_allclose(error.out_of_phase, damping, rtol=5e-4, atol=5e-4 * np.max(np.abs(damping)))
    exact_limit = k[np.nonzero(np.abs(damping[0, 1] / damping[:, 1] - 1.0) > 0.05)[0][0] - 1]
    assert error.limit("Cm") == pytest.approx(exact_limit, rel=0.2)
    assert "quasi-steady damping within 5%" in error.summary()
    assert len(error.plot().axes) == 4


def test_quasi_steady_model_from_a_table_converts_rates() -> None:
    data = responses(known_system(), CONDITION, GRID)
    for convention in ("c/2V", "c/V"):
        reference = replace(REFERENCE, rate_normalisation=convention)
        model = QuasiSteadyModel.from_responses(replace(data, reference=reference))
        again = QuasiSteadyModel.from_table(model.derivatives(), CONDITION, reference, data.baseline, method="rom")
        np.testing.assert_allclose(again.static, model.static, rtol=1e-14)
        np.testing.assert_allclose(again.rates[:, 0], model.rates[:, 0], rtol=1e-14)
    with pytest.raises(InputError, match="0 records"):
        QuasiSteadyModel.from_table(DerivativeTable(), CONDITION, REFERENCE, data.baseline)


def test_lift_of_a_subsonic_section_has_no_alphadot_derivative() -> None:
    reference = replace(REFERENCE, length=1.0, moment_reference=(0.25, 0.0, 0.0))
    airfoil = incompressible_airfoil(reference, 0.25)
    condition = FlightCondition(0.1)
    grid = np.concatenate([[0.0], np.geomspace(0.01, 500.0, 400)])
    data = responses(airfoil, condition, grid)
    lift_final = airfoil.step(1e9)[2, [0]]
    moment_final = airfoil.step(1e9)[4, [0]]
    alpha = replace(data["alpha"], final=np.concatenate([lift_final, moment_final]))
    data = replace(data, responses=(alpha, data["q"]))
    with pytest.raises(NoLimitError):
        QuasiSteadyModel.from_responses(data)
    table = ConvolutionModel(data).derivatives()
    assert "CN_alphadot" not in table.names()
    assert table.value("Cm_alphadot") == pytest.approx(-np.pi / 4.0, rel=0.01)
