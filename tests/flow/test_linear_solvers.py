"""Linear solves with block-sparse matrices against dense algebra: real and complex, plain and transposed."""

import numpy as np
import pytest

from indicial.cfd.flow.grid import Grid
from indicial.cfd.march import BlockILU, KnownSolutions, Pattern, gmres
from indicial.cfd.mesh import box_mesh
from indicial.conventions import ReferenceQuantities
from indicial.errors import DivergenceError, InputError

REFERENCE = ReferenceQuantities(1.0, 1.0)
KINDS = pytest.mark.parametrize(
    ("matrix", "vector"),
    [(float, float), (float, complex), (complex, float), (complex, complex)],
    ids=["real matrix, real b", "real matrix, complex b", "complex matrix, real b", "complex matrix, complex b"],
)


def random(shape: tuple[int, ...], kind: type, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    values = rng.standard_normal(shape)
    return values + 1j * rng.standard_normal(shape) if kind is complex else values


def blocks_on(pattern: Pattern, kind: type) -> np.ndarray:
    """Random blocks with dominant diagonals."""
    blocks = random((len(pattern.indices), 5, 5), kind)
    blocks[pattern.diagonal] += 12.0 * np.eye(5)
    return blocks


def dense(pattern: Pattern, blocks: np.ndarray) -> np.ndarray:
    """The matrix of block-sparse rows."""
    n = len(pattern.diagonal)
    out = np.zeros((n, 5, n, 5), dtype=blocks.dtype)
    for i in range(n):
        for s in range(pattern.indptr[i], pattern.indptr[i + 1]):
            out[i, :, pattern.indices[s], :] = blocks[s]
    return out.reshape(5 * n, 5 * n)


def pattern_of(shape: tuple[int, int, int]) -> Pattern:
    return Pattern.of(Grid.from_mesh(box_mesh(shape, skew="none"), REFERENCE))


@KINDS
def test_ilu_inverts_a_row_of_cells_and_its_transpose(matrix: type, vector: type) -> None:
    """On one row of cells there is no fill to drop, so that M is the matrix, to the factors' single precision."""
    pattern = pattern_of((11, 1, 1))
    blocks = blocks_on(pattern, matrix)
    a = dense(pattern, blocks)
    ilu = BlockILU(pattern, blocks)
    x = random((11, 5), vector, seed=2)
    for solve, operator in ((ilu.solve, a), (ilu.solve_transposed, a.T)):
        found = solve((operator @ x.ravel()).reshape(x.shape))
        assert found.dtype == np.result_type(matrix, vector)
        assert found == pytest.approx(x, rel=1e-4, abs=1e-5)


@KINDS
def test_the_transposed_preconditioner_is_the_transpose_of_the_plain_one(matrix: type, vector: type) -> None:
    """``y.(M^-1 x) = (M^-T y).x`` where fill is dropped, too."""
    pattern = pattern_of((4, 3, 3))
    ilu = BlockILU(pattern, blocks_on(pattern, matrix))
    x, y = random((36, 5), vector, seed=2), random((36, 5), vector, seed=3)
    left, right = np.sum(y * ilu.solve(x)), np.sum(ilu.solve_transposed(y) * x)
    assert left == pytest.approx(right, rel=1e-12)


@KINDS
@pytest.mark.parametrize("shape", [(1, 1, 1), (4, 3, 3)], ids=["one cell", "many cells"])
def test_the_sweeps_are_dense_algebra_with_the_rounded_factors(
    shape: tuple[int, int, int], matrix: type, vector: type
) -> None:
    """To double precision: the factors are rounded, the sums are not, so that M^-1 is one linear operator."""
    grid = Grid.from_mesh(box_mesh(shape, skew="none"), REFERENCE)
    for pattern in (Pattern.of(grid), Pattern.wide(grid)):
        n, blocks = grid.n_cells, blocks_on(pattern, matrix)
        ilu = BlockILU(pattern, blocks)
        rounded = blocks.astype(np.complex64 if matrix is complex else np.float32).astype(matrix)
        factors = dense(pattern, rounded).reshape(n, 5, n, 5)
        lower, upper = np.eye(5 * n, dtype=matrix).reshape(n, 5, n, 5), np.zeros_like(factors)
        for i in range(n):
            lower[i, :, :i] = factors[i, :, :i]
            upper[i, :, i] = np.linalg.inv(factors[i, :, i])
            upper[i, :, i + 1 :] = factors[i, :, i + 1 :]
        m = lower.reshape(5 * n, 5 * n) @ upper.reshape(5 * n, 5 * n)
        b = random((n, 5), vector, seed=2)
        assert ilu.solve(b).ravel() == pytest.approx(np.linalg.solve(m, b.ravel()), rel=1e-11, abs=1e-13)
        assert ilu.solve_transposed(b).ravel() == pytest.approx(np.linalg.solve(m.T, b.ravel()), rel=1e-11, abs=1e-13)


@KINDS
@pytest.mark.parametrize("transposed", [False, True], ids=["plain", "transposed"])
def test_preconditioned_gmres_solves_what_dense_algebra_does(matrix: type, vector: type, transposed: bool) -> None:
    pattern = pattern_of((4, 3, 3))
    blocks = blocks_on(pattern, matrix)
    a = dense(pattern, blocks)
    a = a.T if transposed else a
    ilu = BlockILU(pattern, blocks)
    precondition = ilu.solve_transposed if transposed else ilu.solve
    b = random((36, 5), complex if matrix is complex else vector, seed=2)
    result = gmres(lambda x: (a @ x.ravel()).reshape(x.shape), precondition, b, 1e-11, restart=12, restarts=20)
    assert result.relative_residual <= 1e-11
    assert result.x.ravel() == pytest.approx(np.linalg.solve(a, b.ravel()), rel=1e-8, abs=1e-10)
    plain = gmres(lambda x: (a @ x.ravel()).reshape(x.shape), lambda x: x, b, 1e-11, restart=12, restarts=20)
    assert result.products < plain.products


def matrix_product(a: np.ndarray):  # type: ignore[no-untyped-def]
    return lambda x: a @ x


def test_gmres_from_a_start_solves_for_what_is_left() -> None:
    a = np.eye(30) * 4.0 + random((30, 30), complex) / 4.0
    x = random((30,), complex, seed=2)
    product = matrix_product(a)
    exact = gmres(product, lambda v: v, a @ x, 1e-9, start=x)
    assert exact.products == 1
    near = gmres(product, lambda v: v, a @ x, 1e-9, start=x * (1.0 + 1e-6))
    far = gmres(product, lambda v: v, a @ x, 1e-9)
    assert near.x == pytest.approx(x, rel=1e-7)
    assert near.products < far.products


def test_gmres_returns_the_least_residual_of_a_singular_system_and_says_so() -> None:
    """The part of b that no product reaches is left, and is what the residual says."""
    a = np.diag([1.0, 2.0, 3.0, 0.0])
    result = gmres(matrix_product(a), lambda v: v, np.array([1.0, 1.0, 1.0, 2.0]), 1e-10)
    assert result.relative_residual == pytest.approx(2.0 / np.sqrt(7.0))
    assert a @ result.x == pytest.approx([1.0, 1.0, 1.0, 0.0])
    zero = gmres(lambda v: 0.0 * v, lambda v: v, np.ones(4), 1e-10)
    assert zero.relative_residual == 1.0


def test_gmres_that_is_cut_short_says_how_far_it_came() -> None:
    a = np.roll(np.eye(40), 1, axis=0)  # a cyclic shift: nothing falls before the last vector
    b = np.eye(40)[0] + 0.1 * np.eye(40)[1]
    result = gmres(matrix_product(a), lambda v: v, b, 1e-10, restart=10, restarts=3)
    assert result.relative_residual > 0.1
    assert result.relative_residual == pytest.approx(np.linalg.norm(b - a @ result.x) / np.linalg.norm(b), rel=1e-12)


def test_the_residual_that_gmres_returns_is_that_of_its_solution() -> None:
    a = np.eye(60) * 4.0 + random((60, 60), complex) / 4.0
    b = random((60,), complex, seed=2)
    for tolerance in (1e-2, 1e-6, 1e-10):
        result = gmres(matrix_product(a), lambda v: v, b, tolerance, restart=15, restarts=10)
        left = np.linalg.norm(b - a @ result.x) / np.linalg.norm(b)
        assert result.relative_residual <= tolerance
        assert result.relative_residual == pytest.approx(left, rel=1e-3)


def test_what_is_not_finite_is_refused() -> None:
    b = np.ones(6)
    with pytest.raises(InputError, match="right-hand side"):
        gmres(lambda v: v, lambda v: v, np.where(np.arange(6) == 3, np.nan, b), 1e-6)
    with pytest.raises(InputError, match="first guess"):
        gmres(lambda v: v, lambda v: v, b, 1e-6, start=np.full(6, np.inf))
    with pytest.raises(DivergenceError, match="product"):
        gmres(lambda v: v * np.nan, lambda v: v, b, 1e-6)
    pattern = pattern_of((3, 1, 1))
    with pytest.raises(DivergenceError, match="cell 0"):
        BlockILU(pattern, np.zeros((len(pattern.indices), 5, 5)))


def shifted_systems() -> tuple[np.ndarray, np.ndarray]:
    """J and a diagonal E of 60 unknowns."""
    return np.eye(60) * 4.0 + random((60, 60), float) / 3.0, np.diag(np.linspace(0.5, 1.5, 60))


@pytest.mark.parametrize("shift", [0.0, 0.7, 0.4j], ids=["k = 0", "real shift", "imaginary shift"])
def test_a_guess_from_known_solutions_is_exact_for_what_they_combine_to(shift: complex) -> None:
    """Solutions found at any shift, and the conjugates of complex ones."""
    j, e = shifted_systems()
    known = KnownSolutions(lambda x: (e @ x.ravel()).reshape(x.shape))
    a = j + shift * e
    assert known.guess(random((12, 5), float)) is None
    found = [np.linalg.solve(j + s * e, random((60,), float, seed=n)) for n, s in enumerate([0.0, 0.3j, 1.0])]
    for x in found:
        known.add(x.reshape(12, 5), (j @ x).reshape(12, 5))
    assert len(known) == 4
    x = 2.0 * found[0] - 3.0 * np.conj(found[1]) + found[2]
    guess = known.guess((a @ x).reshape(12, 5), shift)
    assert guess is not None
    assert guess.ravel() == pytest.approx(x, rel=1e-9)


def test_known_solutions_spare_a_frequency_sweep_products_and_change_no_result() -> None:
    j, e = shifted_systems()
    b = random((12, 5), float, seed=3)
    known = KnownSolutions(lambda x: (e @ x.ravel()).reshape(x.shape))
    plain = spared = 0
    for omega in np.linspace(0.0, 2.0, 11):
        shift = 1j * omega
        a = j + shift * e

        def apply(x: np.ndarray, a: np.ndarray = a) -> np.ndarray:
            return (a @ x.ravel()).reshape(x.shape)

        without = gmres(apply, lambda x: x, b.astype(complex), 1e-9)
        result = gmres(apply, lambda x: x, b.astype(complex), 1e-9, start=known.guess(b.astype(complex), shift))
        known.add(result.x, b - shift * (e @ result.x.ravel()).reshape(b.shape))
        assert result.x.ravel() == pytest.approx(np.linalg.solve(a, b.ravel()), rel=1e-7, abs=1e-9)
        plain, spared = plain + without.products, spared + result.products
    assert spared < 0.75 * plain


def test_only_the_latest_solutions_are_kept() -> None:
    known = KnownSolutions(lambda x: x, most=3)
    for n in range(5):
        x = random((4, 5), complex, seed=n)
        known.add(x, 2.0 * x)
    assert len(known) == 3
    latest = random((4, 5), complex, seed=4)
    assert known.guess(2.0 * latest) == pytest.approx(latest)
