"""Meshes about finned bodies and cones: closed, exact fins, second-order bodies, symmetry, numbering."""

from functools import cache

import numpy as np
import pytest

from indicial.cfd.mesh import RESOLUTIONS, WideDomain, cone_mesh, finned_body_mesh
from indicial.cfd.mesh.bow_shock import shock_angle
from indicial.cfd.shapes import Cone, FinnedBody, FinSet, Nose
from indicial.errors import InputError
from indicial.reference_data import read_table

FINNER = FinnedBody.basic_finner()
SWEPT = {"number": 4, "root_chord": 1.5, "span": 1.0, "leading_edge_sweep_deg": 30.0}
DOUBLE_WEDGE = FinSet(
    tip_chord=0.7, trailing_edge=8.0, section="double_wedge", thickness_ratio=0.06, **SWEPT
)  # fmt: skip
DELTA = FinSet(
    tip_chord=1.5 - np.tan(np.radians(30.0)), trailing_edge=9.0, section="single_wedge", thickness_ratio=0.08, **SWEPT
)
PLATES = FinSet(3, 1.0, 1.0, 1.0, trailing_edge=8.5, section="plate", roll_deg=17.0)
OGIVE = Nose("tangent_ogive", 3.0)
DOMAIN = WideDomain()

CASES = {
    "finner M1.5": (FINNER, {"mach": 1.5}),
    "finner M2": (FINNER, {"mach": 2.0}),
    "finner M4.5": (FINNER, {"mach": 4.5}),
    "finner full": (FINNER, {"mach": 2.0, "sector": "full"}),
    "finner rolled": (FinnedBody.basic_finner(roll_deg=13.7), {"mach": 2.0, "sector": "full"}),
    "finner +": (FinnedBody.basic_finner(roll_deg=0.0), {"mach": 3.0, "sector": "full"}),
    "finner quarter": (FINNER, {"mach": 2.0, "sector": "quarter"}),
    "double wedge": (FinnedBody(0.1, OGIVE, 10.0, DOUBLE_WEDGE), {"mach": 2.0}),
    "delta": (FinnedBody(0.1, Nose("cone", 3.0), 9.0, DELTA), {"mach": 3.0}),
    "three plates": (FinnedBody(0.1, OGIVE, 9.0, PLATES), {"mach": 2.0, "sector": "full"}),
    "no fins": (FinnedBody(0.1, OGIVE, 8.0), {"mach": 2.0, "sector": "full"}),
    "cone": (Cone(10.0).body(), {"mach": 2.0, "sector": "quarter"}),
    "wide cone": (Cone(25.0).body(), {"mach": 2.5}),
    "sting": (FINNER, {"wake": "sting"}),
    "sting full": (FINNER, {"wake": "sting", "sector": "full"}),
    "sting quarter": (FINNER, {"wake": "sting", "sector": "quarter"}),
    "double wedge sting": (FinnedBody(0.1, OGIVE, 10.0, DOUBLE_WEDGE), {"wake": "sting"}),
    "delta sting": (FinnedBody(0.1, Nose("cone", 3.0), 11.0, DELTA), {"wake": "sting"}),
    "three plates sting": (FinnedBody(0.1, OGIVE, 9.0, PLATES), {"wake": "sting", "sector": "full"}),
    "no fins sting": (FinnedBody(0.1, OGIVE, 8.0), {"wake": "sting", "sector": "full"}),
}


@cache
def made(case, resolution="quick"):
    body, options = CASES[case]
    return finned_body_mesh(body, resolution, **options)


def wall_faces(mesh, *names):
    return np.concatenate([np.arange(p.start, p.stop) for p in mesh.patches if p.name in names])


def patch_nodes(mesh, name):
    patch = mesh.patch(name)
    return mesh.points[np.unique(np.concatenate([mesh.face_nodes(f) for f in range(patch.start, patch.stop)]))]


def fin_axes(mesh, points, angle):
    """Coordinates along x, along the span and normal to a fin at that azimuth."""
    c, s = np.cos(angle), np.sin(angle)
    return points @ np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("resolution", ["quick", 1.5])
def test_mesh_is_closed_positive_and_of_fair_quality(case, resolution):
    report = made(case, resolution).check()
    assert report.closure < 1e-14
    assert report.moment_closure < 1e-14
    assert report.smallest_cell > 0.0
    assert report.non_orthogonality_deg < 60.0


@pytest.mark.slow
@pytest.mark.parametrize("mach", [1.5, 2.0, 3.0, 4.5])
@pytest.mark.parametrize("resolution", ["medium", "fine"])
def test_finer_finner_meshes_are_closed_and_positive(mach, resolution):
    report = finned_body_mesh(FINNER, resolution, mach=mach).check()
    assert report.closure < 1e-14
    assert report.moment_closure < 1e-14
    assert report.non_orthogonality_deg < 60.0


def test_quick_half_finner_has_about_ten_thousand_cells():
    assert 9000 <= made("finner M2").n_cells <= 11000


@pytest.mark.parametrize("case", CASES)
def test_boundary_is_closed(case):
    mesh = made(case)
    assert np.abs(mesh.face_area[mesh.n_interior :].sum(axis=0)).max() < 1e-14 * np.abs(mesh.face_area).sum()
    assert np.abs(mesh.face_moment[mesh.n_interior :].sum(axis=0)).max() < 1e-14 * np.abs(mesh.face_moment).sum()


@pytest.mark.parametrize("case", CASES)
def test_cells_are_numbered_downstream(case):
    mesh = made(case)
    n = mesh.n_interior
    axial = mesh.face_area[:n, 0] / np.linalg.norm(mesh.face_area[:n], axis=1)
    assert np.all(axial[np.abs(axial) > 0.9] > 0.0)


@pytest.mark.parametrize(
    "case", ["finner M2", "finner full", "finner rolled", "finner +", "finner quarter", "sting", "sting full"]
)
def test_finner_fins_have_their_exact_planform_wedge_and_tip(case):
    mesh, body = made(case), CASES[case][0]
    names = [p.name for p in mesh.patches if p.name.startswith("fin")]
    assert len(names) == {"full": 4, "half": 2, "quarter": 1}[CASES[case][1].get("sector", "half")]
    slope = 0.04
    for name in names:
        angle = body.fins.angles[int(name[3:]) - 1]
        nodes = fin_axes(mesh, patch_nodes(mesh, name) / body.diameter, angle)
        assert nodes[:, 0].min() == pytest.approx(9.0, abs=1e-12)
        assert nodes[:, 0].max() == pytest.approx(10.0, abs=1e-12)
        assert nodes[:, 1].max() == pytest.approx(1.5, abs=1e-12)
        assert np.abs(nodes[:, 2]) == pytest.approx(slope * (nodes[:, 0] - 9.0), abs=1e-12)
        assert np.hypot(nodes[:, 1], nodes[:, 2]).min() == pytest.approx(0.5, abs=1e-12)
        faces = mesh.patch(name).faces
        area = fin_axes(mesh, mesh.face_area[faces], angle) / body.diameter**2
        unit = area / np.linalg.norm(area, axis=1, keepdims=True)
        tip = np.abs(unit[:, 1]) > 0.9
        assert area[tip].sum(axis=0) == pytest.approx([0.0, -0.04, 0.0], abs=1e-12)
        assert np.abs(unit[tip]) == pytest.approx(np.tile([0.0, 1.0, 0.0], (tip.sum(), 1)), abs=1e-9)
        flat = np.array([slope, 0.0, 1.0]) / np.hypot(slope, 1.0)
        assert np.abs(unit[~tip]) == pytest.approx(np.tile(flat, ((~tip).sum(), 1)), abs=1e-9)
        # Planform of one face: span from the foot on the cylinder, sqrt(1/4 - h^2), to the tip
        x = np.linspace(0.0, 1.0, 2001)
        exact = np.trapezoid(1.5 - np.sqrt(0.25 - (slope * x) ** 2), x)
        assert -area[~tip & (area[:, 2] < 0.0), 2].sum() == pytest.approx(exact, rel=1e-5)
        assert area[~tip & (area[:, 2] > 0.0), 2].sum() == pytest.approx(exact, rel=1e-5)


@pytest.mark.parametrize("wake", ["", " sting"])
@pytest.mark.parametrize(("case", "fins"), [("double wedge", DOUBLE_WEDGE), ("delta", DELTA), ("three plates", PLATES)])
def test_other_fins_have_their_planform_and_section(case, fins, wake):
    mesh, body = made(case + wake), CASES[case + wake][0]
    nodes = fin_axes(mesh, patch_nodes(mesh, "fin1") / body.diameter, fins.angles[0])
    fraction = (nodes[:, 1] - 0.5) / fins.span
    chordwise = (nodes[:, 0] - fins.leading_edge(fraction)) / fins.chord(fraction)
    assert chordwise.min() == pytest.approx(0.0, abs=1e-9)
    assert chordwise.max() == pytest.approx(1.0, abs=1e-9)
    half = fins.half_thickness(np.clip(chordwise, 0.0, 1.0)) * fins.chord(fraction)
    assert np.abs(nodes[:, 2]) == pytest.approx(half, abs=1e-9)
    area = fin_axes(mesh, mesh.face_area[mesh.patch("fin1").faces], fins.angles[0]) / body.diameter**2
    assert area[area[:, 2] > 0.0, 2].sum() == pytest.approx(fins.planform_area, rel=2e-3)


def test_body_nodes_lie_on_the_body():
    for case in ("finner M2", "double wedge", "delta", "no fins"):
        mesh, body = made(case), CASES[case][0]
        nodes = patch_nodes(mesh, "body") / body.diameter
        assert np.hypot(nodes[:, 1], nodes[:, 2]) == pytest.approx(body.radius(nodes[:, 0]), abs=1e-13)
        assert nodes[:, 0].min() == 0.0
        assert nodes[:, 0].max() == pytest.approx(body.length)


def test_a_sting_goes_on_from_the_body_and_a_needle_leads_to_it():
    for case in ("sting", "double wedge sting", "delta sting", "no fins sting"):
        mesh, body = made(case), CASES[case][0]
        nodes = patch_nodes(mesh, "body") / body.diameter
        assert np.hypot(nodes[:, 1], nodes[:, 2]) == pytest.approx(body.radius(nodes[:, 0]), abs=1e-13)
        assert np.hypot(*nodes[nodes[:, 0] == nodes[:, 0].min()][:, 1:].T) == pytest.approx(DOMAIN.needle)
        assert nodes[:, 0].max() == pytest.approx(body.length)
        sting = patch_nodes(mesh, "sting") / body.diameter
        radius = np.hypot(sting[:, 1], sting[:, 2])
        ahead, behind = sting[:, 0] < 1.0, sting[:, 0] > body.length + 1e-9
        assert radius[ahead] == pytest.approx(DOMAIN.needle)
        assert radius[behind] == pytest.approx(0.5)
        assert sting[:, 0].min() == pytest.approx(-DOMAIN.upstream)
        assert sting[:, 0].max() == pytest.approx(body.length + DOMAIN.downstream)


def test_the_flat_ends_of_wedge_fins_belong_to_the_sting():
    """Walls then have the force in a constant pressure that they have without a wake, but for the nose's very tip."""
    sting, none = made("sting"), made("finner M2")
    area = {mesh: mesh.face_area[wall_faces(mesh, "fin1", "fin4")].sum(axis=0) for mesh in (sting, none)}
    assert area[sting] == pytest.approx(area[none], abs=1e-12 * 0.03**2)
    axial = {mesh: mesh.face_area[wall_faces(mesh, "body"), 0].sum() for mesh in (sting, none)}
    tip = 0.5 * np.pi * DOMAIN.needle**2 * 0.03**2
    assert axial[none] - axial[sting] == pytest.approx(tip, rel=0.02)
    ends = sting.patch("sting").faces
    flat = sting.face_area[ends][np.abs(sting.face_centre[ends, 0] - 0.3) < 1e-9]
    chord_thickness = 0.08 * (1.5 - np.sqrt(0.25 - 0.04**2 / 3.0))
    assert flat[:, 0].sum() == pytest.approx(-2.0 * chord_thickness * 0.03**2, rel=2e-3)


def test_the_wide_domain_is_a_cylinder():
    mesh = made("sting")
    far = patch_nodes(mesh, "farfield") / 0.03
    inside = (far[:, 0] > -DOMAIN.upstream + 1e-9) & (far[:, 0] < 10.0 + DOMAIN.downstream - 1e-9)
    assert np.hypot(far[inside, 1], far[inside, 2]) == pytest.approx(DOMAIN.radius)
    assert {p.name: p.kind for p in mesh.patches} == {
        "body": "wall", "fin1": "wall", "fin4": "wall", "farfield": "farfield", "sting": "sting",
        "symmetry": "symmetry",
    }  # fmt: skip


def test_cone_with_even_columns_has_the_volume_and_area_of_its_pyramid():
    cone = Cone(10.0, 0.7)
    mesh = cone_mesh(cone, "quick", mach=2.0)
    faces = mesh.patch("body").faces
    step = np.pi / 16
    base = cone.base_area / 2.0 * np.sin(step) / step
    assert -mesh.face_area[faces, 0].sum() == pytest.approx(-base, rel=1e-12)
    walls = -np.einsum("ij,ij->", mesh.face_centre[faces], mesh.face_area[faces]) / 3.0
    assert walls + base * cone.length / 3.0 == pytest.approx(base * cone.length / 3.0, rel=1e-9)
    slant = np.hypot(cone.length, 0.5 * cone.base_diameter * np.cos(step / 2.0))
    triangle = 0.5 * cone.base_diameter * np.sin(step / 2.0) * slant
    assert np.linalg.norm(mesh.face_area[faces], axis=1).sum() == pytest.approx(16 * triangle, rel=1e-12)


@pytest.mark.parametrize("case", ["no fins", "finner M2"])
def test_enclosed_volume_and_wetted_area_converge_with_second_order(case):
    body = CASES[case][0]
    share = 1.0 if CASES[case][1].get("sector") == "full" else 0.5
    if body.fins is None:
        volume, wetted = share * body.body_volume, share * body.lateral_area
    else:
        body = FinnedBody(body.diameter, body.nose, 8.0)  # the part ahead of the fins
        volume, wetted = 0.5 * body.body_volume, 0.5 * body.lateral_area
    errors = []
    for factor in (0.5, 1.0, 2.0):
        mesh = finned_body_mesh(body, factor, mach=2.0, sector="full" if share == 1.0 else "half")
        area, centre = (a[mesh.patch("body").faces] for a in (mesh.face_area, mesh.face_centre))
        base = area[:, 0].sum()
        inside = (base * body.length * body.diameter - np.einsum("ij,ij->", centre, area)) / 3.0
        errors.append([abs(inside / volume - 1.0), abs(np.linalg.norm(area, axis=1).sum() / wetted - 1.0)])
    rates = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    assert rates == pytest.approx(np.full((2, 2), 2.0), abs=0.2)
    assert max(errors[-1]) < 3e-3


def test_half_mesh_is_its_own_mirror_image_in_z():
    mesh = made("finner M2")
    order, image = (np.lexsort(np.round(mesh.points * [1.0, 1.0, sign] / 0.03, 10).T + 0.0) for sign in (1.0, -1.0))
    assert mesh.points[order] == pytest.approx(mesh.points[image] * [1.0, 1.0, -1.0], abs=1e-14)
    volumes = np.sort(mesh.cell_volume)
    assert volumes[::2] == pytest.approx(volumes[1::2], rel=1e-9)


def test_full_mesh_is_two_halves_and_does_not_depend_on_roll():
    half, full, rolled, quarter = (made(c) for c in ("finner M2", "finner full", "finner rolled", "finner quarter"))
    assert full.n_cells == 2 * half.n_cells == 4 * quarter.n_cells
    assert made("sting full").n_cells == 2 * made("sting").n_cells == 4 * made("sting quarter").n_cells
    assert full.cell_volume.sum() == pytest.approx(2.0 * half.cell_volume.sum(), rel=1e-12)
    assert np.sort(full.cell_volume) == pytest.approx(np.sort(rolled.cell_volume), rel=1e-9)
    assert np.sort(full.cell_volume)[::2] == pytest.approx(np.sort(half.cell_volume), rel=1e-9)


def test_symmetry_planes_are_exact():
    mesh = made("finner quarter")
    assert np.all(mesh.points[:, 1] >= 0.0)
    assert np.all(mesh.points[:, 2] >= 0.0)
    assert np.abs(patch_nodes(mesh, "symmetry")[:, 1]).max() == 0.0
    assert np.abs(patch_nodes(mesh, "symmetry_z")[:, 2]).max() == 0.0


def test_patches_have_their_kinds_and_places():
    mesh = made("finner M2")
    assert {p.name: p.kind for p in mesh.patches} == {
        "body": "wall", "fin1": "wall", "fin4": "wall", "farfield": "farfield", "outflow": "outflow",
        "symmetry": "symmetry",
    }  # fmt: skip
    assert np.all(mesh.face_centre[mesh.patch("outflow").faces, 0] == pytest.approx(0.3))
    assert np.all(mesh.face_centre[mesh.patch("fin1").faces, 2] > 0.0)
    assert np.all(mesh.face_centre[mesh.patch("fin4").faces, 2] < 0.0)
    assert np.all(mesh.face_area[mesh.patch("outflow").faces, 0] > 0.0)


@pytest.mark.parametrize("mach", [1.5, 2.0, 4.5])
def test_outer_boundary_lies_outside_the_bow_shock_until_nothing_can_return(mach):
    mesh = made(f"finner M{mach:g}")
    nodes = patch_nodes(mesh, "farfield") / 0.03
    outer = np.array([np.hypot(*nodes[nodes[:, 0] == x][:, 1:].T).max() for x in np.unique(nodes[:, 0])])
    x = np.unique(nodes[:, 0])
    slope = np.tan(shock_angle(mach, np.radians(10.0)))
    leaves = np.flatnonzero(outer < slope * x)
    if leaves.size:
        first = leaves[0]
        assert x[first] + (outer[first] - 1.5) / slope >= 10.0


def test_shock_angle_is_close_above_the_taylor_maccoll_solution():
    table = read_table("cone_exact")
    rows = zip(*(table.numbers(n) for n in ("sigma_deg", "M", "shock_deg")), strict=True)
    checked = 0
    for sigma, mach, exact in rows:
        if 1.5 <= mach <= 6.0 and 5.0 <= sigma <= 20.0:
            angle = np.degrees(shock_angle(mach, np.radians(sigma)))
            assert 0.1 < angle - exact < 1.5
            checked += 1
    assert checked > 20


def test_presets_refine_by_a_constant_ratio():
    factors = list(RESOLUTIONS.values())
    assert np.diff(np.log(factors)) == pytest.approx(np.log(1.5))
    quick, double = made("finner M2"), made("finner M2", 2.0)
    assert double.n_cells / quick.n_cells == pytest.approx(8.0, rel=0.03)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: finned_body_mesh(FINNER, "best", mach=2.0), "resolution is 'best', must be one of quick"),
        (lambda: finned_body_mesh(FINNER, 0.0, mach=2.0), "resolution is 0.0, must be positive"),
        (lambda: finned_body_mesh(FINNER, "quick", mach=0.9), "mach is 0.9, must be above 1"),
        (lambda: finned_body_mesh(Cone(40.0).body(), "quick", mach=1.5), "detached"),
        (lambda: finned_body_mesh(FINNER, "quick", mach=2.0, margin=0.9), "margin is 0.9"),
        (lambda: finned_body_mesh(FINNER, "quick"), "mach is missing"),
        (
            lambda: finned_body_mesh(FINNER, "quick", mach=2.0, wake="free"),
            "wake is 'free', must be one of none, sting",
        ),
        (lambda: WideDomain(upstream=0.0), "upstream is 0.0, must be positive"),
        (
            lambda: finned_body_mesh(FINNER, "quick", wake="sting", domain=WideDomain(radius=2.0)),
            "radius is 2.0, must be above 3 calibres",
        ),
        (lambda: finned_body_mesh(FINNER, "quick", wake="sting", domain=WideDomain(needle=0.2)), "needle is 0.2"),
        (lambda: finned_body_mesh(FINNER, "quick", mach=2.0, sector="eighth"), "must be one of full, half, quarter"),
        (
            lambda: finned_body_mesh(FinnedBody.basic_finner(roll_deg=90.0), "quick", mach=2.0),
            "a fin lies in the symmetry plane y = 0",
        ),
        (
            lambda: finned_body_mesh(FinnedBody.basic_finner(roll_deg=20.0), "quick", mach=2.0),
            "fins are not symmetric about y = 0",
        ),
        (
            lambda: finned_body_mesh(FinnedBody(0.1, OGIVE, 12.0, DELTA), "quick", mach=2.0),
            "trailing edge at the body's base",
        ),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(InputError, match=message):
        call()
