"""An aircraft with derivatives in all axes against published modes, and the loads against their definition."""

import numpy as np
import pytest

from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.flightsim import (
    BodyAxisAerodynamics,
    ConstantAtmosphere,
    Dynamics,
    FlatEarth,
    InitialState,
    Vehicle,
    build_dynamics,
    linearise,
)

FOOT, SLUG, POUND = 0.3048, 14.593902937206364, 4.4482216152605
GRAVITY, SPEED, DENSITY = 32.174 * FOOT, 774.0 * FOOT, 0.0005909 * SLUG / FOOT**3
LONGITUDINAL, LATERAL = ("u", "w", "q", "q2"), ("v", "p", "r", "q1")
WEIGHT, IXZ = 636636.0 * POUND, -0.156e7


def boeing_747() -> Dynamics:
    """Boeing 747-100, M 0.8 at 40,000 ft, stability axes: Etkin and Reid, Dynamics of Flight, tables 6.1 and 6.2."""
    reference = ReferenceQuantities(27.31 * FOOT, 5500.0 * FOOT**2, lateral_length=195.7 * FOOT)
    inertia = np.array([[0.183e8, 0.0, -IXZ], [0.0, 0.331e8, 0.0], [-IXZ, 0.0, 0.497e8]]) * SLUG * FOOT**2
    vehicle = Vehicle("Boeing 747-100", WEIGHT / GRAVITY, inertia, reference, (0.0, 0.0, 0.0))
    model = BodyAxisAerodynamics(
        reference=reference,
        speed=SPEED,
        CX_u=-0.1080,
        CX_alpha=0.2193,
        CZ_0=-WEIGHT / (0.5 * DENSITY * SPEED**2 * reference.area),
        CZ_u=-0.1060,
        CZ_alpha=-4.920,
        CZ_q=-5.921,
        CZ_alphadot=5.896,
        Cm_u=0.1043,
        Cm_alpha=-1.023,
        Cm_q=-23.92,
        Cm_alphadot=-6.314,
        CY_beta=-0.8771,
        Cl_beta=-0.2797,
        Cn_beta=0.1946,
        Cl_p=-0.3295,
        Cn_p=-0.04073,
        Cl_r=0.304,
        Cn_r=-0.2737,
    )
    temperature = 216.65
    air = ConstantAtmosphere(temperature, DENSITY * 8314.32 / 28.9644 * temperature)
    return build_dynamics(vehicle, model, air, FlatEarth(GRAVITY))


def test_modes_of_the_747_are_those_published() -> None:
    dynamics = boeing_747()
    linear = linearise(dynamics, dynamics.initial_vector(InitialState.from_path(SPEED)))
    assert linear.rate[3:] == pytest.approx(np.zeros(10), abs=1e-12)
    found = np.concatenate([np.linalg.eigvals(linear.block(names)) for names in (LONGITUDINAL, LATERAL)])
    published = {
        "phugoid": -0.003289 + 0.06723j,
        "short period": -0.3719 + 0.8875j,
        "spiral": -0.0072973,
        "roll": -0.56248,
        "Dutch roll": -0.033011 + 0.94655j,
    }
    for name, eigenvalue in published.items():
        nearest = found[np.argmin(np.abs(found - eigenvalue))]
        assert nearest.real == pytest.approx(eigenvalue.real, rel=5e-3), name
        assert nearest.imag == pytest.approx(eigenvalue.imag, rel=5e-3, abs=1e-12), name


def test_lateral_modes_follow_from_the_books_matrix_to_five_digits() -> None:
    matrix = [
        [-0.0558, 0, -774, 32.2],
        [-0.003865, -0.4342, 0.4136, 0],
        [0.001086, -0.006112, -0.1458, 0],
        [0, 1, 0, 0],
    ]
    found = np.linalg.eigvals(np.array(matrix))
    for eigenvalue in (-0.0072973, -0.56248, -0.033011 + 0.94655j):
        nearest = found[np.argmin(np.abs(found - eigenvalue))]
        assert nearest.real == pytest.approx(eigenvalue.real, rel=2e-5)
        assert nearest.imag == pytest.approx(np.imag(eigenvalue), rel=1e-5)


def test_loads_are_the_coefficients_they_are_defined_by() -> None:
    reference = ReferenceQuantities(0.5, 2.0, lateral_length=3.0)
    names = ("CX_0", "CX_u", "CX_alpha", "CX_q", "CZ_0", "CZ_u", "CZ_alpha", "CZ_q", "Cm_0", "Cm_u", "Cm_alpha", "Cm_q")
    names += ("CY_0", "CY_beta", "CY_p", "CY_r", "Cl_0", "Cl_beta", "Cl_p", "Cl_r", "Cn_0", "Cn_beta", "Cn_p", "Cn_r")
    values = dict(zip(names, np.random.default_rng(5).standard_normal(len(names)), strict=True))
    model = BodyAxisAerodynamics(reference=reference, speed=50.0, CD_0=0.3, **values)
    vehicle = Vehicle("body", 10.0, np.eye(3), reference, (0.0, 0.0, 0.0))
    dynamics = build_dynamics(vehicle, model)
    start = InitialState.from_path(60.0, alpha=0.1, beta=0.2, rate=(1.0, 2.0, 3.0))
    force, moment, density, *_ = (
        np.array(part).ravel() for part in dynamics.loads(dynamics.initial_vector(start), [], 0.0)
    )
    direction = start.velocity / 60.0
    pressure = 0.5 * density[0] * 60.0**2 * 2.0
    p, q, r = np.array([1.0, 2.0, 3.0]) * np.array([3.0, 0.5, 3.0]) / (2.0 * 60.0)
    along = {"0": 1.0, "u": 0.2, "alpha": direction[2], "q": q}
    across = {"0": 1.0, "beta": direction[1], "p": p, "r": r}

    def sum_of(name: str, motion: dict[str, float]) -> float:
        return sum(values[f"{name}_{key}"] * amount for key, amount in motion.items())

    drag = -0.3 * direction
    coefficients = [sum_of("CX", along), sum_of("CY", across), sum_of("CZ", along)]
    assert force == pytest.approx(pressure * (coefficients + drag), rel=1e-12)
    lengths = np.array([3.0, 0.5, 3.0])
    moments = np.array([sum_of("Cl", across), sum_of("Cm", along), sum_of("Cn", across)])
    assert moment == pytest.approx(pressure * lengths * moments, rel=1e-12)


def test_speed_derivatives_need_their_speed() -> None:
    with pytest.raises(InputError, match="speed"):
        BodyAxisAerodynamics(reference=ReferenceQuantities(1.0, 1.0), CX_u=-0.1)
