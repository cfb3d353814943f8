"""NACA 0012 in subsonic flow: steady lift and drag, the step in alpha from its piston start to its wake-ruled end."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import airfoil_mesh
from indicial.cfd.shapes import Airfoil
from indicial.conventions import Array, ReferenceQuantities, mesh_from_body
from indicial.errors import NoLimitError
from indicial.methods import indicial_response
from indicial.methods.indicial_response import StepResponse
from indicial.motion import AlphaStep, FlightCondition
from theory.linear import wagner

Complex = NDArray[np.complex128]

SECTION = Airfoil.naca("0012")
REFERENCE = ReferenceQuantities(1.0, 1.0, (0.25, 0.0, 0.0))
CONDITION = FlightCondition(0.5)
BETA = np.sqrt(1.0 - CONDITION.mach**2)
AMPLITUDE = 1e-3
FINENESS = [pytest.param(64), pytest.param(128, marks=pytest.mark.slow)]
"""Cells round the section."""


@cache
def solver(around: int, section: Airfoil = SECTION) -> FiniteVolumeSolver:
    """Cells of aspect one on the wall, the far field 500 chords away: beyond the reach of the wake in any test."""
    mesh = airfoil_mesh(section, n_around=around, n_normal=around // 2, farfield=500.0)
    return FiniteVolumeSolver(mesh, REFERENCE)


def lift_slope(around: int) -> float:
    return solver(around).steady(replace(CONDITION, alpha=AMPLITUDE))["CN"] / AMPLITUDE


def contour(panels: int = 800) -> Complex:
    """Nodes round the section from the trailing edge, upper surface first, closed."""
    x = (1.0 + np.cos(np.linspace(0.0, np.pi, panels // 2 + 1))) / 2.0
    upper, lower = SECTION.surface(x, 1.0), SECTION.surface(x[::-1], -1.0)
    return np.concatenate([upper[:, 0] + 1j * upper[:, 1], (lower[:, 0] + 1j * lower[:, 1])[1:]])


def incompressible_lift_slope(nodes: Complex) -> float:
    """``8 pi R/c`` of a closed contour of unit chord with Kutta's condition, R the radius of the circle it maps to.

    R is the contour's logarithmic capacity: the density of unit total whose logarithmic potential is constant on it
    (Symm's equation, here by constant panels) has the potential ``ln R``. A plate has R = c/4.
    """
    start, step = nodes[:-1], np.diff(nodes)
    middle, length, panels = start + step / 2.0, np.abs(step), step.size
    # Gauss' rule on every panel, closed form where the point lies on the panel itself
    points, weights = np.polynomial.legendre.leggauss(8)
    inner = middle + step / 2.0 * points[:, None]
    potential = sum(w / 2.0 * np.log(np.abs(middle[:, None] - z)) for w, z in zip(weights, inner, strict=True))
    np.fill_diagonal(potential, np.log(length / 2.0) - 1.0)
    matrix = np.block([[potential * length, -np.ones((panels, 1))], [length[None, :], np.zeros((1, 1))]])
    return float(8.0 * np.pi * np.exp(np.linalg.solve(matrix, np.append(np.zeros(panels), 1.0))[-1]))


def compressible_lift_slope() -> float:
    """The incompressible one times Kaplan's second-order compressibility factor.

    C. Kaplan, NACA Report 834 (1946): ``mu + t/(1 + t) (mu (mu - 1) + (gamma + 1)/4 (mu^2 - 1)^2)``, for an
    ellipse of thickness t, mu = 1/beta.
    """
    mu, t = 1.0 / BETA, SECTION.thickness
    factor = mu + t / (1.0 + t) * (mu * (mu - 1.0) + 0.25 * 2.4 * (mu**2 - 1.0) ** 2)
    return float(factor * incompressible_lift_slope(contour()))


@cache
def alpha_response(around: int, section: Airfoil = SECTION) -> StepResponse:
    s = indicial_response.step_times(0.04, 1.12, 3.0, 100.0)
    flow = solver(around, section)
    history = indicial_response.run(flow, CONDITION, AMPLITUDE, s)
    return indicial_response.read(history, flow.steady(replace(CONDITION, alpha=AMPLITUDE)))


def about(response: StepResponse, shift: float) -> StepResponse:
    """The response with moments about a point `shift` chords further aft."""
    loads = response.response.copy()
    loads[:, 4] += shift * loads[:, 2]
    final = response.final | {"Cm": response.final["Cm"] + shift * response.final["CN"]}
    return replace(response, response=loads, final=final)


def aerodynamic_centre(response: StepResponse) -> float:
    """Where the steady moment does not change with alpha, chords aft of c/4."""
    return -response.final["Cm"] / response.final["CN"]


def piston_loads(flow: FiniteVolumeSolver, step: AlphaStep) -> tuple[float, float]:
    """CN and Cm of ``dp = rho a (step of u_g.n)``, rho and a of the converged flow on the wall, n into the gas.

    The wall's density follows from its pressure at the entropy of the cell on it.
    """
    field, mesh, mach = flow.field(step.condition), flow.mesh, step.condition.mach
    faces = field.wall_faces
    cells = mesh.owner[faces]
    pressure = 1.0 + 0.7 * mach**2 * field.wall_cp
    density = field.density[cells] * (pressure / field.pressure[cells]) ** (1.0 / 1.4)
    into_body = mesh.face_area[faces]
    jump = mesh_from_body(step.velocity(0.0) - step.velocity_before) / step.condition.speed_of_sound
    impedance = np.sqrt(density * pressure)
    force: Array = (impedance * -(into_body @ jump) / np.linalg.norm(into_body, axis=1))[:, None] * into_body
    arm = mesh.face_centre[faces] - np.asarray(REFERENCE.moment_reference)
    moment = np.cross(arm, force)[:, 1]
    return float(force[:, 2].sum() / (0.5 * mach**2)), float(moment.sum() / (0.5 * mach**2))


def test_a_symmetric_section_at_no_incidence_has_no_lift_nor_moment() -> None:
    """Down to the residual of the steady state, 1e-9."""
    loads = solver(64).steady(CONDITION)
    assert abs(loads["CN"]) < 1e-8
    assert abs(loads["Cm"]) < 1e-8


def test_drag_of_a_subcritical_flow_falls_to_zero_with_second_order() -> None:
    drag = {}
    for around in (32, 64, 96):
        mesh = airfoil_mesh(SECTION, n_around=around, n_normal=3 * around // 8, farfield=40.0)
        drag[around] = FiniteVolumeSolver(mesh, REFERENCE).steady(CONDITION)["CA"]
    order = np.log(drag[64] / drag[96]) / np.log(96 / 64)
    print(drag, np.log2(drag[32] / drag[64]), order)
    assert 0.0 < drag[96] < 0.008
    assert order > 1.8


def test_incompressible_lift_slope_of_an_ellipse_is_exact() -> None:
    """The oracle itself: an ellipse of thickness t maps to a circle of radius (1 + t)/4."""
    angle = np.linspace(0.0, 2.0 * np.pi, 401)
    for t in (0.06, 0.12, 0.5):
        found = incompressible_lift_slope(0.5 * np.cos(angle) + 0.5j * t * np.sin(angle))
        assert found == pytest.approx(2.0 * np.pi * (1.0 + t), rel=2e-4)


@pytest.mark.parametrize(
    ("around", "allowed"), [(64, 0.07), (96, 0.04), pytest.param(192, 0.015, marks=pytest.mark.slow)]
)
def test_lift_slope_tends_to_theory(around: int, allowed: float) -> None:
    found, wanted = lift_slope(around), compressible_lift_slope()
    print(around, found, wanted, found / wanted - 1.0)
    assert found == pytest.approx(wanted, rel=allowed)


@pytest.mark.parametrize("around", FINENESS)
def test_a_step_in_alpha_starts_at_the_piston_integral_over_the_steady_surface(around: int) -> None:
    """To the difference of a linear and an isentropic extrapolation to the wall, which falls with the cells."""
    step = AlphaStep(CONDITION, AMPLITUDE)
    lift, moment = piston_loads(solver(around), step)
    found, allowed = alpha_response(around), 0.2 / around
    print(found.initial("CN") * AMPLITUDE / lift - 1.0, found.initial("Cm") * AMPLITUDE / moment - 1.0)
    assert found.initial("CN") * AMPLITUDE == pytest.approx(lift, rel=allowed)
    assert found.initial("Cm") * AMPLITUDE == pytest.approx(moment, rel=allowed)
    # the air on the section is thinner than far away: less than the plate's 4/M
    assert 0.9 * 4.0 / CONDITION.mach < found.initial("CN") < 4.0 / CONDITION.mach


@pytest.mark.parametrize("around", FINENESS)
def test_a_step_in_alpha_ends_at_the_steady_slope_as_the_wake_leaves(around: int) -> None:
    """The deficiency tends to Wagner's ``1 - phi`` in time beta^2 s, in proportion to the lift that is shed.

    A shed vortex of the whole lift's circulation at distance Ut lowers the incidence by ``C(inf)/(2 pi beta s)``, so
    ``F/C(inf) -> C(inf) beta/(2 pi) (1 - phi(beta^2 s))``, Prandtl-Glauert's rule for a wake far away.
    """
    found = alpha_response(around)
    s = np.array([66.7, 80.0, 95.0])
    final = found.final["CN"]
    shed = final * BETA / (2.0 * np.pi)
    left = np.interp(s, found.s, found.deficiency("CN")) / final
    print(left / (shed * (1.0 - wagner(BETA**2 * s))) - 1.0)
    assert left == pytest.approx(shed * (1.0 - wagner(BETA**2 * s)), rel=0.05)
    assert np.all(left < 0.03)
    assert np.all(np.diff(found["CN"][found.s > 10.0]) > 0.0)


@pytest.mark.parametrize("around", FINENESS)
def test_lift_has_no_alphadot_derivative_and_moment_about_the_aerodynamic_centre_has_one(around: int) -> None:
    """Lift shed as 1/s acts at the aerodynamic centre: about it, and only about it, the deficiency has an area."""
    found = alpha_response(around)
    centre = aerodynamic_centre(found)
    result = indicial_response.derive(about(found, centre))
    print(centre, result.summary())
    assert "no limit" in result.refused["CN_alphadot"]
    with pytest.raises(NoLimitError, match="1/s"):
        result["CN_alphadot"]
    assert result["Cm_alphadot"] < 0.0
    assert result.uncertainties["Cm_alphadot"] < 0.1 * abs(result["Cm_alphadot"])


def test_about_the_quarter_chord_a_thick_section_keeps_the_lift_tail_times_the_arm() -> None:
    found = alpha_response(64)
    centre = aerodynamic_centre(found)
    late = found.s > 50.0
    assert 0.0 < centre < 0.02
    assert found.deficiency("Cm")[late] == pytest.approx(-centre * found.deficiency("CN")[late], rel=0.08)


@pytest.mark.slow
def test_moment_derivative_tends_to_that_of_a_plate_as_the_section_thins() -> None:
    """A plate has ``Cm_alphadot = -pi/(4 beta^3)`` about c/4.

    To first order in k, ``phi = psi exp(i mu x)`` with ``mu = k M^2/beta^2`` (half-chords) turns the subsonic plate
    into an incompressible one at ``k/beta^2`` under the downwash ``(1 - i mu x)/beta`` (Miles' reduction), whose moment
    about c/4 is ``-(i k pi/4)/beta^3``. Thickness takes off a part in proportion to itself.
    """
    found = []
    for digits in ("0003", "0006"):
        response = alpha_response(96, Airfoil.naca(digits))
        about_centre = about(response, aerodynamic_centre(response))
        found.append(indicial_response.derive(about_centre)["Cm_alphadot"])
    print(found, 2.0 * found[0] - found[1], -np.pi / (4.0 * BETA**3))
    assert 2.0 * found[0] - found[1] == pytest.approx(-np.pi / (4.0 * BETA**3), rel=0.05)
