"""Forced roll: what each compensation holds, and its reading against the exact frequency response."""

import math

import numpy as np
import pytest

from indicial.cfd.lattice import Lattice, LatticeSettings, LatticeSolver
from indicial.cfd.shapes import LiftingSurface
from indicial.conventions import flow_angles
from indicial.errors import InputError
from indicial.methods import forced_oscillation, moving_frame, reduced_frequency
from indicial.motion import FlightCondition, RollOscillation

CONDITION = FlightCondition(0.1, alpha=math.radians(15.0))
AMPLITUDE = math.radians(5.0)
TIMES = np.linspace(0.0, 3.0, 301)


def motion(compensation="full", condition=CONDITION):
    return RollOscillation(condition, AMPLITUDE, 2.0, compensation)


def earth_velocity(roll):
    """V_b in the axes that the body has at zero roll."""
    phi, v = roll.angle(TIMES), roll.velocity(TIMES)
    y = np.cos(phi) * v[:, 1] - np.sin(phi) * v[:, 2]
    z = np.sin(phi) * v[:, 1] + np.cos(phi) * v[:, 2]
    return np.stack([v[:, 0], y, z], axis=1)


def test_full_compensation_holds_alpha_beta_and_speed():
    speed, alpha, beta = flow_angles(motion().velocity(TIMES))
    assert np.ptp(alpha) == np.ptp(speed) == 0.0
    assert np.all(beta == 0.0)


def test_sideslip_compensation_holds_beta_and_lets_alpha_vary():
    roll = motion("sideslip")
    _, alpha, beta = flow_angles(roll.velocity(TIMES))
    assert np.all(beta == 0.0)
    exact = np.arctan(math.tan(CONDITION.alpha) * np.cos(roll.angle(TIMES)))
    np.testing.assert_allclose(alpha, exact, rtol=0.0, atol=1e-15)


def test_roll_alone_turns_alpha_into_sideslip():
    roll = motion("none")
    _, _, beta = flow_angles(roll.velocity(TIMES))
    np.testing.assert_allclose(np.sin(beta), math.sin(CONDITION.alpha) * np.sin(roll.angle(TIMES)), atol=1e-15)
    # the point itself does not move: its velocity at zero roll stays
    np.testing.assert_allclose(earth_velocity(roll), np.tile(CONDITION.velocity, (TIMES.size, 1)), atol=1e-13)


@pytest.mark.parametrize(
    ("compensation", "across"),
    [
        ("sideslip", lambda phi: (np.sin(phi) * np.cos(phi), np.sin(phi) ** 2)),
        ("full", lambda phi: (np.sin(phi), 1.0 - np.cos(phi))),
    ],
)
def test_compensations_are_the_stated_translations(compensation, across):
    roll = motion(compensation)
    y, z = across(roll.angle(TIMES))
    w = CONDITION.velocity[2]
    given = CONDITION.velocity - w * np.stack([np.zeros_like(y), y, z], axis=1)
    np.testing.assert_allclose(earth_velocity(roll), given, atol=1e-13)


def test_rate_is_the_derivative_of_the_angle():
    roll, h = motion(), 1e-4
    slope = (roll.angle(TIMES + h) - roll.angle(TIMES - h)) / (2.0 * h)
    np.testing.assert_allclose(roll.rate(TIMES)[:, 0], slope, atol=1e-8)
    assert not np.any(roll.rate(TIMES)[:, 1:])


def test_bad_oscillations_are_refused():
    with pytest.raises(InputError, match="compensation 'half'"):
        motion("half")
    with pytest.raises(InputError, match="without sideslip"):
        motion(condition=FlightCondition(0.1, beta=0.1))
    with pytest.raises(InputError, match="frequency"):
        RollOscillation(CONDITION, AMPLITUDE, 0.0)


@pytest.fixture(scope="module")
def solver():
    wing = LiftingSurface.wing("wing", 8.0, 1.2, taper=0.6)
    lattice = Lattice.of(wing, chordwise=3, spanwise=8)
    return LatticeSolver(lattice, wing.reference((0.3, 0.0, 0.0)), LatticeSettings(wake="frozen"))


@pytest.fixture(scope="module")
def history(solver):
    return forced_oscillation.run(
        solver, FlightCondition(0.1), math.radians(0.5), 0.3, "roll", periods=2, steps_per_period=64
    )


def test_readings_of_a_linear_flow_are_its_frequency_response(solver, history):
    response = solver.frequency_response(history.condition, [0.3 * solver.reference.length / 8.0], ("p",))
    transfer = response.channel("Cl", "p")[0]
    for reduce in (forced_oscillation.regression, forced_oscillation.fourier, forced_oscillation.phase_angle):
        reading = reduce(history, 1)
        assert reading.k == pytest.approx(0.3)
        assert reading.value("Cl") == pytest.approx(transfer.real, rel=5e-3)
        # p b/2V = ik phi: the angle sees -k times the imaginary part
        assert reading.value("Cl", "in_phase") == pytest.approx(-0.3 * transfer.imag, abs=5e-3 * abs(transfer.real))


def test_roll_is_tabled_as_rate_derivatives_of_lateral_loads(history):
    table = forced_oscillation.fourier(history).derivatives()
    assert [record.name for record in table.records] == ["CY_p", "Cl_p", "Cn_p"]


def test_slow_roll_meets_the_moving_frame(solver, history):
    steady = moving_frame.run(solver, history.condition, ("p",), second=None)
    response = solver.frequency_response(history.condition, [0.0], ("p",))
    assert steady["Cl_p"] == pytest.approx(response.at_zero("Cl", "p")[0], rel=1e-4)


def test_reduced_frequency_methods_refuse_roll(history):
    with pytest.raises(InputError, match="pitch"):
        reduced_frequency.read(history)
