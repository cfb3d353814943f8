"""The time step of a march is a matter of accuracy: second order, and free to grow as a response settles."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.flow import STILL_AIR, Grid, MeshMotion, Residual
from indicial.cfd.flow.gas import conservative_jacobian
from indicial.cfd.march import Pattern
from indicial.cfd.march.unsteady import march
from indicial.cfd.mesh import box_mesh, finned_body_mesh, plate_mesh
from indicial.cfd.shapes import FinnedBody
from indicial.conventions import ReferenceQuantities
from indicial.methods import forced_oscillation, indicial_response
from indicial.methods.forced_oscillation import OscillationMotion
from indicial.methods.indicial_response import StepKind, step_times
from indicial.motion import FlightCondition
from indicial.reference_data import FINNER_MOMENT_REFERENCE
from theory.plate import settling_tau

REFERENCE = ReferenceQuantities(1.0, 1.0, (0.0, 0.0, 0.0))
END = 3.0


def shaken(time: float) -> MeshMotion:
    """A box that sets off smoothly from rest, turns and swings back."""
    wave = np.sin(2.0 * np.pi * max(time, 0.0) / END) ** 2
    return MeshMotion(np.array([-0.4, 0.0, 0.1]) * wave, np.array([0.0, 0.2, 0.0]) * wave)


def box() -> Residual:
    """A layer of 10 by 8 skewed cells with a wall below, still air on the other sides."""
    kinds = {"z_min": "wall", "y_min": "symmetry", "y_max": "symmetry"}
    mesh = box_mesh((10, 1, 8), upper=(1.0, 0.2, 1.0), skew="smooth", kinds=kinds)  # type: ignore[arg-type]
    return Residual(Grid.from_mesh(mesh, REFERENCE))


@cache
def by_runge_kutta() -> np.ndarray:
    """The state at the end by an explicit method of eighth order, far below the errors of the march."""
    residual = box()
    volume = residual.grid.volume[:, None]
    start = np.tile(STILL_AIR, (residual.grid.n_cells, 1))

    def slope(time: float, q: np.ndarray) -> np.ndarray:
        state = q.reshape(start.shape)
        rate = -residual(state, shaken(time)) / volume
        return np.linalg.solve(conservative_jacobian(state), rate[..., None]).ravel()

    found = solve_ivp(slope, (0.0, END), start.ravel(), method="DOP853", rtol=1e-9, atol=1e-11)
    return np.asarray(found.y[:, -1].reshape(start.shape))


@pytest.mark.parametrize("growth", [1.0, 10.0], ids=["even steps", "last step ten times the first"])
def test_the_march_is_of_second_order_in_time(growth: float) -> None:
    """Against another integrator of the same equations: halving every step divides the error by four."""
    residual = box()
    pattern = Pattern.of(residual.grid)
    exact, start = by_runge_kutta(), np.tile(STILL_AIR, (residual.grid.n_cells, 1))
    errors = []
    for n in (80, 160, 320):
        fraction = np.arange(n + 1) / n
        times = END * (fraction if growth == 1.0 else (growth**fraction - 1.0) / (growth - 1.0))
        found = march(residual, pattern, start, shaken, times, tolerance=1e-9, ambient_pressure=STILL_AIR[4])
        errors.append(np.linalg.norm(found.q - exact))
    order = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    print(f"errors {errors}, orders {order}")
    assert order[-1] == pytest.approx(2.0, abs=0.15)


@pytest.mark.parametrize("kind", ["alpha", "q"])
def test_a_response_with_growing_steps_equals_a_fine_one_with_even_steps(kind: StepKind) -> None:
    """Within 0.5% of the largest load at every instant, the kink where the response settles included, and 0.1% on
    the mean, with a fifth of the steps."""
    mach, cells = 1.5, 24
    mesh = plate_mesh(n_chord=cells, n_normal=18, height=0.62 / np.sqrt(mach**2 - 1.0), ahead=3.0 / cells, behind=0.1)
    flow, condition = FiniteVolumeSolver(mesh, REFERENCE), FlightCondition(mach)
    end = 2.0 * 2.0 * mach * settling_tau(mach)[1]
    fine = np.linspace(0.0, end, 401)
    grown = step_times(0.01, 1.1, 0.02 * end, end)
    assert grown.size < fine.size / 5
    even, few = (indicial_response.read(indicial_response.run(flow, condition, 1e-3, s, kind)) for s in (fine, grown))
    for load in ("CN", "Cm"):
        wanted = np.interp(grown, fine, even[load])
        error = np.abs(few[load] - wanted) / np.max(np.abs(wanted))
        print(kind, load, f"largest {error.max():.2e} at s = {grown[np.argmax(error)]:.3g}, at the end {error[-1]:.2e}")
        assert np.max(error) < 0.005
        assert np.mean(error) < 0.001


@pytest.mark.slow
@pytest.mark.parametrize("motion", ["pitch", "pitch_rate"])
def test_damping_at_mach_1_hardly_changes_when_the_published_step_is_halved(motion: OscillationMotion) -> None:
    """From U dt/d = 0.3 at k = 0.025, 420 steps a period; published: 2.47% (Cm_q) and 1.93% (CN_q) to the limit."""
    body, k, amplitude = FinnedBody.basic_finner(), 0.025, np.radians(0.5)
    solver = FiniteVolumeSolver(finned_body_mesh(body, 0.5, wake="sting"), body.reference(FINNER_MOMENT_REFERENCE))
    found = []
    for steps in (420, 840):
        history = forced_oscillation.run(
            solver, FlightCondition(1.0), amplitude, k, motion, periods=1, steps_per_period=steps
        )
        # body and motion are symmetric: the second half of the period is as good as a whole one, and past the start
        late = slice(-steps // 2, None)
        wave = 2.0 * np.cos(history.motion["omega"] * history.time[late]) / (amplitude * k)
        found.append([np.mean(history[name][late] * wave) for name in ("Cm", "CN")])
    change = np.array(found[0]) / np.array(found[1]) - 1.0
    print(motion, found[1], change)
    assert np.max(np.abs(change)) < 0.005
