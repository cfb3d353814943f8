r"""Rigid motions of a body through still air.

A motion gives the velocity ``V_b(t)`` of the moment reference point and the rate ``omega(t)``, both in body
axes. Angle of attack is a property of V_b; the air at infinity is always at rest. A solver starts from the
steady state of ``(velocity_before, rate_before)`` at t = 0- and follows the motion from t = 0+ on.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import brentq

from indicial.conventions import Array, ReferenceQuantities, angular_frequency, flow_angles, velocity_from_angles
from indicial.errors import InputError


@dataclass(frozen=True)
class FlightCondition:
    """Steady flight: Mach number, angles and still air.

    Parameters
    ----------
    mach : float
    alpha, beta : float
        Angle of attack and sideslip [rad].
    temperature, pressure : float
        Still air [K], [Pa]; 15 C and 1 atm if not given.
    gamma, gas_constant : float
        Ratio of specific heats; specific gas constant [J/(kg K)].
    """

    mach: float
    alpha: float = 0.0
    beta: float = 0.0
    temperature: float = 288.15
    pressure: float = 101325.0
    gamma: float = 1.4
    gas_constant: float = 287.05287

    def __post_init__(self) -> None:
        for name in ("mach", "temperature", "pressure"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"{name} is {value}, must be positive and finite")
        for name in ("alpha", "beta"):
            if not math.isfinite(getattr(self, name)):
                raise InputError(f"{name} is {getattr(self, name)}, must be finite")

    @property
    def density(self) -> float:
        """[kg/m^3]"""
        return self.pressure / (self.gas_constant * self.temperature)

    @property
    def speed_of_sound(self) -> float:
        """[m/s]"""
        return math.sqrt(self.gamma * self.gas_constant * self.temperature)

    @property
    def speed(self) -> float:
        """True airspeed [m/s]."""
        return self.mach * self.speed_of_sound

    @property
    def dynamic_pressure(self) -> float:
        """[Pa]"""
        return 0.5 * self.density * self.speed**2

    @property
    def velocity(self) -> Array:
        """V_b [m/s], body axes, shape (3,)."""
        return velocity_from_angles(self.speed, self.alpha, self.beta)


@dataclass(frozen=True)
class Rates:
    """Steady body rates p, q, r [rad/s], body axes."""

    p: float = 0.0
    q: float = 0.0
    r: float = 0.0

    def __post_init__(self) -> None:
        for name in ("p", "q", "r"):
            if not math.isfinite(getattr(self, name)):
                raise InputError(f"rate {name} is {getattr(self, name)} rad/s, must be finite")

    def as_array(self) -> Array:
        """Shape (3,)."""
        return np.array([self.p, self.q, self.r])


class Motion(ABC):
    """A rigid motion: what the methods prescribe and solvers follow."""

    @abstractmethod
    def velocity(self, time: ArrayLike) -> Array:
        """V_b [m/s], body axes, shape ``time.shape + (3,)``, for time >= 0 [s]."""

    @abstractmethod
    def rate(self, time: ArrayLike) -> Array:
        """omega [rad/s], body axes, shape ``time.shape + (3,)``."""

    @property
    def velocity_before(self) -> Array:
        """V_b of the steady state from which the motion starts (t = 0-), shape (3,)."""
        return self.velocity(0.0)

    @property
    def rate_before(self) -> Array:
        """omega of the steady state from which the motion starts (t = 0-), shape (3,)."""
        return self.rate(0.0)

    def alpha(self, time: ArrayLike) -> Array:
        """Angle of attack [rad] at the moment reference point."""
        return flow_angles(self.velocity(time))[1]

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Kind and parameters as plain values, stored with every history."""


@dataclass(frozen=True)
class SteadyMotion(Motion):
    """Constant velocity and rate, from the condition."""

    condition: FlightCondition
    rates: Rates = Rates()

    def velocity(self, time: ArrayLike) -> Array:
        return np.broadcast_to(self.condition.velocity, (*np.shape(time), 3)).copy()

    def rate(self, time: ArrayLike) -> Array:
        return np.broadcast_to(self.rates.as_array(), (*np.shape(time), 3)).copy()

    def describe(self) -> dict[str, Any]:
        return {"kind": "steady", "p": self.rates.p, "q": self.rates.q, "r": self.rates.r}


@dataclass(frozen=True)
class AlphaStep(Motion):
    """A jump of V_b at constant attitude: alpha changes by `amplitude` [rad] at t = 0 (no rotation)."""

    condition: FlightCondition
    amplitude: float

    def velocity(self, time: ArrayLike) -> Array:
        c = self.condition
        after = velocity_from_angles(c.speed, c.alpha + self.amplitude, c.beta)
        return np.broadcast_to(after, (*np.shape(time), 3)).copy()

    def rate(self, time: ArrayLike) -> Array:
        return np.zeros((*np.shape(time), 3))

    @property
    def velocity_before(self) -> Array:
        return self.condition.velocity

    def describe(self) -> dict[str, Any]:
        return {"kind": "alpha_step", "amplitude": self.amplitude}


@dataclass(frozen=True)
class SideslipStep(Motion):
    """A jump of V_b at constant attitude: beta changes by `amplitude` [rad] at t = 0 (no rotation)."""

    condition: FlightCondition
    amplitude: float

    def velocity(self, time: ArrayLike) -> Array:
        c = self.condition
        after = velocity_from_angles(c.speed, c.alpha, c.beta + self.amplitude)
        return np.broadcast_to(after, (*np.shape(time), 3)).copy()

    def rate(self, time: ArrayLike) -> Array:
        return np.zeros((*np.shape(time), 3))

    @property
    def velocity_before(self) -> Array:
        return self.condition.velocity

    def describe(self) -> dict[str, Any]:
        return {"kind": "beta_step", "amplitude": self.amplitude}


@dataclass(frozen=True)
class RateStep(Motion):
    """A jump of omega with V_b constant in body axes: one rate changes from 0 to `rate_amplitude` [rad/s] at t = 0."""

    condition: FlightCondition
    rate_amplitude: float

    axis: ClassVar[Literal["p", "q", "r"]]
    kind: ClassVar[str]

    @property
    def rates(self) -> Rates:
        """After the step."""
        return Rates(**{self.axis: self.rate_amplitude})

    def velocity(self, time: ArrayLike) -> Array:
        return np.broadcast_to(self.condition.velocity, (*np.shape(time), 3)).copy()

    def rate(self, time: ArrayLike) -> Array:
        return np.broadcast_to(self.rates.as_array(), (*np.shape(time), 3)).copy()

    @property
    def rate_before(self) -> Array:
        return np.zeros(3)

    def describe(self) -> dict[str, Any]:
        return {"kind": self.kind, "rate_amplitude": self.rate_amplitude}


@dataclass(frozen=True)
class RollRateStep(RateStep):
    """A step in p."""

    axis = "p"
    kind = "roll_rate_step"


@dataclass(frozen=True)
class PitchRateStep(RateStep):
    """A step in q."""

    axis = "q"
    kind = "pitch_rate_step"


@dataclass(frozen=True)
class YawRateStep(RateStep):
    """A step in r."""

    axis = "r"
    kind = "yaw_rate_step"


@dataclass(frozen=True)
class PitchOscillation(Motion):
    r"""``A sin(omega t)`` in pitch about the moment reference point, or one half of that motion.

    - pitching about a fixed axis: alpha = alpha0 + A sin(omega t), q = A omega cos(omega t);
    - plunging (`rotates` false): the same alpha, q = 0; isolates the alphadot derivative;
    - pitching with alpha held (`varies_alpha` false): the same q, alpha = alpha0; isolates the q derivative.

    Parameters
    ----------
    condition : FlightCondition
        The mean state.
    amplitude : float
        A [rad].
    omega : float
        Angular frequency [rad/s], positive. `from_reduced_frequency` takes k instead.
    varies_alpha, rotates : bool
        Which half of the motion is made.
    """

    condition: FlightCondition
    amplitude: float
    omega: float
    varies_alpha: bool = True
    rotates: bool = True

    def __post_init__(self) -> None:
        _check_sine(self.amplitude, self.omega)
        if not (self.varies_alpha or self.rotates):
            raise InputError("an oscillation must vary alpha, rotate, or both")

    @classmethod
    def from_reduced_frequency(
        cls,
        condition: FlightCondition,
        reference: ReferenceQuantities,
        amplitude: float,
        k: float,
        *,
        varies_alpha: bool = True,
        rotates: bool = True,
    ) -> PitchOscillation:
        """The oscillation at reduced frequency ``k = omega c/2U`` (Eq. 5)."""
        omega = angular_frequency(k, condition.speed, reference.length)
        return cls(condition, amplitude, omega, varies_alpha, rotates)

    @property
    def period(self) -> float:
        """[s]"""
        return 2.0 * math.pi / self.omega

    def velocity(self, time: ArrayLike) -> Array:
        t = np.asarray(time, dtype=float)
        c = self.condition
        alpha = c.alpha + (self.amplitude * np.sin(self.omega * t) if self.varies_alpha else np.zeros_like(t))
        cb, sb = math.cos(c.beta), math.sin(c.beta)
        return c.speed * np.stack([np.cos(alpha) * cb, np.full_like(alpha, sb), np.sin(alpha) * cb], axis=-1)

    def rate(self, time: ArrayLike) -> Array:
        t = np.asarray(time, dtype=float)
        omega = np.zeros((*t.shape, 3))
        if self.rotates:
            omega[..., 1] = self.amplitude * self.omega * np.cos(self.omega * t)
        return omega

    def describe(self) -> dict[str, Any]:
        kinds = {(True, True): "pitch_oscillation", (True, False): "plunge_oscillation"}
        return {
            "kind": kinds.get((self.varies_alpha, self.rotates), "pitch_rate_oscillation"),
            "amplitude": self.amplitude,
            "omega": self.omega,
        }


Compensation = Literal["full", "sideslip", "none"]
"""What a rolling body's reference point does besides: see `RollOscillation`."""


@dataclass(frozen=True)
class RollOscillation(Motion):
    r"""Roll ``phi = A sin(omega t)`` about the body's x axis, ``p = A omega cos(omega t)``, from zero sideslip.

    A body at incidence that only rolls turns alpha into sideslip: of the velocity V_z across it at zero roll it keeps
    ``V_z cos phi`` as w and gets ``V_z sin phi`` as v. A translation in step with the roll compensates for that:

    - "full": V_b stays as it is, hence alpha and beta do (a translation by ``-V_z sin phi``, ``-V_z (1 - cos phi)``);
    - "sideslip": v = 0, hence beta = 0 to round-off, and ``w = V_z cos phi`` (by ``-V_z sin phi cos phi``,
      ``-V_z sin^2 phi``, as a dynamic mesh usually has it, there with V_z of the oncoming wind and no sign);
    - "none": roll alone.

    The translations are components of the reference point's velocity along y and z of the axes at zero roll.

    Parameters
    ----------
    condition : FlightCondition
        The mean state, without sideslip.
    amplitude : float
        A [rad].
    omega : float
        Angular frequency [rad/s], positive. `from_reduced_frequency` takes k instead.
    compensation : {"full", "sideslip", "none"}

    Raises
    ------
    InputError
        If the condition has sideslip, or a number or the compensation is bad.
    """

    condition: FlightCondition
    amplitude: float
    omega: float
    compensation: Compensation = "full"

    def __post_init__(self) -> None:
        _check_sine(self.amplitude, self.omega)
        if self.compensation not in get_args(Compensation):
            raise InputError(f"no compensation {self.compensation!r}; there are {', '.join(get_args(Compensation))}")
        if self.condition.beta != 0.0:
            raise InputError(f"a roll oscillation starts without sideslip, beta is {self.condition.beta} rad")

    @classmethod
    def from_reduced_frequency(
        cls,
        condition: FlightCondition,
        reference: ReferenceQuantities,
        amplitude: float,
        k: float,
        compensation: Compensation = "full",
    ) -> RollOscillation:
        """The oscillation at ``k = omega b/2U`` with the length b of roll moments."""
        omega = angular_frequency(k, condition.speed, float(reference.moment_lengths[0]))
        return cls(condition, amplitude, omega, compensation)

    @property
    def period(self) -> float:
        """[s]"""
        return 2.0 * math.pi / self.omega

    def angle(self, time: ArrayLike) -> Array:
        """Roll angle phi [rad]."""
        return self.amplitude * np.sin(self.omega * np.asarray(time, dtype=float))

    def velocity(self, time: ArrayLike) -> Array:
        phi = self.angle(time)
        u, _, w = self.condition.velocity
        across = {
            "full": (np.zeros_like(phi), np.full_like(phi, w)),
            "sideslip": (np.zeros_like(phi), w * np.cos(phi)),
            "none": (w * np.sin(phi), w * np.cos(phi)),
        }[self.compensation]
        return np.stack([np.full_like(phi, u), *across], axis=-1)

    def rate(self, time: ArrayLike) -> Array:
        t = np.asarray(time, dtype=float)
        omega = np.zeros((*t.shape, 3))
        omega[..., 0] = self.amplitude * self.omega * np.cos(self.omega * t)
        return omega

    def describe(self) -> dict[str, Any]:
        return {
            "kind": "roll_oscillation",
            "amplitude": self.amplitude,
            "omega": self.omega,
            "compensation": self.compensation,
        }


def _check_sine(amplitude: float, omega: float) -> None:
    if not (math.isfinite(omega) and omega > 0.0):
        raise InputError(f"oscillation frequency is {omega} rad/s, must be positive and finite")
    if not (math.isfinite(amplitude) and amplitude != 0.0):
        raise InputError(f"oscillation amplitude is {amplitude} rad, must be finite and not zero")


@dataclass(frozen=True)
class TabulatedMotion(Motion):
    """A motion given at instants, linear between them and constant outside.

    Parameters
    ----------
    times : array_like
        Increasing instants [s], shape (n,).
    velocities, rates : array_like
        V_b [m/s] and omega [rad/s], body axes, shape (n, 3).
    """

    times: Array
    velocities: Array
    rates: Array

    def __post_init__(self) -> None:
        t = np.asarray(self.times, dtype=float)
        if t.ndim != 1 or t.size < 2 or not np.all(np.diff(t) > 0.0):
            raise InputError("a tabulated motion needs at least two instants, strictly increasing")
        for name in ("velocities", "rates"):
            values = np.asarray(getattr(self, name), dtype=float)
            if values.shape != (t.size, 3) or not np.all(np.isfinite(values)):
                raise InputError(f"a tabulated motion's {name} must be finite and of shape ({t.size}, 3)")
            object.__setattr__(self, name, values)
        object.__setattr__(self, "times", t)

    def _at(self, time: ArrayLike, table: Array) -> Array:
        t = np.asarray(time, dtype=float)
        return np.stack([np.interp(t, self.times, table[:, j]) for j in range(3)], axis=-1)

    def velocity(self, time: ArrayLike) -> Array:
        return self._at(time, self.velocities)

    def rate(self, time: ArrayLike) -> Array:
        return self._at(time, self.rates)

    def describe(self) -> dict[str, Any]:
        return {"kind": "tabulated", "samples": int(self.times.size)}


@dataclass(frozen=True)
class Multisine(Motion):
    r"""Sums of sines in alpha and in pitch rate, each at frequencies of its own: one run tells all channels apart.

    ``alpha - alpha0 = A sum sin(w_j t + phi_j)`` over `alpha_omega`, and q likewise over `rate_omega`, with Schroeder's
    phases (IEEE Trans. Inf. Theory 16, 1970), which keep the sum's peak low, turned so that each sum starts at zero.

    Parameters
    ----------
    condition : FlightCondition
        The mean state, from which the motion starts.
    alpha_omega, rate_omega : tuple of float
        Angular frequencies [rad/s] of alpha and of q; either may be empty. `from_reduced_frequencies` takes k instead.
    alpha_amplitude, rate_amplitude : float
        Of each sine [rad], [rad/s].
    """

    condition: FlightCondition
    alpha_omega: tuple[float, ...]
    rate_omega: tuple[float, ...]
    alpha_amplitude: float
    rate_amplitude: float

    def __post_init__(self) -> None:
        both = (*self.alpha_omega, *self.rate_omega)
        if not both or not all(math.isfinite(omega) and omega > 0.0 for omega in both) or len(set(both)) < len(both):
            raise InputError("a multisine needs distinct frequencies, positive and finite")
        if not (math.isfinite(self.alpha_amplitude) and math.isfinite(self.rate_amplitude)):
            raise InputError("a multisine's amplitudes must be finite")

    @classmethod
    def from_reduced_frequencies(
        cls,
        condition: FlightCondition,
        reference: ReferenceQuantities,
        k: ArrayLike,
        alpha_amplitude: float,
        rate_amplitude: float,
    ) -> Multisine:
        """Reduced frequencies dealt out in turn: the first to alpha, the second to q, and so on.

        `rate_amplitude` is of ``q c/2V``.
        """
        length = reference.length
        omega = [angular_frequency(float(one), condition.speed, length) for one in np.ravel(np.asarray(k, dtype=float))]
        rate = rate_amplitude * 2.0 * condition.speed / length
        return cls(condition, tuple(omega[::2]), tuple(omega[1::2]), alpha_amplitude, rate)

    def velocity(self, time: ArrayLike) -> Array:
        c = self.condition
        alpha = c.alpha + self.alpha_amplitude * _sines(self.alpha_omega, np.asarray(time, dtype=float))
        cb, sb = math.cos(c.beta), math.sin(c.beta)
        return c.speed * np.stack([np.cos(alpha) * cb, np.full_like(alpha, sb), np.sin(alpha) * cb], axis=-1)

    def rate(self, time: ArrayLike) -> Array:
        t = np.asarray(time, dtype=float)
        omega = np.zeros((*t.shape, 3))
        omega[..., 1] = self.rate_amplitude * _sines(self.rate_omega, t)
        return omega

    def describe(self) -> dict[str, Any]:
        return {
            "kind": "multisine",
            "alpha_omega": list(self.alpha_omega),
            "rate_omega": list(self.rate_omega),
            "alpha_amplitude": self.alpha_amplitude,
            "rate_amplitude": self.rate_amplitude,
        }


def _sines(omega: tuple[float, ...], time: Array) -> Array:
    """Sum of unit sines with Schroeder's phases, 0 at t = 0; shape of `time`."""
    if not omega:
        return np.zeros_like(time)
    w = np.array(omega)
    index = np.arange(w.size)
    phase = -np.pi * index * (index + 1) / w.size + np.pi / 2.0
    total: Array = np.sin(np.multiply.outer(time + _zero(w, phase), w) + phase).sum(axis=-1)
    return total


def _zero(w: Array, phase: Array) -> float:
    """First instant at which the sum of sines is zero."""

    def total(t: float) -> float:
        return float(np.sum(np.sin(w * t + phase)))

    # no sum of sines without a mean keeps its sign for two periods of its slowest one
    grid = np.linspace(0.0, 4.0 * np.pi / np.min(w), 64 * w.size * int(np.ceil(np.max(w) / np.min(w))))
    values = np.array([total(float(t)) for t in grid])
    first = int(np.flatnonzero(values[:-1] * values[1:] <= 0.0)[0])
    return float(brentq(total, grid[first], grid[first + 1]))
