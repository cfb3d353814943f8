"""Models projected from linearised flows, against dense algebra."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_continuous_lyapunov

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.motion import Rates
from indicial.rom import Projection, StateSpaceModel, StepResponse, StepResponses, project, realise
from indicial.rom.reduction import Reduced, impose, nest
from indicial.rom.snapshots import Snapshots, residual_norms
from indicial.solver import LinearisedFlow, Solver
from rom.cases import CONDITION
from rom.linearised import DenseFlow, known_flow, pipe, random_flow


def channel_size(flow: DenseFlow, k_max: float) -> Array:
    """What errors are relative to: each channel's peak over the band, or 0.1% of the largest."""
    peak = np.max(np.abs(flow.transfer(np.linspace(0.0, k_max, 300))), axis=0)
    return np.maximum(peak, 1e-3 * np.max(peak))


def true_error(flow: DenseFlow, model: StateSpaceModel, k_max: float) -> float:
    """Largest error over the band, relative to each channel's peak, by dense solutions on a fine grid."""
    k = np.linspace(0.0, k_max, 300)
    error = np.abs(model.frequency_response(k) - flow.transfer(k)) / channel_size(flow, k_max)
    return float(np.max(error))


def exact_steps(flow: DenseFlow, end: float, count: int = 400) -> StepResponses:
    s, values = flow.step(end, count)
    final = flow.static()
    steps = tuple(StepResponse(name, s, values[:, :, j], final=final[:, j]) for j, name in enumerate(flow.inputs))
    return StepResponses(steps, flow.outputs, flow.baseline, flow.condition, flow.reference)


def step_error(flow: DenseFlow, model: StateSpaceModel, end: float) -> float:
    """Largest error of the step responses, relative to each response's peak."""
    exact = exact_steps(flow, end)
    errors = []
    for response in exact.responses:
        found = model.step(response.s)[response.input].values
        errors.append(np.max(np.abs(found - response.values), axis=0) / np.max(np.abs(response.values), axis=0))
    return float(np.max(errors))


def check_exact_at_zero(flow: DenseFlow, model: StateSpaceModel) -> None:
    static, rate = flow.static(), flow.rate()
    np.testing.assert_allclose(model.static_gain, static, atol=1e-9 * np.max(np.abs(static)))
    np.testing.assert_allclose(model.rate_gain, rate, atol=1e-9 * np.max(np.abs(rate)))
    np.testing.assert_array_equal(model.d, flow.d)


def check_estimate(flow: DenseFlow, projection: Projection, low: float, high: float) -> None:
    """The estimated error lies between `low` and `high` times the true one."""
    ratio = projection.estimated_error / true_error(flow, projection.model, projection.k_max)
    assert low < ratio < high


def test_a_system_of_few_states_among_many_is_found_with_its_poles() -> None:
    flow: LinearisedFlow = known_flow()
    projection = project(flow, k_max=1.0)
    assert projection.model.order == 5
    poles = np.sort_complex(projection.model.poles)
    np.testing.assert_allclose(poles, np.sort_complex([-0.2, -0.7, -0.35, -0.3 + 0.5j, -0.3 - 0.5j]), atol=1e-9)
    assert true_error(known_flow(), projection.model, 20.0) < 1e-10
    assert projection.met


@pytest.mark.parametrize("seed", [1, 3])
def test_non_normal_flow_is_modelled_within_the_tolerance(seed: int) -> None:
    flow = random_flow(seed=seed)
    projection = project(flow, k_max=2.0, tolerance=1e-2)
    assert projection.met
    assert true_error(flow, projection.model, 2.0) < 1e-2
    assert np.max(projection.model.poles.real) < 0.0
    check_exact_at_zero(flow, projection.model)
    check_estimate(flow, projection, 0.5, 10.0)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-5])
@pytest.mark.parametrize("k_max", [2.0, 20.0])
def test_sound_in_a_pipe_is_modelled_within_the_tolerance(tolerance: float, k_max: float) -> None:
    projection = project(pipe(), k_max, tolerance)
    assert projection.met
    assert true_error(pipe(), projection.model, k_max) < tolerance
    check_exact_at_zero(pipe(), projection.model)
    check_estimate(pipe(), projection, 0.5, 20.0)


@pytest.mark.parametrize(
    ("inputs", "outputs"), [(("alpha",), ("CN", "Cm")), (("alpha", "q"), ("CN",)), (("q",), ("Cm",))]
)
def test_any_number_of_inputs_and_loads(inputs: tuple[str, ...], outputs: tuple[str, ...]) -> None:
    whole = pipe()
    rows = [whole.outputs.index(name) for name in outputs]
    columns = [whole.inputs.index(name) for name in inputs]
    b, c, d = whole.b[:, columns], whole.c[rows], whole.d[np.ix_(rows, columns)]
    flow = replace(whole, b=b, c=c, d=d, inputs=inputs, outputs=outputs)
    projection = project(flow, k_max=6.0)
    assert projection.met
    assert true_error(flow, projection.model, 6.0) < 1e-3
    check_exact_at_zero(flow, projection.model)


@pytest.mark.parametrize("order", range(4, 12))
def test_every_order_is_stable_and_exact_at_zero(order: int) -> None:
    model = project(pipe(), 6.0, order=order).model
    assert model.order == order
    assert np.max(model.poles.real) < 0.0
    check_exact_at_zero(pipe(), model)


def test_steps_are_followed_although_their_spectrum_has_no_end() -> None:
    projection = project(pipe(), k_max=20.0)
    assert step_error(pipe(), projection.model, 12.0) < 2e-3
    first = projection.model.step(np.linspace(0.0, 12.0, 5))
    np.testing.assert_array_equal(first.initial, pipe().d)


@pytest.mark.parametrize("order", [pytest.param(4, marks=pytest.mark.slow), pytest.param(6, marks=pytest.mark.slow), 8])
def test_projection_is_nearer_than_fits_to_exact_step_responses_at_equal_order(order: int) -> None:
    flow, k_max, end = pipe(), 6.0, 12.0
    projected = project(flow, k_max, order=order).model
    for method in ("exponential", "era", "modal"):
        fitted = realise(exact_steps(flow, end, 150), method, order // 2)
        assert fitted.order == order
        assert true_error(flow, projected, k_max) < true_error(flow, fitted, k_max)
        assert step_error(flow, projected, end) < step_error(flow, fitted, end)


def test_error_at_solutions_held_out_is_what_the_estimate_said() -> None:
    flow = random_flow()
    projection = project(flow, 2.0, 1e-2)
    size = channel_size(flow, 2.0)
    for point in projection.held_out:
        assert point.k not in projection.points
        error = np.abs(projection.model.frequency_response(point.k) - flow.transfer(point.k))[0]
        assert point.actual == pytest.approx(np.max(error / size), rel=0.05)
        assert point.actual < 3.0 * point.estimated


def test_settled_loads_are_second_order_in_what_the_flow_solver_leaves() -> None:
    errors = []
    for noise in (1e-4, 1e-6):
        model = project(replace(pipe(), noise=noise), 6.0, 1e-2).model
        errors.append(np.max(np.abs(model.static_gain - pipe().static())))
    assert errors[1] < 1e-3 * errors[0]


@dataclass(frozen=True)
class CountedFlow(DenseFlow):
    """Counts the solutions, and how good a start each was given."""

    @property
    def log(self) -> list[tuple[bool, float]]:
        entries: list[tuple[bool, float]] = self.__dict__.setdefault("_log", [])
        return entries

    def solve(
        self,
        rhs: NDArray[Any],
        shift: complex = 0.0,
        *,
        transposed: bool = False,
        start: NDArray[Any] | None = None,
    ) -> NDArray[Any]:
        left = rhs
        if start is not None:
            applied = shift * self.apply_mass(start, transposed=transposed) + self.apply(start, transposed=transposed)
            left = rhs - applied
        self.log.append((transposed, float(np.linalg.norm(left) / np.linalg.norm(rhs))))
        return super().solve(rhs, shift, transposed=transposed)


def test_solutions_are_counted_and_started_from_the_projection() -> None:
    flow = CountedFlow(**{name: getattr(pipe(), name) for name in ("mass", "jacobian", "b", "c", "d")})
    projection = project(flow, 6.0, 1e-5)
    assert projection.forward_solves == sum(not transposed for transposed, _ in flow.log)
    assert projection.adjoint_solves == sum(transposed for transposed, _ in flow.log)
    held_out = [left for transposed, left in flow.log if not transposed][-4:]
    assert max(held_out) < 1e-2


def test_an_unstable_flow_is_not_passed_off_as_modelled(caplog: pytest.LogCaptureFixture) -> None:
    stable = random_flow(60)
    rates = np.linalg.eigvals(np.linalg.solve(stable.mass, stable.jacobian)).real
    growing = replace(stable, jacobian=stable.jacobian - 1.5 * np.min(rates) * stable.mass)
    with caplog.at_level(logging.WARNING):
        projection = project(growing, 2.0, 1e-2)
    assert not projection.met
    assert projection.estimated_error > 1e-2
    assert np.all(projection.discarded.real > 0.0)
    assert projection.discarded.size
    assert "NOT MET" in projection.summary()
    assert "NOT MET" in caplog.text


def test_model_is_a_solver_with_the_flows_derivatives() -> None:
    flow, model = pipe(), project(pipe(), 6.0).model
    assert isinstance(model, Solver)
    table = model.derivatives()
    assert table.value("CN_alpha") == pytest.approx(flow.static()[0, 0], rel=1e-9)
    assert table.value("Cm_alphadot") == pytest.approx(flow.rate()[1, 0], rel=1e-9)
    assert table.value("CN_q") == pytest.approx(flow.static()[0, 1], rel=1e-9)
    np.testing.assert_allclose(model.steady(flow.condition, Rates()).coefficients, flow.baseline)
    assert {(error.output, error.input) for error in model.errors} == {
        (output, name) for output in flow.outputs for name in flow.inputs
    }
    assert max(error.peak for error in model.errors) < 1e-3


def test_summary_and_plot_tell_band_errors_and_solutions() -> None:
    projection = project(pipe(), 6.0)
    text = projection.summary()
    assert "0 <= k <= 6" in text
    assert f"{projection.model.order} states" in text
    assert f"{projection.forward_solves} forward" in text
    assert len(projection.plot().axes[0].lines) == 4 + 2 + projection.points.size


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"k_max": 0.0}, "k_max"),
        ({"k_max": float("nan")}, "k_max"),
        ({"k_max": 1.0, "tolerance": 0.0}, "tolerance"),
        ({"k_max": 1.0, "tolerance": 1.0}, "tolerance"),
        ({"k_max": 1.0, "tolerance": float("nan")}, "tolerance"),
        ({"k_max": 1.0, "max_order": 0}, "max_order"),
        ({"k_max": 1.0, "order": 3}, "order"),
        ({"k_max": 1.0, "max_points": 2}, "max_points"),
    ],
)
def test_bad_arguments_are_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        project(known_flow(), **options)


def test_more_states_than_the_flow_shows_are_refused() -> None:
    with pytest.raises(InputError, match="at most 5"):
        project(known_flow(), 1.0, order=9)


def test_a_flow_whose_loads_see_nothing_is_refused() -> None:
    flow = known_flow()
    with pytest.raises(InputError, match="nothing to model"):
        project(replace(flow, c=np.zeros_like(flow.c)), 1.0)


def test_gramian_factor_converges_to_the_gramian() -> None:
    flow = known_flow(12)
    a, b = -np.linalg.solve(flow.mass, flow.jacobian), np.linalg.solve(flow.mass, flow.b)
    exact = solve_continuous_lyapunov(a, -b @ b.T)
    snapshots = Snapshots(flow)
    for k in np.append(0.0, np.geomspace(1e-3, 1e3, 500)):
        snapshots.extend(1j * k, snapshots.solve(1j * k))
    factor = snapshots.basis @ snapshots.gramian_factor()
    np.testing.assert_allclose(factor @ factor.T, exact, atol=2e-3 * np.max(np.abs(exact)))


def test_residual_norms_from_coordinates_are_those_of_the_residuals() -> None:
    flow = replace(known_flow(), mass=2.0 * np.eye(40))  # a mass that all equations share is only a factor
    snapshots = Snapshots(flow, adjoint=True)
    for k in (0.0, 0.5):
        snapshots.extend(1j * k, snapshots.solve(1j * k))
    k, states = np.array([0.2, 0.9]), np.random.default_rng(1).normal(size=(2, snapshots.size, 2)) + 0j
    x = snapshots.basis @ states
    residuals = flow.c.T - 1j * k[:, None, None] * 2.0 * x - flow.jacobian.T @ x
    found = residual_norms(snapshots.residual_factor(), k, states)
    np.testing.assert_allclose(found, np.linalg.norm(residuals, axis=1) / np.sqrt(2.0), rtol=1e-10)


def stable_model(order: int = 9) -> Reduced:
    rng = np.random.default_rng(2)
    a = rng.normal(size=(order, order))
    a -= (np.max(np.linalg.eigvals(a).real) + 0.3) * np.eye(order)
    return Reduced(a, rng.normal(size=(order, 2)), rng.normal(size=(3, order)), rng.normal(size=(3, 2)))


def test_nested_states_lose_the_energy_that_the_loads_see() -> None:
    model, scale = stable_model(), np.outer([1.0, 5.0, 0.1], [1.0, 2.0])
    nested = nest(model, 2.0, scale)
    seen = nested.model.c / np.array([2.0, 10.0, 0.2])[:, None]
    np.testing.assert_allclose(nested.model.a + nested.model.a.T, -seen.T @ seen, atol=1e-9)
    k = np.linspace(0.0, 5.0, 7)
    np.testing.assert_allclose(nested.model.transfer(k), model.transfer(k), atol=1e-9)
    np.testing.assert_allclose(
        nested.truncate(4).c @ nested.truncate(4).moments(), model.c @ model.moments(), atol=1e-9
    )


def test_imposed_values_are_met_with_the_poles_kept_or_refused() -> None:
    model, rng = stable_model(), np.random.default_rng(4)
    static, rate = rng.normal(size=(3, 2)), rng.normal(size=(3, 2))
    imposed = impose(model, static, rate)
    assert imposed is not None
    np.testing.assert_allclose(imposed.c @ imposed.moments(), np.hstack([static - model.d, rate]), atol=1e-9)
    np.testing.assert_array_equal(imposed.a, model.a)
    few = np.eye(9, 3)
    assert impose(model.within(few, few), static, rate) is None


def test_a_plane_subsonic_flow_passes_on_what_it_has_no_limit_of() -> None:
    flow = replace(known_flow(), plane=True, condition=replace(CONDITION, mach=0.5))
    assert "CN_alphadot" in project(flow, 1.0).model.refusals()
    assert not project(known_flow(), 1.0).model.refusals()
