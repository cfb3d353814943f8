r"""A structured mesh wrapped round a finned body.

One block of planes along x, radial levels and azimuthal columns; `body_frame` says where they stand. A fin is a column
of nodes split into two sheets, one for each of its faces. Above the tip the sheets close over a few levels, and the gap
between them is one column of cells standing on the flat tip, the last of them prisms. So the flat faces, the tip and
the thickness of the fins are exact. Behind a blunt trailing edge the gap goes on as the fin's wake, if there is one.
"""

from __future__ import annotations

import math
from typing import Literal, get_args

import numpy as np

from indicial.cfd.mesh.body_frame import Frame, WideDomain, narrow_frame, wide_frame
from indicial.cfd.mesh.geometry import Array, Index
from indicial.cfd.mesh.hexahedra import I_MINUS, I_PLUS, J_MINUS, J_PLUS, K_MINUS, K_PLUS, PatchSides
from indicial.cfd.mesh.mesh import Mesh
from indicial.cfd.mesh.sectors import Extent, Sector, split_into_sectors
from indicial.cfd.mesh.stations import azimuthal_fractions
from indicial.cfd.mesh.structured import block_hexahedra, block_nodes, positive
from indicial.cfd.shapes.cone import Cone
from indicial.cfd.shapes.finned_body import FinnedBody
from indicial.cfd.shapes.fins import FinSet
from indicial.errors import InputError

Resolution = Literal["quick", "coarse", "medium", "fine"]
RESOLUTIONS: dict[Resolution, float] = {"quick": 1.0, "coarse": 1.5, "medium": 2.25, "fine": 3.375}
"""Cells along each direction relative to the quick mesh: each preset has 1.5 times as many as the one before."""

Wake = Literal["none", "sting"]

WIDE_DOMAIN = WideDomain()

QUADRANT_CELLS = 8
"""Cells round 90 degrees, on the quick mesh."""


def finned_body_mesh(
    body: FinnedBody,
    resolution: Resolution | float = "coarse",
    *,
    mach: float | None = None,
    sector: Extent = "half",
    margin: float = 1.15,
    wake: Wake = "none",
    domain: WideDomain = WIDE_DOMAIN,
) -> Mesh:
    """Mesh about a body with or without fins.

    Without a wake it goes from the plane of the tip to that of the base, which asks for a supersonic stream: what is
    ahead of the attached bow shock is undisturbed, and what leaves beside the base says nothing any more. The outer
    boundary lies outside the bow shock by `margin`, up to the radius beyond which waves can no longer return to the
    body (`influence_limit`, times `margin`). With `wake` "sting" the body goes on as a cylinder of its own diameter
    whose loads are left out, in a wide domain all round, for any Mach number. The flat base, and the fins' blunt
    trailing edges, carry no load in either.

    Patches: "body", "fin1", "fin2", ... (walls; number n is the n-th of `FinSet.angles`, both faces and the tip),
    "farfield", "outflow" (the plane of the base, without a wake), "sting" (the sting, the fins' trailing edges and the
    needle ahead of the nose, with one), and, on a sector, "symmetry" (plane y = 0) and "symmetry_z" (z = 0). Cells are
    numbered plane by plane along x, within a plane along the radius first.

    Parameters
    ----------
    body : FinnedBody
        Without a wake single-wedge fins must end at the base.
    resolution : "quick", "coarse", "medium", "fine" or float
        About 9,100, 31,000, 104,000 and 353,000 cells for half a Basic Finner; a number is the ratio of cells along
        every direction to those of "quick". With a sting about 2.4 times as many.
    mach : float, optional
        Mach number [-], above 1 with an attached bow shock; only without a wake, where the outflow plane asks for
        about 1.4 or more.
    sector : {"half", "full", "quarter"}
        "half" is y >= 0, "quarter" y, z >= 0 (an axisymmetric or doubly symmetric flow only).
    margin : float
        At least 1.
    wake : {"none", "sting"}
    domain : WideDomain
        Size of the domain with a sting.

    Raises
    ------
    InputError
        If the fins do not suit the sector or the mesh, the shock is detached, or a parameter is out of range.
    """
    factor = resolution_factor(resolution)
    if not margin >= 1.0:
        raise InputError(f"margin is {margin}, must be at least 1")
    if wake not in get_args(Wake):
        raise InputError(f"wake is {wake!r}, must be one of {', '.join(get_args(Wake))}")
    sectors = split_into_sectors(body.fins, sector)
    if wake == "sting":
        frame = wide_frame(body, factor, domain)
    elif mach is None:
        raise InputError("mach is missing: a mesh without a wake follows the bow shock; give it or take wake='sting'")
    else:
        frame = narrow_frame(body, factor, mach, margin)
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


def _columns(sector: Sector, factor: float) -> Array:
    """Fractions of the sector at which its columns stand."""
    n = max(2, round(QUADRANT_CELLS * factor * (sector.end - sector.start) / (0.5 * np.pi)))
    return azimuthal_fractions(n, sector.start_fin is not None, sector.end_fin is not None)


def _sector_nodes(frame: Frame, sector: Sector, fractions: Array, fins: FinSet | None) -> Array:
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


def _edge(frame: Frame, azimuth: float, fin: int | None, side: float) -> tuple[Array, Array, Array]:
    """Axial station, azimuth and radius (ni, nj) of the nodes at one end of a sector."""
    if fin is None:
        return frame.x, np.full_like(frame.s, azimuth), frame.s
    turn = np.arctan2(side * frame.sheet_h, frame.sheet_s)
    return frame.sheet_x, azimuth + turn, np.hypot(frame.sheet_s, frame.sheet_h)


def _place_sheet(points: Array, frame: Frame, azimuth: float, side: float) -> None:
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


def _assemble(frame: Frame, points: Array, sectors: list[Sector], sizes: list[int], sector: Extent) -> Mesh:
    """Number cells plane by plane, keep the gap columns only above the tips and in wakes, and name the boundary."""
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
    if frame.open_wake:
        keep[frame.trail :, : frame.closed, gaps] = True
    number = np.full(keep.shape, -1, dtype=np.int64)
    in_order = number.transpose(0, 2, 1)
    in_order[keep.transpose(0, 2, 1)] = np.arange(int(keep.sum()))
    patches = [PatchSides.of("body", "wall", _kept(number[frame.nose : frame.base, 0], J_MINUS))]
    patches += _fin_patches(frame, number, gaps, sectors)
    far, end = [_kept(number[0], I_MINUS), _kept(number[:, -1], J_PLUS)], _kept(number[-1], I_PLUS)
    if frame.is_wide:
        patches += [PatchSides.of("farfield", "farfield", *far, end), _sting_patch(frame, number, gaps)]
    else:
        patches += [PatchSides.of("farfield", "farfield", *far), PatchSides.of("outflow", "outflow", end)]
    if sector == "half":
        patches.append(PatchSides.of("symmetry", "symmetry", (number[:, :, 0], K_MINUS), (number[:, :, -1], K_PLUS)))
    elif sector == "quarter":
        patches.append(PatchSides.of("symmetry", "symmetry", (number[:, :, -1], K_PLUS)))
        patches.append(PatchSides.of("symmetry_z", "symmetry", (number[:, :, 0], K_MINUS)))
    return Mesh.from_hexahedra(points.reshape(-1, 3), cells.transpose(0, 2, 1, 3)[keep.transpose(0, 2, 1)], patches)


def _kept(cells: Index, side: int) -> tuple[Index, int]:
    return cells[cells >= 0], side


def _sting_patch(frame: Frame, number: Index, gaps: Index) -> PatchSides:
    """Needle, sting and the fins' blunt trailing edges."""
    sides = [_kept(number[: frame.nose, 0], J_MINUS), _kept(number[frame.base :, 0], J_MINUS)]
    if frame.open_wake:
        sides.append((number[frame.trail, : frame.tip, gaps], I_MINUS))
    return PatchSides.of("sting", "sting", *sides)


def _fin_patches(frame: Frame, number: Index, gaps: Index, sectors: list[Sector]) -> list[PatchSides]:
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
