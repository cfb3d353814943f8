"""The motion that a map tells of a history, on the package's own terms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from indicial.conventions import Array, ReferenceQuantities, angular_frequency, velocity_from_angles
from indicial.errors import InputError
from indicial.motion import AlphaStep, FlightCondition, Motion, PitchOscillation, PitchRateStep, TabulatedMotion
from indicial.readers import mapping
from indicial.readers.registry import read_table
from indicial.readers.table import Table

_HALVES = {
    "pitch_oscillation": (True, True),
    "plunge_oscillation": (True, False),
    "pitch_rate_oscillation": (False, True),
}


def seconds_per_unit(unit: str, condition: FlightCondition, reference: ReferenceQuantities) -> float:
    """What a file's unit of time is in seconds."""
    chord = reference.length / condition.speed
    return {"s": 1.0, "ms": 1e-3, "us": 1e-6, "2Vt/c": 0.5 * chord, "Vt/c": chord}[unit]


def motion_of(
    given: mapping.MotionMap,
    condition: FlightCondition,
    reference: ReferenceQuantities,
    table: Table,
    folder: Path,
    unit: float,
) -> Motion:
    """The motion, with t = 0 at its start; `unit` is that of the file's time in seconds."""
    if isinstance(given, mapping.AlphaStep):
        return AlphaStep(condition, math.radians(given.amplitude_deg))
    if isinstance(given, mapping.RateStep):
        if given.rate_deg_s is not None:
            return PitchRateStep(condition, math.radians(given.rate_deg_s))
        return PitchRateStep(condition, (given.reduced_rate or 0.0) * 2.0 * condition.speed / reference.length)
    if isinstance(given, mapping.Oscillation):
        omega = given.omega_rad_s
        if given.frequency_Hz is not None:
            omega = 2.0 * math.pi * given.frequency_Hz
        if omega is None:
            omega = angular_frequency(given.k or 0.0, condition.speed, reference.length)
        return PitchOscillation(condition, math.radians(given.amplitude_deg), omega, *_HALVES[given.kind])
    return _tabulated(given, condition, table, folder, unit)


def _tabulated(
    given: mapping.TableMotion, condition: FlightCondition, table: Table, folder: Path, unit: float
) -> TabulatedMotion:
    source = table if given.file is None else read_table(folder / given.file)
    if given.alpha is None and given.q is None:
        raise InputError("motion: a table needs a column of alpha, of q, or both")
    times = unit * (source[given.time] - given.start)
    scale = math.pi / 180.0 if given.angle_unit == "deg" else 1.0
    alpha = np.full(times.size, condition.alpha) if given.alpha is None else scale * source[given.alpha]
    rates = np.zeros((times.size, 3))
    if given.q is not None:
        rates[:, 1] = scale * source[given.q]
    if np.any(np.abs(alpha) > math.pi / 2.0):
        raise InputError(f"motion: {given.alpha} goes to {np.max(np.abs(alpha)):.3g} rad; is angle_unit right?")
    velocity = np.array([velocity_from_angles(condition.speed, float(a), condition.beta) for a in alpha])
    return TabulatedMotion(times, velocity, rates)


def attitude(motion: Motion, times: Array) -> Array:
    """Pitch angle [rad] that the motion has turned the body by since t = 0, shape (n,)."""
    if isinstance(motion, PitchRateStep):
        return motion.rate_amplitude * times
    if isinstance(motion, PitchOscillation):
        return motion.amplitude * np.sin(motion.omega * times) * float(motion.rotates)
    fine = np.union1d(np.linspace(0.0, max(float(times[-1]), 0.0), 2001), np.append(times, 0.0))
    q = motion.rate(fine)[:, 1]
    angle = np.concatenate([[0.0], np.cumsum(0.5 * (q[1:] + q[:-1]) * np.diff(fine))])
    return np.asarray(np.interp(times, fine, angle - np.interp(0.0, fine, angle)))


def rotates(motion: Motion) -> bool:
    """Whether the body turns in still air."""
    if isinstance(motion, TabulatedMotion):
        return bool(np.any(motion.rates != 0.0))
    return isinstance(motion, PitchRateStep) or (isinstance(motion, PitchOscillation) and motion.rotates)
