"""Still air, conservation, exactness for linear fields, and the Jacobian."""

import numpy as np
import pytest

from indicial.cfd.flow import STILL_AIR, Grid, Jacobian, MeshMotion, Residual
from indicial.cfd.flow.residual import gradients
from indicial.cfd.march import BlockILU, Pattern, gmres
from indicial.cfd.mesh import Mesh, box_mesh
from indicial.conventions import ReferenceQuantities

REFERENCE = ReferenceQuantities(1.0, 1.0, (0.3, 0.2, 0.1))
MOTION = MeshMotion(np.array([-2.0, 0.3, 0.5]), np.array([0.3, -0.5, 0.2]))
ALL_KINDS = {"x_min": "wall", "x_max": "outflow", "y_min": "symmetry", "y_max": "wall"}


def disturbed_air(grid: Grid, size: float, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    q = STILL_AIR * (1.0 + size * rng.uniform(-1.0, 1.0, (grid.n_cells, 5)))
    q[:, 1:4] = 5.0 * size * rng.uniform(-1.0, 1.0, (grid.n_cells, 3))
    return q


@pytest.fixture(scope="module")
def skewed() -> Mesh:
    return box_mesh((6, 5, 7), skew="random")


@pytest.mark.parametrize("second_order", [True, False])
@pytest.mark.parametrize("seed", range(3))
def test_still_air_stays_still_to_round_off_under_any_motion_on_a_skewed_mesh(
    skewed: Mesh, seed: int, second_order: bool
) -> None:
    grid = Grid.from_mesh(skewed, REFERENCE)
    rng = np.random.default_rng(seed)
    motion = MeshMotion(3.0 * rng.standard_normal(3), 3.0 * rng.standard_normal(3))
    still = np.tile(STILL_AIR, (grid.n_cells, 1))
    r = Residual(grid, second_order=second_order)(still, motion)
    assert np.max(np.abs(r)) < 1e-14


def test_what_leaves_a_cell_enters_its_neighbour(skewed: Mesh) -> None:
    """The sum of the residual over all cells is the flux through the boundary (and the turning of momentum)."""
    grid = Grid.from_mesh(skewed, REFERENCE)
    residual = Residual(grid)
    q = disturbed_air(grid, 0.1)
    total = residual(q, MOTION).sum(axis=0)
    momentum = np.sum((grid.volume * q[:, 0])[:, None] * q[:, 1:4], axis=0)
    expected = residual.face_flux[grid.n_interior :].sum(axis=0)
    expected[1:4] += np.cross(MOTION.omega, momentum)
    assert total == pytest.approx(expected, abs=1e-13)


def test_a_wall_lets_no_mass_pass_and_does_the_work_of_its_motion() -> None:
    mesh = box_mesh((4, 4, 4), skew="random", kinds="wall")
    grid = Grid.from_mesh(mesh, REFERENCE)
    residual = Residual(grid)
    r = residual(disturbed_air(grid, 0.1), MOTION).sum(axis=0)
    assert abs(r[0]) < 1e-14
    faces = np.arange(grid.n_interior, len(grid.owner))
    swept = grid.normal @ MOTION.velocity + (grid.moment @ MOTION.omega) / grid.area
    pressure = np.sum(residual.face_flux[faces, 1:4] * grid.normal[faces], axis=1)
    assert r[4] == pytest.approx(np.sum(pressure * swept[faces]), rel=1e-12)


def test_gradients_of_linear_fields_are_exact_on_a_skewed_mesh(skewed: Mesh) -> None:
    grid = Grid.from_mesh(skewed, REFERENCE)
    slope = np.random.default_rng(2).standard_normal((5, 3))
    q = 1.0 + skewed.cell_centre @ slope.T
    out = np.empty((grid.n_cells, 5, 3))
    gradients(q, grid.offsets, grid.faces, grid.cells, grid.weights, grid.normal, 1.0, out)
    assert np.max(np.abs(out - slope)) < 1e-11


def test_the_compact_blocks_are_the_first_order_jacobian_and_ilu_solves_a_downstream_chain_exactly() -> None:
    """On one row of cells ILU(0) has no fill to drop, so it is a direct solver (to its single precision)."""
    mesh = box_mesh((12, 1, 1), skew="none", kinds=ALL_KINDS)  # type: ignore[arg-type]
    grid = Grid.from_mesh(mesh, REFERENCE)
    residual = Residual(grid, second_order=False)
    q = disturbed_air(grid, 0.05)
    jacobian = Jacobian(residual, q, MOTION)
    pattern = Pattern.of(grid)
    extra = np.broadcast_to(0.1 * np.eye(5), (grid.n_cells, 5, 5)).copy()
    ilu = BlockILU(pattern, jacobian.compact_blocks(extra, pattern.slots, pattern.diagonal, len(pattern.indices)))
    x = np.random.default_rng(4).standard_normal(q.shape)
    assert ilu.solve(jacobian.apply(x) + 0.1 * x) == pytest.approx(x, abs=2e-4)


def test_gmres_solves_a_random_system_to_its_tolerance() -> None:
    rng = np.random.default_rng(5)
    a = np.eye(60) * 4.0 + rng.standard_normal((60, 60)) / 4.0
    b = rng.standard_normal((12, 5))
    result = gmres(lambda x: (a @ x.ravel()).reshape(x.shape), lambda x: x, b, 1e-10, restart=20, restarts=10)
    left = np.linalg.norm((a @ result.x.ravel()).reshape(b.shape) - b) / np.linalg.norm(b)
    assert left < 1e-10
    assert left == pytest.approx(result.relative_residual, rel=0.5)


def test_a_single_cell_has_no_interior_faces_and_a_residual() -> None:
    grid = Grid.from_mesh(box_mesh((1, 1, 1)), REFERENCE)
    assert np.max(np.abs(Residual(grid)(np.tile(STILL_AIR, (1, 1)), MOTION))) < 1e-14


def test_the_residual_is_the_same_for_one_and_two_threads() -> None:
    import numba

    mesh = box_mesh((12, 10, 11), skew="random")
    grid = Grid.from_mesh(mesh, REFERENCE)
    residual, q = Residual(grid), disturbed_air(Grid.from_mesh(mesh, REFERENCE), 0.1)
    before = numba.get_num_threads()
    try:
        results = []
        for threads in sorted({1, min(2, numba.config.NUMBA_NUM_THREADS)}):
            numba.set_num_threads(threads)
            results.append(residual(q, MOTION))
    finally:
        numba.set_num_threads(before)
    assert all(np.array_equal(results[0], r) for r in results)
