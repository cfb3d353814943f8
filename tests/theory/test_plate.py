"""The flat-plate oracle against its own theory: tabulated values, loading integrals, limits, reciprocity."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from indicial.conventions import ReferenceQuantities
from indicial.motion import AlphaStep, FlightCondition, PitchOscillation, PitchRateStep
from indicial.solver import Solver
from theory.plate import (
    SupersonicPlate,
    about_axis,
    frequency_response,
    incidence_derivatives,
    settling_tau,
    steady_response,
    subsonic_early_step,
    supersonic_step,
)

MACHS = (1.05, 1.5, 2.5, 4.5)

# M, s = 2Ut/c, then cl_alpha, cm_alpha, cl_q, cm_q about the leading edge per q c/U: quadrature of the loadings of
# Lomax, Heaslet, Fuller and Sluder, NACA TR 1077 (1952).
TABLE = np.array(
    [
        [1.1, 0.55, 3.63636364, -1.76136364, 1.87500000, -1.22253788],
        [1.1, 1.1, 3.64453314, -1.59924226, 2.04529088, -1.29528854],
    ]
)


def loading(mach: float, x: float, t: float) -> tuple[float, float]:
    """dcp per alpha and per q c/U about the leading edge, straight from the source integrals."""
    b = np.sqrt(mach**2 - 1.0)

    def circle(at: float, when: float) -> float:
        return float(np.arcsin(np.clip((at - mach * when) / when, -1.0, 1.0)) + np.pi / 2.0)

    s1 = circle(x, t)
    s2 = mach / b * (np.arcsin(np.clip((b**2 * t - mach * x) / x, -1.0, 1.0)) + np.pi / 2.0)
    s2 = 0.0 if t <= x / (mach + 1.0) else s2
    s2 = np.pi * mach / b if t >= x / (mach - 1.0) else s2
    at = x - mach * t
    low, high = np.arcsin(np.clip(-at / t, -1.0, 1.0)), np.pi / 2.0  # x1 = X + t sin(angle) > 0
    s1q = quad(lambda angle: at + t * np.sin(angle), low, high)[0]
    s3 = mach * quad(lambda when: circle(x, when), 0.0, t, points=[x / (mach + 1.0), x / (mach - 1.0)], limit=200)[0]
    scale = 4.0 / (np.pi * mach)
    return scale * (s1 + s2), scale * (s1q + s3)


def test_plate_equals_tabulated_values() -> None:
    for row in TABLE:
        np.testing.assert_allclose(supersonic_step(row[0], row[1]), row[2:], atol=6e-9)


@pytest.mark.parametrize(("mach", "tau"), [(1.2, 0.2), (1.2, 1.3), (2.0, 0.5), (2.0, 0.9)])
def test_closed_forms_equal_chordwise_integrals_of_the_loading(mach: float, tau: float) -> None:
    breaks = [p for p in (mach * tau - tau, mach * tau + tau) if 0.0 < p < 1.0]

    def integral(column: int, power: int) -> float:
        value, _ = quad(
            lambda x: x**power * loading(mach, x, tau)[column], 1e-12, 1.0, points=breaks, limit=200, epsabs=1e-8
        )
        return float(value)

    direct = [integral(0, 0), -integral(0, 1), integral(1, 0), -integral(1, 1)]
    np.testing.assert_allclose(supersonic_step(mach, 2.0 * mach * tau), direct, atol=2e-6)


@pytest.mark.parametrize("mach", MACHS)
def test_plate_starts_at_piston_theory_and_settles_in_finite_time(mach: float) -> None:
    piston = np.array([4.0, -2.0, 2.0, -4.0 / 3.0]) / mach
    np.testing.assert_allclose(supersonic_step(mach, 0.0), piston)
    first, last = settling_tau(mach)
    for tau in (first, last):  # continuous where the pieces meet
        around = supersonic_step(mach, 2.0 * mach * tau * np.array([1.0 - 1e-9, 1.0 + 1e-9]))
        np.testing.assert_allclose(around[0], around[1], atol=1e-6)
    np.testing.assert_allclose(supersonic_step(mach, 1e4), steady_response(mach))


@pytest.mark.parametrize("mach", MACHS)
def test_reciprocity_about_mid_chord(mach: float) -> None:
    responses = supersonic_step(mach, np.linspace(0.0, 3.0 * mach / (mach - 1.0), 60), 0.5)
    np.testing.assert_allclose(responses[:, 1], responses[:, 2], atol=1e-9)


@pytest.mark.parametrize("mach", MACHS)
def test_frequency_response_has_the_exact_limit_and_slope(mach: float) -> None:
    k = 1e-4 * (mach - 1.0)
    response = frequency_response(mach, k)
    np.testing.assert_allclose(response.real, steady_response(mach), rtol=1e-6)
    # d/d(ik) per c/2U is twice the derivative per c/U
    np.testing.assert_allclose(response[:2].imag / k, 2.0 * np.array(incidence_derivatives(mach)), rtol=1e-5)


@pytest.mark.parametrize(("mach", "gap_percent", "tolerance"), [(1.05, 6.3, 0.06), (1.1, 1.7, 0.05), (1.2, 0.5, 0.05)])
def test_gap_between_oscillation_and_steady_rate_of_a_tail_fin(
    mach: float, gap_percent: float, tolerance: float
) -> None:
    # fin chord 1d with its mid-chord 4d behind the moment reference, alpha held, k = 0.025
    steady = steady_response(mach, -3.5)[3]
    gap = 1.0 - frequency_response(mach, 0.025, -3.5)[3].real / steady
    assert 100.0 * gap == pytest.approx(gap_percent, abs=tolerance)


def test_gap_of_a_tail_fin_is_under_a_thousandth_from_mach_1_5() -> None:
    for mach in (1.5, 2.0, 3.0):
        assert 0.0 < 1.0 - frequency_response(mach, 0.025, -3.5)[3].real / steady_response(mach, -3.5)[3] < 1e-3


def plate(mach: float) -> tuple[SupersonicPlate, FlightCondition]:
    reference = ReferenceQuantities(length=0.5, area=0.6, moment_reference=(0.3, 0.0, 0.0))
    return SupersonicPlate(reference, chord=1.5, span=0.4, leading_edge=0.1), FlightCondition(mach, alpha=0.02)


def test_plate_solver_returns_its_step_responses() -> None:
    solver, condition = plate(1.4)
    assert isinstance(solver, Solver)
    times = np.linspace(0.0, 0.03, 50)
    exact = supersonic_step(1.4, 2.0 * condition.speed * times / 1.5, solver.axis)
    history = solver.unsteady(condition, AlphaStep(condition, 0.01), times)
    np.testing.assert_allclose((history["CN"] - history.initial("CN")) / 0.01, exact[:, 0], rtol=1e-9)
    np.testing.assert_allclose((history["Cm"] - history.initial("Cm")) / 0.01, exact[:, 1] * 3.0, rtol=1e-7)
    history = solver.unsteady(condition, PitchRateStep(condition, 2.0), times)
    unit = 2.0 * 1.5 / condition.speed
    np.testing.assert_allclose((history["Cm"] - history.initial("Cm")) / unit, exact[:, 3] * 3.0, rtol=1e-7)
    after = FlightCondition(1.4, alpha=0.03)
    last = solver.unsteady(condition, AlphaStep(condition, 0.01), [0.0, 1.0]).coefficients[-1]
    np.testing.assert_allclose(last, solver.steady(after).coefficients, rtol=1e-9)


def test_plate_solver_oscillates_as_its_frequency_response_says() -> None:
    solver, condition = plate(1.2)
    k, amplitude = 0.1, 0.01
    motion = PitchOscillation.from_reduced_frequency(condition, solver.reference, amplitude, k)
    times = np.linspace(0.0, 3.0 * motion.period, 90)
    history = solver.unsteady(condition, motion, times)
    response = solver.frequency_response(condition, k)
    phasor = response[:, 0] * -1j * amplitude + response[:, 1] * amplitude * k
    mean = solver.steady(condition)
    for name, value in zip(("CN", "Cm"), phasor, strict=True):
        expected = mean[name] + np.real(value * np.exp(1j * motion.omega * times))
        late = times > 2.0 * motion.period
        np.testing.assert_allclose(history[name][late], expected[late], rtol=1e-8, atol=1e-11)


def test_early_subsonic_responses_start_at_piston_theory_and_keep_their_identity() -> None:
    s = np.linspace(0.0, 2.0 * 0.5 / 1.5, 10)
    early = subsonic_early_step(0.5, s)
    np.testing.assert_allclose(early[0], [8.0, -4.0, 4.0])
    np.testing.assert_allclose(early[:, 2], early[:, 0] + early[:, 1])  # cl_q = cl_alpha + cm_alpha, always
    assert np.all(np.diff(early[:, 0]) < 0.0)  # the lift falls before it climbs


def test_axis_change_composes() -> None:
    responses = steady_response(2.0)
    np.testing.assert_allclose(about_axis(responses, 0.7), about_axis(about_axis(responses, 0.2), 0.5), rtol=1e-12)
