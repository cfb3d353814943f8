"""Indicial responses against the exact plate, finite-pole systems and the incompressible airfoil."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from indicial.conventions import ReferenceQuantities, transfer_longitudinal
from indicial.errors import InputError, NoLimitError
from indicial.methods import forced_oscillation, indicial_response, moving_frame
from indicial.methods.indicial_response import StepResponse, step_times
from indicial.motion import FlightCondition
from indicial.solver import Solver
from theory.linear import NoisySolver, incompressible_airfoil, random_system
from theory.plate import SupersonicPlate, incidence_derivatives, steady_response

REFERENCE = ReferenceQuantities(length=1.0, area=1.0)


def respond(
    solver: Solver, condition: FlightCondition, kind: str, amplitude: float, s: np.ndarray, *, final: bool = True
) -> StepResponse:
    step = indicial_response.experiment(condition, solver.reference, amplitude, kind)
    history = indicial_response.run(solver, condition, amplitude, s, kind)
    return indicial_response.read(history, solver.steady(*indicial_response.after(step)) if final else None)


@pytest.mark.parametrize("mach", [1.1, 1.6, 2.5])
@pytest.mark.parametrize(("normalisation", "factor"), [("c/2V", 2.0), ("c/V", 1.0)])
def test_plate_gives_every_exact_derivative(mach: float, normalisation: str, factor: float) -> None:
    solver = SupersonicPlate(replace(REFERENCE, rate_normalisation=normalisation))
    condition = FlightCondition(mach, alpha=0.02)
    s = step_times(1e-3, 1.05, 0.02 * mach / (mach - 1.0), 5.0 * mach / (mach - 1.0))
    result = indicial_response.derive(
        respond(solver, condition, "alpha", 0.01, s), respond(solver, condition, "q", 1e-3, s)
    )
    cl_a, cm_a, cl_q, cm_q = steady_response(mach)
    cl_ad, cm_ad = incidence_derivatives(mach)
    assert result["CN_alpha"] == pytest.approx(cl_a, rel=1e-8)
    assert result["Cm_alpha"] == pytest.approx(cm_a, rel=1e-8)
    assert result["CN_q"] == pytest.approx(factor * cl_q, rel=1e-8)
    assert result["Cm_q"] == pytest.approx(factor * cm_q, rel=1e-8)
    assert result["CN_alphadot"] == pytest.approx(factor * cl_ad, rel=5e-4)
    assert result["Cm_alphadot"] == pytest.approx(factor * cm_ad, rel=5e-4)
    total = -factor * (4.0 / 3.0) * (mach**2 - 2.0) / (mach**2 - 1.0) ** 1.5
    assert result["Cm_q+Cm_alphadot"] == pytest.approx(total, abs=1e-3 * abs(factor * cm_ad))
    record = result.derivatives().one("Cm_alphadot")
    assert (record.method, record.rate_normalisation) == ("irm", normalisation)
    assert record.uncertainty < 2e-3 * abs(record.value)


def test_step_response_starts_at_piston_theory() -> None:
    condition = FlightCondition(2.0, alpha=0.02)
    solver = SupersonicPlate(REFERENCE)
    s = step_times(0.1, 1.0, 0.1, 8.0)
    in_alpha = respond(solver, condition, "alpha", 0.01, s)
    in_q = respond(solver, condition, "q", 1e-3, s)
    assert in_alpha.initial("CN") == pytest.approx(4.0 / 2.0)
    assert in_alpha.initial("Cm") == pytest.approx(-2.0 / 2.0)
    assert in_q.initial("CN") == pytest.approx((8.0 / 2.0) * 0.5)  # per q c/2U
    assert in_q.initial("Cm") == pytest.approx(-(8.0 / 2.0) / 3.0)
    assert in_alpha.deficiency("CN")[-1] == pytest.approx(0.0, abs=1e-9)


def test_finite_poles_are_recovered_with_and_without_the_final_value() -> None:
    system = random_system(REFERENCE)
    condition = FlightCondition(0.8, alpha=0.05)
    s = step_times(5e-3, 1.05, 0.5, 150.0)
    slope, static = system.slope(), system.transfer(0.0).real
    for final in (True, False):
        result = indicial_response.derive(
            respond(system, condition, "alpha", 0.01, s, final=final),
            respond(system, condition, "q", 1e-3, s, final=final),
        )
        for name, row in (("CN", 2), ("Cm", 4)):
            assert result[f"{name}_alpha"] == pytest.approx(static[row, 0], rel=1e-4)
            assert result[f"{name}_q"] == pytest.approx(static[row, 3], rel=1e-4)
            assert result[f"{name}_alphadot"] == pytest.approx(slope[row, 0], rel=3e-3)


def test_three_methods_agree_on_a_linear_flow_at_small_k() -> None:
    solver = SupersonicPlate(replace(REFERENCE, moment_reference=(0.3, 0.0, 0.0)))
    condition = FlightCondition(1.8)
    s = step_times(2e-3, 1.05, 0.05, 12.0)
    irm = indicial_response.derive(
        respond(solver, condition, "alpha", 0.01, s), respond(solver, condition, "q", 1e-3, s)
    )
    mrf = moving_frame.run(solver, condition)
    history = forced_oscillation.run(solver, condition, 0.01, 0.005, periods=2)
    fom = forced_oscillation.fourier(history).derivatives()
    assert irm["Cm_q"] == pytest.approx(mrf["Cm_q"], rel=1e-8)
    assert irm["CN_alpha"] == pytest.approx(mrf["CN_alpha"], rel=1e-8)
    assert fom.value("Cm_q+Cm_alphadot") == pytest.approx(mrf["Cm_q"] + irm["Cm_alphadot"], rel=1e-3)


def test_incidence_lag_transfers_as_theory_says() -> None:
    condition = FlightCondition(1.6)
    s = step_times(2e-3, 1.05, 0.05, 16.0)

    def derive(axis: float) -> indicial_response.IndicialResult:
        solver = SupersonicPlate(replace(REFERENCE, moment_reference=(axis, 0.0, 0.0)))
        return indicial_response.derive(respond(solver, condition, "alpha", 0.01, s))

    moved = transfer_longitudinal(derive(0.0).values, 0.6)
    assert moved["Cm_alphadot"] == pytest.approx(derive(0.6)["Cm_alphadot"], rel=1e-3)


@pytest.mark.parametrize("level", [0.0, 1e-4])
def test_incompressible_lift_lag_is_refused_and_moment_about_quarter_chord_is_not(level: float) -> None:
    condition = FlightCondition(0.3)
    s = step_times(2e-3, 1.03, 0.5, 80.0)
    airfoil: Solver = incompressible_airfoil(replace(REFERENCE, moment_reference=(0.25, 0.0, 0.0)), 0.25)
    solver = NoisySolver(airfoil, level) if level else airfoil
    result = indicial_response.derive(
        respond(solver, condition, "alpha", 0.01, s), respond(solver, condition, "q", 1e-3, s)
    )
    assert result["CN_alpha"] == pytest.approx(2.0 * np.pi, rel=1e-6)
    assert result["Cm_alphadot"] == pytest.approx(-np.pi / 4.0, rel=2e-3)
    assert result["Cm_q"] == pytest.approx(-np.pi / 4.0, rel=1e-6)
    assert "1/s" in result.refused["CN_alphadot"]
    assert "CN_alphadot" not in result.derivatives().names()
    assert "refused" in result.summary()
    with pytest.raises(NoLimitError, match="CN_alphadot"):
        result["CN_alphadot"]


def test_incompressible_moment_lag_about_the_leading_edge_is_refused() -> None:
    s = step_times(2e-3, 1.03, 0.5, 80.0)
    airfoil = incompressible_airfoil(REFERENCE, 0.0)
    result = indicial_response.derive(respond(airfoil, FlightCondition(0.3), "alpha", 0.01, s))
    assert set(result.refused) == {"CN_alphadot", "Cm_alphadot"}


def test_opposite_steps_show_and_remove_what_is_even_in_the_amplitude() -> None:
    def square(inputs: np.ndarray) -> np.ndarray:
        loads = np.zeros((*inputs.shape[:-1], 6))
        loads[..., 2] = 3.0 * inputs[..., 0] ** 2
        return loads

    linear = random_system(REFERENCE)
    bent = replace(linear, distortion=square)
    condition, s = FlightCondition(0.8), step_times(5e-3, 1.05, 0.5, 150.0)
    up, down = (respond(bent, condition, "alpha", a, s) for a in (0.01, -0.01))
    exact = respond(linear, condition, "alpha", 0.01, s)
    np.testing.assert_allclose(indicial_response.average(up, down).response, exact.response, atol=1e-9)
    size = np.max(np.abs(up["CN"]))
    assert indicial_response.linearity(up, down)["CN"] == pytest.approx(2.0 * 3.0 * 0.01 / size)
    assert indicial_response.linearity(up, down)["Cm"] == pytest.approx(0.0, abs=1e-9)
    checked = indicial_response.derive(up, alpha_check=down)
    assert checked.uncertainties["CN_alpha"] == pytest.approx(0.06, rel=1e-6)


def test_step_times_grow_to_their_limit_and_meet_the_end() -> None:
    times = step_times(0.01, 1.2, 0.5, 20.0)
    steps = np.diff(times)
    assert (times[0], times[-1]) == (0.0, pytest.approx(20.0))
    assert np.all(steps[1:] / steps[:-1] <= 1.2 + 1e-9)
    assert np.max(steps) <= 0.5
    assert steps[0] == pytest.approx(0.01, rel=0.05)
    for bad in ((0.0, 1.1, 1.0, 5.0), (0.1, 0.9, 1.0, 5.0), (0.1, 1.1, 0.01, 5.0), (0.1, 1.1, 1.0, -5.0)):
        with pytest.raises(InputError):
            step_times(*bad)


def test_reading_refuses_what_is_no_step() -> None:
    system = random_system(REFERENCE)
    condition = FlightCondition(0.8)
    with pytest.raises(InputError, match="no step"):
        indicial_response.read(forced_oscillation.run(system, condition, 0.01, 0.1))
    with pytest.raises(InputError, match="no step in"):
        indicial_response.experiment(condition, REFERENCE, 0.01, "roll")
    s = step_times(0.01, 1.1, 0.5, 20.0)
    with pytest.raises(InputError, match="same variable"):
        indicial_response.linearity(
            respond(system, condition, "alpha", 0.01, s), respond(system, condition, "q", 0.01, s)
        )
