"""A body as a lit solid: faces that look at the viewer, coloured by a quantity, far ones painted first."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LIGHT = (-0.25, 0.35, 0.9)
"""Direction towards the light, by the picture's axes: right, up, to the viewer."""

AMBIENT = 0.7
"""Brightness of a face that the light does not reach."""


@dataclass(frozen=True)
class View:
    """Where a solid is seen from, without perspective; angles [rad].

    Parameters
    ----------
    azimuth : float
        0 from the right (nose to the left of the picture needs y < 0: pi), positive towards the tail.
    elevation : float
        Above the x-y plane.
    """

    azimuth: float
    elevation: float

    @property
    def axes(self) -> Array:
        """Picture's right, up and the direction to the viewer, rows of a rotation, shape (3, 3)."""
        flat = math.cos(self.elevation)
        towards = np.array([math.sin(self.azimuth) * flat, -math.cos(self.azimuth) * flat, math.sin(self.elevation)])
        right = np.array([math.cos(self.azimuth), math.sin(self.azimuth), 0.0])
        return np.stack([right, np.cross(towards, right), towards])


def whole(corners: Array) -> Array:
    """A half (y >= 0) and its mirror image with the same sense of rotation, shape (2 n, 4, 3)."""
    return np.concatenate([corners, corners[:, ::-1] * [1.0, -1.0, 1.0]])


def normals(corners: Array) -> Array:
    """Unit normals of quadrilaterals by their diagonals, shape (n, 3); right-handed about the order of the corners."""
    across = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    return np.asarray(across / np.linalg.norm(across, axis=1, keepdims=True))


def draw_solid(axes: Axes, corners: Array, colours: NDArray[np.float64], view: View) -> None:
    """Paint a solid.

    Parameters
    ----------
    corners : ndarray
        Of its faces, outside on the right of the way round them, shape (n, 4, 3).
    colours : ndarray
        RGBA of the faces, shape (n, 4).
    """
    from matplotlib.collections import PolyCollection

    turned = corners @ view.axes.T
    outward = -normals(turned)
    seen = np.flatnonzero(outward[:, 2] > 0.0)
    seen = seen[np.argsort(turned[seen, :, 2].mean(axis=1))]
    light = np.asarray(LIGHT) / np.linalg.norm(LIGHT)
    brightness = AMBIENT + (1.0 - AMBIENT) * np.clip(outward[seen] @ light, 0.0, 1.0)
    painted = colours[seen].copy()
    painted[:, :3] *= brightness[:, None]
    faces = PolyCollection(list(turned[seen, :, :2]), facecolors=painted, edgecolors=painted, linewidths=0.3)
    faces.set_rasterized(True)
    axes.add_collection(faces)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.axis("off")
