"""Functions of time that drive a parameter of a flight: controls, and whatever else a schedule prescribes."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.march import Drive

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MULTISTEP = (3.0, 2.0, 1.0, 1.0)


@dataclass(frozen=True)
class Signal:
    """Linear between its points; before the first and after the last it holds.

    Parameters
    ----------
    time : array_like
        Not decreasing [s], shape (n,); a time that stands twice is a jump, the second value counting from there on.
    value : array_like
        In the unit of what it drives, shape (n,).

    Raises
    ------
    InputError
        If times decrease, stand three times, or a value is missing.
    """

    time: Array
    value: Array

    def __post_init__(self) -> None:
        for name in ("time", "value"):
            numbers = np.array(getattr(self, name), dtype=float)
            numbers.setflags(write=False)
            object.__setattr__(self, name, numbers)
        if self.time.ndim != 1 or self.time.size == 0 or self.time.shape != self.value.shape:
            raise InputError(f"a signal needs as many values as times, not {self.value.shape} and {self.time.shape}")
        if not (np.all(np.isfinite(self.time)) and np.all(np.isfinite(self.value))):
            raise InputError("times and values of a signal must be finite")
        if np.any(np.diff(self.time) < 0.0) or np.any(self.time[2:] == self.time[:-2]):
            raise InputError("times of a signal must not decrease, nor stand three times")

    @classmethod
    def pieces(cls, edges: ArrayLike, values: ArrayLike, before: float = 0.0, after: float = 0.0) -> Self:
        """Constant between edges [s] (one more than values), with jumps at them."""
        t, v = np.asarray(edges, dtype=float), np.asarray(values, dtype=float)
        if t.size != v.size + 1:
            raise InputError(f"{v.size} constant pieces have {v.size + 1} edges, not {t.size}")
        return cls(np.repeat(t, 2), np.concatenate([[before], np.repeat(v, 2), [after]]))

    @classmethod
    def step(cls, amplitude: float, at: float = 0.0, base: float = 0.0) -> Self:
        """From `base` to `base + amplitude` at a time [s]."""
        return cls(np.array([at, at]), np.array([base, base + amplitude]))

    @classmethod
    def doublet(cls, amplitude: float, width: float, at: float = 0.0, base: float = 0.0) -> Self:
        """Up for `width` [s], then down as long."""
        return cls.multistep(amplitude, width, at, base, pattern=(1.0, 1.0))

    @classmethod
    def multistep(
        cls,
        amplitude: float,
        unit: float,
        at: float = 0.0,
        base: float = 0.0,
        pattern: tuple[float, ...] = MULTISTEP,
    ) -> Self:
        """Steps of alternating sign, each as many units of time [s] long as the pattern says: 3-2-1-1 by default.

        Source: Koehler & Wilhelm, DFVLR-IB 154-77/40 (1977).
        """
        if not unit > 0.0 or not all(length > 0.0 for length in pattern):
            raise InputError(f"a multistep needs lengths above 0, not {pattern} units of {unit} s")
        edges = at + unit * np.concatenate([[0.0], np.cumsum(pattern)])
        signs = amplitude * (-1.0) ** np.arange(len(pattern))
        return cls.pieces(edges, base + signs, base, base)

    @classmethod
    def sampled(cls, function: Any, duration: float, spacing: float) -> Self:
        """A function of time (array to array) at even instants, at most `spacing` [s] apart, from 0 to `duration`."""
        if not (duration > 0.0 and spacing > 0.0):
            raise InputError(f"duration {duration} s and spacing {spacing} s must be above 0")
        time = np.linspace(0.0, duration, math.ceil(duration / spacing) + 1)
        return cls(time, np.asarray(function(time), dtype=float))

    def at(self, times: ArrayLike) -> Array:
        """Values at times [s], of the same shape."""
        t = np.asarray(times, dtype=float)
        values: Array = np.interp(t, self.time, self.value)
        # np.interp takes the first of two values at a jump
        last = np.searchsorted(self.time, t, side="right") - 1
        exact = (last >= 0) & (self.time[np.maximum(last, 0)] == t)
        return np.where(exact, self.value[np.maximum(last, 0)], values)

    def summary(self) -> str:
        """One line."""
        return (
            f"signal of {self.time.size} points from {self.time[0]:g} to {self.time[-1]:g} s, "
            f"{self.value.min():.4g} to {self.value.max():.4g}"
        )

    def plot(self) -> Figure:
        """Value over time."""
        import matplotlib.pyplot as plt

        figure, ax = plt.subplots(figsize=(7, 3), layout="constrained")
        ax.plot(self.time, self.value)
        ax.set(xlabel="time [s]", ylabel="value")
        return figure


Parameters = Mapping[str, "float | Signal"]
"""Values of a model's parameters: numbers, or functions of time."""


@dataclass(frozen=True)
class Schedule:
    """The parameters of one flight, in the model's order: numbers and signals.

    Parameters
    ----------
    names : tuple of str
    values : tuple of float or Signal
    """

    names: tuple[str, ...]
    values: tuple[float | Signal, ...]

    @classmethod
    def of(cls, names: Sequence[str], given: Parameters | None) -> Self:
        """One value for each name.

        Raises
        ------
        InputError
            If one is missing, unknown, or not a finite number.
        """
        values = dict(given or {})
        if set(values) != set(names):
            raise InputError(f"parameters given are ({', '.join(values)}), the model's are ({', '.join(names)})")
        for name, value in values.items():
            if not isinstance(value, Signal) and not math.isfinite(value):
                raise InputError(f"parameter {name} is {value}, must be finite")
        return cls(tuple(names), tuple(values[name] for name in names))

    @property
    def signals(self) -> tuple[str, ...]:
        """Names of those that change with time."""
        return tuple(n for n, value in zip(self.names, self.values, strict=True) if isinstance(value, Signal))

    def at(self, times: ArrayLike) -> Array:
        """All values at times [s], shape (n_parameters, n)."""
        t = np.atleast_1d(np.asarray(times, dtype=float))
        rows = [v.at(t) if isinstance(v, Signal) else np.full(t.size, float(v)) for v in self.values]
        return np.array(rows, dtype=float).reshape(len(rows), t.size)

    @property
    def drive(self) -> Drive:
        """The signals as the march takes them."""
        signals = [(i, v) for i, v in enumerate(self.values) if isinstance(v, Signal)]
        first = np.concatenate([[0], np.cumsum([v.time.size for _, v in signals])]).astype(np.int64)
        time = np.concatenate([np.zeros(0), *(v.time for _, v in signals)])
        value = np.concatenate([np.zeros(0), *(v.value for _, v in signals)])
        return Drive(np.array([i for i, _ in signals], dtype=np.int64), first, time, value, np.unique(time))
