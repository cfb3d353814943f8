"""Parameters that are functions of time: their values, and flights under them against closed forms."""

import math

import casadi as ca
import numpy as np
import pytest

from flightsim.support import FINNER, derivative_model
from indicial.errors import InputError
from indicial.flightsim import CosineGust, FlatEarth, InitialState, Motor, Signal, build_dynamics, fly

THRUST = ca.SX.sym("thrust")
QUIET = derivative_model(CA_0=0.0, CN_alpha=0.0, CN_q=0.0, CN_alphadot=0.0, Cm_alpha=0.0, Cm_q=0.0, Cm_alphadot=0.0)
ROCKET = build_dynamics(FINNER, QUIET, earth=FlatEarth(0.0), forces=[Motor(THRUST, (0.3, 0.0, 0.0))])
START = InitialState.from_path(1.0)


def test_a_signal_is_linear_between_its_points_jumps_where_told_and_holds_beyond() -> None:
    signal = Signal([0.0, 1.0, 1.0, 3.0], [2.0, 4.0, -1.0, 1.0])
    times = [-5.0, 0.0, 0.5, 1.0 - 1e-12, 1.0, 2.0, 3.0, 9.0]
    assert signal.at(times) == pytest.approx([2.0, 2.0, 3.0, 4.0, -1.0, 0.0, 1.0, 1.0])


def test_multisteps_alternate_as_their_pattern_says() -> None:
    signal = Signal.multistep(0.1, unit=0.5, at=1.0, base=0.02)
    middles = [0.5, 1.75, 3.0, 3.75, 4.25, 5.0]
    assert signal.at(middles) == pytest.approx([0.02, 0.12, -0.08, 0.12, -0.08, 0.02])
    assert Signal.doublet(1.0, 2.0).at([1.0, 3.0, 4.5]) == pytest.approx([1.0, -1.0, 0.0])
    assert Signal.step(3.0, at=1.0, base=-1.0).at([0.9, 1.0]) == pytest.approx([-1.0, 2.0])


@pytest.mark.parametrize("method", ["rk4", "dop853"])
def test_speed_gained_is_the_integral_of_the_thrust(method: str) -> None:
    """Jumps at 0.3 and 0.7 s, between which thrust grows; both methods exact, as their steps meet the jumps."""
    signal = Signal([0.3, 0.3, 0.7, 0.7], [0.0, 10.0, 30.0, 0.0])
    flight = fly(ROCKET, START, 1.0, parameters={"thrust": signal}, method=method, step=0.1)
    impulse = np.interp(flight.time, [0.0, 0.3, 0.4, 0.5, 0.6, 0.7], [0.0, 0.0, 1.25, 3.0, 5.25, 8.0])
    assert flight.velocity[:, 0] - 1.0 == pytest.approx(impulse / FINNER.mass, abs=1e-12)


def test_the_adaptive_march_does_not_pass_over_a_short_pulse() -> None:
    signal = Signal.pieces([5.0, 5.001], [1000.0])
    flight = fly(ROCKET, START, 10.0, parameters={"thrust": signal}, step=2.0, method="dop853")
    assert flight.velocity[-1, 0] - 1.0 == pytest.approx(1.0 / FINNER.mass, rel=1e-12)


def test_nor_over_a_short_gust() -> None:
    """A vehicle with drag alone crosses 20 m of gust 5 km away: momentum lost to it, against a fine fixed step."""
    model = derivative_model(CN_alpha=0.0, CN_q=0.0, CN_alphadot=0.0, Cm_alpha=0.0, Cm_q=0.0, Cm_alphadot=0.0)
    dynamics = build_dynamics(
        FINNER, model, earth=FlatEarth(0.0), wind=CosineGust((-200.0, 0.0, 0.0), 20.0, start=2000.0)
    )
    fast = InitialState.from_path(680.0)
    adaptive = fly(dynamics, fast, 4.0, method="dop853", step=0.01, estimate_error=False)
    fixed = fly(dynamics, fast, 4.0, step=1e-4, every=10000, estimate_error=False)
    still = fly(build_dynamics(FINNER, model, earth=FlatEarth(0.0)), fast, 4.0, step=1e-3, estimate_error=False)
    assert adaptive.velocity[-1, 0] == pytest.approx(fixed.velocity[-1, 0], abs=1e-6)
    assert still.velocity[-1, 0] - adaptive.velocity[-1, 0] > 0.1


def test_order_of_the_adaptive_march_survives_jumps() -> None:
    """Pitch under a doublet of moment: the same as marching the pieces one after the other."""
    kick = ca.SX.sym("kick")
    dynamics = build_dynamics(FINNER, derivative_model(Cm_q=-300.0 + kick * 50.0), earth=FlatEarth(0.0))
    signal = Signal.pieces([0.013, 0.029], [2.0])
    start = InitialState.from_path(687.0, alpha=0.05)
    whole = fly(dynamics, start, 0.05, parameters={"kick": signal}, method="dop853", step=0.05)
    for duration, value in ((0.013, 0.0), (0.016, 2.0), (0.021, 0.0)):
        piece = fly(dynamics, start, duration, parameters={"kick": value}, method="dop853", step=duration)
        start = InitialState(piece.velocity[-1], piece.quaternion[-1], piece.rate[-1], piece.position[-1])
    assert whole.velocity[-1] == pytest.approx(piece.velocity[-1], abs=1e-8)
    assert whole.rate[-1] == pytest.approx(piece.rate[-1], abs=1e-8)


def test_loads_are_recorded_with_the_signal_of_the_moment() -> None:
    drag = ca.SX.sym("drag")
    dynamics = build_dynamics(FINNER, derivative_model(CA_0=drag), earth=FlatEarth(0.0))
    flight = fly(
        dynamics, InitialState.from_path(500.0), 0.1, parameters={"drag": Signal.step(0.4, at=0.05)}, step=0.01
    )
    expected = np.where(flight.time >= 0.05, 0.4, 0.0)
    assert flight.coefficients[:, 0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Signal([1.0, 0.0], [0.0, 0.0]), "decrease"),
        (lambda: Signal([1.0, 1.0, 1.0], [0.0, 0.0, 1.0]), "three times"),
        (lambda: Signal([1.0], [0.0, 0.0]), "as many values"),
        (lambda: Signal([1.0], [math.nan]), "finite"),
        (lambda: Signal.pieces([0.0, 1.0], [1.0, 2.0]), "edges"),
        (lambda: Signal.multistep(1.0, 0.0), "lengths above 0"),
        (lambda: fly(ROCKET, START, 1.0, parameters={"thrust": math.inf}), "finite"),
        (lambda: fly(ROCKET, START, 1.0, parameters={}), "parameters given"),
        (lambda: fly(ROCKET, START, 1.0, parameters={"thrust": Signal.step(1.0)}, method="cvodes"), "CVODES"),
    ],
)
def test_what_makes_no_sense_is_refused(make: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()
