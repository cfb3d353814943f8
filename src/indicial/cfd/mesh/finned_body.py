r"""A structured mesh wrapped round a finned body in a supersonic stream.

One block of planes along x, radial levels and azimuthal columns. It begins in the plane of the nose's tip: the stream
ahead of an attached bow shock is undisturbed, and wedge-shaped cells round the axis would only be in the way (least
squares gradients are unstable on them). A fin is a column of nodes split into two sheets, one for each of its faces.
Above the tip the sheets close over a few levels, and the gap between them is one column of cells standing on the flat
tip, the last of them prisms. So the flat faces, the tip and the thickness of the fins are exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from indicial.cfd.mesh.bow_shock import influence_limit, outer_radius, shock_angle
from indicial.cfd.mesh.geometry import Array, Index
from indicial.cfd.mesh.hexahedra import I_MINUS, I_PLUS, J_MINUS, J_PLUS, K_MINUS, K_PLUS, PatchSides
from indicial.cfd.mesh.mesh import Mesh
from indicial.cfd.mesh.sectors import Extent, Sector, split_into_sectors
from indicial.cfd.mesh.stations import (
    Anchor,
    axial_stations,
    azimuthal_fractions,
    plain_levels,
    smooth_step,
    tip_levels,
)
from indicial.cfd.mesh.structured import block_hexahedra, block_nodes, positive
from indicial.cfd.shapes.cone import Cone
from indicial.cfd.shapes.finned_body import FinnedBody
from indicial.cfd.shapes.fins import FinSet
from indicial.errors import InputError

Resolution = Literal["quick", "coarse", "medium", "fine"]
RESOLUTIONS: dict[Resolution, float] = {"quick": 1.0, "coarse": 1.5, "medium": 2.25, "fine": 3.375}
"""Cells along each direction relative to the quick mesh: each preset has 1.5 times as many as the one before."""

NOSE_STEP = 0.025
"""First step behind the tip, and radius of the inflow disc there, over the nose's length, on the quick mesh."""

SPAN_CELLS, OUTER_CELLS, PLAIN_CELLS, QUADRANT_CELLS = 7, 8, 16, 8
"""Quick mesh: cells along a fin's span, beyond its tip, from a finless body outwards, round 90 degrees."""


def finned_body_mesh(
    body: FinnedBody,
    resolution: Resolution | float = "coarse",
    *,
    mach: float,
    sector: Extent = "half",
    margin: float = 1.15,
) -> Mesh:
    """Mesh about a body with or without fins, from the plane of its tip to that of its base.

    Patches: "body", "fin1", "fin2", ... (walls; number n is the n-th of `FinSet.angles`, both faces and the tip),
    "farfield" (inflow and outer boundary), "outflow" (the plane of the base), and, on a sector, "symmetry"
    (plane y = 0) and "symmetry_z" (z = 0). The flat base is not part of the mesh. Cells are numbered plane by plane
    along x, within a plane along the radius first.

    The outer boundary lies outside the bow shock by `margin`, up to the radius beyond which waves can no longer
    return to the body (`influence_limit`, times `margin`).

    Parameters
    ----------
    body : FinnedBody
        Single-wedge fins must end at the base.
    resolution : "quick", "coarse", "medium", "fine" or float
        About 9,100, 31,000, 104,000 and 353,000 cells for half a Basic Finner; a number is the ratio of cells along
        every direction to those of "quick".
    mach : float
        Mach number [-], above 1 with an attached bow shock. The outflow plane asks for about 1.4 or more.
    sector : {"half", "full", "quarter"}
        "half" is y >= 0, "quarter" y, z >= 0 (an axisymmetric or doubly symmetric flow only).
    margin : float
        At least 1.

    Raises
    ------
    InputError
        If the fins do not suit the sector or the mesh, the shock is detached, or a parameter is out of range.
    """
    factor = resolution_factor(resolution)
    if not margin >= 1.0:
        raise InputError(f"margin is {margin}, must be at least 1")
    sectors = split_into_sectors(body.fins, sector)
    frame = _frame(body, factor, mach, margin)
    columns = [_columns(s, factor) for s in sectors]
    blocks = [_sector_nodes(frame, s, f, body.fins) for s, f in zip(sectors, columns, strict=True)]
    points = np.concatenate(blocks, axis=2)
    _close_planes(points, body, sector)
    return _assemble(frame, points, sectors, [f.size for f in columns], sector).scaled(body.diameter)


def cone_mesh(
    cone: Cone,
    resolution: Resolution | float = "coarse",
    *,
    mach: float,
    sector: Extent = "half",
    margin: float = 1.15,
) -> Mesh:
    """Mesh about a cone, ending at its base: `finned_body_mesh` of ``cone.body()``."""
    return finned_body_mesh(cone.body(), resolution, mach=mach, sector=sector, margin=margin)


def resolution_factor(resolution: Resolution | float) -> float:
    """Ratio of cells along each direction to those of the quick mesh."""
    if isinstance(resolution, str):
        if resolution not in RESOLUTIONS:
            raise InputError(f"resolution is {resolution!r}, must be one of {', '.join(RESOLUTIONS)} or a number")
        return RESOLUTIONS[resolution]
    return positive("resolution", resolution)


@dataclass(frozen=True)
class _Frame:
    """Planes and levels of the block [calibres]: nodes away from the fins, and on their sheets.

    x, s : (ni, nj) axial station and radius away from the fins; sheet_x, sheet_s, sheet_h : the same and the half
    gap on the sheets, s and h measured along and normal to the fin. The fins take planes `lead` to `trail` and
    levels 0 to `tip`; the gap is closed again at level `closed`.
    """

    x: Array
    s: Array
    sheet_x: Array
    sheet_s: Array
    sheet_h: Array
    lead: int
    trail: int
    tip: int
    closed: int


def _frame(body: FinnedBody, factor: float, mach: float, margin: float) -> _Frame:
    slope = margin * math.tan(shock_angle(mach, body.nose.tip_half_angle))
    fins = body.fins
    largest = 0.5 if fins is None else 0.5 + fins.span
    planes, lead, trail = _planes(body, factor)
    first = NOSE_STEP * body.nose.length
    if fins is not None:
        slope = max(slope, (1.3 * largest - first) / fins.root_leading_edge)
    beta = shock_angle(mach, body.nose.tip_half_angle)
    limit = max(1.5 * largest, margin * influence_limit(body.length, largest, beta))
    outer = outer_radius(planes, first=first, slope=slope, limit=limit)
    inner = body.radius(planes)
    if fins is None:
        s = plain_levels(inner, outer, max(2, round(PLAIN_CELLS * factor)))
        x = np.broadcast_to(planes[:, None], s.shape)
        return _Frame(x, s, x, s, np.zeros_like(s), 0, 0, 0, 0)
    n_span, n_outer = max(2, round(SPAN_CELLS * factor)), max(2, round(OUTER_CELLS * factor))
    s = _levels_with_tip(body, fins, planes, inner, outer, n_span, n_outer)
    closed = n_span + max(1, round(factor)) if fins.thickness_ratio > 0.0 else n_span
    return _with_sheets(fins, planes, s, lead, trail, n_span, closed)


def _planes(body: FinnedBody, factor: float) -> tuple[Array, int, int]:
    """Axial stations [calibres], and the indices of the fins' leading and trailing edges."""
    nose, fins = body.nose, body.fins
    tip_step, largest = NOSE_STEP * nose.length, 0.6
    anchors = [Anchor(0.0, tip_step, min(largest, 0.1 * nose.length))]
    if nose.length < body.length * (1.0 - 1e-9):
        anchors.append(Anchor(nose.length, min(0.16, 0.1 * nose.length), largest))
    edges = [0.0, 0.0]
    if fins is not None:
        chord, edges = fins.root_chord, [fins.root_leading_edge, fins.trailing_edge]
        if edges[0] <= anchors[-1].x + 1e-9:
            anchors.pop()
        anchors.append(Anchor(edges[0], 0.08 * chord, 0.12 * chord))
        if fins.section == "double_wedge":
            anchors.append(Anchor(0.5 * (edges[0] + edges[1]), 0.09 * chord, 0.12 * chord))
        anchors.append(Anchor(edges[1], 0.12 * chord, largest))
    if anchors[-1].x < body.length - 1e-9:
        anchors.append(Anchor(body.length, largest, largest))
    stations, at = axial_stations(anchors, factor)
    index = {anchor.x: i for anchor, i in zip(anchors, at, strict=True)}
    return stations, index[edges[0]], index[edges[1]]


def _levels_with_tip(
    body: FinnedBody, fins: FinSet, planes: Array, inner: Array, outer: Array, n_span: int, n_outer: int
) -> Array:
    """Radial levels (ni, nj): plain near the nose, with a level exactly at the fins' tips along the fins."""
    tip = np.minimum(0.5 + fins.span, inner + 0.6 * (outer - inner))
    start = min(body.nose.length, fins.root_leading_edge - 1.0)
    end = max(fins.root_leading_edge - 0.5, 0.5 * (start + fins.root_leading_edge))
    weight = smooth_step(planes, start, end)[:, None]
    plain = plain_levels(inner, outer, n_span + n_outer)
    levels = (1.0 - weight) * plain + weight * tip_levels(inner, tip, outer, n_span, n_outer)
    levels[:, 0] = inner
    return levels


def _with_sheets(fins: FinSet, planes: Array, s: Array, lead: int, trail: int, tip: int, closed: int) -> _Frame:
    """Place the nodes of the fins' sheets, and shear the planes along swept edges."""
    ends_at_base = trail == planes.size - 1
    shift_lead = float(fins.leading_edge(1.0) - fins.leading_edge(0.0))
    shift_trail = shift_lead + fins.tip_chord - fins.root_chord
    if fins.section == "single_wedge" and not ends_at_base:
        raise InputError("a mesh of single-wedge fins needs their trailing edge at the body's base")
    if ends_at_base and abs(shift_trail) > 1e-9:
        raise InputError("fins that end at the base must have an unswept trailing edge for this mesh")
    if not ends_at_base and shift_trail > 0.8 * (planes[-1] - planes[trail]):
        raise InputError("the fins' swept trailing edge reaches too near the base for this mesh")
    chordwise = np.clip((planes - planes[lead]) / (planes[trail] - planes[lead]), 0.0, 1.0)
    in_chord = (np.arange(planes.size) >= lead) & (np.arange(planes.size) <= trail)
    blend = planes[lead] - max(1.0, 2.0 * shift_lead)
    ahead = np.clip((planes - blend) / (planes[lead] - blend), 0.0, 1.0)
    behind = np.ones(planes.size)
    if not ends_at_base:
        behind = np.clip((planes[-1] - planes) / (planes[-1] - planes[trail]), 0.0, 1.0)
    shear = ((1.0 - chordwise) * shift_lead + chordwise * shift_trail) * ahead * behind

    def half_gap(fraction: Array) -> Array:
        section = np.where(in_chord, fins.half_thickness(chordwise), 0.0)
        return section[:, None] * fins.chord(np.minimum(fraction, 1.0))

    fraction = np.clip((s - s[:, :1]) / fins.span, 0.0, 1.0)
    root = s[:, :1].copy()
    for _ in range(30):  # the sheets' feet lie on the cylinder: a contraction by about (thickness)^2 a pass
        root = np.sqrt(s[:, :1] ** 2 - half_gap((root - s[:, :1]) / fins.span) ** 2)
    on_fin = np.arange(s.shape[1]) <= tip
    sheet_s = np.where(on_fin, s - (s[:, :1] - root) * (1.0 - fraction), s)
    sheet_fraction = np.where(on_fin, (sheet_s - s[:, :1]) / fins.span, 1.0)
    closing = np.ones(s.shape[1])
    if closed > tip:
        closing = np.clip((closed - np.arange(s.shape[1])) / (closed - tip), 0.0, 1.0)
    return _Frame(
        x=planes[:, None] + shear[:, None] * fraction,
        s=s,
        sheet_x=planes[:, None] + shear[:, None] * sheet_fraction,
        sheet_s=sheet_s,
        sheet_h=half_gap(sheet_fraction) * closing,
        lead=lead,
        trail=trail,
        tip=tip,
        closed=closed,
    )


def _columns(sector: Sector, factor: float) -> Array:
    """Fractions of the sector at which its columns stand."""
    n = max(2, round(QUADRANT_CELLS * factor * (sector.end - sector.start) / (0.5 * np.pi)))
    return azimuthal_fractions(n, sector.start_fin is not None, sector.end_fin is not None)


def _sector_nodes(frame: _Frame, sector: Sector, fractions: Array, fins: FinSet | None) -> Array:
    """Nodes (ni, nj, nk, 3) of one sector, from sheet to sheet or plane of symmetry."""
    x_a, angle_a, r_a = _edge(frame, sector.start, sector.start_fin, 1.0)
    x_b, angle_b, r_b = _edge(frame, sector.end, sector.end_fin, -1.0)
    reach = 0.5 if sector.start_fin is not None and sector.end_fin is not None else 1.0
    near_a, near_b = (np.maximum(0.0, 1.0 - away / reach) ** 3 for away in (fractions, 1.0 - fractions))
    x = frame.x[..., None] + (x_a - frame.x)[..., None] * near_a + (x_b - frame.x)[..., None] * near_b
    radius = frame.s[..., None] + (r_a - frame.s)[..., None] * near_a + (r_b - frame.s)[..., None] * near_b
    azimuth = angle_a[..., None] * (1.0 - fractions) + angle_b[..., None] * fractions
    points = np.stack([x, radius * np.cos(azimuth), radius * np.sin(azimuth)], axis=-1)
    if fins is not None:
        for k, fin, side in ((0, sector.start_fin, 1.0), (-1, sector.end_fin, -1.0)):
            if fin is not None:
                _place_sheet(points[:, :, k], frame, float(fins.angles[fin]), side)
    return points


def _edge(frame: _Frame, azimuth: float, fin: int | None, side: float) -> tuple[Array, Array, Array]:
    """Axial station, azimuth and radius (ni, nj) of the nodes at one end of a sector."""
    if fin is None:
        return frame.x, np.full_like(frame.s, azimuth), frame.s
    turn = np.arctan2(side * frame.sheet_h, frame.sheet_s)
    return frame.sheet_x, azimuth + turn, np.hypot(frame.sheet_s, frame.sheet_h)


def _place_sheet(points: Array, frame: _Frame, azimuth: float, side: float) -> None:
    """Put nodes on one face of a fin, in the fin's own axes: both faces agree to the last bit where they meet."""
    cosine, sine = math.cos(azimuth), math.sin(azimuth)
    points[..., 0] = frame.sheet_x
    points[..., 1] = frame.sheet_s * cosine - side * frame.sheet_h * sine
    points[..., 2] = frame.sheet_s * sine + side * frame.sheet_h * cosine


def _close_planes(points: Array, body: FinnedBody, sector: Extent) -> None:
    """Put nodes exactly on the planes of symmetry, or close the full circle of a body without fins."""
    if sector == "full":
        if body.fins is None:
            points[:, :, -1] = points[:, :, 0]
        return
    points[:, :, -1, 1] = 0.0
    points[:, :, 0, 1 if sector == "half" else 2] = 0.0


def _assemble(frame: _Frame, points: Array, sectors: list[Sector], sizes: list[int], sector: Extent) -> Mesh:
    """Number cells plane by plane, keep the gap columns only above the tips, and name the boundary."""
    nodes = block_nodes(*points.shape[:3])
    gaps = np.cumsum(sizes) - 1
    if sector == "full" and sectors[0].start_fin is not None:
        nodes = np.concatenate([nodes, nodes[:, :, :1]], axis=2)
    else:
        gaps = gaps[:-1]
    cells = block_hexahedra(nodes)
    keep = np.ones(cells.shape[:3], dtype=bool)
    keep[:, :, gaps] = False
    keep[frame.lead : frame.trail, frame.tip : frame.closed, gaps] = True
    number = np.full(keep.shape, -1, dtype=np.int64)
    in_order = number.transpose(0, 2, 1)
    in_order[keep.transpose(0, 2, 1)] = np.arange(int(keep.sum()))
    patches = [PatchSides.of("body", "wall", _kept(number[:, 0], J_MINUS))]
    patches += _fin_patches(frame, number, gaps, sectors)
    patches += [
        PatchSides.of("farfield", "farfield", _kept(number[0], I_MINUS), _kept(number[:, -1], J_PLUS)),
        PatchSides.of("outflow", "outflow", _kept(number[-1], I_PLUS)),
    ]
    if sector == "half":
        patches.append(PatchSides.of("symmetry", "symmetry", (number[:, :, 0], K_MINUS), (number[:, :, -1], K_PLUS)))
    elif sector == "quarter":
        patches.append(PatchSides.of("symmetry", "symmetry", (number[:, :, -1], K_PLUS)))
        patches.append(PatchSides.of("symmetry_z", "symmetry", (number[:, :, 0], K_MINUS)))
    return Mesh.from_hexahedra(points.reshape(-1, 3), cells.transpose(0, 2, 1, 3)[keep.transpose(0, 2, 1)], patches)


def _kept(cells: Index, side: int) -> tuple[Index, int]:
    return cells[cells >= 0], side


def _fin_patches(frame: _Frame, number: Index, gaps: Index, sectors: list[Sector]) -> list[PatchSides]:
    """One patch for each fin: its two faces, and its tip if it has thickness."""
    chord, span = slice(frame.lead, frame.trail), slice(0, frame.tip)
    patches: dict[int, PatchSides] = {}
    for i, gap in enumerate(gaps):
        fin = sectors[i].end_fin
        assert fin is not None
        after = (gap + 1) % number.shape[2]
        sides = [(number[chord, span, gap - 1], K_PLUS), (number[chord, span, after], K_MINUS)]
        if frame.closed > frame.tip:
            sides.append((number[chord, frame.tip, gap], J_MINUS))
        patches[fin] = PatchSides.of(f"fin{fin + 1}", "wall", *sides)
    return [patches[fin] for fin in sorted(patches)]
