"""One operator: against exact theory, against marches, against the whole body, and direct against adjoint."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest

from indicial.cfd import FiniteVolumeSolver, FlowSettings
from indicial.cfd.adjoint import direct_sensitivities, sensitivities
from indicial.cfd.mesh import finned_body_mesh, plate_mesh
from indicial.cfd.mesh.sectors import Extent
from indicial.cfd.shapes import FinnedBody
from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.frequency import FrequencyResponse
from indicial.methods import adjoint, forced_oscillation, indicial_response, moving_frame, operator
from indicial.motion import FlightCondition, Rates
from indicial.rom import StepResponses
from indicial.rom.inverse import step_responses
from theory.plate import frequency_response as exact_frequency_response
from theory.plate import incidence_derivatives, settling_tau, steady_response

REFERENCE = ReferenceQuantities(1.0, 1.0)
CONDITION = FlightCondition(2.0)
CELLS = 32
K = (0.05, 0.1, 0.2, 0.5)
COLUMNS = {("alpha", "CN"): 0, ("alpha", "Cm"): 1, ("q", "CN"): 2, ("q", "Cm"): 3}


@cache
def plate() -> FiniteVolumeSolver:
    height = 0.62 / np.sqrt(3.0)
    mesh = plate_mesh(n_chord=CELLS, n_normal=24, height=height, ahead=3.0 / CELLS, behind=2.0 / CELLS)
    return FiniteVolumeSolver(mesh, REFERENCE)


@cache
def plate_response() -> FrequencyResponse:
    return operator.run(plate(), CONDITION, K)


def test_the_plate_responds_as_in_exact_theory_at_every_frequency() -> None:
    """Within the mesh's 0.5%, of the size of each channel."""
    for m, k in enumerate(K):
        exact = exact_frequency_response(2.0, k)
        for (kind, load), column in COLUMNS.items():
            wanted = (1.0 if kind == "alpha" else 2.0) * exact[column]
            found = plate_response().channel(load, kind)[m]
            print(k, kind, load, abs(found / wanted - 1.0))
            assert abs(found - wanted) < 5e-3 * abs(wanted)


def test_derivatives_at_k_zero_are_those_of_exact_theory() -> None:
    table = operator.derivatives(plate_response()).select(k=None)
    lift, moment, lift_q, moment_q = steady_response(2.0)
    lift_lag, moment_lag = incidence_derivatives(2.0)
    wanted = {"CN_alpha": lift, "Cm_alpha": moment, "CN_q": 2.0 * lift_q, "Cm_q": 2.0 * moment_q}
    wanted |= {"CN_alphadot": 2.0 * lift_lag, "Cm_alphadot": 2.0 * moment_lag}
    wanted["Cm_q+Cm_alphadot"] = wanted["Cm_q"] + wanted["Cm_alphadot"]
    for name, value in wanted.items():
        print(name, table.value(name) / value - 1.0)
        assert table.value(name) == pytest.approx(value, rel=5e-3), name


def test_rates_per_half_and_per_whole_length_differ_by_two() -> None:
    from dataclasses import replace

    whole = FiniteVolumeSolver(plate().mesh, replace(REFERENCE, rate_normalisation="c/V"))
    halves = operator.derivatives(plate_response()).select(k=None)
    wholes = operator.derivatives(operator.run(whole, CONDITION)).select(k=None)
    by_adjoint = adjoint.derivatives(adjoint.run(whole, CONDITION))
    for name, factor in {"CN_alpha": 1.0, "Cm_q": 0.5, "Cm_alphadot": 0.5}.items():
        assert wholes.value(name) == pytest.approx(factor * halves.value(name), rel=1e-6)
        assert by_adjoint.value(name) == pytest.approx(factor * halves.value(name), rel=1e-6)


@pytest.mark.parametrize("k", [0.1, 0.5])
def test_a_small_marched_oscillation_is_the_frequency_response(k: float) -> None:
    """Out of phase within 0.5% at the same k, in pitch; both on one mesh, so only time steps and amplitude differ."""
    response = plate_response()
    history = forced_oscillation.run(plate(), CONDITION, 1e-3, k, periods=2, steps_per_period=240)
    reading = forced_oscillation.fourier(history)
    for load in ("CN", "Cm"):
        ahead, behind = operator.pitch_oscillation(response, load, k)
        print(k, load, reading.value(load, "in_phase") / ahead - 1.0, reading.value(load) / behind - 1.0)
        assert reading.value(load, "in_phase") == pytest.approx(ahead, rel=5e-3)
        assert reading.value(load) == pytest.approx(behind, rel=5e-3)


def test_at_k_zero_the_operator_gives_the_derivatives_of_moving_frame_and_indicial_response() -> None:
    """By differences so small that the limiter, which wakes as they pass about 1e-3 on this mesh, plays no part."""
    table = operator.derivatives(plate_response()).select(k=None)
    steady = moving_frame.run(plate(), CONDITION, ("alpha", "q"), amplitudes={"alpha": 1e-4, "q": 1e-4}, second=None)
    for name in ("CN_alpha", "Cm_alpha", "CN_q", "Cm_q"):
        assert steady[name] == pytest.approx(table.value(name), rel=1e-4)
    steps = marched_steps()
    for load in ("CN", "Cm"):
        s, values = steps.channel(load, "alpha")
        area = np.trapezoid(values[-1] - values, s)
        assert -area == pytest.approx(table.value(f"{load}_alphadot"), rel=0.01)


@cache
def marched_steps() -> StepResponses:
    s = np.linspace(0.0, 1.1 * 4.0 * settling_tau(2.0)[1], 193)
    histories = [indicial_response.run(plate(), CONDITION, 1e-3, s, kind) for kind in ("alpha", "q")]
    return StepResponses.from_histories(histories)


def test_step_responses_rebuilt_from_the_frequency_response_equal_the_marched_ones() -> None:
    """Mean absolute difference over the record below 1% of the mean absolute response (even samples from 0+)."""
    response = operator.run(plate(), CONDITION, np.geomspace(0.02, 60.0, 36))
    marched = marched_steps()
    rebuilt = step_responses(response, marched["alpha"].s)
    for kind, load in COLUMNS:
        (_, found), (_, wanted) = rebuilt.channel(load, kind), marched.channel(load, kind)
        error = np.mean(np.abs(found - wanted)) / np.mean(np.abs(wanted))
        print(kind, load, error)
        assert error < 0.01


@cache
def finner(sector: Extent) -> FiniteVolumeSolver:
    body = FinnedBody.basic_finner()
    mesh = finned_body_mesh(body, 0.45, mach=2.0, sector=sector)
    return FiniteVolumeSolver(mesh, body.reference(5.5), FlowSettings(steady_tolerance=1e-11))


PITCHED = FlightCondition(2.0, alpha=0.05)
"""At incidence, so that no symmetry but that of the plane is left."""


def test_half_a_body_responds_to_sideslip_roll_and_yaw_as_the_whole_one() -> None:
    half, whole = (finner(sector).frequency_response(PITCHED, [0.1]) for sector in ("half", "full"))
    assert half.inputs == whole.inputs
    for name in ("values", "static", "slope", "direct"):
        found, wanted = getattr(half, name), getattr(whole, name)
        scale = np.max(np.abs(np.nan_to_num(wanted)), axis=(-2, -1), keepdims=True)
        assert np.nanmax(np.abs(found - wanted) / scale) < 1e-6, name
    assert abs(half.at_zero("Cl", "p")[0]) > 1.0
    assert abs(half.at_zero("Cn", "beta")[0]) > 1.0


def test_the_adjoint_gives_what_the_direct_solves_give() -> None:
    operators = finner("half").linearise(PITCHED, tolerance=1e-11)
    by_load, by_input = sensitivities(operators), direct_sensitivities(operators)
    for name in ("values", "accelerations"):
        found, wanted = getattr(by_load, name), getattr(by_input, name)
        scale = np.max(np.abs(wanted), axis=1, keepdims=True)
        assert np.max(np.abs(found - wanted) / scale) < 1e-7, name


def test_adjoint_derivatives_are_those_of_the_operator() -> None:
    response = finner("half").frequency_response(PITCHED)
    table = adjoint.derivatives(finner("half").sensitivities(PITCHED))
    direct = operator.derivatives(response)
    for record in direct:
        scale = max(abs(r.value) for r in direct if r.name.split("_", 1)[1] == record.name.split("_", 1)[1])
        assert table.value(record.name) == pytest.approx(record.value, abs=1e-6 * scale), record.name


def test_mach_number_and_moment_reference_change_the_loads_as_the_adjoint_says() -> None:
    """Against steady solutions on either side, with a rate, so that the moment reference moves the flow too."""
    rates = Rates(q=0.02 * 2.0 * PITCHED.speed / finner("half").reference.length)
    told = finner("half").sensitivities(PITCHED, rates)
    h = 1e-3
    faster, slower = (
        finner("half").steady(FlightCondition(2.0 + step, alpha=0.05), rates).coefficients for step in (h, -h)
    )
    slope = (faster - slower) / (2.0 * h)
    assert told.values[:, 6] == pytest.approx(slope, abs=1e-4 * np.max(np.abs(slope)))
    reference = finner("half").reference
    x, y, z = reference.moment_reference
    h = 1e-3 * reference.length
    for axis, (dx, dz) in enumerate(((h, 0.0), (0.0, h))):
        ends = []
        for sign in (1.0, -1.0):
            moved = reference.about((x + sign * dx, y, z + sign * dz))
            solver = FiniteVolumeSolver(finner("half").mesh, moved, FlowSettings(steady_tolerance=1e-11))
            ends.append(solver.steady(PITCHED, rates).coefficients)
        slope = (ends[0] - ends[1]) / (2.0 * h)
        assert told.values[:, (7, 9)[axis]] == pytest.approx(slope, abs=1e-4 * np.max(np.abs(slope)))


def test_a_plane_flow_has_no_sideslip() -> None:
    with pytest.raises(InputError, match="no input 'beta'"):
        plate().frequency_response(CONDITION, [0.1], ("beta",))


@pytest.mark.parametrize("k", [[-0.1], [np.nan], [0.1, np.inf]])
def test_impossible_frequencies_are_refused_before_anything_is_solved(k: list[float]) -> None:
    solver = FiniteVolumeSolver(plate().mesh, REFERENCE, progress=lambda fraction: pytest.fail("something was solved"))
    with pytest.raises(InputError, match="reduced frequency"):
        solver.frequency_response(CONDITION, k)


def test_a_flow_that_has_not_converged_is_not_linearised() -> None:
    solver = FiniteVolumeSolver(plate().mesh, REFERENCE, FlowSettings(steady_tolerance=1e-2))
    with pytest.raises(InputError, match="steady_tolerance"):
        solver.frequency_response(FlightCondition(2.0, alpha=0.05), [0.1])


def test_more_memory_than_there_is_is_refused_before_anything_is_solved(monkeypatch: pytest.MonkeyPatch) -> None:
    solver = plate()
    monkeypatch.setattr("indicial.cfd.memory.psutil.virtual_memory", lambda: SimpleNamespace(available=10**6))
    with pytest.raises(InputError, match=r"GB of memory, 0\.0 GB are available"):
        FiniteVolumeSolver(plate().mesh, REFERENCE)
    with pytest.raises(InputError, match="linearised flow on"):
        solver.linearise(CONDITION)


def test_betadot_is_made_dimensionless_alike_by_operator_and_adjoint() -> None:
    """By the lateral length, as p and r are; so with twice that length the derivative is half as large."""
    from dataclasses import replace

    one = finner("half").reference
    tables = []
    for reference in (one, replace(one, lateral_length=2.0 * one.length)):
        flow = FiniteVolumeSolver(finner("half").mesh, reference)
        tables.append(operator.derivatives(flow.frequency_response(PITCHED, [0.1], ("beta",))))
        by_adjoint = adjoint.derivatives(adjoint.run(flow, PITCHED))
        for name in ("CY_betadot", "Cn_betadot"):
            assert tables[-1].value(name, k=None) == pytest.approx(by_adjoint.value(name), rel=1e-6)
    for k in (None, 0.1):
        assert tables[1].value("CY_betadot", k=k) == pytest.approx(0.5 * tables[0].value("CY_betadot", k=k), rel=1e-6)


def test_alphadot_alone_gives_the_derivatives_that_alpha_gives() -> None:
    alone = operator.derivatives(plate().frequency_response(CONDITION, K, ("alphadot",)))
    told = operator.derivatives(plate_response())
    assert alone.names() == ("CA_alphadot", "CN_alphadot", "Cm_alphadot")
    for k in (None, *K):
        for name in ("CN_alphadot", "Cm_alphadot"):
            assert alone.value(name, k=k) == pytest.approx(told.value(name, k=k), rel=1e-6)


def test_a_frequency_asked_for_twice_gives_one_record() -> None:
    found = operator.derivatives(plate().frequency_response(CONDITION, [0.5, 0.1, 0.5], ("alpha",)))
    assert found.value("CN_alpha", k=0.5) == pytest.approx(
        operator.derivatives(plate_response()).value("CN_alpha", k=0.5)
    )


def test_a_pitch_oscillation_that_was_not_solved_for_is_refused() -> None:
    with pytest.raises(InputError, match="not among the reduced frequencies"):
        operator.pitch_oscillation(plate().frequency_response(CONDITION), "CN", 0.1)


def test_solutions_do_not_depend_on_what_was_solved_before() -> None:
    """Factors of one shift serve others near it, but complex ones no real system."""
    (flow,) = plate().linearise(CONDITION)
    (fresh,) = plate().linearise(CONDITION)
    rhs = flow.b[:, 0]
    flow.solve(rhs, 1e-5j)
    real = flow.solve(rhs)
    assert real.dtype == float
    assert real == pytest.approx(fresh.solve(rhs), abs=1e-6 * np.max(np.abs(real)))
    for shift in (0.5, 0.5 + 0.0j):
        x = flow.solve(rhs, shift)
        left = rhs - flow.apply(x) - shift * flow.apply_mass(x)
        assert np.linalg.norm(left) < 2.0 * flow.tolerance * np.linalg.norm(rhs)


def test_a_plane_flow_has_no_lateral_derivatives_by_the_adjoint() -> None:
    found = adjoint.derivatives(adjoint.run(plate(), CONDITION))
    assert found.value("CN_alpha") == pytest.approx(
        operator.derivatives(plate_response()).value("CN_alpha", k=None), rel=1e-6
    )
    assert not [name for name in found.names() if name.startswith(("CY", "Cl", "Cn"))]
