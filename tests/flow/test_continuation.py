"""The rules of the pseudo-time continuation, on equations with known solutions."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from indicial.cfd.march.continuation import Standing, continuation
from indicial.cfd.march.convergence import ConvergenceHistory, Recorder
from indicial.errors import DivergenceError, InputError

CELLS = 3
ROOT = np.arange(1.0, 1.0 + 5 * CELLS).reshape(CELLS, 5)


@dataclass
class Linearised:
    """``F'(q) + 1/cfl``, all diagonal, with an inverse that may be spoilt."""

    diagonal: np.ndarray
    inverse: np.ndarray
    products: int = 0

    def apply(self, x: np.ndarray) -> np.ndarray:
        self.products += 1
        return self.diagonal * x

    def precondition(self, b: np.ndarray) -> np.ndarray:
        return self.inverse * b


@dataclass
class Powers:
    """``F = q^n - ROOT^n``: linear for n = 1; `spoilt` steps, of no use, come first."""

    power: int = 1
    spoilt: int = 0
    singular: int = 0
    floor: float = 0.0
    tried: list[float] = field(default_factory=list)
    name = "trial"
    advice = "another one"
    residual: Any = field(
        default_factory=lambda: SimpleNamespace(second_order=True, grid=SimpleNamespace(volume=np.ones(CELLS)))
    )

    def __call__(self, q: np.ndarray) -> np.ndarray:
        return q**self.power - ROOT**self.power

    def round_off(self) -> float:
        return self.floor

    def linearise(self, q: np.ndarray, cfl: float) -> Linearised:
        self.tried.append(cfl)
        if len(self.tried) <= self.singular:
            raise DivergenceError("singular")
        diagonal = self.power * q ** (self.power - 1) + 1.0 / cfl
        spoilt = len(self.tried) <= self.singular + self.spoilt
        return Linearised(diagonal, np.full_like(q, np.nan) if spoilt else 1.0 / diagonal)

    def update(self, q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        return q + dq


def solved(
    equations: Powers, start: np.ndarray = ROOT + 1.0, tolerance: float = 1e-12, cfl: float = 10.0, iterations: int = 50
) -> tuple[np.ndarray, ConvergenceHistory]:
    record = Recorder()
    q = continuation(equations, Standing(start, cfl, iterations), scale=1.0, tolerance=tolerance, record=record)
    return q, record.history(equations.floor)


@pytest.mark.parametrize("power", [1, 2, 3])
def test_it_ends_at_the_root_with_steps_that_have_become_newtons(power: int) -> None:
    q, history = solved(Powers(power))
    assert q == pytest.approx(ROOT, rel=1e-11)
    assert np.all(np.diff(history.cfl[1:]) > 0.0)
    assert history.products[-1] >= history.steps


def test_a_residual_of_exactly_zero_is_an_end() -> None:
    _, history = solved(Powers(), start=ROOT.copy())
    assert history.steps == 0
    exact = Powers()
    exact.update = lambda q, dq: ROOT.copy()  # type: ignore[method-assign]
    _, history = solved(exact)
    assert history.steps == 1


def test_it_ends_where_round_off_leaves_more_than_is_wanted() -> None:
    _, history = solved(Powers(2, floor=1e-3), tolerance=1e-15)
    assert 1e-15 < history.residual[-1] <= 1e-3 < history.residual[-2]


@pytest.mark.parametrize("failure", ["singular", "spoilt"])
def test_equations_that_cannot_be_solved_cut_the_step_by_ten(failure: str) -> None:
    equations = Powers(2, **{failure: 2})  # type: ignore[arg-type]
    q, history = solved(equations)
    assert equations.tried[:3] == pytest.approx([10.0, 1.0, 0.1])
    assert q == pytest.approx(ROOT, rel=1e-11)
    assert history.steps == len(equations.tried) - 2


def test_a_step_that_raises_the_residual_threefold_is_taken_back_and_its_work_counted() -> None:
    equations = Powers(2)
    update, kept = equations.update, []

    def first_too_far(q: np.ndarray, dq: np.ndarray) -> np.ndarray:
        kept.append(q)
        return update(q, 100.0 * dq if len(kept) == 1 else dq)

    equations.update = first_too_far  # type: ignore[method-assign]
    _, history = solved(equations)
    assert kept[1] is kept[0]
    assert equations.tried[:2] == pytest.approx([10.0, 1.0])
    assert history.steps == len(equations.tried) - 1
    assert history.products[1] >= 2


def test_no_step_short_enough_and_no_step_left_are_told_apart_and_carry_the_last_state() -> None:
    start = ROOT.copy()
    start[2] += 1.0
    with pytest.raises(
        DivergenceError, match=r"trial solution .* no pseudo-time step is short enough.* another"
    ) as caught:
        solved(Powers(singular=99), start)
    assert caught.value.state is start
    assert caught.value.cell == 2
    with pytest.raises(DivergenceError, match="after 2 Newton steps: no more steps are allowed"):
        solved(Powers(2), iterations=2)


def test_a_start_that_is_not_finite_is_refused() -> None:
    with pytest.raises(InputError, match="not finite"):
        solved(Powers(), start=np.full((CELLS, 5), np.nan))


def test_an_iteration_goes_on_from_any_place_it_stood_at_as_if_it_had_never_stopped() -> None:
    places: list[tuple[Standing, ConvergenceHistory]] = []
    record, start = Recorder(), Standing(ROOT + 1.0, 10.0, 50)
    q = continuation(
        Powers(3),
        start,
        scale=1.0,
        tolerance=1e-12,
        record=record,
        keep=lambda at: places.append((at, record.history(0.0))),
    )
    assert len(places) > 3
    for at, history in places:
        again = Recorder.of(history)
        assert np.array_equal(continuation(Powers(3), at, scale=1.0, tolerance=1e-12, record=again), q)
        for name, values in record.history(0.0).to_arrays().items():
            assert np.array_equal(values, again.history(0.0).to_arrays()[name]), name
