"""The flow about half a body in a steady pitch rate, as much of it as pictures need."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from indicial.cfd.field import FlowField
from indicial.cfd.mesh import Mesh
from indicial.conventions import Array, mesh_from_body
from indicial.errors import InputError
from indicial.files import atomic_path

SCHEMA_VERSION = 1

WINDOW = ((-2.5, 13.0), (-5.5, 5.5))
"""x and z [calibres] between which faces of the symmetry plane are kept; meshes with a sting reach far beyond."""

Indices = NDArray[np.int32]


def write_arrays(path: Path, arrays: dict[str, Any]) -> None:
    """Write a compressed numpy archive of this schema in one step."""
    with atomic_path(path) as temporary, temporary.open("wb") as stream:
        np.savez_compressed(stream, schema_version=SCHEMA_VERSION, **arrays)


@contextmanager
def stored_arrays(path: Path, what: str) -> Iterator[Any]:
    """Arrays of an archive of this schema, to make `what` of.

    Raises
    ------
    InputError
        If it is something else, or of another version.
    """
    try:
        with np.load(path, allow_pickle=False) as stored:
            if int(stored["schema_version"]) != SCHEMA_VERSION:
                raise ValueError(f"schema_version must be {SCHEMA_VERSION}")
            yield stored
    except (OSError, EOFError, ValueError, KeyError, BadZipFile) as error:
        raise InputError(f"{path}: not {what} ({error})") from error


@dataclass(frozen=True)
class Patch:
    """Quadrilaterals in space with values on them.

    Parameters
    ----------
    points : ndarray
        Corners [calibres], mesh axes (x aft from the nose, y to the right, z up), shape (n, 3).
    quads : ndarray
        Indices of the corners of each face, in order round it, shape (m, 4).
    values : dict
        Values on the faces by name, shape (m,) each.
    """

    points: Array
    quads: Indices
    values: dict[str, Array]

    @classmethod
    def of(cls, mesh: Mesh, faces: NDArray[Any], diameter: float, values: dict[str, Array]) -> Self:
        """Faces of a mesh with their own numbering of points; a triangle repeats its last corner."""
        nodes = []
        for face in faces:
            corners = np.asarray(mesh.face_nodes(int(face)))
            nodes.append(np.concatenate([corners, corners[-1:].repeat(4 - len(corners))]))
        used, quads = np.unique(np.array(nodes), return_inverse=True)
        return cls(mesh.points[used] / diameter, quads.reshape(-1, 4).astype(np.int32), values)

    def to_arrays(self, name: str) -> dict[str, Any]:
        """In single precision, under names that begin with `name`."""
        arrays: dict[str, Any] = {f"{name}_points": self.points.astype(np.float32)}
        arrays[f"{name}_quads"] = self.quads.astype(np.uint16 if len(self.points) < 2**16 else np.int32)
        return arrays | {f"{name}_{key}": values.astype(np.float32) for key, values in self.values.items()}

    @classmethod
    def from_arrays(cls, stored: Any, name: str, keys: Sequence[str]) -> Self:
        """Inverse of `to_arrays`, of those values that `keys` name."""
        values = {key: stored[f"{name}_{key}"].astype(float) for key in keys}
        return cls(stored[f"{name}_points"].astype(float), stored[f"{name}_quads"].astype(np.int32), values)

    @property
    def corners(self) -> Array:
        """Corners of the faces, shape (m, 4, 3)."""
        return self.points[self.quads]

    def at_points(self, name: str) -> Array:
        """Mean of the values on the faces round each point, shape (n,)."""
        count = np.bincount(self.quads.ravel(), minlength=len(self.points))
        total = np.bincount(self.quads.ravel(), np.repeat(self.values[name], 4), minlength=len(self.points))
        return np.asarray(total / count)

    def triangles(self) -> Indices:
        """Each quadrilateral as two triangles, shape (2 m, 3)."""
        return np.concatenate([self.quads[:, [0, 1, 2]], self.quads[:, [0, 2, 3]]])


@dataclass(frozen=True)
class PitchingFlow:
    """Pressure on the walls, and pressure and Mach number in the symmetry plane.

    Parameters
    ----------
    wall : Patch
        With ``cp``.
    plane : Patch
        With ``cp`` and ``mach`` of the cells behind its faces, the latter relative to the centre of rotation. Relative
        to the body that turns, even undisturbed air has a Mach number that changes with the place, and hides shocks.
    mach, alpha, q : float
        Of the flight; alpha [rad], q d/2V.
    """

    wall: Patch
    plane: Patch
    mach: float
    alpha: float
    q: float

    @classmethod
    def of(cls, field: FlowField, diameter: float, q: float) -> Self:
        """From a field on half a body; `diameter` is the calibre [m]."""
        mesh, condition = field.mesh, field.condition
        plane = np.arange(mesh.n_faces)[mesh.patch("symmetry").faces]
        centre = np.array([mesh.points[mesh.face_nodes(int(face))].mean(axis=0) for face in plane]) / diameter
        (left, right), (below, above) = WINDOW
        x, z = centre[:, 0], centre[:, 2]
        plane = plane[(x > left) & (x < right) & (z > below) & (z < above)]
        cells = mesh.owner[plane]
        relative = field.velocity[cells] - mesh_from_body(condition.velocity) / condition.speed_of_sound
        speed = np.linalg.norm(relative, axis=1) / np.sqrt(field.pressure[cells] / field.density[cells])
        return cls(
            Patch.of(mesh, field.wall_faces, diameter, {"cp": field.wall_cp}),
            Patch.of(mesh, plane, diameter, {"cp": field.cp[cells], "mach": speed}),
            condition.mach,
            condition.alpha,
            q,
        )

    def save(self, path: Path) -> None:
        """Write a compressed numpy archive in one step, in single precision."""
        arrays: dict[str, Any] = {"flight": np.array([self.mach, self.alpha, self.q])}
        for name, patch in (("wall", self.wall), ("plane", self.plane)):
            arrays |= patch.to_arrays(name)
        write_arrays(path, arrays)

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read what `save` wrote.

        Raises
        ------
        InputError
            If it is something else, or of another version.
        """
        with stored_arrays(path, "a flow in steady pitch") as stored:
            wall = Patch.from_arrays(stored, "wall", ("cp",))
            plane = Patch.from_arrays(stored, "plane", ("cp", "mach"))
            mach, alpha, q = stored["flight"].tolist()
            return cls(wall, plane, mach, alpha, q)
