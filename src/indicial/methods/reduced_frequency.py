r"""The reduced-frequency method: a periodic flow by a few harmonics, without a march.

Under ``alpha = alpha0 + A sin wt`` a load repeats itself as

    C = mean + sum_n ( sine_n sin n wt + cosine_n cos n wt ),   n = 1, ..., h,

and a solver that satisfies `indicial.solver.PeriodicSolver` finds it from 2h + 1 coupled instants of one period.
Nothing has to die out, and the amplitude is as finite as in a march: with enough harmonics the two are the same flow.
The first harmonic holds the derivatives just as a forced oscillation does: ``sine_1/A`` is in phase,
``cosine_1/(A k)`` out of phase (see `indicial.methods.forced_oscillation` for what they contain in each motion).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities, reduced_frequency
from indicial.derivatives import DerivativeTable
from indicial.errors import InputError
from indicial.history import History
from indicial.methods import forced_oscillation
from indicial.methods.forced_oscillation import KINDS, OscillationMotion, OscillationReading
from indicial.motion import FlightCondition, PitchOscillation, RollOscillation
from indicial.solver import PeriodicSolver, instants

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SAMPLES = 128
"""Instants of one period at which loops are drawn and read."""


@dataclass(frozen=True)
class PeriodicLoads:
    """Loads of a periodic flow as Fourier series.

    Parameters
    ----------
    motion : {"pitch", "plunge", "pitch_rate"}
    k, amplitude : float
        Reduced frequency and amplitude [rad].
    mean : ndarray
        Of (CA, CY, CN, Cl, Cm, Cn) over the period, shape (6,).
    sine, cosine : ndarray
        Coefficients of sin n wt and cos n wt, n = 1, ..., h, shape (h, 6).
    condition : FlightCondition
    reference : ReferenceQuantities
    provenance : dict
        How it was made: solver, mesh, products with the Jacobian, residual (plain values).
    """

    motion: OscillationMotion
    k: float
    amplitude: float
    mean: Array
    sine: Array
    cosine: Array
    condition: FlightCondition
    reference: ReferenceQuantities
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def harmonics(self) -> int:
        """h."""
        return len(self.sine)

    @property
    def oscillation(self) -> PitchOscillation | RollOscillation:
        """The motion that was forced."""
        return forced_oscillation.experiment(self.condition, self.reference, self.amplitude, self.k, self.motion)

    def at(self, phase: ArrayLike) -> Array:
        """The six loads at phases omega t, shape ``phase.shape + (6,)``."""
        angle = np.multiply.outer(np.asarray(phase, dtype=float), np.arange(1, self.harmonics + 1))
        loads: Array = self.mean + np.sin(angle) @ self.sine + np.cos(angle) @ self.cosine
        return loads

    def history(self, samples: int = SAMPLES) -> History:
        """One whole period in `samples` even steps, both ends included: the reductions of forced oscillation apply."""
        oscillation = self.oscillation
        times = forced_oscillation.sample_times(oscillation, 1, samples)
        loads = self.at(oscillation.omega * times)
        return History(
            time=times,
            coefficients=loads,
            velocity=oscillation.velocity(times),
            rate=oscillation.rate(times),
            before=loads[0],
            condition=self.condition,
            reference=self.reference,
            motion=oscillation.describe(),
            provenance=self.provenance,
        )

    def reading(self) -> OscillationReading:
        """In-phase and out-of-phase parts: the first harmonic, exactly."""
        return forced_oscillation.fourier(self.history(max(SAMPLES, 4 * self.harmonics)))

    def derivatives(self, source: str = "reduced frequency") -> DerivativeTable:
        """The records that the motion gives, method ``reduced_frequency``, with k and amplitude."""
        records = self.reading().derivatives(source)
        return DerivativeTable(tuple(replace(r, method="reduced_frequency", reduction=None) for r in records))

    def distortion(self, name: str) -> float:
        """Root mean square of the harmonics above the first over that of all: 0 for an ellipse, and for h = 1."""
        column = _column(name)
        energy = self.sine[:, column] ** 2 + self.cosine[:, column] ** 2
        return float(np.sqrt(energy[1:].sum() / max(energy.sum(), 1e-300)))

    def difference(self, history: History, name: str) -> float:
        """Root mean square difference of a load from a marched history of the same motion, over its last period.

        Relative to the half-range of the load in that period.

        Raises
        ------
        InputError
            If the history is of another motion or shorter than one period, or the load does not move.
        """
        column = _column(name)
        own, other = self.oscillation, history.motion
        same = other.get("kind") == own.describe()["kind"] and np.allclose(
            [other["omega"], other["amplitude"]], [own.omega, own.amplitude], rtol=1e-6
        )
        if not same or history.condition != self.condition:
            raise InputError("the history is not of the motion whose periodic loads these are")
        start = history.time[-1] - own.period
        if start < -1e-6 * own.period:
            raise InputError("the history is shorter than one period")
        last = history.time > start + 1e-6 * own.period
        marched = history[name][last]
        half_range = 0.5 * float(np.ptp(marched))
        if not half_range > 1e-12 * np.max(np.abs(history.coefficients)):
            raise InputError(f"{name} does not move: a relative difference has no meaning")
        apart = self.at(own.omega * history.time[last])[:, column] - marched
        return float(np.sqrt(np.mean(apart**2))) / half_range

    def summary(self) -> str:
        """A few lines."""
        reading = self.reading()
        rows = [
            f"{self.motion} at M {self.condition.mach:g}, k = {self.k:.4g}, amplitude "
            f"{np.degrees(self.amplitude):.3g} deg, by reduced frequency with {self.harmonics} "
            f"harmonic{'s' if self.harmonics > 1 else ''}"
        ]
        for name in forced_oscillation.DERIVATIVES:
            rows.append(
                f"{name}: mean {self.mean[_column(name)]:.6g}, in phase {reading.value(name, 'in_phase'):.6g}, "
                f"out of phase {reading.value(name):.6g}, higher harmonics {100.0 * self.distortion(name):.2g}%"
            )
        return "\n".join(rows)

    def plot(self, name: str = "Cm", ax: Axes | None = None) -> Axes:
        """The loop of a load over the angle of the motion."""
        import matplotlib.pyplot as plt

        phase = np.linspace(0.0, 2.0 * np.pi, SAMPLES + 1)
        axes: Axes = plt.subplots(layout="constrained")[1] if ax is None else ax
        label = f"{self.harmonics} harmonic{'s' if self.harmonics > 1 else ''}"
        axes.plot(np.degrees(self.amplitude * np.sin(phase)), self.at(phase)[:, _column(name)], label=label)
        axes.set_xlabel("A sin ωt [deg]")
        axes.set_ylabel(name)
        axes.legend()
        return axes


def run(
    solver: PeriodicSolver,
    condition: FlightCondition,
    amplitude: float,
    k: float,
    motion: OscillationMotion = "pitch",
    harmonics: int = 1,
) -> PeriodicLoads:
    """Solve one period of an oscillation of `amplitude` [rad] at reduced frequency k with so many harmonics.

    Raises
    ------
    InputError
        Before anything is solved: if k is not positive, the amplitude zero, either not finite, `harmonics` not a whole
        number of at least 1, the motion unknown, or the solver can only march.
    DivergenceError
        If the flow does not converge.
    """
    instants(harmonics)
    if motion == "roll":
        raise InputError("periodic flows are of oscillations in pitch; march one in roll, by forced_oscillation")
    if not isinstance(solver, PeriodicSolver):
        raise InputError(f"{type(solver).__name__} has no `periodic`: it can only march, by forced_oscillation")
    oscillation = forced_oscillation.experiment(condition, solver.reference, amplitude, k, motion)
    return read(solver.periodic(condition, oscillation, oscillation.period, harmonics))


def read(history: History) -> PeriodicLoads:
    """Fourier series through the loads at the 2h + 1 even instants of one period, the first at t = 0.

    Raises
    ------
    InputError
        If the history is no such period of an oscillation.
    """
    kind = history.motion.get("kind")
    if kind not in KINDS or KINDS[kind] == "roll":
        raise InputError(f"a history of {kind!r} is no oscillation in pitch, plunge or pitch rate")
    omega = float(history.motion["omega"])
    harmonics = (history.time.size - 1) // 2
    phase = instants(harmonics)
    if phase.size != history.time.size or not np.allclose(omega * history.time, phase, atol=1e-9):
        raise InputError("a periodic history must hold an odd number of even instants of one period, from t = 0")
    spectrum = np.fft.rfft(history.coefficients, axis=0) / phase.size
    return PeriodicLoads(
        motion=KINDS[kind],
        k=reduced_frequency(omega, history.condition.speed, history.reference.length),
        amplitude=float(history.motion["amplitude"]),
        mean=spectrum[0].real,
        sine=-2.0 * spectrum[1:].imag,
        cosine=2.0 * spectrum[1:].real,
        condition=history.condition,
        reference=history.reference,
        provenance=dict(history.provenance),
    )


def _column(name: str) -> int:
    if name not in COEFFICIENTS:
        raise InputError(f"no coefficient {name!r}; there are {', '.join(COEFFICIENTS)}")
    return COEFFICIENTS.index(name)
