"""Vehicles that burn, motors, tables and forces of the user's own, against closed forms."""

import math
from dataclasses import replace

import casadi as ca
import numpy as np
import pytest

from flightsim.support import FINNER, SPEED, derivative_model
from indicial.errors import InputError
from indicial.flightsim import (
    ALPHA,
    ALTITUDE,
    MACH,
    TIME,
    TOTAL_ANGLE,
    ConstantAtmosphere,
    FlatEarth,
    FunctionForce,
    InitialState,
    Motor,
    Vehicle,
    build_dynamics,
    fly,
    table,
)

NO_LOADS = derivative_model(
    CA_0=0.0, CN_alpha=0.0, CN_q=0.0, CN_alphadot=0.0, Cm_alpha=0.0, Cm_q=0.0, Cm_alphadot=0.0, Cl_p=0.0
)
VACUUM = {"atmosphere": ConstantAtmosphere(pressure=0.0), "earth": FlatEarth(0.0)}


def burning(**changed: object) -> Vehicle:
    values = {"name": "burning", "mass": FINNER.mass, "inertia": FINNER.inertia, "reference": FINNER.reference}
    return Vehicle(**(values | {"centre_of_gravity": FINNER.centre_of_gravity} | changed))


def test_a_rocket_gains_what_tsiolkovsky_says() -> None:
    """Constant thrust mu c_e: delta v = c_e ln(m0/m1)."""
    exhaust, flow, duration = 2000.0, 0.3, 4.0
    vehicle = burning(mass=table(TIME, [0.0, duration], [2.0, 2.0 - flow * duration]))
    motor = Motor(exhaust * flow, nozzle=(0.3, 0.0, 0.0))
    dynamics = build_dynamics(vehicle, NO_LOADS, **VACUUM, forces=[motor])
    flight = fly(dynamics, InitialState.from_path(1.0), duration, method="dop853", step=0.1)
    assert flight.velocity[-1, 0] - 1.0 == pytest.approx(exhaust * math.log(2.0 / 0.8), rel=1e-10)


def test_mass_that_leaves_without_being_thrown_takes_no_speed_along() -> None:
    """A spinning body whose centre of gravity drifts: the centre moves with the body's point that is there."""
    drift, spin, duration = 0.02, 3.0, 2.0
    centre = (table(TIME, [0.0, duration], [0.165, 0.165 + drift * duration]), 0.0, 0.0)  # aft
    vehicle = burning(centre_of_gravity=centre, inertia=np.diag([1.0, 1.0, 1.0]))
    dynamics = build_dynamics(vehicle, NO_LOADS, **VACUUM)
    start = InitialState.from_path(5.0, rate=(0.0, 0.0, spin))
    flight = fly(dynamics, start, duration, method="dop853", step=0.05)
    assert flight.rate[:, 2] == pytest.approx(spin, abs=1e-10)
    # The body's point at the centre of gravity is not accelerated, so the nose is, by -omega^2 (a + d t) exp(i omega t)
    # from it: z = (a + 2 i d/omega + d t) exp(i omega t) - 2 i d/omega + (V + d) t.
    t, turned = flight.time, np.exp(1j * spin * flight.time)
    nose = flight.position[:, 0] + 1j * flight.position[:, 1] + (0.165 + drift * t) * turned
    lead = 2j * drift / spin
    assert nose == pytest.approx((0.165 + lead + drift * t) * turned - lead + (5.0 + drift) * t, abs=1e-9)


def test_the_jet_damps_a_turning_rocket() -> None:
    """dI/dt = -mu k^2: omega = omega0 (I/I0)^((l^2 - k^2)/k^2), l the nozzle's arm (Thomson, sec. 7.10)."""
    flow, duration, square, nozzle = 0.2, 3.0, 0.01, 0.365
    mass = table(TIME, [0.0, duration], [2.0, 2.0 - flow * duration])
    transverse = table(TIME, [0.0, duration], [0.04, 0.04 - flow * duration * square])
    inertia = ca.diag(ca.vertcat(0.002, transverse, transverse))
    vehicle = burning(mass=mass, inertia=inertia)
    dynamics = build_dynamics(vehicle, NO_LOADS, **VACUUM, forces=[Motor(50.0, nozzle=(nozzle, 0.0, 0.0))])
    flight = fly(dynamics, InitialState.from_path(5.0, rate=(0.0, 0.7, 0.0)), duration, method="dop853", step=0.1)
    arm = nozzle - 0.165
    expected = 0.7 * (1.0 - flow * flight.time * square / 0.04) ** ((arm**2 - square) / square)
    assert flight.rate[:, 1] == pytest.approx(expected, rel=1e-9)


def test_a_motor_off_the_axis_turns_the_body() -> None:
    motor = Motor(10.0, nozzle=(0.3, 0.0, 0.02))
    dynamics = build_dynamics(FINNER, NO_LOADS, **VACUUM, forces=[motor])
    rate = dynamics.rate(dynamics.initial_vector(InitialState.from_path(5.0)))
    # the nozzle is 0.02 m above the axis: thrust there pitches the nose down
    assert rate[11] == pytest.approx(-10.0 * 0.02 / FINNER.inertia[1, 1], rel=1e-12)
    assert rate[3] == pytest.approx(10.0 / FINNER.mass, rel=1e-12)


def test_values_of_a_model_follow_tables_of_the_flight_condition() -> None:
    """At any state the model with tables has the loads of the model with the numbers of that state."""
    machs, values = [1.5, 2.0, 2.5], [-20.0, -30.0, -25.0]
    model = derivative_model(Cm_alpha=table(MACH, machs, values), CA_0=0.5 + 2.0 * ALPHA**2 + 1e-5 * ALTITUDE)
    dynamics = build_dynamics(FINNER, model)
    for mach in (1.2, 1.6, 2.3, 3.0):
        sound = math.sqrt(1.4 * 8314.32 / 28.9644 * 293.15)
        start = InitialState.from_path(mach * sound, alpha=0.05, position=(0.0, 0.0, -120.0))
        numbers = derivative_model(Cm_alpha=np.interp(mach, machs, values), CA_0=0.5 + 2.0 * 0.05**2 + 120e-5)
        plain = build_dynamics(FINNER, numbers)
        state = dynamics.initial_vector(start)
        assert dynamics.rate(state) == pytest.approx(plain.rate(state), rel=1e-12, abs=1e-9)
        kernel = dynamics.rate_kernel(state)
        assert kernel == pytest.approx(plain.rate(state), rel=1e-12, abs=1e-9)


def test_everything_is_defined_at_rest_with_tables_and_wind_too() -> None:
    model = derivative_model(CA_0=table(TOTAL_ANGLE, [0.0, 0.1], [0.5, 0.6]), Cm_alpha=-20.0 + ALPHA)
    dynamics = build_dynamics(FINNER, model)
    state = dynamics.initial_vector(InitialState(np.zeros(3), [1.0, 0.0, 0.0, 0.0], np.zeros(3), np.zeros(3)))
    assert np.all(np.isfinite(dynamics.rate(state)))
    assert np.all(np.isfinite(dynamics.jacobian(state)))


def test_tables_of_two_arguments_interpolate_bilinearly_and_hold_beyond() -> None:
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    values = np.array([[1.0, 2.0, 4.0], [3.0, -1.0, 0.0]])
    function = ca.Function("f", [x, y], [table((x, y), ([0.0, 2.0], [0.0, 1.0, 3.0]), values)])
    for (a, b), expected in {
        (0.0, 0.0): 1.0,
        (2.0, 3.0): 0.0,
        (1.0, 0.5): 1.25,
        (0.5, 2.0): 2.125,
        (9, -9): 3.0,
    }.items():
        assert float(function(a, b)) == pytest.approx(expected)
    linear = ca.Function("f", [x], [table(x, [0.0, 1.0, 4.0], [1.0, 3.0, 0.0])])
    for a, expected in {-1.0: 1.0, 0.5: 2.0, 1.0: 3.0, 2.5: 1.5, 7.0: 0.0}.items():
        assert float(linear(a)) == pytest.approx(expected)


def test_a_force_of_the_users_own_acts_at_the_centre_of_gravity() -> None:
    """A spring to the origin along x: harmonic motion."""
    stiffness = ca.SX.sym("stiffness")
    force = FunctionForce(lambda flow: ((-stiffness * flow.speed, 0.0, 0.0), (0.0, 0.0, 0.0)))
    dynamics = build_dynamics(FINNER, NO_LOADS, **VACUUM, forces=[force])
    assert dynamics.parameter_names == ("stiffness",)
    flight = fly(dynamics, InitialState.from_path(5.0), 1.0, parameters={"stiffness": 0.4}, step=0.01)
    assert flight.velocity[-1, 0] == pytest.approx(5.0 * math.exp(-0.4 / FINNER.mass), rel=1e-9)


def test_a_mass_that_is_a_symbol_is_a_parameter() -> None:
    mass = ca.SX.sym("mass")
    dynamics = build_dynamics(replace(FINNER, mass=mass), derivative_model(), earth=FlatEarth(0.0))
    assert dynamics.parameter_names == ("mass",)
    plain = build_dynamics(FINNER, derivative_model(), earth=FlatEarth(0.0))
    state = plain.initial_vector(InitialState.from_path(SPEED, alpha=0.03))
    assert dynamics.rate(state, [FINNER.mass]) == pytest.approx(plain.rate(state), rel=1e-13, abs=1e-12)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: table(MACH, [1.0, 1.0], [1.0, 2.0]), "increasing"),
        (lambda: table(MACH, [1.0, 2.0], [1.0]), "shape"),
        (lambda: table(MACH, [1.0, 2.0], [1.0, math.nan]), "not finite"),
        (lambda: Motor(1.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)), "direction"),
        (lambda: burning(mass=-1.0), "mass"),
        (lambda: burning(inertia=ca.SX.sym("I", 2, 2)), "shape"),
        (
            lambda: build_dynamics(
                replace(FINNER, mass=ca.SX.sym("one")), derivative_model(CA_0=ca.SX.sym("one")), **VACUUM
            ),
            "two different symbols",
        ),
        (
            lambda: build_dynamics(
                FINNER, NO_LOADS, forces=[FunctionForce(lambda flow: ((1.0, 2.0), (0.0, 0.0, 0.0)))]
            ),
            "three components",
        ),
    ],
)
def test_models_that_make_no_sense_are_refused(make: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()
