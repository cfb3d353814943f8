"""What damping is made of, stability factors, handling-qualities levels."""

import math

import numpy as np
import pytest

from flightsim.support import DENSITY, FINNER, SPEED, derivative_model
from indicial.errors import InputError
from indicial.flightsim import (
    SpinStability,
    build_dynamics,
    check_damping,
    damping_sensitivity,
    missile_modes,
    rate_modes,
    spin_stability,
)
from indicial.flightsim.damping_sensitivity import NAMES


@pytest.mark.parametrize("roll_rate", [0.0, 1500.0])
def test_sensitivities_are_differences_of_the_modes(roll_rate: float) -> None:
    found = damping_sensitivity(FINNER, derivative_model(), SPEED, roll_rate=roll_rate)
    for i, name in enumerate(NAMES):
        value = getattr(derivative_model(), name)
        ends = [
            missile_modes(build_dynamics(FINNER, derivative_model(**{name: v})), SPEED, roll_rate=roll_rate)
            for v in (value + 1e-3 * abs(value), value - 1e-3 * abs(value))
        ]
        for arm in found.arms:
            up, down = (modes[arm.name] for modes in ends)
            step = 2e-3 * abs(value)
            scale = 1e-9 * abs(arm.eigenvalue) / step + 1e-5 * abs(arm.gradient[i])
            assert abs((up.eigenvalue - down.eigenvalue) / step - arm.gradient[i]) < scale
            ratio = (up.damping_ratio - down.damping_ratio) / step
            assert ratio == pytest.approx(arm.ratio_gradient[i], rel=1e-4, abs=1e-9 / step)


def test_parts_are_those_of_the_closed_form_and_sum_to_the_whole() -> None:
    d = derivative_model()
    arm = damping_sensitivity(FINNER, d, SPEED).arms[0]
    scale = DENSITY * SPEED * FINNER.reference.area / 4.0
    radius = FINNER.reference.length**2 / (2.0 * FINNER.inertia[1, 1])
    parts = arm.parts
    assert parts["Cm_q"] == pytest.approx(scale * radius * d.Cm_q, rel=1e-3)
    assert parts["Cm_alphadot"] == pytest.approx(scale * radius * d.Cm_alphadot, rel=1e-3)
    assert parts["lift"] == pytest.approx(-scale * (d.CN_alpha - d.CA_0) / FINNER.mass, rel=1e-2)
    assert parts["slowing"] == pytest.approx(scale * d.CA_0 / FINNER.mass, rel=1e-2)
    assert sum(parts.values()) == pytest.approx(arm.damping, rel=1e-12)
    assert abs(parts["remainder"]) < 1e-2 * abs(arm.damping)


def test_a_sum_that_is_known_makes_the_damping_known_whatever_its_parts() -> None:
    errors = {"Cm_q": 60.0, "Cm_alphadot": 60.0}
    apart, together = (
        damping_sensitivity(FINNER, derivative_model(), SPEED, uncertainties=errors, correlations=c).arms[0]
        for c in ({}, {("Cm_q", "Cm_alphadot"): -1.0})
    )
    slope = abs(apart.damping_gradient[NAMES.index("Cm_q")])
    assert apart.standard_error == pytest.approx(slope * 60.0 * math.sqrt(2.0), rel=1e-3)
    assert together.standard_error < 1e-3 * apart.standard_error
    assert apart.margin == pytest.approx(-apart.damping / apart.standard_error)


def test_impossible_uncertainties_are_refused() -> None:
    for given, message in (
        ({"uncertainties": {"Cm_p": 1.0}}, "Cm_p"),
        ({"uncertainties": {"Cm_q": -1.0}}, "negative"),
        ({"correlations": {("Cm_q", "Cm_alphadot"): 1.5}}, "1.5"),
    ):
        with pytest.raises(InputError, match=message):
            damping_sensitivity(FINNER, derivative_model(), SPEED, **given)


def test_the_criterion_of_the_factors_is_that_of_the_roots() -> None:
    """Over motions at random, with every sign of H, M and T: Sd(2 - Sd) > 1/Sg exactly if both roots die out."""
    draw = np.random.default_rng(3)
    verdicts = []
    for _ in range(2000):
        h, p, m, t = draw.normal(size=4)
        case = SpinStability(h + 0.5, 3.0 * p, m, t, 1.0, 1.0)
        stable = max(root.real for root in case.roots) < 0.0
        assert case.dynamically_stable == stable
        verdicts.append(stable)
    assert 200 < sum(verdicts) < 1800


def test_yaw_of_a_spinning_unstable_projectile_follows_the_two_arms() -> None:
    """Sg 2 by spin, no static stability: the flight's arms are those of its linearisation, and of tricyclic theory.

    The theory has no CN_q and CN_alphadot, and leaves out products of lift and damping, (rho S/2m)^2 CL_alpha
    (m c^2/2Iy) Cm_q = 2e-5 beside M = 6.5e-3: hence 5e-3.
    """
    model = derivative_model(Cm_alpha=5.0, Cl_p=-1.0, CN_q=0.0, CN_alphadot=0.0)
    at_rest = spin_stability(FINNER, model, DENSITY, SPEED)
    roll = math.sqrt(8.0 * at_rest.M) * SPEED * FINNER.inertia[1, 1] / FINNER.inertia[0, 0]
    spinning = spin_stability(FINNER, model, DENSITY, SPEED, roll_rate=roll)
    assert spinning.gyroscopic == pytest.approx(2.0, rel=1e-12)
    assert spinning.dynamically_stable
    assert not at_rest.dynamically_stable
    check = check_damping(FINNER, model, SPEED, roll_rate=roll, amplitude=math.radians(0.02), wavelengths=3.0)
    for arm, root in zip(check.arms, spinning.roots, strict=True):
        # Both arms turn too fast by one rate, 5e-8 of the roll's: the angle of the axes that do not roll.
        assert abs(arm.fitted.imag - arm.linearised.imag) < 1e-7 * roll
        assert arm.fitted.real == pytest.approx(arm.linearised.real, rel=1e-4)
        assert arm.fitted.real == pytest.approx(root.real * SPEED, rel=5e-3)
        assert arm.fitted.imag == pytest.approx(root.imag * SPEED, rel=5e-3)


def test_magnus_moment_can_make_a_stable_projectile_unstable() -> None:
    model, roll = derivative_model(Cm_alpha=5.0), 8000.0
    assert spin_stability(FINNER, model, DENSITY, SPEED, roll_rate=roll).dynamically_stable
    turned = spin_stability(FINNER, model, DENSITY, SPEED, roll_rate=roll, Cn_p_alpha=-5.0)
    assert "UNSTABLE" in turned.summary()


def test_roll_at_the_pitching_frequency_is_told() -> None:
    frequency = spin_stability(FINNER, derivative_model(), DENSITY, SPEED).pitch_frequency
    near = spin_stability(FINNER, derivative_model(), DENSITY, SPEED, roll_rate=1.1 * frequency)
    assert "resonance" in near.warnings[0]
    assert not spin_stability(FINNER, derivative_model(), DENSITY, SPEED, roll_rate=0.3 * frequency).warnings


def test_levels_of_the_747_without_yaw_damper() -> None:
    """Etkin and Reid's modes at M 0.8, 40,000 ft, with n/alpha = qbar S 4.92/W = 7.52 g/rad, rated by hand."""
    rated = rate_modes(
        "III",
        "B",
        short_period=-0.3719 + 0.8875j,
        n_alpha=7.52,
        phugoid=-0.003289 + 0.06723j,
        dutch_roll=-0.033011 + 0.94655j,
        roll=-0.56248,
        spiral=-0.0072973,
    )
    assert [r.level for r in rated.ratings] == [1, 1, 1, 3, 2, 1]
    assert rated.level == 3
    assert "Dutch roll" in rated.summary()


def _pair(zeta: float, omega: float) -> complex:
    return complex(-zeta * omega, omega * math.sqrt(max(1.0 - zeta**2, 0.0)))


@pytest.mark.parametrize(
    ("kind", "category", "zeta", "omega", "level"),
    [
        ("IV", "A", 0.36, 1.01, 1),
        ("IV", "A", 0.36, 0.99, 2),
        ("III", "A", 0.36, 0.99, 1),
        ("III", "A", 0.34, 1.0, 2),
        ("I", "B", 0.081, 1.9, 1),
        ("I", "B", 0.079, 1.9, 2),
        ("I", "C", 0.2, 0.9, 2),
        ("II", "C", 0.2, 0.9, 1),
        ("II-C", "C", 0.2, 0.9, 2),
        ("III", "B", 0.019, 3.0, 3),
        ("III", "B", -0.01, 3.0, None),
        ("III", "B", 0.5, 0.39, None),
    ],
)
def test_boundaries_of_the_dutch_roll(kind: str, category: str, zeta: float, omega: float, level: int | None) -> None:
    assert rate_modes(kind, category, dutch_roll=_pair(zeta, omega))["Dutch roll"].level == level


def test_boundaries_of_the_other_modes() -> None:
    def rated(category: str, **mode: complex) -> int | None:
        return rate_modes("IV", category, **mode).level  # type: ignore[arg-type]

    for zeta, levels in ((0.351, (1, 1)), (0.349, (2, 1)), (0.24, (3, 2)), (0.16, (3, 3)), (0.14, (None, None))):
        assert tuple(rated(c, short_period=_pair(zeta, 3.0)) for c in "AB") == levels
    for cap, level in ((0.29, 1), (0.27, 2), (3.7, 2), (10.1, 3), (0.15, None)):
        assert rated("A", short_period=_pair(0.7, 4.0), n_alpha=16.0 / cap) == level
    for growth, level in ((-0.05, 1), (-0.03, 2), (math.log(2.0) / 56.0, 3), (math.log(2.0) / 54.0, None)):
        assert rated("B", phugoid=complex(growth, math.sqrt(1.0 - growth**2))) == level
    assert [rated(c, roll=-1.0 / t) for c, t in (("A", 0.9), ("A", 1.1), ("B", 1.1), ("B", 3.1))] == [1, 2, 1, 3]
    for double, level in ((12.1, 1), (11.9, 2), (7.9, 3), (3.9, None)):
        assert rated("A", spiral=math.log(2.0) / double) == level
    assert rated("B", spiral=math.log(2.0) / 19.0) == 2


def test_unknown_classes_are_refused() -> None:
    with pytest.raises(InputError, match="II-L"):
        rate_modes("V", "A", roll=-1.0)
    with pytest.raises(InputError, match="category"):
        rate_modes("I", "D", roll=-1.0)
    with pytest.raises(InputError, match="no mode"):
        rate_modes("I", "A")


def test_parts_are_drawn() -> None:
    import matplotlib.pyplot as plt

    found = damping_sensitivity(FINNER, derivative_model(), SPEED, uncertainties={"Cm_q": 10.0})
    assert len(found.plot().axes) == 2
    assert "remainder" in found.summary()
    plt.close("all")
