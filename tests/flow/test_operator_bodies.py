"""The operator on a finned body and on an airfoil with a shock: against marches on the same mesh.

Oscillations: parts in phase and out of phase at the same k, relative to the out-of-phase part's own size.
Steps: mean over reduced time of the absolute difference, over that of the absolute response.
"""

from functools import cache

import numpy as np
import pytest

from indicial.cfd import FiniteVolumeSolver, FlowSettings
from indicial.cfd.adjoint import direct_sensitivities, sensitivities
from indicial.cfd.flow import Jacobian, Residual
from indicial.cfd.mesh import airfoil_mesh, finned_body_mesh
from indicial.cfd.shapes import Airfoil, FinnedBody
from indicial.conventions import Array, ReferenceQuantities
from indicial.errors import NoLimitError
from indicial.frequency import FrequencyResponse
from indicial.methods import adjoint, forced_oscillation, indicial_response, operator
from indicial.motion import FlightCondition
from indicial.rom import StepResponses
from indicial.rom.inverse import step_responses

CONDITIONS = {"finner": FlightCondition(2.0), "airfoil": FlightCondition(0.8, alpha=np.radians(1.25))}
AMPLITUDE = 2e-4
"""Of marched motions [rad]: small beside the differences at which limiter and shock begin to move."""

FINNER = [pytest.param("finner", 0.45), pytest.param("finner", 1.0, marks=pytest.mark.slow)]
BOTH = [*FINNER, pytest.param("airfoil", 24), pytest.param("airfoil", 48, marks=pytest.mark.slow)]


@cache
def solver(shape: str, fineness: float) -> FiniteVolumeSolver:
    settings = FlowSettings(unsteady_tolerance=1e-5)
    if shape == "finner":
        body = FinnedBody.basic_finner()
        mesh = finned_body_mesh(body, fineness, mach=2.0)
        return FiniteVolumeSolver(mesh, body.reference(5.5), settings)
    n = int(fineness)
    mesh = airfoil_mesh(Airfoil.naca("0012"), n_around=2 * n, n_normal=n // 2, farfield=30.0)
    return FiniteVolumeSolver(mesh, ReferenceQuantities(1.0, 1.0, (0.25, 0.0, 0.0)), settings)


def response(shape: str, fineness: float, k: tuple[float, ...]) -> FrequencyResponse:
    return operator.run(solver(shape, fineness), CONDITIONS[shape], k)


@pytest.mark.parametrize(("shape", "fineness"), BOTH)
def test_a_small_marched_oscillation_is_the_frequency_response(shape: str, fineness: float) -> None:
    """In and out of phase within 0.5% at the same k. The airfoil's shock takes long to forget how the motion began."""
    k, periods, steps = (0.1, 2, 200) if shape == "finner" else (0.2, 8, 400)
    found = response(shape, fineness, (k,))
    history = forced_oscillation.run(
        solver(shape, fineness), CONDITIONS[shape], AMPLITUDE, k, periods=periods, steps_per_period=steps
    )
    reading = forced_oscillation.fourier(history, 1)
    for load in ("CN", "Cm"):
        ahead, behind = operator.pitch_oscillation(found, load, k)
        print(shape, fineness, load, reading.value(load, "in_phase") / ahead - 1.0, reading.value(load) / behind - 1.0)
        assert reading.value(load, "in_phase") == pytest.approx(ahead, rel=5e-3)
        assert reading.value(load) == pytest.approx(behind, rel=5e-3)


@pytest.mark.parametrize(("shape", "fineness"), FINNER)
def test_steps_rebuilt_from_the_frequency_response_equal_the_marched_ones(shape: str, fineness: float) -> None:
    """Within 1%."""
    body, condition = solver(shape, fineness), CONDITIONS[shape]
    s = indicial_response.step_times(0.05, 1.03, 0.4, 60.0)
    marched = StepResponses.from_histories(
        [indicial_response.run(body, condition, AMPLITUDE, s, kind) for kind in ("alpha", "q")]
    )
    rebuilt = step_responses(response(shape, fineness, tuple(np.geomspace(0.01, 60.0, 44))), s)
    for kind in ("alpha", "q"):
        for load in ("CN", "Cm"):
            (_, found), (_, wanted) = rebuilt.channel(load, kind), marched.channel(load, kind)
            error = np.trapezoid(np.abs(found - wanted), s) / np.trapezoid(np.abs(wanted), s)
            print(shape, fineness, kind, load, error, np.max(np.abs(found - wanted)) / np.max(np.abs(wanted)))
            assert error < 0.01


def test_derivatives_about_a_shock_are_exact_and_adjoint_equals_direct() -> None:
    """The limiter and the flux are differentiated where they are: on a converged flow with a shock."""
    flow, condition = solver("airfoil", 24), CONDITIONS["airfoil"]
    operators = flow.linearise(condition, tolerance=1e-11)
    by_load, by_input = sensitivities(operators), direct_sensitivities(operators)
    for name in ("values", "accelerations"):
        found, wanted = getattr(by_load, name), getattr(by_input, name)
        scale = np.max(np.abs(wanted), axis=1, keepdims=True) + 1e-300
        assert np.max(np.abs(found - wanted) / scale) < 1e-7, name
    field = flow.field(condition)
    assert np.max(field.mach) > 1.15, "no shock"


def test_the_jacobian_is_exact_about_a_shock() -> None:
    flow, condition = solver("airfoil", 24), CONDITIONS["airfoil"]
    state = flow._state(condition, condition.velocity, np.zeros(3))
    x = np.random.default_rng(3).standard_normal(state.q.shape)
    exact: Array = Residual(flow.grid)(state.q + 1e-30j * x, state.motion).imag / 1e-30
    found = Jacobian(Residual(flow.grid), state.q, state.motion).apply(x)
    assert np.max(np.abs(found - exact)) < 1e-9 * np.max(np.abs(exact))


def test_the_lift_of_a_plane_subsonic_flow_has_no_alphadot_derivative() -> None:
    """Its wake makes the out-of-phase part grow like log k; what the mesh has at k = 0 is not given out for it."""
    found = response("airfoil", 24, ())
    assert "CN_alphadot" in operator.refusals(found)
    with pytest.raises(NoLimitError, match="no limit"):
        operator.value(found, "CN_alphadot")
    assert "CN_alphadot" not in operator.derivatives(found).select(k=None).names()


def test_what_has_no_limit_is_refused_by_the_adjoint_too_and_where_alpha_was_not_asked_for() -> None:
    flow = solver("airfoil", 24)
    told = adjoint.run(flow, CONDITIONS["airfoil"])
    assert adjoint.refusals(told).keys() == operator.refusals(response("airfoil", 24, ())).keys()
    names = adjoint.derivatives(told).names()
    assert "CN_alpha" in names
    assert not set(names) & {"CN_alphadot", "CN_q+CN_alphadot"}
    alone = flow.frequency_response(CONDITIONS["airfoil"], [0.1], ("alphadot",))
    with pytest.raises(NoLimitError, match="ask for the input alpha"):
        operator.value(alone, "CN_alphadot")
    assert "CN_alphadot" in operator.derivatives(alone).select(k=0.1).names()
