"""The rigid body against closed forms: no aerodynamics but drag."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipj

from flightsim.support import DENSITY, FINNER, SPEED, derivative_model
from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.flightsim import (
    ConstantAtmosphere,
    FlatEarth,
    InitialState,
    Trajectory,
    Vehicle,
    axisymmetric_inertia,
    build_dynamics,
    simulate,
)
from indicial.flightsim.attitude import (
    euler_angles,
    matrix_from_quaternion,
    quaternion_from_euler,
    quaternion_from_matrix,
)

VACUUM = ConstantAtmosphere(pressure=0.0)


def body(*principal: float) -> Vehicle:
    return replace(FINNER, inertia=np.diag(principal))


def in_vacuum(vehicle: Vehicle, rate: tuple[float, float, float], duration: float, step: float) -> Trajectory:
    start = InitialState.from_attitude((0.0, 0.0, 0.0), rate=rate)
    return simulate(vehicle, derivative_model(), start, duration, step=step, atmosphere=VACUUM, earth=FlatEarth(0.0))


def test_torque_free_rates_equal_jacobi_elliptic_functions() -> None:
    # Landau & Lifshitz, Mechanics, section 37, Eqs. (37.8) to (37.10), for M^2 > 2 E I2.
    i1, i2, i3 = 1.0e-3, 1.7e-3, 2.2e-3
    energy2, momentum2 = 2.0, 4.0e-3  # 2E and M^2
    assert energy2 * i2 < momentum2 < energy2 * i3
    tau = math.sqrt((i3 - i2) * (momentum2 - energy2 * i1) / (i1 * i2 * i3))
    k2 = (i2 - i1) * (energy2 * i3 - momentum2) / ((i3 - i2) * (momentum2 - energy2 * i1))
    amplitudes = np.sqrt(
        [
            (energy2 * i3 - momentum2) / (i1 * (i3 - i1)),
            (energy2 * i3 - momentum2) / (i2 * (i3 - i2)),
            (momentum2 - energy2 * i1) / (i3 * (i3 - i1)),
        ]
    )
    flight = in_vacuum(body(i1, i2, i3), (amplitudes[0], 0.0, amplitudes[2]), 2.0, 1e-4)
    sn, cn, dn, _ = ellipj(tau * flight.time, k2)
    exact = amplitudes * np.stack([cn, sn, dn], axis=1)
    assert np.max(np.abs(flight.rate - exact)) < 1e-8 * np.max(amplitudes)


def test_torque_free_body_keeps_energy_and_angular_momentum_vector() -> None:
    vehicle = replace(FINNER, inertia=np.array([[1.0, 0.1, -0.2], [0.1, 1.6, 0.3], [-0.2, 0.3, 2.1]]) * 1e-3)
    flight = in_vacuum(vehicle, (10.0, 20.0, 30.0), 2.0, 2e-4)
    spin = flight.rate @ vehicle.inertia
    energy = np.einsum("ni,ni->n", flight.rate, spin)
    momentum = np.einsum("nij,nj->ni", matrix_from_quaternion(flight.quaternion), spin)
    assert np.ptp(energy) < 1e-9 * energy[0]
    assert np.max(np.abs(momentum - momentum[0])) < 1e-9 * np.linalg.norm(momentum[0])


def test_tumbling_brick_has_the_rates_of_the_check_case() -> None:
    # NASA NESC atmospheric check cases, case 2: body rates [deg/s] of a brick without damping; the moments of
    # inertia in slug ft^2 (only their ratios matter).
    vehicle = body(0.00189422, 0.006211019, 0.007194665)
    flight = in_vacuum(vehicle, tuple(np.radians([10.0, 20.0, 30.0])), 20.0, 0.01)
    published = {
        5.0: (-16.9394851494, 9.63193937745, 33.4066280795),
        10.0: (-2.41890222177, -23.5525695195, 28.12859263),
        20.0: (-5.42273467991, 22.7159305765, 28.6082817473),
    }
    for time, rates in published.items():
        assert np.degrees(flight.at_times(time).rate[0]) == pytest.approx(rates, abs=2e-7)


def test_vacuum_flight_is_a_parabola() -> None:
    start = InitialState.from_attitude((100.0, 5.0, -50.0), pitch=0.3, yaw=0.2, roll=-0.4, rate=(3.0, -2.0, 1.0))
    flight = simulate(FINNER, derivative_model(), start, 5.0, step=2e-3, atmosphere=VACUUM)
    t = flight.time
    exact = np.stack([100.0 * t, 5.0 * t, -50.0 * t + 0.5 * 9.80665 * t**2], axis=1)
    assert np.max(np.abs(flight.position - exact)) < 1e-7


def test_drag_alone_slows_a_missile_as_the_closed_form() -> None:
    model = derivative_model()
    flight = simulate(FINNER, model, InitialState.from_path(SPEED), 2.0, step=5e-3, earth=FlatEarth(0.0))
    k = DENSITY * FINNER.reference.area * model.CA_0 / (2.0 * FINNER.mass)
    assert flight.speed == pytest.approx(SPEED / (1.0 + k * SPEED * flight.time), rel=1e-11)
    assert flight.position[:, 0] == pytest.approx(np.log1p(k * SPEED * flight.time) / k, rel=1e-11)
    assert flight.distance == pytest.approx(flight.position[:, 0], rel=1e-10)


def test_roll_decays_over_distance_as_the_closed_form() -> None:
    model = derivative_model()
    start = InitialState.from_path(SPEED, rate=(500.0, 0.0, 0.0))
    flight = simulate(FINNER, model, start, 0.2, step=1e-4, earth=FlatEarth(0.0))
    reference = FINNER.reference
    per_metre = DENSITY * reference.area * reference.length**2 * model.Cl_p / (4.0 * FINNER.inertia[0, 0])
    assert flight.rate[:, 0] == pytest.approx(500.0 * np.exp(per_metre * flight.position[:, 0]), rel=1e-10)


def test_quaternion_flight_equals_a_second_implementation_with_rotation_matrices() -> None:
    """Velocity in earth axes, nine direction cosines, loads written out by plane: nothing shared."""
    d = derivative_model(CN_alphadot=0.0, Cm_alphadot=0.0, Cl_0=0.01)
    area, c = d.reference.area, d.reference.length
    inertia, mass = FINNER.inertia, FINNER.mass

    def rate_of_change(_: float, state: np.ndarray) -> np.ndarray:
        velocity, rotation, omega = state[3:6], state[6:15].reshape(3, 3), state[15:]
        u, v, w = rotation.T @ velocity
        p, q, r = omega
        speed = math.sqrt(u * u + v * v + w * w)
        pressure = 0.5 * DENSITY * speed**2
        hat = c / (2.0 * speed)
        force = (
            -pressure
            * area
            * np.array([d.CA_0, d.CN_alpha * v / speed - d.CN_q * r * hat, d.CN_alpha * w / speed + d.CN_q * q * hat])
        )
        moment = (
            pressure
            * area
            * c
            * np.array(
                [
                    d.Cl_0 + d.Cl_p * p * hat,
                    d.Cm_alpha * w / speed + d.Cm_q * q * hat,
                    -d.Cm_alpha * v / speed + d.Cm_q * r * hat,
                ]
            )
        )
        skew = np.array([[0.0, -r, q], [r, 0.0, -p], [-q, p, 0.0]])
        return np.concatenate(
            [
                velocity,
                rotation @ force / mass + [0.0, 0.0, 9.80665],
                (rotation @ skew).ravel(),
                np.linalg.solve(inertia, moment - np.cross(omega, inertia @ omega)),
            ]
        )

    start = InitialState.from_path(SPEED, alpha=0.03, beta=-0.02, path_angle=0.1, heading=0.3, rate=(150.0, 2.0, -3.0))
    flight = simulate(FINNER, d, start, 0.1, step=5e-5)
    rotation = matrix_from_quaternion(start.quaternion)
    first = np.concatenate([start.position, rotation @ start.velocity, rotation.ravel(), start.rate])
    other = solve_ivp(rate_of_change, (0.0, 0.1), first, "DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    assert flight.position[-1] == pytest.approx(other[:3], abs=1e-8)
    assert flight.earth_velocity[-1] == pytest.approx(other[3:6], abs=1e-6)
    assert matrix_from_quaternion(flight.quaternion[-1]).ravel() == pytest.approx(other[6:15], abs=1e-8)
    assert flight.rate[-1] == pytest.approx(other[15:], abs=1e-6)


def test_motion_does_not_depend_on_the_quaternion_norm() -> None:
    dynamics = build_dynamics(FINNER, derivative_model())
    state = dynamics.initial_vector(InitialState.from_path(SPEED, alpha=0.05, rate=(10.0, 5.0, 2.0)))
    scaled = state.copy()
    scaled[6:10] *= 1.5
    one, other = (np.array(dynamics.step()(x, [], 1e-4)).ravel() for x in (state, scaled))
    other[6:10] /= 1.5
    assert other == pytest.approx(one, rel=1e-14)


def test_euler_angles_and_matrices_are_inverse() -> None:
    angles = (0.7, -0.4, 2.0)
    quaternion = quaternion_from_euler(*angles)
    assert euler_angles(quaternion) == pytest.approx(angles)
    assert quaternion_from_matrix(matrix_from_quaternion(quaternion)) == pytest.approx(quaternion)


def test_initial_path_gives_the_asked_velocity_and_angles() -> None:
    start = InitialState.from_path(100.0, alpha=0.1, beta=-0.05, path_angle=0.2, heading=0.4, bank=0.9)
    earth = matrix_from_quaternion(start.quaternion) @ start.velocity
    expected = 100.0 * np.array([math.cos(0.2) * math.cos(0.4), math.cos(0.2) * math.sin(0.4), -math.sin(0.2)])
    assert earth == pytest.approx(expected)
    assert math.atan2(start.velocity[2], start.velocity[0]) == pytest.approx(0.1)
    assert math.asin(start.velocity[1] / 100.0) == pytest.approx(-0.05)


def test_range_model_has_the_published_mass_properties() -> None:
    # DREV-TM-9703: 30 mm, 1.5894 kg, 1.92e-4 and 9.785e-3 kg m^2, centre of gravity 5.50 d from the nose.
    assert FINNER.mass == 1.5894
    assert np.diag(FINNER.inertia) == pytest.approx([1.92e-4, 9.785e-3, 9.785e-3])
    assert FINNER.centre_of_gravity[0] / FINNER.reference.length == pytest.approx(5.5)
    assert FINNER.reference.area == pytest.approx(math.pi * 0.03**2 / 4.0)


@pytest.mark.parametrize(
    ("mass", "inertia", "named"),
    [
        (-1.0, np.eye(3), "mass"),
        (1.0, np.diag([1.0, 1.0, 3.0]), "principal"),
        (1.0, np.array([[1.0, 0.1, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), "symmetric"),
        (1.0, np.eye(2), "shape"),
    ],
)
def test_an_impossible_body_is_refused(mass: float, inertia: np.ndarray, named: str) -> None:
    with pytest.raises(InputError, match=named):
        Vehicle("x", mass, inertia, ReferenceQuantities(1.0, 1.0), (0.0, 0.0, 0.0))


def test_axisymmetric_inertia_is_diagonal() -> None:
    assert np.array_equal(axisymmetric_inertia(1.0, 2.0), np.diag([1.0, 2.0, 2.0]))
