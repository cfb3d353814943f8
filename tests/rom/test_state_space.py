"""The state-space model as an object: simulation, derivatives, solver, files."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import control
import numpy as np
import pytest

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.motion import AlphaStep, PitchOscillation, Rates
from indicial.rom import StateSpaceModel, realise
from indicial.rom.signals import MotionInputs
from indicial.rom.simulation import simulate
from indicial.solver import Solver
from rom.cases import COLUMNS, CONDITION, OUTPUTS, REFERENCE, ROWS, graded, known_system, plate, responses


def known_model() -> StateSpaceModel:
    """The known system written down as a model, its pair as a real block."""
    system = known_system()
    a = np.diag([-0.2, -0.7, -0.35, -0.3, -0.3])
    a[3, 4], a[4, 3] = 0.5, -0.5
    b = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0], [0.0, 0.0]])
    # Re(c x) with x = x3 - i x4 and c real
    c = np.hstack([system.c[ROWS].real, np.zeros((2, 1))])
    return StateSpaceModel(
        a, b, c, system.d[np.ix_(ROWS, COLUMNS)], ("alpha", "q"), OUTPUTS,
        system.steady(CONDITION).coefficients, CONDITION, REFERENCE,
    )  # fmt: skip


def test_written_down_model_is_the_known_system() -> None:
    for k in (0.0, 0.3, 2.0):
        exact = known_system().transfer(k)[np.ix_(ROWS, COLUMNS)]
        np.testing.assert_allclose(known_model().frequency_response(k)[0], exact, atol=1e-13)
    s = graded(30.0, 50)
    for name, column in zip(("alpha", "q"), COLUMNS, strict=True):
        exact_step = known_system().step(s)[:, ROWS, column]
        np.testing.assert_allclose(known_model().step(s)[name].values, exact_step, atol=1e-12)


def test_control_state_space_has_names_and_the_same_response() -> None:
    system = known_model().system
    assert isinstance(system, control.StateSpace)
    assert (system.input_labels, system.output_labels) == (["alpha", "q"], ["CN", "Cm"])
    np.testing.assert_allclose(system(0.4j), known_model().frequency_response(0.4)[0], atol=1e-12)


def ramp_response(pole: float, s: Array) -> Array:
    """State of ``x' = pole x + u`` from rest for u = s."""
    exact: Array = (np.exp(pole * s) - 1.0) / pole**2 - s / pole
    return exact


def test_ramp_on_uneven_instants_is_exact() -> None:
    s = np.append(0.0, np.cumsum(np.random.default_rng(1).uniform(0.01, 3.0, 40)))
    a, b = np.diag([-0.2, -0.7]), np.ones((2, 1))
    found = simulate(a, b, s, s[:, None], np.zeros(2))
    np.testing.assert_allclose(found, np.stack([ramp_response(p, s) for p in (-0.2, -0.7)], axis=1), rtol=1e-10)


def test_simulation_agrees_with_control_on_a_uniform_grid() -> None:
    s = np.linspace(0.0, 20.0, 401)
    inputs = np.stack([np.sin(0.4 * s), 0.2 * np.cos(1.1 * s)], axis=1)
    found = known_model().respond(MotionInputs(s, inputs, np.zeros(2)))
    start = np.zeros(5)
    _, exact = control.forced_response(known_model().system, s, inputs.T, start)
    np.testing.assert_allclose(found, exact.T, atol=1e-10)


@pytest.mark.parametrize(("varies_alpha", "rotates"), [(True, True), (True, False), (False, True)])
def test_oscillations_start_from_their_steady_state_and_follow_closed_form(varies_alpha: bool, rotates: bool) -> None:
    motion = PitchOscillation.from_reduced_frequency(
        CONDITION, REFERENCE, 0.02, 0.2, varies_alpha=varies_alpha, rotates=rotates
    )
    times = np.linspace(0.0, 2.0 * motion.period, 101)
    exact = known_system().unsteady(CONDITION, motion, times)
    found = known_model().unsteady(CONDITION, motion, times)
    size = np.ptp(exact.coefficients[:, ROWS], axis=0)
    # eight linear pieces of each interval: (k ds)^2/12 of the amplitude
    assert np.all(np.abs(found.coefficients - exact.coefficients)[:, ROWS] < 3e-5 * size)
    np.testing.assert_allclose(found.before, exact.before, atol=1e-12)
    np.testing.assert_allclose(found["CA"], 0.02)


def test_alpha_step_jumps_by_the_feedthrough() -> None:
    times = np.array([0.0, 1e-4, 2e-4])
    found = known_model().unsteady(CONDITION, AlphaStep(CONDITION, 0.01), times)
    np.testing.assert_allclose((found["CN"][0] - found.initial("CN")) / 0.01, 3.0, rtol=1e-12)
    exact = known_system().unsteady(CONDITION, AlphaStep(CONDITION, 0.01), times)
    np.testing.assert_allclose(found.coefficients, exact.coefficients, atol=1e-13)


def test_model_is_a_solver_with_the_known_steady_loads() -> None:
    model = known_model()
    assert isinstance(model, Solver)
    tilted = replace(CONDITION, alpha=CONDITION.alpha - 0.02)
    exact = known_system().steady(tilted, Rates(q=11.0)).coefficients
    np.testing.assert_allclose(model.steady(tilted, Rates(q=11.0)).coefficients, exact, atol=1e-13)


def test_derivatives_at_k_zero_are_those_of_the_transfer_function() -> None:
    table = known_model().derivatives()
    system = known_system()
    for row, output in zip(ROWS, OUTPUTS, strict=True):
        static, slope = system.step(1e6)[row], system.slope()[row]
        assert table.value(f"{output}_alpha", method="rom") == pytest.approx(static[0], rel=1e-12)
        assert table.value(f"{output}_q") == pytest.approx(static[3], rel=1e-12)
        assert table.value(f"{output}_alphadot") == pytest.approx(slope[0], rel=1e-12)
        assert table.value(f"{output}_q+{output}_alphadot") == pytest.approx(static[3] + slope[0], rel=1e-12)


def test_derivatives_at_k_are_those_of_oscillations() -> None:
    k = 0.3
    table, h = known_model().derivatives(k), known_system().transfer(k)
    pitch = h[4, 0] + 1j * k * h[4, 3]
    assert table.value("Cm_q+Cm_alphadot", k=k) == pytest.approx(pitch.imag / k, rel=1e-12)
    assert table.value("Cm_alpha", k=k) == pytest.approx(h[4, 0].real, rel=1e-12)
    with pytest.raises(InputError, match="k is 0"):
        known_model().derivatives(0.0)


def test_rate_derivatives_follow_the_reference_normalisation() -> None:
    per_length = replace(known_model(), reference=replace(REFERENCE, rate_normalisation="c/V"))
    usual, other = known_model().derivatives(), per_length.derivatives()
    for name in ("Cm_q", "Cm_alphadot"):
        assert other.value(name) == pytest.approx(0.5 * usual.value(name), rel=1e-14)
        assert other.one(name).rate_normalisation == "c/V"
    assert other.value("Cm_alpha") == usual.value("Cm_alpha")


@pytest.mark.parametrize("suffix", ["json", "nc"])
def test_file_round_trip_is_exact(tmp_path: Path, suffix: str) -> None:
    solver, condition = plate(3.0)
    model = realise(responses(solver, condition, np.linspace(0.0, 8.0, 101)), order=3)
    path = tmp_path / f"model.{suffix}"
    if suffix == "json":
        model.to_json(path)
        read = StateSpaceModel.from_json(path)
    else:
        model.to_netcdf(path)
        read = StateSpaceModel.from_netcdf(path)
    for name in ("a", "b", "c", "d", "baseline"):
        np.testing.assert_array_equal(getattr(read, name), getattr(model, name))
    for name in ("inputs", "outputs", "condition", "reference", "method", "errors", "candidates", "refused"):
        assert getattr(read, name) == getattr(model, name), name


def test_file_of_another_schema_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    known_model().to_json(path)
    values = json.loads(path.read_text())
    path.write_text(json.dumps({**values, "schema_version": 99}))
    with pytest.raises(InputError, match="schema version 1"):
        StateSpaceModel.from_json(path)
    path.write_text("not json")
    with pytest.raises(InputError, match="not a readable JSON"):
        StateSpaceModel.from_json(path)


@pytest.mark.parametrize(
    ("damage", "reason"),
    [
        ({"d": None}, "missing"),
        ({"a": [["x"]]}, "damaged"),
        ({"condition": {"mach": 2.0, "wind": 1.0}}, "damaged"),
        ({"a": np.eye(5).tolist()}, "not stable"),
    ],
)
def test_damaged_file_is_refused_by_its_name(damage: dict[str, Any], reason: str, tmp_path: Path) -> None:
    path = tmp_path / "model.json"
    values = {**known_model().to_dict(), **damage}
    path.write_text(json.dumps({name: value for name, value in values.items() if value is not None}))
    with pytest.raises(InputError, match=rf"model\.json: .*{reason}"):
        StateSpaceModel.from_json(path)


def test_damaged_netcdf_file_is_refused(tmp_path: Path) -> None:
    data = known_model().to_dataset()
    data.drop_vars("D").to_netcdf(tmp_path / "part.nc", engine="h5netcdf")
    with pytest.raises(InputError, match=r"part\.nc: damaged"):
        StateSpaceModel.from_netcdf(tmp_path / "part.nc")
    data.assign_attrs(schema_version="two").to_netcdf(tmp_path / "other.nc", engine="h5netcdf")
    with pytest.raises(InputError, match="schema version 1"):
        StateSpaceModel.from_netcdf(tmp_path / "other.nc")


def test_unstable_or_misshapen_models_are_refused() -> None:
    model = known_model()
    with pytest.raises(InputError, match="not stable"):
        replace(model, a=-model.a)
    with pytest.raises(InputError, match="state-space b"):
        replace(model, b=model.b.T)
    with pytest.raises(InputError, match="model outputs"):
        replace(model, outputs=("CN", "CL"))


def test_model_without_states_is_its_feedthrough() -> None:
    model = replace(known_model(), a=np.zeros((0, 0)), b=np.zeros((0, 2)), c=np.zeros((2, 0)))
    s = np.linspace(0.0, 1.0, 5)
    found = model.respond(MotionInputs(s, np.outer(s, [1.0, -2.0]), np.zeros(2)))
    np.testing.assert_allclose(found, np.outer(s, model.d @ [1.0, -2.0]), atol=1e-15)
    np.testing.assert_array_equal(model.static_gain, model.d)


def test_summary_and_plot_tell_order_and_fit() -> None:
    data = responses(known_system(), CONDITION, graded(80.0, 100))
    model = realise(data, order=2)
    assert "4 states" in model.summary()
    assert "Cm to q: error" in model.summary()
    assert len(model.plot(data).axes) == 4
    assert len(model.plot().axes) == 4
