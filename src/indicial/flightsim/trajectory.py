"""A flight: labelled states and loads in time, with units, files and interpolation."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from indicial.conventions import Array, ReferenceQuantities, flow_angles
from indicial.errors import InputError
from indicial.flightsim.attitude import euler_angles, matrix_from_quaternion
from indicial.flightsim.trajectory_files import COLUMNS, dataset, load, save
from indicial.flightsim.trajectory_path import plot_path

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Trajectory:
    """States and aerodynamic loads of a flight at instants.

    Parameters
    ----------
    time : ndarray
        Strictly increasing [s], shape (n,).
    position : ndarray
        Centre of gravity, earth axes x downrange, y right, z down [m], shape (n, 3).
    velocity : ndarray
        Of the centre of gravity over the ground, body axes [m/s], shape (n, 3).
    quaternion : ndarray
        Unit, scalar first, body -> earth, shape (n, 4).
    rate : ndarray
        (p, q, r), body axes [rad/s], shape (n, 3).
    force, moment : ndarray
        Aerodynamic force [N] and moment about the centre of gravity [N m], body axes, shape (n, 3).
    density, speed_of_sound : ndarray
        Of the air [kg/m^3], [m/s], shape (n,).
    lag : ndarray
        Aerodynamic lag states, shape (n, n_lag).
    outside_range : ndarray of bool
        Where the aerodynamic model or the atmosphere was used beyond where it holds, shape (n,).
    reference : ReferenceQuantities
    lag_names : tuple of str
    provenance : dict
        How it was made: vehicle, method, step, error estimate (plain values).
    wind : ndarray, optional
        Velocity of the air over the ground, body axes [m/s], shape (n, 3); still air if not given.
    """

    time: Array
    position: Array
    velocity: Array
    quaternion: Array
    rate: Array
    force: Array
    moment: Array
    density: Array
    speed_of_sound: Array
    lag: Array
    outside_range: NDArray[np.bool_]
    reference: ReferenceQuantities
    lag_names: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)
    wind: Array = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        n = np.size(self.time)
        if np.size(self.wind) == 0:
            object.__setattr__(self, "wind", np.zeros((n, 3)))
        shapes = {"time": (n,), "density": (n,), "speed_of_sound": (n,), "lag": (n, len(self.lag_names))}
        shapes |= {name: (n, len(columns)) for name, columns in COLUMNS.items()}
        for name, shape in shapes.items():
            values = np.asarray(getattr(self, name), dtype=float)
            if values.shape != shape or not np.all(np.isfinite(values)):
                raise InputError(f"trajectory {name} must be finite and of shape {shape}, not {values.shape}")
            object.__setattr__(self, name, values)
        object.__setattr__(self, "outside_range", np.asarray(self.outside_range, dtype=bool).reshape(n))
        if n < 1 or np.any(np.diff(self.time) <= 0.0):
            raise InputError("trajectory time must be strictly increasing")

    def __len__(self) -> int:
        return int(self.time.size)

    @property
    def air_velocity(self) -> Array:
        """Of the centre of gravity through the air, body axes [m/s], shape (n, 3)."""
        return self.velocity - self.wind

    @property
    def speed(self) -> Array:
        """V of the centre of gravity through the air [m/s]."""
        return flow_angles(self.air_velocity)[0]

    @property
    def alpha(self) -> Array:
        """``atan2(w, u)`` [rad]."""
        return flow_angles(self.air_velocity)[1]

    @property
    def beta(self) -> Array:
        """``asin(v/V)`` [rad]."""
        return flow_angles(self.air_velocity)[2]

    @property
    def total_angle(self) -> Array:
        """Angle between the body's x axis and the velocity through the air [rad]."""
        u, v, w = self.air_velocity.T
        angle: Array = np.arctan2(np.hypot(v, w), u)
        return angle

    @property
    def mach(self) -> Array:
        """Mach number."""
        return self.speed / self.speed_of_sound

    @property
    def euler(self) -> Array:
        """(yaw, pitch, roll) [rad], shape (n, 3)."""
        return euler_angles(self.quaternion)

    @property
    def earth_velocity(self) -> Array:
        """Velocity, earth axes [m/s], shape (n, 3)."""
        turned: Array = np.einsum("nij,nj->ni", matrix_from_quaternion(self.quaternion), self.velocity)
        return turned

    @property
    def coefficients(self) -> Array:
        """(CA, CY, CN, Cl, Cm, Cn), moments about the centre of gravity, shape (n, 6); 0 at rest."""
        pressure_area = 0.5 * self.density * self.speed**2 * self.reference.area
        scale = np.divide(1.0, pressure_area, out=np.zeros_like(pressure_area), where=pressure_area > 0.0)[:, None]
        force = self.force * np.array([-1.0, 1.0, -1.0]) * scale
        return np.hstack([force, self.moment * scale / self.reference.moment_lengths])

    @property
    def distance(self) -> Array:
        """Length of path flown from the first instant [m]."""
        from scipy.interpolate import CubicSpline

        if len(self) < 2:
            return np.zeros(len(self))
        over_ground = np.linalg.norm(self.velocity, axis=1)
        length: Array = CubicSpline(self.time, over_ground).antiderivative()(self.time)
        return length

    @property
    def non_rolling_incidence(self) -> Any:
        r"""``xi = (v + i w)/V exp(i integral of p dt)``, beta + i alpha in axes that do not roll, complex (n,)."""
        from scipy.interpolate import CubicSpline

        turned = CubicSpline(self.time, self.rate[:, 0]).antiderivative()(self.time) if len(self) > 1 else 0.0
        incidence = self.air_velocity[:, 1] + 1j * self.air_velocity[:, 2]
        speed = self.speed
        return np.divide(incidence, speed, out=np.zeros_like(incidence), where=speed > 0.0) * np.exp(1j * turned)

    def at_times(self, times: ArrayLike) -> Trajectory:
        """The flight at other instants [s], by cubic splines (fourth order in the sampling interval).

        Raises
        ------
        InputError
            If an instant lies outside the flight.
        """
        from scipy.interpolate import CubicSpline

        t = np.atleast_1d(np.asarray(times, dtype=float))
        if t.size == 0 or np.min(t) < self.time[0] or np.max(t) > self.time[-1]:
            raise InputError(f"times must be within {self.time[0]:g} to {self.time[-1]:g} s of the trajectory")
        names = (*COLUMNS, "density", "speed_of_sound", "lag")
        values: dict[str, Any] = {name: CubicSpline(self.time, getattr(self, name))(t) for name in names}
        values["quaternion"] /= np.linalg.norm(values["quaternion"], axis=1, keepdims=True)
        nearest = np.clip(np.searchsorted(self.time, t), 0, len(self) - 1)
        return Trajectory(
            time=t,
            **values,
            outside_range=self.outside_range[nearest],
            reference=self.reference,
            lag_names=self.lag_names,
            provenance=self.provenance,
        )

    def at_stations(self, x: ArrayLike) -> Trajectory:
        """The flight where it passes downrange stations x [m].

        Raises
        ------
        InputError
            If the flight does not pass a station, or does not go steadily downrange.
        """
        from scipy.interpolate import CubicSpline

        stations = np.atleast_1d(np.asarray(x, dtype=float))
        along = self.position[:, 0]
        if np.any(np.diff(along) <= 0.0):
            raise InputError("stations need a flight that goes downrange all the time (x increasing)")
        room = 1e-12 * np.max(np.abs(along))  # what round-off may add to the last station
        if stations.size == 0 or np.min(stations) < along[0] - room or np.max(stations) > along[-1] + room:
            raise InputError(f"stations must be within x = {along[0]:g} to {along[-1]:g} m of the trajectory")
        distance = CubicSpline(self.time, along)
        times = np.interp(stations, along, self.time)
        for _ in range(4):
            times = np.clip(times - (distance(times) - stations) / distance(times, 1), self.time[0], self.time[-1])
        return self.at_times(times)

    def to_dataset(self) -> xarray.Dataset:
        """The trajectory as an `xarray.Dataset` with units."""
        return dataset(self)

    def save(self, path: str | Path) -> None:
        """Write a file in one step: CSV, netCDF-4 or Parquet (needs pyarrow) by its suffix, every digit kept.

        Raises
        ------
        InputError
            If the suffix is not .csv, .nc or .parquet, or pyarrow is missing.
        """
        save(self, path)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a file of `save`.

        Raises
        ------
        InputError
            If the file is missing, not an indicial trajectory, or lacks a column.
        """
        return cls(**load(path))

    def summary(self) -> str:
        """What was flown, how far, how fast, within the models' range or not."""
        first, last = self.position[0], self.position[-1]
        who = self.provenance.get("vehicle", "trajectory")
        lines = [
            f"{who}: {len(self)} instants over {self.time[-1] - self.time[0]:.6g} s, "
            f"x {first[0]:.6g} to {last[0]:.6g} m, y {last[1]:.4g} m, altitude {-last[2]:.6g} m at the end",
            f"  Mach {self.mach[0]:.4g} to {self.mach[-1]:.4g}, total angle of attack up to "
            f"{math.degrees(np.max(self.total_angle)):.4g} deg, roll rate {self.rate[-1, 0]:.4g} rad/s at the end",
        ]
        made = self.provenance
        if "position_error_m" in made:
            march = (
                f"step {made['step_s']:.3g} s; error by halving it"
                if "step_s" in made
                else f"tolerance {made['tolerance']:.3g}; error by a hundredth of it"
            )
            lines.append(
                f"  {made['method']}, {march}: "
                f"position {made['position_error_m']:.2g} m, attitude {made['attitude_error_rad']:.2g} rad"
            )
        outside = int(np.count_nonzero(self.outside_range))
        if outside:
            when = self.time[np.argmax(self.outside_range)]
            lines.append(f"  OUTSIDE the models' stated range at {outside} instants, first at t = {when:.6g} s")
        return "\n".join(lines)

    def plot_path(self, bodies: int = 12) -> Figure:
        """The path in space, its shadow on the ground, and the body's axes at `bodies` instants."""
        return plot_path(self, bodies)

    def plot(self) -> Figure:
        """Angles against distance, alpha-beta motion in non-rolling axes, Mach number and swerve."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(2, 2, figsize=(10, 7), layout="constrained")
        x = self.position[:, 0]
        motion = math.degrees(1.0) * self.non_rolling_incidence
        axes[0, 0].plot(x, np.degrees(self.alpha), label="alpha")
        axes[0, 0].plot(x, np.degrees(self.beta), label="beta")
        axes[0, 0].plot(x, np.degrees(self.total_angle), color="0.6", label="total")
        axes[0, 0].set(xlabel="x [m]", ylabel="angle [deg]")
        axes[0, 0].legend()
        axes[0, 1].plot(motion.real, motion.imag)
        axes[0, 1].set(xlabel="beta, not rolling [deg]", ylabel="alpha, not rolling [deg]", aspect="equal")
        axes[0, 1].set_adjustable("datalim")
        axes[1, 0].plot(x, self.mach)
        axes[1, 0].set(xlabel="x [m]", ylabel="Mach number")
        axes[1, 1].plot(x, self.position[:, 1], label="y (right)")
        axes[1, 1].plot(x, self.position[:, 2], label="z (down)")
        axes[1, 1].set(xlabel="x [m]", ylabel="[m]")
        axes[1, 1].legend()
        return figure
