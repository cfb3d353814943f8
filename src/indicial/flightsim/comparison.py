"""Two flights compared: differences of position and angles, of damping and of phase."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.files import write_csv
from indicial.flightsim.epicycle import EpicyclicFit, fit_trajectory
from indicial.flightsim.trajectory import Trajectory

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Alignment = Literal["time", "station"]
ANGLES = ("alpha", "beta", "total_angle")

_NO_PHASE = 0.05  # of the largest incidence


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
    fits : pair of EpicyclicFit or None
        Of the first and the second flight.
    """

    first: Trajectory
    second: Trajectory
    aligned: Alignment
    arms: tuple[ArmDifference, ...]
    fits: tuple[EpicyclicFit, EpicyclicFit] | None = None

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

    @property
    def phase_difference(self) -> Array:
        """Angle [rad] by which each arm of the second flight leads at every instant, shape (n, 2): fast, slow.

        With the first flight's eigenvalues the incidence and its slope over distance, ``xi - K_T = a_F + a_S`` and
        ``xi' = lambda_F a_F + lambda_S a_S``, tell the arms of both flights apart at any instant. NaN where an arm is
        below a twentieth of its largest, and everywhere if no epicycle was fitted.
        """
        phase = np.full((len(self.first), 2), np.nan)
        if self.fits is None:
            return phase
        roots = [arm.eigenvalue for arm in (self.fits[0].fast, self.fits[0].slow)]
        one, other = (
            _arms_at(flight, fit.trim, roots) for flight, fit in zip((self.first, self.second), self.fits, strict=True)
        )
        for k in range(2):
            sizes = np.minimum(*(np.abs(a[:, k]) / np.max(np.abs(a[:, k])) for a in (one, other)))
            seen = sizes > _NO_PHASE
            phase[seen, k] = np.unwrap(np.angle(other[seen, k] * one[seen, k].conj()))
        return phase

    @property
    def swerve_difference(self) -> Array:
        """Of `swerve` of both flights [m], to the right and down, shape (n, 2)."""
        return swerve(self.second) - swerve(self.first)

    def to_dict(self) -> dict[str, Any]:
        """Plain values, schema version 1."""
        across = self.swerve_difference
        return {
            "schema_version": 1,
            "kind": "flight comparison",
            "aligned": self.aligned,
            "instants": len(self.first),
            "rms_position_m": self.rms_position.tolist(),
            "largest_position_m": np.max(np.abs(self.position_difference), axis=0).tolist(),
            "rms_angles_deg": {name: math.degrees(self.rms_angle(name)) for name in ANGLES},
            "rms_incidence_deg": math.degrees(self.rms_incidence),
            "rms_mach": float(np.sqrt(np.mean((self.second.mach - self.first.mach) ** 2))),
            "rms_swerve_m": float(np.sqrt(np.mean(np.sum(across**2, axis=1)))),
            "arms": [asdict(arm) for arm in self.arms],
        }

    def to_csv(self, path: str | Path) -> None:
        """The differences at every instant, in one step."""
        first, second = self.first, self.second
        across, columns = self.swerve_difference, {"time_s": first.time, "x_m": first.position[:, 0]}
        columns |= {f"d{axis}_m": self.position_difference[:, i] for i, axis in enumerate("xyz")}
        columns |= {f"d{n}_deg": np.degrees(getattr(second, n) - getattr(first, n)) for n in ANGLES}
        columns |= {"dmach": second.mach - first.mach, "dphase_fast_deg": np.degrees(self.phase_difference[:, 0])}
        columns |= {"dphase_slow_deg": np.degrees(self.phase_difference[:, 1])}
        columns |= {"dswerve_right_m": across[:, 0], "dswerve_down_m": across[:, 1]}
        write_csv(path, {"format": "indicial flight comparison", "schema_version": 1, "aligned": self.aligned}, columns)

    def summary(self) -> str:
        """Differences of position, angles and arms."""
        x, y, z = self.rms_position
        angles = ", ".join(f"{name} {math.degrees(self.rms_angle(name)):.3g}" for name in ANGLES)
        peak = math.degrees(float(np.max(self.first.total_angle)))
        lines = [
            f"{len(self.first)} instants aligned by {self.aligned}: rms x {x:.3g}, y {y:.3g}, z {z:.3g} m; "
            f"rms angles [deg] {angles} (largest angle {peak:.3g} deg)"
        ]
        record = self.to_dict()
        lines.append(f"  swerve {record['rms_swerve_m']:.3g} m rms, Mach number {record['rms_mach']:.2g} rms")
        lines += [
            f"  {a.name}: damping {a.damping_first:.5g} 1/s, difference {a.damping:+.3g} 1/s "
            f"({a.damping / a.damping_first:+.2%}); frequency {a.frequency:+.3g} rad/s; "
            f"phase at the end {math.degrees(a.phase):+.3g} deg"
            for a in self.arms
        ]
        return "\n".join(lines)

    def plot(self) -> Figure:
        """Angles of both flights, and their differences of position, swerve and phase, over distance."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(5, 1, figsize=(9, 12), sharex=True, layout="constrained")
        x = self.first.position[:, 0]
        for flight, style, label in ((self.first, "-", "first"), (self.second, "--", "second")):
            axes[0].plot(x, np.degrees(flight.alpha), style, label=label)
            axes[1].plot(x, np.degrees(flight.beta), style, label=label)
        for i, name in enumerate("xyz"):
            axes[2].plot(x, self.position_difference[:, i], label=name)
        for i, name in enumerate(("right", "down")):
            axes[3].plot(x, self.swerve_difference[:, i], label=name)
        for k, (name, style) in enumerate((("fast arm", "-"), ("slow arm", "--"))):
            axes[4].plot(x, np.degrees(self.phase_difference[:, k]), style, label=name)
        axes[0].set(ylabel="alpha [deg]")
        axes[1].set(ylabel="beta [deg]")
        axes[2].set(ylabel="position, second less first [m]")
        axes[3].set(ylabel="swerve, second less first [m]")
        axes[4].set(xlabel="x [m]", ylabel="second leads by [deg]")
        for axis in axes:
            axis.legend(fontsize="small")
        return figure


def swerve(flight: Trajectory) -> Array:
    """How the path winds: y and z [m] less the cubic in x that fits them best (aim, drop and drift), shape (n, 2).

    Raises
    ------
    InputError
        If there are too few instants, or the flight does not go downrange.
    """
    x = flight.position[:, 0]
    if len(flight) < 5 or np.any(np.diff(x) <= 0.0):
        raise InputError("swerve needs a flight downrange of five instants or more")
    scaled = 2.0 * (x - x[0]) / (x[-1] - x[0]) - 1.0
    basis = np.polynomial.legendre.legvander(scaled, 3)
    fitted, *_ = np.linalg.lstsq(basis, flight.position[:, 1:], rcond=None)
    winding: Array = flight.position[:, 1:] - basis @ fitted
    return winding


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
    if not arms:
        return TrajectoryComparison(one, other, aligned, ())
    fits = (fit_trajectory(one), fit_trajectory(other))
    return TrajectoryComparison(one, other, aligned, _differences(one, fits), fits)


def _differences(first: Trajectory, fits: tuple[EpicyclicFit, EpicyclicFit]) -> tuple[ArmDifference, ...]:
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


def _arms_at(flight: Trajectory, trim: complex, roots: list[complex]) -> Any:
    """Fast and slow arm at every instant, complex (n, 2)."""
    from scipy.interpolate import CubicSpline

    turned = flight.non_rolling_incidence - trim
    slope = CubicSpline(flight.distance, turned).derivative()(flight.distance)
    return np.linalg.solve(np.array([[1.0, 1.0], roots]), np.stack([turned, slope])).T
