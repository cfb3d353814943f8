r"""Data compatibility: do the instruments of a record agree with each other, before anything is identified from it?

Accelerometers and gyros, integrated (`kinematics`), must give what vanes, attitude gyros and altimeter show. Biases of
the former, biases, scales and delays of the latter and the start are fitted by least squares with residuals made white
by what they remember (`coloured`). What differs from an instrument without error by more than chance would make one of
all the errors differ in a hundred records is told. Source: Klein & Morelli, "Aircraft System Identification" (2006),
ch. 10.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.identification.accuracy import cramer_rao
from indicial.identification.coloured import reflections, runs, whiten
from indicial.identification.estimate import Estimate
from indicial.identification.kinematics import block_responses, integrate
from indicial.identification.maximum_likelihood import gauss_newton_step
from indicial.identification.record import FlightRecord

if TYPE_CHECKING:
    from matplotlib.figure import Figure

IMU = ("ax", "ay", "az", "p", "q", "r")
OUTPUTS = ("V", "alpha", "beta", "phi", "theta", "psi", "altitude")
START = ("u", "v", "w", "phi", "theta", "psi", "altitude")
DEFAULT = (*(f"bias_{name}" for name in IMU), "scale_alpha", "bias_alpha", "scale_beta", "bias_beta")
"""Errors of instruments that are looked for unless others are named."""

_BY_CHANCE = 0.01  # of records without errors in which one is found
_STEPS, _ROUNDS = 40, 8
_SHORT = 1e-4
_SETTLED = 5e-3
_MOST_DAMPING = 1e9
_DIFFERENCE = 1e-5
_BLOCKS = 30
_MOVING = 3.0  # standard deviations


@dataclass(frozen=True)
class Compatibility:
    """What the instruments say of each other.

    Parameters
    ----------
    errors : tuple of Estimate
        ``bias_CHANNEL`` in the channel's unit, ``scale_CHANNEL``, ``delay_CHANNEL`` [s].
    start : tuple of Estimate
    findings : tuple of str
        What is not as instruments without error would show it, in words; empty if all agree.
    record : FlightRecord
    computed : dict of str to ndarray
        What the channels would show, shape (n,) each.
    noise : dict of str to float
        Standard deviation of each channel's residuals.
    """

    errors: tuple[Estimate, ...]
    start: tuple[Estimate, ...]
    findings: tuple[str, ...]
    record: FlightRecord
    computed: dict[str, Array]
    noise: dict[str, float]

    def __getitem__(self, name: str) -> Estimate:
        """An error by name.

        Raises
        ------
        InputError
            If it was not looked for.
        """
        for estimate in (*self.errors, *self.start):
            if estimate.name == name:
                return estimate
        raise InputError(f"{name} was not looked for; there are {', '.join(e.name for e in self.errors)}")

    @property
    def consistent(self) -> bool:
        """Whether nothing was found."""
        return not self.findings

    def corrected(self) -> FlightRecord:
        """The record with the errors found to be there taken out; those that may be none are left."""
        channels = {}
        for name, values in self.record.channels.items():
            bias, scale, delay = (self._sure(f"{kind}_{name}") for kind in ("bias", "scale", "delay"))
            made = (values - (bias or 0.0)) / (scale or 1.0)
            if delay:
                known = np.isfinite(made)
                shifted = np.interp(self.record.time + delay, self.record.time[known], made[known])
                made = np.where(known, shifted, np.nan)
            channels[name] = made
        return replace(self.record, channels=channels)

    @property
    def biased(self) -> tuple[str, ...]:
        """Channels whose bias `corrected` takes out."""
        seen = [e.name.removeprefix("bias_") for e in self.errors if e.name.startswith("bias_")]
        return tuple(name for name in seen if self._sure(f"bias_{name}") is not None)

    def _sure(self, name: str) -> float | None:
        for estimate in self.errors:
            if estimate.name == name and _differs(estimate, len(self.errors)):
                return estimate.value
        return None

    def summary(self) -> str:
        """Findings and the errors looked for."""
        lines = ["the instruments agree with each other" if self.consistent else "the instruments do not all agree:"]
        lines += [f"  {text}" for text in self.findings]
        return "\n".join([*lines, "errors looked for:", *(f"  {e.summary()}" for e in self.errors)])

    def plot(self) -> Figure:
        """Measured channels and what the others imply, with residuals."""
        import matplotlib.pyplot as plt

        rows = len(self.computed)
        figure, axes = plt.subplots(
            rows, 2, figsize=(11, 1.0 + 1.6 * rows), sharex=True, layout="constrained", squeeze=False
        )
        for (left, right), (name, values) in zip(axes, self.computed.items(), strict=True):
            left.plot(self.record.time, self.record[name], ".", ms=2, label="measured")
            left.plot(self.record.time, values, label="from accelerometers and gyros")
            left.set_ylabel(name)
            right.plot(self.record.time, self.record[name] - values, ".", ms=2)
        axes[0, 0].legend(fontsize="small")
        axes[0, 1].set_title("measured less computed")
        for ax in axes[-1]:
            ax.set_xlabel("time [s]")
        return figure


def check_compatibility(
    record: FlightRecord, *, errors: Sequence[str] | None = None, g: float = 9.80665
) -> Compatibility:
    """Check a record's instruments against each other.

    Parameters
    ----------
    record : FlightRecord
        With ``ax ay az p q r`` at the centre of gravity (`to_centre_of_gravity`), and some of `OUTPUTS`. Of the former
        single missing samples, such as spikes taken out, are bridged by straight lines; longer gaps are refused.
    errors : sequence of str, optional
        What to look for: ``bias_``, ``scale_`` or ``delay_`` and a channel (delays of `OUTPUTS` only); `DEFAULT` as far
        as the record has the channels, if not given; of scales those of channels that move beyond their noise.
    g : float
        [m/s^2].

    Raises
    ------
    InputError
        If a channel is lacking or has gaps that it must not have, units look wrong, or an error has no effect.
    DivergenceError
        If the fit does not converge.
    """
    record.require(*IMU)
    seen = tuple(name for name in OUTPUTS if name in record.channels)
    if not seen:
        raise InputError(f"a compatibility check needs some of {', '.join(OUTPUTS)} to compare with")
    whole = record.with_channels(**{name: _bridged(record, name) for name in IMU})
    place = record.provenance.get("installation", {})
    if any(place.get("accelerometers", ())) or any(place.get("vanes", ())):
        raise InputError("the instruments are off the centre of gravity: move them there by to_centre_of_gravity first")
    wanted = _wanted(errors, seen, record)
    _check_units(whole, g)
    with threadpool_limits(limits=1, user_api="blas"):
        return replace(_Fit(whole, seen, wanted, g).solve(), record=record)


def _bridged(record: FlightRecord, name: str) -> Array:
    """A channel with single missing samples between its neighbours."""
    values, known = record[name], np.isfinite(record[name])
    if not (known[0] and known[-1] and np.all(known[1:] | known[:-1])):
        raise InputError(f"{name} has dropouts: a compatibility check integrates it, so select a part without")
    bridged: Array = np.interp(record.time, record.time[known], values[known])
    return np.where(known, values, bridged)


def _wanted(errors: Sequence[str] | None, seen: tuple[str, ...], record: FlightRecord) -> tuple[str, ...]:
    """What to look for; of scales, unless asked for, only those of channels that move far beyond their noise."""
    if errors is None:
        found = [name for name in DEFAULT if name.split("_")[1] in (*IMU, *seen)]
        return tuple(n for n in found if not n.startswith("scale_") or _moves(record, n.removeprefix("scale_")))
    for name in errors:
        kind, _, channel = name.partition("_")
        allowed = seen if kind == "delay" else (*IMU, *seen)
        if kind not in ("bias", "scale", "delay") or channel not in allowed:
            raise InputError(f"no error {name!r} to look for: bias_, scale_ or delay_ and one of {', '.join(allowed)}")
    return tuple(dict.fromkeys(errors))


def _check_units(record: FlightRecord, g: float) -> None:
    """Refuse rates and accelerations of which the size says that the unit or the sign is wrong."""
    check_accelerations(record, g)
    for angle, rate in (("theta", "q"), ("phi", "p"), ("psi", "r")):
        if angle not in record.channels:
            continue
        known = np.isfinite(record[angle])
        change, total = np.ptp(record[angle][known]), record[rate]
        turned = np.ptp(np.concatenate([[0.0], np.cumsum(0.5 * (total[1:] + total[:-1]) * np.diff(record.time))]))
        if turned > 20.0 * max(change, 0.02):
            times = turned / max(change, 1e-9)
            raise InputError(f"{rate} turns the vehicle {times:.3g} times as far as {angle} does: is it in deg/s?")


def check_accelerations(record: FlightRecord, g: float = 9.80665) -> None:
    """Refuse ax, ay, az that look like multiples of g or forces the other way round."""
    felt = np.sqrt(sum(record[name] ** 2 for name in ("ax", "ay", "az")))
    if 0.5 / g < float(np.nanmedian(felt)) / g < 2.0 / g and float(np.nanmax(felt)) < 0.6 * g:
        raise InputError(f"ax, ay, az are of size {np.nanmedian(felt):.3g}: they look like multiples of g, not m/s^2")
    if float(np.nanmedian(record["az"])) > 0.5 * g:
        raise InputError("az is positive on the whole: it must be specific force, downward, about -g in level flight")


def _differs(estimate: Estimate, looked_for: int) -> bool:
    from scipy.special import ndtri

    ideal = 1.0 if estimate.name.startswith("scale_") else 0.0
    return bool(abs(estimate.value - ideal) > -ndtri(0.5 * _BY_CHANCE / looked_for) * estimate.standard_error)


class _Fit:
    """Unknowns: errors of instruments, then the start."""

    def __init__(self, record: FlightRecord, seen: tuple[str, ...], wanted: tuple[str, ...], g: float) -> None:
        self.record, self.seen, self.wanted, self.g = record, seen, wanted, g
        self.imu = np.stack([record[name] for name in IMU], axis=1)
        self.measured = {name: record[name] for name in seen}
        self.known = {name: np.isfinite(values) for name, values in self.measured.items()}
        self.free = tuple(n for n in START if n not in ("psi", "altitude") or n in seen)
        self.names = (*wanted, *(f"start_{name}" for name in self.free))
        self.stated = {
            name: record.standard_deviations.get(name) or _roughness(values) for name, values in self.measured.items()
        }

    def first(self) -> Array:
        """Errors of none, and the start as measured."""
        near = {}
        for name, values in self.measured.items():
            near[name] = float(values[self.known[name]][0])
        speed, alpha, beta = near.get("V", 0.0), near.get("alpha", 0.0), near.get("beta", 0.0)
        if speed <= 0.0:
            raise InputError("a compatibility check needs V to start from")
        start = {
            "u": speed * math.cos(alpha) * math.cos(beta),
            "v": speed * math.sin(beta),
            "w": speed * math.sin(alpha) * math.cos(beta),
            **{name: near.get(name, 0.0) for name in ("phi", "theta", "psi", "altitude")},
        }
        ideal = [1.0 if name.startswith("scale_") else 0.0 for name in self.wanted]
        return np.array([*ideal, *(start[name] for name in self.free)])

    def outputs(self, sets: Array) -> dict[str, Array]:
        """Channels of several sets of unknowns, each (sets, n)."""
        errors = {name: sets[:, i] for i, name in enumerate(self.wanted)}
        none, one = np.zeros(len(sets)), np.ones(len(sets))
        biases = np.stack([errors.get(f"bias_{name}", none) for name in IMU], axis=1)
        scales = np.stack([errors.get(f"scale_{name}", one) for name in IMU], axis=1)
        starts = np.zeros((len(sets), len(START)))
        for i, name in enumerate(self.free):
            starts[:, START.index(name)] = sets[:, len(self.wanted) + i]
        states = integrate(self.record.time, self.imu, starts, biases, scales, self.g)
        u, v, w = (states[:, :, i] for i in range(3))
        speed = np.sqrt(u * u + v * v + w * w)
        shown = {"V": speed, "alpha": np.arctan2(w, u), "beta": np.arcsin(v / speed)}
        shown |= {name: states[:, :, START.index(name)] for name in ("phi", "theta", "psi", "altitude")}
        found = {}
        for name in self.seen:
            made = shown[name]
            delays = errors.get(f"delay_{name}")
            if delays is not None:
                made = np.stack([_late(self.record.time, row, late) for row, late in zip(made, delays, strict=True)])
            scale, bias = errors.get(f"scale_{name}", one), errors.get(f"bias_{name}", none)
            found[name] = scale[:, None] * made + bias[:, None]
        return found

    def rows(self, x: Array, sizes: dict[str, float], memory: dict[str, Array]) -> dict[str, tuple[Array, Array]]:
        """White sensitivities and residuals of each channel."""
        steps = _DIFFERENCE * np.maximum(np.abs(x), 0.01)
        sets = np.concatenate([x[None, :], x + np.diag(steps), x - np.diag(steps)])
        outputs, n = self.outputs(sets), x.size
        made = {}
        for name in self.seen:
            values, known = outputs[name], self.known[name]
            slopes = ((values[1 : n + 1] - values[n + 1 :]) / (2.0 * steps[:, None])).T
            residual = np.where(known, self.measured[name] - values[0], 0.0)
            if name in ("phi", "psi"):
                residual = (residual + math.pi) % (2.0 * math.pi) - math.pi
            both = np.column_stack([slopes, residual]) / sizes[name]
            white = whiten(both, memory[name], known)[known]
            made[name] = (white[:, :-1], white[:, -1])
        return made

    def solve(self) -> Compatibility:
        sizes, memory = dict(self.stated), dict.fromkeys(self.seen, np.zeros(0))
        x = self.minimise(self.first(), sizes, memory)
        for _ in range(_ROUNDS):
            before = dict(sizes)
            sizes, memory = self.noise(x, sizes)
            x = self.minimise(x, sizes, memory)
            if all(abs(sizes[n] / before[n] - 1.0) < _SETTLED for n in self.seen):
                break
        rows = self.rows(x, sizes, memory)
        slopes = np.vstack([s for s, _ in rows.values()])
        silent = [n for n, size in zip(self.names, np.linalg.norm(slopes, axis=0), strict=True) if size == 0.0]
        if silent:
            raise InputError(f"{silent[0]} has no effect on this record: do not look for it")
        bound = cramer_rao(slopes)
        deviations = np.sqrt(np.diag(bound + self.walk(x, sizes, memory, bound @ slopes.T)))
        estimates = [Estimate(n, float(v), float(e)) for n, v, e in zip(self.names, x, deviations, strict=True)]
        errors, start = estimates[: len(self.wanted)], estimates[len(self.wanted) :]
        computed = {name: values[0] for name, values in self.outputs(x[None, :]).items()}
        findings = tuple(_say(e) for e in errors if _differs(e, len(errors)))
        return Compatibility(tuple(errors), tuple(start), findings, self.record, computed, sizes)

    def walk(self, x: Array, sizes: dict[str, float], memory: dict[str, Array], estimator: Array) -> Array:
        """What the integrated noise of the IMU adds to the covariance."""
        errors = dict(zip(self.wanted, x, strict=False))
        bias = np.array([errors.get(f"bias_{n}", 0.0) for n in IMU])
        scale = np.array([errors.get(f"scale_{n}", 1.0) for n in IMU])
        start = np.zeros(len(START))
        for i, name in enumerate(self.free):
            start[START.index(name)] = x[len(self.wanted) + i]
        edges = np.unique(np.linspace(0, len(self.record), _BLOCKS + 1).astype(np.int64))
        noise = np.array([self.record.standard_deviations.get(n) or _roughness(self.record[n]) for n in IMU])
        motion = (self.imu - bias) / scale
        size = np.array([1e-3, 1e-3, 1e-3, 1e-5, 1e-5, 1e-5])
        base = integrate(self.record.time, motion, start[None], np.zeros((1, 6)), np.ones((1, 6)), self.g)[0]
        changes = block_responses(self.record.time, motion, base, self.g, edges, size)
        spread = np.zeros((x.size, x.size))
        for b, length in enumerate(np.diff(edges)):
            for c in range(len(IMU)):
                rows = self.whitened_change(base, changes[b, c], errors, sizes, memory)
                shift = estimator @ rows
                spread += np.outer(shift, shift) * noise[c] ** 2 / length
        return spread

    def whitened_change(
        self, base: Array, change: Array, errors: dict[str, float], sizes: dict[str, float], memory: dict[str, Array]
    ) -> Array:
        """What a small change of the motion (n, 7) does to the channels, white, all in one."""
        u, v, w = base[:, :3].T
        du, dv, dw = change[:, :3].T
        speed, across = np.sqrt(u * u + v * v + w * w), u * u + w * w
        growth = (u * du + v * dv + w * dw) / speed
        shown = {
            "V": growth,
            "alpha": (u * dw - w * du) / across,
            "beta": (dv - v * growth / speed) / np.sqrt(across),
            **{name: change[:, START.index(name)] for name in ("phi", "theta", "psi", "altitude")},
        }
        parts = []
        for name in self.seen:
            known = self.known[name]
            column = errors.get(f"scale_{name}", 1.0) * shown[name] / sizes[name]
            parts.append(whiten(column[:, None], memory[name], known)[known][:, 0])
        return np.concatenate(parts)

    def noise(self, x: Array, sizes: dict[str, float]) -> tuple[dict[str, float], dict[str, Array]]:
        """Size and memory of each channel's residuals."""
        plain = self.rows(x, sizes, dict.fromkeys(self.seen, np.zeros(0)))
        memory = {}
        for name in self.seen:
            series = np.zeros(len(self.record))
            series[self.known[name]] = plain[name][1]
            memory[name] = reflections([series[first:stop] for first, stop in runs(self.known[name])])
        rows = self.rows(x, sizes, memory)
        bound = cramer_rao(np.vstack([s for s, _ in rows.values()]))
        found = {}
        for name, (slopes, residuals) in rows.items():
            freedom = residuals.size - float(np.sum((slopes @ bound) * slopes))
            found[name] = sizes[name] * math.sqrt(float(residuals @ residuals) / max(freedom, 1.0))
        return found, memory

    def minimise(self, x: Array, sizes: dict[str, float], memory: dict[str, Array]) -> Array:
        """Damped Gauss-Newton."""

        def look(at: Array) -> tuple[Array, Array]:
            rows = self.rows(at, sizes, memory)
            return np.vstack([s for s, _ in rows.values()]), np.concatenate([r for _, r in rows.values()])

        slopes, residuals = look(x)
        damping = 0.0
        for _ in range(_STEPS):
            step, length = gauss_newton_step(slopes, residuals, damping)
            trial_slopes, trial = look(x + step)
            if np.all(np.isfinite(trial)) and (trial @ trial <= residuals @ residuals or length < _SHORT):
                x, slopes, residuals = x + step, trial_slopes, trial
                damping = 0.0 if damping < 1e-4 else damping / 10.0
                if length < _SHORT:
                    return x
                continue
            damping = max(1e-3, 10.0 * damping)
            if damping > _MOST_DAMPING:
                break
        raise DivergenceError(
            "the compatibility check does not converge: look for fewer errors, or check units, signs and the clock"
        )


def _late(time: Array, values: Array, delay: float) -> Array:
    """Values a delay ago, by a cubic spline; held before the first."""
    from scipy.interpolate import CubicSpline

    made: Array = CubicSpline(time, values)(np.maximum(time - delay, time[0]))
    return made


def _moves(record: FlightRecord, name: str) -> bool:
    values = record[name]
    sd = record.standard_deviations.get(name) or _roughness(values)
    return float(np.nanstd(values)) > _MOVING * sd


def _roughness(values: Array) -> float:
    known = values[np.isfinite(values)]
    size = float(np.median(np.abs(np.diff(known, 2)))) / (0.6745 * math.sqrt(6.0))
    return max(size, 1e-5 * max(float(np.ptp(known)), 1e-6))


def _say(error: Estimate) -> str:
    kind, _, channel = error.name.partition("_")
    value, sure = error.value, error.standard_error
    if kind == "bias":
        return f"{channel} is biased by {value:.4g} +- {sure:.2g}"
    if kind == "delay":
        word = "late" if value > 0.0 else "early"
        return f"{channel} is {abs(value):.4g} +- {sure:.2g} s {word}"
    return f"{channel} shows {value:.4g} +- {sure:.2g} times what it should"
