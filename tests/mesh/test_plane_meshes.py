"""Plate and airfoil meshes: walls on the shape, mirror symmetry, quality."""

import numpy as np
import pytest

from indicial.cfd.mesh import airfoil_mesh, plate_mesh
from indicial.cfd.shapes import Airfoil
from indicial.errors import InputError

WIDE = {"n_chord": 40, "n_normal": 40, "ahead": 30.0, "behind": 30.0, "height": 30.0, "edge_spacing": 0.004}


def assert_closed(mesh, tolerance=1e-14):
    report = mesh.check()
    assert report.closure < tolerance
    assert report.moment_closure < tolerance
    return report


def mirrored_volumes_differ_by(mesh):
    """Largest relative difference of volumes between cells that are images of one another in z = 0."""
    centre = mesh.cell_centre
    digits = np.round(np.stack([centre[:, 0], np.abs(centre[:, 2])]), 9)
    order = np.lexsort((centre[:, 2] > 0, digits[1], digits[0]))
    pairs = mesh.cell_volume[order].reshape(-1, 2)
    assert np.all(np.diff(centre[order][:, 2].reshape(-1, 2), axis=1) > 0.0)
    return np.max(np.abs(pairs[:, 0] / pairs[:, 1] - 1.0))


@pytest.mark.parametrize("options", [{}, WIDE | {"wall_spacing": 0.004}])
def test_plate_is_a_slit_of_one_chord(options):
    mesh = plate_mesh(0.5, **options)
    assert_closed(mesh)
    for name, sign in (("upper", -1.0), ("lower", 1.0)):
        patch = mesh.patch(name)
        assert patch.kind == "wall"
        assert mesh.face_area[patch.faces].sum(axis=0) == pytest.approx([0.0, 0.0, sign * 0.5 * 0.5])
        assert np.abs(mesh.face_centre[patch.faces, 2]).max() == 0.0
        assert 0.0 < mesh.face_centre[patch.faces, 0].min() < mesh.face_centre[patch.faces, 0].max() < 0.5
    above, below = (mesh.owner[mesh.patch(n).faces] for n in ("upper", "lower"))
    assert np.all(mesh.cell_centre[above, 2] > 0.0)
    assert np.all(mesh.cell_centre[below, 2] < 0.0)
    ahead, behind, height = (options.get(n, d) for n, d in (("ahead", 0.3), ("behind", 0.1), ("height", 1.5)))
    assert mesh.cell_volume.sum() == pytest.approx(0.125 * (1 + ahead + behind) * 2 * height, rel=1e-12)


def test_plate_mesh_is_mirror_symmetric():
    assert mirrored_volumes_differ_by(plate_mesh(n_chord=20, n_normal=15)) < 1e-13


def test_plate_cells_run_downstream():
    mesh = plate_mesh(n_chord=20, n_normal=15)
    assert np.all(np.diff(mesh.cell_centre[:, 0]) > -1e-12)


def test_plate_spacings_are_those_asked_for():
    mesh = plate_mesh(n_chord=40, n_normal=30, edge_spacing=0.01, wall_spacing=0.02)
    wall = mesh.patch("upper")
    lengths = -mesh.face_area[wall.faces, 2]
    assert lengths[[0, -1]] == pytest.approx([0.01, 0.01], rel=0.15)
    first = mesh.cell_volume[mesh.owner[wall.faces]] / lengths
    assert first == pytest.approx(np.full(wall.size, 0.02))


@pytest.mark.parametrize("digits", ["0012", "0006", "2412", "4415"])
def test_airfoil_wall_lies_on_the_airfoil(digits):
    airfoil = Airfoil.naca(digits)
    mesh = airfoil_mesh(airfoil, n_around=64, n_normal=24)
    report = assert_closed(mesh)
    patch = mesh.patch("airfoil")
    nodes = np.unique(np.concatenate([mesh.face_nodes(f) for f in range(patch.start, patch.stop)]))
    wall = mesh.points[nodes]
    dense = np.cos(np.linspace(0.0, np.pi / 2, 40001)) ** 2
    for side in (1.0, -1.0):
        curve = airfoil.surface(dense, side)
        part = wall[
            np.sign(wall[:, 2] - np.interp(wall[:, 0], dense[::-1], airfoil.camber_line(dense[::-1])[0])) == side
        ]
        distance = np.min(np.hypot(*(part[:, None, [0, 2]] - curve[None]).transpose(2, 0, 1)), axis=1)
        assert distance.max() < 1e-4  # spacing of the dense points; the normal distance is below 1e-8
    tail = wall[np.argmax(wall[:, 0])]
    assert tail[[0, 2]] == pytest.approx([1.0, 0.0], abs=1e-14)
    assert report.non_orthogonality_deg < 12.0


def test_airfoil_area_converges_to_the_section_with_second_order():
    airfoil = Airfoil.naca("0012")
    errors = []
    for n in (40, 80, 160):
        mesh = airfoil_mesh(airfoil, n_around=n, n_normal=8, wall_aspect=0.5)
        faces = mesh.patch("airfoil").faces
        inside = -0.5 * np.einsum("ij,ij->", mesh.face_centre[faces][:, [0, 2]], mesh.face_area[faces][:, [0, 2]])
        errors.append(abs(inside - airfoil.area))
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.15)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(2.0, abs=0.15)


def test_symmetric_airfoil_has_a_mesh_that_is_mirror_symmetric_to_round_off():
    mesh = airfoil_mesh(Airfoil.naca("0012"), n_around=64, n_normal=24)
    images = mesh.points * [1.0, 1.0, -1.0] + 0.0
    key = [tuple(p) for p in mesh.points + 0.0]
    assert set(key) == {tuple(p) for p in images}
    assert mirrored_volumes_differ_by(mesh) < 1e-11
    faces = mesh.patch("airfoil").faces
    assert abs(mesh.face_area[faces, 2].sum()) < 1e-15


def test_airfoil_cells_on_the_wall_have_the_aspect_asked_for():
    mesh = airfoil_mesh(Airfoil.naca("0012"), n_around=128, n_normal=40, wall_aspect=0.5)
    patch = mesh.patch("airfoil")
    length = np.linalg.norm(mesh.face_area[patch.faces], axis=1)
    height = mesh.cell_volume[mesh.owner[patch.faces]] / length
    middle = np.abs(mesh.face_centre[patch.faces, 0] - 0.5) < 0.3
    assert (height / length)[middle] == pytest.approx(np.full(middle.sum(), 0.5), rel=0.15)


def test_airfoil_far_field_is_where_it_was_asked_for():
    mesh = airfoil_mesh(Airfoil.naca("0012"), 2.0, n_around=64, n_normal=24, farfield=30.0)
    centre = mesh.face_centre[mesh.patch("farfield").faces] - [1.0, 0.0, 0.0]
    distance = np.hypot(centre[:, 0], centre[:, 2])
    assert distance == pytest.approx(np.full(distance.size, 60.0), rel=0.02)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: plate_mesh(ahead=0.0), "ahead is 0.0, must be positive"),
        (lambda: plate_mesh(n_chord=0), "n_chord is 0"),
        (lambda: airfoil_mesh(Airfoil.naca("0012", closed_trailing_edge=False)), "must be True"),
        (lambda: airfoil_mesh(Airfoil(0.12), n_around=17), "n_around is 17, must be even"),
        (lambda: airfoil_mesh(Airfoil(0.12), farfield=1.0), "farfield is 1.0 chords"),
        (lambda: airfoil_mesh(Airfoil(0.12), n_around=20, n_normal=50), "overfill"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(InputError, match=message):
        call()
