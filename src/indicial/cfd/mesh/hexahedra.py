"""From hexahedra with coinciding nodes to a face-based mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from indicial.cfd.mesh.geometry import Array, Index
from indicial.cfd.mesh.mesh import Mesh, Patch, PatchKind
from indicial.errors import InputError

SIDE_NODES: Index = np.array(
    [[0, 4, 7, 3], [1, 2, 6, 5], [0, 1, 5, 4], [3, 7, 6, 2], [0, 3, 2, 1], [4, 5, 6, 7]], dtype=np.int64
)
"""Nodes of a hexahedron's six sides, seen anticlockwise from outside: i-, i+, j-, j+, k-, k+.

Nodes 0..7 are at (i, j, k) = 000, 100, 110, 010, 001, 101, 111, 011 (the order of VTK and CGNS).
"""

I_MINUS, I_PLUS, J_MINUS, J_PLUS, K_MINUS, K_PLUS = range(6)


@dataclass(frozen=True)
class PatchSides:
    """A patch as sides of hexahedra.

    Parameters
    ----------
    name : str
    kind : {"wall", "no_slip_wall", "sting", "farfield", "outflow", "symmetry"}
    cells, sides : int arrays of one shape
        Cell numbers and their sides 0..5 (`SIDE_NODES`). A side collapsed to a line or a point is left out.
    """

    name: str
    kind: PatchKind
    cells: Index
    sides: Index

    @classmethod
    def of(cls, name: str, kind: PatchKind, *blocks: tuple[Index, int]) -> PatchSides:
        """From pairs of cell numbers (any shape) and the one side that they give."""
        cells = [np.asarray(block, dtype=np.int64).ravel() for block, _ in blocks]
        sides = [np.full(c.size, side, dtype=np.int64) for c, (_, side) in zip(cells, blocks, strict=True)]
        return cls(name, kind, np.concatenate(cells), np.concatenate(sides))


def mesh_from_hexahedra(points: Array, cells: Index, patches: Sequence[PatchSides]) -> Mesh:
    """Face-based mesh of hexahedra that may be collapsed to prisms, pyramids and the like.

    Nodes at exactly the same place become one; faces lose repeated nodes, and those left with fewer than three
    distinct nodes vanish. Sides named in a patch are boundary even where another cell touches them, which is how
    a surface of no thickness is made. All others must match in pairs.

    Parameters
    ----------
    points : (np, 3) array
        Nodes [m].
    cells : (nc, 8) int array
        Nodes of each hexahedron in the order of `SIDE_NODES`; cells keep their numbers.
    patches : sequence of PatchSides
        The boundary.

    Raises
    ------
    InputError
        If sides are left that neither match nor belong to a patch, belong to two patches, or are folded.
    """
    points, cells = _merge_nodes(np.asarray(points, dtype=float), np.asarray(cells, dtype=np.int64))
    n_cells = cells.shape[0]
    quads = cells[:, SIDE_NODES].reshape(-1, 4)
    keep = quads != np.roll(quads, 1, axis=1)
    count = keep.sum(axis=1)
    part = _patch_of_sides(patches, n_cells)
    part[count < 3] = _VANISHED
    ordered = np.sort(quads, axis=1)
    if np.any((1 + (np.diff(ordered, axis=1) != 0).sum(axis=1) != count) & (count >= 3)):
        raise InputError("a hexahedron is folded: a side touches the same node twice without an edge between")
    first, second = _match(np.where(keep, quads, -1), np.flatnonzero(part == _INTERIOR), points, n_cells)
    order = np.lexsort((second // 6, first // 6))
    first, second = first[order], second[order]
    boundary = [np.flatnonzero(part == i) for i in range(len(patches))]
    faces = np.concatenate([first, *boundary])
    edges = first.size + np.concatenate([[0], np.cumsum([b.size for b in boundary])])
    return Mesh(
        points=points,
        face_offsets=np.concatenate([[0], np.cumsum(count[faces])]),
        face_points=quads[faces][keep[faces]],
        owner=faces // 6,
        neighbour=second // 6,
        patches=tuple(
            Patch(patch.name, patch.kind, int(edges[i]), int(edges[i + 1])) for i, patch in enumerate(patches)
        ),
    )


_INTERIOR, _VANISHED = -1, -2


def _merge_nodes(points: Array, cells: Index) -> tuple[Array, Index]:
    """Give nodes at the same place one number, drop unused ones, keep the order of first appearance in cells."""
    order = np.lexsort((points + 0.0).T)
    new = np.ones(order.size, dtype=bool)
    new[1:] = np.any(points[order[1:]] != points[order[:-1]], axis=1)
    representative = np.empty_like(order)
    representative[order] = order[np.flatnonzero(new)][np.cumsum(new) - 1]
    cells = representative[cells]
    used, first = np.unique(cells.ravel(), return_index=True)
    ranked = used[np.argsort(first)]
    number = np.empty(points.shape[0], dtype=np.int64)
    number[ranked] = np.arange(ranked.size)
    return points[ranked], number[cells]


def _patch_of_sides(patches: Sequence[PatchSides], n_cells: int) -> NDArray[np.int64]:
    """Number of the patch of each of the 6 nc sides, or interior."""
    part = np.full(6 * n_cells, _INTERIOR, dtype=np.int64)
    for i, patch in enumerate(patches):
        sides = 6 * patch.cells + patch.sides
        if np.any(part[sides] != _INTERIOR) or np.unique(sides).size != sides.size:
            raise InputError(f"patch {patch.name!r} names a side of a cell that already belongs to a patch")
        part[sides] = i
    return part


def _match(quads: Index, sides: Index, points: Array, n_cells: int) -> tuple[Index, Index]:
    """Pairs of sides (of the smaller and the larger cell) with the same set of nodes; -1 stands for no node."""
    nodes = np.sort(quads[sides], axis=1) + 1
    radix = points.shape[0] + 1
    low, high = nodes[:, 0] * radix + nodes[:, 1], nodes[:, 2] * radix + nodes[:, 3]
    order = np.lexsort((high, low))
    low, high, ranked = low[order], high[order], sides[order]
    same = (low[1:] == low[:-1]) & (high[1:] == high[:-1])
    alone = np.ones(ranked.size, dtype=bool)
    alone[1:] &= ~same
    alone[:-1] &= ~same
    if np.any(alone):
        where = points[quads[ranked[alone][0]].max()]
        raise InputError(
            f"{int(alone.sum())} sides of hexahedra neither match another cell nor belong to a patch, "
            f"the first near ({where[0]:.6g}, {where[1]:.6g}, {where[2]:.6g}) m"
        )
    if np.any(same[1:] & same[:-1]):
        raise InputError("more than two hexahedra share a side")
    one, two = ranked[:-1][same], ranked[1:][same]
    if np.any(one // 6 == two // 6):
        raise InputError("a hexahedron is flat: two of its sides coincide")
    return np.minimum(one, two), np.maximum(one, two)
