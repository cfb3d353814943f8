import math
from dataclasses import replace

import numpy as np
import pytest

from indicial.cfd.lattice import Lattice, LatticeSettings, LatticeSolver, March, RigidMotion, steady_instant
from indicial.cfd.lattice.biot_savart import ring_velocities, sheet_velocity
from indicial.cfd.lattice.influence import Influence
from indicial.cfd.lattice.shedding import Rings, cut
from indicial.cfd.shapes import LiftingSurface, SpanStation, WingSection
from indicial.errors import InputError
from indicial.motion import FlightCondition, Rates

INCOMPRESSIBLE = LatticeSettings(compressible=False)


def rectangle(aspect_ratio: float, chordwise: int = 4, spanwise: int = 16, **settings: object) -> LatticeSolver:
    wing = LiftingSurface.wing("wing", aspect_ratio, 1.0)
    lattice = Lattice.of(wing, chordwise=chordwise, spanwise=spanwise)
    return LatticeSolver(lattice, wing.reference((0.25, 0.0, 0.0)), LatticeSettings(compressible=False, **settings))  # type: ignore[arg-type]


def lift(solver: LatticeSolver, alpha: float) -> tuple[float, float]:
    loads = solver.steady(FlightCondition(0.1, alpha=alpha))
    ca, cn = loads["CA"], loads["CN"]
    return cn * math.cos(alpha) - ca * math.sin(alpha), cn * math.sin(alpha) + ca * math.cos(alpha)


def test_high_aspect_ratio_tends_to_the_plate_from_below() -> None:
    slopes = [lift(rectangle(ar), 0.01)[0] / 0.01 for ar in (20.0, 200.0, 2000.0)]
    assert slopes[0] < slopes[1] < slopes[2] < 2.0 * math.pi
    assert slopes[2] == pytest.approx(2.0 * math.pi, rel=3e-3)


def test_plate_in_two_dimensions_has_its_lift_at_the_quarter_chord() -> None:
    loads = rectangle(5000.0, chordwise=3).steady(FlightCondition(0.1, alpha=0.01))
    assert abs(loads["Cm"] / loads["CN"]) < 1e-3


def test_slender_wing_has_jones_lift_slope() -> None:
    # CL_alpha = pi AR/2 of any slender wing that is widest at its end
    ratios = []
    for ar in (0.2, 0.05):
        delta = LiftingSurface("delta", (SpanStation(0, 0, 0, 1.0), SpanStation(0.98, 0.25 * ar, 0, 0.02)))
        lattice = Lattice.of(delta, chordwise=20, spanwise=10)
        slope = lift(LatticeSolver(lattice, delta.reference((0.5, 0.0, 0.0)), INCOMPRESSIBLE), 0.01)[0] / 0.01
        span, area = delta.span, delta.area
        ratios.append(slope / (0.5 * math.pi * span**2 / area))
    assert abs(ratios[1] - 1.0) < abs(ratios[0] - 1.0)
    assert ratios[1] == pytest.approx(1.0, abs=0.01)


def elliptic(aspect_ratio: float, stations: int = 24) -> LiftingSurface:
    # straight quarter-chord line, span 2, chord c0 sin(theta)
    root = 8.0 / (math.pi * aspect_ratio)
    y = np.sin(np.linspace(0.0, 0.5 * math.pi - 0.02, stations))
    chords = root * np.sqrt(1.0 - y**2)
    return LiftingSurface("elliptic", tuple(SpanStation(-0.25 * c, v, 0.0, c) for v, c in zip(y, chords, strict=True)))


def test_elliptic_wing_of_high_aspect_ratio_is_that_of_lifting_line_theory() -> None:
    # lift slope a0 AR/(AR + 2); induced drag CL^2/(pi AR)
    aspect_ratio = 40.0
    wing = elliptic(aspect_ratio)
    solver = LatticeSolver(Lattice.of(wing, chordwise=3, spanwise=40), wing.reference((0.0, 0.0, 0.0)), INCOMPRESSIBLE)
    cl, cd = lift(solver, 0.02)
    ar = wing.span**2 / wing.area
    assert cl / 0.02 == pytest.approx(2.0 * math.pi * ar / (ar + 2.0), rel=0.01)
    assert cd == pytest.approx(cl**2 / (math.pi * ar), rel=0.005)


def test_elliptic_wing_of_high_aspect_ratio_has_the_roll_damping_of_lifting_line_theory() -> None:
    # y = cos(theta) b/2, c = 4 b/(pi AR) sin(theta), Gamma = 2 b V A2 sin(2 theta): Prandtl's equation,
    # 2 b A2 sin(2 theta) = (2 pi c/2) (pb/2V cos(theta) - 2 A2 sin(2 theta)/sin(theta)), has A2 = pb/2V / (AR + 4),
    # and Cl = -pi AR A2/4
    aspect_ratio = 100.0
    wing = elliptic(aspect_ratio)
    reference = wing.reference((0.0, 0.0, 0.0))
    solver = LatticeSolver(Lattice.of(wing, chordwise=3, spanwise=40), reference, INCOMPRESSIBLE)
    condition = FlightCondition(0.1)
    rate = 0.01 / reference.rate_scale(condition.speed)[0]
    damping = solver.steady(condition, Rates(p=rate))["Cl"] / 0.01
    ar = wing.span**2 / wing.area
    assert damping == pytest.approx(-math.pi * ar / (4.0 * (ar + 4.0)), rel=0.01)


def test_lift_converges_at_once_with_panels_across() -> None:
    slopes = [lift(rectangle(6.0, 3, n), 0.01)[0] for n in (6, 24)]
    assert slopes[0] == pytest.approx(slopes[1], rel=1e-3)


def test_prandtl_glauert_in_two_dimensions_and_refusal_beyond() -> None:
    wing = LiftingSurface.wing("wing", 4000.0, 1.0)
    solver = LatticeSolver(Lattice.of(wing, chordwise=3, spanwise=10), wing.reference((0.25, 0.0, 0.0)))
    slope = solver.steady(FlightCondition(0.6, alpha=0.01))["CN"] / 0.01
    assert slope == pytest.approx(2.0 * math.pi / 0.8, rel=3e-3)
    with pytest.raises(InputError, match="Mach number"):
        solver.steady(FlightCondition(0.8))


def test_goethert_rule_a_wing_at_mach_is_the_incompressible_one_of_reduced_aspect_ratio() -> None:
    loads = []
    for ar, mach, compressible in ((6.0, 0.6, True), (4.8, 0.1, False)):
        wing = LiftingSurface.wing("wing", ar, 1.0)
        settings = LatticeSettings(compressible=compressible)
        solver = LatticeSolver(Lattice.of(wing, chordwise=4, spanwise=12), wing.reference((0.25, 0.0, 0.0)), settings)
        loads.append(solver.steady(FlightCondition(mach, alpha=1e-4))["CN"] / 1e-4)
    # beta CL_alpha is a function of beta AR
    assert 0.8 * loads[0] == pytest.approx(loads[1], rel=1e-6)


def test_camber_gives_the_zero_lift_angle_of_thin_airfoil_theory() -> None:
    section = WingSection.naca("2412")
    wing = LiftingSurface.wing("wing", 5000.0, 1.0, sections=(section, section))
    solver = LatticeSolver(Lattice.of(wing, chordwise=40, spanwise=6), wing.reference((0.25, 0.0, 0.0)), INCOMPRESSIBLE)
    theta = (np.arange(4000) + 0.5) * math.pi / 4000
    slope = section.mean_line(0.5 * (1.0 - np.cos(theta)))[1]
    lift_at_zero = 2.0 * np.mean(slope * (np.cos(theta) - 1.0)) * math.pi
    # 2 pi times minus the zero-lift angle, (1/pi) integral of slope (cos theta - 1)
    assert solver.steady(FlightCondition(0.1))["CN"] == pytest.approx(lift_at_zero, rel=0.01)


def test_symmetric_and_antisymmetric_halves() -> None:
    wing = LiftingSurface.wing("wing", 8.0, 1.0, taper=0.5, sweep=0.3, dihedral=0.1)
    tail = LiftingSurface("fin", (SpanStation(6, 0, 0, 1), SpanStation(6.5, 0, 1.2, 0.6)), symmetric=False)
    solver = LatticeSolver(Lattice.of([wing, tail], chordwise=3, spanwise=8), wing.reference((0.5, 0.0, 0.0)))
    straight = solver.steady(FlightCondition(0.2, alpha=0.05), Rates(q=0.1)).coefficients
    assert np.max(np.abs(straight[[1, 3, 5]])) < 1e-12
    one = solver.steady(FlightCondition(0.2, alpha=0.05, beta=0.04), Rates(p=0.2, r=0.1)).coefficients
    two = solver.steady(FlightCondition(0.2, alpha=0.05, beta=-0.04), Rates(p=-0.2, r=-0.1)).coefficients
    assert np.allclose(one * [1, -1, 1, -1, 1, -1], two, atol=1e-12)
    assert one[1] < 0.0  # a side force against the sideslip


def test_moment_about_another_point_is_that_of_the_same_forces() -> None:
    wing = LiftingSurface.wing("wing", 6.0, 1.0, sweep=0.4)
    lattice = Lattice.of(wing, chordwise=3, spanwise=8)
    near, far = (LatticeSolver(lattice, wing.reference((x, 0.0, 0.0))) for x in (0.0, 2.0))
    condition = FlightCondition(0.2, alpha=0.06)
    one, two = near.steady(condition), far.steady(condition)
    length = near.reference.length
    assert two["Cm"] == pytest.approx(one["Cm"] + 2.0 / length * one["CN"], rel=1e-12)


def test_still_air_gives_no_load_and_keeps_circulation() -> None:
    wing = LiftingSurface.wing("wing", 4.0, 1.0)
    influence = Influence.of(Lattice.of(wing, chordwise=3, spanwise=5), 0.0, 0.0)
    at_rest = RigidMotion(np.zeros(3), np.zeros(3), np.zeros(3))
    moving = RigidMotion(np.array([-1.0, 0.0, 0.0]), np.zeros(3), np.zeros(3))
    # a plate edgewise through still air
    instant = steady_instant(influence, moving)
    circulation = instant.circulation()
    assert np.max(np.abs(circulation)) == 0.0
    march = March(influence, moving, circulation)
    for n, motion in enumerate((moving, at_rest, at_rest)):
        step = march.advance(0.3 * n, motion)
        march.accept(step.circulation())
        assert np.max(np.abs(step.loads(step.circulation()).force)) == 0.0


def test_kelvin_circulation_round_wing_and_wake_is_kept() -> None:
    # from no lift: none round wing and wake together, and what the panels say round the wing alone
    wing = LiftingSurface.wing("wing", 4.0, 1.0)
    lattice = Lattice.of(wing, chordwise=3, spanwise=4, span_spacing="equal")
    influence = Influence.of(lattice, 0.0, 0.0)
    along, turned = (RigidMotion(np.array([-1.0, 0.0, w]), np.zeros(3), np.zeros(3)) for w in (0.0, -0.1))
    settled = steady_instant(influence, along).circulation()
    march = March(influence, along, settled)
    for n in range(6):
        march.accept(march.advance(0.2 * n, turned).circulation())
    sheet = lattice.sheets[0]
    rings = cut(march.wakes[0], sheet.nodes[-1], sheet.last_chord)
    trailing = march.circulation[lattice.trailing]
    rings = replace(rings, strength=rings.strength + rings.share * trailing)
    strip = 5
    # the starting vortex is about 1.0 behind the trailing edge
    assert _round(influence, rings, march.circulation, 1.3, 1.6, strip) == pytest.approx(0.0, abs=1e-12)
    alone = _round(influence, rings, march.circulation, 0.5, 0.54, strip)
    assert alone == pytest.approx(trailing[strip], rel=1e-9)


def _round(
    influence: Influence, rings: Rings, circulation: np.ndarray, middle: float, radius: float, strip: int
) -> float:
    """Integral of v.dr round an ellipse in the middle of a strip, clockwise seen from the left: lift is positive."""
    theta = 2.0 * math.pi * np.arange(4000) / 4000
    y = influence.lattice.strips.quarter_chord[strip, 1]
    points = np.stack([middle + radius * np.cos(theta), np.full_like(theta, y), 0.6 * radius * np.sin(theta)], axis=1)
    bound = np.empty((3, len(points), influence.lattice.n_panels))
    ring_velocities(influence.lattice.corners, points, bound)
    velocity = bound @ circulation
    sheet_velocity(rings.nodes, rings.strength, rings.tail, rings.far, 0.0, np.ascontiguousarray(points.T), velocity)
    tangent = np.stack([-radius * np.sin(theta), 0.6 * radius * np.cos(theta)])
    return -float(np.mean(np.sum(velocity[[0, 2]] * tangent, axis=0)) * 2.0 * math.pi)


@pytest.mark.parametrize("kind", ["q", "r"])
def test_steady_turn_does_not_fly_into_its_own_wake(kind: str) -> None:
    # radius of 5 spans and less: a wake followed all round would come back to the wing
    wing = LiftingSurface.wing("wing", 10.0, 1.5, taper=0.5, sweep=0.4)
    lattice = Lattice.of(wing, chordwise=2, spanwise=6)
    solver = LatticeSolver(lattice, wing.reference((0.5, 0.0, 0.0)), INCOMPRESSIBLE)
    condition = FlightCondition(0.1, alpha=0.1)
    slopes = []
    for per_metre in (1e-4, 0.02, 0.03):
        rate = per_metre * condition.speed
        two, one = (solver.steady(condition, Rates(**{kind: sign * rate})).coefficients for sign in (1.0, -1.0))
        slopes.append((two - one) / (2.0 * per_metre))
    load = {"q": 2, "r": 3}[kind]
    assert [slope[load] / slopes[0][load] for slope in slopes[1:]] == pytest.approx([1.0, 1.0], abs=0.02)
