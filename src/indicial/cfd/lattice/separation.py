r"""The separation point of every strip: static from its polar, and late in time.

In Kirchhoff's flow about a plate that is attached as far as x chords, lift and centre of pressure are

    cl = a0 sin(alpha - alpha0) ((1 + sqrt x)/2)^2,   x_cp = (5 (1 - sqrt x)^2 + 4 sqrt x)/16,

and the drag of pressures that the leading edge's suction does not make up for, ``a0 sin^2(alpha - alpha0)
((1 - sqrt x)/2)^2``. The polar gives the static x0(alpha); what Kirchhoff's flow leaves of the polar is added as a
function of incidence, so that with x = x0 the polar is given back exactly. Out of balance, in chords travelled
tau = V t/c,

    T_p d alpha'/d tau + alpha' = alpha,   T_f dx/d tau + x = x0(alpha')

(Leishman and Beddoes, J. American Helicopter Society 34, 1989: T_p = 1.7, T_f = 3.0 half chords at low Mach numbers,
without their leading-edge vortex; they let the load be late by T_p, here the incidence, the same for an attached load).
To first order in frequency that is ``T_f dx/d tau + x = x0(alpha - T_p d alpha/d tau)``, the form of Goman and
Khrabrov (J. Aircraft 31, 1994).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.interpolate import PchipInterpolator

from indicial.cfd.lattice.polars import GRID, Polar
from indicial.conventions import Array
from indicial.errors import InputError

_ATTACHED = math.radians(6.0)
"""Width of the incidences from zero lift on in which a polar's lift is that of attached flow [rad]."""

_SEPARATED = math.radians(60.0)
"""Incidence from zero lift beyond which x0 is 0 [rad]."""


@dataclass(frozen=True)
class SeparationLag:
    """Time constants in chords travelled.

    Parameters
    ----------
    delay : float
        T_p, of the incidence that the separation point answers to.
    response : float
        T_f, of its answer.
    """

    delay: float = 0.85
    response: float = 1.5

    def __post_init__(self) -> None:
        for name in ("delay", "response"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"time constant {name} is {value} chords, must be positive and finite")


@dataclass(frozen=True)
class SeparationState:
    """Of each strip: the late incidence alpha' that it sees [rad] and the separation point x, shapes (S,)."""

    incidence: Array
    point: Array


@dataclass(frozen=True)
class StripSections:
    """Tables of all S strips on `GRID`, all round.

    Parameters
    ----------
    slope, zero_lift : ndarray
        a0 [1/rad] and alpha0 [rad], shape (S,).
    tables : ndarray
        Kirchhoff's factor of lift at x0, and cl, cd, cm of the polars, with their slopes on the grid, by cubic pieces,
        shape (4, 2, n, S).
    trusted : ndarray
        Ends of the trusted ranges [rad], shape (2, S).
    mean : ndarray, optional
        Weights of all strips in the incidence that each separation point answers to (S, S); its own if not given.
    """

    slope: Array
    zero_lift: Array
    tables: Array
    trusted: Array
    mean: Array | None = None

    @classmethod
    def of(cls, polars: Sequence[Polar], mean: Array | None = None) -> Self:
        """From one polar a strip."""
        full = [polar.full for polar in polars]
        fits = [attached_lift(polar) for polar in polars]
        slope, zero = np.array(fits).T
        points = np.stack([static_point(p, a, z) for p, a, z in zip(full, slope, zero, strict=True)], axis=1)
        loads = [np.stack([getattr(p, name) for p in full], axis=1) for name in ("cl", "cd", "cm")]
        values = np.stack([kirchhoff(points), *loads])
        slopes = np.stack([PchipInterpolator(GRID, one).derivative()(GRID) for one in values])
        trusted = np.array([p.range for p in full]).T
        return cls(slope, zero, np.stack([values, slopes], axis=1), trusted, mean)

    def seen(self, alpha: Array) -> Array:
        """Incidences (S,) that the separation points answer to, of those that the strips meet (S,)."""
        return alpha if self.mean is None else np.asarray(self.mean @ alpha)

    def _at(self, alpha: Array, rows: Sequence[int]) -> tuple[Array, Array]:
        """Values and slopes of tables at incidences (S,), shapes (len(rows), S)."""
        step = GRID[1] - GRID[0]
        place = (alpha - GRID[0]) / step
        n = np.clip(place.astype(int), 0, GRID.size - 2)
        w = place - n
        strips = np.arange(alpha.size)
        which = np.array(rows)[:, None]
        f0, f1, d0, d1 = (self.tables[which, kind, n + k, strips] for kind in (0, 1) for k in (0, 1))
        rise = f1 - f0
        value = f0 + w * (step * d0 + w * (3.0 * rise - step * (2.0 * d0 + d1) + w * (step * (d0 + d1) - 2.0 * rise)))
        slope = d0 + w * (2.0 * (3.0 * rise / step - 2.0 * d0 - d1) + 3.0 * w * (d0 + d1 - 2.0 * rise / step))
        return value, slope

    def static(self, alpha: Array) -> tuple[Array, Array]:
        """x0 and its slope [1/rad] at incidences (S,)."""
        (factor,), (change,) = self._at(alpha, (0,))
        root = 2.0 * np.sqrt(np.clip(factor, 0.25, 1.0)) - 1.0
        return root**2, 2.0 * root * change / np.sqrt(np.clip(factor, 0.25, 1.0))

    def lift(self, alpha: Array, point: Array) -> tuple[Array, Array]:
        """cl and its slope at fixed x [1/rad], shapes (S,)."""
        (factor, lift), (change, slope) = self._at(alpha, (0, 1))
        sine, cosine = np.sin(alpha - self.zero_lift), np.cos(alpha - self.zero_lift)
        more = kirchhoff(point) - factor
        return lift + self.slope * sine * more, slope + self.slope * (cosine * more - sine * change)

    def polar_lift(self, alpha: Array) -> tuple[Array, Array]:
        """cl of the polars and its slope [1/rad], shapes (S,)."""
        (lift,), (slope,) = self._at(alpha, (1,))
        return lift, slope

    def settled_lift(self, alpha: Array) -> tuple[Array, Array]:
        """cl with all separation points at rest (S,), and its slopes against all incidences (S, S) [1/rad]."""
        if self.mean is None:
            lift, slope = self.polar_lift(alpha)
            return lift, np.diag(slope)
        (factor,), (change,) = self._at(self.seen(alpha), (0,))
        lift, own = self.lift(alpha, self.static(self.seen(alpha))[0])
        inside = (factor > 0.25) & (factor < 1.0)
        by_seen = self.slope * np.sin(alpha - self.zero_lift) * np.where(inside, change, 0.0)
        return lift, np.diag(own) + by_seen[:, None] * self.mean

    def lift_of_point(self, alpha: Array, point: Array) -> Array:
        """d cl/dx at fixed incidence, shape (S,)."""
        root = np.sqrt(np.maximum(point, 1e-12))
        return np.asarray(self.slope * np.sin(alpha - self.zero_lift) * 0.25 * (1.0 + root) / root)

    def drag_and_moment(self, alpha: Array, point: Array) -> tuple[Array, Array]:
        """cd, and cm about the quarter chord, shapes (S,)."""
        (cd, cm), _ = self._at(alpha, (2, 3))
        static, _ = self.static(alpha)
        sine = np.sin(alpha - self.zero_lift)

        def kirchhoff_drag(x: Array) -> Array:
            return np.asarray(self.slope * sine**2 * (0.5 * (1.0 - np.sqrt(x))) ** 2)

        def kirchhoff_moment(x: Array) -> Array:
            return -self.slope * sine * kirchhoff(x) * (centre_of_pressure(x) - 0.25)

        return (
            cd + kirchhoff_drag(point) - kirchhoff_drag(static),
            cm + kirchhoff_moment(point) - kirchhoff_moment(static),
        )

    def outside(self, alpha: Array) -> Array:
        """Which strips are beyond the trusted range of their polars, shape (S,)."""
        return np.asarray((alpha < self.trusted[0] - 1e-9) | (alpha > self.trusted[1] + 1e-9))

    def advance(self, state: SeparationState, alpha: Array, travelled: Array, lag: SeparationLag) -> SeparationState:
        """State after so many chords (S,) at constant incidence (S,): exact for alpha', second order for x."""
        seen = self.seen(alpha)

        def late(part: float) -> Array:
            return np.asarray(seen + (state.incidence - seen) * np.exp(-part * travelled / lag.delay))

        goal, _ = self.static(late(0.5))
        return SeparationState(late(1.0), goal + (state.point - goal) * np.exp(-travelled / lag.response))


def kirchhoff(point: Array) -> Array:
    """``((1 + sqrt x)/2)^2``."""
    return np.asarray((0.5 * (1.0 + np.sqrt(np.clip(point, 0.0, 1.0)))) ** 2)


def centre_of_pressure(point: Array) -> Array:
    """Chords behind the leading edge."""
    root = np.sqrt(np.clip(point, 0.0, 1.0))
    return np.asarray((5.0 * (1.0 - root) ** 2 + 4.0 * root) / 16.0)


def attached_lift(polar: Polar) -> tuple[float, float]:
    """a0 [1/rad] and alpha0 [rad] of attached flow: a fit of ``a0 sin(alpha - alpha0)`` from zero lift on.

    Raises
    ------
    InputError
        If the polar has no zero of lift that rises with incidence within 15 degrees.
    """
    full = polar.full
    near = np.abs(GRID) < math.radians(15.0)
    alpha, cl = GRID[near], full.cl[near]
    rising = np.flatnonzero((cl[:-1] <= 0.0) & (cl[1:] > 0.0))
    if rising.size == 0:
        raise InputError(f"polar of {polar.section!r} has no incidence of zero lift within 15 degrees")
    n = int(rising[np.argmin(np.abs(alpha[rising]))])
    zero = float(alpha[n] - cl[n] * (alpha[n + 1] - alpha[n]) / (cl[n + 1] - cl[n]))
    wide = (zero <= GRID) & (zero + _ATTACHED >= GRID)
    sine = np.sin(GRID[wide] - zero)
    return float(sine @ full.cl[wide] / (sine @ sine)), zero


def static_point(polar: Polar, slope: float, zero_lift: float) -> Array:
    """x0 on `GRID`: Kirchhoff's lift solved for x, and never rising away from zero lift."""
    angle = GRID - zero_lift
    attached = slope * np.sin(angle)
    known = np.abs(angle) > math.radians(1.0)
    ratio = np.divide(polar.cl, attached, out=np.ones_like(attached), where=known & (np.abs(attached) > 1e-9))
    raw: Array = np.clip(2.0 * np.sqrt(np.clip(ratio, 0.25, 1.0)) - 1.0, 0.0, 1.0) ** 2
    raw[np.abs(angle) > _SEPARATED] = 0.0
    above = angle >= 0.0
    raw[above] = np.maximum.accumulate(raw[above][::-1])[::-1]
    raw[~above] = np.maximum.accumulate(raw[~above])
    return raw
