"""The face-based mesh, its generators, its checks, reading and writing."""

from indicial.cfd.mesh.airfoil import airfoil_mesh
from indicial.cfd.mesh.body_frame import WideDomain
from indicial.cfd.mesh.box import box_mesh
from indicial.cfd.mesh.finned_body import RESOLUTIONS, Resolution, cone_mesh, finned_body_mesh
from indicial.cfd.mesh.hexahedra import PatchSides
from indicial.cfd.mesh.mesh import PATCH_KINDS, Mesh, Patch, PatchKind
from indicial.cfd.mesh.plate import plate_mesh
from indicial.cfd.mesh.quality import MeshReport

__all__ = [
    "PATCH_KINDS",
    "RESOLUTIONS",
    "Mesh",
    "MeshReport",
    "Patch",
    "PatchKind",
    "PatchSides",
    "Resolution",
    "WideDomain",
    "airfoil_mesh",
    "box_mesh",
    "cone_mesh",
    "finned_body_mesh",
    "plate_mesh",
]
