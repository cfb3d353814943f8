r"""Forced oscillation in pitch, plunge, pitch rate or roll, and its three reductions (Eqs. 6, 9, 12).

Also called FOM. After the start has died out a load repeats itself as
``C - mean = A (in_phase sin wt + k out_of_phase cos wt)`` plus higher harmonics (Eq. 2), with the motion
``alpha = alpha0 + A sin wt`` and ``k = w c/2U`` (Eq. 5; for rates per ``q c/V`` the k in Eq. 2 is ``w c/U``).

=============  ==========================  =======================
motion         in phase                    out of phase
=============  ==========================  =======================
pitch          ``C_ja - k^2 C_jqd`` (3)    ``C_jad + C_jq`` (4)
plunge         ``C_ja`` + O(k^2)           ``C_jad``
pitch_rate     ``-k^2 C_jqd``              ``C_jq``
roll           ``-k^2 C_jpd``              ``C_jp``
=============  ==========================  =======================

All values are those at k: on a linear flow with transfer functions H_a, H_q the out-of-phase part in pitch is exactly
``Im(H_a(ik) + ik H_q(ik))/k``, and equals the derivatives of the other methods only as k goes to 0.

In roll the angle is phi, and k and the reduced rate have the length of roll moments (``k = w b/2U``, ``p b/2U``). That
holds for "full" compensation (`indicial.motion.RollOscillation`): the others vary alpha or beta too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.interpolate import CubicSpline

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities, reduced_frequency
from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError
from indicial.history import History
from indicial.motion import Compensation, FlightCondition, PitchOscillation, RollOscillation
from indicial.solver import Solver

if TYPE_CHECKING:
    from matplotlib.axes import Axes

OscillationMotion = Literal["pitch", "plunge", "pitch_rate", "roll"]
Reduction = Literal["phase_angle", "regression", "fourier"]

KINDS: dict[str, OscillationMotion] = {
    "pitch_oscillation": "pitch",
    "plunge_oscillation": "plunge",
    "pitch_rate_oscillation": "pitch_rate",
    "roll_oscillation": "roll",
}
"""From the kind that a history names to the motion."""

DERIVATIVES = ("CN", "Cm")
"""Loads whose derivatives are tabled."""

ROLL_DERIVATIVES = ("CY", "Cl", "Cn")
"""Those of roll."""


@dataclass(frozen=True)
class OscillationReading:
    """In-phase and out-of-phase parts of every load, by one reduction.

    Parameters
    ----------
    reduction : {"phase_angle", "regression", "fourier"}
    motion : {"pitch", "plunge", "pitch_rate", "roll"}
    k, amplitude : float
        Reduced frequency and amplitude [rad].
    periods : int
        How many of the last whole periods were read.
    in_phase, out_of_phase : ndarray
        Of (CA, CY, CN, Cl, Cm, Cn), shape (6,): per rad of the angle, and per unit of the reduced rate.
    standard_error : ndarray or None
        Of `out_of_phase`, from the scatter about the regression, shape (6,). It supposes independent scatter;
        for a smooth, distorted loop it is a measure of the distortion.
    drift : ndarray or None
        `out_of_phase` less its value one period earlier, shape (6,); None with too few periods.
    periodicity : ndarray or None
        Largest change of each load from the period before to the last, of its half-range in the last, shape (6,).
    condition : FlightCondition
    reference : ReferenceQuantities
    """

    reduction: Reduction
    motion: OscillationMotion
    k: float
    amplitude: float
    periods: int
    in_phase: Array
    out_of_phase: Array
    standard_error: Array | None
    drift: Array | None
    periodicity: Array | None
    condition: FlightCondition
    reference: ReferenceQuantities

    @property
    def loads(self) -> tuple[str, ...]:
        """Names of the loads whose derivatives are tabled."""
        return ROLL_DERIVATIVES if self.motion == "roll" else DERIVATIVES

    def value(self, name: str, part: Literal["in_phase", "out_of_phase"] = "out_of_phase") -> float:
        """One part of one load."""
        if name not in COEFFICIENTS:
            raise InputError(f"no coefficient {name!r}; there are {', '.join(COEFFICIENTS)}")
        values: Array = getattr(self, part)
        return float(values[COEFFICIENTS.index(name)])

    def uncertainty(self, name: str) -> float | None:
        """Of the out-of-phase part: standard error and drift together; None if neither is known."""
        index = COEFFICIENTS.index(name)
        known = [float(part[index]) for part in (self.standard_error, self.drift) if part is not None]
        return math.hypot(*known) if known else None

    def derivatives(self, source: str = "forced oscillation") -> DerivativeTable:
        """The records that the motion gives, method ``fom``, with this reduction and k."""
        records = []
        for name in self.loads:
            out = {
                "pitch": f"{name}_q+{name}_alphadot",
                "plunge": f"{name}_alphadot",
                "pitch_rate": f"{name}_q",
                "roll": f"{name}_p",
            }[self.motion]
            wanted = [(out, self.value(name), self.uncertainty(name))]
            if self.motion in ("pitch", "plunge"):
                wanted.insert(0, (f"{name}_alpha", self.value(name, "in_phase"), None))
            records += [
                Derivative.at(
                    self.condition,
                    self.reference,
                    label,
                    "fom",
                    value,
                    source,
                    uncertainty=uncertainty,
                    k=self.k,
                    amplitude=self.amplitude,
                    reduction=self.reduction,
                )
                for label, value, uncertainty in wanted
            ]
        return DerivativeTable(tuple(records))

    def summary(self) -> str:
        """A few lines."""
        head = (
            f"{self.motion} oscillation at M {self.condition.mach:g}, k = {self.k:.4g}, amplitude "
            f"{math.degrees(self.amplitude):.3g} deg, by {self.reduction} over {self.periods} periods"
        )
        rows = [head]
        for name in self.loads:
            spread = self.uncertainty(name)
            within = "" if spread is None else f" +- {spread:.2g}"
            rows.append(
                f"{name}: in phase {self.value(name, 'in_phase'):.6g}, out of phase {self.value(name):.6g}{within}"
            )
        return "\n".join(rows)


def experiment(
    condition: FlightCondition,
    reference: ReferenceQuantities,
    amplitude: float,
    k: float,
    motion: OscillationMotion = "pitch",
    *,
    compensation: Compensation = "full",
) -> PitchOscillation | RollOscillation:
    """The oscillation at amplitude [rad] and reduced frequency k (Eq. 5); `compensation` is for roll."""
    if motion not in KINDS.values():
        raise InputError(f"no oscillation {motion!r}; there are {', '.join(KINDS.values())}")
    if not (np.isfinite(k) and k > 0.0):
        raise InputError(f"reduced frequency k is {k}, must be positive and finite")
    if motion == "roll":
        return RollOscillation.from_reduced_frequency(condition, reference, amplitude, k, compensation)
    return PitchOscillation.from_reduced_frequency(
        condition, reference, amplitude, k, varies_alpha=motion != "pitch_rate", rotates=motion != "plunge"
    )


def sample_times(oscillation: PitchOscillation | RollOscillation, periods: int, steps_per_period: int) -> Array:
    """Uniform instants [s] over whole periods, from 0, shape (periods * steps_per_period + 1,)."""
    if periods < 1 or steps_per_period < 8 or steps_per_period % 2:
        raise InputError(
            f"{periods} periods of {steps_per_period} steps: at least 1 period of an even number of steps, 8 or more"
        )
    return oscillation.period * np.arange(periods * steps_per_period + 1) / steps_per_period


def run(
    solver: Solver,
    condition: FlightCondition,
    amplitude: float,
    k: float,
    motion: OscillationMotion = "pitch",
    *,
    periods: int = 3,
    steps_per_period: int = 100,
    compensation: Compensation = "full",
) -> History:
    """Force the oscillation and record it; read it with `phase_angle`, `regression` or `fourier`."""
    oscillation = experiment(condition, solver.reference, amplitude, k, motion, compensation=compensation)
    return solver.unsteady(condition, oscillation, sample_times(oscillation, periods, steps_per_period))


def phase_angle(history: History, periods: int | None = None) -> OscillationReading:
    """Differences between opposite phases (Eq. 6), averaged over the last whole `periods`.

    ``C(wt = 2 pi) - C(wt = pi) = 2 (C_jad + C_jq) A k``; in phase the same between pi/2 and 3 pi/2. Between samples a
    cubic spline is read. Odd harmonics of the load enter in full: a third cosine harmonic c3 adds c3/(A k).
    """
    return _reading("phase_angle", history, periods)


def regression(history: History, periods: int | None = None) -> OscillationReading:
    """Least squares on a constant, sin wt and cos wt (Eqs. 7-9) over the last whole `periods`.

    ``beta = (X^T X)^-1 X^T y`` is found by singular values of X, not by forming its square.
    """
    return _reading("regression", history, periods)


def fourier(history: History, periods: int | None = None) -> OscillationReading:
    """First Fourier coefficients (Eq. 12) over the last n whole `periods`.

    ``C_out = 2/(A k n T) integral dC cos wt dt``: by the trapezoidal rule on uniform samples, which is exact there for
    all harmonics that they resolve, and by a cubic spline of the product otherwise.
    """
    return _reading("fourier", history, periods)


@dataclass(frozen=True)
class _Record:
    """What the reductions need of a history."""

    time: Array
    loads: Array
    amplitude: float
    omega: float
    whole: int

    def window(self, last: int, count: int) -> tuple[float, float]:
        """Start and end [s] of `count` periods that end with period number `last` (counted from 1)."""
        period = 2.0 * math.pi / self.omega
        return (last - count) * period, last * period


def _record(history: History) -> _Record:
    kind = history.motion.get("kind")
    if kind not in KINDS:
        raise InputError(f"a history of {kind!r} is no forced oscillation; those are {', '.join(KINDS)}")
    omega = float(history.motion["omega"])
    span = history.time[-1] * omega / (2.0 * math.pi)
    whole = math.floor(span + 1e-6)
    if whole < 1:
        raise InputError(f"the oscillation was recorded for {span:.3g} periods: at least one whole period is needed")
    if history.time.size < 8 * whole:
        raise InputError(f"{history.time.size} samples in {whole} periods: at least 8 samples a period are needed")
    return _Record(history.time, history.coefficients, float(history.motion["amplitude"]), omega, whole)


def _reading(reduction: Reduction, history: History, periods: int | None) -> OscillationReading:
    record = _record(history)
    count = max(1, record.whole - 1) if periods is None else periods
    if not 1 <= count <= record.whole:
        raise InputError(f"{periods} periods were asked for, the history holds {record.whole} whole ones")
    reduce = {"phase_angle": _opposite_phases, "regression": _least_squares, "fourier": _integrals}[reduction]
    sine, cosine, error = reduce(record, record.whole, count)
    speed, reference = history.condition.speed, history.reference
    motion = KINDS[history.motion["kind"]]
    axis = 0 if motion == "roll" else 1
    length = float(reference.moment_lengths[0]) if motion == "roll" else reference.length
    unit = record.amplitude * record.omega * float(reference.rate_scale(speed)[axis])
    drift = periodicity = None
    if record.whole >= 2:
        drift = (reduce(record, record.whole, 1)[1] - reduce(record, record.whole - 1, 1)[1]) / unit
        periodicity = _periodicity(record)
    return OscillationReading(
        reduction=reduction,
        motion=motion,
        k=reduced_frequency(record.omega, speed, length),
        amplitude=record.amplitude,
        periods=count,
        in_phase=sine / record.amplitude,
        out_of_phase=cosine / unit,
        standard_error=None if error is None else error / abs(unit),
        drift=drift,
        periodicity=periodicity,
        condition=history.condition,
        reference=reference,
    )


def _opposite_phases(record: _Record, last: int, count: int) -> tuple[Array, Array, None]:
    """Coefficients of sin wt and cos wt, shape (6,) each."""
    curve = CubicSpline(record.time, record.loads)
    starts = np.array([record.window(number, 1)[0] for number in range(last - count + 1, last + 1)])
    quarter = math.pi / (2.0 * record.omega)

    def at(quarters: int) -> Array:
        values: Array = np.mean(curve(np.minimum(starts + quarters * quarter, record.time[-1])), axis=0)
        return values

    return (at(1) - at(3)) / 2.0, (at(4) - at(2)) / 2.0, None


def _inside(record: _Record, last: int, count: int) -> tuple[Array, Array]:
    start, end = record.window(last, count)
    slack = 1e-6 * (end - start)
    chosen = (record.time > start + slack) & (record.time <= end + slack)
    return record.time[chosen], record.loads[chosen]


def _least_squares(record: _Record, last: int, count: int) -> tuple[Array, Array, Array]:
    time, loads = _inside(record, last, count)
    phase = record.omega * time
    x = np.stack([np.ones_like(phase), np.sin(phase), np.cos(phase)], axis=1)
    beta, _, rank, _ = np.linalg.lstsq(x, loads, rcond=None)
    if rank < 3:
        raise InputError("the samples do not tell sine from cosine: record more instants of each period")
    variance = np.sum((loads - x @ beta) ** 2, axis=0) / max(time.size - 3, 1)
    # the last diagonal element of (X^T X)^-1 = R^-1 R^-T is 1/r^2 of the last element of the triangle R
    _, triangle = np.linalg.qr(x)
    return beta[1], beta[2], np.sqrt(variance) / abs(triangle[2, 2])


def _integrals(record: _Record, last: int, count: int) -> tuple[Array, Array, None]:
    start, end = record.window(last, count)
    time, loads = _inside(record, last, count)
    steps = np.diff(time, prepend=start)
    if np.ptp(steps) < 1e-6 * np.mean(steps) and abs(time[-1] - end) < 1e-6 * (end - start):
        phase = record.omega * time[:, None]
        return 2.0 * np.mean(loads * np.sin(phase), axis=0), 2.0 * np.mean(loads * np.cos(phase), axis=0), None
    phase = record.omega * record.time[:, None]
    stop = min(end, float(record.time[-1]))
    change = record.loads - np.mean(loads, axis=0)

    def integral(wave: Array) -> Array:
        values: Array = 2.0 / (end - start) * CubicSpline(record.time, change * wave).integrate(start, stop)
        return values

    return integral(np.sin(phase)), integral(np.cos(phase)), None


def _periodicity(record: _Record) -> Array:
    """Largest change of a load over one period, of its half-range; 0 for a load that does not move."""
    time, loads = _inside(record, record.whole, 1)
    before = CubicSpline(record.time, record.loads)(time - 2.0 * math.pi / record.omega)
    half_range = np.ptp(loads, axis=0) / 2.0
    change: Array = np.max(np.abs(loads - before), axis=0)
    floor = 1e-12 * np.max(np.abs(record.loads))
    relative: Array = np.divide(change, half_range, out=np.zeros_like(change), where=half_range > floor)
    return relative


def plot_loop(history: History, name: str = "Cm", ax: Axes | None = None) -> Axes:
    """A load against the angle of the motion, with the last whole period emphasised."""
    import matplotlib.pyplot as plt

    record = _record(history)
    angle = np.degrees(record.amplitude * np.sin(record.omega * record.time))
    last = record.time >= record.window(record.whole, 1)[0] * (1.0 - 1e-9)
    axes: Axes = plt.subplots()[1] if ax is None else ax
    axes.plot(angle, history[name], color="0.7", label="start")
    axes.plot(angle[last], history[name][last], label="last period")
    axes.set_xlabel("A sin wt [deg]")
    axes.set_ylabel(name)
    axes.legend()
    return axes
