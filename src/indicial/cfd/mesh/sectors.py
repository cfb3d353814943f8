"""The azimuthal sectors that fins and symmetry planes cut a body mesh into."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from indicial.cfd.shapes.fins import FinSet
from indicial.errors import InputError

Extent = Literal["full", "half", "quarter"]

_RANGE: dict[Extent, tuple[float, float]] = {
    "half": (-0.5 * np.pi, 0.5 * np.pi),
    "quarter": (0.0, 0.5 * np.pi),
}


@dataclass(frozen=True)
class Sector:
    """Azimuths from `start` to `end` [rad]; `start_fin` and `end_fin` number the fins that bound it, if any."""

    start: float
    end: float
    start_fin: int | None
    end_fin: int | None


def split_into_sectors(fins: FinSet | None, extent: Extent) -> list[Sector]:
    """Sectors of the mesh, in the order of their azimuth.

    "half" is y >= 0 (azimuth -90 to 90 degrees from the y axis), "quarter" y, z >= 0.

    Raises
    ------
    InputError
        If the extent is unknown, a fin lies in a symmetry plane, or the fins are not mirror images of one another.
    """
    if extent not in get_args(Extent):
        raise InputError(f"sector is {extent!r}, must be one of {', '.join(get_args(Extent))}")
    angles = np.array([]) if fins is None else fins.angles
    if extent == "full":
        return _full_circle(angles)
    _check_mirrored(angles, extent)
    start, end = _RANGE[extent]
    wrapped = (angles + np.pi) % (2.0 * np.pi) - np.pi
    inside = [int(i) for i in np.argsort(wrapped) if start < wrapped[i] < end]
    edges = [start, *(float(wrapped[i]) for i in inside), end]
    owners = [None, *inside, None]
    return [Sector(edges[i], edges[i + 1], owners[i], owners[i + 1]) for i in range(len(edges) - 1)]


def _full_circle(angles: np.ndarray) -> list[Sector]:
    if angles.size == 0:
        return [Sector(0.0, 2.0 * np.pi, None, None)]
    order = [int(i) for i in np.argsort(angles)]
    following = [*order[1:], order[0]]
    ends = [float(angles[i]) for i in order[1:]] + [float(angles[order[0]]) + 2.0 * np.pi]
    return [Sector(float(angles[a]), end, a, b) for a, b, end in zip(order, following, ends, strict=True)]


def _check_mirrored(angles: np.ndarray, extent: Extent) -> None:
    """Raise InputError unless every fin has its image in each symmetry plane, off the plane."""
    images = [(np.array([-1.0, 1.0]), "y = 0")] + ([(np.array([1.0, -1.0]), "z = 0")] if extent == "quarter" else [])
    direction = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    for turn, plane in images:
        if np.any(np.linalg.norm(direction * turn - direction, axis=-1) < 1e-6):
            raise InputError(f"a fin lies in the symmetry plane {plane}: change roll_deg or take sector='full'")
        distance = np.linalg.norm(direction[:, None] * turn - direction[None], axis=-1)
        if angles.size and np.any(distance.min(axis=1) > 1e-6):
            raise InputError(f"the fins are not symmetric about {plane}: change roll_deg or take sector='full'")
