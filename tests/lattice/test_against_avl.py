"""Wing, tail and fin against AVL 3.40, another vortex lattice (Drela & Youngren), run on the same surfaces.

AVL's numbers are of OptVL 2.5.0, 8 panels along each chord, 32, 16 and 16 across, cosine spacing, flat sections,
Mach 0, body axes. Its wake leaves along the body's x axis, ours along the stream: derivatives are compared at no
incidence.
"""

import math

import numpy as np
import pytest

from indicial.cfd.lattice import Lattice, LatticeSettings, LatticeSolver
from indicial.cfd.shapes import LiftingSurface, SpanStation
from indicial.conventions import COEFFICIENTS
from indicial.motion import FlightCondition, Rates

AVL = {
    "alpha": {"CN": 4.71008, "Cm": -2.16789},
    "beta": {"CY": -0.271826, "Cl": -0.110496, "Cn": 0.134624},
    "p": {"CY": -0.186912, "Cl": -0.441010, "Cn": 0.0304692},
    "q": {"CN": 10.75841, "Cm": -21.44632},
    "r": {"CY": 0.310255, "Cl": 0.0638515, "Cn": -0.169502},
}
AVL_AT_FOUR_DEGREES = {"CN": 0.328228, "Cm": -0.152074}


@pytest.fixture(scope="module")
def glider() -> LatticeSolver:
    wing = LiftingSurface.wing("wing", 6.0, 1.2, taper=0.5, sweep=math.radians(25.0), dihedral=math.radians(6.0))
    tail = LiftingSurface.wing("tail", 2.0, 0.6, taper=0.8, root_leading_edge=(4.0, 0.5))
    fin = LiftingSurface("fin", (SpanStation(3.8, 0.0, 0.6, 0.8), SpanStation(4.2, 0.0, 1.6, 0.4)), symmetric=False)
    lattice = Lattice.of([wing, tail, fin], chordwise=6, spanwise={"wing": 14, "tail": 7, "fin": 7})
    return LatticeSolver(lattice, wing.reference((0.8, 0.0, 0.1)), LatticeSettings(compressible=False))


def loads(solver: LatticeSolver, name: str, size: float) -> np.ndarray:
    angles = {name: size} if name in ("alpha", "beta") else {}
    condition = FlightCondition(0.1, **angles)
    lengths = dict(zip("pqr", solver.reference.moment_lengths, strict=True))
    rates = {} if angles else {name: size * 2.0 * condition.speed / float(lengths[name])}
    found = solver.steady(condition, Rates(**rates))
    return np.array([found[c] for c in COEFFICIENTS])


@pytest.mark.parametrize("motion", list(AVL))
def test_derivatives_of_wing_tail_and_fin_are_avl_s(glider: LatticeSolver, motion: str) -> None:
    """Within 1% of the largest derivative of each load, with cross derivatives and signs."""
    size = 5e-3
    slopes = (loads(glider, motion, size) - loads(glider, motion, -size)) / (2.0 * size)
    largest = {c: max(abs(row.get(c, 0.0)) for row in AVL.values()) for c in COEFFICIENTS}
    for name, value in zip(COEFFICIENTS[1:], slopes[1:], strict=True):
        assert value == pytest.approx(AVL[motion].get(name, 0.0), abs=0.01 * largest[name]), name


def test_loads_at_four_degrees_are_avl_s(glider: LatticeSolver) -> None:
    found = dict(zip(COEFFICIENTS, loads(glider, "alpha", math.radians(4.0)), strict=True))
    assert found["CN"] == pytest.approx(AVL_AT_FOUR_DEGREES["CN"], rel=0.005)
    assert found["Cm"] == pytest.approx(AVL_AT_FOUR_DEGREES["Cm"], rel=0.02)  # the tail in a wake that is elsewhere
