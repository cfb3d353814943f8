"""The supersonic flat plate: whole indicial histories and derivatives against exact linear theory.

The measure of a history is the mean over even samples, from 0+ until the exact response has settled at
``s = 2M/(M-1)``, of the absolute error, over the mean of the absolute exact response.
"""

from functools import cache

import numpy as np
import pytest

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import plate_mesh
from indicial.conventions import ReferenceQuantities
from indicial.methods import forced_oscillation, indicial_response, moving_frame
from indicial.methods.indicial_response import StepKind, StepResponse
from indicial.motion import FlightCondition
from theory.plate import frequency_response as exact_frequency_response
from theory.plate import incidence_derivatives, settling_tau, steady_response, supersonic_step

REFERENCE = ReferenceQuantities(1.0, 1.0, (0.0, 0.0, 0.0))
"""Moments about the leading edge; rates per q c/2V, twice those of the exact functions, which are per q c/V."""

AMPLITUDE = 1e-3
COLUMNS = {("alpha", "CN"): 0, ("alpha", "Cm"): 1, ("q", "CN"): 2, ("q", "Cm"): 3}
FINENESS = [pytest.param(32, 0.01), pytest.param(96, 0.001, marks=pytest.mark.slow)]
"""Cells along the chord, and the error allowed."""


@cache
def solver(mach: float, cells: int) -> FiniteVolumeSolver:
    """A domain just tall enough that nothing comes back from its top within the plate."""
    height = 0.62 / np.sqrt(mach**2 - 1.0)
    mesh = plate_mesh(n_chord=cells, n_normal=int(0.75 * cells), height=height, ahead=3.0 / cells, behind=2.0 / cells)
    return FiniteVolumeSolver(mesh, REFERENCE)


@cache
def response(mach: float, cells: int, kind: StepKind) -> StepResponse:
    """Even steps of half a cell's convection or so, to a tenth beyond the settling time."""
    s = np.linspace(0.0, 1.1 * 2.0 * mach * settling_tau(mach)[1], 1 + int(1.5 * cells))
    flow, condition = solver(mach, cells), FlightCondition(mach)
    history = indicial_response.run(flow, condition, AMPLITUDE, s, kind)
    final = flow.steady(*indicial_response.after(indicial_response.experiment(condition, REFERENCE, AMPLITUDE, kind)))
    return indicial_response.read(history, final)


def exact(mach: float, s: np.ndarray, kind: str, load: str) -> np.ndarray:
    return (1.0 if kind == "alpha" else 2.0) * supersonic_step(mach, s)[..., COLUMNS[kind, load]]


@pytest.mark.parametrize("kind", ["alpha", "q"])
@pytest.mark.parametrize(("cells", "allowed"), FINENESS)
@pytest.mark.parametrize("mach", [1.5, 2.5])
def test_step_histories_equal_the_exact_ones(mach: float, cells: int, allowed: float, kind: StepKind) -> None:
    found = response(mach, cells, kind)
    until = found.s <= 2.0 * mach * settling_tau(mach)[1]
    for load in ("CN", "Cm"):
        wanted = exact(mach, found.s, kind, load)
        error = np.abs(found[load] - wanted)[until]
        print(
            f"M {mach} {kind} {load}: mean {np.mean(error) / np.mean(np.abs(wanted[until])):.2e}, "
            f"largest {np.max(error) / np.max(np.abs(wanted)):.2e}"
        )
        assert np.mean(error) < allowed * np.mean(np.abs(wanted[until]))
        assert np.max(error) < 2.0 * max(allowed, 0.3 / cells) * np.max(np.abs(wanted))
        # settled: the history has reached the steady solution, and that is Ackeret's
        assert found[load][-1] == pytest.approx(found.final[load], rel=allowed)
        assert found.final[load] == pytest.approx(exact(mach, np.array(1e9), kind, load), rel=allowed)


@pytest.mark.parametrize("mach", [1.5, 2.5])
def test_responses_start_at_the_piston_value(mach: float) -> None:
    """Exact but for the step's own square and, in Cm to q, the midpoint rule over the plate's faces: 1/(4 n^2)."""
    cells = 32
    for (kind, load), column in COLUMNS.items():
        wanted = float(exact(mach, np.array(0.0), kind, load))
        quadrature = 1.0 / cells**2 if column == 3 else 0.0
        assert response(mach, cells, kind).initial(load) == pytest.approx(wanted, rel=AMPLITUDE / 50.0 + quadrature)


@pytest.mark.parametrize(("cells", "allowed"), FINENESS)
@pytest.mark.parametrize("mach", [1.5, 2.5])
def test_derivatives_of_the_steps_are_exact(mach: float, cells: int, allowed: float) -> None:
    found = indicial_response.derive(response(mach, cells, "alpha"), response(mach, cells, "q"))
    lift_lag, moment_lag = incidence_derivatives(mach)
    lift, moment, lift_q, moment_q = steady_response(mach)
    wanted = {
        "CN_alpha": lift,
        "Cm_alpha": moment,
        "CN_q": 2.0 * lift_q,
        "Cm_q": 2.0 * moment_q,
        "CN_alphadot": 2.0 * lift_lag,
        "Cm_alphadot": 2.0 * moment_lag,
    }
    assert not found.refused
    print({name: found[name] / value - 1.0 for name, value in wanted.items()})
    for name, value in wanted.items():
        assert found[name] == pytest.approx(value, rel=allowed), name


def test_slow_forced_oscillation_agrees_with_indicial_response_and_moving_frame() -> None:
    """At k = 0.02 the exact sum differs from its limit by about k^2: below 0.1% of Cm_q."""
    mach, cells, k = 2.0, 32, 0.02
    flow, condition = solver(mach, cells), FlightCondition(mach)
    steady = moving_frame.run(flow, condition, ("q",), second=None)
    lag = indicial_response.derive(response(mach, cells, "alpha"))
    history = forced_oscillation.run(flow, condition, AMPLITUDE, k, periods=2, steps_per_period=48)
    for load in ("CN", "Cm"):
        together = steady[f"{load}_q"] + lag[f"{load}_alphadot"]
        for reduce in (forced_oscillation.phase_angle, forced_oscillation.regression, forced_oscillation.fourier):
            reading = reduce(history)
            print(load, reading.reduction, reading.value(load) / together - 1.0)
            assert reading.value(load) == pytest.approx(together, abs=0.005 * abs(steady[f"{load}_q"]))
            assert reading.value(load, "in_phase") == pytest.approx(lag[f"{load}_alpha"], rel=0.005)


@pytest.mark.parametrize("motion", ["pitch", "plunge"])
@pytest.mark.parametrize("k", [0.1, 0.2])
def test_forced_oscillation_equals_the_exact_frequency_response(k: float, motion: str) -> None:
    """``H_a(ik) + ik H_q(ik)`` in pitch (q per c/2U), ``H_a(ik)`` in plunge; errors relative to the larger part."""
    mach = 2.0
    history = forced_oscillation.run(
        solver(mach, 32), FlightCondition(mach), AMPLITUDE, k, motion, periods=2, steps_per_period=48
    )
    reading = forced_oscillation.fourier(history)
    h = exact_frequency_response(mach, k)
    for column, load in enumerate(("CN", "Cm")):
        total = h[column] + (2.0j * k * h[2 + column] if motion == "pitch" else 0.0)
        print(load, reading.value(load, "in_phase") / total.real - 1, reading.value(load) / (total.imag / k) - 1)
        assert reading.value(load, "in_phase") == pytest.approx(total.real, rel=0.005)
        assert reading.value(load) == pytest.approx(total.imag / k, rel=0.01)
