r"""Exact linearisation, and the modes of a missile in straight flight.

Modes of the angular motion are taken over distance flown, in axes that do not roll: with ``e = (v, w)/V``, rates
over V, and lag states as they are, ``dz/ds = (1/V)(T A T^-1 - (Vdot/V) E) z``, T dividing velocities and rates by V
and E picking them out. This is exact to first order while drag slows the missile down, where a time-domain
Jacobian with V frozen is not: it has ``-CN_alpha`` where the lift ``-CL_alpha = -(CN_alpha - CA)`` belongs, and
misses the growth of the angles by ``rho V S CA/4m`` as the frequency falls with V. Times V, eigenvalues are in 1/s.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.dynamics import Dynamics
from indicial.flightsim.epicycle import Complex, order_arms
from indicial.flightsim.initial import InitialState


@dataclass(frozen=True)
class LinearModel:
    """``d(dx)/dt = A dx`` about a state, exact (casadi's derivative of the equations flown).

    Parameters
    ----------
    matrix : ndarray
        A, shape (n, n).
    state : ndarray
        The state it is taken about, shape (n,).
    rate : ndarray
        dx/dt there, shape (n,); not zero in straight flight that drag slows down.
    state_names : tuple of str
    """

    matrix: Array
    state: Array
    rate: Array
    state_names: tuple[str, ...]

    def block(self, rows: tuple[str, ...], columns: tuple[str, ...] | None = None) -> Array:
        """Part of A by state names."""
        i = [self.state_names.index(name) for name in rows]
        j = i if columns is None else [self.state_names.index(name) for name in columns]
        part: Array = self.matrix[np.ix_(i, j)]
        return part


@dataclass(frozen=True)
class Mode:
    """One mode.

    Parameters
    ----------
    name : str
        "fast arm" (nutation), "slow arm" (precession), "roll", "lag 1", ...
    eigenvalue : complex
        [1/s] at `speed`: of angles (and rates over V) over distance, times V; of p over time for roll.
    speed : float
        [m/s].
    """

    name: str
    eigenvalue: complex
    speed: float

    @property
    def per_metre(self) -> complex:
        """Eigenvalue over distance [1/m]."""
        return self.eigenvalue / self.speed

    @property
    def frequency(self) -> float:
        """Turning rate [rad/s], positive in the sense from y to z (that of positive roll)."""
        return self.eigenvalue.imag

    @property
    def damping(self) -> float:
        """Real part of the eigenvalue [1/s], negative if the motion dies out."""
        return self.eigenvalue.real

    @property
    def damping_ratio(self) -> float:
        """``-Re/|eigenvalue|``."""
        return -self.eigenvalue.real / abs(self.eigenvalue)


@dataclass(frozen=True)
class Modes:
    """The modes of a missile in straight flight.

    Parameters
    ----------
    modes : tuple of Mode
    speed : float
        [m/s].
    roll_rate : float
        [rad/s].
    """

    modes: tuple[Mode, ...]
    speed: float
    roll_rate: float

    def __getitem__(self, name: str) -> Mode:
        for mode in self.modes:
            if mode.name == name:
                return mode
        raise InputError(f"no mode {name!r}; there are {', '.join(mode.name for mode in self.modes)}")

    @property
    def lag(self) -> tuple[Mode, ...]:
        """The modes of the aerodynamic lag states."""
        return tuple(mode for mode in self.modes if mode.name.startswith("lag"))

    def summary(self) -> str:
        """A line for each mode."""
        lines = [f"modes at {self.speed:.5g} m/s, roll rate {self.roll_rate:.5g} rad/s"]
        lines += [
            f"  {m.name:<10} damping {m.damping:>12.6g} 1/s  frequency {m.frequency:>12.6g} rad/s  "
            f"ratio {m.damping_ratio:.4g}"
            for m in self.modes
        ]
        return "\n".join(lines)


def linearise(dynamics: Dynamics, state: Array, parameters: Mapping[str, float] | None = None) -> LinearModel:
    """The exact linear model about a state vector (`Dynamics.initial_vector`)."""
    values = dynamics.parameter_vector(parameters)
    matrix, rate = dynamics.jacobian(state, values), dynamics.rate(state, values)
    return LinearModel(matrix, np.asarray(state, dtype=float), rate, dynamics.state_names)


def missile_modes(
    dynamics: Dynamics,
    speed: float,
    *,
    roll_rate: float = 0.0,
    altitude: float = 0.0,
    parameters: Mapping[str, float] | None = None,
) -> Modes:
    """Modes of a missile of rotational symmetry in straight level flight at zero incidence.

    Gravity does not enter: it bends the path and leaves a trim, over many wavelengths.

    Parameters
    ----------
    dynamics : Dynamics
        Lag states, if any, those of the pitch plane first, then those of the yaw plane.
    speed : float
        [m/s].
    roll_rate : float
        [rad/s]; p/V is held.
    altitude : float
        [m].

    Raises
    ------
    InputError
        If the motion in the two planes is not alike.
    """
    if not (math.isfinite(speed) and speed > 0.0):
        raise InputError(f"speed is {speed} m/s, must be positive and finite")
    initial = InitialState.from_path(speed, rate=(roll_rate, 0.0, 0.0), position=(0.0, 0.0, -altitude))
    values = dynamics.parameter_vector(parameters)
    model = linearise(dynamics, dynamics.initial_vector(initial, values), parameters)
    planes = complex_plane(over_distance(model, speed), dynamics.lag_states // 2)
    turning = 1j * roll_rate / speed
    found = [complex(value) + turning for value in np.linalg.eigvals(planes)]
    near = [complex(value) + turning for value in np.linalg.eigvals(_without_lag(planes))]
    arms = [found.pop(int(np.argmin([abs(value - guess) for value in found]))) for guess in near]
    fast, slow = order_arms(*arms)
    named = [("fast arm", fast * speed), ("slow arm", slow * speed), ("roll", complex(model.block(("p",))[0, 0]))]
    named += [(f"lag {i + 1}", value * speed) for i, value in enumerate(sorted(found, key=lambda v: -v.real))]
    return Modes(tuple(Mode(name, value, speed) for name, value in named), speed, roll_rate)


def over_distance(model: LinearModel, speed: float) -> Array:
    """The transverse motion over distance, states (v/V, w/V, q/V, r/V, lag pitch, lag yaw)."""
    names = ("v", "w", "q", "r", *model.state_names[13:])
    matrix = model.block(names)
    scale = np.ones(len(names))
    scale[:4] = 1.0 / speed
    slowing = model.rate[model.state_names.index("u")] / speed
    carried: Array = (scale[:, None] * matrix / scale[None, :] - np.diag(np.where(scale < 1.0, slowing, 0.0))) / speed
    return carried


def complex_plane(matrix: Array, lags: int) -> Complex:
    """The matrix of (v + iw, q + ir, lag_yaw + i lag_pitch) of a motion that is the same in both planes."""
    y = [0, 2, *range(4 + lags, 4 + 2 * lags)]
    z = [1, 3, *range(4, 4 + lags)]
    along, across = matrix[np.ix_(y, y)], matrix[np.ix_(z, y)]
    mismatch = max(np.max(np.abs(matrix[np.ix_(z, z)] - along)), np.max(np.abs(matrix[np.ix_(y, z)] + across)))
    if mismatch > 1e-9 * np.max(np.abs(matrix)):
        raise InputError(
            "the pitch and yaw planes of this vehicle differ: its modes are not those of a symmetric missile"
        )
    return along + 1j * across


def _without_lag(planes: Complex) -> Complex:
    """The two rigid-body states with the lag states settled."""
    if len(planes) == 2:
        return planes
    settled = np.linalg.solve(planes[2:, 2:], planes[2:, :2])
    rigid: Complex = planes[:2, :2] - planes[:2, 2:] @ settled
    return rigid
