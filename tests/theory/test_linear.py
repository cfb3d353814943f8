"""The linear oracles against second implementations: integration in time, Theodorsen, tabulated Wagner."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from indicial.conventions import ReferenceQuantities
from indicial.motion import AlphaStep, FlightCondition, PitchOscillation
from indicial.solver import Solver
from theory.linear import incompressible_airfoil, random_system, theodorsen, wagner, wagner_spectrum

REFERENCE = ReferenceQuantities(length=2.0, area=3.0, lateral_length=5.0)
CONDITION = FlightCondition(0.6, alpha=0.03)


def test_wagner_equals_published_values() -> None:
    # Wagner (1925), as tabulated in Bisplinghoff, Ashley and Halfman, Aeroelasticity
    published = [0.5, 0.60061, 0.78820, 0.87504, 0.93665, 0.97676]
    np.testing.assert_allclose(wagner([0.0, 1.0, 5.0, 10.0, 20.0, 50.0]), published, atol=6e-6)


def test_wagner_transforms_into_theodorsen() -> None:
    x, w = wagner_spectrum()
    for k in (0.01, 0.3, 2.0):
        assert abs(theodorsen(k) - (1.0 - np.sum(w * 1j * k / (1j * k + x)))) < 1e-10


def test_linear_system_equals_integration_in_time() -> None:
    system = random_system(REFERENCE)
    assert isinstance(system, Solver)
    motion = PitchOscillation.from_reduced_frequency(CONDITION, REFERENCE, 0.02, 0.2)
    times = np.linspace(0.0, 2.0 * motion.period, 40)
    history = system.unsteady(CONDITION, motion, times)
    unit = REFERENCE.length / (2.0 * CONDITION.speed)

    def inputs(time: float) -> np.ndarray:
        scaled = motion.rate(time) * REFERENCE.rate_scale(CONDITION.speed)
        return np.array([float(motion.alpha(time)), 0.0, *scaled])

    start = -(system.b @ inputs(0.0)) / system.poles
    solved = solve_ivp(
        lambda s, x: system.poles * x + system.b @ inputs(s * unit),
        (0.0, times[-1] / unit), start, "DOP853", times / unit, rtol=1e-10, atol=1e-12,
    )  # fmt: skip
    driven = np.array([inputs(t) for t in times])
    expected = system.offset + np.real(solved.y.T @ system.c.T) + driven @ system.d.T
    np.testing.assert_allclose(history.coefficients, expected, atol=1e-8)


def test_linear_system_steps_as_its_step_response_says() -> None:
    system = random_system(REFERENCE)
    times = np.linspace(0.0, 1.0, 20)
    history = system.unsteady(CONDITION, AlphaStep(CONDITION, 0.01), times)
    np.testing.assert_allclose(
        (history.coefficients - history.before) / 0.01, system.step(history.s)[:, :, 0], rtol=1e-8, atol=1e-10
    )


def test_transfer_slope_is_the_derivative_of_the_transfer_function() -> None:
    system = random_system(REFERENCE)
    np.testing.assert_allclose(system.transfer(1e-5).imag / 1e-5, system.slope(), rtol=1e-6, atol=1e-8)


def test_incompressible_airfoil_oscillates_as_theodorsen_says() -> None:
    airfoil = incompressible_airfoil(REFERENCE, 0.25)
    k = 0.1
    mass = np.pi * 1j * k / (1.0 + 0.05j * k)  # apparent mass, spread in time
    np.testing.assert_allclose(airfoil.transfer(k)[2, 0], 2.0 * np.pi * theodorsen(k) + mass, atol=1e-9)
    np.testing.assert_allclose(airfoil.transfer(k)[4, 0], -mass / 4.0, atol=1e-9)
    np.testing.assert_allclose(airfoil.transfer(1e-9)[4, 3].real, -np.pi / 4.0, atol=1e-9)
