"""Pictures in space: the mesh, and the flow on the body and in its symmetry plane."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from indicial.cfd.mesh import Mesh
from indicial.conventions import Array
from indicial.errors import InputError
from indicial.files import atomic_path
from indicial.report.style import figure_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Polygons = list[Array]


def patch_polygons(mesh: Mesh, faces: Any) -> Polygons:
    """Corner points of faces [m], one array (n, 3) a face."""
    return [mesh.points[mesh.face_nodes(int(face))] for face in np.arange(mesh.n_faces)[faces]]


@dataclass(frozen=True)
class FlowPicture:
    """What the flow picture needs of a steady flow, small enough to keep.

    Parameters
    ----------
    wall_corners : ndarray
        Corners of the wall faces [m], mesh axes, shape (n, 4, 3); triangles repeat a corner.
    wall_cp : ndarray
        Pressure coefficient on them, shape (n,).
    plane_corners, plane_mach : ndarray
        The same of the symmetry plane, and the Mach number in the cells behind its faces.
    title : str
    """

    wall_corners: Array
    wall_cp: Array
    plane_corners: Array
    plane_mach: Array
    title: str

    @classmethod
    def of(cls, mesh: Mesh, wall_faces: NDArray[Any], wall_cp: Array, mach: Array, title: str) -> Self:
        """From a mesh of half a body and the flow on it.

        Parameters
        ----------
        wall_faces, wall_cp : ndarray
            Indices of faces and the pressure coefficient on them.
        mach : ndarray
            Mach number in the cells.
        """
        plane = np.arange(mesh.n_faces)[mesh.patch("symmetry").faces]
        return cls(
            _quads(patch_polygons(mesh, wall_faces)),
            wall_cp,
            _quads(patch_polygons(mesh, plane)),
            mach[mesh.owner[plane]],
            title,
        )

    def save(self, path: Path) -> None:
        """Write a compressed numpy archive in one step."""
        with atomic_path(path) as temporary, temporary.open("wb") as stream:
            np.savez_compressed(
                stream,
                wall_corners=self.wall_corners.astype(np.float32),
                wall_cp=self.wall_cp.astype(np.float32),
                plane_corners=self.plane_corners.astype(np.float32),
                plane_mach=self.plane_mach.astype(np.float32),
                title=np.array(self.title),
            )

    @classmethod
    def load(cls, path: Path) -> Self:
        """Read what `save` wrote."""
        try:
            with np.load(path, allow_pickle=False) as stored:
                return cls(
                    stored["wall_corners"],
                    stored["wall_cp"],
                    stored["plane_corners"],
                    stored["plane_mach"],
                    str(stored["title"]),
                )
        except (OSError, EOFError, ValueError, KeyError, BadZipFile) as error:
            raise InputError(f"{path}: not a flow picture ({error})") from error


def _quads(polygons: Polygons) -> Array:
    """Corners of triangles and quadrilaterals, shape (n, 4, 3)."""
    return np.array([np.concatenate([corners, corners[-1:].repeat(4 - len(corners), axis=0)]) for corners in polygons])


def mesh_figure(mesh: Mesh, diameter: float) -> Figure:
    """The mesh in the symmetry plane, round the fins (with a sting, the whole domain instead), and on the body.

    Parameters
    ----------
    mesh : Mesh
        Of half a body.
    diameter : float
        Unit of the axes [m].
    """
    plane = _quads(patch_polygons(mesh, mesh.patch("symmetry").faces)) / diameter
    walls = np.concatenate(
        [_quads(patch_polygons(mesh, patch.faces)) for patch in mesh.patches if patch.kind == "wall"]
    )
    wide = all(patch.kind != "outflow" for patch in mesh.patches)
    with figure_style() as plt:
        figure: Figure = plt.figure(figsize=(11.0, 7.4))
        parts: Any = figure.subfigures(2, 1, height_ratios=(1.15, 1.0))
        top, bottom = parts
        axes = top.subplots()
        _draw(axes, plane[..., [0, 2]], edge="0.25")
        axes.set(xlabel="x/d, aft of the nose", ylabel="z/d", title="symmetry plane", aspect="equal")
        axes.autoscale_view()
        left, right = bottom.subplots(1, 2, width_ratios=(1.0, 1.5))
        if wide:
            axes.set(**_near(walls / diameter, plane))
            _draw(left, plane[..., [0, 2]], edge="0.25")
            left.set(xlabel="x/d", ylabel="z/d", title="the whole domain", aspect="equal")
        else:
            base = _quads(patch_polygons(mesh, mesh.patch("outflow").faces)) / diameter
            _draw(left, base[..., [1, 2]], edge="0.25")
            left.set(xlabel="y/d", ylabel="z/d", title="plane of the base: the fins' gaps", aspect="equal")
            left.set(xlim=(-0.05, 2.2), ylim=(-2.0, 2.0))
        _surface(right, walls / diameter, None, edge="0.3")
        right.set_title("surface")
        return figure


def _near(walls: Array, plane: Array) -> dict[str, tuple[float, float]]:
    """Limits of x and z that show the body and, as far as there is a mesh, a part of its length all round."""
    length = float(walls[..., 0].max())
    first, last = float(plane[..., 0].min()), float(plane[..., 0].max())
    return {"xlim": (max(first, -0.15 * length), min(last, 1.3 * length)), "ylim": (-0.4 * length, 0.4 * length)}


def flow_figure(picture: FlowPicture, diameter: float) -> Figure:
    """Mach number in the symmetry plane and pressure coefficient on the body."""
    with figure_style() as plt:
        figure: Figure
        figure, (above, below) = plt.subplots(2, 1, figsize=(10.0, 7.6), height_ratios=(1.3, 1.0))
        plane = _draw(above, picture.plane_corners[..., [0, 2]] / diameter, picture.plane_mach, cmap="viridis")
        figure.colorbar(plane, ax=above, label="Mach number relative to the body", shrink=0.9)
        above.set(xlabel="x/d, aft of the nose", ylabel="z/d", aspect="equal")
        above.set(**_near(picture.wall_corners / diameter, picture.plane_corners / diameter))
        above.set_title(f"{picture.title}: symmetry plane")
        limit = float(np.quantile(np.abs(picture.wall_cp), 0.98))
        wall = _surface(below, picture.wall_corners / diameter, picture.wall_cp, cmap="RdBu_r", limit=limit)
        figure.colorbar(wall, ax=below, label="pressure coefficient", shrink=0.9)
        below.set_title("surface")
        return figure


def _draw(axes: Axes, corners: Array, values: Array | None = None, *, cmap: str = "viridis", edge: str = "face") -> Any:
    """Polygons (n, 4, 2), filled with values or only outlined."""
    from matplotlib.collections import PolyCollection

    filled: dict[str, Any] = {"facecolors": "none"} if values is None else {"array": values, "cmap": cmap}
    collection = PolyCollection(list(corners), edgecolors=edge, linewidths=0.3 if values is None else 0.1, **filled)
    collection.set_rasterized(True)
    axes.add_collection(collection)
    axes.autoscale_view()
    axes.grid(visible=False)
    return collection


def _surface(
    axes: Axes,
    corners: Array,
    values: Array | None,
    *,
    cmap: str = "RdBu_r",
    edge: str = "face",
    limit: float | None = None,
) -> Any:
    """The whole body, made of a half (y >= 0) and its mirror image, seen from behind, above and the right."""
    from matplotlib.collections import PolyCollection

    both = np.concatenate([corners, corners[:, ::-1] * [1.0, -1.0, 1.0]])
    azimuth, elevation = math.radians(35.0), math.radians(22.0)
    aft = np.array([math.sin(azimuth), math.cos(azimuth), 0.0]) * math.cos(elevation)
    view = aft + np.array([0.0, 0.0, math.sin(elevation)])
    right = np.array([math.cos(azimuth), -math.sin(azimuth), 0.0])
    up = np.cross(right, view) * -1.0
    order = np.argsort(both.mean(axis=1) @ view)
    flat = np.stack([both @ right, both @ up], axis=-1)[order]
    filled: dict[str, Any] = {"facecolors": "#dfe6ee"}
    if values is not None:
        filled = {"array": np.concatenate([values, values])[order], "cmap": cmap}
    collection = PolyCollection(list(flat), edgecolors=edge, linewidths=0.25, **filled)
    if limit is not None:
        collection.set_clim(-limit, limit)
    axes.add_collection(collection)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.axis("off")
    return collection
