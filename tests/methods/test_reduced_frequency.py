"""The reduced-frequency method against exact systems, exact theory and the march."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache

import matplotlib as mpl
import numpy as np
import pytest

from indicial.cfd import FiniteVolumeSolver, FlowSettings
from indicial.cfd.mesh import airfoil_mesh, plate_mesh
from indicial.cfd.shapes import Airfoil
from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.history import History
from indicial.methods import forced_oscillation, reduced_frequency
from indicial.methods.reduced_frequency import PeriodicLoads
from indicial.motion import FlightCondition, Motion, PitchOscillation, SteadyMotion
from indicial.solver import instants
from theory.linear import LinearSystem, random_system
from theory.plate import frequency_response

mpl.use("Agg")

REFERENCE = ReferenceQuantities(length=0.4, area=0.5, moment_reference=(0.3, 0.0, 0.0))
CONDITION = FlightCondition(1.4, alpha=0.02)
A, K = 0.01, 0.15
CHORD = ReferenceQuantities(1.0, 1.0)


@dataclass(frozen=True)
class PeriodicSystem:
    """A linear system with a known distortion, sampled long after its start."""

    system: LinearSystem

    @property
    def reference(self) -> ReferenceQuantities:
        return self.system.reference

    def periodic(self, condition: FlightCondition, motion: Motion, period: float, harmonics: int = 1) -> History:
        phase = instants(harmonics)
        times = period * np.concatenate([[0.0], 12.0 + phase / (2.0 * np.pi)])
        late = self.system.unsteady(condition, motion, times)
        kept = {name: getattr(late, name)[1:] for name in ("coefficients", "velocity", "rate")}
        return replace(late, time=times[1:] - times[1], before=kept["coefficients"][0], **kept)


class UntouchedSolver:
    """Refuses to be asked for anything but its reference."""

    reference = REFERENCE

    def periodic(self, *_: object) -> History:
        raise AssertionError("the input must be refused before the solver is asked")


def cubic(inputs: np.ndarray) -> np.ndarray:
    """Extra Cm of 3 (alpha - alpha0)^2 + 40 (alpha - alpha0)^3."""
    loads = np.zeros((*inputs.shape[:-1], 6))
    change = inputs[..., 0] - CONDITION.alpha
    loads[..., 4] = 3.0 * change**2 + 40.0 * change**3
    return loads


@pytest.mark.parametrize("motion", ["pitch", "plunge", "pitch_rate"])
@pytest.mark.parametrize("harmonics", [1, 3])
def test_the_first_harmonic_of_a_linear_system_is_its_frequency_response(motion: str, harmonics: int) -> None:
    system = random_system(REFERENCE)
    loads = reduced_frequency.run(PeriodicSystem(system), CONDITION, A, K, motion, harmonics)  # type: ignore[arg-type]
    h = system.transfer(K)
    total = (h[:, 0] if motion != "pitch_rate" else 0.0) + 1j * K * (h[:, 3] if motion != "plunge" else 0.0)
    reading = loads.reading()
    assert reading.in_phase == pytest.approx(np.real(total), abs=1e-6)
    assert reading.out_of_phase == pytest.approx(np.imag(total) / K, abs=1e-6)
    assert reading.k == pytest.approx(K)
    assert loads.harmonics == harmonics
    assert np.max(np.abs(loads.sine[1:]), initial=0.0) < 1e-8


def test_three_harmonics_hold_a_cubic_load_exactly() -> None:
    """``sin^2 = (1 - cos 2wt)/2``, ``sin^3 = (3 sin wt - sin 3wt)/4``."""
    plain = random_system(REFERENCE)
    straight = reduced_frequency.run(PeriodicSystem(plain), CONDITION, A, K, "plunge", 3)
    loads = reduced_frequency.run(PeriodicSystem(replace(plain, distortion=cubic)), CONDITION, A, K, "plunge", 3)
    square, cube = 3.0 * A**2, 40.0 * A**3
    assert loads.mean[4] - straight.mean[4] == pytest.approx(square / 2.0, rel=1e-6)
    assert loads.sine[0, 4] - straight.sine[0, 4] == pytest.approx(0.75 * cube, rel=1e-6)
    assert loads.cosine[1, 4] == pytest.approx(-square / 2.0, rel=1e-6)
    assert loads.sine[2, 4] == pytest.approx(-cube / 4.0, rel=1e-6)
    energy = loads.sine[:, 4] ** 2 + loads.cosine[:, 4] ** 2
    assert loads.distortion("Cm") == pytest.approx(np.sqrt((energy[1] + energy[2]) / energy.sum()))
    assert loads.distortion("CN") < 1e-9


def test_a_second_harmonic_is_folded_onto_the_first_by_three_instants() -> None:
    """``cos 2wt = cos wt`` at wt = 0, 120 and 240 degrees: what one harmonic cannot tell, two can."""
    solver = PeriodicSystem(replace(random_system(REFERENCE), distortion=cubic))
    one, two = (reduced_frequency.run(solver, CONDITION, A, K, "plunge", h) for h in (1, 2))
    assert one.cosine[0, 4] - two.cosine[0, 4] == pytest.approx(-3.0 * A**2 / 2.0, rel=1e-2)
    assert one.cosine[0, 2] == pytest.approx(two.cosine[0, 2], rel=1e-6)


def test_the_series_runs_through_the_instants_and_its_history_is_read_by_every_reduction() -> None:
    solver = PeriodicSystem(replace(random_system(REFERENCE), distortion=cubic))
    oscillation = forced_oscillation.experiment(CONDITION, REFERENCE, A, K)
    history = solver.periodic(CONDITION, oscillation, oscillation.period, 3)
    loads = reduced_frequency.read(history)
    assert loads.at(instants(3)) == pytest.approx(history.coefficients, abs=1e-12)
    dense = loads.history(96)
    assert dense.time.size == 97
    assert dense.coefficients[0] == pytest.approx(dense.coefficients[-1], abs=1e-12)
    # a long march of the same system, at the same 96 phases
    marched = forced_oscillation.run(solver.system, CONDITION, A, K, periods=12, steps_per_period=96)
    for reduce in (forced_oscillation.phase_angle, forced_oscillation.regression, forced_oscillation.fourier):
        assert reduce(dense).out_of_phase == pytest.approx(reduce(marched, 1).out_of_phase, abs=1e-6)
    assert loads.difference(marched, "Cm") < 1e-6


def test_the_difference_of_loops_is_the_root_mean_square_over_the_half_range() -> None:
    """Of one harmonic from a load with a second one of amplitude a beside a first of amplitude 1: a/sqrt 2."""
    a = 1e-3
    shape = np.zeros(6)
    shape[2] = 1.0
    base = PeriodicLoads("pitch", K, A, 0.0 * shape, shape[None], 0.0 * shape[None], CONDITION, REFERENCE)
    more = replace(base, sine=np.stack([shape, a * shape]), cosine=np.zeros((2, 6)))
    history = more.history(512)
    half_range = 0.5 * np.ptp(history["CN"])
    assert base.difference(history, "CN") == pytest.approx(a / np.sqrt(2.0) / half_range, rel=1e-6)
    other = replace(base, amplitude=2.0 * A)
    for stranger in (other.history(), replace(base, motion="plunge").history()):
        with pytest.raises(InputError, match="not of the motion"):
            base.difference(stranger, "CN")


def test_records_carry_method_frequency_and_amplitude() -> None:
    loads = reduced_frequency.run(PeriodicSystem(random_system(REFERENCE)), CONDITION, A, K)
    table = loads.derivatives("linear system")
    assert table.names() == ("CN_alpha", "CN_q+CN_alphadot", "Cm_alpha", "Cm_q+Cm_alphadot")
    for record in table:
        assert (record.method, record.reduction, record.source) == ("reduced_frequency", None, "linear system")
        assert record.k == pytest.approx(K)
        assert record.amplitude_deg == pytest.approx(np.degrees(A))
    assert table.value("Cm_alpha") == loads.reading().value("Cm", "in_phase")
    assert "harmonic" in loads.summary()
    axes = loads.plot("CN")
    assert axes.get_ylabel() == "CN"


@pytest.mark.parametrize("k", [0.0, -0.1, np.nan, np.inf])
def test_a_frequency_that_is_not_positive_is_refused_at_once(k: float) -> None:
    with pytest.raises(InputError, match="frequency"):
        reduced_frequency.run(UntouchedSolver(), CONDITION, A, k)


@pytest.mark.parametrize("amplitude", [0.0, np.nan, np.inf])
def test_an_amplitude_that_is_zero_or_not_finite_is_refused_at_once(amplitude: float) -> None:
    with pytest.raises(InputError, match="amplitude"):
        reduced_frequency.run(UntouchedSolver(), CONDITION, amplitude, K)


def test_other_nonsense_is_refused_at_once() -> None:
    for harmonics in (0, -2, 1.5, np.nan):
        with pytest.raises(InputError, match="harmonics"):
            reduced_frequency.run(UntouchedSolver(), CONDITION, A, K, harmonics=harmonics)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="no oscillation"):
        reduced_frequency.run(UntouchedSolver(), CONDITION, A, K, "yaw")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="can only march"):
        reduced_frequency.run(random_system(REFERENCE), CONDITION, A, K)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="no coefficient"):
        reduced_frequency.run(PeriodicSystem(random_system(REFERENCE)), CONDITION, A, K).distortion("CL")


def test_a_history_that_is_no_set_of_even_instants_is_refused() -> None:
    system = random_system(REFERENCE)
    with pytest.raises(InputError, match="no oscillation"):
        reduced_frequency.read(system.unsteady(CONDITION, SteadyMotion(CONDITION), [0.0, 1.0]))
    with pytest.raises(InputError, match="even instants"):
        reduced_frequency.read(forced_oscillation.run(system, CONDITION, A, K, periods=1))


@cache
def plate(cells: int) -> FiniteVolumeSolver:
    """Steps of a march solved so closely that only their length is left to see."""
    height = 0.62 / np.sqrt(2.0**2 - 1.0)
    mesh = plate_mesh(n_chord=cells, n_normal=int(0.75 * cells), height=height, ahead=3.0 / cells, behind=2.0 / cells)
    return FiniteVolumeSolver(mesh, CHORD, FlowSettings(unsteady_tolerance=1e-8))


@pytest.mark.parametrize("motion", ["pitch", "plunge"])
@pytest.mark.parametrize("k", [0.1, 0.2])
def test_on_the_supersonic_plate_it_equals_exact_theory(k: float, motion: str) -> None:
    """``H_a(ik) + ik H_q(ik)`` in pitch, ``H_a(ik)`` in plunge: no error in time, the mesh's alone."""
    loads = reduced_frequency.run(plate(32), FlightCondition(2.0), 1e-3, k, motion)  # type: ignore[arg-type]
    reading, h = loads.reading(), frequency_response(2.0, k)
    for column, load in enumerate(("CN", "Cm")):
        total = h[column] + (2.0j * k * h[2 + column] if motion == "pitch" else 0.0)
        print(load, reading.value(load, "in_phase") / total.real - 1, reading.value(load) / (total.imag / k) - 1)
        assert reading.value(load, "in_phase") == pytest.approx(total.real, rel=0.005)
        assert reading.value(load) == pytest.approx(total.imag / k, rel=0.005)


def test_at_finite_amplitude_it_tends_with_h_to_what_the_march_tends_to_with_its_step() -> None:
    """Five degrees at M 2: BDF2's error falls with the square of the step, so two marches tell their limit."""
    condition, amplitude, k = FlightCondition(2.0, alpha=np.radians(2.0)), np.radians(5.0), 0.3
    coarse, fine = (
        forced_oscillation.run(plate(16), condition, amplitude, k, periods=2, steps_per_period=n) for n in (32, 64)
    )
    extrapolated = fine.coefficients[::2] + (fine.coefficients[::2] - coarse.coefficients) / 3.0
    limit = replace(coarse, coefficients=extrapolated)
    few, many = (reduced_frequency.run(plate(16), condition, amplitude, k, harmonics=h) for h in (2, 5))
    for load in ("CN", "Cm"):
        print(load, few.difference(limit, load), many.difference(limit, load), many.difference(coarse, load))
        assert many.difference(limit, load) < 3e-4
        assert many.difference(limit, load) < 0.2 * few.difference(limit, load)
        assert many.difference(limit, load) < 0.2 * many.difference(coarse, load)
    with pytest.raises(InputError, match="does not move"):
        many.difference(limit, "CA")


@cache
def airfoil() -> FiniteVolumeSolver:
    mesh = airfoil_mesh(Airfoil.naca("0012"), n_around=48, n_normal=18, farfield=30.0)
    return FiniteVolumeSolver(mesh, ReferenceQuantities(1.0, 1.0, (0.25, 0.0, 0.0)))


def test_one_harmonic_holds_the_lift_loop_of_a_subcritical_airfoil() -> None:
    """NACA 0012, M 0.6, 2.89 + 2.41 sin wt deg, k 0.0808 (AGARD CT1), coarse: against the march's third period."""
    condition, amplitude, k = FlightCondition(0.6, alpha=np.radians(2.89)), np.radians(2.41), 0.0808
    history = forced_oscillation.run(airfoil(), condition, amplitude, k, periods=3, steps_per_period=48)
    marched = int(history.provenance["jacobian_products"])
    loads = reduced_frequency.run(airfoil(), condition, amplitude, k)
    spent = int(loads.provenance["jacobian_products"])
    print(loads.difference(history, "CN"), loads.difference(history, "Cm"), spent, marched)
    assert loads.difference(history, "CN") < 0.02
    assert spent < marched


def test_a_shock_that_comes_and_goes_converges() -> None:
    """M 0.755, 0.016 + 2.51 sin wt deg, k 0.0814 (AGARD CT5), coarse: all that the equations ask, to 1e-9."""
    condition, amplitude = FlightCondition(0.755, alpha=np.radians(0.016)), np.radians(2.51)
    loads = reduced_frequency.run(airfoil(), condition, amplitude, 0.0814, harmonics=2)
    assert loads.provenance["residual"] < 1e-9
    oscillation = loads.oscillation
    assert isinstance(oscillation, PitchOscillation)
    # nearly symmetric: half a period later all is nearly turned over
    assert abs(loads.mean[2]) < 0.05 * np.max(np.abs(loads.sine[0, 2]))
