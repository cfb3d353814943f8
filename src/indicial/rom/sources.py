"""What the modes of one input are found from: its step response, or its frequency response."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from indicial.conventions import COEFFICIENTS, Array
from indicial.errors import InputError, NoLimitError
from indicial.frequency import FrequencyResponse
from indicial.rom.deficiency import deficiency_integral
from indicial.rom.era import settling_time
from indicial.rom.mode_fitting import FrequencyTarget, Target, TimeTarget
from indicial.rom.model import ComplexArray
from indicial.rom.response import StepResponse
from indicial.rom.signals import quadrature_weights

Part = Literal["all", "fitted", "held out"]
"""All samples; every second one, with the last; and those between."""

_RESAMPLED = 240
_QUASI_STEADY = 1e-3


class Source(ABC):
    """Data of one input, of which every second sample can be held out."""

    @property
    @abstractmethod
    def name(self) -> str:
        """Of the input."""

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of samples."""

    @property
    @abstractmethod
    def peak(self) -> Array:
        """Largest absolute value of each output, shape (n_outputs,)."""

    @property
    @abstractmethod
    def scale(self) -> Array:
        """What errors of each output are measured by, shape (n_outputs,)."""

    @property
    @abstractmethod
    def slowest(self) -> float:
        """Reduced time after which nothing happens any more, as far as the data show."""

    @property
    @abstractmethod
    def quasi_steady(self) -> bool:
        """Whether every output answers at once, without any lag."""

    @abstractmethod
    def target(self, part: Part, match_integral: bool) -> Target:
        """What modes are to match; initial value and integral are those of all samples."""

    def _kept(self, part: Part) -> NDArray[np.intp]:
        index = np.arange(self.count)
        fitted = np.union1d(index[::2], index[-1:])
        return {"all": index, "fitted": fitted, "held out": np.setdiff1d(index, fitted)}[part]


@dataclass(frozen=True)
class StepSource(Source):
    """A step response."""

    response: StepResponse

    @property
    def name(self) -> str:
        return self.response.input

    @property
    def count(self) -> int:
        return int(self.response.s.size)

    @property
    def peak(self) -> Array:
        r = self.response
        return _floored(np.max(np.abs(np.vstack([r.values, r.settled])), axis=0))

    @property
    def scale(self) -> Array:
        """Norm of each deficiency function, or of 0.1% of the response where that is larger (a quasi-steady output)."""
        r = self.response
        norm = np.sqrt(quadrature_weights(r.s) @ r.deficiency**2)
        return np.asarray(np.maximum(norm, _QUASI_STEADY * self.peak * np.sqrt(r.s[-1])))

    @property
    def slowest(self) -> float:
        return settling_time(self.response.s, self.response.deficiency)

    @property
    def quasi_steady(self) -> bool:
        return not np.any(self.response.deficiency)

    def target(self, part: Part, match_integral: bool) -> TimeTarget:
        r, kept = self.response, self._kept(part)
        integral, horizon = self._integral
        weights = quadrature_weights(r.s)[kept] if part == "held out" else quadrature_weights(r.s[kept])
        if part == "held out":
            weights *= r.s[-1] / np.sum(weights)  # errors are means over the whole record
        return TimeTarget(
            values=r.deficiency[kept],
            initial=r.deficiency[0],
            integral=integral if match_integral else None,
            horizon=horizon,
            weights=weights,
            scale=self.scale,
            s=r.s[kept],
        )

    def decay(self, part: Part, end: float) -> Array:
        """Uniform samples of the scaled deficiency function up to `end`, shape (240, n_outputs)."""
        target = self.target(part, match_integral=False)
        grid = np.linspace(0.0, end, _RESAMPLED)
        curve = PchipInterpolator(target.s, target.values / target.scale, axis=0)
        inside: Array = np.where((grid <= target.s[-1])[:, None], curve(np.minimum(grid, target.s[-1])), 0.0)
        return inside

    @cached_property
    def _integral(self) -> tuple[Array, float]:
        """Integral of the deficiency functions, shape (n_outputs,), and up to when.

        Of all time, with the tail beyond the record where the final value is known and the tail can be judged; if it
        cannot, or has no integral, of the record.
        """
        r = self.response
        end = float(r.s[-1])
        over_record = np.asarray(r.curve().integrate(0.0, end))
        if r.final is None:
            return over_record, np.inf
        try:
            parts = [deficiency_integral(r.s, r.values[:, i], float(final)) for i, final in enumerate(r.final)]
        except (NoLimitError, InputError):
            return over_record, end
        return np.array([part.value for part in parts]), np.inf


@dataclass(frozen=True)
class FrequencySource(Source):
    """The frequency response to one input.

    Parameters
    ----------
    of : str
        Name of the input.
    k : ndarray
        Reduced frequencies above 0, increasing, shape (n,).
    values : ndarray
        H(ik), shape (n, n_outputs).
    static, slope, direct : ndarray
        H(0), H'(0) (NaN where it is not known) and H(i inf), shape (n_outputs,).
    """

    of: str
    k: Array
    values: ComplexArray
    static: Array
    slope: Array
    direct: Array

    @classmethod
    def read(cls, response: FrequencyResponse, name: str, outputs: tuple[str, ...]) -> FrequencySource:
        """The response of some outputs to one input.

        Raises
        ------
        InputError
            If a value that a model needs is not finite.
        """
        rows, column = [COEFFICIENTS.index(output) for output in outputs], response.inputs.index(name)
        k, order = np.unique(response.k, return_index=True)
        moving = k > 0.0
        values = response.values[order[moving]][:, rows, column]
        static, slope, direct = (array[rows, column] for array in (response.static, response.slope, response.direct))
        for part, what in ((values, "H(ik)"), (static, "H(0)"), (direct, "H(i inf)")):
            if not np.all(np.isfinite(part)):
                raise InputError(
                    f"frequency response to {name}: {what} of {', '.join(outputs)} is not known everywhere"
                )
        return cls(name, k[moving], values, static, slope, direct)

    @property
    def name(self) -> str:
        return self.of

    @property
    def count(self) -> int:
        return int(self.k.size)

    @property
    def peak(self) -> Array:
        return _floored(np.max(np.abs(np.vstack([self.values, self.static, self.direct])), axis=0))

    @property
    def scale(self) -> Array:
        """Norm of each unsteady part ``H - H(0)`` over log k, or of 0.1% of the peak where that is larger."""
        weights = quadrature_weights(np.log(self.k))
        norm = np.sqrt(weights @ np.abs(self.values - self.static) ** 2)
        return np.asarray(np.maximum(norm, _QUASI_STEADY * self.peak * np.sqrt(np.sum(weights))))

    @property
    def slowest(self) -> float:
        return 1.0 / float(self.k[0])

    @property
    def quasi_steady(self) -> bool:
        return not np.any(self.values - self.static)

    def target(self, part: Part, match_integral: bool) -> FrequencyTarget:
        kept = self._kept(part)
        places = np.log(self.k)
        weights = quadrature_weights(places)[kept] if part == "held out" else quadrature_weights(places[kept])
        weights *= (places[-1] - places[0]) / np.sum(weights)
        unsteady = self.static - self.values[kept]
        known = match_integral and bool(np.all(np.isfinite(self.slope)))
        return FrequencyTarget(
            values=np.vstack([unsteady.real, unsteady.imag]),
            initial=self.static - self.direct,
            integral=-self.slope if known else None,
            horizon=np.inf,
            weights=np.append(weights, weights),
            scale=self.scale,
            k=self.k[kept],
        )

    def part(self, part: Part) -> FrequencySource:
        """The same with some of the frequencies."""
        kept = self._kept(part)
        return replace(self, k=self.k[kept], values=self.values[kept])


def _floored(peak: Array) -> Array:
    """Peaks; an output that is nothing beside the others counts as they do, 1e-6."""
    return np.asarray(np.maximum(peak, max(1e-6 * float(np.max(peak)), 1e-300)))
