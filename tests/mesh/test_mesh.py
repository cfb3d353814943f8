"""The mesh itself: geometry, topology, checks and files."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from indicial.cfd.mesh import Mesh, PatchSides, box_mesh
from indicial.cfd.mesh.hexahedra import I_MINUS, SIDE_NODES
from indicial.errors import InputError

UNIT = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], dtype=float)


def one_cell(points: np.ndarray) -> Mesh:
    everything = PatchSides("all", "farfield", np.zeros(6, dtype=int), np.arange(6))
    return Mesh.from_hexahedra(points, np.arange(8)[None], [everything])


def test_cube_has_its_volume_centre_areas_and_moments():
    mesh = one_cell(UNIT * 2.0 + np.array([3.0, -1.0, 0.5]))
    assert mesh.cell_volume == pytest.approx([8.0])
    assert mesh.cell_centre[0] == pytest.approx([4.0, 0.0, 1.5])
    assert mesh.face_moment == pytest.approx(np.cross(mesh.face_centre, mesh.face_area))
    assert mesh.face_area[0] == pytest.approx([-4.0, 0.0, 0.0])


def test_tetrahedron_from_a_collapsed_hexahedron_is_exact():
    a, b, c, top = np.array([[0, 0, 0], [2, 0, 0], [0, 3, 0], [0.5, 0.5, 4.0]])
    mesh = one_cell(np.array([a, b, c, c, top, top, top, top]))
    assert mesh.n_faces == 4
    assert mesh.n_points == 4
    assert mesh.cell_volume == pytest.approx([2 * 3 * 4.0 / 6.0])
    assert mesh.cell_centre[0] == pytest.approx((a + b + c + top) / 4)


@pytest.mark.parametrize("axis", range(3))
def test_prisms_collapsed_along_any_axis_have_half_the_volume(axis):
    points = np.roll(UNIT, axis, axis=1)
    points[:, (axis + 2) % 3] *= points[:, axis]
    mesh = one_cell(points)
    assert mesh.n_faces == 5
    assert mesh.cell_volume == pytest.approx([0.5])


@given(st.integers(0, 10_000))
@settings(max_examples=20, deadline=None)
def test_warped_cell_has_the_volume_and_centroid_of_its_tetrahedra(seed):
    rng = np.random.default_rng(seed)
    points = UNIT + rng.uniform(-0.2, 0.2, (8, 3)) + np.array([50.0, 0.0, 0.0])
    mesh = one_cell(points)
    volume, first = 0.0, np.zeros(3)
    apex = points.mean(axis=0)
    for quad in points[SIDE_NODES]:
        hub = quad.mean(axis=0)
        for p, q in zip(quad, np.roll(quad, -1, axis=0), strict=True):
            part = np.dot(p - apex, np.cross(q - apex, hub - apex)) / 6.0
            volume += part
            first += part * (p + q + hub + apex) / 4.0
    assert mesh.cell_volume[0] == pytest.approx(volume, rel=1e-10)
    assert mesh.cell_centre[0] == pytest.approx(first / volume, rel=1e-10)


def test_face_moment_is_the_swept_volume_of_a_rotating_warped_face():
    mesh = box_mesh((2, 2, 2), skew="random", amplitude=0.25)
    omega = np.array([0.3, -0.7, 0.4])
    nodes = mesh.points[mesh.face_nodes(0)]
    hub = nodes.mean(axis=0)
    swept = 0.0
    for p, q in zip(nodes, np.roll(nodes, -1, axis=0), strict=True):
        corners = np.array([hub, p, q])
        area = 0.5 * np.cross(p - hub, q - hub)
        swept += np.dot(np.cross(omega, corners).mean(axis=0), area)
    assert mesh.face_moment[0] @ omega == pytest.approx(swept, rel=1e-10)


@pytest.mark.parametrize("skew", ["none", "smooth", "random"])
@pytest.mark.parametrize("shape", [(6, 5, 4), (9, 1, 7)])
def test_box_is_closed_and_keeps_its_volume(skew, shape):
    mesh = box_mesh(shape, (0.0, -1.0, 2.0), (2.0, 0.5, 3.0), skew=skew)
    report = mesh.check()
    assert report.volume == pytest.approx(3.0, rel=1e-12)
    assert report.closure < 1e-14
    assert report.moment_closure < 1e-14
    assert np.all(mesh.cell_volume > 0.0)
    assert mesh.cell_volume @ mesh.cell_centre == pytest.approx(3.0 * np.array([1.0, -0.25, 2.5]), rel=1e-12)


def test_smooth_skew_is_one_map_at_every_refinement():
    coarse, fine = (box_mesh((n, n, n), skew="smooth") for n in (4, 8))
    fine_nodes = {tuple(p) for p in np.round(fine.points, 12)}
    assert all(tuple(p) in fine_nodes for p in np.round(coarse.points, 12))


def test_faces_are_laid_out_as_in_polymesh():
    mesh = box_mesh((4, 3, 5))
    n = mesh.n_interior
    assert np.all(mesh.owner[:n] < mesh.neighbour)
    assert np.all(np.diff(mesh.owner[:n] * mesh.n_cells + mesh.neighbour) > 0)
    assert n == 3 * 3 * 5 + 4 * 2 * 5 + 4 * 3 * 4
    line = mesh.cell_centre[mesh.neighbour] - mesh.cell_centre[mesh.owner[:n]]
    assert np.all(np.einsum("ij,ij->i", line, mesh.face_area[:n]) > 0.0)
    for patch in mesh.patches:
        outward = mesh.face_centre[patch.faces] - mesh.cell_centre[mesh.owner[patch.faces]]
        assert np.all(np.einsum("ij,ij->i", outward, mesh.face_area[patch.faces]) > 0.0)


def test_box_patches_have_the_kinds_asked_for():
    mesh = box_mesh((2, 1, 2), kinds={"y_min": "symmetry", "y_max": "symmetry", "x_max": "outflow"})
    kinds = {p.name: p.kind for p in mesh.patches}
    assert kinds["y_min"] == kinds["y_max"] == "symmetry"
    assert kinds["x_max"] == "outflow"
    assert kinds["z_min"] == "farfield"
    assert {p.kind for p in box_mesh((2, 2, 2), kinds="wall").patches} == {"wall"}


def test_scaling_multiplies_lengths():
    mesh = box_mesh((3, 3, 3), skew="random")
    twice = mesh.scaled(2.0)
    assert twice.cell_volume == pytest.approx(8.0 * mesh.cell_volume)
    assert twice.face_moment == pytest.approx(8.0 * mesh.face_moment)
    with pytest.raises(InputError, match="scale factor"):
        mesh.scaled(0.0)


def test_inverted_cells_are_refused_with_their_number_and_place():
    mesh = box_mesh((3, 3, 3))
    points = mesh.points.copy()
    corner = np.flatnonzero(np.all(points == 0.0, axis=1))[0]
    points[corner] = [0.9, 0.9, 0.9]
    bad = Mesh(points, mesh.face_offsets, mesh.face_points, mesh.owner, mesh.neighbour, mesh.patches)
    with pytest.raises(InputError, match=r"1 of 27 cells are inverted, the worst is cell 0 near \("):
        bad.check()


def test_left_handed_cells_are_refused():
    with pytest.raises(InputError, match="1 of 1 cells are inverted"):
        one_cell(UNIT * [1.0, 1.0, -1.0]).check()


def test_unnamed_boundary_is_refused_with_its_place():
    with pytest.raises(InputError, match="5 sides of hexahedra neither match another cell nor belong to a patch"):
        Mesh.from_hexahedra(UNIT, np.arange(8)[None], [PatchSides.of("one", "wall", (np.array([0]), I_MINUS))])


def test_side_in_two_patches_is_refused():
    patch = [PatchSides.of(n, "wall", (np.array([0]), I_MINUS)) for n in ("a", "b")]
    with pytest.raises(InputError, match="'b' names a side"):
        Mesh.from_hexahedra(UNIT, np.arange(8)[None], patch)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: box_mesh((0, 1, 1)), "nx is 0"),
        (lambda: box_mesh((1, 1, 1), upper=(1.0, 0.0, 1.0)), "must be below"),
        (lambda: box_mesh((1, 1, 1), kinds="slip"), "kind is 'slip', must be one of wall, "),
        (lambda: box_mesh((1, 1, 1), kinds={"left": "wall"}), "'left', must be one of x_min"),
        (lambda: box_mesh((1, 1, 1), skew="wavy"), "must be one of none, smooth, random"),
        (lambda: box_mesh((1, 1, 1)).patch("fin"), "no patch 'fin'"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(InputError, match=message):
        call()


def test_save_and_load_give_the_same_mesh(tmp_path):
    mesh = box_mesh((3, 2, 4), skew="random", kinds={"x_min": "wall"})
    mesh.save(tmp_path / "box.npz")
    same = Mesh.load(tmp_path / "box.npz")
    for name in ("points", "face_offsets", "face_points", "owner", "neighbour", "face_moment", "cell_volume"):
        assert np.array_equal(getattr(mesh, name), getattr(same, name))
    assert same.patches == mesh.patches


def test_other_files_are_refused(tmp_path):
    with pytest.raises(InputError, match="does not exist"):
        Mesh.load(tmp_path / "none.npz")
    (tmp_path / "text.npz").write_text("no mesh")
    with pytest.raises(InputError, match="cannot be read as a mesh"):
        Mesh.load(tmp_path / "text.npz")
    np.savez(tmp_path / "old.npz", header='{"schema": "indicial.mesh", "schema_version": 0}', **{
        name: np.zeros(1) for name in ("points", "face_offsets", "face_points", "owner", "neighbour")
    })  # fmt: skip
    with pytest.raises(InputError, match="version 0, must be indicial"):
        Mesh.load(tmp_path / "old.npz")


def read_list(path):
    """Entries of an OpenFOAM list, as written one a line."""
    text = path.read_text()
    size, body = re.search(r"\n(\d+)\n\(\n(.*)\n\)\n$", text, re.S).groups()
    return int(size), body


def test_polymesh_files_read_back_to_the_same_mesh(tmp_path):
    mesh = box_mesh((3, 2, 4), skew="random", kinds={"z_min": "wall", "y_min": "symmetry"})
    mesh.to_polymesh(tmp_path)
    size, body = read_list(tmp_path / "points")
    points = np.array([[float(v) for v in line.strip("()").split()] for line in body.splitlines()])
    assert size == mesh.n_points
    assert np.array_equal(points, mesh.points)
    size, body = read_list(tmp_path / "faces")
    nodes = [[int(v) for v in re.match(r"\d+\((.*)\)", line)[1].split()] for line in body.splitlines()]
    assert size == mesh.n_faces == len(nodes)
    assert np.array_equal(np.concatenate(nodes), mesh.face_points)
    for name in ("owner", "neighbour"):
        assert np.array_equal(np.array(read_list(tmp_path / name)[1].split(), dtype=int), getattr(mesh, name))
    entries = re.findall(
        r"(\w+)\n\{\n    type (\w+);\n    nFaces (\d+);\n    startFace (\d+);", read_list(tmp_path / "boundary")[1]
    )
    assert [(n, int(c), int(s)) for n, _, c, s in entries] == [(p.name, p.size, p.start) for p in mesh.patches]
    types = {n: t for n, t, _, _ in entries}
    assert (types["z_min"], types["y_min"], types["x_min"]) == ("wall", "symmetry", "patch")
