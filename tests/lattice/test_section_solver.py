"""Section data on the lattice: the linear limit, lifting-line theory, several steady states, marches, refusals."""

import math
import warnings

import numpy as np
import pytest

from indicial.cfd.lattice import (
    ExtrapolationWarning,
    Lattice,
    LatticeSolver,
    PolarTables,
    SectionLatticeSolver,
    SectionSettings,
    steady_instant,
)
from indicial.cfd.lattice.coupling import StripProblem
from indicial.cfd.lattice.polars import Polar
from indicial.cfd.lattice.spanwise import spanwise_mean
from indicial.cfd.shapes import LiftingSurface
from indicial.errors import InputError
from indicial.methods import indicial_response, moving_frame
from indicial.motion import AlphaStep, FlightCondition, Rates, RollOscillation, SteadyMotion
from indicial.solver import Solver
from lattice.sections import linear, stalling, tables

CONDITION = FlightCondition(0.1, alpha=math.radians(6.0))


def solver(polar: Polar, *, sweep: float = 0.0, aspect: float = 8.0, spanwise: int = 8) -> SectionLatticeSolver:
    wing = LiftingSurface.wing("wing", aspect, 1.2, taper=2.0 / 3.0, sweep=sweep, dihedral=0.05, washout=0.02)
    lattice = Lattice.of(wing, chordwise=3, spanwise=spanwise, camber=False)
    return SectionLatticeSolver(lattice, wing.reference((0.3, 0.0, 0.0)), tables(polar))


def attached(one: SectionLatticeSolver) -> LatticeSolver:
    return LatticeSolver(one.lattice, one.reference)


@pytest.mark.parametrize("sweep", [0.0, 0.5])
def test_section_of_slope_two_pi_leaves_the_lattice_as_it_is(sweep: float) -> None:
    one = solver(linear(), sweep=sweep)
    rates = Rates(0.5, 0.3, 0.2)
    found, exact = one.steady(CONDITION, rates), attached(one).steady(CONDITION, rates)
    np.testing.assert_allclose(found.coefficients, exact.coefficients, atol=1e-8)


def test_march_with_a_section_of_slope_two_pi_is_that_of_the_lattice() -> None:
    one = solver(linear())
    times = np.linspace(0.0, 0.3, 7)
    for motion in (AlphaStep(CONDITION, 0.02), RollOscillation(CONDITION, 0.05, 20.0)):
        found, exact = one.unsteady(CONDITION, motion, times), attached(one).unsteady(CONDITION, motion, times)
        np.testing.assert_allclose(found.coefficients, exact.coefficients, atol=1e-7)
        np.testing.assert_allclose(found.before, exact.before, atol=1e-8)


@pytest.mark.parametrize("mach", [0.1, 0.6])
def test_strips_of_a_long_swept_wing_meet_the_incidence_of_flight_at_any_mach_number(mach: float) -> None:
    # in two dimensions across the sweep nothing is induced: Gamma = pi c cos V alpha/sqrt(1 - M^2 cos^2)
    wing = LiftingSurface.wing("wing", 400.0, 1.0, sweep=0.6)
    lattice = Lattice.of(wing, chordwise=4, spanwise=16, camber=False)
    plain = LatticeSolver(lattice, wing.reference((0.0, 0.0, 0.0)))
    condition = FlightCondition(mach, alpha=0.01)
    motion = plain.motion(condition.velocity, np.zeros(3))
    problem = StripProblem.at(steady_instant(plain.influence(condition), motion))
    met = problem.incidence(problem.free / (2.0 * np.pi * problem.size))
    # a quarter of the way out, far from tip and kink
    np.testing.assert_allclose(met[20:24], 0.01, rtol=5e-3)


def lifting_line(slope: float, span: float, root: float, taper: float, terms: int = 60) -> float:
    """Lift slope of a straight tapered wing by Prandtl's equation in Glauert's series (odd terms), per rad."""
    theta = (np.arange(terms) + 0.5) * (math.pi / 2.0) / terms
    chord = root * (1.0 - (1.0 - taper) * np.cos(theta))
    n = 2.0 * np.arange(terms) + 1.0
    mu = slope * chord / (4.0 * span)
    matrix = np.sin(np.outer(theta, n)) * (mu[:, None] * n + np.sin(theta)[:, None])
    series = np.linalg.solve(matrix, mu * np.sin(theta))
    return float(math.pi * span / (0.5 * root * (1.0 + taper)) * series[0])


@pytest.mark.parametrize("slope", [5.0, 6.0])
def test_lift_slope_of_a_slender_wing_is_that_of_lifting_line_theory_with_the_section_s_slope(slope: float) -> None:
    wing = LiftingSurface.wing("wing", 30.0, 1.2, taper=0.5)
    lattice = Lattice.of(wing, chordwise=2, spanwise=20, camber=False)
    one = SectionLatticeSolver(lattice, wing.reference((0.3, 0.0, 0.0)), tables(linear(slope)))
    up, down = (one.steady(FlightCondition(1e-3, alpha=a))["CN"] for a in (0.01, -0.01))
    exact = lifting_line(slope, 30.0, 1.2, 0.5)
    # lifting-surface theory lies below the line by some 1/aspect ratio of it
    assert (up - down) / 0.02 == pytest.approx(exact, rel=0.015)


def test_drag_and_moment_of_sections_add_up() -> None:
    plain, thick = solver(linear()), solver(linear(drag=0.02, moment=-0.05))
    condition = FlightCondition(1e-3)
    more = thick.steady(condition).coefficients - plain.steady(condition).coefficients
    strips = plain.lattice.strips
    assert more[0] == pytest.approx(0.02 * np.sum(strips.area) / plain.reference.area, rel=2e-3)
    level = strips.span[:, 1]
    pitch = -0.05 * np.sum(strips.area * strips.chord * level) / (plain.reference.area * plain.reference.length)
    lever = 0.02 * np.sum(strips.area * strips.quarter_chord[:, 2]) / (plain.reference.area * plain.reference.length)
    assert more[4] == pytest.approx(pitch + lever, rel=2e-3)


def test_steady_strips_have_the_lift_of_their_polars() -> None:
    one = solver(stalling())
    for degrees in (8.0, 14.0, 17.0):
        condition = FlightCondition(0.1, alpha=math.radians(degrees))
        sections = one.sections(condition)
        instant = one._steady_instant(condition, Rates())
        problem = StripProblem.at(instant)
        for state in one.steady_states(condition):
            speed = np.hypot(problem.along, state.across)
            wanted = problem.size * speed * sections.polar_lift(state.alpha)[0]
            np.testing.assert_allclose(state.circulation, wanted, rtol=1e-9, atol=1e-9)
            wash = problem.wash(state.across, state.circulation)
            given = instant.circulation(wash[one.lattice.strip])[one.lattice.trailing]
            np.testing.assert_allclose(given, state.circulation, rtol=1e-8, atol=1e-9)


def test_abrupt_stall_gives_several_states_that_mirror_one_another() -> None:
    one = solver(stalling(0.7))
    condition = FlightCondition(0.1, alpha=math.radians(15.5))
    states = one.steady_states(condition)
    rolling = sorted(float(one.state_loads(condition, Rates(), state)[3]) for state in states)
    assert len(states) > 1
    assert rolling[-1] > 0.01
    np.testing.assert_allclose(rolling, -np.array(rolling[::-1]), atol=1e-8)
    told = one.steady(condition).convergence
    assert told["states"] == len(states)
    assert told["largest_Cl"] == pytest.approx(rolling[-1], abs=1e-8)


def test_attached_flow_has_one_state() -> None:
    assert solver(stalling()).steady(CONDITION).convergence["states"] == 1


def test_growth_tells_whether_a_disturbed_state_comes_back() -> None:
    """The march from a state must stay there where its growth is negative."""
    one = solver(stalling(0.4))
    condition = FlightCondition(0.1, alpha=math.radians(16.5))
    state = one.steady_states(condition)[0]
    assert state.growth < 0.0
    assert np.min(state.point) < 0.9
    history = one.unsteady(condition, SteadyMotion(condition), np.linspace(0.0, 1.0, 21))
    np.testing.assert_allclose(history.coefficients, np.tile(history.before, (21, 1)), atol=1e-6)


def test_slow_roll_in_stall_meets_the_moving_frame() -> None:
    one = solver(stalling(0.3))
    condition = FlightCondition(0.1, alpha=math.radians(14.5))
    p = 0.02
    steady = one.steady(condition, Rates(p=p))

    class Ramp(SteadyMotion):
        def rate(self, time):
            ramp = np.minimum(np.asarray(time, dtype=float) / 1.0, 1.0)
            return np.multiply.outer(ramp, np.array([p, 0.0, 0.0]))

    history = one.unsteady(condition, Ramp(condition), np.linspace(0.0, 4.0, 81))
    assert history["Cl"][-1] == pytest.approx(steady["Cl"], rel=2e-2)


def test_incidence_beyond_the_range_is_flagged_and_warned_of() -> None:
    alpha = np.radians(np.arange(-5.0, 5.1, 0.5))
    short = Polar("flat", 1e6, alpha, 2.0 * np.pi * np.sin(alpha), 0.0 * alpha, 0.0 * alpha)
    one = solver(short)
    with pytest.warns(ExtrapolationWarning, match="beyond the trusted range"):
        loads = one.steady(FlightCondition(0.1, alpha=math.radians(12.0)))
    assert loads.convergence["extrapolated"] > 0
    step = AlphaStep(FlightCondition(0.1), math.radians(12.0))
    with pytest.warns(ExtrapolationWarning, match="'alpha_step'"):
        history = one.unsteady(FlightCondition(0.1), step, np.linspace(0.0, 0.3, 6))
    assert history.provenance["extrapolated"] > 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert one.steady(FlightCondition(0.1)).convergence["extrapolated"] == 0


def test_methods_run_on_it_unchanged() -> None:
    one = solver(stalling())
    assert isinstance(one, Solver)
    central = moving_frame.run(one, CONDITION, ("p",), second=None)
    one_sided = moving_frame.run(one, CONDITION, ("p",), second=None, one_sided=True)
    assert central["Cl_p"] == pytest.approx(one_sided["Cl_p"], rel=1e-2)


@pytest.mark.parametrize("kind", ["alpha", "beta", "p", "q", "r"])
def test_steps_of_every_kind_settle_on_the_steady_state_after_them(kind: str) -> None:
    one = solver(stalling())
    size = 0.01
    s = indicial_response.step_times(0.3, 1.15, 4.0, 120.0)
    history = indicial_response.run(one, CONDITION, size, s, kind)  # type: ignore[arg-type]
    step = indicial_response.experiment(CONDITION, one.reference, size, kind)  # type: ignore[arg-type]
    response = indicial_response.read(history, one.steady(*indicial_response.after(step)))
    load = {"alpha": "CN", "q": "CN"}.get(kind, "Cl")
    assert response[load][-1] == pytest.approx(response.final[load], rel=0.01)
    assert load in response.summary()


def test_camber_and_missing_data_are_refused() -> None:
    wing = LiftingSurface.wing("wing", 8.0, 1.0)
    with pytest.raises(InputError, match="camber=False"):
        SectionLatticeSolver(Lattice.of(wing), wing.reference((0.0, 0.0, 0.0)))
    one = SectionLatticeSolver(
        Lattice.of(wing, chordwise=2, spanwise=4, camber=False), wing.reference((0.0, 0.0, 0.0)), PolarTables.of([])
    )
    with pytest.raises(InputError, match="section 'flat' has no polar data"):
        one.steady(CONDITION)


def spreading(polar: Polar, spread: float, *, aspect: float = 8.0, spanwise: int = 8) -> SectionLatticeSolver:
    wing = LiftingSurface.wing("wing", aspect, 1.2, taper=2.0 / 3.0)
    lattice = Lattice.of(wing, chordwise=2, spanwise=spanwise, camber=False)
    reference = wing.reference((0.3, 0.0, 0.0))
    return SectionLatticeSolver(lattice, reference, tables(polar), SectionSettings(spread=spread))


def test_spanwise_mean_keeps_what_is_linear_across_the_span_and_surfaces_apart() -> None:
    wing = LiftingSurface.wing("wing", 12.0, 1.0)
    tail = LiftingSurface.wing("tail", 4.0, 0.5, root_leading_edge=(5.0, 0.0))
    strips = Lattice.of([wing, tail], chordwise=1, spanwise=40, span_spacing="equal").strips
    mean = spanwise_mean(strips, 0.7)
    assert mean is not None
    np.testing.assert_allclose(np.sum(mean, axis=1), 1.0, atol=1e-14)
    y = strips.quarter_chord[:, 1]
    np.testing.assert_allclose((mean @ y)[20:60], y[20:60], atol=1e-10)
    assert not np.any(mean[:80, 80:])
    # the transform of the Gaussian: a wave of length L chords is damped by exp(-(pi spread/L)^2)
    wave = np.cos(2.0 * np.pi * y / 2.0)
    middle = slice(35, 45)
    np.testing.assert_allclose((mean @ wave)[middle], math.exp(-((math.pi * 0.7 / 2.0) ** 2)) * wave[middle], atol=1e-4)


def test_spread_leaves_attached_flow_as_it_is() -> None:
    rates = Rates(0.5, 0.3, 0.2)
    plain, spread = (spreading(linear(5.5), width).steady(CONDITION, rates) for width in (0.0, 1.0))
    np.testing.assert_allclose(spread.coefficients, plain.coefficients, atol=1e-9)


def test_spread_state_has_the_lift_of_the_points_that_the_means_ask_for_and_stays() -> None:
    one = spreading(stalling(0.4), 1.0)
    condition = FlightCondition(0.1, alpha=math.radians(16.5))
    sections = one.sections(condition)
    problem = StripProblem.at(one._steady_instant(condition, Rates()))
    state = one.steady_states(condition)[0]
    point = sections.static(spanwise_mean(one.lattice.strips, 1.0) @ state.alpha)[0]
    np.testing.assert_allclose(state.point, point, atol=1e-12)
    wanted = problem.size * np.hypot(problem.along, state.across) * sections.lift(state.alpha, point)[0]
    np.testing.assert_allclose(state.circulation, wanted, rtol=1e-9)
    assert np.min(state.point) < 0.9
    history = one.unsteady(condition, SteadyMotion(condition), np.linspace(0.0, 1.0, 21))
    np.testing.assert_allclose(history.coefficients, np.tile(history.before, (21, 1)), atol=1e-6)


def test_slopes_of_the_settled_lift_are_derivatives() -> None:
    one = spreading(stalling(), 1.0)
    sections, h = one.sections(CONDITION), 1e-6
    alpha = np.radians(np.linspace(9.0, 17.0, 16) + 0.03)
    slopes = sections.settled_lift(alpha)[1]
    for n in (3, 8, 12):
        push = h * (np.arange(16) == n)
        numeric = (sections.settled_lift(alpha + push)[0] - sections.settled_lift(alpha - push)[0]) / (2.0 * h)
        np.testing.assert_allclose(slopes[:, n], numeric, atol=1e-5)


def test_cells_of_stall_have_the_width_of_strips_unless_separation_spreads() -> None:
    condition = FlightCondition(0.1, alpha=math.radians(14.5))

    def reversals(spread: float, spanwise: int) -> tuple[int, int]:
        """How often separation turns from more to less along half a wing, and how many steady states there are."""
        states = spreading(stalling(0.3), spread, aspect=16.0, spanwise=spanwise).steady_states(condition)
        change = np.diff(states[0].point[spanwise:])
        change = change[np.abs(change) > 0.05]
        return int(np.count_nonzero(np.diff(np.sign(change)))), len(states)

    assert reversals(0.0, 24)[0] > reversals(0.0, 12)[0] > 3
    assert reversals(1.0, 12) == reversals(1.0, 24) == (0, 1)


def test_bad_spread_is_refused() -> None:
    with pytest.raises(InputError, match="spread is -1"):
        SectionSettings(spread=-1.0)
