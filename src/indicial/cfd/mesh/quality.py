"""Checks of a mesh: is it closed, positive, and of what quality."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from indicial.cfd.mesh.geometry import Array, sum_over_cells
from indicial.cfd.mesh.mesh import Mesh
from indicial.errors import InputError


@dataclass(frozen=True)
class MeshReport:
    """What `Mesh.check` measured.

    Parameters
    ----------
    n_cells, n_faces, n_points : int
    patches : dict
        Faces and area [m^2] of each patch.
    volume : float
        Sum of the cells [m^3].
    smallest_cell, largest_cell : float
        Volumes [m^3].
    closure : float
        Largest ``|sum A_f| / sum |A_f|`` of a cell.
    moment_closure : float
        Largest ``|sum M_f| / sum |A_f|`` of a cell over the size of the mesh.
    non_orthogonality_deg, mean_non_orthogonality_deg : float
        Angle between a face's area and the line of the two cell centres.
    skewness : float
        Largest distance from an interior face's centre to that line, over the line's length.
    aspect_ratio : float
        Largest ratio of a cell's largest to smallest extent ``V / (projected area)``.
    """

    n_cells: int
    n_faces: int
    n_points: int
    patches: dict[str, tuple[int, float]]
    volume: float
    smallest_cell: float
    largest_cell: float
    closure: float
    moment_closure: float
    non_orthogonality_deg: float
    mean_non_orthogonality_deg: float
    skewness: float
    aspect_ratio: float

    def summary(self) -> str:
        """A few lines for a reader."""
        patches = ", ".join(f"{name} {faces}" for name, (faces, _) in self.patches.items())
        return "\n".join(
            [
                f"{self.n_cells} cells, {self.n_faces} faces, {self.n_points} points",
                f"patches (faces): {patches}",
                f"volume {self.volume:.6g} m3, cells {self.smallest_cell:.3g} to {self.largest_cell:.3g} m3",
                f"closure {self.closure:.1e}, of moments {self.moment_closure:.1e}",
                f"non-orthogonality {self.non_orthogonality_deg:.1f} deg "
                f"(mean {self.mean_non_orthogonality_deg:.1f}), skewness {self.skewness:.2f}, "
                f"aspect ratio {self.aspect_ratio:.3g}",
            ]
        )


def check_mesh(mesh: Mesh) -> MeshReport:
    """Measure closure and quality of a mesh.

    Raises
    ------
    InputError
        If cells have no positive volume: how many, and where the worst is.
    """
    volume = mesh.cell_volume
    bad = np.flatnonzero(~(volume > 0.0))
    if bad.size:
        worst = bad[np.argmin(volume[bad])]
        x, y, z = mesh.cell_centre[worst]
        raise InputError(
            f"{bad.size} of {mesh.n_cells} cells are inverted, the worst is cell {worst} near "
            f"({x:.6g}, {y:.6g}, {z:.6g}) m with volume {volume[worst]:.3g} m3"
        )
    size = np.linalg.norm(mesh.face_area, axis=1)
    surface = _sums(mesh, size, sign=1.0)
    closure = np.linalg.norm(_sums(mesh, mesh.face_area), axis=1) / surface
    extent = float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    moment_closure = np.linalg.norm(_sums(mesh, mesh.face_moment), axis=1) / (surface * extent)
    angle, skewness = _interior_quality(mesh, size)
    projected = _sums(mesh, np.abs(mesh.face_area), sign=1.0) / 2.0
    return MeshReport(
        n_cells=mesh.n_cells,
        n_faces=mesh.n_faces,
        n_points=mesh.n_points,
        patches={p.name: (p.size, float(size[p.faces].sum())) for p in mesh.patches},
        volume=float(volume.sum()),
        smallest_cell=float(volume.min()),
        largest_cell=float(volume.max()),
        closure=float(closure.max()),
        moment_closure=float(moment_closure.max()),
        non_orthogonality_deg=float(np.rad2deg(angle.max(initial=0.0))),
        mean_non_orthogonality_deg=float(np.rad2deg(angle.mean())) if angle.size else 0.0,
        skewness=float(skewness.max(initial=0.0)),
        aspect_ratio=float((projected.max(axis=1) / projected.min(axis=1)).max()),
    )


def _sums(mesh: Mesh, values: Array, sign: float = -1.0) -> Array:
    return sum_over_cells(values, mesh.owner, mesh.neighbour, mesh.n_cells, sign)


def _interior_quality(mesh: Mesh, size: Array) -> tuple[Array, Array]:
    """Non-orthogonality [rad] and skewness of the interior faces."""
    n = mesh.n_interior
    here = mesh.cell_centre[mesh.owner[:n]]
    line = mesh.cell_centre[mesh.neighbour] - here
    length = np.linalg.norm(line, axis=1)
    cosine = np.einsum("ij,ij->i", line, mesh.face_area[:n]) / (length * size[:n])
    arm = mesh.face_centre[:n] - here
    along = np.einsum("ij,ij->i", arm, line) / length**2
    miss = np.linalg.norm(arm - along[:, None] * line, axis=1) / length
    return np.arccos(np.clip(cosine, -1.0, 1.0)), miss
