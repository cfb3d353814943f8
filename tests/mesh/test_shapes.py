"""Shapes: closed forms against quadrature, and refusal of what cannot be."""

import numpy as np
import pytest
from scipy.integrate import quad

from indicial.cfd.shapes import Airfoil, Cone, FinnedBody, FinSet, Nose
from indicial.errors import InputError

FINNER = FinnedBody.basic_finner()


@pytest.mark.parametrize("nose", [Nose("cone", 2.8), Nose("tangent_ogive", 3.0), Nose("tangent_ogive", 0.5)])
def test_nose_volume_and_area_equal_their_integrals(nose):
    def radius(x):
        return float(nose.radius(x))

    assert nose.volume == pytest.approx(quad(lambda x: np.pi * radius(x) ** 2, 0, nose.length)[0], rel=1e-8)
    # Pappus: area as the limit of frusta
    x = nose.length * (1.0 - np.cos(np.linspace(0.0, np.pi, 20001))) / 2.0
    r = nose.radius(x)
    frusta = np.pi * np.sum((r[1:] + r[:-1]) * np.hypot(np.diff(x), np.diff(r)))
    assert nose.lateral_area == pytest.approx(frusta, rel=1e-6)
    assert radius(nose.length) == 0.5
    assert radius(-1.0) == 0.0


def test_ogive_is_tangent_to_the_cylinder_and_has_its_tip_angle():
    nose = Nose("tangent_ogive", 3.0)
    assert (0.5 - nose.radius(3.0 - 1e-4)) / 1e-4 < 1e-4
    assert np.arctan(nose.radius(1e-7) / 1e-7) == pytest.approx(nose.tip_half_angle, rel=1e-5)


def test_basic_finner_is_the_published_one():
    fins = FINNER.fins
    assert FINNER.nose.length == pytest.approx(2.836, abs=5e-4)
    assert np.rad2deg(FINNER.nose.tip_half_angle) == pytest.approx(10.0)
    assert (FINNER.length, FINNER.diameter, fins.number) == (10.0, 0.03, 4)
    assert (fins.root_leading_edge, fins.trailing_edge) == (9.0, 10.0)
    assert 2.0 * fins.half_thickness(1.0) * fins.chord(0.5) == pytest.approx(0.08)
    assert fins.half_thickness([0.0, 0.5]) == pytest.approx([0.0, 0.02])
    assert FINNER.fin_planform_area == pytest.approx(0.03**2)
    assert FINNER.base_area == pytest.approx(np.pi * 0.03**2 / 4)
    assert FINNER.reference(5.5).moment_reference[0] == pytest.approx(0.165)
    assert np.rad2deg(fins.angles) == pytest.approx([45.0, 135.0, 225.0, 315.0])


def test_trapezoidal_fin_has_the_area_and_edges_of_its_chords():
    fins = FinSet(3, 1.5, 0.7, 1.2, trailing_edge=8.0, section="plate", leading_edge_sweep_deg=30.0)
    assert fins.planform_area == pytest.approx(quad(lambda f: 1.2 * float(fins.chord(f)), 0, 1)[0])
    assert fins.leading_edge(1.0) - fins.leading_edge(0.0) == pytest.approx(1.2 * np.tan(np.radians(30.0)))


def test_cone_agrees_with_its_body():
    cone = Cone(12.0, 0.8)
    body = cone.body()
    assert body.body_volume == pytest.approx(cone.volume)
    assert body.lateral_area == pytest.approx(cone.lateral_area)
    assert body.base_area == pytest.approx(cone.base_area)
    assert body.length * body.diameter == pytest.approx(0.8)


def test_naca_0012_has_its_published_ordinates():
    open_ended = Airfoil.naca("0012", closed_trailing_edge=False)
    # Abbott and von Doenhoff, appendix III: x, y in per cent of the chord
    x = np.array([1.25, 5.0, 10.0, 30.0, 50.0, 80.0, 100.0]) / 100.0
    y = np.array([1.894, 3.555, 4.683, 6.002, 5.294, 2.623, 0.126]) / 100.0
    assert open_ended.half_thickness(x) == pytest.approx(y, abs=5e-6)
    assert open_ended.nose_radius == pytest.approx(0.0158, abs=1e-4)


def test_closed_airfoil_ends_in_a_point_with_its_angle():
    airfoil = Airfoil.naca("2412")
    assert airfoil.half_thickness(1.0) == pytest.approx(0.0, abs=1e-15)
    upper, lower = (airfoil.surface(1.0 - 1e-7, side) - airfoil.surface(1.0, side) for side in (1.0, -1.0))
    angle = np.arctan2(lower[1], lower[0]) - np.arctan2(upper[1], upper[0])
    assert angle % (2 * np.pi) == pytest.approx(airfoil.trailing_edge_angle, rel=1e-5)


def test_airfoil_area_equals_its_integral():
    airfoil = Airfoil(0.15)
    assert airfoil.area == pytest.approx(quad(lambda x: 2 * float(airfoil.half_thickness(x)), 0, 1)[0], rel=1e-8)


def test_camber_line_of_2412_has_its_crest_at_two_per_cent_and_four_tenths():
    z, slope = Airfoil.naca("2412").camber_line(np.array([0.0, 0.4, 1.0]))
    assert z == pytest.approx([0.0, 0.02, 0.0], abs=1e-15)
    assert slope[1] == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Nose("blunt", 1.0), "Nose.type is 'blunt', must be 'cone' or 'tangent_ogive'"),
        (lambda: Nose("tangent_ogive", 0.4), "Nose.length is 0.4, must be at least 0.5"),
        (lambda: FinnedBody(-0.03, Nose("cone", 3.0), 10.0), "FinnedBody.diameter is -0.03, must be positive"),
        (lambda: FinnedBody(0.03, Nose("cone", 3.0), 2.0), "FinnedBody.length is 2.0, must be at least"),
        (lambda: FinnedBody(0.03, Nose("cone", 9.5), 10.0, FINNER.fins), "behind the nose"),
        (lambda: FinnedBody(0.03, Nose("cone", 3.0), 9.5, FINNER.fins), "within 9.5 calibres"),
        (lambda: FinSet(0, 1.0, 1.0, 1.0, 10.0, "plate"), "FinSet.number is 0, must be from 1 to 16"),
        (lambda: FinSet(4, 1.0, 0.0, 1.0, 10.0, "plate"), "FinSet.tip_chord is 0.0, must be positive"),
        (lambda: FinSet(4, 1.0, 1.0, 1.0, 10.0, "round"), "one of single_wedge, double_wedge, plate"),
        (lambda: FinSet(4, 1.0, 1.0, 1.0, 10.0, "single_wedge"), "FinSet.thickness_ratio is 0.0, must be above 0"),
        (lambda: FinSet(4, 1.0, 1.0, 1.0, 10.0, "plate", 0.1), "must be 0 for a plate"),
        (lambda: FinSet(4, 1.0, 1.0, 1.0, 10.0, "plate", 0.0, 85.0), "leading_edge_sweep_deg is 85.0"),
        (lambda: Cone(70.0), "Cone.half_angle_deg is 70.0"),
        (lambda: Airfoil(0.5), "Airfoil.thickness is 0.5"),
        (lambda: Airfoil.naca("12"), "must be four digits"),
        (lambda: Airfoil.naca("2012"), "must both be zero"),
    ],
)
def test_impossible_shapes_are_named(call, message):
    with pytest.raises(InputError, match=message.replace("(", r"\(")):
        call()
