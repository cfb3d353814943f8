"""A mesh made ready for the flow kernels: lengths in reference lengths, tables from cells to faces."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from indicial.cfd.flow.reconstruction import least_squares_weights
from indicial.cfd.mesh import Mesh
from indicial.conventions import Array, Index, ReferenceQuantities
from indicial.errors import InputError

SLIP_WALL, FARFIELD, OUTFLOW, SYMMETRY = range(4)
MOST_SKEWED = 1.0
"""Distance of a face's centre off the line of its cells' centres, over their distance, beyond which both cells carry
no gradient: their scheme is of first order. Only the slivers round a sharp nose tip are so skewed."""

BLOCK = 32
"""Faces that go through the flux kernel together: whole vector registers, and their cells fit the first cache."""

MIRROR = -2
"""Stands for a neighbour in the cell-to-face table: the cell's own mirror image behind a symmetry plane."""

KINDS = {"wall": SLIP_WALL, "sting": SLIP_WALL, "farfield": FARFIELD, "outflow": OUTFLOW, "symmetry": SYMMETRY}


@dataclass(frozen=True)
class Grid:
    """What the kernels read. Lengths are in reference lengths, the origin is the moment reference point.

    Parameters
    ----------
    owner, neighbour : ndarray
        Cells of the faces (nf,), (ni,); interior faces come first.
    kind : ndarray
        Boundary kind of each face behind the interior ones (nf - ni,).
    normal, area, moment : ndarray
        Unit normals (nf, 3), areas (nf,), ``M_f = integral of r x dA`` (nf, 3).
    to_owner, to_neighbour : ndarray
        Face centre less the cell centre (nf, 3), (ni, 3).
    volume : ndarray
        (nc,).
    offsets, faces, signs, cells, weights : ndarray
        Cell-to-face table in rows: face, +1 where the cell owns it else -1, neighbour cell, MIRROR for the cell's own
        image behind a symmetry plane or -1, and the least-squares weight of that neighbour.
    softening : ndarray
        The limiter's eps of each face that has a neighbour or an image behind it, else 0 (nf,).
    wall_faces : ndarray
        Faces whose loads count.
    """

    owner: Index
    neighbour: Index
    kind: NDArray[np.int8]
    normal: Array
    area: Array
    moment: Array
    to_owner: Array
    to_neighbour: Array
    volume: Array
    offsets: Index
    faces: Index
    signs: NDArray[np.int8]
    cells: Index
    weights: Array
    softening: Array
    wall_faces: Index

    @property
    def n_cells(self) -> int:
        """Number of cells."""
        return len(self.volume)

    @property
    def n_interior(self) -> int:
        """Number of interior faces."""
        return len(self.neighbour)

    @cached_property
    def blocks(self) -> Array:
        """Geometry of the interior faces in blocks, a face to a column (blocks, 14, BLOCK).

        Rows: normal, area, moment, to_owner, to_neighbour, softening. The last block is filled up with ones.
        """
        ni = self.n_interior
        rows = (self.normal, self.area, self.moment, self.to_owner, self.to_neighbour, self.softening)
        count = -(-ni // BLOCK)
        table = np.ones((count * BLOCK, 14))
        table[:ni] = np.column_stack([row[:ni] for row in rows])
        return np.ascontiguousarray(table.reshape(count, BLOCK, 14).transpose(0, 2, 1))

    @cached_property
    def twins(self) -> Index:
        """Where the cell-to-face table holds the same face in the neighbour's row, -1 for boundary faces (entries,)."""
        paired = np.flatnonzero(self.cells >= 0)
        order = paired[np.argsort(self.faces[paired], kind="stable")]
        out = np.full(len(self.faces), -1, dtype=np.int32)
        out[order[0::2]], out[order[1::2]] = order[1::2], order[0::2]
        return out

    @classmethod
    def from_mesh(cls, mesh: Mesh, reference: ReferenceQuantities) -> Grid:
        """Scale, shift and tabulate `mesh`.

        Raises
        ------
        InputError
            If a cell's volume is not positive or a patch is of a kind the solver does not know.
        """
        bad = np.flatnonzero(~(mesh.cell_volume > 0.0))
        if bad.size:
            raise InputError(f"{bad.size} of {mesh.n_cells} mesh cells have no positive volume, the first is {bad[0]}")
        c = reference.length
        origin = np.asarray(reference.moment_reference)
        area = np.linalg.norm(mesh.face_area, axis=1)
        ni = mesh.n_interior
        owner, neighbour = mesh.owner, mesh.neighbour
        kind = np.empty(mesh.n_faces - ni, dtype=np.int8)
        for patch in mesh.patches:
            if patch.kind not in KINDS:
                raise InputError(
                    f"patch {patch.name} is of kind {patch.kind!r}; the flow is inviscid, it knows {', '.join(KINDS)}"
                )
            kind[patch.start - ni : patch.stop - ni] = KINDS[patch.kind]

        cell = np.concatenate([owner, neighbour])
        order = np.argsort(cell, kind="stable")
        offsets = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=mesh.n_cells))])
        face = np.concatenate([np.arange(mesh.n_faces), np.arange(ni)])[order]
        sign = np.concatenate([np.ones(mesh.n_faces), -np.ones(ni)])[order].astype(np.int8)
        other = np.concatenate([neighbour, np.full(mesh.n_faces - ni, -1), owner[:ni]])[order]
        centres = mesh.cell_centre / c
        normal = mesh.face_area / area[:, None]
        to_owner = mesh.face_centre / c - centres[owner]
        step = np.zeros((mesh.n_faces, 3))
        step[:ni] = centres[neighbour] - centres[owner[:ni]]
        mirrors = ni + np.flatnonzero(kind == SYMMETRY)
        step[mirrors] = 2.0 * np.sum(to_owner * normal, axis=1)[mirrors, None] * normal[mirrors]
        other[np.isin(face, mirrors)] = MIRROR
        weights = least_squares_weights(sign[:, None] * step[face], offsets)
        paired = np.concatenate([np.arange(ni), mirrors])
        skewed = paired[_skewness(to_owner[paired], step[paired]) > MOST_SKEWED]
        plain = np.zeros(mesh.n_cells, dtype=bool)
        plain[owner[skewed]] = plain[neighbour[skewed[skewed < ni]]] = True
        weights[np.repeat(plain, np.diff(offsets))] = 0.0
        walls = [np.arange(p.start, p.stop) for p in mesh.patches if p.kind == "wall"]
        return cls(
            owner=owner.astype(np.int32),
            neighbour=neighbour.astype(np.int32),
            kind=kind,
            normal=normal,
            area=area / c**2,
            moment=(mesh.face_moment - np.cross(origin, mesh.face_area)) / c**3,
            to_owner=to_owner,
            to_neighbour=mesh.face_centre[:ni] / c - centres[neighbour],
            volume=mesh.cell_volume / c**3,
            offsets=offsets.astype(np.int32),
            faces=face.astype(np.int32),
            signs=sign,
            cells=other.astype(np.int32),
            weights=weights,
            softening=np.linalg.norm(step, axis=1) ** 3,
            wall_faces=np.concatenate(walls).astype(np.int32) if walls else np.empty(0, dtype=np.int32),
        )


def _skewness(to_face: Array, step: Array) -> Array:
    """Distance of face centres off the line of centres, in lengths of that line."""
    square = np.sum(step * step, axis=1)
    along = np.sum(to_face * step, axis=1) / square
    off: Array = np.linalg.norm(to_face - along[:, None] * step, axis=1) / np.sqrt(square)
    return off
