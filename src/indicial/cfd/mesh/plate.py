"""A flat plate of no thickness in an H-grid, two-dimensional (one layer of cells)."""

from __future__ import annotations

import numpy as np

from indicial.cfd.mesh.geometry import Array
from indicial.cfd.mesh.hexahedra import I_MINUS, I_PLUS, J_MINUS, J_PLUS, K_MINUS, K_PLUS, PatchSides
from indicial.cfd.mesh.mesh import Mesh
from indicial.cfd.mesh.structured import (
    block_hexahedra,
    block_nodes,
    extrude,
    geometric,
    positive,
    positive_count,
    two_sided,
)


def plate_mesh(
    chord: float = 1.0,
    *,
    n_chord: int = 80,
    n_normal: int = 60,
    ahead: float = 0.3,
    behind: float = 0.1,
    height: float = 1.5,
    edge_spacing: float | None = None,
    wall_spacing: float | None = None,
    thickness: float = 1.0,
) -> Mesh:
    r"""Flat plate from (0, 0) to (`chord`, 0) as a slit between two rows of cells, mirror-symmetric about z = 0.

    Patches: "upper" and "lower" (wall), "farfield" (inflow, top and bottom), "outflow" (downstream),
    "symmetry" (front and back). Cells are numbered plane by plane along x.

    The defaults suit a supersonic stream, where nothing returns from behind or, with
    ``2 height > 1 / sqrt(M^2 - 1)`` chords, from above. A subsonic one needs some 20 to 50 chords on every side.

    Parameters
    ----------
    chord : float
        Chord c [m].
    n_chord, n_normal : int
        Cells along the plate, and from it to the top (and to the bottom).
    ahead, behind, height : float
        Extent of the domain upstream, downstream and to each side, in chords.
    edge_spacing : float, optional
        Length of the cells at both edges of the plate, in chords; even spacing, ``1 / n_chord``, if not given.
    wall_spacing : float, optional
        Height of the cells on the plate, in chords; even spacing in z if not given.
    thickness : float
        Width of the layer along y, in chords.

    Raises
    ------
    InputError
        If a length or count is not positive, or a spacing exceeds what it divides.
    """
    positive_count("n_chord", n_chord)
    positive_count("n_normal", n_normal)
    for name, value in (("chord", chord), ("ahead", ahead), ("behind", behind), ("height", height)):
        positive(name, value)
    positive("thickness", thickness)
    edge = positive("edge_spacing", 1.0 / n_chord if edge_spacing is None else edge_spacing)
    wall = positive("wall_spacing", height / n_normal if wall_spacing is None else wall_spacing)
    upstream, downstream = _growing(edge, ahead), _growing(edge, behind)
    x = np.concatenate([-upstream[:0:-1], two_sided(edge, edge, n_chord), 1.0 + downstream[1:]])
    half = geometric(wall, height, n_normal)
    z = np.concatenate([-half[:0:-1], half])
    plane_x, plane_z = np.meshgrid(x, z, indexing="ij")
    points = chord * extrude(plane_x, plane_z, thickness)
    cells = block_hexahedra(block_nodes(x.size, 2, z.size))
    number = block_nodes(*cells.shape[:3])
    plate = slice(upstream.size - 1, upstream.size - 1 + n_chord)
    patches = [
        PatchSides.of("upper", "wall", (number[plate, :, n_normal], K_MINUS)),
        PatchSides.of("lower", "wall", (number[plate, :, n_normal - 1], K_PLUS)),
        PatchSides.of(
            "farfield", "farfield", (number[0], I_MINUS), (number[..., 0], K_MINUS), (number[..., -1], K_PLUS)
        ),
        PatchSides.of("outflow", "outflow", (number[-1], I_PLUS)),
        PatchSides.of("symmetry", "symmetry", (number[:, 0], J_MINUS), (number[:, -1], J_PLUS)),
    ]
    return Mesh.from_hexahedra(points.reshape(-1, 3), cells.reshape(-1, 8), patches)


def _growing(first: float, length: float, ratio: float = 1.15) -> Array:
    """Stations from 0 to `length` with steps growing by about `ratio` from `first`; evenly if `length` is short."""
    if length <= 2.0 * first:
        return np.linspace(0.0, length, max(1, round(length / first)) + 1)
    n = int(np.ceil(np.log1p(length / first * (ratio - 1.0)) / np.log(ratio)))
    return geometric(first, length, n)
