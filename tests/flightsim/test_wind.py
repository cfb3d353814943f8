"""Wind and gusts: what a uniform wind must not change, gusts by formula, turbulence against its spectrum."""

import math

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import quad

from flightsim.support import FINNER, SPEED, derivative_model, first_order_lag
from indicial.errors import InputError
from indicial.flightsim import (
    CosineGust,
    DrydenTurbulence,
    FlatEarth,
    InitialState,
    SteadyWind,
    WindProfile,
    Winds,
    build_dynamics,
    fly,
)
from indicial.flightsim.attitude import matrix_from_quaternion

MODEL = derivative_model(Cm_alphadot=-100.0, CN_alphadot=20.0)


@pytest.mark.parametrize("model", [MODEL, first_order_lag(0.3)])
def test_flight_in_a_steady_wind_is_flight_in_still_air_carried_along(model: object) -> None:
    """Galilean invariance: same initial velocity through the air, path displaced by wind times time."""
    wind = np.array([-15.0, 8.0, 3.0])
    still = InitialState.from_path(SPEED, alpha=0.04, beta=0.02, path_angle=0.2, rate=(30.0, 1.0, 0.0))
    carried = InitialState(
        still.velocity + matrix_from_quaternion(still.quaternion).T @ wind, still.quaternion, still.rate, still.position
    )
    options = {"step": 2e-4, "every": 50, "estimate_error": False}
    one = fly(build_dynamics(FINNER, model), still, 0.3, **options)
    other = fly(build_dynamics(FINNER, model, wind=SteadyWind(tuple(wind))), carried, 0.3, **options)
    assert other.position == pytest.approx(one.position + np.outer(one.time, wind), abs=1e-8)
    assert other.quaternion == pytest.approx(one.quaternion, abs=1e-10)
    assert other.air_velocity == pytest.approx(one.velocity, abs=1e-7)
    assert other.alpha == pytest.approx(one.alpha, abs=1e-9)
    assert other.mach == pytest.approx(one.mach, abs=1e-9)
    assert np.einsum("nij,nj->ni", matrix_from_quaternion(other.quaternion), other.wind) == pytest.approx(
        np.tile(wind, (len(other), 1)), abs=1e-10
    )


def test_incidence_rate_counts_the_change_of_the_wind() -> None:
    """What the loads take for V d(v/V, w/V)/dt is the derivative, by differences, along the flight through a gust."""
    gust = Winds((CosineGust((2.0, -5.0, 9.0), 40.0), SteadyWind((3.0, 1.0, 0.0))))
    still = derivative_model(CN_alpha=0.0, CN_q=0.0, CN_alphadot=30.0, Cm_alphadot=0.0)
    dynamics = build_dynamics(FINNER, still, wind=gust)
    start = InitialState.from_path(SPEED, alpha=0.02, path_angle=0.1, rate=(0.0, 1.0, 0.5))
    flight = fly(dynamics, start, 0.04, step=1e-5, estimate_error=False)
    incidence = flight.air_velocity[:, 1:] / flight.speed[:, None]
    rate = (incidence[2:] - incidence[:-2]) / (flight.time[2:] - flight.time[:-2])[:, None]
    spin = flight.rate[1:-1, 0]
    turned = rate + np.stack([-spin * incidence[1:-1, 1], spin * incidence[1:-1, 0]], axis=1)
    scale = flight.density[1:-1] * FINNER.reference.area * FINNER.reference.length / 4.0 * flight.speed[1:-1]
    assert -flight.force[1:-1, 2] == pytest.approx(30.0 * scale * turned[:, 1], rel=1e-5, abs=1e-4)
    assert -flight.force[1:-1, 1] == pytest.approx(30.0 * scale * turned[:, 0], rel=1e-5, abs=1e-4)


def at(wind: object, position: tuple[float, float, float]) -> np.ndarray:
    symbol, altitude = ca.SX.sym("position", 3), ca.SX.sym("altitude")
    function = ca.Function("wind", [symbol, altitude], [wind.velocity(symbol, altitude)])
    return np.array(function(position, -position[2])).ravel()


def test_a_cosine_gust_has_its_shape_and_stands_along_its_heading() -> None:
    gust = CosineGust((0.0, 0.0, -6.0), length=50.0, start=10.0, heading=math.pi / 2)
    for along, expected in ((9.0, 0.0), (10.0, 0.0), (22.5, -3.0), (35.0, -6.0), (60.0, 0.0), (1e3, 0.0)):
        assert at(gust, (77.0, along, 0.0)) == pytest.approx([0.0, 0.0, expected], abs=1e-12)


def test_a_profile_is_linear_between_its_altitudes_and_held_beyond() -> None:
    profile = WindProfile([0.0, 100.0, 300.0], [[0.0, 0.0, 0.0], [10.0, -5.0, 0.0], [20.0, 5.0, 1.0]])
    for altitude, expected in ((-10.0, [0, 0, 0]), (50.0, [5, -2.5, 0]), (200.0, [15, 0, 0.5]), (900.0, [20, 5, 1])):
        assert at(profile, (0.0, 0.0, -altitude)) == pytest.approx(expected, abs=1e-12)
    law = WindProfile.power_law((8.0, 0.0, 0.0), height=10.0, exponent=1.0 / 7.0, top=500.0, points=60)
    for altitude in (30.0, 120.0, 500.0):
        assert at(law, (0.0, 0.0, -altitude))[0] == pytest.approx(8.0 * (altitude / 10.0) ** (1.0 / 7.0), rel=2e-3)


def test_wind_from_a_direction_blows_the_other_way() -> None:
    assert at(SteadyWind.from_direction(10.0, math.pi / 2), (0.0, 0.0, 0.0)) == pytest.approx([0.0, -10.0, 0.0])


TURBULENCE = DrydenTurbulence((1.5, 1.2, 0.9), (200.0, 150.0, 50.0), seed=4, span=10.0)


def test_turbulence_has_the_stated_variance_up_to_its_longest_waves() -> None:
    """Sum of a_i^2/2 against sigma^2 less what lies beyond the band, (2/pi)(low + 1/high)-like, under 1%."""
    waves = TURBULENCE._waves
    power = 0.5 * np.sum(waves.cosine**2 + waves.sine**2, axis=1)
    assert np.sqrt(power[:3]) == pytest.approx([1.5, 1.2, 0.9], rel=0.01)


def test_turbulence_is_correlated_over_distance_as_drydens_is() -> None:
    """Over many seeds: u by exp(-s/L), w by exp(-s/L)(1 - s/2L); three standard errors of the mean."""
    lags = np.array([0.0, 20.0, 60.0, 150.0])
    products = []
    for seed in range(400):
        field = DrydenTurbulence((1.5, 1.2, 0.9), (200.0, 150.0, 50.0), seed=seed)
        seen = field.components(lags)
        products.append([seen[0, 0] * seen[:, 0], seen[0, 2] * seen[:, 2]])
    mean, error = np.mean(products, axis=0), np.std(products, axis=0) / 20.0
    expected = [2.25 * np.exp(-lags / 200.0), 0.81 * np.exp(-lags / 50.0) * (1.0 - lags / 100.0)]
    assert np.all(np.abs(mean - expected) < 3.5 * error + 0.01 * np.array([[2.25], [0.81]]))


def test_rotary_gusts_have_the_powers_of_the_specification() -> None:
    """Integrals of MIL-F-8785C's spectra of p, q and r, by quadrature."""
    waves, b = TURBULENCE._waves, 10.0
    power = 0.5 * np.sum(waves.cosine**2 + waves.sine**2, axis=1)

    def across(sigma: float, scale: float, x: float) -> float:
        return sigma**2 * scale / math.pi * (1 + 3 * (scale * x) ** 2) / (1 + (scale * x) ** 2) ** 2

    roll = 0.81 / 50.0 * 0.8 * (math.pi * 50.0 / (4 * b)) ** (1 / 3) * (math.pi / 2) * math.pi / (4 * b)
    pitch = quad(lambda x: across(0.9, 50.0, x) * x**2 / (1 + (4 * b * x / math.pi) ** 2), 0, np.inf)[0]
    yaw = quad(lambda x: across(1.2, 150.0, x) * x**2 / (1 + (3 * b * x / math.pi) ** 2), 0, np.inf)[0]
    assert power[3:] == pytest.approx([roll, pitch, yaw], rel=0.03)


def test_the_air_turns_as_its_field_is_sheared() -> None:
    """Far below the span's lag, q = -dw/ds and r = dv/ds."""
    field = DrydenTurbulence((1.0, 1.0, 1.0), (200.0, 200.0, 200.0), seed=2, span=1e-6, waves=40)
    s = np.array([10.0, 10.0 + 1e-6])
    first, second = field.components(s)
    assert -(second[2] - first[2]) / 1e-6 == pytest.approx(first[4], rel=1e-4, abs=1e-6)
    assert (second[1] - first[1]) / 1e-6 == pytest.approx(first[5], rel=1e-4, abs=1e-6)


def test_one_seed_is_one_field_and_the_expression_is_it() -> None:
    assert np.array_equal(
        DrydenTurbulence((1.0, 1.0, 1.0), (9.0, 9.0, 9.0), 3).components(np.arange(5.0)),
        DrydenTurbulence((1.0, 1.0, 1.0), (9.0, 9.0, 9.0), 3).components(np.arange(5.0)),
    )
    assert at(TURBULENCE, (12.5, 99.0, -5.0)) == pytest.approx(TURBULENCE.components(np.array([12.5]))[0, :3])


def test_turbulence_shakes_a_flight_alike_whatever_the_step() -> None:
    dynamics = build_dynamics(FINNER, MODEL, earth=FlatEarth(0.0), wind=TURBULENCE)
    start = InitialState.from_path(SPEED)
    coarse, fine = (
        fly(dynamics, start, 0.2, step=h, every=n, estimate_error=False) for h, n in ((4e-5, 10), (1e-5, 40))
    )
    assert np.max(coarse.total_angle) > 1e-4
    assert fine.velocity == pytest.approx(coarse.velocity, abs=1e-6)


def test_low_altitude_scales_are_those_of_the_specification() -> None:
    """At 1000 ft all scales are 1000 ft and all intensities 0.1 W_20."""
    field = DrydenTurbulence.at_altitude(304.8, 15.4, seed=1)
    assert field.scale == pytest.approx((304.8, 304.8, 304.8))
    assert field.intensity == pytest.approx((1.54, 1.54, 1.54))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: SteadyWind((1.0, math.nan, 0.0)), "finite components"),
        (lambda: WindProfile([0.0, 1.0], [[1.0, 0.0, 0.0]]), "vectors of shape"),
        (lambda: WindProfile([1.0, 0.0], np.zeros((2, 3))), "increasing"),
        (lambda: CosineGust((0.0, 0.0, 1.0), 0.0), "length of a gust"),
        (lambda: DrydenTurbulence((1.0, -1.0, 1.0), (1.0, 1.0, 1.0), 0), "intensities"),
        (lambda: DrydenTurbulence((1.0, 1.0, 1.0), (1.0, 0.0, 1.0), 0), "positive"),
        (lambda: DrydenTurbulence.at_altitude(1000.0, 10.0, 0), "low-altitude"),
    ],
)
def test_winds_that_make_no_sense_are_refused(make: object, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()
