"""Planes and levels of the block about a body: a narrow domain inside the bow shock, or a wide one all round.

The narrow domain goes from the plane of the nose's tip to that of the base, and widens with the bow shock. The wide one
is a cylinder that begins ahead of the nose and ends behind the base. There the flow beside the base has to go
somewhere: along a sting of the body's diameter. Ahead of the nose the block's inner surface is a needle, not the axis:
wedge-shaped cells round an axis have no gradient that could be trusted. Lengths are in calibres.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields

import numpy as np
from scipy.optimize import brentq

from indicial.cfd.mesh.bow_shock import influence_limit, outer_radius, shock_angle
from indicial.cfd.mesh.geometry import Array
from indicial.cfd.mesh.stations import Anchor, axial_stations, plain_levels, smooth_step, tip_levels, wide_levels
from indicial.cfd.shapes.finned_body import FinnedBody
from indicial.cfd.shapes.fins import FinSet
from indicial.errors import InputError

NOSE_STEP = 0.025
"""First step behind the tip, and radius of the narrow domain's inflow disc, over the nose's length, quick mesh."""

SPAN_CELLS, OUTER_CELLS, PLAIN_CELLS = 7, 8, 16
"""Narrow domain, quick mesh: cells along a fin's span, beyond its tip, from a finless body outwards."""

WIDE_STEP, WIDE_GROWTH = 0.1, 1.3
"""Wide domain, quick mesh: first radial step beyond a fin's tip [calibres], and ratio of neighbouring steps."""


@dataclass(frozen=True)
class WideDomain:
    """A cylinder all round the body, in calibres.

    Parameters
    ----------
    upstream, downstream : float
        From the nose to the upstream end, from the base to the downstream end.
    radius : float
        Of the cylinder.
    needle : float
        Radius of the needle ahead of the nose; where the nose is thinner, the needle takes its place.

    Notes
    -----
    In a pitch rate the needle meets the stream at an incidence that grows with its length, and on cells of reasonable
    size what it does to the stream reaches the fins: with 20 calibres instead of 4, CN_q at M 1.4 is 5% and CN_alphadot
    a third larger (docs/studies/finner.md). Above Mach 1 give `upstream` as 2; subsonic flow needs the distance.

    Raises
    ------
    InputError
        If a length is not positive.
    """

    upstream: float = 20.0
    downstream: float = 20.0
    radius: float = 30.0
    needle: float = 0.02

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if not (math.isfinite(value) and value > 0.0):
                raise InputError(f"domain: {field.name} is {value}, must be positive")


@dataclass(frozen=True)
class Frame:
    """Planes and levels of the block [calibres]: nodes away from the fins, and on their sheets.

    x, s : (ni, nj) axial station and radius away from the fins; sheet_x, sheet_s, sheet_h : the same and the half
    gap on the sheets, s and h measured along and normal to the fin. The body takes planes `nose` to `base`, the fins
    `lead` to `trail` and levels 0 to `tip`; the gap is closed again at level `closed`. Behind a blunt trailing edge
    in the wide domain the gap goes on to the last plane (`open_wake`).
    """

    x: Array
    s: Array
    sheet_x: Array
    sheet_s: Array
    sheet_h: Array
    nose: int
    base: int
    lead: int
    trail: int
    tip: int
    closed: int
    open_wake: bool

    @property
    def is_wide(self) -> bool:
        """Whether there are planes behind the base."""
        return bool(self.base < self.x.shape[0] - 1)


@dataclass(frozen=True)
class _Planes:
    """Axial stations, and the indices of the nose, the base and the fins' leading and trailing edges."""

    x: Array
    nose: int
    base: int
    lead: int
    trail: int


def narrow_frame(body: FinnedBody, factor: float, mach: float, margin: float) -> Frame:
    """Planes from tip to base, levels out to a boundary that follows the bow shock.

    Raises
    ------
    InputError
        If the shock is detached or the fins do not suit.
    """
    beta = shock_angle(mach, body.nose.tip_half_angle)
    slope = margin * math.tan(beta)
    fins = body.fins
    largest = 0.5 if fins is None else 0.5 + fins.span
    planes = _planes(body, factor, 0.0, None)
    first = NOSE_STEP * body.nose.length
    if fins is not None:
        slope = max(slope, (1.3 * largest - first) / fins.root_leading_edge)
    limit = max(1.5 * largest, margin * influence_limit(body.length, largest, beta))
    outer = outer_radius(planes.x, first=first, slope=slope, limit=limit)
    inner = body.radius(planes.x)
    if fins is None:
        return _without_fins(planes, plain_levels(inner, outer, _count(PLAIN_CELLS, factor)))
    n_span, n_outer = _count(SPAN_CELLS, factor), _count(OUTER_CELLS, factor)
    plain = plain_levels(inner, outer, n_span + n_outer)
    tip = np.minimum(0.5 + fins.span, inner + 0.6 * (outer - inner))
    s = _levels_with_tip(body, fins, planes.x, plain, tip_levels(inner, tip, outer, n_span, n_outer))
    return _with_sheets(fins, planes, s, n_span, _closed(fins, n_span, factor))


def wide_frame(body: FinnedBody, factor: float, domain: WideDomain) -> Frame:
    """Planes from far ahead of the nose to far behind the base, levels out to a cylinder.

    Raises
    ------
    InputError
        If the domain is too small for the body.
    """
    fins = body.fins
    largest = 0.5 if fins is None else 0.5 + fins.span
    if not domain.radius > 2.0 * largest:
        raise InputError(f"domain: radius is {domain.radius}, must be above {2.0 * largest:g} calibres for this body")
    if not domain.needle < 0.1:
        raise InputError(f"domain: needle is {domain.needle}, must be below 0.1 calibre")
    start = brentq(lambda x: float(body.radius(x)) - domain.needle, 0.0, body.nose.length)
    planes = _planes(body, factor, start, domain)
    inner = np.maximum(body.radius(planes.x), domain.needle)
    outer = np.full(planes.x.size, domain.radius)
    growing = math.log(1.0 + (domain.radius - largest) * (WIDE_GROWTH - 1.0) / WIDE_STEP) / math.log(WIDE_GROWTH)
    n_span, n_outer = _count(SPAN_CELLS, factor), _count(growing, factor)
    plain = wide_levels(inner, outer, 0.4 * WIDE_STEP / factor, n_span + n_outer)
    if fins is None:
        return _without_fins(planes, plain)
    tip = np.full(planes.x.size, 0.5 + fins.span)
    s = _levels_with_tip(body, fins, planes.x, plain, tip_levels(inner, tip, outer, n_span, n_outer))
    return _with_sheets(fins, planes, s, n_span, _closed(fins, n_span, factor))


def _count(quick: float, factor: float) -> int:
    return max(2, round(quick * factor))


def _closed(fins: FinSet, n_span: int, factor: float) -> int:
    """Level at which the gap above a fin's tip is closed."""
    return n_span + max(1, round(factor)) if fins.thickness_ratio > 0.0 else n_span


def _planes(body: FinnedBody, factor: float, start: float, domain: WideDomain | None) -> _Planes:
    """Axial stations from the station `start` of the nose to the base, in a wide domain from end to end."""
    nose, fins = body.nose, body.fins
    tip_step, largest = NOSE_STEP * nose.length, 0.6
    anchors = [Anchor(start, tip_step, min(largest, 0.1 * nose.length))]
    if nose.length < body.length * (1.0 - 1e-9):
        anchors.append(Anchor(nose.length, min(0.16, 0.1 * nose.length), largest))
    edges = [start, start]
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
    base = anchors[-1].x
    if domain is not None:
        far = max(domain.upstream, domain.downstream)
        anchors = [Anchor(-domain.upstream, far, far), *anchors[:-1], Anchor(base, anchors[-1].step, far)]
        anchors.append(Anchor(base + domain.downstream, far, far))
    stations, at = axial_stations(anchors, factor)
    index = {anchor.x: i for anchor, i in zip(anchors, at, strict=True)}
    return _Planes(stations, index[start], index[base], index[edges[0]], index[edges[1]])


def _without_fins(planes: _Planes, s: Array) -> Frame:
    x = np.broadcast_to(planes.x[:, None], s.shape)
    return Frame(x, s, x, s, np.zeros_like(s), planes.nose, planes.base, 0, 0, 0, 0, False)


def _levels_with_tip(body: FinnedBody, fins: FinSet, x: Array, plain: Array, with_tip: Array) -> Array:
    """Radial levels (ni, nj): plain near the nose, with a level exactly at the fins' tips along the fins."""
    start = min(body.nose.length, fins.root_leading_edge - 1.0)
    end = max(fins.root_leading_edge - 0.5, 0.5 * (start + fins.root_leading_edge))
    weight = smooth_step(x, start, end)[:, None]
    levels = (1.0 - weight) * plain + weight * with_tip
    levels[:, 0] = plain[:, 0]
    return levels


def _with_sheets(fins: FinSet, planes: _Planes, s: Array, tip: int, closed: int) -> Frame:
    """Place the nodes of the fins' sheets, and shear the planes along swept edges."""
    x, lead, trail = planes.x, planes.lead, planes.trail
    wide = planes.base < x.size - 1
    open_wake = wide and fins.section == "single_wedge"
    chordwise = np.clip((x - x[lead]) / (x[trail] - x[lead]), 0.0, 1.0)
    number = np.arange(x.size)
    has_gap = (number >= lead) & ((number <= trail) | open_wake)
    shear = _shear(fins, planes, chordwise, wide)

    def half_gap(fraction: Array) -> Array:
        section = np.where(has_gap, fins.half_thickness(chordwise), 0.0)
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
    return Frame(
        x=x[:, None] + shear[:, None] * fraction,
        s=s,
        sheet_x=x[:, None] + shear[:, None] * sheet_fraction,
        sheet_s=sheet_s,
        sheet_h=half_gap(sheet_fraction) * closing,
        nose=planes.nose,
        base=planes.base,
        lead=lead,
        trail=trail,
        tip=tip,
        closed=closed,
        open_wake=open_wake,
    )


def _shear(fins: FinSet, planes: _Planes, chordwise: Array, wide: bool) -> Array:
    """How far aft of their root the planes stand at the fins' tip, (ni,): along the swept edges, fading away from them.

    Raises
    ------
    InputError
        If the planes of the narrow domain leave no room for that.
    """
    x, lead, trail = planes.x, planes.lead, planes.trail
    lead_shift = float(fins.leading_edge(1.0) - fins.leading_edge(0.0))
    trail_shift = lead_shift + fins.tip_chord - fins.root_chord
    blend = x[lead] - max(1.0, 2.0 * lead_shift)
    ahead = np.clip((x - blend) / (x[lead] - blend), 0.0, 1.0)
    if wide:
        behind = np.clip(1.0 - (x - x[trail]) / max(1.0, 2.0 * abs(trail_shift)), 0.0, 1.0)
    else:
        ends_at_base = trail == planes.base
        if fins.section == "single_wedge" and not ends_at_base:
            raise InputError("a mesh of single-wedge fins needs their trailing edge at the body's base")
        if ends_at_base and abs(trail_shift) > 1e-9:
            raise InputError("fins that end at the base must have an unswept trailing edge for this mesh")
        if not ends_at_base and trail_shift > 0.8 * (x[-1] - x[trail]):
            raise InputError("the fins' swept trailing edge reaches too near the base for this mesh")
        behind = np.ones(x.size)
        if not ends_at_base:
            behind = np.clip((x[-1] - x) / (x[-1] - x[trail]), 0.0, 1.0)
    shear: Array = ((1.0 - chordwise) * lead_shift + chordwise * trail_shift) * ahead * behind
    return shear
