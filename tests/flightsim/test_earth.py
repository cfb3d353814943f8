"""A rotating, oblate earth against closed forms and against the NASA NESC atmospheric check cases."""

import math

import casadi as ca
import numpy as np
import pytest

from flightsim.support import FINNER, derivative_model
from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.flightsim import (
    WGS84,
    BodyAxisAerodynamics,
    ConstantAtmosphere,
    InitialState,
    StandardAtmosphere,
    Trajectory,
    Vehicle,
    simulate,
)
from indicial.flightsim.attitude import matrix_from_quaternion, quaternion_from_euler

FOOT, SLUG = 0.3048, 14.593902937206364
VACUUM = ConstantAtmosphere(pressure=0.0)

# 8 x 4 x 2.25 in, reference lengths 8 and 4 in; inertia in slug ft^2
BRICK_REFERENCE = ReferenceQuantities(2.0 * FOOT / 3.0, 2.0 * FOOT**2 / 9.0, lateral_length=FOOT / 3.0)
BRICK = Vehicle(
    "brick",
    0.155404754 * SLUG,
    np.diag([0.00189422, 0.006211019, 0.007194665]) * SLUG * FOOT**2,
    BRICK_REFERENCE,
    (0.0, 0.0, 0.0),
)


def value(expression: object) -> np.ndarray:
    return np.array(ca.evalf(expression)).ravel()


def drop(aerodynamics: BodyAxisAerodynamics) -> Trajectory:
    """From 30,000 ft over the equator, at rest on the turning earth."""
    start = InitialState(
        np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), np.radians([10.0, 20.0, 30.0]), np.array([0.0, 0.0, -30000 * FOOT])
    )
    return simulate(
        BRICK, aerodynamics, start, 30.0, step=1.0, method="dop853", atmosphere=StandardAtmosphere(), earth=WGS84()
    )


# time [s]: yaw, pitch, roll [deg] in north, east, down; rates in inertial space [deg/s], of sim_04
UNDAMPED = {
    10: ((-4.32133636889, 3.74133747365, -66.0190032425), (-2.41890222177, -23.5525695195, 28.12859263)),
    30: ((-4.28935504226, -3.81965492189, -56.1513075938), (12.6183907757, -17.3974747619, 31.1195888868)),
}
DAMPED = {
    10: ((-142.916122013, -36.5640898524, 14.5654054321), (-0.119673377375, -0.0458085531177, 8.42554174543)),
    30: ((-111.383858577, -38.7889055337, -5.09406213522), (0.0, 0.0, 1.75598203807e-5)),
}
# time: altitude [ft], longitude [deg] of sim_04 and of sim_02, which part by what is allowed
DROPPED = {
    10: ((28400.2040727, 2.12654133805e-6), (28400.20402, 2.12e-6)),
    30: ((15598.9043522, 5.74552213287e-5), (15598.90389, 5.74e-5)),
}
FIRED = {
    10: ((7306.60595042, 0.0240256288982), (7306.162594, 0.024024355)),
    30: ((10160.9897645, 0.0616478507138), (10159.53629, 0.061643207)),
}


def check_place(flight: Trajectory, published: dict) -> None:
    earth = WGS84()
    for time, (one, other) in published.items():
        latitude, longitude, altitude = earth.geodetic(flight.position[time])
        foot = math.degrees(FOOT / 6378137.0)
        assert abs(altitude / FOOT - one[0]) <= abs(one[0] - other[0]) + 0.01
        assert abs(math.degrees(longitude) - one[1]) / foot <= abs(one[1] - other[1]) / foot + 0.01
        assert abs(math.degrees(latitude)) / foot <= 0.01


@pytest.mark.parametrize(
    ("derivatives", "published"), [({}, UNDAMPED), ({"Cl_p": -1.0, "Cm_q": -1.0, "Cn_r": -1.0}, DAMPED)]
)
def test_tumbling_brick_is_that_of_the_check_cases(derivatives: dict, published: dict) -> None:
    """NESC cases 2 and 3: attitude, compared as a rotation, to 0.01 deg, rates to 1e-4 deg/s, place."""
    # the check case takes damping to be of the rates in inertial space
    flight = drop(BodyAxisAerodynamics(reference=BRICK_REFERENCE, rates_in="inertial space", **derivatives))
    for time, (angles, rates) in published.items():
        local = WGS84().local_axes(flight.position[time])
        ours = local.T @ matrix_from_quaternion(flight.quaternion[time])
        turned = matrix_from_quaternion(quaternion_from_euler(*np.radians(angles))).T @ ours
        angle = math.degrees(2.0 * math.asin(np.linalg.norm(turned - np.eye(3)) / math.sqrt(8.0)))
        assert angle < 0.01
        assert np.degrees(flight.rate[time]) == pytest.approx(rates, abs=1e-4)
    check_place(flight, DROPPED)


def test_brick_dropped_at_rest_is_damped_from_the_first_instant_without_a_division_by_zero() -> None:
    flight = drop(BodyAxisAerodynamics(reference=BRICK_REFERENCE, Cl_p=-1.0, Cm_q=-1.0, Cn_r=-1.0))
    assert np.max(np.abs(flight.moment[0])) < 1e-12
    assert flight.alpha[0] == 0.0
    # the air turns with the earth, and takes the brick along
    assert flight.rate[-1] == pytest.approx(
        matrix_from_quaternion(flight.quaternion[-1]).T @ WGS84().rotation, abs=1e-6
    )


def test_cannonball_is_that_of_the_check_case() -> None:
    """NESC case 9: fired east and up at 1000 ft/s each from the equator, CD = 0.1."""
    reference = ReferenceQuantities(FOOT, 0.1963495 * FOOT**2)
    ball = Vehicle("cannonball", SLUG, np.eye(3) * 3.6 * SLUG * FOOT**2, reference, (0.0, 0.0, 0.0))
    start = InitialState.from_attitude((0.0, 1000 * FOOT, -1000 * FOOT), yaw=math.pi / 2)
    model = BodyAxisAerodynamics(reference=reference, CD_0=0.1)
    flight = simulate(
        ball, model, start, 30.0, step=1.0, method="dop853", atmosphere=StandardAtmosphere(), earth=WGS84()
    )
    check_place(flight, FIRED)
    local = WGS84().local_axes(flight.position[30])
    # sim_04: north, east, down [ft/s]; sim_02 differs by 0.05
    assert local.T @ flight.earth_velocity[30] / FOOT == pytest.approx((0.0, 610.746581927, 181.748229037), abs=1e-3)


@pytest.mark.parametrize("latitude", [-1.2, 0.0, 0.7, math.pi / 2])
def test_altitude_is_the_height_above_the_ellipsoid(latitude: float) -> None:
    earth = WGS84(0.3, -0.8, 120.0, azimuth=0.4)
    for altitude in (-100.0, 0.0, 3e4, 1e5):
        place = earth.position(latitude, 2.0, altitude)
        assert value(earth.altitude(ca.SX(place))) == pytest.approx(altitude, abs=1e-7)
        found = earth.geodetic(place)
        assert found[0] == pytest.approx(latitude, abs=1e-12)
        assert found[2] == pytest.approx(altitude, abs=1e-7)


def test_gravity_on_the_ellipsoid_is_normal_gravity_but_for_the_harmonics_left_out() -> None:
    # WGS 84 [m/s^2]; normal gravity also has J4 = -2.37091e-6, which adds -15/8 J4 mu/a^2 at the equator and
    # -5 J4 mu a^4/b^6 at the poles, and J6 = 6.1e-9
    mu, a, b, j4 = 3.986004418e14, 6378137.0, 6356752.314245, -2.37091e-6
    equator = 9.7803253359 + 15.0 / 8.0 * j4 * mu / a**2
    pole = 9.8321849378 + 5.0 * j4 * mu * a**4 / b**6
    for latitude, expected in ((0.0, equator), (math.pi / 2, pole)):
        pull = value(WGS84(latitude).gravity(ca.SX.zeros(3)))
        assert pull == pytest.approx((0.0, 0.0, expected), abs=1e-6)


def test_a_stone_let_fall_drifts_east_as_the_closed_form() -> None:
    """``(1/3) omega g t^3 cos(latitude)`` for an even g: Landau and Lifshitz, Mechanics, sec. 39."""
    latitude, duration = 0.6, 10.0
    earth = WGS84(latitude, j2=0.0)
    start = InitialState.from_attitude((0.0, 0.0, 0.0), position=(0.0, 0.0, -2000.0))
    flight = simulate(FINNER, derivative_model(), start, duration, step=0.1, atmosphere=VACUUM, earth=earth)
    drift = earth.rate * 9.8 * duration**3 * math.cos(latitude) / 3.0
    assert flight.position[-1, 1] == pytest.approx(drift, rel=2e-3)


def test_a_body_in_vacuum_keeps_its_orbit() -> None:
    """Without drag or J2: the ellipse of Kepler, seen from the turning earth; here a circle at 500 km."""
    earth = WGS84(j2=0.0, altitude_of_site=5e5)
    radius = 6378137.0 + 5e5
    speed = math.sqrt(earth.mu / radius)
    start = InitialState.from_attitude((0.0, speed - earth.rate * radius, 0.0))
    period = 2.0 * math.pi * radius / speed
    flight = simulate(
        FINNER, derivative_model(), start, period, step=period / 8, method="dop853", atmosphere=VACUUM, earth=earth
    )
    from_centre = flight.position @ earth.axes.T + earth.origin
    assert np.linalg.norm(from_centre, axis=1) == pytest.approx(radius, abs=1e-3)
    angle = np.unwrap(np.arctan2(from_centre[:, 1], from_centre[:, 0]))
    assert angle[-1] == pytest.approx(2.0 * math.pi - earth.rate * period, abs=1e-9)


def test_an_impossible_site_is_refused() -> None:
    with pytest.raises(InputError, match="latitude"):
        WGS84(latitude=2.0)
