"""Friction and base estimates against what is known of them in closed form or in print."""

import math

import pytest

from indicial.cfd.shapes import FinnedBody
from indicial.errors import InputError
from indicial.studies.finner.axial_force import (
    RECOVERY,
    axial_force,
    base_drag,
    karman_schoenherr,
    mean_skin_friction,
    reynolds_number,
)


def test_karman_schoenherr_fits_schoenherrs_table():
    """Mean friction line: 0.004409 at Re 1e6, 0.002934 at 1e7, 0.002072 at 1e8 (ATTC 1947)."""
    for reynolds, printed in ((1e6, 4.409e-3), (1e7, 2.934e-3), (1e8, 2.072e-3)):
        assert karman_schoenherr(reynolds) == pytest.approx(printed, rel=1e-3)


def test_without_speed_and_heat_van_driest_is_incompressible():
    assert mean_skin_friction(5e6, 0.0, 1.0) == pytest.approx(karman_schoenherr(5e6), rel=1e-12)
    assert mean_skin_friction(5e6, 1e-4, 1.0) == pytest.approx(karman_schoenherr(5e6), rel=1e-4)
    assert mean_skin_friction(5e6, 1e-4, 1.7) == pytest.approx(mean_skin_friction(5e6, 0.0, 1.7), rel=1e-4)


def test_on_an_adiabatic_wall_the_factor_is_the_closed_form():
    """With Tw = T (1 + r m), B = 0 and F_c = r m / asin(A)^2, A^2 = r m/(1 + r m)."""
    mach, heat = 2.5, RECOVERY * 0.2 * 2.5**2
    factor = heat / math.asin(math.sqrt(heat / (1.0 + heat))) ** 2
    wall = 1.0 + heat
    viscosity_ratio = wall**1.5 * (293.15 + 110.4) / (293.15 * wall + 110.4)
    expected = karman_schoenherr(1e7 / viscosity_ratio / factor) / factor
    assert mean_skin_friction(1e7, mach, wall) == pytest.approx(expected, rel=1e-9)


def test_a_cold_wall_has_more_friction_than_a_hot_one_and_speed_takes_it_away():
    assert mean_skin_friction(1e7, 3.0, 1.0) > mean_skin_friction(1e7, 3.0, 2.6)
    assert mean_skin_friction(1e7, 4.0, 4.0) < mean_skin_friction(1e7, 2.0, 2.0) < karman_schoenherr(1e7)


def test_reynolds_numbers_are_those_of_the_range():
    """7e6 at M 1 to 30e6 at M 4.5 on the length."""
    assert reynolds_number(1.0, 0.3) == pytest.approx(7e6, rel=0.05)
    assert reynolds_number(4.5, 0.3) == pytest.approx(30e6, rel=0.05)


def test_the_base_is_continuous_at_mach_1_and_the_parts_add_up():
    assert base_drag(1.0 - 1e-12) == pytest.approx(base_drag(1.0))
    parts = axial_force(FinnedBody.basic_finner(), 2.0, 0.1)
    assert parts.total == parts.forebody_and_fins + parts.friction + parts.base + parts.trailing_edges
    assert parts.trailing_edges == pytest.approx(parts.base * 4 * 0.08 / (math.pi / 4.0))
    assert parts.friction_adiabatic < parts.friction


def test_nonsense_is_refused():
    with pytest.raises(InputError, match="skin friction"):
        mean_skin_friction(1e7, 2.0, -1.0)
