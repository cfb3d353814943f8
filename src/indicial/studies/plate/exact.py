r"""Flat plate in linear theory: exact indicial responses in supersonic flow, early ones in subsonic flow.

Lomax, Heaslet, Fuller and Sluder, NACA TR 1077 (1952). The chordwise integrals of the loading are done in
closed form here. Notation: tau = a t / chord, s = 2 U t / chord = 2 M tau, responses (cl_alpha, cm_alpha,
cl_q, cm_q) on the plate's own chord, alpha in rad and rates per ``q chord/U``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.polynomial import Chebyshev
from numpy.typing import ArrayLike, NDArray

from indicial.conventions import Array, ReferenceQuantities, flow_angles
from indicial.errors import InputError
from indicial.history import History
from indicial.motion import FlightCondition, Motion, Rates
from indicial.solver import SteadyLoads

NODES, WEIGHTS = np.polynomial.legendre.leggauss(96)
DEGREE = 128


def about_axis(responses: Array, axis: float) -> Array:
    """Turn responses about the leading edge, ``(..., 4)``, into those about `axis` chords aft of it.

    ``cl_q(a) = cl_q - a cl_a``, ``cm_a(a) = cm_a + a cl_a``, ``cm_q(a) = cm_q + a cl_q - a cm_a(a)``.
    """
    cl_a, cm_a, cl_q, cm_q = np.moveaxis(responses, -1, 0)
    moved = cm_a + axis * cl_a
    return np.stack([cl_a, moved, cl_q - axis * cl_a, cm_q + axis * cl_q - axis * moved], axis=-1)


def settling_tau(mach: float) -> tuple[float, float]:
    """When the trailing edge first and last feels the leading edge's start: 1/(M+1), 1/(M-1)."""
    return 1.0 / (mach + 1.0), 1.0 / (mach - 1.0)


def steady_response(mach: float, axis: float = 0.0) -> Array:
    """``s -> inf`` for M > 1, shape (4,)."""
    b = math.sqrt(mach**2 - 1.0)
    return about_axis(np.array([4.0, -2.0, 2.0, -4.0 / 3.0]) / b, axis)


def supersonic_step(mach: float, s: ArrayLike, axis: float = 0.0) -> Array:
    """Step responses for M > 1 at any reduced time, shape ``s.shape + (4,)``, about `axis` chords from the edge."""
    if mach <= 1.0:
        raise InputError(f"the supersonic plate needs M > 1, not {mach}")
    tau = np.asarray(s, dtype=float) / (2.0 * mach)
    first, last = settling_tau(mach)
    early = _early(mach, tau)
    between = _between(mach, np.clip(tau, first, last))
    late = np.broadcast_to(steady_response(mach), early.shape)
    known = np.where((tau <= first)[..., None], early, np.where((tau >= last)[..., None], late, between))
    return about_axis(known, axis)


def _early(mach: float, tau: Array) -> Array:
    cl_a = np.full_like(tau, 4.0 / mach)
    cm_a = -(2.0 / mach) * (1.0 - tau**2 / 2.0)
    return np.stack([cl_a, cm_a, cl_a + cm_a, -4.0 / (3.0 * mach) - 2.0 / 3.0 * tau**3], axis=-1)


def _between(mach: float, t: Array) -> Array:
    """Moments of the loading when the sonic circle of the start covers the trailing edge."""
    b = math.sqrt(mach**2 - 1.0)
    u = 1.0 - mach * t
    root = np.sqrt(np.maximum(t**2 - u**2, 0.0))
    a = np.pi / 2.0 + np.arcsin(np.clip(u / t, -1.0, 1.0))
    g = np.pi / 2.0 + np.arcsin(np.clip(b**2 * t - mach, -1.0, 1.0))
    x0 = u * a + root
    x1 = (u**2 / 2.0 - t**2 / 4.0) * a + u * root / 4.0
    x2 = u**3 / 3.0 * a + (t**2 * root - root**3 / 3.0) / 3.0
    mt = mach * t
    zeroth = x0 + mach / b * (g + b * t * a)
    first = x1 + mt * x0 + mach / b * (g / 2.0 + b * t / 2.0 * (mt * a - root))
    second = (
        x2
        + 2.0 * mt * x1
        + mt**2 * x0
        + mach / b * (g / 3.0 + b * t / 3.0 * (t**2 * a / 2.0 - u * root / 2.0 - 2.0 * mt * root + mt**2 * a))
    )
    wave = -(root**3) / 3.0 + mt / 2.0 * (u * root + t**2 * a)
    scale = 4.0 / (np.pi * mach)
    cl_a, cm_a = scale * zeroth, -scale * first
    return np.stack([cl_a, cm_a, cl_a + cm_a, -scale * (second + wave)], axis=-1)


def subsonic_early_step(mach: float, s: ArrayLike) -> Array:
    """``(cl_alpha, cm_alpha, cl_q)`` about the leading edge for M < 1 while ``s <= 2M/(1+M)``, shape s.shape + (3,)."""
    t = np.asarray(s, dtype=float)
    if mach >= 1.0 or np.any(t > 2.0 * mach / (1.0 + mach) * (1.0 + 1e-12)):
        raise InputError("the early subsonic plate needs M < 1 and s <= 2M/(1+M)")
    linear = 1.0 - (1.0 - mach) * t / (2.0 * mach)
    square = (2.0 - mach) * t**2 / (8.0 * mach)
    return np.stack([4.0 / mach * linear, -2.0 / mach * (linear - square), 2.0 / mach * (linear + square)], axis=-1)


def incidence_derivatives(mach: float, axis: float = 0.0) -> tuple[float, float]:
    """``(cl_alphadot, cm_alphadot)`` for M > 1 per ``alphadot chord/U``: ``-2/beta^3`` and ``4/(3 beta^3)`` at LE."""
    b3 = math.sqrt(mach**2 - 1.0) ** 3
    return -2.0 / b3, 4.0 / (3.0 * b3) - 2.0 * axis / b3


@dataclass(frozen=True)
class _Piece:
    """One smooth piece of the step responses, as Chebyshev series in theta: s = start + width (1 - cos theta)/2.

    The responses have square-root ends in s and none in theta.
    """

    start: float
    width: float
    slopes: tuple[Chebyshev, ...]

    @classmethod
    def of(cls, mach: float, start: float, end: float, axis: float) -> _Piece:
        width = end - start

        def response(theta: Array, column: int) -> Array:
            s = start + width * (1.0 - np.cos(theta)) / 2.0
            values: Array = supersonic_step(mach, s, axis)[..., column]
            return values

        series = (Chebyshev.interpolate(response, DEGREE, domain=[0.0, np.pi], args=(j,)) for j in range(4))
        return cls(start, width, tuple(one.deriv() for one in series))

    def increments(self, until: ArrayLike) -> tuple[Array, Array]:
        """Reduced times (n, m) and weights (n, m, 4) that integrate against dA from the piece's start to `until`."""
        reached = np.clip((np.atleast_1d(until) - self.start) / self.width, 0.0, 1.0)
        top = np.arccos(1.0 - 2.0 * reached)[:, None]
        theta = top * (NODES + 1.0) / 2.0
        slopes = np.stack([slope(theta) for slope in self.slopes], axis=-1)
        return self.start + self.width * (1.0 - np.cos(theta)) / 2.0, slopes * (top * WEIGHTS / 2.0)[..., None]


@lru_cache(maxsize=64)
def _pieces(mach: float, axis: float) -> tuple[_Piece, _Piece]:
    first, last = (2.0 * mach * tau for tau in settling_tau(mach))
    return _Piece.of(mach, 0.0, first, axis), _Piece.of(mach, first, last, axis)


def frequency_response(mach: float, k: float, axis: float = 0.0) -> NDArray[np.complex128]:
    """``H(ik) = A(0) + integral of exp(-iks) dA(s)``, k on the plate's own chord, shape (4,)."""
    total = supersonic_step(mach, 0.0, axis).astype(complex)
    for piece in _pieces(mach, axis):
        s, weights = piece.increments(np.inf)
        total += np.einsum("nm,nmj->j", np.exp(-1j * k * s), weights)
    return total


@dataclass(frozen=True)
class SupersonicPlate:
    """The exact plate as a solver: linear, so alpha and q of any motion are superposed.

    Parameters
    ----------
    reference : ReferenceQuantities
        Loads are made dimensionless with it; its moment reference is measured from the mesh origin.
    chord, span, leading_edge : float
        Of the plate [m]; the leading edge's x in mesh axes.
    """

    reference: ReferenceQuantities
    chord: float = 1.0
    span: float = 1.0
    leading_edge: float = 0.0

    @property
    def axis(self) -> float:
        """Moment reference, chords from the leading edge."""
        return (self.reference.moment_reference[0] - self.leading_edge) / self.chord

    def _loads(self, cl: Array, cm: Array) -> Array:
        coefficients = np.zeros((*np.shape(cl), 6))
        size = self.chord * self.span / self.reference.area
        coefficients[..., 2] = cl * size
        coefficients[..., 4] = cm * size * self.chord / self.reference.length
        return coefficients

    def steady(self, condition: FlightCondition, rates: Rates = Rates()) -> SteadyLoads:
        cl_a, cm_a, cl_q, cm_q = steady_response(condition.mach, self.axis)
        rate = rates.q * self.chord / condition.speed
        loads = self._loads(cl_a * condition.alpha + cl_q * rate, cm_a * condition.alpha + cm_q * rate)
        return SteadyLoads(loads, condition, rates, self.reference)

    def unsteady(self, condition: FlightCondition, motion: Motion, times: ArrayLike) -> History:
        t = np.asarray(times, dtype=float)
        mach, scale = condition.mach, self.chord / condition.speed
        start = np.array([float(flow_angles(motion.velocity_before)[1]), motion.rate_before[1] * scale])

        def inputs(time: Array) -> Array:
            return np.stack([motion.alpha(time), motion.rate(time)[..., 1] * scale], axis=-1)

        s = 2.0 * t / scale
        initial, final = supersonic_step(mach, 0.0, self.axis), steady_response(mach, self.axis)
        now = supersonic_step(mach, s, self.axis)
        # columns of the responses: cl, cm to alpha, then cl, cm to q
        direct = np.repeat(inputs(t), 2, axis=-1) * initial + np.repeat(start, 2) * (final - now)
        for piece in _pieces(mach, self.axis):
            lag, weights = piece.increments(s)
            earlier = inputs(np.maximum(t[:, None] - lag * scale / 2.0, 0.0))
            direct += np.einsum("nmj,nmj->nj", np.repeat(earlier, 2, axis=-1), weights)
        loads = self._loads(direct[:, 0] + direct[:, 2], direct[:, 1] + direct[:, 3])
        before = np.repeat(start, 2) * final
        return History(
            time=t,
            coefficients=loads,
            velocity=motion.velocity(t),
            rate=motion.rate(t),
            before=self._loads(before[0] + before[2], before[1] + before[3]),
            condition=condition,
            reference=self.reference,
            motion=motion.describe(),
            provenance={"solver": "supersonic plate, linear theory"},
        )

    def frequency_response(self, condition: FlightCondition, k: float) -> NDArray[np.complex128]:
        """CN, Cm (rows) to alpha and the reduced pitch rate (columns), k on the reference length, shape (2, 2)."""
        h = frequency_response(condition.mach, k * self.chord / self.reference.length, self.axis)
        size = self.chord * self.span / self.reference.area
        rate = self.chord / condition.speed / self.reference.rate_scale(condition.speed)[1]
        rows = np.array([size, size * self.chord / self.reference.length])[:, None]
        response: NDArray[np.complex128] = rows * np.array([[h[0], h[2] * rate], [h[1], h[3] * rate]])
        return response
