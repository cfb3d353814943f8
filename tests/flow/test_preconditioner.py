"""The preconditioner of hard solves: its blocks, its coarse level, and what it is worth."""

from functools import cache

import numpy as np
import pytest

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.flow.gas import STILL_AIR, conservative_jacobian
from indicial.cfd.flow.grid import Grid
from indicial.cfd.flow.jacobian import Jacobian
from indicial.cfd.flow.residual import MeshMotion, Residual
from indicial.cfd.march import BlockILU, Pattern, TwoLevel, converge, gmres
from indicial.cfd.march.aggregation import CoarseLevel, aggregates
from indicial.cfd.march.assembly import wide_blocks
from indicial.cfd.march.preconditioner import SECOND_ORDER_PARTS
from indicial.cfd.mesh import Mesh, airfoil_mesh, box_mesh, cone_mesh
from indicial.cfd.shapes import Airfoil, Cone
from indicial.conventions import Array, ReferenceQuantities

REFERENCE = ReferenceQuantities(1.0, 1.0, (0.3, 0.2, -0.1))
MOTION = MeshMotion(np.array([-1.2, 0.0, 0.1]), np.array([0.02, 0.05, -0.03]))
KINDS = {"x_min": "wall", "x_max": "outflow", "y_min": "symmetry", "z_max": "symmetry"}
SHIFT = 0.3 + 2.0j


@cache
def disturbed(second_order: bool = True) -> Jacobian:
    """The Jacobian about air disturbed at random in a skewed box with every kind of boundary."""
    grid = Grid.from_mesh(box_mesh((5, 4, 3), skew="random", kinds=KINDS), REFERENCE)
    noise = 0.1 * np.random.default_rng(1).uniform(-1.0, 1.0, (grid.n_cells, 5))
    q = STILL_AIR + noise * np.array([1.0, 1.0, 1.0, 1.0, 0.7])
    return Jacobian(Residual(grid, second_order=second_order), q, MOTION)


def random(shape: tuple[int, ...], kind: type = float, seed: int = 2) -> np.ndarray:
    rng = np.random.default_rng(seed)
    values = rng.standard_normal(shape)
    return values + 1j * rng.standard_normal(shape) if kind is complex else values


def product(pattern: Pattern, blocks: np.ndarray, x: np.ndarray) -> np.ndarray:
    rows = np.repeat(np.arange(len(pattern.diagonal)), np.diff(pattern.indptr))
    out = np.zeros(x.shape, np.result_type(blocks, x))
    np.add.at(out, rows, np.einsum("nij,nj->ni", blocks, x[pattern.indices]))
    return out


def dense(apply, n: int) -> np.ndarray:  # type: ignore[no-untyped-def]
    return np.stack([apply(e.reshape(n, 5)).ravel() for e in np.eye(5 * n)], axis=1)


@pytest.mark.parametrize("parity", [1.0, -1.0], ids=["symmetric", "antisymmetric"])
@pytest.mark.parametrize("second_order", [True, False], ids=["second order", "first order"])
def test_the_wide_blocks_are_the_exact_jacobian(second_order: bool, parity: float) -> None:
    jacobian = disturbed(second_order)
    pattern, x = Pattern.wide(jacobian.grid), random((jacobian.grid.n_cells, 5))
    exact = jacobian.apply(x, parity)
    found = product(pattern, wide_blocks(jacobian, pattern, parity=parity), x)
    assert found == pytest.approx(exact, abs=1e-13 * np.max(np.abs(exact)))


@pytest.mark.parametrize("parity", [1.0, -1.0], ids=["symmetric", "antisymmetric"])
def test_without_second_order_terms_the_wide_blocks_are_the_compact_ones(parity: float) -> None:
    jacobian = disturbed()
    extra = random((jacobian.grid.n_cells, 5, 5), complex)
    wide, compact = Pattern.wide(jacobian.grid), Pattern.of(jacobian.grid)
    x = random((jacobian.grid.n_cells, 5))
    blocks = jacobian.compact_blocks(extra, compact.slots, compact.diagonal, len(compact.indices), parity)
    expected = product(compact, blocks, x)
    found = product(wide, wide_blocks(jacobian, wide, extra, part=0.0, parity=parity), x)
    assert found == pytest.approx(expected, abs=1e-13 * np.max(np.abs(expected)))


def test_lumps_are_connected_pairs_of_pairs_of_about_equal_size() -> None:
    jacobian = disturbed()
    pattern = Pattern.wide(jacobian.grid)
    lump = aggregates(pattern, wide_blocks(jacobian, pattern), 12)
    sizes = np.bincount(lump)
    assert sizes.size <= 12
    assert sizes.min() >= 1
    assert sizes.max() <= 2 ** np.ceil(np.log2(60 / 12)) * 2


@pytest.mark.parametrize("kind", [float, complex])
@pytest.mark.parametrize("vector", [float, complex])
def test_the_coarse_level_solves_exactly_for_what_is_constant_on_its_lumps(kind: type, vector: type) -> None:
    """``P A_c^-1 P^T A (P z) = P z``, and the same of the transpose."""
    jacobian = disturbed()
    n = jacobian.grid.n_cells
    pattern = Pattern.wide(jacobian.grid)
    blocks = wide_blocks(jacobian, pattern, (SHIFT if kind is complex else 0.3) * np.tile(np.eye(5), (n, 1, 1)))
    coarse = CoarseLevel(pattern, blocks, 10)
    z = random((int(aggregates(pattern, blocks, 10).max()) + 1, 5), vector)
    smooth = coarse.spread(z)
    assert coarse.product(z) == pytest.approx(product(pattern, blocks, smooth), abs=1e-10)
    assert coarse.solve(coarse.restrict(coarse.product(z))) == pytest.approx(z, abs=1e-9)
    assert coarse.solve(coarse.product_transposed(smooth), transposed=True) == pytest.approx(z, abs=1e-9)


@pytest.mark.parametrize("vector", [float, complex])
@pytest.mark.parametrize("shift", [0.3, SHIFT], ids=["real", "complex"])
def test_the_transposed_preconditioner_is_the_transpose_of_the_plain_one(shift: complex, vector: type) -> None:
    jacobian = disturbed()
    n = jacobian.grid.n_cells
    two_level = TwoLevel(jacobian, Pattern.wide(jacobian.grid), shift * np.tile(np.eye(5), (n, 1, 1)))
    x, y = random((n, 5), vector), random((n, 5), vector, seed=3)
    assert np.sum(y * two_level.solve(x)) == pytest.approx(np.sum(two_level.solve_transposed(y) * x), rel=1e-10)


@pytest.mark.parametrize("parity", [1.0, -1.0], ids=["symmetric", "antisymmetric"])
@pytest.mark.parametrize("transposed", [False, True], ids=["plain", "transposed"])
@pytest.mark.parametrize("shift", [0.3, SHIFT], ids=["real", "complex"])
def test_shifted_systems_are_solved_as_by_dense_algebra(shift: complex, transposed: bool, parity: float) -> None:
    jacobian = disturbed()
    n = jacobian.grid.n_cells
    a = dense(lambda x: jacobian.apply(x, parity), n) + shift * np.eye(5 * n)
    a = a.T if transposed else a
    two_level = TwoLevel(jacobian, Pattern.wide(jacobian.grid), shift * np.tile(np.eye(5), (n, 1, 1)), parity=parity)
    precondition = two_level.solve_transposed if transposed else two_level.solve
    b = random((n, 5), type(shift))
    result = gmres(lambda x: (a @ x.ravel()).reshape(n, 5), precondition, b, 1e-10)
    assert result.relative_residual <= 1e-10
    assert result.x.ravel() == pytest.approx(np.linalg.solve(a, b.ravel()), rel=1e-6, abs=1e-8)


def steady_jacobian(mesh: Mesh, reference: ReferenceQuantities, mach: float) -> tuple[Jacobian, Array]:
    """J of a converged steady flow without incidence, and what a change of incidence does to the residual."""
    grid = FiniteVolumeSolver(mesh, reference).grid
    residual, motion = Residual(grid), MeshMotion(np.array([-mach, 0.0, 0.0]), np.zeros(3))
    q = converge(residual, Pattern.of(grid), motion, tolerance=1e-8).q
    tilted = MeshMotion(np.array([-mach, 0.0, 1e-6]), np.zeros(3))
    return Jacobian(residual, q, motion), (residual(q, tilted) - residual(q, motion)) / 1e-6


def products(jacobian: Jacobian, b: Array, mass: np.ndarray | None = None) -> tuple[int, int]:
    """Products with J to a residual of 1e-8 with the compact factors and with the wide two-level ones."""
    grid, compact = jacobian.grid, Pattern.of(jacobian.grid)
    extra = np.zeros((grid.n_cells, 5, 5)) if mass is None else mass

    def apply(x: np.ndarray) -> np.ndarray:
        return jacobian.apply(x) + np.einsum("nij,nj->ni", extra, x)

    ilu = BlockILU(compact, jacobian.compact_blocks(extra, compact.slots, compact.diagonal, len(compact.indices)))
    two_level = TwoLevel(jacobian, Pattern.wide(grid), extra)
    b = b.astype(extra.dtype)
    results = [gmres(apply, method.solve, b, 1e-8, restart=60, restarts=20) for method in (ilu, two_level)]
    assert results[1].relative_residual <= 1e-8
    left = np.linalg.norm(b - apply(results[1].x)) / np.linalg.norm(b)
    assert left <= 1.001e-8
    return results[0].products, results[1].products


def test_hard_solves_take_less_than_half_the_products_of_the_compact_factors() -> None:
    """Subsonic flow about an airfoil far from its boundary, whose pressure waves reach everywhere."""
    mesh = airfoil_mesh(Airfoil.naca("0012"), n_around=64, n_normal=32, farfield=100.0)
    jacobian, b = steady_jacobian(mesh, ReferenceQuantities(1.0, 1.0, (0.25, 0.0, 0.0)), 0.5)
    before, after = products(jacobian, b)
    assert after < before / 2


def test_waves_that_a_coarse_far_field_does_not_resolve_do_not_upset_the_factors() -> None:
    """At k = 0.01 a wave is 600 chords long, the cells 500 chords away are 50 chords long."""
    mesh = airfoil_mesh(Airfoil.naca("0012"), n_around=64, n_normal=32, farfield=500.0)
    jacobian, b = steady_jacobian(mesh, ReferenceQuantities(1.0, 1.0, (0.25, 0.0, 0.0)), 0.5)
    state = np.broadcast_to(STILL_AIR, (jacobian.grid.n_cells, 5))
    mass = 0.01j * jacobian.grid.volume[:, None, None] * conservative_jacobian(state)
    before, after = products(jacobian, b, mass)
    assert after < before / 2


def test_a_cone_at_supersonic_speed_takes_less_than_half_the_products_too() -> None:
    cone = Cone(10.0)
    mesh = cone_mesh(cone, 0.6, mach=2.0)
    jacobian, b = steady_jacobian(mesh, ReferenceQuantities(cone.length, cone.base_area), 2.0)
    before, after = products(jacobian, b)
    assert after < before / 2
    # and so at a frequency: i omega V dW/dq beside J, omega c/a = 0.2
    state = np.broadcast_to(STILL_AIR, (jacobian.grid.n_cells, 5))
    mass = 0.2j * jacobian.grid.volume[:, None, None] * conservative_jacobian(state)
    before, after = products(jacobian, b, mass)
    assert after < before / 2


def along(length: float) -> tuple[Jacobian, Array]:
    """J of a uniform stream at M 1.2 along cells so many times as long as they are wide, and a right-hand side."""
    kinds = {"x_max": "outflow", "y_min": "wall", "z_min": "wall"}
    grid = Grid.from_mesh(box_mesh((6, 12, 12), upper=(6.0 * length, 12.0, 12.0), kinds=kinds), REFERENCE)
    still = np.tile(STILL_AIR, (grid.n_cells, 1))
    return Jacobian(Residual(grid), still, MeshMotion(np.array([-1.2, 0.0, 0.0]), np.zeros(3))), random(still.shape)


def test_cells_a_hundred_times_longer_than_wide_do_not_upset_the_factors(monkeypatch: pytest.MonkeyPatch) -> None:
    """As in a wake far behind a sting: there the factors bear less of the second-order terms."""
    jacobian, b = along(100.0)
    pattern = Pattern.wide(jacobian.grid)
    found = TwoLevel(jacobian, pattern)
    assert found.part < SECOND_ORDER_PARTS[0]
    solution = gmres(jacobian.apply, found.solve, b, 1e-8, restart=160, restarts=1)
    assert solution.relative_residual <= 1e-8
    monkeypatch.setattr("indicial.cfd.march.preconditioner.SECOND_ORDER_PARTS", SECOND_ORDER_PARTS[:1])
    upset = gmres(jacobian.apply, TwoLevel(jacobian, pattern).solve, b, 1e-8, restart=2 * solution.products, restarts=1)
    assert upset.relative_residual > 1e-2


def test_where_the_factors_bear_them_most_second_order_terms_are_kept() -> None:
    jacobian, _ = along(1.0)
    assert TwoLevel(jacobian, Pattern.wide(jacobian.grid)).part == SECOND_ORDER_PARTS[0]
