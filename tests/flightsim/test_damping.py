"""Epicyclic fits, modes and damping against closed forms and each other."""

import math
from dataclasses import replace

import numpy as np
import pytest

from flightsim.support import DENSITY, FINNER, SPEED, derivative_model, first_order_lag
from indicial.errors import InputError
from indicial.flightsim import (
    DampingChange,
    FlatEarth,
    InitialState,
    build_dynamics,
    check_damping,
    epicyclic_roots,
    fit_epicycle,
    holding_roll,
    missile_modes,
    simulate,
)

AREA, LENGTH, MASS, PITCH_INERTIA = FINNER.reference.area, FINNER.reference.length, FINNER.mass, FINNER.inertia[1, 1]


def test_fit_finds_the_epicycle_that_was_made() -> None:
    s = np.linspace(3.0, 180.0, 400)
    fast, slow, trim = -0.004 + 0.25j, -0.006 - 0.14j, 1e-3 - 5e-4j
    xi = (0.01 + 0.02j) * np.exp(fast * s) + (0.015 - 0.01j) * np.exp(slow * s) + trim
    fit = fit_epicycle(s, xi)
    assert fit.fast.eigenvalue == pytest.approx(fast, abs=1e-11)
    assert fit.slow.eigenvalue == pytest.approx(slow, abs=1e-11)
    assert fit.fast.amplitude == pytest.approx(0.01 + 0.02j, rel=1e-8)
    assert fit.trim == pytest.approx(trim, rel=1e-7)
    assert fit.residual < 1e-12
    assert fit(s) == pytest.approx(xi, abs=1e-11)


def test_fit_of_noisy_motion_scatters_about_the_truth() -> None:
    noise = np.random.default_rng(1)
    s = np.linspace(0.0, 200.0, 300)
    clean = 0.02 * (np.exp((-0.005 + 0.19j) * s) + np.exp((-0.005 - 0.19j) * s))
    fits = [
        fit_epicycle(s, clean + 1e-4 * (noise.standard_normal(300) + 1j * noise.standard_normal(300)))
        for _ in range(10)
    ]
    values = np.array([fit.fast.eigenvalue.real for fit in fits])
    spread = np.std(values) / math.sqrt(10)
    assert abs(np.mean(values) + 0.005) < 4.0 * spread
    assert np.std(values) < 0.01 * 0.005
    assert np.mean([fit.residual for fit in fits]) == pytest.approx(1e-4 * math.sqrt(2.0), rel=0.1)


def test_too_short_a_record_is_refused() -> None:
    with pytest.raises(InputError, match="12"):
        fit_epicycle(np.arange(5.0), np.zeros(5))


def test_closed_form_at_zero_roll_is_the_textbook_formula() -> None:
    d = derivative_model()
    fast, slow = epicyclic_roots(FINNER, d, DENSITY, SPEED)
    formula = (
        DENSITY
        * SPEED
        * AREA
        / 4.0
        * (-(d.CN_alpha - d.CA_0) / MASS + d.CA_0 / MASS + LENGTH**2 / (2 * PITCH_INERTIA) * (d.Cm_q + d.Cm_alphadot))
    )
    assert fast.real * SPEED == pytest.approx(formula, rel=1e-12)
    assert slow == pytest.approx(fast.conjugate(), rel=1e-12)
    stiffness = DENSITY * SPEED**2 * AREA * LENGTH * -d.Cm_alpha / (2.0 * PITCH_INERTIA)
    assert abs(fast.imag * SPEED) == pytest.approx(math.sqrt(stiffness - formula**2), rel=1e-12)


@pytest.mark.parametrize("roll_rate", [0.0, 300.0, -5000.0])
def test_linearised_modes_equal_linear_theory(roll_rate: float) -> None:
    """What the theory neglects (CN_q, CN_alphadot, lift times damping) is of the order of rho S c CN_q/4m, 1e-4."""
    dynamics = build_dynamics(FINNER, derivative_model())
    modes = missile_modes(dynamics, SPEED, roll_rate=roll_rate)
    theory = epicyclic_roots(FINNER, derivative_model(), DENSITY, SPEED, roll_rate)
    for name, root in zip(("fast arm", "slow arm"), theory, strict=True):
        assert modes[name].damping == pytest.approx(root.real * SPEED, rel=1e-3)
        assert modes[name].frequency == pytest.approx(root.imag * SPEED, rel=1e-3)


def test_roll_mode_is_the_closed_form() -> None:
    modes = missile_modes(build_dynamics(FINNER, derivative_model()), SPEED)
    exact = DENSITY * SPEED * AREA * LENGTH**2 * -22.0 / (4.0 * FINNER.inertia[0, 0])
    assert modes["roll"].eigenvalue == pytest.approx(exact, rel=1e-12)


def test_fin_cant_holds_the_roll_against_damping_while_drag_slows_the_missile() -> None:
    model = holding_roll(FINNER, derivative_model(), SPEED, 400.0)
    start = InitialState.from_path(SPEED, rate=(400.0, 0.0, 0.0))
    flight = simulate(FINNER, model, start, 0.5, step=1e-3, earth=FlatEarth(0.0))
    assert flight.speed[-1] < 0.96 * SPEED
    assert flight.rate[:, 0] / flight.speed == pytest.approx(400.0 / SPEED, rel=1e-10)


@pytest.mark.parametrize("roll_rate", [0.0, 1500.0])
@pytest.mark.parametrize("model", [derivative_model(), first_order_lag(0.3)], ids=["derivatives", "lag"])
def test_damping_of_a_small_flight_is_that_of_its_linearisation(model: object, roll_rate: float) -> None:
    check = check_damping(FINNER, model, SPEED, roll_rate=roll_rate, amplitude=math.radians(0.02), wavelengths=3.0)
    assert check.fit.residual < 1e-4 * math.radians(0.02)
    for arm in check.arms:
        assert arm.fitted.real == pytest.approx(arm.linearised.real, rel=2e-6)
        assert arm.fitted.imag == pytest.approx(arm.linearised.imag, rel=2e-6)
        assert abs(arm.closed_form_difference) < 1e-3


def test_damping_of_a_stiff_flight_is_that_of_its_linearisation() -> None:
    """A lag far faster than the motion, which CVODES flies."""
    check = check_damping(FINNER, first_order_lag(3.0), SPEED, amplitude=math.radians(0.02), wavelengths=3.0)
    assert check.trajectory.provenance["method"] == "cvodes"
    for arm in check.arms:
        assert arm.fitted.real == pytest.approx(arm.linearised.real, rel=2e-6)
        assert arm.fitted.imag == pytest.approx(arm.linearised.imag, rel=2e-6)


def test_fitted_damping_parts_from_the_linear_one_with_the_square_of_the_amplitude() -> None:
    differences = [
        check_damping(FINNER, derivative_model(), SPEED, amplitude=math.radians(a)).arms[0].fit_difference
        for a in (1.0, 2.0)
    ]
    assert differences[1] / differences[0] == pytest.approx(4.0, rel=0.05)


def test_slowing_down_is_what_time_based_damping_would_miss() -> None:
    """With drag far larger than damping, the angles still follow the distance-based eigenvalue."""
    check = check_damping(FINNER, derivative_model(CA_0=3.0), SPEED, amplitude=math.radians(0.02), wavelengths=3.0)
    arm = check.arms[0]
    assert arm.fitted.real == pytest.approx(arm.linearised.real, rel=1e-5)
    assert check.slowing > 0.05 * abs(arm.linearised.real)


def test_slow_aerodynamics_change_damping_and_frequency_as_their_transfer_function_says() -> None:
    """First order in the aerodynamics: the lag's change of Cm over twice the frequency."""
    model = first_order_lag(0.02)
    lagged, quasi = (
        missile_modes(build_dynamics(FINNER, m), SPEED)["fast arm"].eigenvalue for m in (model, model.quasi_steady())
    )
    k = quasi * LENGTH / (2.0 * SPEED)
    change = -60.0 * (k / (1.0 + k / 0.02) - k)
    stiffness = DENSITY * SPEED**2 * AREA * LENGTH / (2.0 * PITCH_INERTIA)
    expected = stiffness * change / (2j * quasi.imag)
    assert abs(lagged - quasi - expected) < 0.02 * abs(expected)


def test_change_of_damping_is_told_for_both_arms() -> None:
    slow = first_order_lag(0.005)
    before, after = (check_damping(FINNER, m, SPEED, wavelengths=2.0) for m in (slow.quasi_steady(), slow))
    change = DampingChange(before, after)
    exact = after.modes["fast arm"].damping / before.modes["fast arm"].damping - 1.0
    assert change.damping == pytest.approx((exact, exact), rel=1e-9)
    assert abs(exact) > 1e-3
    assert "state-space" in change.summary()
    assert "stable" in after.summary()


def test_a_missile_that_does_not_oscillate_is_refused() -> None:
    with pytest.raises(InputError, match="oscillate"):
        check_damping(FINNER, derivative_model(Cm_alpha=5.0), SPEED)


def test_a_body_with_two_planes_is_refused() -> None:
    vehicle = replace(FINNER, inertia=np.diag([1.92e-4, 9.785e-3, 9.9e-3]))
    with pytest.raises(InputError, match="planes"):
        missile_modes(build_dynamics(vehicle, derivative_model()), SPEED)


def test_check_is_drawn() -> None:
    import matplotlib.pyplot as plt

    assert len(check_damping(FINNER, derivative_model(), SPEED, roll_rate=1000.0, wavelengths=2.0).plot().axes) == 2
    plt.close("all")


def test_a_roll_too_quick_to_be_flown_is_refused_by_its_name() -> None:
    with pytest.raises(InputError, match=r"at a roll rate of 1e\+07 rad/s takes .* steps, at most 20000000 are flown"):
        check_damping(FINNER, derivative_model(), SPEED, roll_rate=1e7)
