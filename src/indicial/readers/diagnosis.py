"""What is wrong with a history, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from indicial.conventions import COEFFICIENTS, Array
from indicial.errors import InputError
from indicial.history import History

GAP = 4.0
"""An interval is a gap if it is longer than both its neighbours by this factor."""

UNEVEN = 1.01
"""Longest over shortest interval, above which a time step is said to change."""

MOVING = 0.01
"""Part of the whole change that a load may move by before a step, or over the last fifth after it."""

UNCERTAIN_START = 0.02
"""Part of the whole change by which two ways to the value at 0+ may differ."""

SHORT, LONG = 0.5, 1e5
"""Reduced times between which a record's length is plausible."""


@dataclass(frozen=True)
class Finding:
    """One thing that was found.

    Parameters
    ----------
    severity : {"note", "warning"}
        Whether it only informs, or makes what is read from the history doubtful.
    text : str
    """

    severity: Literal["note", "warning"]
    text: str

    def summary(self) -> str:
        """One line."""
        return f"{self.severity}: {self.text}"


def refuse_broken(source: str, time: Array, columns: dict[str, Array]) -> None:
    """Raise in words if samples are not finite, times repeat or go back, or there are too few.

    Raises
    ------
    InputError
    """
    for name, values in {"time": time, **columns}.items():
        bad = np.flatnonzero(~np.isfinite(values))
        if bad.size:
            raise InputError(
                f"{source}: {name!r} is not a number in {bad.size} of {values.size} rows, first in row {bad[0] + 1} "
                f"(time {time[bad[0]]:g}): the solution had diverged, or the file is damaged; cut it off before"
            )
    if time.size < 3:
        raise InputError(f"{source}: {time.size} row(s), a history needs three or more")
    steps = np.diff(time)
    if np.any(steps == 0.0):
        row = int(np.flatnonzero(steps == 0.0)[0])
        raise InputError(
            f"{source}: time {time[row]:g} is there twice (rows {row + 1} and {row + 2}) under different step counts"
        )
    if np.any(steps < 0.0):
        row = int(np.flatnonzero(steps < 0.0)[0])
        raise InputError(
            f"{source}: time goes back from {time[row]:g} to {time[row + 1]:g} in row {row + 2} while steps count on: "
            "was the clock reset at a restart?"
        )


def sampling(time: Array) -> list[Finding]:
    """Of the instants: gaps, uneven steps."""
    steps = np.diff(time)
    if steps.size < 3:
        return []
    neighbours = np.maximum(np.append(steps[1], steps[:-1]), np.append(steps[1:], steps[-2]))
    gaps = np.flatnonzero(steps > GAP * neighbours)
    found = [
        Finding(
            "warning",
            f"there is a gap from t = {time[i]:.5g} s to {time[i + 1]:.5g} s, {steps[i] / neighbours[i]:.0f} time "
            "steps long: rows are missing, what lies between is interpolated",
        )
        for i in gaps[:3]
    ]
    if gaps.size > 3:
        found.append(Finding("warning", f"there are {gaps.size} gaps in all"))
    even = np.delete(steps, gaps)
    if even.size and np.max(even) > UNEVEN * np.min(even):
        found.append(
            Finding(
                "note",
                f"the time step is not uniform, {np.min(even):.3g} to {np.max(even):.3g} s: taken as it is",
            )
        )
    if np.all(time == np.round(time)) and np.all(np.abs(steps - 1.0) < 1e-9):
        found.append(Finding("warning", "time counts whole units, one by one: are these iterations of a steady run?"))
    return found


def drift_before(time: Array, loads: Array, whole: Array, outputs: Sequence[str]) -> list[Finding]:
    """Whether loads had settled before the motion began.

    Parameters
    ----------
    time, loads : ndarray
        Before the motion, shapes (n,) and (n, n_outputs).
    whole : ndarray
        Range of the loads after it, shape (n_outputs,).
    outputs : sequence of str
    """
    if time.size < 4:
        return []
    late = time >= time[-1] - 0.5 * np.ptp(time)
    moved = np.abs(np.polyfit(time[late], loads[late], 1)[0]) * np.ptp(time[late])
    return [
        Finding(
            "warning",
            f"{name} drifts before the motion begins, by {part:.1%} of its later change over the last half of the "
            "time before: start from a steady solution that has converged",
        )
        for name, part in zip(outputs, moved / np.maximum(whole, 1e-300), strict=True)
        if part > MOVING
    ]


def of_step(history: History, outputs: Sequence[str], unit: float, first: float, doubt: Array) -> list[Finding]:
    """Of a step response: late start, early end, implausible length, wrong signs.

    Parameters
    ----------
    history : History
    outputs : sequence of str
    unit : float
        The step, of which only the sign counts.
    first : float
        Time of the first sample after the step [s], 0 if the file holds 0+ itself.
    doubt : ndarray
        By how much the values at 0+ are uncertain, shape (n_outputs,).
    """
    columns = [COEFFICIENTS.index(name) for name in outputs]
    change = history.coefficients[:, columns] - history.before[columns]
    whole = np.maximum(np.ptp(np.vstack([np.zeros(len(columns)), change]), axis=0), 1e-300)
    found = _late_start(history, outputs, first, doubt / whole)
    late = history.time >= 0.8 * history.time[-1]
    if np.count_nonzero(late) >= 4:
        t = history.time[late]
        moved = np.abs(np.polyfit(t, change[late], 1)[0]) * np.ptp(t)
        found += [
            Finding(
                "warning",
                f"{name} has not settled when the record ends at s = {history.s[-1]:.4g}: it still moves by {part:.1%} "
                "of its whole change over the last fifth; its final value is wrong by as much or more",
            )
            for name, part in zip(outputs, moved / whole, strict=True)
            if part > MOVING
        ]
    if not SHORT < history.s[-1] < LONG:
        found.append(
            Finding(
                "warning",
                f"the record is {history.s[-1]:.3g} long in reduced time 2Vt/c: are the unit of time and the reference "
                "length right?",
            )
        )
    return found + _signs(history, outputs, change[0] / unit)


def _late_start(history: History, outputs: Sequence[str], first: float, doubt: Array) -> list[Finding]:
    if first == 0.0:
        return []
    following = history.time[2] - history.time[1]
    found = []
    s = first * history.s[-1] / history.time[-1]
    if first > 3.0 * following:
        found.append(
            Finding(
                "warning",
                f"the history starts late: its first sample is {first / following:.1f} time steps after the step, at "
                f"s = {s:.3g}; is `start` right?",
            )
        )
    poor = [f"{name} +-{part:.1%}" for name, part in zip(outputs, doubt, strict=True) if part > UNCERTAIN_START]
    found.append(
        Finding(
            "warning" if poor else "note",
            f"values at 0+ are extrapolated from the first sample at s = {s:.3g}"
            + (f"; uncertain, of the whole change: {', '.join(poor)}: take smaller first time steps" if poor else ""),
        )
    )
    return found


def _signs(history: History, outputs: Sequence[str], initial: Array) -> list[Finding]:
    """At the first instant pressure opposes motion: CN with alpha is positive, Cm with q negative, for any body."""
    expected = {"alpha_step": ("CN", 1.0, "alpha"), "pitch_rate_step": ("Cm", -1.0, "q")}
    if (kind := history.motion.get("kind")) not in expected:
        return []
    name, sign, input_ = expected[kind]
    if name not in outputs or sign * initial[list(outputs).index(name)] >= 0.0:
        return []
    right = "positive" if sign > 0.0 else "negative"
    return [
        Finding(
            "warning",
            f"wrong sign: {name} jumps by {initial[list(outputs).index(name)]:.3g} per unit {input_} at 0+, where "
            f"the air's resistance makes it {right} for any body; are axes, columns and sign of the step right?",
        )
    ]


def of_oscillation(history: History, outputs: Sequence[str]) -> list[Finding]:
    """Of an oscillation: too short, not periodic, lift against the angle."""
    period = 2.0 * np.pi / float(history.motion["omega"])
    periods = (history.time[-1] - history.time[0]) / period
    if periods < 1.0:
        return [
            Finding("warning", f"the record holds {periods:.2f} of a period: are frequency and unit of time right?")
        ]
    last = history.time >= history.time[-1] - period
    angle = history.alpha[last] - np.mean(history.alpha[last])
    if "CN" in outputs and np.ptp(angle) > 0.0 and angle @ history["CN"][last] < 0.0:
        return [Finding("warning", "wrong sign: CN falls where alpha rises; are the axes and the columns right?")]
    return []
