"""Exact derivatives of the residual: complex step, transposes, inputs, loads, and halves of symmetric flows."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from indicial.cfd.flow import STILL_AIR, Grid, Jacobian, MeshMotion, Residual
from indicial.cfd.mesh import box_mesh, finned_body_mesh
from indicial.cfd.shapes import FinnedBody
from indicial.conventions import Array, ReferenceQuantities

REFERENCE = ReferenceQuantities(1.0, 1.0, (0.3, 0.2, 0.1))
KINDS = {
    "farfield": "farfield",
    "wall": "wall",
    "outflow": {"x_max": "outflow"},
    "symmetry": {"y_min": "symmetry", "y_max": "symmetry"},
    "all": {"x_min": "wall", "x_max": "outflow", "y_min": "symmetry", "z_max": "wall"},
}
STEP = 1e-30


def motion_for(kinds: str) -> MeshMotion:
    """No motion crosses a symmetry plane."""
    if kinds in ("symmetry", "all"):
        return MeshMotion(np.array([-2.0, 0.0, 0.5]), np.array([0.0, -0.5, 0.0]))
    return MeshMotion(np.array([-2.0, 0.3, 0.5]), np.array([0.3, -0.5, 0.2]))


def disturbed_air(grid: Grid, size: float) -> Array:
    rng = np.random.default_rng(1)
    q = STILL_AIR * (1.0 + size * rng.uniform(-1.0, 1.0, (grid.n_cells, 5)))
    q[:, 1:4] = 5.0 * size * rng.uniform(-1.0, 1.0, (grid.n_cells, 3))
    return q


def grid_of(kinds: str) -> Grid:
    return Grid.from_mesh(box_mesh((5, 4, 5), skew="random", kinds=KINDS[kinds]), REFERENCE)  # type: ignore[arg-type]


@pytest.mark.parametrize("kinds", KINDS)
@pytest.mark.parametrize("size", [0.1, 1e-3], ids=["far from converged", "nearly uniform"])
@pytest.mark.parametrize("second_order", [True, False])
def test_the_jacobian_is_the_complex_step_of_the_whole_residual(kinds: str, size: float, second_order: bool) -> None:
    grid, motion = grid_of(kinds), motion_for(kinds)
    residual = Residual(grid, second_order=second_order)
    q = disturbed_air(grid, size)
    x = np.random.default_rng(3).standard_normal(q.shape)
    exact = Residual(grid, second_order=second_order)(q + 1j * STEP * x, motion).imag / STEP
    assert np.max(np.abs(Jacobian(residual, q, motion).apply(x) - exact)) < 1e-12 * np.max(np.abs(exact))


@pytest.mark.parametrize("kinds", KINDS)
def test_the_input_matrices_are_the_complex_step_in_velocity_and_rate(kinds: str) -> None:
    grid, motion = grid_of(kinds), motion_for(kinds)
    q = disturbed_air(grid, 0.1)
    velocity, omega = Jacobian(Residual(grid), q, motion).inputs()
    residual = Residual(grid)
    for x in range(3):
        step = 1j * STEP * np.eye(3)[x]
        for found, moved in (
            (velocity, MeshMotion(motion.velocity + step, motion.omega)),
            (omega, MeshMotion(motion.velocity, motion.omega + step)),
        ):
            exact = residual(q, moved).imag / STEP
            assert np.max(np.abs(found[..., x] - exact)) < 1e-12 * np.max(np.abs(exact))


@pytest.mark.parametrize("parity", [1.0, -1.0])
@pytest.mark.parametrize("kinds", KINDS)
@pytest.mark.parametrize("second_order", [True, False])
def test_the_transpose_is_the_transpose(kinds: str, second_order: bool, parity: float) -> None:
    """y.(J x) = x.(J^T y) for complex x and y; and complex x goes as its two real parts."""
    grid, motion = grid_of(kinds), motion_for(kinds)
    jacobian = Jacobian(Residual(grid, second_order=second_order), disturbed_air(grid, 0.1), motion)
    rng = np.random.default_rng(4)
    x, y = (rng.standard_normal((grid.n_cells, 5)) + 1j * rng.standard_normal((grid.n_cells, 5)) for _ in range(2))
    ahead = jacobian.apply(x, parity)
    back = jacobian.apply_transposed(y, parity)
    assert np.sum(y * ahead) == pytest.approx(np.sum(x * back), rel=1e-12)
    apart = jacobian.apply(x.real.copy(), parity) + 1j * jacobian.apply(x.imag.copy(), parity)
    assert np.max(np.abs(ahead - apart)) < 1e-13 * np.max(np.abs(ahead))


@pytest.fixture(scope="module")
def halves() -> tuple[Grid, Grid, Array, Array]:
    """A finned body whole and cut, and which whole cell is each cut cell and its image."""
    body = FinnedBody.basic_finner()
    whole, half = (finned_body_mesh(body, 0.45, mach=2.0, sector=sector) for sector in ("full", "half"))  # type: ignore[arg-type]
    tree = cKDTree(whole.cell_centre)
    places = []
    for mirror in (1.0, -1.0):
        distance, place = tree.query(half.cell_centre * [1.0, mirror, 1.0])
        assert np.max(distance) < 1e-9
        places.append(place)
    reference = ReferenceQuantities(body.diameter, 1.0, (6.0 * body.diameter, 0.0, 0.0))
    return Grid.from_mesh(whole, reference), Grid.from_mesh(half, reference), places[0], places[1]


def unfold(x: Array, own: Array, image: Array, parity: float) -> Array:
    """The whole field of a cut one."""
    out = np.zeros((2 * len(x), 5))
    out[image] = parity * x * [1.0, 1.0, -1.0, 1.0, 1.0]
    out[own] = x
    return out


def test_half_a_body_has_the_residual_of_the_whole_one(halves: tuple[Grid, Grid, Array, Array]) -> None:
    whole, half, own, image = halves
    motion = MeshMotion(np.array([-2.0, 0.0, 0.1]), np.array([0.0, 0.05, 0.0]))
    q = disturbed_air(half, 0.05)
    cut = Residual(half)(q, motion)
    full = Residual(whole)(unfold(q, own, image, 1.0), motion)
    assert np.max(np.abs(full - unfold(cut, own, image, 1.0))) < 1e-12 * np.max(np.abs(cut))


@pytest.mark.parametrize("parity", [1.0, -1.0])
def test_half_a_body_has_the_derivatives_of_the_whole_one(
    halves: tuple[Grid, Grid, Array, Array], parity: float
) -> None:
    """Symmetric and antisymmetric disturbances of a symmetric flow, and the inputs that make them."""
    whole, half, own, image = halves
    motion = MeshMotion(np.array([-2.0, 0.0, 0.1]), np.array([0.0, 0.05, 0.0]))
    q = disturbed_air(half, 0.05)
    cut = Jacobian(Residual(half), q, motion)
    full = Jacobian(Residual(whole), unfold(q, own, image, 1.0), motion)
    x = np.random.default_rng(5).standard_normal(q.shape)
    found, exact = cut.apply(x, parity), full.apply(unfold(x, own, image, parity), 1.0)
    assert np.max(np.abs(exact - unfold(found, own, image, parity))) < 1e-11 * np.max(np.abs(exact))
    axes = {1.0: ((0, 0), (0, 2), (1, 1)), -1.0: ((0, 1), (1, 0), (1, 2))}
    for kind, axis in axes[parity]:
        part, entire = cut.inputs()[kind][..., axis], full.inputs()[kind][..., axis]
        assert np.max(np.abs(entire - unfold(part, own, image, parity))) < 1e-11 * np.max(np.abs(entire))
