r"""Superposition of step responses, Eq. (13), in its deficiency form, Eqs. (14) and (15)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PPoly
from scipy.special import spherical_jn

from indicial.conventions import Array
from indicial.rom.model import ComplexArray, ReducedModel
from indicial.rom.response import Interpolation, StepResponses
from indicial.rom.signals import MotionInputs

_CHUNK = 2_000_000  # kernel values held at a time


def deficiency_load(curve: PPoly, s: Array, values: Array, before: float, at: Array) -> Array:
    r"""``F(s - s0) du(0+) + integral of F(s - sigma) u'(sigma) d sigma``, exactly, for piecewise-linear u.

    With ``J`` the integral of F from 0, u' constant on each interval turns the integral into the sum over samples of
    ``J(s - s_j)`` times the change of slope there.

    Parameters
    ----------
    curve : PPoly
        F on ``[0, S]``, values of shape (m,); 0 beyond S.
    s, values : ndarray
        Samples of u, shape (n,).
    before : float
        u before the first sample.
    at : ndarray
        Reduced times wanted, shape (k,), not before ``s[0]``.

    Returns
    -------
    ndarray
        Shape (k, m).
    """
    end = curve.x[-1]
    slope = np.diff(values) / np.diff(s)
    change = np.diff(slope, prepend=0.0, append=0.0)
    integral = curve.antiderivative()
    load: Array = (values[0] - before) * np.where((at - s[0] <= end)[:, None], curve(np.minimum(at - s[0], end)), 0.0)
    rows = max(1, _CHUNK // s.size)
    for start in range(0, at.size, rows):
        block = slice(start, start + rows)
        age = np.clip(at[block, None] - s[None, :], 0.0, end)
        load[block] += np.einsum("ijm,j->im", integral(age), change)
    return load


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
    at the start included. Cost is samples times loads wanted.

    Parameters
    ----------
    responses : StepResponses
    interpolation : {"cubic", "linear"}
        Between the samples of the step responses; cubic is monotone.
    """

    responses: StepResponses
    interpolation: Interpolation = "cubic"

    def __post_init__(self) -> None:
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
        """Loads less `baseline` under `inputs`, shape (n, n_outputs)."""
        at = inputs.s[:: inputs.stride]
        load = inputs.values[:: inputs.stride] @ self.static_gain.T
        for j, curve in enumerate(self._curves):
            load -= deficiency_load(curve, inputs.s, inputs.values[:, j], inputs.before[j], at)
        return load

    def describe(self) -> dict[str, Any]:
        """Kind and parameters as plain values."""
        return {**super().describe(), "interpolation": self.interpolation}

    def summary(self) -> str:
        """One line."""
        return f"convolution (Eq. 13) of steps in {', '.join(self.inputs)} for {', '.join(self.outputs)}"
