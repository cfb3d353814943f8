r"""What instruments on board give of a simulated flight: rates, accelerations, air data, attitude and position.

A sensor at time t gives, of the true value y,

    z = quantised( scale y(t - delay) + bias + white + coloured )
    coloured: c_k+1 = rho c_k + sigma sqrt(1 - rho^2) w_k

with ``rho = exp(-1/(rate correlation_time))``, so that the coloured part has variance sigma^2 and the autocorrelation
``exp(-lag/correlation_time)`` (Gauss-Markov, of first order). With r the place of the sensor from the centre of
gravity, accelerometers feel ``F/m + omegadot x r + omega x (omega x r)`` and vanes the wind of ``v + omega x r``
(Klein & Morelli, "Aircraft System Identification" (2006), sec. 10.2).
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array, flow_angles
from indicial.errors import InputError
from indicial.flightsim import Earth, FlatEarth, Signal, Trajectory, Vehicle
from indicial.flightsim.attitude import matrix_from_quaternion
from indicial.flightsim.expressions import is_number
from indicial.flightsim.turbulence import DrydenTurbulence
from indicial.identification.record import FlightRecord, check_channel

Triple = tuple[float, float, float]


@dataclass(frozen=True)
class Sensor:
    """How one channel is measured; lengths of time in s, the rest in the channel's unit.

    Parameters
    ----------
    rate : float
        Samples a second [Hz].
    white, coloured : float
        Standard deviations of white noise and of first-order coloured noise.
    correlation_time : float
        Of the coloured noise [s].
    bias, scale, delay : float
    dropout : float
        Probability that a dropout starts at a sample.
    burst : float
        Mean length of dropouts [samples], geometrically distributed.
    resolution : float
        Step of the last digit; 0 for none.
    """

    rate: float
    white: float = 0.0
    coloured: float = 0.0
    correlation_time: float = 0.1
    bias: float = 0.0
    scale: float = 1.0
    delay: float = 0.0
    dropout: float = 0.0
    burst: float = 1.0
    resolution: float = 0.0

    def __post_init__(self) -> None:
        values = asdict(self)
        for name, value in values.items():
            if not math.isfinite(value) or (value < 0.0 and name not in ("bias", "scale")):
                raise InputError(f"{name} of a sensor is {value}, must be finite and not negative")
        for name in ("rate", "correlation_time", "scale"):
            if values[name] == 0.0:
                raise InputError(f"{name} of a sensor must not be 0")
        if self.dropout >= 1.0 or self.burst < 1.0:
            raise InputError(f"a sensor needs dropout below 1 and burst of 1 or more, not {self.dropout}, {self.burst}")

    @property
    def standard_deviation(self) -> float:
        """Of white and coloured noise together."""
        return math.hypot(self.white, self.coloured)

    def read(self, exact: Array, stream: np.random.SeedSequence | None) -> Array:
        """Readings of true values at its own samples (already delayed), shape (n,); no noise without a stream."""
        values = self.scale * exact + self.bias
        lost = np.zeros(exact.shape, dtype=bool)
        if stream is not None:
            white, coloured, dropouts = (np.random.default_rng(s) for s in stream.spawn(3))
            values = values + self.white * white.standard_normal(exact.size)
            values += self.coloured * gauss_markov(exact.size, 1.0 / (self.rate * self.correlation_time), coloured)
            starts = np.flatnonzero(dropouts.random(exact.size) < self.dropout)
            ends = np.minimum(starts + dropouts.geometric(1.0 / self.burst, starts.size), exact.size)
            change = np.bincount(starts, minlength=exact.size + 1) - np.bincount(ends, minlength=exact.size + 1)
            lost = np.cumsum(change)[:-1] > 0
        if self.resolution > 0.0:
            values = self.resolution * np.round(values / self.resolution)
        return np.where(lost, np.nan, values)


@dataclass(frozen=True)
class Installation:
    """Where instruments are, body axes from the centre of gravity [m], and what the body does to the vanes.

    Parameters
    ----------
    accelerometers, vanes : tuple of float
        (x forward, y right, z down).
    upwash, sidewash : float
        What the vanes show of the angle of attack and of sideslip at their place.
    """

    accelerometers: Triple = (0.0, 0.0, 0.0)
    vanes: Triple = (0.0, 0.0, 0.0)
    upwash: float = 1.0
    sidewash: float = 1.0


def measure_flight(
    trajectory: Trajectory,
    vehicle: Vehicle,
    sensors: Mapping[str, Sensor],
    *,
    seed: int | None,
    inputs: Mapping[str, Signal] | None = None,
    installation: Installation | None = None,
    turbulence: DrydenTurbulence | None = None,
    thrust: ArrayLike = 0.0,
    earth: Earth | None = None,
) -> FlightRecord:
    """What instruments give of a simulated flight.

    Away from the centre of gravity, ``ax ay az`` and ``V alpha beta`` are those at the instruments: the record's
    provenance says where. Each channel has random streams of its own, so another channel changes nothing in them.

    Parameters
    ----------
    trajectory : Trajectory
        Sampled finely enough for cubic splines.
    vehicle : Vehicle
        With mass and inertia in numbers.
    sensors : mapping of str to Sensor
        By channel of `CHANNEL_UNITS`. The record runs at the highest rate, of which the others must be whole parts.
    seed : int or None
        Of noise and dropouts; None for neither. Bias, scale, delay and resolution remain.
    inputs : mapping of str to Signal, optional
        Controls, recorded without error.
    installation : Installation, optional
        At the centre of gravity if not given.
    turbulence : DrydenTurbulence, optional
        Seen by the air data only, besides the wind of the flight: the vehicle does not answer to it.
    thrust : array_like
        Force along the body's x axis through the centre of gravity, besides the aerodynamic one [N], scalar or (n,).
    earth : Earth, optional
        On which it was flown, for altitude; flat if not given.

    Raises
    ------
    InputError
        If a channel is not known, rates do not divide the highest, the vehicle is not in numbers, or the flight is too
        short.
    """
    from scipy.interpolate import CubicSpline

    if not sensors:
        raise InputError("a flight is measured by at least one sensor")
    highest = max(sensor.rate for sensor in sensors.values())
    number = math.floor((trajectory.time[-1] - trajectory.time[0]) * highest * (1.0 + 1e-12)) + 1
    if len(trajectory) < 2 or number < 2:
        raise InputError(f"the flight is too short for {highest:g} Hz")
    time = np.minimum(trajectory.time[0] + np.arange(number) / highest, trajectory.time[-1])
    place = Installation() if installation is None else installation
    exact = exact_channels(trajectory, vehicle, place, turbulence, thrust, earth)
    channels: dict[str, Array] = {}
    for name, sensor in sensors.items():
        check_channel(name)
        every = highest / sensor.rate
        if abs(every - round(every)) > 1e-9 * every:
            raise InputError(f"rate of {name}, {sensor.rate:g} Hz, is no whole part of the highest, {highest:g} Hz")
        samples = slice(None, None, round(every))
        seen = time[samples] - sensor.delay
        begun = seen >= trajectory.time[0] - 1e-12 * np.abs(seen)
        key = (zlib.crc32(name.encode()),)
        stream = None if seed is None else np.random.SeedSequence(seed, spawn_key=key)
        reading = sensor.read(CubicSpline(trajectory.time, exact[name])(seen), stream)
        channels[name] = np.full(time.size, np.nan)
        channels[name][samples] = np.where(begun, reading, np.nan)
    controls = {name: signal.at(time) for name, signal in (inputs or {}).items()}
    deviations = {name: s.standard_deviation for name, s in sensors.items() if s.standard_deviation > 0.0}
    provenance = {"simulated": True, "seed": seed, "vehicle": vehicle.name, "installation": asdict(place)}
    return FlightRecord(time, channels, controls, deviations, provenance)


def exact_channels(
    trajectory: Trajectory,
    vehicle: Vehicle,
    installation: Installation,
    turbulence: DrydenTurbulence | None = None,
    thrust: ArrayLike = 0.0,
    earth: Earth | None = None,
) -> dict[str, Array]:
    """True values of every channel at the instants of a trajectory; arguments as `measure_flight`."""
    if not (is_number(vehicle.mass) and isinstance(vehicle.inertia, np.ndarray)):
        raise InputError(f"instruments need mass and inertia of {vehicle.name} in numbers")
    force = trajectory.force.copy()
    force[:, 0] += np.asarray(thrust, dtype=float)
    omega = trajectory.rate
    moment = trajectory.moment - np.cross(omega, omega @ vehicle.inertia)
    turning = np.linalg.solve(vehicle.inertia, moment.T).T
    arm = np.array(installation.accelerometers)
    felt = force / vehicle.mass + np.cross(turning, arm) + np.cross(omega, np.cross(omega, arm))
    air = trajectory.air_velocity + np.cross(omega, np.array(installation.vanes))
    if turbulence is not None:
        air = air - _gusts(trajectory, turbulence)
    speed, alpha, beta = flow_angles(air)
    yaw, pitch, roll = np.unwrap(trajectory.euler, axis=0).T
    channels = dict(zip("xyz", trajectory.position.T, strict=True))
    channels["altitude"] = _altitude(trajectory.position, FlatEarth() if earth is None else earth)
    channels |= {"V": speed, "alpha": installation.upwash * alpha, "beta": installation.sidewash * beta}
    channels |= {"mach": speed / trajectory.speed_of_sound, "dynamic_pressure": 0.5 * trajectory.density * speed**2}
    channels |= dict(zip(("p", "q", "r"), omega.T, strict=True))
    channels |= dict(zip(("pdot", "qdot", "rdot"), turning.T, strict=True))
    channels |= dict(zip(("ax", "ay", "az"), felt.T, strict=True))
    return channels | {"phi": roll, "theta": pitch, "psi": yaw}


def _altitude(position: Array, earth: Earth) -> Array:
    """Geometric altitude [m] of positions (n, 3), shape (n,)."""
    place = ca.SX.sym("place", 3)
    altitude = ca.Function("altitude", [place], [earth.altitude(place)])
    found: Array = np.array(altitude(position.T)).ravel()
    return found


def gauss_markov(number: int, step: float, random: np.random.Generator) -> Array:
    """First-order coloured noise of variance 1, stationary, with autocorrelation ``exp(-k step)`` at lag k, (n,)."""
    from scipy.signal import lfilter

    neighbours = math.exp(-step)
    drive = random.standard_normal(number)
    drive[1:] *= math.sqrt(-math.expm1(-2.0 * step))
    noise: Array = lfilter([1.0], [1.0, -neighbours], drive)
    return noise


def _gusts(trajectory: Trajectory, turbulence: DrydenTurbulence) -> Array:
    """Velocity of the air, body axes [m/s], shape (n, 3)."""
    c, s = math.cos(turbulence.heading), math.sin(turbulence.heading)
    x, y, _ = trajectory.position.T
    along, across, down = replace(turbulence, span=None).components(c * x + s * y)[:, :3].T
    earth = np.stack([c * along - s * across, s * along + c * across, down], axis=1)
    turned: Array = np.einsum("nij,ni->nj", matrix_from_quaternion(trajectory.quaternion), earth)
    return turned
