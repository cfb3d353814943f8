"""The grid-convergence index against numbers made to converge at a known order."""

import pytest

from indicial.errors import InputError
from indicial.studies.grid_convergence import FORMAL_ORDER, SAFETY, SAFETY_ELSEWHERE, grid_convergence


def made(limit: float, size: float, order: float, cells: tuple[int, ...]) -> list[float]:
    """``limit + size N^(-order/3)``."""
    return [limit + size * n ** (-order / 3.0) for n in cells]


@pytest.mark.parametrize("order", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("cells", [(8000, 27000, 91125), (9000, 25000, 83000)])
def test_the_order_is_found_also_with_unequal_ratios_and_the_index_is_the_error_times_the_safety_factor(order, cells):
    found = grid_convergence(made(-300.0, 5e3, order, cells), cells)
    assert found.order == pytest.approx(order, rel=1e-9)
    assert found.asymptotic
    assert found.index == pytest.approx(SAFETY * abs(found.value + 300.0), rel=1e-9)


def test_numbers_that_alternate_have_no_order_and_the_larger_safety_factor():
    found = grid_convergence([1.0, 1.2, 1.1], (1000, 8000, 64000))
    assert found.order is None
    assert not found.asymptotic
    assert found.index == pytest.approx(SAFETY_ELSEWHERE * 0.1 / (2.0**FORMAL_ORDER - 1.0))


def test_changes_that_grow_are_not_asymptotic():
    assert not grid_convergence([1.0, 1.1, 1.3], (1000, 8000, 64000)).asymptotic


def test_an_order_above_the_formal_one_is_not_credited():
    cells = (1000, 8000, 64000)
    found = grid_convergence(made(1.0, 1e3, 2.8, cells), cells)
    assert found.order == pytest.approx(2.8)
    assert found.index > SAFETY * abs(found.value - 1.0)


def test_meshes_that_do_not_become_finer_are_refused():
    with pytest.raises(InputError, match="coarsest to the finest"):
        grid_convergence([1.0, 1.1], (8000, 1000))
    with pytest.raises(InputError, match="two or three"):
        grid_convergence([1.0], (8000,))
