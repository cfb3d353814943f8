"""The separation point: static limit, linear limit, loops of small motions, and what the time constants do."""

import math

import numpy as np
import pytest

from indicial.cfd.lattice.polars import GRID
from indicial.cfd.lattice.separation import SeparationLag, SeparationState, StripSections, centre_of_pressure, kirchhoff
from indicial.conventions import Array
from indicial.errors import InputError
from lattice.sections import linear, stalling


def sections(polar=None) -> StripSections:
    return StripSections.of([polar or stalling()])


def along(one: StripSections, alpha: Array, lag: SeparationLag, step: float) -> tuple[Array, Array]:
    """cl and x under incidences (n,), a step in chords travelled between them, from the static state."""
    first = alpha[:1]
    state = SeparationState(first, one.static(first)[0])
    lift, point = np.empty(alpha.size), np.empty(alpha.size)
    for n in range(alpha.size):
        middle = alpha[n : n + 1] if n == 0 else 0.5 * (alpha[n - 1 : n] + alpha[n : n + 1])
        state = one.advance(state, middle, np.array([step if n else 0.0]), lag)
        lift[n], point[n] = one.lift(alpha[n : n + 1], state.point)[0][0], state.point[0]
    return lift, point


def test_static_point_gives_the_polar_back_exactly() -> None:
    polar = stalling()
    one = StripSections.of([polar] * GRID.size)
    point, _ = one.static(GRID)
    np.testing.assert_allclose(one.lift(GRID, point)[0], polar.full.cl, atol=1e-12)
    drag, moment = one.drag_and_moment(GRID, point)
    np.testing.assert_allclose(drag, polar.full.cd, atol=1e-12)
    np.testing.assert_allclose(moment, polar.full.cm, atol=1e-12)
    # and between the table's incidences, whatever the interpolation
    between = GRID[:-1] + 0.4 * (GRID[1] - GRID[0])
    many = StripSections.of([polar] * between.size)
    lift, _ = many.lift(between, many.static(between)[0])
    np.testing.assert_allclose(lift, many.polar_lift(between)[0], atol=1e-12)


def test_kirchhoff_s_flow_is_solved_for_its_point() -> None:
    point = np.linspace(0.05, 1.0, 20)
    alpha = np.radians(np.linspace(25.0, 12.0, 20))
    # a polar that is Kirchhoff's lift of that point
    table = np.radians(np.concatenate([np.arange(-30.0, 12.0, 0.25), np.degrees(alpha[::-1])]))
    x = np.concatenate([np.ones(table.size - 20), point[::-1]])
    from indicial.cfd.lattice.polars import Polar

    polar = Polar("a", 1e6, table, 2.0 * np.pi * np.sin(table) * kirchhoff(x), 0.0 * table, 0.0 * table)
    many = StripSections.of([polar] * 20)
    np.testing.assert_allclose(many.static(alpha)[0], point, atol=2e-3)


def test_attached_section_has_no_separation_and_its_lift_does_not_lag() -> None:
    one = sections(linear())
    alpha = np.radians(8.0 * np.sin(np.linspace(0.0, 10.0, 200)))
    lift, point = along(one, alpha, SeparationLag(), 0.5)
    np.testing.assert_allclose(point, 1.0, atol=1e-9)
    np.testing.assert_allclose(lift, 2.0 * np.pi * np.sin(alpha), atol=1e-5)


def test_slopes_are_derivatives() -> None:
    alpha = np.radians(np.linspace(-40.0, 40.0, 57) + 0.03)
    many, h = StripSections.of([stalling()] * alpha.size), 1e-6
    point = np.linspace(0.1, 0.9, alpha.size)
    for function in (lambda a: many.lift(a, point), many.polar_lift, many.static):
        numeric = (function(alpha + h)[0] - function(alpha - h)[0]) / (2.0 * h)
        np.testing.assert_allclose(function(alpha)[1], numeric, atol=2e-6)
    numeric = (many.lift(alpha, point + h)[0] - many.lift(alpha, point - h)[0]) / (2.0 * h)
    np.testing.assert_allclose(many.lift_of_point(alpha, point), numeric, atol=1e-6)


@pytest.mark.parametrize("k", [0.05, 0.2, 0.8])
def test_loop_of_a_small_motion_has_the_area_of_the_closed_form(k: float) -> None:
    """cl = cl_a alpha + cl_x x with x' = static slope / ((1 + i k T_p)(1 + i k T_f)), k per chord: area pi A Im."""
    one, lag = sections(), SeparationLag(0.7, 1.9)
    mean, amplitude = math.radians(13.6), math.radians(0.02)
    here = np.array([mean])
    point, slope = (value[0] for value in one.static(here))
    answer = slope / ((1.0 + 1j * k * lag.delay) * (1.0 + 1j * k * lag.response))
    exact = math.pi * amplitude**2 * one.lift_of_point(here, np.array([point]))[0] * answer.imag
    steps, periods = 400, 6
    phase = 2.0 * np.pi * np.arange(periods * steps + 1) / steps
    alpha = mean + amplitude * np.sin(phase)
    lift, _ = along(one, alpha, lag, 2.0 * np.pi / (k * steps))
    # over the last period: the out-of-phase part times pi A
    last = slice(-steps, None)
    area = math.pi * amplitude * 2.0 * np.mean(lift[last] * np.cos(phase[last]))
    assert area == pytest.approx(exact, rel=2e-3)


def test_quick_separation_follows_the_polar_and_a_slow_one_does_not_move() -> None:
    one = sections()
    alpha = np.radians(13.0 + 2.0 * np.sin(np.linspace(0.0, 6.0, 400)))
    quick, _ = along(one, alpha, SeparationLag(1e-4, 1e-4), 0.5)
    many = StripSections.of([stalling()] * 400)
    middle = np.concatenate([alpha[:1], 0.5 * (alpha[1:] + alpha[:-1])])
    np.testing.assert_allclose(quick, many.lift(alpha, many.static(middle)[0])[0], atol=1e-12)
    _, slow = along(one, alpha, SeparationLag(1e-4, 1e9), 0.5)
    assert np.ptp(slow) < 1e-6


def test_kirchhoff_s_limits() -> None:
    np.testing.assert_allclose(kirchhoff(np.array([0.0, 1.0])), [0.25, 1.0])
    np.testing.assert_allclose(centre_of_pressure(np.array([0.0, 1.0])), [5.0 / 16.0, 0.25])


def test_bad_time_constants_are_refused() -> None:
    with pytest.raises(InputError, match="response is 0"):
        SeparationLag(1.0, 0.0)
