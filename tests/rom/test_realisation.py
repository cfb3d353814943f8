"""State-space models realised from step responses of known systems, exact theory and noisy data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.motion import PitchOscillation
from indicial.rom import StepResponse, StepResponses, check_prediction, deficiency_integral, realise
from indicial.rom.era import era_modes, hankel
from indicial.rom.mode_fitting import TimeTarget, fit_amplitudes, refine
from indicial.rom.modes import Modes
from indicial.rom.realisation import Method, Poles
from rom.cases import COLUMNS, CONDITION, OUTPUTS, REFERENCE, ROWS, graded, known_system, plate, responses
from theory.linear import NoisySolver, incompressible_airfoil, theodorsen

GRID = graded(80.0, 120)
JONES = ((0.165, 0.0455), (0.335, 0.3))  # R. T. Jones, NACA TR 681: phi = 1 - 0.165 e^-0.0455s - 0.335 e^-0.3s


def jones_responses() -> StepResponses:
    """Circulatory lift of a step in alpha by Jones' approximation of Wagner's function, per 2 pi alpha."""
    s = np.concatenate([[0.0], np.geomspace(0.02, 300.0, 250)])
    phi = 1.0 - sum(a * np.exp(-p * s) for a, p in JONES)
    response = StepResponse("alpha", s, phi[:, None], final=np.ones(1))
    return StepResponses((response,), ("CN",), np.zeros(6), CONDITION, REFERENCE)


def test_known_system_is_recovered_with_poles_feedthrough_and_gains() -> None:
    data = responses(known_system(), CONDITION, graded(150.0, 300))
    model = realise(data, tolerance=1e-7, match_integral=False)
    found = np.sort_complex(model.poles)
    exact = np.sort_complex(np.array([-0.2, -0.7, -0.35, -0.3 + 0.5j, -0.3 - 0.5j]))
    assert found.size == 5
    np.testing.assert_allclose(found, exact, rtol=1e-5)
    np.testing.assert_allclose(model.d, known_system().step(0.0)[np.ix_(ROWS, COLUMNS)], atol=1e-11)
    np.testing.assert_allclose(model.static_gain, known_system().step(1e6)[np.ix_(ROWS, COLUMNS)], rtol=1e-9)
    for k in (0.01, 0.2, 1.0, 10.0):
        exact_h = known_system().transfer(k)[np.ix_(ROWS, COLUMNS)]
        np.testing.assert_allclose(model.frequency_response(k)[0], exact_h, atol=1e-5 * np.max(np.abs(exact_h)))
    np.testing.assert_allclose(model.rate_gain[:, 0], known_system().slope()[ROWS, 0], rtol=2e-5)


def test_step_to_model_to_step_is_the_identity() -> None:
    # the integral is left free: the samples give it only to the accuracy of a quadrature
    model = realise(responses(known_system(), CONDITION, graded(150.0, 150)), "modal", match_integral=False)
    again = realise(model.step(graded(150.0, 150)), "modal", match_integral=False)
    s = np.linspace(0.0, 30.0, 77)
    for name in ("alpha", "q"):
        np.testing.assert_allclose(again.step(s)[name].values, model.step(s)[name].values, atol=1e-6)


@pytest.mark.parametrize("method", ["exponential", "era", "modal"])
@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_initial_final_and_integral_are_exact_whatever_the_order(method: str, order: int) -> None:
    data = responses(plate(3.0)[0], plate()[1], np.linspace(0.0, 8.0, 161))
    model = realise(data, method, order)  # type: ignore[arg-type]
    np.testing.assert_array_equal(model.d, data.initial)
    np.testing.assert_allclose(model.static_gain, data.final, rtol=1e-11)
    assert np.all(model.poles.real < 0.0)
    if order > 1:
        integral = [-r.curve().integrate(0.0, 8.0) for r in data.responses]
        np.testing.assert_allclose(model.rate_gain, np.stack(integral, axis=1), rtol=1e-9)


def test_exponential_method_finds_jones_poles() -> None:
    model = realise(jones_responses(), "exponential", tolerance=1e-6)
    np.testing.assert_allclose(np.sort(model.poles.real), [-0.3, -0.0455], rtol=1e-6)
    np.testing.assert_array_equal(model.poles.imag, 0.0)
    assert model.d[0, 0] == pytest.approx(0.5, abs=1e-15)


def test_jones_model_stays_as_near_theodorsen_as_jones_function_does() -> None:
    model = realise(jones_responses(), tolerance=1e-6)
    for k in (0.05, 0.1, 0.3, 1.0):
        jones = 1.0 - sum(1j * k * a / (1j * k + p) for a, p in JONES)
        found = complex(model.frequency_response(k)[0, 0, 0])
        assert found == pytest.approx(jones, abs=1e-6)
        assert abs(found - theodorsen(k)) < 0.025


def test_wagner_response_gives_theodorsen_function() -> None:
    """The exact airfoil's circulatory lift: an algebraic tail, yet a few real poles serve over a decade of k."""
    reference = replace(REFERENCE, length=1.0, moment_reference=(0.25, 0.0, 0.0))
    airfoil = incompressible_airfoil(reference, 0.25)
    s = np.concatenate([[0.0], np.geomspace(0.02, 2000.0, 300)])
    # a step in q about c/4 has no apparent mass in the lift here: 2 pi phi(s) per q c/2U
    lift = airfoil.step(s)[:, 2, 3] / airfoil.step(1e12)[2, 3]
    response = StepResponse("q", s, lift[:, None], final=np.ones(1))
    data = StepResponses((response,), ("CN",), np.zeros(6), CONDITION, reference)
    model = realise(data, "exponential")
    for k in (0.05, 0.1, 0.2, 0.5):
        assert complex(model.frequency_response(k)[0, 0, 0]) == pytest.approx(theodorsen(k), abs=0.01)


def test_complex_poles_serve_a_delay_better_than_real_ones() -> None:
    """A response that settles in finite time; the choice between the methods is by held-out error."""
    solver, condition = plate(3.0)
    model = realise(responses(solver, condition, np.linspace(0.0, 8.0, 101)), max_order=5)
    assert model.method == "modal"
    for name in ("alpha", "q"):
        tried = [c for c in model.candidates if c.input == name]
        best = {m: min(c.held_out for c in tried if c.method == m) for m in ("exponential", "modal")}
        assert best["modal"] < 0.6 * best["exponential"]
        assert next(c.held_out for c in tried if c.chosen) <= 1.25 * best["modal"]


@pytest.mark.parametrize("mach", [1.2, 2.0, 3.0])
def test_plate_oscillation_not_seen_is_predicted_within_2_percent_of_its_peak(mach: float) -> None:
    solver, condition = plate(3.0)
    condition = replace(condition, mach=mach)
    end = 2.0 * mach / (mach - 1.0)
    model = realise(responses(solver, condition, np.linspace(0.0, 2.0 * end, 121)), "modal")
    for k in (0.05, 0.2):
        motion = PitchOscillation.from_reduced_frequency(condition, solver.reference, 0.01, k)
        times = np.linspace(0.0, 2.0 * motion.period, 160)
        check = check_prediction(model, solver.unsteady(condition, motion, times))
        for name in OUTPUTS:
            assert check[name].relative_peak < 0.02, check.summary()


@pytest.mark.parametrize("seed", range(2))
def test_noise_leaves_the_model_stable_small_and_near_the_truth(seed: int) -> None:
    noisy = responses(NoisySolver(known_system(), 0.01, seed), CONDITION, GRID)  # type: ignore[arg-type]
    settled = [
        replace(r, final=known_system().step(1e6)[ROWS, c]) for r, c in zip(noisy.responses, COLUMNS, strict=True)
    ]
    model = realise(replace(noisy, responses=tuple(settled)), max_order=4)
    assert np.all(model.poles.real < 0.0)
    assert model.order <= 8
    s = np.linspace(1.0, 40.0, 100)
    exact = known_system().step(s)
    for name, column in zip(("alpha", "q"), COLUMNS, strict=True):
        error = model.step(np.append(0.0, s))[name].values[1:] - exact[:, ROWS, column]
        # four standard deviations of the noise, which the value at 0+ keeps in full
        assert np.max(np.abs(error)) < 0.04 * np.max(np.abs(exact[:, ROWS, column]))


@pytest.mark.parametrize("method", ["exponential", "era", "modal"])
def test_models_of_growing_or_random_data_are_stable(method: str) -> None:
    rng = np.random.default_rng(7)
    s = np.linspace(0.0, 10.0, 41)
    for values in (np.exp(0.3 * s)[:, None], rng.normal(size=(41, 1)), np.cos(3.0 * s)[:, None]):
        data = StepResponses((StepResponse("alpha", s, values),), ("CN",), np.zeros(6), CONDITION, REFERENCE)
        for order in (1, 2):
            model = realise(data, method, order, match_integral=False)  # type: ignore[arg-type]
            assert model.order >= 1
            assert np.all(model.poles.real < 0.0)


def test_rom_keeps_the_alphadot_derivative_of_the_indicial_method() -> None:
    """With a final value from a steady solution that the record misses a little, as a solver's does."""
    data = responses(known_system(), CONDITION, graded(60.0, 150))
    finals = known_system().step(1e6)[np.ix_(ROWS, COLUMNS)] * (1.0 + 1e-5)
    data = replace(data, responses=tuple(replace(r, final=finals[:, j]) for j, r in enumerate(data.responses)))
    model = realise(data)
    alpha = data["alpha"]
    for i, name in enumerate(OUTPUTS):
        integral = deficiency_integral(alpha.s, alpha.values[:, i], finals[i, 0])
        assert model.derivatives().value(f"{name}_alphadot") == pytest.approx(-integral.value, rel=1e-9)
        assert -integral.value == pytest.approx(known_system().slope()[ROWS[i], 0], rel=2e-3)


def test_model_of_a_subsonic_section_refuses_the_lift_derivative_without_limit() -> None:
    reference = replace(REFERENCE, length=1.0, moment_reference=(0.25, 0.0, 0.0))
    airfoil = incompressible_airfoil(reference, 0.25)
    s = np.concatenate([[0.0], np.geomspace(0.01, 500.0, 200)])
    response = StepResponse("alpha", s, airfoil.step(s)[:, ROWS, 0], final=airfoil.step(1e12)[ROWS, 0])
    data = StepResponses((response,), OUTPUTS, np.zeros(6), CONDITION, reference)
    model = realise(data, order=4)
    assert list(model.refused) == ["CN_alphadot"]
    assert "CN_alphadot" not in model.derivatives().names()
    assert "refused: CN_alphadot" in model.summary()
    assert "CN_alphadot" in model.derivatives(0.1).names()


def test_quasi_steady_output_beside_a_lagging_one_is_kept() -> None:
    s = graded(60.0, 120)
    values = np.stack([np.full(s.size, 2.0), 3.0 - np.exp(-0.2 * s)], axis=1)
    data = StepResponses((StepResponse("alpha", s, values),), OUTPUTS, np.zeros(6), CONDITION, REFERENCE)
    model = realise(data)
    assert model.order == 1
    np.testing.assert_allclose(model.frequency_response(0.7)[0, 0, 0], 2.0, atol=1e-4)


@pytest.mark.parametrize("method", ["auto", "exponential", "era", "modal"])
@pytest.mark.parametrize("poles", ["separate", "shared"])
def test_input_that_is_answered_at_once_is_kept(method: Method, poles: Poles) -> None:
    """No lag at all, or no load: there is no pole to be found."""
    data = responses(known_system(), CONDITION, graded(40.0, 120))
    for value in (0.7, 0.0):
        flat = replace(data["q"], values=np.full_like(data["q"].values, value))
        model = realise(replace(data, responses=(data["alpha"], flat)), method, poles=poles)
        np.testing.assert_allclose(model.step(flat.s)["q"].values, value, atol=1e-12)


def test_too_few_samples_and_bad_choices_are_refused() -> None:
    data = responses(known_system(), CONDITION, np.linspace(0.0, 40.0, 5))
    with pytest.raises(InputError, match="needs six"):
        realise(data)
    with pytest.raises(InputError, match="must be one of auto"):
        realise(data, "fourier")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="order is 0"):
        realise(data, order=0)
    with pytest.raises(InputError, match="order is 60, must be from 1 to 30"):
        realise(data, order=60)
    with pytest.raises(InputError, match="max_order is 60, must be from 1 to 30"):
        realise(data, max_order=60)
    with pytest.raises(InputError, match="tolerance is nan"):
        realise(data, tolerance=float("nan"))


def test_a_tolerance_that_no_order_meets_is_said(caplog: pytest.LogCaptureFixture) -> None:
    data = responses(known_system(), CONDITION, graded(150.0, 100))
    realise(data, "modal", tolerance=1.0)
    realise(data, "modal", 1, tolerance=1e-9)
    assert not caplog.text
    model = realise(data, "exponential", max_order=1, tolerance=1e-3)
    assert min(one.held_out for one in model.candidates) > 1e-3
    assert "no order meets the tolerance" in caplog.text
    assert "response to q" in caplog.text


def test_era_recovers_poles_of_exact_free_decay() -> None:
    step = 0.4
    s = step * np.arange(60)
    samples = np.stack([np.exp(-0.3 * s) + np.exp(-0.1 * s) * np.cos(s), 2.0 * np.exp(-0.1 * s) * np.sin(s)], axis=1)
    modes = era_modes(samples, step, 3)
    np.testing.assert_allclose(modes.rates, [0.3], rtol=1e-9)
    np.testing.assert_allclose(modes.pairs, [[0.1, 1.0]], rtol=1e-9)


def test_hankel_matrix_holds_shifted_samples() -> None:
    blocks = hankel(np.arange(12.0).reshape(6, 2))
    np.testing.assert_array_equal(blocks[:2, 1], [2.0, 3.0])
    np.testing.assert_array_equal(blocks[2:4, 0], blocks[:2, 1])


def some_modes() -> tuple[Modes, TimeTarget]:
    s = np.linspace(0.0, 10.0, 60)
    values = np.random.default_rng(0).normal(size=(60, 2))
    weights = np.full(60, 1.0 / 6.0)
    target = TimeTarget(values, values[0], values.mean(axis=0), 10.0, weights, np.array([1.0, 2.0]), s)
    return Modes(np.array([0.3, 1.1]), np.array([[0.4, 1.0], [0.8, 2.0]])), target


@pytest.mark.parametrize("horizon", [np.inf, 10.0])
def test_slopes_of_modes_equal_central_differences(horizon: float) -> None:
    modes, target = some_modes()
    vector = modes.to_vector()
    basis, integral = modes.basis_slopes(target.s), modes.integral_slopes(horizon)
    k = np.array([0.02, 0.3, 1.0, 7.0])
    transform = modes.transform_slopes(k)
    for i, change in enumerate(1e-6 * np.eye(6)):
        up, down = modes.from_vector(vector + change), modes.from_vector(vector - change)
        np.testing.assert_allclose(basis[i], (up.basis(target.s) - down.basis(target.s)) / 2e-6, atol=1e-8)
        np.testing.assert_allclose(integral[i], (up.integral(horizon) - down.integral(horizon)) / 2e-6, atol=1e-8)
        np.testing.assert_allclose(transform[i], (up.transform(k) - down.transform(k)) / 2e-6, atol=1e-8)


def test_integral_of_modes_equals_quadrature() -> None:
    modes, _ = some_modes()
    s = np.linspace(0.0, 10.0, 20001)
    np.testing.assert_allclose(modes.integral(10.0), np.trapezoid(modes.basis(s), s, axis=0), atol=1e-6)


def test_refined_poles_are_a_stationary_point() -> None:
    modes, target = some_modes()
    best = refine(modes, [target], tolerance=1e-14)
    vector = best.to_vector()
    least = target.error(best, fit_amplitudes(best, target))
    low, high = best.bounds(0.2 / 10.0, 5.0 / (10.0 / 59.0))
    for change in 1e-3 * np.eye(6):
        for moved in (vector + change, vector - change):
            if np.all((moved > low) & (moved < high)):
                near = best.from_vector(moved)
                assert target.error(near, fit_amplitudes(near, target)) >= least - 1e-9


def test_constraints_hold_on_any_data() -> None:
    modes, target = some_modes()
    amplitudes = fit_amplitudes(modes, target)
    np.testing.assert_allclose(modes.basis(np.zeros(1))[0] @ amplitudes, target.initial, atol=1e-12)
    np.testing.assert_allclose(modes.integral(10.0) @ amplitudes, target.integral, atol=1e-12)


def test_candidates_tell_what_was_compared() -> None:
    model = realise(responses(known_system(), CONDITION, graded(150.0, 100)), max_order=3)
    for name in ("alpha", "q"):
        tried = [c for c in model.candidates if c.input == name]
        assert sum(c.chosen for c in tried) == 1
        assert {c.method for c in tried} == {"exponential", "modal"}
    assert "<- chosen" in model.summary()


def test_shared_poles_are_those_of_both_inputs() -> None:
    """A system whose inputs drive the same two modes: one set of poles is found, and serves both."""
    s = graded(80.0, 120)
    decay = np.exp(-np.outer(s, [0.15, 0.6]))
    alpha, q = (StepResponse(n, s, 2.0 - decay @ np.array(a)) for n, a in (("alpha", [[1.0, 0.3], [-0.5, 1.2]]),
                                                                        ("q", [[-0.4, 1.0], [0.8, 0.1]])))  # fmt: skip
    data = StepResponses((alpha, q), OUTPUTS, np.zeros(6), CONDITION, REFERENCE)
    for method in ("exponential", "modal", "era"):
        model = realise(data, method, 2, poles="shared", match_integral=False)  # type: ignore[arg-type]
        # the final value is that of the record's end, e^-12 from settled
        np.testing.assert_allclose(np.sort(model.poles.real), [-0.6, -0.6, -0.15, -0.15], rtol=2e-4)
        assert {c.input for c in model.candidates} == {"alpha, q"}


def test_shared_poles_serve_inputs_sampled_at_different_times() -> None:
    parts = [responses(known_system(), CONDITION, graded(end, count)) for end, count in ((80.0, 90), (120.0, 140))]
    data = replace(parts[0], responses=(parts[0]["alpha"], parts[1]["q"]))
    model = realise(data, "modal", poles="shared", tolerance=1e-4)
    assert model.order % 2 == 0
    assert max(error.peak for error in model.errors) < 5e-3


@pytest.mark.parametrize("method", ["exponential", "era", "modal"])
def test_outputs_in_another_order_or_unit_give_the_same_poles(method: str) -> None:
    data = responses(plate(3.0)[0], plate()[1], np.linspace(0.0, 8.0, 101))
    swapped = [replace(r, values=r.values[:, ::-1] * [0.1, 5.0]) for r in data.responses]
    other = replace(data, responses=tuple(swapped), outputs=OUTPUTS[::-1])
    poles = [realise(one, method, 3).poles for one in (data, other)]  # type: ignore[arg-type]
    np.testing.assert_allclose(np.sort_complex(poles[1]), np.sort_complex(poles[0]), rtol=1e-4)
