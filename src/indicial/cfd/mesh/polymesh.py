"""OpenFOAM's polyMesh: the same faces, owners and neighbours, as text."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path

from indicial.cfd.mesh.mesh import Mesh
from indicial.files import write_text

_OPENFOAM_TYPE: dict[str, str] = {
    "wall": "wall",
    "no_slip_wall": "wall",
    "sting": "wall",
    "farfield": "patch",
    "outflow": "patch",
    "symmetry": "symmetry",
}


def write_polymesh(mesh: Mesh, folder: str | Path) -> None:
    """Write ``points``, ``faces``, ``owner``, ``neighbour`` and ``boundary`` into `folder`, in ASCII.

    Walls and stings become ``wall``, symmetry planes ``symmetry``, the rest ``patch``; names are kept.
    """
    target = Path(folder)
    note = f"nPoints:{mesh.n_points} nCells:{mesh.n_cells} nFaces:{mesh.n_faces} nInternalFaces:{mesh.n_interior}"
    nodes = mesh.face_points.tolist()
    edges = mesh.face_offsets.tolist()
    faces = (f"{b - a}({' '.join(map(str, nodes[a:b]))})" for a, b in pairwise(edges))
    points = (f"({x:.17g} {y:.17g} {z:.17g})" for x, y, z in mesh.points.tolist())
    boundary = (
        f"{p.name}\n{{\n    type {_OPENFOAM_TYPE[p.kind]};\n    nFaces {p.size};\n    startFace {p.start};\n}}"
        for p in mesh.patches
    )
    _write_list(target / "points", "vectorField", mesh.n_points, points)
    _write_list(target / "faces", "faceList", mesh.n_faces, faces)
    _write_list(target / "owner", "labelList", mesh.n_faces, map(str, mesh.owner.tolist()), note)
    _write_list(target / "neighbour", "labelList", mesh.n_interior, map(str, mesh.neighbour.tolist()), note)
    _write_list(target / "boundary", "polyBoundaryMesh", len(mesh.patches), boundary)


def _write_list(path: Path, kind: str, size: int, entries: Iterable[str], note: str = "") -> None:
    header = ["FoamFile", "{", "    version 2.0;", "    format ascii;", f"    class {kind};"]
    if note:
        header.append(f'    note "{note}";')
    header += ['    location "constant/polyMesh";', f"    object {path.name};", "}", "", str(size), "("]
    write_text(path, "\n".join([*header, *entries, ")", ""]))
