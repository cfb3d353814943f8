import math
import os
import subprocess
import sys

import numpy as np
import pytest

from indicial.cfd.lattice import Lattice, LatticeSettings, LatticeSolver, discrete
from indicial.cfd.shapes import LiftingSurface, SpanStation
from indicial.errors import InputError
from indicial.methods import forced_oscillation, indicial_response, moving_frame, operator
from indicial.motion import AlphaStep, FlightCondition, PitchRateStep, Rates, SteadyMotion, TabulatedMotion
from theory.linear import theodorsen, wagner

STILL = FlightCondition(0.1)


def plate(chordwise: int, wake: str = "frozen") -> LatticeSolver:
    """A wing of such an aspect ratio that its middle is two-dimensional, about the quarter chord."""
    wing = LiftingSurface.wing("plate", 2000.0, 1.0)
    lattice = Lattice.of(wing, chordwise=chordwise, spanwise=2)
    return LatticeSolver(lattice, wing.reference((0.25, 0, 0)), LatticeSettings(wake=wake, compressible=False))  # type: ignore[arg-type]


def tailed(wake: str = "shed", chordwise: int = 3, spanwise: int = 6) -> LatticeSolver:
    wing = LiftingSurface.wing("wing", 6.0, 1.0, taper=0.6, sweep=0.3, dihedral=0.1)
    tail = LiftingSurface.wing("tail", 2.0, 0.5, root_leading_edge=(4.0, 0.3))
    lattice = Lattice.of([wing, tail], chordwise=chordwise, spanwise=spanwise)
    return LatticeSolver(lattice, wing.reference((0.5, 0.0, 0.0)), LatticeSettings(wake=wake))  # type: ignore[arg-type]


def reduced(s: np.ndarray, solver: LatticeSolver, condition: FlightCondition = STILL) -> np.ndarray:
    return s * solver.reference.length / (2.0 * condition.speed)


def test_plate_follows_theodorsen() -> None:
    # about c/4, plunge: lift 2 pi C + i pi k, moment -i pi k/4; pitch rate: lift 2 pi C + i pi k/2, moment -pi/4 - ...
    response = plate(12).frequency_response(STILL, [0.1, 0.5, 1.0], ("alpha", "q"))
    for n, k in enumerate(response.k):
        lift = 2.0 * math.pi * theodorsen(k) + 1j * math.pi * k
        assert abs(response.channel("CN", "alpha")[n] / lift - 1.0) < 5e-3
        assert abs(response.channel("Cm", "alpha")[n] + 0.25j * math.pi * k) < 0.02 * k
        turning = 2.0 * math.pi * theodorsen(k) + 0.5j * math.pi * k
        assert abs(response.channel("CN", "q")[n] / turning - 1.0) < 5e-3
        assert response.channel("Cm", "q")[n].real == pytest.approx(-math.pi / 4.0, rel=0.02)


def test_lattice_converges_on_theodorsen_with_the_square_of_the_panels() -> None:
    errors = []
    for chordwise in (4, 8):
        response = plate(chordwise).frequency_response(STILL, [0.5], ("alpha",))
        lift = 2.0 * math.pi * theodorsen(0.5) + 0.5j * math.pi
        # the aspect ratio's own share is the same in both
        errors.append(abs(response.channel("Cm", "alpha")[0] + 0.125j * math.pi) / abs(lift))
    assert math.log2(errors[0] / errors[1]) > 1.3


def test_step_follows_wagner_from_two_panels_on() -> None:
    solver = plate(12)
    s = np.arange(0.0, 20.0, 0.16)
    history = solver.unsteady(STILL, AlphaStep(STILL, 0.01), reduced(s, solver))
    final = solver.steady(FlightCondition(0.1, alpha=0.01))["CN"]
    late = s >= 1.0
    assert np.max(np.abs(history["CN"][late] / final / wagner(s[late]) - 1.0)) < 0.02
    assert np.max(np.abs(history["CN"][s >= 3.0] / final / wagner(s[s >= 3.0]) - 1.0)) < 0.006


@pytest.mark.parametrize("chordwise", [1, 3, 8])
def test_jump_has_the_impulse_of_a_plate_s_added_mass(chordwise: int) -> None:
    # rho pi c^2/4 per unit velocity: in coefficients and reduced time pi per unit of alpha
    linear = plate(chordwise).linearise(STILL)
    assert linear.impulse("alpha")[2] == pytest.approx(math.pi, rel=3e-3)


def test_history_of_a_jump_keeps_its_impulse() -> None:
    solver = plate(6)
    s = np.array([0.0, 0.4, 0.8])
    history = solver.unsteady(STILL, AlphaStep(STILL, 0.01), reduced(s, solver))
    assert history.provenance["impulse"]["CN"] / 0.01 == pytest.approx(math.pi, rel=3e-3)
    smooth = solver.unsteady(STILL, SteadyMotion(STILL), reduced(s, solver))
    assert smooth.provenance["impulse"]["CN"] == 0.0


def test_march_from_a_steady_state_stays_there() -> None:
    for wake in ("shed", "frozen"):
        solver = tailed(wake)
        condition = FlightCondition(0.3, alpha=0.1, beta=0.02)
        s = np.concatenate([[0.0], np.cumsum([0.1, 0.5, 2.0, 0.3, 1.0])])
        history = solver.unsteady(condition, SteadyMotion(condition), reduced(s, solver, condition))
        assert np.allclose(history.coefficients, history.before, atol=1e-12)


def test_step_settles_on_the_steady_state_after_it() -> None:
    solver = tailed()
    condition = FlightCondition(0.2, alpha=0.02)
    s = np.concatenate([[0.0], np.cumsum(0.2 * 1.12 ** np.arange(48))])
    history = solver.unsteady(condition, PitchRateStep(condition, 0.5), reduced(s, solver, condition))
    after = solver.steady(condition, Rates(q=0.5))
    change = after.coefficients - history.before
    assert np.allclose(history.coefficients[-1] - history.before, change, atol=2e-3 * np.max(np.abs(change)))


def test_jones_indicial_functions_of_elliptic_wings() -> None:
    # R. T. Jones, NACA Report 681 (1940): lift over its final value 1 - 0.283 exp(-0.540 t) at AR 3,
    # 1 - 0.361 exp(-0.381 t) at AR 6, t in half chords; approximations, of the circulatory lift
    for aspect_ratio, drop, rate in ((3.0, 0.283, 0.540), (6.0, 0.361, 0.381)):
        root = 8.0 / (math.pi * aspect_ratio)
        y = np.sin(np.linspace(0.0, 0.5 * math.pi - 0.05, 14))
        chords = root * np.sqrt(1.0 - y**2)
        stations = tuple(SpanStation(-0.5 * c, v, 0.0, c) for v, c in zip(y, chords, strict=True))
        wing = LiftingSurface("elliptic", stations)
        lattice = Lattice.of(wing, chordwise=6, spanwise=16)
        solver = LatticeSolver(lattice, wing.reference((0.0, 0.0, 0.0)), LatticeSettings(compressible=False))
        # Jones counts half chords of the mean chord, span^2/AR
        s = np.arange(0.0, 12.0, 0.25)
        history = solver.unsteady(STILL, AlphaStep(STILL, 0.01), s * wing.area / wing.span / (2.0 * STILL.speed))
        final = solver.steady(FlightCondition(0.1, alpha=0.01))["CN"]
        late = s >= 2.0
        jones = 1.0 - drop * np.exp(-rate * s[late])
        assert np.max(np.abs(history["CN"][late] / final - jones)) < 0.03


def test_linear_response_at_rest_is_the_moving_frame_s() -> None:
    for wake, alpha in (("shed", 0.0), ("shed", 0.1)):
        solver = tailed(wake)
        condition = FlightCondition(0.3, alpha=alpha)
        response = solver.frequency_response(condition)
        amplitudes = dict.fromkeys(("alpha", "beta", "p", "q", "r"), 0.0001)
        frame = moving_frame.run(
            solver, condition, ("alpha", "beta", "p", "q", "r"), amplitudes=amplitudes, second=None
        )
        size = max(abs(value) for value in frame.values.values())
        for name, value in frame.values.items():
            load, _, motion = name.partition("_")
            if motion != "0":
                # a helical wake is followed in pieces
                assert response.at_zero(load, motion)[0] == pytest.approx(value, abs=1e-4 * size)


@pytest.mark.parametrize("motion", ["plunge", "pitch_rate"])
def test_forced_oscillation_converges_on_the_linear_response_with_the_square_of_the_step(motion: str) -> None:
    solver = tailed(chordwise=2, spanwise=4)
    condition = FlightCondition(0.3, alpha=0.05)
    source = {"plunge": "alpha", "pitch_rate": "q"}[motion]
    response = solver.frequency_response(condition, [0.4], (source,))
    exact = {load: response.channel(load, source)[0] for load in ("CN", "Cm")}
    errors = []
    for steps in (24, 48):
        history = forced_oscillation.run(solver, condition, 1e-3, 0.4, motion, periods=3, steps_per_period=steps)  # type: ignore[arg-type]
        reading = forced_oscillation.fourier(history, 1)
        worst = 0.0
        for load, h in exact.items():
            in_phase, out = reading.value(load, "in_phase"), reading.value(load)
            # pitch_rate: out of phase Re H, in phase -k Im H
            found = in_phase + 0.4j * out if motion == "plunge" else out - 1j * in_phase / 0.4
            worst = max(worst, abs(found / h - 1.0))
        errors.append(worst)
    assert errors[1] < 0.01
    assert errors[0] / errors[1] > 3.0


def test_indicial_derivatives_are_those_of_the_linear_response() -> None:
    # with the impulse in the deficiency's integral; the first two panels' time after a jump is what is not resolved
    wing = LiftingSurface.wing("wing", 6.0, 1.0)
    lattice = Lattice.of(wing, chordwise=10, spanwise=5)
    solver = LatticeSolver(lattice, wing.reference((0.25, 0.0, 0.0)), LatticeSettings(compressible=False))
    s = indicial_response.step_times(0.1, 1.06, 1.0, 120.0)
    history = indicial_response.run(solver, STILL, 0.005, s, "alpha")
    final = solver.steady(FlightCondition(0.1, alpha=0.005))
    response = solver.frequency_response(STILL, (), ("alpha", "alphadot"))
    read = indicial_response.read(history, final)
    found = indicial_response.derive(read, noise=1e-6)
    assert found["CN_alpha"] == pytest.approx(response.at_zero("CN", "alpha")[0], rel=1e-4)
    for load in ("CN", "Cm"):
        impulse = response.direct[4 if load == "Cm" else 2, 1]
        assert read.impulse[load] == pytest.approx(impulse, rel=1e-4)
        # against the two parts that make it up
        gap = found[f"{load}_alphadot"] - response.at_zero(load, "alpha")[1]
        assert abs(gap) < 0.15 * abs(impulse)


def test_lateral_steps_have_the_derivatives_of_the_linear_response() -> None:
    """Steps in beta, p and r of a wing with dihedral and a fin: limits, betadot, and the loads a step does not move."""
    wing = LiftingSurface.wing("wing", 6.0, 1.0, dihedral=0.1)
    fin = LiftingSurface("fin", (SpanStation(2.0, 0.0, 0.2, 0.6), SpanStation(2.2, 0.0, 1.0, 0.4)), symmetric=False)
    lattice = Lattice.of([wing, fin], chordwise=6, spanwise=5)
    solver = LatticeSolver(lattice, wing.reference((0.25, 0.0, 0.0)), LatticeSettings(compressible=False))
    s = indicial_response.step_times(0.15, 1.07, 2.0, 160.0)
    response = solver.frequency_response(STILL, (), ("beta", "p", "r"))
    steps = {}
    for kind, size in (("beta", 0.005), ("p", 0.005), ("r", 0.005)):
        history = indicial_response.run(solver, STILL, size, s, kind)  # type: ignore[arg-type]
        condition, rates = indicial_response.after(
            indicial_response.experiment(STILL, solver.reference, size, kind)  # type: ignore[arg-type]
        )
        steps[kind] = indicial_response.read(history, solver.steady(condition, rates))
        assert steps[kind].kind == kind
        for load in ("CY", "Cl", "Cn"):
            exact = response.at_zero(load, kind)[0]
            assert steps[kind][load][-1] == pytest.approx(exact, rel=2e-3, abs=2e-3)
        opposite = indicial_response.run(solver, STILL, -size, s[:12], kind)  # type: ignore[arg-type]
        mirrored = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0]) * opposite.coefficients
        assert mirrored == pytest.approx(history.coefficients[:12], abs=1e-12)
    found = indicial_response.derive_lateral(steps["beta"], steps["p"], steps["r"], noise=1e-6)
    table = operator.derivatives(response)
    for load in ("CY", "Cl", "Cn"):
        for motion in ("beta", "p", "r"):
            assert found[f"{load}_{motion}"] == pytest.approx(response.at_zero(load, motion)[0], rel=1e-3, abs=1e-4)
        exact = table.value(f"{load}_betadot", k=None)
        impulse = steps["beta"].impulse[load] * float(
            solver.reference.moment_lengths[1] / solver.reference.moment_lengths[0]
        )
        assert abs(found[f"{load}_betadot"] - exact) < 0.15 * abs(impulse) + 0.02 * abs(exact)
    assert found.derivatives().value("Cl_p") == found["Cl_p"]
    with pytest.raises(InputError, match="derive_lateral needs"):
        indicial_response.derive_lateral(steps["p"])


@pytest.mark.parametrize("alpha", [0.0, 0.08])
def test_state_space_is_the_march_with_a_frozen_wake(alpha: float) -> None:
    solver = tailed("frozen", chordwise=2, spanwise=3)
    condition = FlightCondition(0.3, alpha=alpha)
    model = discrete(solver.linearise(condition), 0.3, 15.0, ("alpha", "q", "p"))
    n = np.arange(40)
    t = reduced(0.3 * n, solver, condition)
    inputs = 1e-6 * np.stack([np.sin(0.3 * n), 1.0 - np.cos(0.2 * n), 0.1 * n], axis=1)
    angles = condition.alpha + inputs[:, 0]
    velocity = condition.speed * np.stack([np.cos(angles), 0.0 * angles, np.sin(angles)], axis=1)
    rates = np.stack([inputs[:, 2], inputs[:, 1], 0.0 * angles], axis=1) / solver.reference.rate_scale(condition.speed)
    history = solver.unsteady(condition, TabulatedMotion(t, velocity, rates), t)
    found, wanted = model.respond(inputs), history.coefficients - history.before
    # the march has first-order differences at its first step
    assert np.allclose(found[3:], wanted[3:], atol=1e-4 * np.max(np.abs(wanted)))
    assert model.system().dt == pytest.approx(0.3)


def test_state_space_has_the_linear_response_s_limit() -> None:
    solver = tailed("frozen", chordwise=2, spanwise=3)
    response = solver.frequency_response(STILL, [0.05], ("alpha", "q"))
    model = discrete(solver.linearise(STILL), 0.3, 40.0, ("alpha", "q"))
    assert np.allclose(model.frequency_response([0.0])[0].real, response.static, atol=1e-9 * np.max(response.static))
    slow = model.frequency_response([0.05])[0]
    assert np.allclose(slow, response.values[0], atol=3e-3 * np.max(np.abs(slow)))
    assert np.max(np.abs(np.linalg.eigvals(model.a))) < 1.0
    lifting = tailed("shed").linearise(FlightCondition(0.3, alpha=0.1))
    with pytest.raises(InputError, match="frozen"):
        discrete(lifting, 0.3, 3.0)


def test_operator_method_runs_on_the_lattice() -> None:
    table = operator.derivatives(operator.run(tailed(), STILL, [0.2], ("alpha", "alphadot", "q", "beta", "p", "r")))
    assert table.value("Cl_p", k=None) < 0.0
    assert table.value("Cm_q", k=0.2) < 0.0


def test_vanishing_rotation_is_no_rotation() -> None:
    solver = tailed()
    condition = FlightCondition(0.2, alpha=0.04)
    slow = solver.steady(condition, Rates(p=1e-9, q=1e-9)).coefficients
    assert np.allclose(slow, solver.steady(condition).coefficients, atol=1e-8)


def test_any_motion_is_marched_and_bad_times_are_refused() -> None:
    solver = tailed()
    t = np.linspace(0.0, 0.2, 9)
    velocity = STILL.velocity + np.stack([0.0 * t, 2.0 * np.sin(40.0 * t), 3.0 * t], axis=1)
    motion = TabulatedMotion(t, velocity, np.stack([np.cos(30.0 * t), 0.2 * t, 0.0 * t], axis=1))
    history = solver.unsteady(STILL, motion, t)
    assert np.all(np.isfinite(history.coefficients))
    for bad in ([0.1, 0.2], [0.0, 0.2, 0.2], [0.0, math.nan]):
        with pytest.raises(InputError, match="times must"):
            solver.unsteady(STILL, motion, bad)


THREADS = """
import numba, numpy as np
from indicial.cfd.lattice import Lattice, LatticeSolver
from indicial.cfd.shapes import LiftingSurface
from indicial.motion import AlphaStep, FlightCondition
wing = LiftingSurface.wing("wing", 6.0, 1.0)
condition, found = FlightCondition(0.2, alpha=0.05), []
for threads in (1, 2):
    numba.set_num_threads(threads)
    solver = LatticeSolver(Lattice.of(wing, chordwise=4, spanwise=8), wing.reference((0.25, 0.0, 0.0)))
    found.append(solver.unsteady(condition, AlphaStep(condition, 0.05), 0.004 * np.arange(8)).coefficients)
assert np.array_equal(*found)
"""


@pytest.mark.slow
def test_loads_do_not_depend_on_the_number_of_threads() -> None:
    environment = os.environ | {"NUMBA_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "1"}
    subprocess.run([sys.executable, "-c", THREADS], check=True, env=environment)
