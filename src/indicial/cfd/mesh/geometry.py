r"""Areas, moments, volumes and centres of polyhedra, exact on the triangulation of their faces.

Every face is cut into the fan of triangles about the mean of its nodes, its hub. A cell bounded by such faces is
a closed polyhedron with plane facets, so its sums of ``A_f`` and of ``M_f = integral of r x dA`` vanish to
round-off, whatever the warp of its faces. That is the geometric conservation law of a mesh that moves rigidly.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.int64]


class FaceGeometry(NamedTuple):
    """Integrals over the faces' triangles t, with areas ``A_t`` and centroids ``r_t``.

    Attributes
    ----------
    area : (nf, 3) array
        ``A_f = sum_t A_t`` [m^2].
    centre : (nf, 3) array
        Mean of ``r_t`` weighted with ``|A_t|`` [m].
    moment : (nf, 3) array
        ``M_f = sum_t r_t x A_t`` [m^3].
    hub : (nf, 3) array
        Mean of the nodes [m].
    tensor : (nf, 3, 3) array
        ``sum_t (r_t - hub) A_t^T`` [m^3].
    """

    area: Array
    centre: Array
    moment: Array
    hub: Array
    tensor: Array


def face_geometry(points: Array, offsets: Index, nodes: Index) -> FaceGeometry:
    """Integrals over faces given as CSR lists of nodes, anticlockwise seen from the tip of the area vector."""
    start, count = offsets[:-1], np.diff(offsets)

    def total(values: Array) -> Array:
        sums: Array = np.add.reduceat(values, start, axis=0)
        return sums

    successor = np.arange(1, nodes.size + 1)
    successor[offsets[1:] - 1] = start
    corner = points[nodes]
    hub = total(corner) / count[:, None]
    corner -= np.repeat(hub, count, axis=0)
    following = corner[successor]
    area_t = 0.5 * np.cross(corner, following)
    arm_t = (corner + following) / 3.0
    size_t = np.sqrt(np.einsum("ij,ij->i", area_t, area_t))
    area = total(area_t)
    size = np.maximum(total(size_t), np.finfo(float).tiny)
    return FaceGeometry(
        area=area,
        centre=hub + total(size_t[:, None] * arm_t) / size[:, None],
        moment=np.cross(hub, area) + total(np.cross(arm_t, area_t)),
        hub=hub,
        tensor=total(arm_t[:, :, None] * area_t[:, None, :]),
    )


def sum_over_cells(values: Array, owner: Index, neighbour: Index, n_cells: int, sign: float = -1.0) -> Array:
    """Sum face values ``(nf, ...)`` into cells: plus for the owner, times `sign` for the neighbour."""
    flat = values.reshape(values.shape[0], -1)
    sums = np.empty((n_cells, flat.shape[1]))
    for i, column in enumerate(flat.T):
        sums[:, i] = np.bincount(owner, weights=column, minlength=n_cells)
        sums[:, i] += sign * np.bincount(neighbour, weights=column[: neighbour.size], minlength=n_cells)
    return sums.reshape(n_cells, *values.shape[1:])


def cell_geometry(faces: FaceGeometry, owner: Index, neighbour: Index, n_cells: int) -> tuple[Array, Array]:
    """Volumes (nc,) [m^3] and centroids (nc, 3) [m] of cells: sums of tetrahedra on the faces' triangles.

    The tetrahedra's common corner is the mean ``o`` of the cell's face centres, so small cells far from the origin
    lose no digits. As every triangle holds its face's hub h, ``V = sum_f (h - o).A_f / 3`` and
    ``integral of (r - o) dV = sum_f [(h - o)(h - o).A_f + T_f (h - o)] / 4``.
    """
    count = sum_over_cells(np.ones(owner.size), owner, neighbour, n_cells, sign=1.0)
    origin = sum_over_cells(faces.centre, owner, neighbour, n_cells, sign=1.0) / count[:, None]
    volume, first_moment = np.zeros(n_cells), np.zeros((n_cells, 3))
    for cells, sign in ((owner, 1.0), (neighbour, -1.0)):
        part = slice(cells.size)
        arm = faces.hub[part] - origin[cells]
        height = np.einsum("ij,ij->i", arm, faces.area[part])
        volume += sign * np.bincount(cells, weights=height, minlength=n_cells) / 3.0
        moment = height[:, None] * arm + np.einsum("fij,fj->fi", faces.tensor[part], arm)
        for i in range(3):
            first_moment[:, i] += sign * np.bincount(cells, weights=moment[:, i], minlength=n_cells) / 4.0
    safe = np.where(volume == 0.0, 1.0, volume)
    return volume, origin + first_moment / safe[:, None]
