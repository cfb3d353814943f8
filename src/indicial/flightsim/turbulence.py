r"""Dryden turbulence: a random field of gusts, frozen in the air, as a sum of sines.

MIL-F-8785C (1980), sec. 3.7: over the wave number Omega [rad/m], one-sided,

    Phi_u = sigma_u^2 (2 L_u/pi) / (1 + (L_u Omega)^2)
    Phi_v = sigma_v^2 (L_v/pi) (1 + 3 (L_v Omega)^2)/(1 + (L_v Omega)^2)^2,     Phi_w likewise
    Phi_q = Phi_w Omega^2/(1 + (4 b Omega/pi)^2),    Phi_r = Phi_v Omega^2/(1 + (3 b Omega/pi)^2)
    Phi_p = sigma_w^2/L_w 0.8 (pi L_w/4b)^(1/3) / (1 + (4 b Omega/pi)^2)

Each component is ``sum a_i cos(Omega_i s + phi_i)`` (Shinozuka & Jan, J. Sound Vib. 25, 1972, 111) over bands of wave
number: a_i^2/2 is the exact power of the band, Omega_i a random wave number in it and phi_i a random phase. So the
field has the stated variance and spectrum, is smooth, and one seed is one field whatever the steps of the flight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Self

import casadi as ca
import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError

_FOOT = 0.3048
_LOW, _HIGH = 1e-2, 1e3  # wave numbers that are represented, over 1/L


class _Waves(NamedTuple):
    """Sines along the direction of flight."""

    number: Array
    """Omega [rad/m], shape (n,)."""
    cosine: Array
    """Weights of cos(Omega s) in (u, v, w, p, q, r), shape (6, n)."""
    sine: Array


@dataclass(frozen=True)
class DrydenTurbulence:
    """Turbulence of stated intensity and scale along a direction of flight.

    Parameters
    ----------
    intensity : tuple of float
        sigma_u, sigma_v, sigma_w [m/s]: along the direction, across it to the right, down.
    scale : tuple of float
        L_u, L_v, L_w [m], as MIL-F-8785C has them.
    seed : int
    heading : float
        Of the direction of flight, horizontal, from x to y [rad].
    span : float, optional
        b [m]; the air then turns too, as a wing of this span feels it. Without it there are no rotary gusts.
    waves : int
        Sines of each field.
    """

    intensity: tuple[float, float, float]
    scale: tuple[float, float, float]
    seed: int
    heading: float = 0.0
    span: float | None = None
    waves: int = 96

    def __post_init__(self) -> None:
        if not all(math.isfinite(s) and s >= 0.0 for s in self.intensity):
            raise InputError(f"intensities of turbulence are {self.intensity} m/s, must be 0 or more")
        if not all(math.isfinite(s) and s > 0.0 for s in self.scale) or not (self.span is None or self.span > 0.0):
            raise InputError(f"scales {self.scale} m and span of turbulence must be positive")
        if self.waves < 8:
            raise InputError(f"turbulence of {self.waves} waves is none: at least 8")

    @classmethod
    def at_altitude(cls, altitude: float, wind_at_20_ft: float, seed: int, **options: Any) -> Self:
        """Intensities and scales of low altitude, 3 to 305 m (MIL-F-8785C, sec. 3.7.3.4).

        ``sigma_w = 0.1 W_20``, ``sigma_u/sigma_w = (0.177 + 0.000823 h)^-0.4``, ``L_w = h``,
        ``L_u = h (0.177 + 0.000823 h)^-1.2``, h in feet.

        Parameters
        ----------
        altitude : float
            Above ground [m].
        wind_at_20_ft : float
            W_20 [m/s]: 7.7 light, 15.4 moderate, 23.1 severe.
        **options
            `heading`, `span`, `waves`.
        """
        feet = altitude / _FOOT
        if not 10.0 <= feet <= 1000.0:
            raise InputError(f"altitude is {altitude:g} m; the low-altitude model holds from 3.048 to 304.8 m")
        shape = 0.177 + 0.000823 * feet
        down = 0.1 * wind_at_20_ft
        along, scale = down / shape**0.4, altitude / shape**1.2
        return cls((along, along, down), (scale, scale, altitude), seed, **options)

    @cached_property
    def _waves(self) -> _Waves:
        random = np.random.default_rng(self.seed)
        fields = []
        for component, (sigma, scale) in enumerate(zip(self.intensity, self.scale, strict=True)):
            edges = np.geomspace(_LOW, _HIGH, self.waves + 1) / scale
            power = sigma**2 * _share(component, edges * scale)
            fields.append(_field(random, edges, power, component))
        if self.span is not None:
            fields += [self._rolling(random), _rotary(fields[2], 2, 4.0 * self.span / math.pi)]
            fields.append(_rotary(fields[1], 1, 3.0 * self.span / math.pi))
        number = np.concatenate([field.number for field in fields])
        return _Waves(number, *(np.hstack([getattr(f, name) for f in fields]) for name in ("cosine", "sine")))

    def _rolling(self, random: np.random.Generator) -> _Waves:
        assert self.span is not None
        scale, sigma = self.scale[2], self.intensity[2]
        lag = 4.0 * self.span / math.pi
        edges = np.geomspace(_LOW, _HIGH, self.waves + 1) / lag
        level = sigma**2 / scale * 0.8 * (math.pi * scale / (4.0 * self.span)) ** (1.0 / 3.0)
        power = level / lag * np.diff(np.arctan(lag * edges))
        return _field(random, edges, power, 3)

    def velocity(self, position: Any, altitude: Any) -> Any:
        """The three components, in earth axes."""
        del altitude
        u, v, w = ca.vertsplit(self._at(position, slice(0, 3)))
        return self._to_earth(u, v, w)

    def rotation(self, position: Any, altitude: Any) -> Any:
        """(p_g, q_g, r_g) in earth axes; None without a span."""
        del altitude
        if self.span is None:
            return None
        p, q, r = ca.vertsplit(self._at(position, slice(3, 6)))
        return self._to_earth(p, q, r)

    def components(self, distance: Array) -> Array:
        """(u, v, w, p, q, r) [m/s, rad/s] at distances along the direction [m], shape (n, 6)."""
        angle = np.outer(self._waves.number, distance)
        values: Array = (self._waves.cosine @ np.cos(angle) + self._waves.sine @ np.sin(angle)).T
        return values

    def _at(self, position: Any, rows: slice) -> Any:
        along = math.cos(self.heading) * position[0] + math.sin(self.heading) * position[1]
        used = np.any(self._waves.cosine[rows] != 0.0, axis=0) | np.any(self._waves.sine[rows] != 0.0, axis=0)
        angle = ca.DM(self._waves.number[used]) * along
        weights = (ca.sparsify(ca.DM(part[rows][:, used])) for part in (self._waves.cosine, self._waves.sine))
        return sum(ca.mtimes(weight, f(angle)) for weight, f in zip(weights, (ca.cos, ca.sin), strict=True))

    def _to_earth(self, along: Any, across: Any, down: Any) -> Any:
        c, s = math.cos(self.heading), math.sin(self.heading)
        return ca.vertcat(c * along - s * across, s * along + c * across, down)


def _share(component: int, x: Array) -> Array:
    """Of the variance, what lies in each band of ``x = L Omega``: integrals of Phi/sigma^2."""
    integral = np.arctan(x) if component == 0 else np.arctan(x) - 0.5 * x / (1.0 + x**2)
    shares: Array = 2.0 / math.pi * np.diff(integral)
    return shares


def _field(random: np.random.Generator, edges: Array, power: Array, row: int) -> _Waves:
    """One component's sines."""
    number = random.uniform(edges[:-1], edges[1:])
    phase = random.uniform(0.0, 2.0 * math.pi, number.size)
    amplitude = np.sqrt(2.0 * power)
    cosine, sine = np.zeros((6, number.size)), np.zeros((6, number.size))
    cosine[row], sine[row] = amplitude * np.cos(phase), -amplitude * np.sin(phase)
    return _Waves(number, cosine, sine)


def _rotary(field: _Waves, row: int, lag: float) -> _Waves:
    """The pitch or yaw rate of the air that belongs to a field of w or v: its slope, seen through a lag [m].

    ``q_g = -(dw/ds)/(1 + lag d/ds)`` (w down: where it grows ahead the air turns nose down), ``r_g = (dv/ds)/(...)``.
    """
    target, sign = (4, -1.0) if row == 2 else (5, 1.0)
    transfer = sign * 1j * field.number / (1.0 + 1j * lag * field.number)
    wave = (field.cosine[row] - 1j * field.sine[row]) * transfer
    cosine, sine = np.zeros_like(field.cosine), np.zeros_like(field.sine)
    cosine[target], sine[target] = wave.real, -wave.imag
    return _Waves(field.number, cosine, sine)
