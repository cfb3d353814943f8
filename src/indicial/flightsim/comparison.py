"""Two flights compared: differences of position and angles, of damping and of phase."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.epicycle import EpicyclicFit, fit_trajectory
from indicial.flightsim.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Alignment = Literal["time", "station"]
ANGLES = ("alpha", "beta", "total_angle")


@dataclass(frozen=True)
class ArmDifference:
    """How one arm of the epicycle differs, second flight less first.

    Parameters
    ----------
    name : str
    damping, frequency : float
        [1/s], [rad/s] at the mean speed of the first flight.
    damping_first : float
        Of the first flight [1/s].
    phase : float
        Angle by which the arm leads at the end of the flight [rad], within +-pi.
    """

    name: str
    damping: float
    frequency: float
    damping_first: float
    phase: float


@dataclass(frozen=True)
class TrajectoryComparison:
    """The second flight less the first, at the instants (or stations) of the first that both have.

    Parameters
    ----------
    first, second : Trajectory
        On the same instants or stations.
    aligned : {"time", "station"}
    arms : tuple of ArmDifference
        Fast and slow arm, from epicyclic fits of both; empty if no fit was asked for.
    """

    first: Trajectory
    second: Trajectory
    aligned: Alignment
    arms: tuple[ArmDifference, ...]

    @property
    def position_difference(self) -> Array:
        """Earth axes [m], shape (n, 3)."""
        return self.second.position - self.first.position

    @property
    def rms_position(self) -> Array:
        """Root mean square of each component [m], shape (3,)."""
        rms: Array = np.sqrt(np.mean(self.position_difference**2, axis=0))
        return rms

    def rms_angle(self, name: str) -> float:
        """Root mean square difference of one of `ANGLES` [rad]."""
        if name not in ANGLES:
            raise InputError(f"no angle {name!r}; there are {', '.join(ANGLES)}")
        return float(np.sqrt(np.mean((getattr(self.second, name) - getattr(self.first, name)) ** 2)))

    @property
    def rms_incidence(self) -> float:
        """Root mean square of the difference of complex incidence, axes that do not roll [rad]."""
        difference = self.second.non_rolling_incidence - self.first.non_rolling_incidence
        return float(np.sqrt(np.mean(np.abs(difference) ** 2)))

    def summary(self) -> str:
        """Differences of position, angles and arms."""
        x, y, z = self.rms_position
        angles = ", ".join(f"{name} {math.degrees(self.rms_angle(name)):.3g}" for name in ANGLES)
        peak = math.degrees(float(np.max(self.first.total_angle)))
        lines = [
            f"{len(self.first)} instants aligned by {self.aligned}: rms x {x:.3g}, y {y:.3g}, z {z:.3g} m; "
            f"rms angles [deg] {angles} (largest angle {peak:.3g} deg)"
        ]
        lines += [
            f"  {a.name}: damping {a.damping_first:.5g} 1/s, difference {a.damping:+.3g} 1/s "
            f"({a.damping / a.damping_first:+.2%}); frequency {a.frequency:+.3g} rad/s; "
            f"phase at the end {math.degrees(a.phase):+.3g} deg"
            for a in self.arms
        ]
        return "\n".join(lines)

    def plot(self) -> Figure:
        """Angles of both flights, and their difference of position, over distance."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(3, 1, figsize=(9, 9), sharex=True, layout="constrained")
        x = self.first.position[:, 0]
        for flight, style, label in ((self.first, "-", "first"), (self.second, "--", "second")):
            axes[0].plot(x, np.degrees(flight.alpha), style, label=label)
            axes[1].plot(x, np.degrees(flight.beta), style, label=label)
        for i, name in enumerate("xyz"):
            axes[2].plot(x, self.position_difference[:, i], label=name)
        axes[0].set(ylabel="alpha [deg]")
        axes[1].set(ylabel="beta [deg]")
        axes[2].set(xlabel="x [m]", ylabel="difference of position [m]")
        for axis in axes:
            axis.legend()
        return figure


def compare(
    first: Trajectory, second: Trajectory, *, aligned: Alignment = "time", arms: bool = True
) -> TrajectoryComparison:
    """Compare two flights.

    Parameters
    ----------
    first, second : Trajectory
    aligned : {"time", "station"}
        Whether the second flight is taken at the first's instants, or where it passes the first's downrange stations.
    arms : bool
        Fit an epicycle with trim to each, for the differences of damping and phase.

    Raises
    ------
    InputError
        If the flights have too little in common.
    """
    if aligned not in ("time", "station"):
        raise InputError(f"aligned is {aligned!r}, must be 'time' or 'station'")
    axes = [flight.time if aligned == "time" else flight.position[:, 0] for flight in (first, second)]
    low, high = max(axis[0] for axis in axes), min(axis[-1] for axis in axes)
    shared = axes[0][(axes[0] >= low) & (axes[0] <= high)]
    if shared.size < 2:
        raise InputError(f"the two flights have no {aligned}s in common")
    if aligned == "time":
        one, other = first.at_times(shared), second.at_times(shared)
    else:
        one, other = first.at_stations(shared), second.at_stations(shared)
    differences = _arms(one, other) if arms else ()
    return TrajectoryComparison(one, other, aligned, differences)


def _arms(first: Trajectory, second: Trajectory) -> tuple[ArmDifference, ...]:
    fits: tuple[EpicyclicFit, EpicyclicFit] = (fit_trajectory(first), fit_trajectory(second))
    speed = float(np.mean(first.speed))
    end = float(first.distance[-1])
    differences = []
    for name in ("fast", "slow"):
        a, b = (getattr(fit, name) for fit in fits)
        change = b.eigenvalue - a.eigenvalue
        phase = np.angle(b.amplitude / a.amplitude * np.exp(1j * change.imag * end))
        differences.append(
            ArmDifference(
                name=f"{name} arm",
                damping=change.real * speed,
                frequency=change.imag * speed,
                damping_first=a.eigenvalue.real * speed,
                phase=float(phase),
            )
        )
    return tuple(differences)
