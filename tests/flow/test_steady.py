"""Steady states: ten orders from an impulsive start at any speed, their history, and what is said of failures."""

from functools import cache
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from numpy.typing import NDArray

from indicial.cfd import ConvergenceHistory, FiniteVolumeSolver, FlowSettings
from indicial.cfd.flow.gas import P
from indicial.cfd.mesh import Mesh, airfoil_mesh, finned_body_mesh, plate_mesh
from indicial.cfd.shapes import Airfoil, FinnedBody
from indicial.conventions import ReferenceQuantities
from indicial.errors import DivergenceError, InputError
from indicial.motion import FlightCondition, Rates

CHORD = ReferenceQuantities(1.0, 1.0, (0.25, 0.0, 0.0))
MISSILE = FinnedBody.basic_finner()
CALIBRE = ReferenceQuantities(MISSILE.diameter, 0.25 * np.pi * MISSILE.diameter**2, (5.5 * MISSILE.diameter, 0.0, 0.0))


def degrees(mach: float, alpha: float) -> FlightCondition:
    return FlightCondition(mach, alpha=float(np.deg2rad(alpha)))


@cache
def section_mesh(farfield: float = 50.0) -> Mesh:
    return airfoil_mesh(Airfoil.naca("0012"), n_around=64, n_normal=32, farfield=farfield)


def small_plate(settings: FlowSettings | None = None, folder: Path | None = None) -> FiniteVolumeSolver:
    mesh = plate_mesh(n_chord=16, n_normal=12, height=0.4, ahead=0.2, behind=0.1)
    return FiniteVolumeSolver(mesh, ReferenceQuantities(1.0, 1.0), settings, folder=folder)


def converged(solver: FiniteVolumeSolver, condition: FlightCondition) -> ConvergenceHistory:
    history = solver.convergence(condition)
    print(condition.mach, condition.alpha, history.summary())
    return history


@pytest.mark.parametrize(
    "condition",
    [degrees(0.5, 2.0), degrees(0.755, 0.016), degrees(0.8, 1.25), degrees(0.85, 1.0), degrees(0.95, 0.0)],
    ids=lambda c: f"M {c.mach}",
)
def test_the_residual_of_an_airfoil_falls_ten_orders_from_an_impulsive_start(condition: FlightCondition) -> None:
    history = converged(FiniteVolumeSolver(section_mesh(), CHORD), condition)
    assert history.residual[-1] <= 1e-10
    assert history.residual[0] == pytest.approx(1.0), "still air is where it starts"


@pytest.mark.parametrize("condition", [degrees(4.5, 0.0), degrees(4.5, 10.0)], ids=["alpha 0", "alpha 10"])
def test_the_residual_of_the_finner_falls_ten_orders_from_an_impulsive_start(condition: FlightCondition) -> None:
    mesh = finned_body_mesh(MISSILE, "quick", mach=condition.mach)
    history = converged(FiniteVolumeSolver(mesh, CALIBRE), condition)
    assert history.residual[-1] <= 1e-10


def test_the_last_steps_are_newtons() -> None:
    """With an exact Jacobian and its equations solved to a hundredth, each step leaves little more than a hundredth."""
    history = converged(FiniteVolumeSolver(section_mesh(), CHORD), degrees(0.8, 1.25))
    assert history.cfl[-1] > 1e5
    assert history.residual[-1] < 0.05 * history.residual[-2] < 0.05**2 * history.residual[-3]


def test_where_round_off_leaves_more_than_is_wanted_it_ends_at_round_off() -> None:
    history = converged(FiniteVolumeSolver(section_mesh(500.0), CHORD, FlowSettings(1e-15)), degrees(0.5, 1.0))
    assert 1e-15 < history.residual[-1] <= history.round_off < 1e-9


def test_the_history_is_kept_with_the_state(tmp_path: Path) -> None:
    condition = FlightCondition(2.0, alpha=0.02)
    first = small_plate(folder=tmp_path).convergence(condition)
    told: list[float] = []
    again = FiniteVolumeSolver(
        small_plate().mesh, ReferenceQuantities(1.0, 1.0), folder=tmp_path, progress=told.append
    ).convergence(condition)
    assert told == []
    for name, values in first.to_arrays().items():
        assert np.array_equal(values, again.to_arrays()[name]), name


def test_the_history_counts_all_the_work_and_names_the_phases() -> None:
    solver = small_plate()
    start, near = FlightCondition(2.0, alpha=0.02), FlightCondition(2.0, alpha=0.021)
    impulsive, restarted = solver.convergence(start), solver.convergence(near)
    assert not impulsive.second_order[0]
    assert impulsive.second_order[-1]
    assert np.all(restarted.second_order)
    assert np.all(np.diff(impulsive.products) >= 0)
    assert impulsive.products[0] == 0
    loads = solver.steady(start)
    assert loads.convergence["iterations"] == impulsive.steps == len(impulsive.residual) - 2
    assert loads.convergence["jacobian_products"] == impulsive.products[-1] >= impulsive.steps
    assert f"{impulsive.products[-1]} products" in impulsive.summary()


def test_the_history_plots_every_state_over_steps_and_over_products() -> None:
    history = small_plate().convergence(FlightCondition(2.0, alpha=0.02))
    figure = history.plot()
    panels = figure.axes
    assert [axes.get_xlabel() for axes in panels] == ["Newton step", "products with J"]
    for axes in panels:
        drawn = np.concatenate([np.asarray(line.get_ydata(), dtype=float) for line in axes.lines])
        assert np.array_equal(np.sort(drawn), np.sort(history.residual))
        assert axes.get_yscale() == "log"
    plt.close(figure)


def test_an_iteration_cut_short_says_where_and_keeps_the_last_good_state(tmp_path: Path) -> None:
    solver = small_plate(FlowSettings(steady_iterations=5), tmp_path)
    with pytest.raises(DivergenceError) as caught:
        solver.steady(FlightCondition(2.0, alpha=0.3), Rates(q=30.0))
    message = str(caught.value)
    assert "no more steps are allowed" in message
    assert "worst at x = " in message
    [kept] = tmp_path.glob("diverged-*.npz")
    assert str(kept) in message
    with np.load(kept) as stored:
        state: NDArray[np.float64] = stored["q"]
    assert np.all(np.isfinite(state))
    assert np.all(state[:, [0, P]] > 0.0)


def test_linear_equations_that_stay_singular_are_refused_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    def singular(*_: object) -> None:
        raise DivergenceError("the linearised equations of cell 3 are singular", cell=3)

    monkeypatch.setattr("indicial.cfd.march.steady.BlockILU", singular)
    with pytest.raises(DivergenceError, match="no pseudo-time step is short enough"):
        small_plate().steady(FlightCondition(2.0, alpha=0.02))


@pytest.mark.parametrize(
    ("name", "value"),
    [("steady_tolerance", 0.0), ("steady_tolerance", 1.0), ("steady_tolerance", np.nan), ("steady_iterations", 0)],
)
def test_settings_without_sense_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        FlowSettings(**{name: value})  # type: ignore[arg-type]
