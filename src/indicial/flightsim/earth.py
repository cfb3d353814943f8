"""The ground under the flight: which way is down, how hard it pulls, how fast it turns, how high the vehicle is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array
from indicial.errors import InputError


class Earth(Protocol):
    """Gravity, rotation and altitude in earth axes: fixed to the ground, x downrange, y right, z down at the origin."""

    @property
    def rotation(self) -> Array:
        """Angular velocity of earth axes [rad/s], in earth axes, shape (3,)."""
        ...

    def gravity(self, position: Any) -> Any:
        """Acceleration of a body let go at rest on the earth [m/s^2], earth axes, casadi expression of shape (3, 1).

        Gravitation and, where the earth turns, its centrifugal acceleration: what a plumb line shows.
        """
        ...

    def altitude(self, position: Any) -> Any:
        """Geometric altitude [m], a casadi expression."""
        ...


@dataclass(frozen=True)
class FlatEarth:
    """Flat and not rotating: earth axes x downrange (north), y right (east), z down; altitude is -z.

    Parameters
    ----------
    g : float
        [m/s^2], constant; 0 for straight flight.
    """

    g: float = 9.80665

    def __post_init__(self) -> None:
        if not math.isfinite(self.g):
            raise InputError(f"gravity is {self.g} m/s^2, must be finite")

    @property
    def rotation(self) -> Array:
        """None."""
        return np.zeros(3)

    def gravity(self, position: Any) -> Any:
        """(0, 0, g)."""
        del position
        return ca.SX([0.0, 0.0, self.g])

    def altitude(self, position: Any) -> Any:
        """``-z``."""
        return -position[2]


_EQUATORIAL_RADIUS = 6378137.0
_FLATTENING = 1.0 / 298.257223563
_POLAR_RADIUS = _EQUATORIAL_RADIUS * (1.0 - _FLATTENING)
_ECCENTRICITY2 = _FLATTENING * (2.0 - _FLATTENING)
_SECOND_ECCENTRICITY2 = _ECCENTRICITY2 / (1.0 - _ECCENTRICITY2)
_AXIS_ROOM = 1e-12  # m^2; keeps slopes finite on the axis of rotation


@dataclass(frozen=True)
class WGS84:
    r"""The rotating ellipsoid of the World Geodetic System 1984, with the gravity of its mass and oblateness J2.

    Earth axes stand on a site and turn with the ground: x along `azimuth`, z down along the ellipsoid's normal.
    Gravitation with r from the centre and Z along the axis of rotation,

    ``g = -mu/r^3 [ (1 + (3/2) J2 (a/r)^2 (1 - 5 (Z/r)^2)) (X, Y, Z) + 3 J2 (a/r)^2 (0, 0, Z) ]``,

    and the centrifugal acceleration ``omega^2 (X, Y, 0)``. Source: NIMA TR8350.2 (2000); Vallado, Fundamentals of
    Astrodynamics, sec. 8.6.

    Parameters
    ----------
    latitude, longitude : float
        Geodetic, of the site [rad].
    altitude_of_site : float
        Above the ellipsoid [m].
    azimuth : float
        Of the x axis, from north to east [rad].
    rate : float
        Angular velocity [rad/s]; 0 for an earth that stands still.
    mu, j2 : float
        Gravitational parameter [m^3/s^2] and oblateness.
    """

    latitude: float = 0.0
    longitude: float = 0.0
    altitude_of_site: float = 0.0
    azimuth: float = 0.0
    rate: float = 7.292115e-5
    mu: float = 3.986004418e14
    j2: float = 1.082626684e-3

    def __post_init__(self) -> None:
        for name in ("latitude", "longitude", "altitude_of_site", "azimuth", "rate", "mu", "j2"):
            if not math.isfinite(getattr(self, name)):
                raise InputError(f"{name} is {getattr(self, name)}, must be finite")
        if abs(self.latitude) > math.pi / 2.0:
            raise InputError(f"latitude is {self.latitude} rad, must be within -pi/2 to pi/2")

    @cached_property
    def axes(self) -> Array:
        """Rotation matrix earth axes -> axes of the centre (x through Greenwich, z north), shape (3, 3)."""
        down = _north_east_down(self.latitude, self.longitude)
        c, s = math.cos(self.azimuth), math.sin(self.azimuth)
        turned: Array = down @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return turned

    @cached_property
    def origin(self) -> Array:
        """The site, from the centre [m], shape (3,)."""
        return _from_geodetic(self.latitude, self.longitude, self.altitude_of_site)

    @property
    def rotation(self) -> Array:
        """``rate`` about the axis, in earth axes [rad/s]."""
        turning: Array = self.axes.T @ np.array([0.0, 0.0, self.rate])
        return turning

    def gravity(self, position: Any) -> Any:
        """Gravitation and centrifugal acceleration."""
        r = self._from_centre(position)
        distance2 = ca.sumsqr(r)
        oblate = 1.5 * self.j2 * _EQUATORIAL_RADIUS**2 / distance2
        pull = -self.mu / (distance2 * ca.sqrt(distance2))
        along = 1.0 + oblate * (1.0 - 5.0 * r[2] * r[2] / distance2)
        swing = self.rate**2
        total = ca.vertcat(
            (pull * along + swing) * r[0], (pull * along + swing) * r[1], pull * (along + 2.0 * oblate) * r[2]
        )
        return ca.mtimes(ca.sparsify(ca.DM(self.axes.T)), total)

    def altitude(self, position: Any) -> Any:
        """Above the ellipsoid, by Bowring's latitude: to 1e-8 m up to 100 km, and no branch."""
        r = self._from_centre(position)
        across = ca.sqrt(r[0] * r[0] + r[1] * r[1] + _AXIS_ROOM)
        sine, cosine = _bowring(across, r[2])
        return across * cosine + r[2] * sine - _EQUATORIAL_RADIUS * ca.sqrt(1.0 - _ECCENTRICITY2 * sine * sine)

    def position(self, latitude: float, longitude: float, altitude: float) -> Array:
        """Of a place [rad, rad, m], in earth axes [m], shape (3,)."""
        place: Array = self.axes.T @ (_from_geodetic(latitude, longitude, altitude) - self.origin)
        return place

    def geodetic(self, position: ArrayLike) -> tuple[Array, Array, Array]:
        """Latitude, longitude [rad] and altitude [m] of positions ``(..., 3)``."""
        places = np.asarray(position, dtype=float) @ self.axes.T + self.origin
        x, y, z = np.moveaxis(places, -1, 0)
        across = np.hypot(x, y)
        latitude = np.arctan2(z, across * (1.0 - _ECCENTRICITY2))
        for _ in range(5):
            normal = _EQUATORIAL_RADIUS / np.sqrt(1.0 - _ECCENTRICITY2 * np.sin(latitude) ** 2)
            latitude = np.arctan2(z + _ECCENTRICITY2 * normal * np.sin(latitude), across)
        flat = _EQUATORIAL_RADIUS * np.sqrt(1.0 - _ECCENTRICITY2 * np.sin(latitude) ** 2)
        return latitude, np.arctan2(y, x), across * np.cos(latitude) + z * np.sin(latitude) - flat

    def local_axes(self, position: ArrayLike) -> Array:
        """Rotation matrices from north, east, down at positions ``(..., 3)`` to earth axes, shape (..., 3, 3)."""
        latitude, longitude, _ = self.geodetic(position)
        turned: Array = self.axes.T @ _north_east_down(latitude, longitude)
        return turned

    def _from_centre(self, position: Any) -> Any:
        return ca.mtimes(ca.sparsify(ca.DM(self.axes)), position) + ca.DM(self.origin)


def _bowring(across: Any, z: Any) -> tuple[Any, Any]:
    """Sine and cosine of the geodetic latitude. Source: Bowring, Survey Review 23 (1976) 323, iterated once."""
    sine, cosine = _direction(z, (1.0 - _FLATTENING) * across)
    for _ in range(2):
        high = z + _SECOND_ECCENTRICITY2 * _POLAR_RADIUS * sine**3
        out = across - _ECCENTRICITY2 * _EQUATORIAL_RADIUS * cosine**3
        latitude = _direction(high, out)
        sine, cosine = _direction((1.0 - _FLATTENING) * latitude[0], latitude[1])
    return latitude


def _direction(opposite: Any, adjacent: Any) -> tuple[Any, Any]:
    length = ca.sqrt(opposite * opposite + adjacent * adjacent)
    return opposite / length, adjacent / length


def _from_geodetic(latitude: float, longitude: float, altitude: float) -> Array:
    sine, cosine = math.sin(latitude), math.cos(latitude)
    normal = _EQUATORIAL_RADIUS / math.sqrt(1.0 - _ECCENTRICITY2 * sine * sine)
    across = (normal + altitude) * cosine
    return np.array(
        [
            across * math.cos(longitude),
            across * math.sin(longitude),
            ((1.0 - _ECCENTRICITY2) * normal + altitude) * sine,
        ]
    )


def _north_east_down(latitude: ArrayLike, longitude: ArrayLike) -> Array:
    """Rotation matrices from north, east, down to axes of the centre, shape (..., 3, 3)."""
    phi, lam = np.broadcast_arrays(np.asarray(latitude, dtype=float), np.asarray(longitude, dtype=float))
    sp, cp, sl, cl, zero = np.sin(phi), np.cos(phi), np.sin(lam), np.cos(lam), np.zeros_like(phi)
    north, east, down = (-sp * cl, -sp * sl, cp), (-sl, cl, zero), (-cp * cl, -cp * sl, -sp)
    return np.stack([np.stack(column, axis=-1) for column in (north, east, down)], axis=-1)
