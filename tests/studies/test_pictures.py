"""Pictures of the Finner's study: what they are drawn from is what was computed, and solids look like solids."""

import math

import numpy as np
import pytest

from indicial.cfd.field import FlowField
from indicial.cfd.mesh import finned_body_mesh
from indicial.errors import InputError
from indicial.history import History
from indicial.methods import forced_oscillation, indicial_response
from indicial.motion import FlightCondition
from indicial.report.solid import View, normals, whole
from indicial.report.style import figure_style
from indicial.studies import find_study
from indicial.studies.finner.figures import _PICTURES
from indicial.studies.finner.pitching_flow import WINDOW, Patch, PitchingFlow
from indicial.studies.finner.selection import derivative
from indicial.studies.finner.variants import FINNER
from indicial.studies.kept import Results

STUDY = find_study("finner")
KEPT = Results.kept("finner", STUDY.pieces)

CUBE = np.array(
    [
        [[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]],
        [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
        [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
        [[0, 1, 0], [0, 1, 1], [1, 1, 1], [1, 1, 0]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]],
        [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]],
    ],
    dtype=float,
)
"""Corners in an order whose right-handed normal points outwards."""


@pytest.fixture(scope="module")
def undisturbed() -> PitchingFlow:
    """Still air on a mesh of half a Finner at M 1.3 and an incidence."""
    mesh = finned_body_mesh(FINNER, 0.5, wake="sting")
    walls = np.concatenate([np.arange(mesh.n_faces)[patch.faces] for patch in mesh.patches if patch.kind == "wall"])
    one = np.ones(mesh.n_cells)
    condition = FlightCondition(1.3, alpha=math.radians(3.0))
    field = FlowField(mesh, condition, one, one, np.zeros((mesh.n_cells, 3)), one, walls, np.zeros(len(walls)))
    return PitchingFlow.of(field, FINNER.diameter, 0.01)


def test_undisturbed_air_has_the_flights_mach_number_everywhere(undisturbed):
    np.testing.assert_allclose(undisturbed.plane.values["mach"], 1.3, rtol=1e-12)
    np.testing.assert_allclose(undisturbed.plane.at_points("mach"), 1.3, rtol=1e-12)
    np.testing.assert_allclose(undisturbed.plane.values["cp"], 0.0, atol=1e-12)


def test_the_plane_is_the_plane_and_is_cut_off_far_away(undisturbed):
    points = undisturbed.plane.points
    np.testing.assert_allclose(points[:, 1], 0.0, atol=1e-9)
    centre = undisturbed.plane.corners.mean(axis=1)
    for axis, (low, high) in zip((0, 2), WINDOW, strict=True):
        assert low < centre[:, axis].min() < centre[:, axis].max() < high


def test_walls_of_the_half_and_its_mirror_image_look_outwards_and_leave_only_the_base_open(undisturbed):
    corners = whole(undisturbed.wall.corners)
    areas = -0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    assert np.all(areas[:, 0] < 1e-6)  # every face of nose, cylinder and wedges looks ahead or aside
    fins = FINNER.fins
    assert fins is not None
    open_end = math.pi / 4.0 + fins.number * fins.thickness_ratio * fins.root_chord * fins.span
    np.testing.assert_allclose(areas.sum(axis=0), [-open_end, 0.0, 0.0], atol=0.03 * open_end)


def test_a_flow_is_the_same_after_writing_and_reading(undisturbed, tmp_path):
    undisturbed.save(tmp_path / "flow.npz")
    again = PitchingFlow.load(tmp_path / "flow.npz")
    assert (again.mach, again.alpha, again.q) == (undisturbed.mach, undisturbed.alpha, undisturbed.q)
    for one, other in ((again.wall, undisturbed.wall), (again.plane, undisturbed.plane)):
        np.testing.assert_array_equal(one.quads, other.quads)
        np.testing.assert_allclose(one.points, other.points, atol=1e-6)
        assert one.values.keys() == other.values.keys()
        for name, values in one.values.items():
            np.testing.assert_allclose(values, other.values[name], atol=1e-6)


def test_another_archive_is_refused(tmp_path):
    np.savez(tmp_path / "flow.npz", schema_version=99)
    with pytest.raises(InputError, match="schema_version must be 1"):
        PitchingFlow.load(tmp_path / "flow.npz")


def test_values_at_points_are_means_of_the_faces_round_them():
    quads = np.array([[0, 1, 4, 3], [1, 2, 5, 4]], dtype=np.int32)
    patch = Patch(np.zeros((6, 3)), quads, {"cp": np.array([1.0, 3.0])})
    np.testing.assert_allclose(patch.at_points("cp"), [1.0, 2.0, 3.0, 1.0, 2.0, 3.0])


@pytest.mark.parametrize(("elevation", "seen"), [(0.4, {1, 2, 4}), (-0.4, {0, 2, 4})])
def test_of_a_cube_three_faces_are_seen_from_ahead_and_the_left(elevation, seen):
    """Nose to the left of the picture: the viewer is at y < 0, a negative azimuth goes towards the nose."""
    view = View(-0.5, elevation)
    np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(view.axes) == pytest.approx(1.0)
    towards = normals(CUBE) @ view.axes[2]
    assert {i for i, cosine in enumerate(towards) if cosine > 0.0} == seen
    assert view.axes[1, 2] > 0.0  # up is up
    assert view.axes[0, 0] > 0.0  # aft is to the right


def test_kept_loops_give_the_kept_derivatives_again():
    loops = [r for r in KEPT if r.piece.method.startswith("loop")]
    assert len(loops) == 6
    for result in loops:
        again = forced_oscillation.fourier(History.from_netcdf(result.file("loop"))).derivatives()
        for record in again:
            assert record.value == pytest.approx(derivative(result, record.name), rel=1e-9)


def test_kept_step_responses_give_the_kept_derivatives_again():
    steps = KEPT.select(method="steps")
    assert len(steps) == 3
    for result in steps:
        found = {}
        for kind in ("alpha", "q"):
            final = {name: derivative(result, f"{name}_{kind}") for name in ("CN", "Cm")}
            found[kind] = indicial_response.read(History.from_netcdf(result.file(kind)), final)
        again = indicial_response.derive(found["alpha"], found["q"])
        for name in ("CN_alphadot", "Cm_alphadot"):
            assert again[name] == pytest.approx(derivative(result, name), rel=1e-6)


def test_kept_flows_are_those_of_their_pieces():
    flows = KEPT.select(method="field")
    assert len(flows) == 3
    for result in flows:
        flow = PitchingFlow.load(result.file("flow"))
        assert (flow.mach, flow.q) == (result.piece.mach, result.piece.settings["q"])
        # a shock can slow the stream and an expansion hasten it, but both stay about the flight's Mach number
        assert flow.plane.values["mach"].min() < flow.mach < flow.plane.values["mach"].max()


def test_kept_loops_are_ellipses():
    """At the small amplitude of the pictures the last period lies on its first harmonic."""
    for result in (r for r in KEPT if r.piece.method.startswith("loop")):
        history = History.from_netcdf(result.file("loop"))
        omega = float(history.motion["omega"])
        last = history.time >= history.time[-1] - 2.0 * math.pi / omega * (1.0 + 1e-9)
        for name in ("CN", "Cm"):
            loads, phase = history[name][last], omega * history.time[last]
            waves = np.stack([np.ones_like(phase), np.sin(phase), np.cos(phase)], axis=1)
            left = loads - waves @ np.linalg.lstsq(waves, loads, rcond=None)[0]
            assert np.max(np.abs(left)) < 0.002 * 0.5 * np.ptp(loads)


def test_smaller_time_steps_change_forced_oscillations_less_than_half_a_percent():
    claims = [one for one in STUDY.claims(KEPT) if "U dt/d" in one.name]
    assert len(claims) == 2
    assert all(one.holds for one in claims)


def test_the_longer_the_march_at_mach_1_the_nearer_the_operator():
    exact = derivative(KEPT.select(method="operator_without_steps").results[0], "Cm_q", k=0.025)
    short, longer = (
        derivative(KEPT.select(method=name, level="quick").results[0], "Cm_q")
        for name in ("time_step_0.05", "fom_pitch_rate_longer")
    )
    assert abs(longer - exact) < abs(short - exact)
    assert longer == pytest.approx(exact, rel=0.005)


def test_nothing_is_drawn_of_nothing():
    with figure_style() as plt:
        assert all(draw(Results(()), plt) is None for draw in _PICTURES.values())
