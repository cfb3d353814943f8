"""A sting is a slip wall whose loads do not count."""

from dataclasses import replace

import numpy as np

from indicial.cfd.flow import STILL_AIR, Grid, MeshMotion, Residual
from indicial.cfd.mesh import Mesh, box_mesh
from indicial.conventions import ReferenceQuantities

REFERENCE = ReferenceQuantities(1.0, 1.0, (0.3, 0.2, 0.1))
MOTION = MeshMotion(np.array([-2.0, 0.3, 0.5]), np.array([0.3, -0.5, 0.2]))


def of_kinds(mesh: Mesh, **kinds: str) -> Mesh:
    return replace(mesh, patches=tuple(replace(p, kind=kinds.get(p.name, p.kind)) for p in mesh.patches))


def test_the_air_meets_a_sting_as_a_wall_but_its_loads_are_left_out() -> None:
    walls = box_mesh((4, 3, 4), skew="random", kinds={"z_min": "wall", "z_max": "wall"})
    meshes = {"walls": walls, "sting": of_kinds(walls, z_max="sting"), "none": of_kinds(walls, z_min="sting")}
    rng = np.random.default_rng(1)
    q = STILL_AIR * (1.0 + 0.1 * rng.uniform(-1.0, 1.0, (walls.n_cells, 5)))
    residuals, forces, moments = {}, {}, {}
    for name, mesh in meshes.items():
        residual = Residual(Grid.from_mesh(mesh, REFERENCE))
        residuals[name] = residual(q, MOTION)
        forces[name], moments[name] = residual.forces(1.0 / 1.4)
    assert np.array_equal(residuals["walls"], residuals["sting"])
    assert np.allclose(forces["sting"] + forces["none"], forces["walls"], rtol=1e-12)
    assert np.allclose(moments["sting"] + moments["none"], moments["walls"], rtol=1e-12)
    assert np.linalg.norm(forces["sting"] - forces["walls"]) > 0.1
