"""The time-spectral equations: D, their Jacobian, their linear limit, and what happens when they fail."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from indicial.cfd import FiniteVolumeSolver, FlowSettings
from indicial.cfd.flow import STILL_AIR, Grid, Jacobian, MeshMotion, Residual
from indicial.cfd.flow.gas import conservative_jacobian
from indicial.cfd.march import Pattern, PeriodicState, converge_periodic
from indicial.cfd.march.time_spectral import PeriodicResidual, resample, spectral_derivative
from indicial.cfd.mesh import box_mesh, plate_mesh
from indicial.conventions import ReferenceQuantities
from indicial.errors import DivergenceError, InputError
from indicial.files import Checkpoint
from indicial.motion import AlphaStep, FlightCondition, PitchOscillation, Rates, SteadyMotion
from indicial.solver import PeriodicSolver, instants

REFERENCE = ReferenceQuantities(1.0, 1.0, (0.3, 0.2, 0.1))
CONDITION = FlightCondition(2.0)
ALL_KINDS = {"x_min": "wall", "x_max": "outflow", "y_min": "symmetry", "y_max": "wall"}


def plate(cells: int = 16, folder: Path | None = None, settings: FlowSettings | None = None) -> FiniteVolumeSolver:
    mesh = plate_mesh(n_chord=cells, n_normal=3 * cells // 4, height=0.4, ahead=0.2, behind=0.1)
    return FiniteVolumeSolver(mesh, ReferenceQuantities(1.0, 1.0), settings, folder=folder)


def pitching(amplitude: float, k: float = 0.2) -> PitchOscillation:
    return PitchOscillation.from_reduced_frequency(CONDITION, ReferenceQuantities(1.0, 1.0), amplitude, k)


def motions(count: int) -> list[MeshMotion]:
    rng = np.random.default_rng(7)
    still = MeshMotion(np.array([-2.0, 0.3, 0.5]), np.array([0.3, -0.5, 0.2]))
    return [
        MeshMotion(still.velocity + 0.1 * rng.standard_normal(3), still.omega + 0.1 * rng.standard_normal(3))
        for _ in range(count)
    ]


def states(grid: Grid, count: int, size: float = 0.1) -> np.ndarray:
    rng = np.random.default_rng(1)
    q = STILL_AIR * (1.0 + size * rng.uniform(-1.0, 1.0, (count, grid.n_cells, 5)))
    q[..., 1:4] = 5.0 * size * rng.uniform(-1.0, 1.0, (count, grid.n_cells, 3))
    return q


@pytest.mark.parametrize("harmonics", [1, 2, 3, 8])
def test_the_spectral_derivative_is_exact_for_the_harmonics_that_it_resolves(harmonics: int) -> None:
    phase, d = instants(harmonics), spectral_derivative(harmonics)
    rng = np.random.default_rng(harmonics)
    n = np.arange(harmonics + 1)
    a, b = rng.standard_normal((2, n.size))
    values = np.cos(np.outer(phase, n)) @ a + np.sin(np.outer(phase, n)) @ b
    slopes = -np.sin(np.outer(phase, n)) @ (n * a) + np.cos(np.outer(phase, n)) @ (n * b)
    assert d @ values == pytest.approx(slopes, abs=1e-12 * harmonics**2)
    assert d == pytest.approx(-d.T, abs=1e-15)


@pytest.mark.parametrize("harmonics", [1, 2, 5])
def test_resampling_is_exact_upwards_and_leaves_out_the_higher_harmonics_downwards(harmonics: int) -> None:
    n = np.arange(3)
    a, b = np.random.default_rng(2).standard_normal((2, n.size, 4))

    def series(h: int, kept: int) -> np.ndarray:
        phases = np.outer(instants(h), n[: kept + 1])
        return np.cos(phases) @ a[: kept + 1] + np.sin(phases) @ b[: kept + 1]

    assert resample(series(2, 2), harmonics) == pytest.approx(series(harmonics, min(harmonics, 2)), abs=1e-14)


@pytest.mark.parametrize("harmonics", [0, -1, 1.5, np.nan, np.inf])
def test_harmonics_are_whole_numbers_from_one(harmonics: float) -> None:
    with pytest.raises(InputError, match="harmonics"):
        instants(harmonics)  # type: ignore[arg-type]


def test_an_even_number_of_instants_is_refused() -> None:
    grid = Grid.from_mesh(box_mesh((2, 2, 2), skew="none"), REFERENCE)
    with pytest.raises(InputError, match="odd"):
        PeriodicResidual(Residual(grid), motions(4), 1.0)


@pytest.mark.parametrize("harmonics", [1, 2])
def test_the_coupled_jacobian_is_the_complex_step_of_the_coupled_residual(harmonics: int) -> None:
    count = 2 * harmonics + 1
    grid = Grid.from_mesh(box_mesh((5, 4, 5), skew="random", kinds=ALL_KINDS), REFERENCE)  # type: ignore[arg-type]
    periodic = PeriodicResidual(Residual(grid), motions(count), 0.7)
    q = states(grid, count)
    x = np.random.default_rng(3).standard_normal(q.shape)
    exact = PeriodicResidual(Residual(grid), motions(count), 0.7)(q + 1e-30j * x).imag / 1e-30
    found = periodic.linearise(q, np.zeros(q.shape[:2])).apply(x)
    assert np.max(np.abs(found - exact)) < 1e-12 * np.max(np.abs(exact))


def test_the_preconditioner_is_exact_for_equal_instants_on_a_row_of_cells() -> None:
    """There block ILU is a direct solver and the means are the instants' own: all to single precision."""
    grid = Grid.from_mesh(box_mesh((12, 1, 1), skew="none", kinds=ALL_KINDS), REFERENCE)  # type: ignore[arg-type]
    motion = motions(1) * 5
    periodic = PeriodicResidual(Residual(grid, second_order=False), motion, 0.7)
    q = np.repeat(states(grid, 1, 0.05), 5, axis=0)
    jacobian = periodic.linearise(q, np.full(q.shape[:2], 3.0))
    x = np.random.default_rng(4).standard_normal(q.shape)
    assert jacobian.preconditioner(Pattern.of(grid))(jacobian.apply(x)) == pytest.approx(x, abs=1e-3)


def test_a_motion_that_is_steady_gives_the_steady_loads_at_every_instant() -> None:
    solver, condition = plate(), FlightCondition(2.0, alpha=0.02)
    steady = solver.steady(condition).coefficients
    history = solver.periodic(condition, SteadyMotion(condition), 0.01, 2)
    assert isinstance(solver, PeriodicSolver)
    assert history.coefficients == pytest.approx(np.tile(steady, (5, 1)), abs=1e-8 * np.max(np.abs(steady)))


def test_a_small_oscillation_is_the_frequency_response_of_the_same_linearised_flow() -> None:
    """``H = D - C (i omega V E + J)^-1 B`` by dense algebra, every factor by differences of the residual itself."""
    solver = plate(8)
    motion, unit = pitching(1e-5), CONDITION.speed_of_sound
    history = solver.periodic(CONDITION, motion, motion.period, 1)
    found = np.fft.rfft(history.coefficients[:, [2, 4]], axis=0)[1] / 3.0 * 2.0

    residual, grid = Residual(solver.grid), solver.grid
    steady = solver._state(CONDITION, CONDITION.velocity, np.zeros(3))
    q, omega, n = steady.q, motion.omega / unit, steady.q.size
    jacobian = Jacobian(residual, q, steady.motion)
    j = np.stack([jacobian.apply(e.reshape(q.shape)).ravel() for e in np.eye(n)], axis=1).astype(complex)
    for cell, block in enumerate(grid.volume[:, None, None] * conservative_jacobian(q)):
        j[5 * cell : 5 * cell + 5, 5 * cell : 5 * cell + 5] += 1j * omega * block

    def at(state: np.ndarray, a: float, rate: float) -> tuple[np.ndarray, np.ndarray]:
        """Residual, and (CN, Cm), at angle a [rad] and pitch rate."""
        turned = replace(CONDITION, alpha=a)
        r = residual(state, solver._mesh_motion(turned, turned.velocity, np.array([0.0, rate, 0.0])))
        return r, solver._coefficients(*residual.forces(1.0 / 1.4), CONDITION)[[2, 4]]

    h = 1e-6
    turn = motion.omega
    slope = [
        tuple((up - down) / (2.0 * h) for up, down in zip(at(q, h, 0.0), at(q, -h, 0.0), strict=True)),
        tuple((up - down) / (2.0 * h) for up, down in zip(at(q, 0.0, h * turn), at(q, 0.0, -h * turn), strict=True)),
    ]
    # alpha = A sin wt = Re(-i A exp(iwt)), q = A w cos wt
    r_input = -1j * slope[0][0] + slope[1][0]
    load = -1j * slope[0][1] + slope[1][1]
    x = np.linalg.solve(j, -r_input.ravel()).reshape(q.shape)
    for part, factor in ((x.real, 1.0), (x.imag, 1.0j)):
        change = at(q + h * part, 0.0, 0.0)[1] - at(q - h * part, 0.0, 0.0)[1]
        load = load + factor * change / (2.0 * h)
    assert found / motion.amplitude == pytest.approx(load, rel=2e-5)


def test_more_harmonics_leave_the_first_of_a_small_oscillation_alone() -> None:
    solver, motion = plate(8), pitching(1e-4)
    first = [
        np.fft.rfft(solver.periodic(CONDITION, motion, motion.period, h).coefficients[:, 2])[1] / (2 * h + 1)
        for h in (1, 3)
    ]
    assert first[1] == pytest.approx(first[0], rel=1e-4)


def test_a_motion_that_does_not_repeat_itself_is_refused() -> None:
    motion = pitching(0.01)
    with pytest.raises(InputError, match="repeat"):
        plate().periodic(CONDITION, motion, 0.9 * motion.period)
    for period in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="period"):
            plate().periodic(CONDITION, AlphaStep(CONDITION, 0.01), period)


def test_a_mirror_is_not_crossed() -> None:
    spinning = SteadyMotion(CONDITION, Rates(p=1.0))
    with pytest.raises(InputError, match="symmetry plane"):
        plate().periodic(CONDITION, spinning, 1.0)


def test_a_periodic_flow_that_does_not_converge_says_so_and_keeps_its_states(tmp_path: Path) -> None:
    plate(folder=tmp_path).steady(CONDITION)
    hasty = plate(folder=tmp_path, settings=FlowSettings(steady_iterations=1))
    motion = pitching(np.radians(4.0))
    with pytest.raises(DivergenceError, match="periodic solution stopped at a residual of") as caught:
        hasty.periodic(CONDITION, motion, motion.period, 2)
    states = np.asarray(caught.value.state)
    assert states.shape == (5, hasty.grid.n_cells, 5)
    [kept] = tmp_path.glob("diverged-*.npz")
    assert str(kept) in str(caught.value)
    with np.load(kept) as stored:
        assert np.array_equal(stored["q"], states)
    assert np.all(states[..., [0, 4]] > 0.0)


@pytest.mark.parametrize("saves", [2, 6], ids=["first-order phase", "second-order phase"])
def test_a_killed_periodic_solution_goes_on_as_if_it_had_never_stopped(
    saves: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    solver, motion = plate(8), pitching(np.radians(4.0))
    unit, phase = CONDITION.speed_of_sound, instants(1)
    t = motion.period * phase / (2.0 * np.pi)
    given = [solver._mesh_motion(CONDITION, motion.velocity(now), motion.rate(now)) for now in t]
    start = np.broadcast_to(STILL_AIR, (solver.grid.n_cells, 5))

    def found(checkpoint: Checkpoint | None) -> PeriodicState:
        return converge_periodic(
            Residual(solver.grid), Pattern.of(solver.grid), given, motion.omega / unit, start, checkpoint=checkpoint
        )

    class Killed(BaseException):
        pass

    class Mortal(Checkpoint):
        left = saves

        def save(self, **arrays: np.ndarray) -> None:
            super().save(**arrays)
            self.left -= 1
            if self.left == 0:
                raise Killed

    whole = found(None)
    path = tmp_path / "periodic.npz"
    with pytest.raises(Killed):
        found(Mortal(path, "this one", interval=0.0))
    kept = Checkpoint(path, "this one").load()
    assert kept is not None
    assert bool(kept["second_order"][-1]) is (saves == 6)
    resumed = found(Checkpoint(path, "this one"))
    assert np.array_equal(resumed.q, whole.q)
    for name, values in whole.history.to_arrays().items():
        assert np.array_equal(values, resumed.history.to_arrays()[name]), name
    assert not path.exists()


def test_a_periodic_solution_that_fails_leaves_nothing_to_fail_from_again(tmp_path: Path) -> None:
    saved = []

    class Watched(Checkpoint):
        def save(self, **arrays: np.ndarray) -> None:
            super().save(**arrays)
            saved.append(self.path.exists())

    grid = plate(8).grid
    checkpoint = Watched(tmp_path / "periodic.npz", "this one", interval=0.0)
    start = np.broadcast_to(STILL_AIR, (grid.n_cells, 5))
    with pytest.raises(DivergenceError, match="no more steps"):
        converge_periodic(Residual(grid), Pattern.of(grid), motions(3), 1.0, start, iterations=1, checkpoint=checkpoint)
    assert saved == [True]
    assert not checkpoint.path.exists()


def test_a_flow_of_fewer_harmonics_starts_one_of_more_nearer_and_to_the_same_end() -> None:
    solver, motion = plate(8), pitching(np.radians(1.0))
    given = {}
    for h in (1, 2):
        times = motion.period * instants(h) / (2.0 * np.pi)
        given[h] = [solver._mesh_motion(CONDITION, motion.velocity(t), motion.rate(t)) for t in times]
    residual, pattern, omega = Residual(solver.grid), Pattern.of(solver.grid), motion.omega / CONDITION.speed_of_sound
    steady = solver._state(CONDITION, CONDITION.velocity, np.zeros(3)).q
    one = converge_periodic(residual, pattern, given[1], omega, steady)
    direct = converge_periodic(residual, pattern, given[2], omega, steady)
    stepped = converge_periodic(residual, pattern, given[2], omega, one.q)
    assert stepped.q == pytest.approx(direct.q, abs=1e-8)
    assert np.all(stepped.history.second_order)
    assert stepped.history.residual[0] < 0.2 * direct.history.residual[direct.history.second_order][0]
    again = converge_periodic(residual, pattern, given[2], omega, direct.q)
    assert again.history.steps <= 1


def test_a_start_at_instants_that_make_no_flow_is_refused() -> None:
    grid = plate(8).grid
    residual, pattern = Residual(grid), Pattern.of(grid)
    still = np.broadcast_to(STILL_AIR, (3, grid.n_cells, 5)).copy()
    with pytest.raises(InputError, match="2 instants"):
        converge_periodic(residual, pattern, motions(5), 1.0, still[:2])
    still[1, 0, 0] *= 10.0
    with pytest.raises(InputError, match="positive density"):
        converge_periodic(residual, pattern, motions(5), 1.0, still)


def test_a_killed_solver_resumes_its_periodic_flow_from_its_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A save is due at every look at the clock, as if each Newton step took a minute."""
    clock = iter(range(0, 10**6, 60))
    monkeypatch.setattr("indicial.files.time", SimpleNamespace(monotonic=lambda: next(clock)))
    motion = pitching(np.radians(1.0))
    whole = plate(8).periodic(CONDITION, motion, motion.period)

    class Killed(BaseException):
        pass

    plate(8, tmp_path).steady(CONDITION)
    solver, told = plate(8, tmp_path), []

    def kill(fraction: float) -> None:
        told.append(fraction)
        if len(told) == 3:
            raise Killed

    solver._progress = kill
    with pytest.raises(Killed):
        solver.periodic(CONDITION, motion, motion.period)
    [kept] = tmp_path.glob("periodic-*.npz")
    resumed = plate(8, tmp_path).periodic(CONDITION, motion, motion.period)
    assert np.array_equal(resumed.coefficients, whole.coefficients)
    assert not kept.exists()
