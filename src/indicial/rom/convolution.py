r"""Superposition of step responses, Eq. (13), in its deficiency form, Eqs. (14) and (15)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly
from scipy.signal import oaconvolve
from scipy.special import spherical_jn

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.rom.model import ComplexArray, ReducedModel
from indicial.rom.response import Interpolation, StepResponses
from indicial.rom.signals import MotionInputs
from indicial.rom.superposition import superpose

_MANY = 256  # samples from which transforms are quicker

Evaluation = Literal["auto", "direct", "fft"]


def deficiency_load(curve: PPoly, s: Array, values: Array, before: float, at: Array) -> Array:
    r"""``F(s - s0) du(0+) + integral of F(s - sigma) u'(sigma) d sigma``, exactly, for piecewise-linear u.

    With J the integral of F from 0 and u' constant on each interval, the integral is a sum over the intervals of u'
    times differences of J.

    Parameters
    ----------
    curve : PPoly
        F on ``[0, S]``, values of shape (m,); 0 beyond S.
    s, values : ndarray
        Samples of u, shape (n,).
    before : float
        u before the first sample.
    at : ndarray
        Reduced times wanted, increasing, shape (k,), not before ``s[0]``.

    Returns
    -------
    ndarray
        Shape (k, m).
    """
    end, integral = curve.x[-1], curve.antiderivative()
    load: Array = (values[0] - before) * np.where((at - s[0] <= end)[:, None], curve(np.minimum(at - s[0], end)), 0.0)
    load += superpose(integral.x, np.ascontiguousarray(integral.c), s, np.ascontiguousarray(values), at)
    return load


def deficiency_load_fft(curve: PPoly, s: Array, values: Array, before: float) -> Array:
    r"""The same as `deficiency_load` at every sample of a uniform grid, by fast convolution, shape (n, m).

    ``u' = du_j/h`` on each interval makes the integral the sum over j of ``du_j`` times the mean of F over the
    interval of lags ``(i - j - 1) h`` to ``(i - j) h``.
    """
    end, step = curve.x[-1], (s[-1] - s[0]) / (s.size - 1)
    reach = min(s.size, int(np.ceil(end / step)) + 1)
    integral = curve.antiderivative()(np.minimum(step * np.arange(reach), end))
    lags = step * np.arange(s.size)
    load: Array = (values[0] - before) * np.where((lags <= end)[:, None], curve(np.minimum(lags, end)), 0.0)
    load[1:] += oaconvolve(np.diff(values)[:, None], np.diff(integral, axis=0) / step, axes=0)[: s.size - 1]
    return load


def is_uniform(s: Array) -> bool:
    """Whether the steps of a grid differ by the round-off of its instants only."""
    step = np.diff(s)
    return step.size > 0 and bool(np.ptp(step) <= 8.0 * np.finfo(float).eps * np.max(np.abs(s)))


def deficiency_transform(curve: PPoly, k: Array) -> ComplexArray:
    r"""``ik times the integral of F(s) exp(-iks) over [0, S]``, exactly, shape (n_k, m).

    By parts it is ``F(0) - F(S) e^{-ikS} + integral of F' e^{-iks}``; F' is at most quadratic on each interval, and
    in Legendre polynomials there the integral is ``2 (-i)^n j_n(kh/2)`` with spherical Bessel functions: no
    cancellation at small k and no limit on k h.
    """
    slope = curve.derivative()
    half = 0.5 * np.diff(curve.x)
    middle = curve.x[:-1] + half
    c = np.zeros((3, *slope.c.shape[1:]))
    c[3 - slope.c.shape[0] :] = slope.c
    # F' = c2 + c1 t + c0 t^2, t = h + h x on the interval's half width h, x in (-1, 1), into Legendre polynomials
    h = half[:, None]
    a0, a1, a2 = c[2] + c[1] * h + c[0] * h**2, (c[1] + 2.0 * c[0] * h) * h, c[0] * h**2
    legendre = (a0 + a2 / 3.0, a1, 2.0 * a2 / 3.0)
    phase = half * np.exp(-1j * np.outer(k, middle))
    total = curve(0.0) - np.exp(-1j * k * curve.x[-1])[:, None] * curve(curve.x[-1])
    for n, coefficient in enumerate(legendre):
        total = total + (phase * 2.0 * (-1j) ** n * spherical_jn(n, np.outer(k, half))) @ coefficient
    transformed: ComplexArray = total
    return transformed


@dataclass(frozen=True)
class ConvolutionModel(ReducedModel):
    r"""Eq. (13): ``C(s) = C(0) + sum over inputs of the integral of A(s - sigma) u'(sigma) d sigma``.

    Evaluated as ``A(inf) (u - u(0-)) - F(s) du(0+) - integral of F(s - sigma) u' d sigma``, F the deficiency
    function (14), (15), zero after the last sample. Exact for inputs that are linear between samples, jumps
    at the start included. Directly, on any grid, the cost is loads wanted times samples within the memory; on a
    uniform grid the same numbers come from fast Fourier transforms. The third way, by recursion, is a model of
    exponential sums: `StateSpaceModel`.

    Parameters
    ----------
    responses : StepResponses
    interpolation : {"cubic", "linear"}
        Between the samples of the step responses; cubic is monotone.
    evaluation : {"auto", "direct", "fft"}
        ``auto`` takes transforms for many samples on a uniform grid.
    """

    responses: StepResponses
    interpolation: Interpolation = "cubic"
    evaluation: Evaluation = "auto"

    def __post_init__(self) -> None:
        if self.evaluation not in ("auto", "direct", "fft"):
            raise InputError(f"evaluation is {self.evaluation!r}, must be 'auto', 'direct' or 'fft'")
        for name in ("inputs", "outputs", "baseline", "condition", "reference"):
            object.__setattr__(self, name, getattr(self.responses, name))
        self._check_names()

    @cached_property
    def _curves(self) -> tuple[PPoly, ...]:
        return tuple(response.curve(self.interpolation) for response in self.responses.responses)

    @property
    def static_gain(self) -> Array:
        """``C(inf)``, shape (n_outputs, n_inputs)."""
        return self.responses.final

    @property
    def rate_gain(self) -> Array:
        """``- integral of F over the samples`` (Eq. 17), shape (n_outputs, n_inputs); see `refusals`."""
        return np.stack([-curve.integrate(0.0, curve.x[-1]) for curve in self._curves], axis=1)

    def refusals(self) -> dict[str, str]:
        """Derivatives whose deficiency integral has no limit, with the reason."""
        return self.responses.without_limit()

    def frequency_response(self, k: ArrayLike) -> ComplexArray:
        """``H(ik) = C(inf) - ik integral of F exp(-iks) ds``, exact for the interpolated responses."""
        ks = np.atleast_1d(np.asarray(k, dtype=float))
        lag = np.stack([deficiency_transform(curve, ks) for curve in self._curves], axis=2)
        response: ComplexArray = self.static_gain - lag
        return response

    def respond(self, inputs: MotionInputs) -> Array:
        """Loads less `baseline` under `inputs`, shape (n, n_outputs).

        Raises
        ------
        InputError
            If transforms are asked for and the grid is not uniform.
        """
        s, stride = inputs.s, inputs.stride
        uniform = is_uniform(s)
        if self.evaluation == "fft" and not uniform:
            raise InputError("evaluation 'fft' needs uniform instants, these are not: take 'auto' or 'direct'")
        fast = self.evaluation == "fft" or (self.evaluation == "auto" and uniform and s.size > _MANY)
        load: Array = inputs.values[::stride] @ self.static_gain.T
        for j, curve in enumerate(self._curves):
            values, before = inputs.values[:, j], inputs.before[j]
            if fast:
                load -= deficiency_load_fft(curve, s, values, before)[::stride]
            else:
                load -= deficiency_load(curve, s, values, before, s[::stride])
        return load

    def describe(self) -> dict[str, Any]:
        """Kind and parameters as plain values."""
        return {**super().describe(), "interpolation": self.interpolation}

    def summary(self) -> str:
        """One line."""
        return f"convolution (Eq. 13) of steps in {', '.join(self.inputs)} for {', '.join(self.outputs)}"
