"""The face-based mesh that every solver of the package works on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal, Self, get_args

import numpy as np

from indicial.cfd.mesh.geometry import Array, FaceGeometry, Index, cell_geometry, face_geometry
from indicial.errors import InputError

if TYPE_CHECKING:
    from indicial.cfd.mesh.hexahedra import PatchSides
    from indicial.cfd.mesh.quality import MeshReport

PatchKind = Literal["wall", "no_slip_wall", "sting", "farfield", "outflow", "symmetry"]
PATCH_KINDS: tuple[PatchKind, ...] = get_args(PatchKind)
"""Loads count on walls only. A "sting" is a slip wall that is no part of the body: a support that stands for a wake."""


@dataclass(frozen=True)
class Patch:
    """A named part of the boundary: faces ``start`` to ``stop - 1`` of the mesh."""

    name: str
    kind: PatchKind
    start: int
    stop: int

    def __post_init__(self) -> None:
        if self.kind not in PATCH_KINDS:
            raise InputError(f"patch {self.name!r}: kind is {self.kind!r}, must be one of {', '.join(PATCH_KINDS)}")

    @property
    def faces(self) -> slice:
        """The patch's part of any array over faces."""
        return slice(self.start, self.stop)

    @property
    def size(self) -> int:
        """Number of faces."""
        return self.stop - self.start


@dataclass(frozen=True, eq=False)
class Mesh:
    """Polyhedral cells, described by their faces in the layout of OpenFOAM's polyMesh.

    Mesh axes: x aft, y right, z up, origin at the nose (leading edge). Interior faces come first, then the patches,
    each a contiguous run, in the order of `patches`. A face's nodes run anticlockwise seen from outside its owner.

    Parameters
    ----------
    points : (np, 3) array
        Nodes [m].
    face_offsets, face_points : (nf + 1,), (...) int arrays
        Face f has the nodes ``face_points[face_offsets[f]:face_offsets[f + 1]]``.
    owner : (nf,) int array
        Cell that the area vector points out of; smaller than the neighbour.
    neighbour : (n_interior,) int array
        Cell that it points into.
    patches : tuple of Patch
        They cover all boundary faces, without gaps.

    Raises
    ------
    InputError
        If the arrays do not fit each other.
    """

    points: Array
    face_offsets: Index
    face_points: Index
    owner: Index
    neighbour: Index
    patches: tuple[Patch, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", np.ascontiguousarray(self.points, dtype=np.float64))
        for name in ("face_offsets", "face_points", "owner", "neighbour"):
            object.__setattr__(self, name, np.ascontiguousarray(getattr(self, name), dtype=np.int64))
        object.__setattr__(self, "patches", tuple(self.patches))
        _check_layout(self)

    @property
    def n_points(self) -> int:
        """Number of nodes."""
        return int(self.points.shape[0])

    @property
    def n_faces(self) -> int:
        """Number of faces."""
        return int(self.owner.size)

    @property
    def n_interior(self) -> int:
        """Number of interior faces."""
        return int(self.neighbour.size)

    @cached_property
    def n_cells(self) -> int:
        """Number of cells."""
        return int(self.owner.max()) + 1

    @cached_property
    def _faces(self) -> FaceGeometry:
        return face_geometry(self.points, self.face_offsets, self.face_points)

    @cached_property
    def _cells(self) -> tuple[Array, Array]:
        return cell_geometry(self._faces, self.owner, self.neighbour, self.n_cells)

    @property
    def face_area(self) -> Array:
        """Area vectors [m^2], (nf, 3): from owner to neighbour, outward on patches."""
        return self._faces.area

    @property
    def face_centre(self) -> Array:
        """Face centroids [m], (nf, 3)."""
        return self._faces.centre

    @property
    def face_moment(self) -> Array:
        """``M_f = integral over the face of r x dA`` [m^3], (nf, 3), about the origin of the mesh axes."""
        return self._faces.moment

    @property
    def cell_volume(self) -> Array:
        """Cell volumes [m^3], (nc,)."""
        return self._cells[0]

    @property
    def cell_centre(self) -> Array:
        """Cell centroids [m], (nc, 3)."""
        return self._cells[1]

    def patch(self, name: str) -> Patch:
        """The patch of that name."""
        for patch in self.patches:
            if patch.name == name:
                return patch
        raise InputError(f"no patch {name!r} in the mesh, it has {', '.join(p.name for p in self.patches)}")

    def face_nodes(self, face: int) -> Index:
        """Node numbers of one face."""
        return self.face_points[self.face_offsets[face] : self.face_offsets[face + 1]]

    def scaled(self, factor: float) -> Self:
        """The same mesh with all lengths times `factor`."""
        if not factor > 0.0:
            raise InputError(f"mesh scale factor is {factor}, must be positive")
        return type(self)(
            self.points * factor, self.face_offsets, self.face_points, self.owner, self.neighbour, self.patches
        )

    @classmethod
    def from_hexahedra(cls, points: Array, cells: Index, patches: Sequence[PatchSides]) -> Mesh:
        """Mesh of hexahedra whose nodes may coincide; see `indicial.cfd.mesh.hexahedra.mesh_from_hexahedra`."""
        from indicial.cfd.mesh.hexahedra import mesh_from_hexahedra

        return mesh_from_hexahedra(points, cells, patches)

    def check(self) -> MeshReport:
        """Measure closure and quality; raises InputError if cells are inverted."""
        from indicial.cfd.mesh.quality import check_mesh

        return check_mesh(self)

    def save(self, path: str | Path) -> None:
        """Write the mesh to a compressed numpy archive (``.npz``)."""
        from indicial.cfd.mesh.storage import save_mesh

        save_mesh(self, path)

    @classmethod
    def load(cls, path: str | Path) -> Mesh:
        """Read what `save` wrote."""
        from indicial.cfd.mesh.storage import load_mesh

        return load_mesh(path)

    def to_polymesh(self, folder: str | Path) -> None:
        """Write OpenFOAM's ``polyMesh`` files into `folder`."""
        from indicial.cfd.mesh.polymesh import write_polymesh

        write_polymesh(self, folder)


def _check_layout(mesh: Mesh) -> None:
    """Raise InputError unless offsets, owners, neighbours and patches fit together."""
    nf, ni = mesh.owner.size, mesh.neighbour.size
    if mesh.points.ndim != 2 or mesh.points.shape[1] != 3:
        raise InputError(f"mesh points have shape {mesh.points.shape}, must be (n, 3)")
    if mesh.face_offsets.size != nf + 1 or mesh.face_offsets[0] != 0 or mesh.face_offsets[-1] != mesh.face_points.size:
        raise InputError(f"face_offsets must run from 0 to {mesh.face_points.size} in {nf + 1} entries")
    if np.any(np.diff(mesh.face_offsets) < 3):
        raise InputError("a face has fewer than 3 nodes")
    if ni > nf or np.any(mesh.owner[:ni] >= mesh.neighbour):
        raise InputError("every interior face must have owner < neighbour")
    edges = [ni, *(patch.stop for patch in mesh.patches)]
    if [patch.start for patch in mesh.patches] != edges[:-1] or edges[-1] != nf:
        raise InputError(f"patches must cover the boundary faces {ni} to {nf} contiguously and in order")
    if len({patch.name for patch in mesh.patches}) != len(mesh.patches):
        raise InputError("two patches have the same name")
