"""What must be kept over long flights without air, against closed forms: spin and arcs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

from flightsim.support import FINNER, derivative_model
from indicial.flightsim import (
    ConstantAtmosphere,
    End,
    FlatEarth,
    InitialState,
    Trajectory,
    build_dynamics,
    fly,
    simulate,
)
from indicial.flightsim.attitude import matrix_from_quaternion

VACUUM = ConstantAtmosphere(pressure=0.0)
INERTIA = np.array([1.0e-3, 1.7e-3, 2.2e-3])
ASYMMETRIC = replace(FINNER, inertia=np.diag(INERTIA))


def jacobi() -> tuple[np.ndarray, float, float]:
    """Amplitudes of the rates, rate of the argument and modulus squared: Landau & Lifshitz, Mechanics, sec. 37."""
    i1, i2, i3 = INERTIA
    energy2, momentum2 = 2.0, 4.0e-3  # 2E and M^2
    high, low = energy2 * i3 - momentum2, momentum2 - energy2 * i1
    amplitudes = np.sqrt([high / (i1 * (i3 - i1)), high / (i2 * (i3 - i2)), low / (i3 * (i3 - i1))])
    tau = math.sqrt((i3 - i2) * low / (i1 * i2 * i3))
    return amplitudes, tau, (i2 - i1) * high / ((i3 - i2) * low)


def drift(flight: Trajectory) -> tuple[float, float]:
    """Largest relative change of energy and of the angular momentum vector in earth axes."""
    spin = flight.rate * INERTIA
    energy = np.einsum("ni,ni->n", flight.rate, spin)
    momentum = np.einsum("nij,nj->ni", matrix_from_quaternion(flight.quaternion), spin)
    change = np.linalg.norm(momentum - momentum[0], axis=1)
    return np.max(np.abs(energy / energy[0] - 1.0)), np.max(change) / np.linalg.norm(momentum[0])


def test_asymmetric_body_keeps_energy_and_momentum_over_a_thousand_revolutions() -> None:
    """Adaptive, tolerance 1e-13: drift under 1e-9; the rates stay Jacobi's to what the phase gathers."""
    amplitudes, tau, k2 = jacobi()
    period = 4.0 * ellipk(k2) / tau  # of the rates; the body turns about once in it
    start = InitialState.from_attitude((0.0, 0.0, 0.0), rate=(amplitudes[0], 0.0, amplitudes[2]))
    dynamics = build_dynamics(ASYMMETRIC, derivative_model(), VACUUM, FlatEarth(0.0))
    revolution = 2.0 * math.pi / np.linalg.norm(start.rate)
    duration = 1000.0 * max(period, revolution)
    flight = fly(
        dynamics, start, duration, step=duration / 2000.0, method="dop853", tolerance=1e-13, estimate_error=False
    )
    assert max(drift(flight)) < 1e-9
    sn, cn, dn, _ = ellipj(tau * flight.time, k2)
    assert np.max(np.abs(flight.rate - amplitudes * np.stack([cn, sn, dn], axis=1))) < 1e-7 * np.max(amplitudes)


def test_rates_of_the_fixed_step_tend_to_jacobis_with_fourth_order() -> None:
    """Classical Runge-Kutta over 20 periods, compared once a period: order at least 3.8."""
    amplitudes, tau, k2 = jacobi()
    period = 4.0 * ellipk(k2) / tau
    start = InitialState.from_attitude((0.0, 0.0, 0.0), rate=(amplitudes[0], 0.0, amplitudes[2]))
    dynamics = build_dynamics(ASYMMETRIC, derivative_model(), VACUUM, FlatEarth(0.0))
    errors = []
    for n in (100, 200, 400):
        flight = fly(dynamics, start, 20.0 * period, step=period / n, every=n, estimate_error=False)
        sn, cn, dn, _ = ellipj(tau * flight.time, k2)
        errors.append(np.max(np.abs(flight.rate - amplitudes * np.stack([cn, sn, dn], axis=1))))
    assert min(np.log2(errors[0] / errors[1]), np.log2(errors[1] / errors[2])) > 3.8


def test_vacuum_arc_has_the_range_apex_and_time_of_flight_of_the_parabola() -> None:
    speed, angle, g = 300.0, 0.7, 9.80665
    start = InitialState.from_path(speed, path_angle=angle)
    flight = simulate(
        FINNER, derivative_model(), start, 60.0, step=0.05, end=End(altitude=-1e-9), atmosphere=VACUUM, method="dop853"
    )
    assert flight.time[-1] == pytest.approx(2.0 * speed * math.sin(angle) / g, rel=1e-9)
    assert flight.position[-1, 0] == pytest.approx(speed**2 * math.sin(2.0 * angle) / g, rel=1e-9)
    apex = flight.at_times(speed * math.sin(angle) / g)
    assert -apex.position[0, 2] == pytest.approx((speed * math.sin(angle)) ** 2 / (2.0 * g), rel=1e-9)
