"""Steady flights against their closed forms."""

import math
from typing import Any

import casadi as ca
import numpy as np
import pytest

from flightsim.support import FINNER, first_order_lag
from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.flightsim import (
    ALPHA,
    BodyAxisAerodynamics,
    ConstantAtmosphere,
    Dynamics,
    FunctionForce,
    InitialState,
    Motor,
    SteadyWind,
    Unknown,
    Vehicle,
    build_dynamics,
    fly,
    trim,
)

G, MASS, CHORD, AREA, V = 9.80665, 1000.0, 1.5, 16.0, 60.0
AIR = ConstantAtmosphere()
RHO = 101325.0 / (8314.32 / 28.9644 * 293.15)
PRESSURE = 0.5 * RHO * V**2 * AREA
CD, CL_ALPHA, CM_ALPHA, CM_DELTA, CM_Q = 0.05, 5.0, -0.8, -1.2, -15.0
LATERAL = {"CY_beta": -0.6, "Cl_beta": -0.1, "Cl_p": -0.5, "Cl_r": 0.1, "Cn_beta": 0.1, "Cn_p": -0.03, "Cn_r": -0.1}


def aircraft(**changed: Any) -> Dynamics:
    """Drag against the velocity, lift along -z, elevator, aileron and rudder, thrust along x through the centre."""
    reference = ReferenceQuantities(CHORD, AREA, lateral_length=10.0)
    inertia = np.array([[1200.0, 0.0, -100.0], [0.0, 1800.0, 0.0], [-100.0, 0.0, 2700.0]])
    vehicle = Vehicle("light aircraft", MASS, inertia, reference, (0.0, 0.0, 0.0))
    elevator, aileron, rudder, thrust = (ca.SX.sym(n) for n in ("elevator", "aileron", "rudder", "thrust"))
    values: dict[str, Any] = {
        "CD_0": CD,
        "CZ_alpha": -CL_ALPHA,
        "Cm_alpha": CM_ALPHA,
        "Cm_q": CM_Q,
        "Cm_0": CM_DELTA * elevator,
        "Cl_0": -0.2 * aileron,
        "Cn_0": -0.08 * rudder,
    }
    model = BodyAxisAerodynamics(reference=reference, **(values | LATERAL | changed))
    return build_dynamics(vehicle, model, AIR, forces=[Motor(thrust, (0.0, 0.0, 0.0))])


LEVEL = {"speed": V, "aileron": 0.0, "rudder": 0.0}
TURNING = ("alpha", "bank", "elevator", "aileron", "rudder", "thrust")


def test_straight_and_level() -> None:
    """Along the path T cos(alpha) = D + Z sin(alpha), across it T sin(alpha) + Z cos(alpha) = m g."""
    level = trim(aircraft(), given=LEVEL, unknown=("alpha", "elevator", "thrust"))
    alpha, normal = level["alpha"], PRESSURE * CL_ALPHA * math.sin(level["alpha"])
    assert level["thrust"] * math.cos(alpha) == pytest.approx(PRESSURE * CD + normal * math.sin(alpha), rel=1e-12)
    assert level["thrust"] * math.sin(alpha) + normal * math.cos(alpha) == pytest.approx(MASS * G, rel=1e-12)
    assert level["elevator"] == pytest.approx(-CM_ALPHA * math.sin(alpha) / CM_DELTA, rel=1e-12)
    assert level.residual < 1e-10
    assert level["load_factor"] == pytest.approx(1.0, rel=1e-12)
    assert "found" in level.summary()


def test_a_trimmed_flight_stays_as_it_is() -> None:
    dynamics = aircraft()
    turn = trim(dynamics, given={"speed": V, "turn_rate": 0.2}, unknown=TURNING)
    start = InitialState(turn.state[3:6], turn.state[6:10], turn.state[10:13], turn.state[:3])
    flight = fly(dynamics, start, 5.0, step=0.01, parameters=turn.parameters)
    assert flight.velocity[-1] == pytest.approx(turn.state[3:6], abs=1e-6)
    assert flight.rate[-1] == pytest.approx(turn.state[10:13], abs=1e-8)


def test_glide_angle_is_that_of_drag_over_lift() -> None:
    glide = trim(aircraft(), given=LEVEL | {"thrust": 0.0}, unknown=("alpha", "path_angle", "elevator"))
    normal = CL_ALPHA * math.sin(glide["alpha"])
    lift, drag = normal * math.cos(glide["alpha"]), CD + normal * math.sin(glide["alpha"])
    assert glide["path_angle"] == pytest.approx(-math.atan(drag / lift), rel=1e-12)
    assert glide.residual < 1e-10


def test_climb_is_the_excess_thrust_over_the_weight() -> None:
    climb = trim(aircraft(), given=LEVEL | {"thrust": 4000.0}, unknown=("alpha", "path_angle", "elevator"))
    alpha = climb["alpha"]
    drag = PRESSURE * (CD + CL_ALPHA * math.sin(alpha) ** 2)
    excess = 4000.0 * math.cos(alpha) - drag
    assert math.sin(climb["path_angle"]) == pytest.approx(excess / (MASS * G), rel=1e-12)
    assert climb["climb_rate"] == pytest.approx(V * excess / (MASS * G), rel=1e-12)


@pytest.mark.parametrize("rate", [0.05, 0.2, -0.3])
def test_level_turn_without_side_force_banks_as_v_omega_over_g(rate: float) -> None:
    """With no force along the side of the path, tan(bank) = V Omega/g and n = 1/cos(bank)."""
    turn = trim(aircraft(CY_beta=0.0), given={"speed": V, "turn_rate": rate}, unknown=TURNING)
    assert math.tan(turn["bank"]) == pytest.approx(V * rate / G, rel=1e-11)
    assert turn["load_factor"] == pytest.approx(1.0 / math.cos(turn["bank"]), rel=1e-11)
    assert turn.residual < 1e-10


def test_turn_of_a_given_load_factor_and_of_a_given_bank() -> None:
    dynamics = aircraft(CY_beta=0.0)
    found = trim(
        dynamics,
        given={"speed": V},
        unknown={**dict.fromkeys(TURNING, 0.0), "turn_rate": Unknown(0.1, 0.0, 2.0)},
        targets={"load_factor": 2.0},
    )
    assert found["bank"] == pytest.approx(math.acos(0.5), rel=1e-11)
    assert found["turn_rate"] == pytest.approx(G * math.sqrt(3.0) / V, rel=1e-11)
    others = [name for name in TURNING if name != "bank"]
    banked = trim(dynamics, given={"speed": V, "bank": found["bank"]}, unknown=(*others, "turn_rate"))
    assert banked["turn_rate"] == pytest.approx(found["turn_rate"], rel=1e-11)


def test_pull_up_is_a_flight_of_an_instant() -> None:
    """At the bottom of a loop n = 1 + q V/g."""
    pull = trim(aircraft(), given=LEVEL | {"pitch_rate": 0.3}, unknown=("alpha", "elevator", "thrust"))
    assert pull["load_factor"] == pytest.approx(1.0 + 0.3 * V / G, rel=1e-12)
    assert not pull.is_steady


def test_spin_of_a_symmetric_body_is_a_helix() -> None:
    """A canted, finned body falls straight down and rolls: m g = qS CA, Cl_0 = -Cl_p p c/2V."""
    fall = trim(
        build_dynamics(FINNER, first_order_lag(0.3, Cl_0=0.02)),
        given={"path_angle": -math.pi / 2.0},
        unknown={"speed": 100.0, "turn_rate": 100.0},
    )
    d, reference = first_order_lag(0.3), FINNER.reference
    speed = math.sqrt(FINNER.mass * G / (0.5 * RHO * reference.area * d.CA_0))
    assert fall["speed"] == pytest.approx(speed, rel=1e-12)
    assert fall["p"] == pytest.approx(-0.02 / d.Cl_p * 2.0 * speed / reference.length, rel=1e-12)
    assert fall["turn_rate"] == pytest.approx(fall["p"], rel=1e-12)
    assert fall.residual < 1e-10


OFFSETS = ("CX_0", "CY_0", "CZ_0", "Cl_0", "Cm_0", "Cn_0")
SPIN = {"speed": 45.0, "alpha": 0.75, "beta": 0.06, "path_angle": -1.45, "bank": 0.35, "turn_rate": 2.2}


def spinner() -> Dynamics:
    """Stalled: lift that falls with incidence and a roll that is driven, every load with an offset of its own."""
    reference = ReferenceQuantities(CHORD, AREA, lateral_length=10.0)
    vehicle = Vehicle("spinner", MASS, np.diag([1200.0, 1800.0, 2700.0]), reference, (0.0, 0.0, 0.0))
    offset = {name: ca.SX.sym(name) for name in OFFSETS}
    offset["CZ_0"] = offset["CZ_0"] - 1.1 * ca.sin(ALPHA)
    model = BodyAxisAerodynamics(
        reference=reference,
        **offset,
        CY_beta=-0.5,
        Cm_alpha=-0.5,
        Cm_q=-10.0,
        Cl_beta=-0.1,
        Cl_p=0.1,
        Cl_r=0.25,
        Cn_beta=0.05,
        Cn_p=-0.05,
        Cn_r=-0.3,
    )
    return build_dynamics(vehicle, model)


def test_a_steady_spin_is_found_with_incidence_sideslip_and_bank_and_goes_on() -> None:
    """Manufactured: offsets that hold a given spin; then the spin, from elsewhere, with those offsets: a helix."""
    held = trim(spinner(), given=SPIN, unknown=OFFSETS)
    offsets = {name: held[name] for name in OFFSETS}
    guess = {name: Unknown(0.9 * value, -3.1 if name == "bank" else -200.0, 200.0) for name, value in SPIN.items()}
    spin = trim(spinner(), given=offsets, unknown=guess)
    assert spin.is_steady
    for name, value in SPIN.items():
        assert spin[name] == pytest.approx(value, rel=1e-9), name
    flight = fly(
        spin.dynamics,
        InitialState(spin.state[3:6], spin.state[6:10], spin.state[10:13], spin.state[:3]),
        3.0,
        method="dop853",
        step=0.05,
        tolerance=1e-12,
        parameters=offsets,
    )
    np.testing.assert_allclose(flight.velocity, np.tile(spin.state[3:6], (len(flight), 1)), atol=1e-6 * spin["speed"])
    radius = spin["speed"] * math.cos(spin["path_angle"]) / spin["turn_rate"]
    centre = flight.position[0, :2] + radius * np.array([0.0, 1.0])  # heading north, turning right
    np.testing.assert_allclose(np.linalg.norm(flight.position[:, :2] - centre, axis=1), radius, rtol=1e-5)


def test_lag_states_are_settled() -> None:
    """A glide held by a moment: the flight of the derivatives at k = 0, with ``0 = -pole x + w/V``."""
    moment, model = ca.SX.sym("moment"), first_order_lag(0.3)
    steering = FunctionForce(lambda flow: ((0.0, 0.0, 0.0), (0.0, moment, 0.0)))
    lagged, quasi = (
        trim(
            build_dynamics(FINNER, m, forces=[steering]),
            given={"speed": 150.0},
            unknown=("alpha", "path_angle", "moment"),
        )
        for m in (model, model.quasi_steady())
    )
    for name in ("alpha", "path_angle", "moment"):
        assert lagged[name] == pytest.approx(quasi[name], rel=1e-10)
    assert lagged.state[13:] == pytest.approx([math.sin(lagged["alpha"]) / 0.3, 0.0], rel=1e-10, abs=1e-12)


def test_what_cannot_be_is_refused_and_the_nearest_told() -> None:
    dynamics = aircraft()
    with pytest.raises(InputError, match=r"nearest.*thrust = 100.*at its bound"):
        trim(dynamics, given=LEVEL, unknown={"alpha": 0.0, "elevator": 0.0, "thrust": Unknown(50.0, 0.0, 100.0)})
    with pytest.raises(InputError, match="7 unknowns for 6 equations"):
        trim(dynamics, given={"speed": V}, unknown=(*TURNING, "turn_rate"))
    falling = build_dynamics(FINNER, first_order_lag(0.3, Cl_0=0.02))
    guesses = {"speed": 100.0, "turn_rate": 10.0, "roll_rate": 20.0}
    with pytest.raises(InputError, match="turn_rate, roll_rate apart"):
        trim(falling, given={"path_angle": -math.pi / 2.0}, unknown=guesses)


def test_names_are_checked() -> None:
    dynamics = aircraft()
    with pytest.raises(InputError, match="no unknown 'flap'"):
        trim(dynamics, given=LEVEL, unknown=("flap",))
    with pytest.raises(InputError, match="elevator, thrust must be given"):
        trim(dynamics, given=LEVEL, unknown=("alpha",))
    with pytest.raises(InputError, match="both given and unknown"):
        trim(dynamics, given=LEVEL, unknown=("speed",))
    with pytest.raises(InputError, match="no output 'n'"):
        trim(dynamics, given=LEVEL, unknown=("alpha", "elevator", "thrust"), targets={"n": 1.0})
    windy = build_dynamics(FINNER, first_order_lag(0.3), wind=SteadyWind((1.0, 0.0, 0.0)))
    with pytest.raises(InputError, match="without wind"):
        trim(windy, given={"speed": 100.0}, unknown=("alpha",))
