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
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.dynamics import Dynamics
from indicial.flightsim.epicycle import Complex, order_arms
from indicial.flightsim.initial import InitialState

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
        Of a missile "fast arm" (nutation), "slow arm" (precession), "roll", "lag 1", ...; of an aircraft see
        `aircraft_modes`.
    eigenvalue : complex
        [1/s] at `speed`. Of a missile: of angles (and rates over V) over distance, times V; of p over time for roll.
        Of an aircraft: over time, a pair by the one with positive frequency.
    speed : float
        [m/s].
    shape : mapping of str to complex
        Eigenvector by states: of an aircraft's mode with the largest of V/speed and the angles scaled to 1; of a
        missile's the incidence ``(v + iw)/V``, the rate ``(q + ir)/V`` [1/m], lag states ``yaw + i pitch`` and p,
        scaled so that the incidence (in the roll mode p) is 1.
    participation : mapping of str to float
        Share of each state in an aircraft's mode, of sum 1.
    """

    name: str
    eigenvalue: complex
    speed: float
    shape: Mapping[str, complex] = field(default_factory=dict)
    participation: Mapping[str, float] = field(default_factory=dict)

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
        """``-Re/|eigenvalue|``; of a mode that neither grows nor turns 0."""
        size = abs(self.eigenvalue)
        return -self.eigenvalue.real / size if size else 0.0

    @property
    def natural_frequency(self) -> float:
        """``|eigenvalue|`` [rad/s]."""
        return abs(self.eigenvalue)

    @property
    def period(self) -> float:
        """Time of a turn [s], infinite if it does not turn."""
        return 2.0 * math.pi / abs(self.eigenvalue.imag) if self.eigenvalue.imag else math.inf

    @property
    def time_to_half(self) -> float:
        """Time in which it dies down to half [s], infinite if it does not."""
        return -math.log(2.0) / self.eigenvalue.real if self.eigenvalue.real < 0.0 else math.inf

    @property
    def time_to_double(self) -> float:
        """Time in which it grows to the double [s], infinite if it does not."""
        return math.log(2.0) / self.eigenvalue.real if self.eigenvalue.real > 0.0 else math.inf


@dataclass(frozen=True)
class Modes:
    """The modes of a missile in straight flight, or of an aircraft in steady flight.

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
        width = max(10, *(len(mode.name) for mode in self.modes))
        for m in self.modes:
            line = f"  {m.name:<{width}} damping {m.damping:>12.6g} 1/s  frequency {m.frequency:>12.6g} rad/s  "
            grows = m.eigenvalue.real > 0.0
            time = f"doubles in {m.time_to_double:.4g} s" if grows else f"halves in {m.time_to_half:.4g} s"
            lines.append(f"{line}ratio {m.damping_ratio:.4g}  {time}")
        return "\n".join(lines)

    def plot(self) -> Figure:
        """Eigenvalues, and the phasors of each mode that oscillates.

        Of an aircraft those of V/speed and the angles, of a missile those of the incidence and the rate (over the
        arm's own turning).

        Raises
        ------
        InputError
            If the modes have no shapes.
        """
        import matplotlib.pyplot as plt

        turning = [mode for mode in self.modes if mode.shape and mode.frequency]
        if not any(mode.shape for mode in self.modes):
            raise InputError("these modes have no shapes to draw")
        figure = plt.figure(figsize=(4.2 * (1 + len(turning)), 4.2), layout="constrained")
        plane = figure.add_subplot(1, 1 + len(turning), 1)
        for mode in self.modes:
            plane.plot(mode.damping, mode.frequency, "x", markersize=8, label=mode.name)
        plane.axvline(0.0, color="0.6", linewidth=0.8)
        plane.set(xlabel="real part [1/s]", ylabel="imaginary part [rad/s]", title="eigenvalues")
        plane.legend(fontsize="small")
        for i, mode in enumerate(turning):
            axes = figure.add_subplot(1, 1 + len(turning), 2 + i, projection="polar")
            axes.set_title(f"{mode.name}: {mode.natural_frequency:.3g} rad/s, ratio {mode.damping_ratio:.3g}")
            for j, (state, value) in enumerate(_phasors(mode).items()):
                arrow = {"arrowstyle": "-|>", "color": f"C{j}", "shrinkA": 0.0, "shrinkB": 0.0}
                axes.annotate("", (float(np.angle(value)), abs(value)), (0.0, 0.0), arrowprops=arrow)
                axes.plot([], [], color=f"C{j}", label=state)
            axes.set_ylim(0.0, 1.05)
            axes.legend(fontsize="small", loc="lower left", bbox_to_anchor=(-0.15, -0.15))
        return figure


def _phasors(mode: Mode) -> dict[str, complex]:
    """What a mode's picture shows: V/speed and angles, those that can be seen; of a missile incidence and rate."""
    if "incidence" in mode.shape:
        turning = mode.shape["rate"] / abs(mode.per_metre)
        return {"(v + iw)/V": mode.shape["incidence"], "(q + ir)/|lambda|": turning}
    angles = {name: mode.shape[name] for name in ("alpha", "theta", "beta", "phi") if name in mode.shape}
    every = {"V/speed": mode.shape["V"] / mode.speed, **angles}
    return {name: value for name, value in every.items() if abs(value) > 0.01}


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
    values_found, vectors = np.linalg.eig(planes)
    found = [complex(value) + turning for value in values_found]
    shapes = {value: _missile_shape(vectors[:, i]) for i, value in enumerate(found)}
    near = [complex(value) + turning for value in np.linalg.eigvals(_without_lag(planes))]
    arms = [found.pop(int(np.argmin([abs(value - guess) for value in found]))) for guess in near]
    fast, slow = order_arms(*arms)
    named = {"fast arm": fast, "slow arm": slow}
    named |= {f"lag {i + 1}": value for i, value in enumerate(sorted(found, key=lambda v: -v.real))}
    modes = [Mode(name, value * speed, speed, shapes[value]) for name, value in named.items()]
    rolling = dict.fromkeys(modes[0].shape, 0j) | {"p": 1.0 + 0j}
    modes.insert(2, Mode("roll", complex(model.block(("p",))[0, 0]), speed, rolling))
    return Modes(tuple(modes), speed, roll_rate)


def _missile_shape(vector: Complex) -> dict[str, complex]:
    """Eigenvector of the complex plane by states, its incidence 1."""
    scaled = vector / vector[0]
    names = ("incidence", "rate", *(f"lag {i + 1}" for i in range(len(vector) - 2)))
    return dict(zip(names, (complex(value) for value in scaled), strict=True)) | {"p": 0j}


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
