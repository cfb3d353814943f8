import math

import numpy as np
import pytest

from indicial.cfd.lattice import Lattice, LatticeSolver
from indicial.cfd.shapes import Airfoil, LiftingSurface, SpanStation, WingSection
from indicial.errors import InputError
from indicial.motion import FlightCondition, TabulatedMotion


def test_five_digit_mean_line_has_its_design_camber() -> None:
    # largest camber of the 230 line is 1.84% at 15% of the chord (Abbott and von Doenhoff), of the 430 line twice that
    line = WingSection.naca("23012")
    x = np.linspace(0.0, 1.0, 2001)
    camber, slope = line.mean_line(x)
    assert np.max(camber) == pytest.approx(0.0184, abs=5e-5)
    assert x[np.argmax(camber)] == pytest.approx(0.15, abs=0.005)
    doubled, _ = WingSection.naca("43018").mean_line(x)
    assert np.allclose(doubled, 2.0 * camber, atol=1e-9)
    assert np.allclose(np.gradient(camber, x)[1:-1], slope[1:-1], atol=2e-3)


def test_section_read_from_its_own_coordinates_is_the_same() -> None:
    airfoil = Airfoil.naca("0015")
    x = 0.5 * (1.0 - np.cos(np.linspace(0.0, np.pi, 81)))
    loop = np.concatenate([airfoil.surface(x, 1.0)[::-1], airfoil.surface(x, -1.0)[1:]])
    section = WingSection.from_coordinates("mine", loop)
    assert np.max(np.abs(section.camber)) < 1e-12
    assert np.allclose(section.half_thickness, airfoil.half_thickness(section.x), atol=2e-4)


@pytest.mark.parametrize("digits", ["23112", "43000", "03012", "26012", "12", "abcde"])
def test_unknown_sections_are_refused(digits: str) -> None:
    with pytest.raises(InputError, match=r"NACA section|Airfoil"):
        WingSection.naca(digits)


def test_surfaces_that_cross_themselves_are_refused() -> None:
    places = [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, -1.0)]
    with pytest.raises(InputError, match="crosses itself"):
        LiftingSurface("box", tuple(SpanStation(0.0, y, z, 1.0) for y, z in places), symmetric=False)
    with pytest.raises(InputError, match="folds back"):
        LiftingSurface("fold", tuple(SpanStation(0.0, y, 0.0, 1.0) for y in (0.0, 2.0, 1.0)), symmetric=False)


def test_bad_stations_are_named() -> None:
    with pytest.raises(InputError, match=r"SpanStation\.chord"):
        SpanStation(0.0, 0.0, 0.0, -1.0)
    with pytest.raises(InputError, match="same y and z"):
        LiftingSurface("wing", (SpanStation(0.0, 0.0, 0.0, 1.0), SpanStation(1.0, 0.0, 0.0, 1.0)))
    with pytest.raises(InputError, match="symmetric"):
        LiftingSurface("wing", (SpanStation(0.0, 0.0, 0.0, 1.0), SpanStation(0.0, -1.0, 0.0, 1.0)))
    wing = LiftingSurface.wing("wing", 6.0, 1.0)
    with pytest.raises(InputError, match="names of their own"):
        Lattice.of([wing, wing])
    with pytest.raises(InputError, match="spanwise"):
        Lattice.of(wing, spanwise={"tail": 4})


def test_lattice_halves_are_mirror_images_and_have_the_area() -> None:
    wing = LiftingSurface.wing(
        "wing", 10.0, 2.0, taper=0.4, sweep=0.3, dihedral=math.radians(5.0), washout=0.05,
        sections=(WingSection.naca("43018"), WingSection.naca("43012")),
    )  # fmt: skip
    lattice = Lattice.of(wing, chordwise=5, spanwise=9)
    normal = lattice.normal.reshape(5, 18, 3)
    assert np.array_equal(normal[:, ::-1] * [1.0, -1.0, 1.0], normal)
    assert np.all(normal[..., 2] > 0.5)
    assert np.sum(lattice.strips.area) == pytest.approx(wing.area, rel=5e-3)
    assert np.all(np.sum(lattice.ring_area * lattice.normal, axis=1) > 0.0)


def test_cuts_fall_on_every_station() -> None:
    stations = tuple(SpanStation(0.0, y, 0.0, 1.0) for y in (0.0, 1.3, 1.9, 4.0))
    lattice = Lattice.of(LiftingSurface("wing", stations), spanwise=8)
    cuts = lattice.sheets[0].nodes[0, 8:, 1]
    assert {1.3, 1.9, 4.0} <= {round(float(y), 12) for y in cuts}


def test_lofted_mean_surface_has_the_camber_and_twist_asked_for() -> None:
    wing = LiftingSurface.wing(
        "wing", 8.0, 1.5, incidence=0.1, sections=(WingSection.naca("2412"), WingSection.naca("2412"))
    )
    nodes = Lattice.of(wing, chordwise=8, spanwise=4).sheets[0].nodes[:, 2]
    local = nodes - [0.375, nodes[0, 1], 0.0]
    along = local[:, 0] * math.cos(0.1) - local[:, 2] * math.sin(0.1)
    across = local[:, 0] * math.sin(0.1) + local[:, 2] * math.cos(0.1)
    assert np.allclose(across / 1.5, Airfoil.naca("2412").camber_line(along / 1.5 + 0.25)[0], atol=1e-5)


def test_surfaces_that_cross_or_cover_one_another_are_refused() -> None:
    wing = LiftingSurface.wing("wing", 6.0, 1.0)
    for top in (0.5, 0.7):
        ends = (SpanStation(0.2, 1.1, -0.5, 0.5), SpanStation(0.2, 1.3, top, 0.5))
        with pytest.raises(InputError, match="cross one another"):
            Lattice.of([wing, LiftingSurface("leaning", ends, symmetric=False)])
    with pytest.raises(InputError, match="lie on one another"):
        Lattice.of([wing, LiftingSurface.wing("twin", 6.0, 1.0)])
    # a fin that ends on the middle of a tailplane, and one beside it
    fin = LiftingSurface("fin", (SpanStation(0.0, 0.0, 0.0, 1.0), SpanStation(0.3, 0.0, 1.0, 0.7)), symmetric=False)
    assert Lattice.of([wing, fin]).n_panels > 0


def test_wing_that_starts_from_rest_has_no_load_before() -> None:
    wing = LiftingSurface.wing("wing", 4.0, 1.0)
    solver = LatticeSolver(Lattice.of(wing, chordwise=2, spanwise=4), wing.reference((0.25, 0.0, 0.0)))
    condition = FlightCondition(0.1, alpha=0.1)
    t = np.array([0.0, 0.01, 0.02])
    motion = TabulatedMotion(t, np.outer(t / 0.02, condition.velocity), np.zeros((3, 3)))
    history = solver.unsteady(condition, motion, t)
    assert np.array_equal(history.before, np.zeros(6))
    assert history["CN"][-1] > 0.0
