"""Linear models of steady flights against differences of the nonlinear equations and against flights."""

import dataclasses
import math
from typing import Any

import casadi as ca
import control
import numpy as np
import pytest

from flightsim.support import FINNER, first_order_lag
from flightsim.test_aircraft import SPEED, boeing_747
from flightsim.test_trim import LEVEL, TURNING, G, V, aircraft
from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim import (
    OUTPUTS,
    FunctionForce,
    InitialState,
    LinearFlight,
    Signal,
    StandardAtmosphere,
    Trim,
    aircraft_modes,
    build_dynamics,
    fly,
    linear_flight,
    trim,
)
from indicial.flightsim.attitude import euler_angles, matrix_from_quaternion, quaternion_from_euler
from indicial.flightsim.outputs import flight_outputs

CONTROLS = ("elevator", "aileron", "rudder", "thrust")


def level(**changed: Any) -> Trim:
    return trim(aircraft(**changed), given=LEVEL, unknown=("alpha", "elevator", "thrust"))


def turn(**given: float) -> Trim:
    return trim(aircraft(), given={"speed": V, "turn_rate": 0.2, "heading": 1.0} | given, unknown=TURNING)


def lagging_glide() -> Trim:
    moment = ca.SX.sym("moment")
    steering = FunctionForce(lambda flow: ((0.0, 0.0, 0.0), (0.0, moment, 0.0)))
    dynamics = build_dynamics(FINNER, first_order_lag(30.0), forces=[steering])
    return trim(dynamics, given={"speed": 150.0}, unknown=("alpha", "path_angle", "moment"))


def spinning_fall() -> Trim:
    dynamics = build_dynamics(FINNER, first_order_lag(30.0, Cl_0=0.02))
    return trim(dynamics, given={"path_angle": -math.pi / 2.0}, unknown={"speed": 100.0, "turn_rate": 100.0})


def standard_level() -> Trim:
    model = aircraft()
    dynamics = build_dynamics(model.vehicle, model.aerodynamics, StandardAtmosphere(), forces=[thrust()])
    return trim(dynamics, given=LEVEL | {"altitude": 3000.0}, unknown=("alpha", "elevator", "thrust"))


def thrust() -> FunctionForce:
    force = ca.SX.sym("thrust")
    return FunctionForce(lambda flow: ((force, 0.0, 0.0), (0.0, 0.0, 0.0)))


def read(state: Array, names: tuple[str, ...]) -> Array:
    """The states kept, of a whole state."""
    u, v, w = state[3:6]
    speed = math.sqrt(u * u + v * v + w * w)
    _, theta, phi = euler_angles(state[6:10])
    _, down_y, down_z = matrix_from_quaternion(state[6:10])[2]
    values = {"V": speed, "alpha": math.atan2(w, u), "beta": math.asin(v / speed), "altitude": -state[2]}
    values |= dict(zip("pqr", state[10:13], strict=True)) | {"theta": theta, "phi": phi}
    values |= {"tilt_y": down_z, "tilt_z": -down_y}
    return np.array([values[name] for name in names if name in values])


def write(about: Trim, names: tuple[str, ...], values: Array) -> Array:
    """A whole state from the states kept, other than the steady one by Euler angles."""
    state = about.state.copy()
    new = dict(zip(names, values, strict=False))
    speed, alpha, beta = new["V"], new["alpha"], new["beta"]
    state[3:6] = speed * np.array([math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)])
    state[10:13] = [new[name] for name in "pqr"]
    state[2] = -new.get("altitude", -state[2])
    if "phi" in new:
        state[6:10] = quaternion_from_euler(float(euler_angles(state[6:10])[0]), new["theta"], new["phi"])
    else:
        from scipy.spatial.transform import Rotation

        tilted = Rotation.from_quat(state[[7, 8, 9, 6]]) * Rotation.from_rotvec([0.0, new["tilt_y"], new["tilt_z"]])
        state[6:10] = tilted.as_quat()[[3, 0, 1, 2]]
    state[13:] = values[len(values) - len(state[13:]) :]
    return state


def rates(about: Trim, names: tuple[str, ...], state: Array, parameters: Array) -> Array:
    """Rates of the states kept along the nonlinear motion, by Euler's kinematics (of the vertical in a spin)."""
    change = about.dynamics.rate(state, parameters)
    (u, v, w), (udot, vdot, wdot), (p, q, r) = state[3:6], change[3:6], state[10:13]
    speed, across = math.sqrt(u * u + v * v + w * w), math.hypot(u, w)
    growth = (u * udot + v * vdot + w * wdot) / speed
    _, theta, phi = euler_angles(state[6:10])
    turning = q * math.sin(phi) + r * math.cos(phi)
    down = np.cross(matrix_from_quaternion(state[6:10])[2], state[10:13])
    values = {"V": growth, "alpha": (u * wdot - w * udot) / across**2, "altitude": -change[2]}
    values |= {"beta": (vdot - v * growth / speed) / across} | dict(zip("pqr", change[10:13], strict=True))
    values |= {"theta": q * math.cos(phi) - r * math.sin(phi), "phi": p + math.tan(theta) * turning}
    values |= {"tilt_y": down[2], "tilt_z": -down[1]}
    return np.concatenate([[values[name] for name in names if name in values], change[13:]])


def outputs(about: Trim, names: tuple[str, ...], state: Array, parameters: Array) -> Array:
    values = flight_outputs(about.dynamics, ca.DM(state), ca.DM(parameters), about.time)
    return np.array([float(values[name]) for name in names])


@pytest.mark.parametrize(
    ("flight", "altitude"),
    [(level, False), (turn, False), (lagging_glide, False), (spinning_fall, False), (standard_level, True)],
)
def test_matrices_are_the_slopes_of_the_nonlinear_motion(flight: Any, altitude: bool) -> None:
    """Every column of a and b, by central differences."""
    about = flight()
    controls = about.dynamics.parameter_names
    undefined = ("theta", "phi", "path_angle", "load_factor") if flight is spinning_fall else ()
    wanted = tuple(name for name in OUTPUTS if name not in undefined and (altitude or name != "altitude"))
    model = linear_flight(about, controls=controls, outputs=wanted, altitude=altitude)
    base = np.concatenate([read(about.state, model.states), about.state[13:]])
    assert base.size == len(model.states)
    steady = rates(about, model.states, about.state, about.parameter_vector)
    kept = [i for i, name in enumerate(model.states) if name != "altitude"]
    assert steady[kept] == pytest.approx(np.zeros(len(kept)), abs=1e-9)
    size = np.array([base[0] if n in ("V", "altitude") else 1.0 for n in model.states])

    def both(state: Array, parameters: Array) -> Array:
        return np.concatenate(
            [rates(about, model.states, state, parameters), outputs(about, wanted, state, parameters)]
        )

    exact = np.block([[model.a, model.b], [model.c, model.d]])
    for j in range(exact.shape[1]):
        step, pair = 1e-4, []
        for sign in (1.0, -1.0):
            values, parameters = base.copy(), about.parameter_vector.copy()
            if j < base.size:
                values[j] += sign * step * size[j]
            else:
                step = 1e-4 * max(1.0, abs(parameters[j - base.size]))
                parameters[j - base.size] += sign * step
            pair.append(both(write(about, model.states, values), parameters))
        found = (pair[0] - pair[1]) / (2.0 * step * (size[j] if j < base.size else 1.0))
        scale = np.max(np.abs(exact[:, j])) + 1.0
        assert exact[:, j] == pytest.approx(found, abs=2e-6 * scale), (*model.states, *controls)[j]


def test_control_and_a_flight_answer_alike_in_a_turn() -> None:
    """Half the difference of two flights with opposite small steps is the linear response to second order."""
    about = turn()
    names = ("V", "alpha", "q", "theta", "beta", "p", "r", "phi")
    model = linear_flight(about, controls=CONTROLS).to_control()
    assert model.input_labels == list(CONTROLS)
    assert model.state_labels == list(names)
    start = InitialState(about.state[3:6], about.state[6:10], about.state[10:13], about.state[:3])
    for column, (name, amplitude) in enumerate({"elevator": 1e-4, "aileron": 1e-4}.items()):
        flown = []
        for sign in (1.0, -1.0):
            moved = dict(about.parameters) | {name: about.parameters[name] + sign * amplitude}
            flight = fly(about.dynamics, start, 6.0, step=0.01, every=10, parameters=moved, estimate_error=False)
            _, theta, phi = np.moveaxis(euler_angles(flight.quaternion), -1, 0)
            p, q, r = flight.rate.T
            speed = np.linalg.norm(flight.velocity, axis=1)
            beta = np.arcsin(flight.velocity[:, 1] / speed)
            alpha = np.arctan2(flight.velocity[:, 2], flight.velocity[:, 0])
            flown.append(np.array([speed, alpha, q, theta, beta, p, r, phi]))
        response = control.step_response(model[:, column], T=flight.time).outputs.reshape(8, -1)
        difference = (flown[0] - flown[1]) / (2.0 * amplitude)
        largest = np.max(np.abs(difference), axis=1)
        assert np.all(np.abs(response - difference) <= 1e-5 * largest[:, None]), name


def test_frequency_response_is_that_of_a_nonlinear_flight_with_a_swinging_control() -> None:
    """Half the difference of two flights with opposite small swings of the elevator, after the short period has gone.

    What is left of the phugoid is fitted beside the swing. The signal is linear over hundredths of a second, which
    makes the swing smaller by (omega dt)^2/12, 1e-4.
    """
    about, omega, amplitude = level(), 3.0, 1e-4
    linear = linear_flight(about, controls=("elevator",), outputs=("q", "alpha"))
    start = InitialState(about.state[3:6], about.state[6:10], about.state[10:13], about.state[:3])
    swung = []
    for size in (amplitude, -amplitude):
        swing = Signal.sampled(lambda t, a=size: about.parameters["elevator"] + a * np.sin(omega * t), 30.0, 0.01)
        moved = {**about.parameters, "elevator": swing}
        flight = fly(about.dynamics, start, 30.0, step=0.01, parameters=moved, method="rk4", estimate_error=False)
        swung.append(np.array([flight.rate[:, 1], np.arctan2(flight.velocity[:, 2], flight.velocity[:, 0])]))
    late = flight.time > 12.0
    time, seen = flight.time[late], ((swung[0] - swung[1]) / (2.0 * amplitude))[:, late]
    slow = np.exp(aircraft_modes(linear)["phugoid"].eigenvalue * time)
    columns = np.stack([np.sin(omega * time), np.cos(omega * time), slow.real, slow.imag], axis=1)
    in_phase, quadrature, *_ = np.linalg.lstsq(columns, seen.T, rcond=None)[0]
    bode = control.frequency_response(linear.to_control(), [omega])
    response = bode.magnitude[:, 0, 0] * np.exp(1j * bode.phase[:, 0, 0])
    assert np.all(np.abs(in_phase + 1j * quadrature - response) < 1e-3 * np.abs(response))


def test_modes_of_the_747_are_those_published() -> None:
    """Etkin and Reid, section 6: through trim, linear model and names."""
    about = trim(boeing_747(), given={"speed": SPEED}, unknown=("alpha", "path_angle"))
    modes = aircraft_modes(linear_flight(about))
    published = {
        "short period": -0.3719 + 0.8875j,
        "phugoid": -0.003289 + 0.06723j,
        "Dutch roll": -0.033011 + 0.94655j,
        "roll": -0.56248,
        "spiral": -0.0072973,
    }
    assert [mode.name for mode in modes.modes] == list(published)
    for name, eigenvalue in published.items():
        assert modes[name].eigenvalue.real == pytest.approx(eigenvalue.real, rel=5e-3), name
        assert modes[name].eigenvalue.imag == pytest.approx(np.imag(eigenvalue), rel=5e-3, abs=1e-12), name
        assert modes[name].time_to_half == pytest.approx(math.log(2.0) / -eigenvalue.real, rel=5e-3)
    phugoid = modes["phugoid"]
    assert phugoid.period == pytest.approx(2.0 * math.pi / 0.06723, rel=5e-3)
    assert abs(phugoid.shape["theta"] / phugoid.shape["alpha"]) > 20.0
    assert "halves in" in modes.summary()
    assert len(modes.plot().axes) == 4


def made_of(matrix: Array) -> LinearFlight:
    return dataclasses.replace(linear_flight(level()), a=matrix)


def test_names_tell_what_is_coupled() -> None:
    """A known matrix: two clean pairs, beta and r that do not oscillate, roll with bank that do."""
    model = linear_flight(level())
    at, matrix = model.states.index, np.zeros((8, 8))

    def pair(first: str, second: str, eigenvalue: complex) -> None:
        i = [at(first), at(second)]
        matrix[np.ix_(i, i)] = [[eigenvalue.real, -eigenvalue.imag], [eigenvalue.imag, eigenvalue.real]]

    pair("alpha", "q", -2 + 3j)
    pair("V", "theta", -0.1 + 0.2j)
    pair("p", "phi", -0.3 + 0.5j)
    matrix[at("beta"), at("beta")], matrix[at("r"), at("r")] = -1.0, 0.5
    modes = aircraft_modes(made_of(matrix))
    found = {mode.name: mode.eigenvalue for mode in modes.modes}
    expected = {"short period": -2 + 3j, "phugoid": -0.1 + 0.2j, "roll-spiral": -0.3 + 0.5j}
    assert found == pytest.approx(expected | {"Dutch roll 1": 0.5, "Dutch roll 2": -1.0})
    assert modes["Dutch roll 1"].time_to_double == pytest.approx(math.log(2.0) / 0.5)
    assert modes["roll-spiral"].participation["p"] == pytest.approx(0.5)


def test_participation_is_the_sensitivity_to_a_states_own_decay() -> None:
    """``|d lambda/d a_kk|`` in the proportion of the participations."""
    model = linear_flight(turn())
    for mode in aircraft_modes(model).modes:
        slopes = []
        for k in range(len(model.states)):
            shifted = []
            for sign in (1.0, -1.0):
                matrix = model.a.copy()
                matrix[k, k] += sign * 1e-5
                values = np.linalg.eigvals(matrix)
                shifted.append(values[np.argmin(np.abs(values - mode.eigenvalue))])
            slopes.append(abs(shifted[0] - shifted[1]))
        shares = np.array(slopes) / np.sum(slopes)
        assert [mode.participation[name] for name in model.states] == pytest.approx(shares, abs=1e-5), mode.name


def test_lag_modes_are_named() -> None:
    modes = aircraft_modes(linear_flight(lagging_glide()))
    assert len(modes.lag) == 2
    for mode in modes.lag:
        assert sum(share for name, share in mode.participation.items() if "lag" in name) > 0.5


def test_phugoid_of_lanchester() -> None:
    """Without drag, with pitch held to the path by strong stability, omega = sqrt(2) g/V."""
    modes = aircraft_modes(linear_flight(level(CD_0=0.0, CZ_alpha=-500.0, Cm_alpha=-80.0, Cm_q=0.0)))
    assert modes["phugoid"].natural_frequency == pytest.approx(math.sqrt(2.0) * G / V, rel=0.01)


def test_what_is_not_steady_or_not_there_is_refused() -> None:
    pull = trim(aircraft(), given=LEVEL | {"pitch_rate": 0.3}, unknown=("alpha", "elevator", "thrust"))
    with pytest.raises(InputError, match="steady"):
        linear_flight(pull)
    about = level()
    with pytest.raises(InputError, match="no control 'flap'"):
        linear_flight(about, controls=("flap",))
    with pytest.raises(InputError, match="named twice"):
        linear_flight(about, controls=("rudder", "rudder"))
    with pytest.raises(InputError, match="no output 'n'"):
        linear_flight(about, outputs=("n",))
    with pytest.raises(InputError, match="altitude=True"):
        linear_flight(about, outputs=("altitude",))
    with pytest.raises(InputError, match="no controls"):
        linear_flight(about).to_control()
    fall = spinning_fall()
    assert "tilt_y" in linear_flight(fall).states
    with pytest.raises(InputError, match="output theta"):
        linear_flight(fall, outputs=("theta",))
    with pytest.raises(InputError, match="vertical"):
        aircraft_modes(linear_flight(fall))
