"""Wings and tails: span stations joined by straight lines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Self

import numpy as np

from indicial.cfd.shapes.validation import require, require_positive
from indicial.cfd.shapes.wing_section import WingSection
from indicial.conventions import Array, ReferenceQuantities
from indicial.errors import InputError


@dataclass(frozen=True)
class SpanStation:
    """A section and where it stands; mesh axes: x aft, y right, z up [m].

    Parameters
    ----------
    x, y, z : float
        Leading edge before it is twisted.
    chord : float
    twist : float
        Nose up, about the quarter chord [rad].
    section : WingSection
    """

    x: float
    y: float
    z: float
    chord: float
    twist: float = 0.0
    section: WingSection = field(default_factory=WingSection.flat)

    def __post_init__(self) -> None:
        for name in ("x", "y", "z"):
            value = getattr(self, name)
            require(math.isfinite(value), "SpanStation", name, value, "finite")
        require_positive("SpanStation", chord=self.chord)
        require(abs(self.twist) < math.pi / 2.0, "SpanStation", "twist", self.twist, "between -pi/2 and pi/2 rad")

    @property
    def quarter_chord(self) -> Array:
        """Point (3,) about which the section is twisted [m]."""
        return np.array([self.x + 0.25 * self.chord, self.y, self.z])


@dataclass(frozen=True)
class LiftingSurface:
    """A surface through stations listed from left to right (or from root to tip, or upwards).

    Parameters
    ----------
    name : str
    stations : sequence of SpanStation
        At least two, none above another's place in the y-z plane.
    symmetric : bool
        Whether the stations are those of the right half, from the root on, and the left one is their mirror image
        behind y = 0. A root at y = 0 joins both halves; one at y > 0 leaves two surfaces with a gap.

    Raises
    ------
    InputError
        Naming surface, station and what is allowed.
    """

    name: str
    stations: tuple[SpanStation, ...]
    symmetric: bool = True

    def __post_init__(self) -> None:
        object.__setattr__(self, "stations", tuple(self.stations))
        if len(self.stations) < 2:
            raise InputError(f"surface {self.name!r} has {len(self.stations)} stations, must have at least 2")
        for n, (one, two) in enumerate(zip(self.stations[:-1], self.stations[1:], strict=True)):
            if math.hypot(two.y - one.y, two.z - one.z) <= 1e-9 * one.chord:
                raise InputError(f"surface {self.name!r}: stations {n} and {n + 1} are at the same y and z")
        if self.symmetric:
            root, outer = self.stations[0], self.stations[1:]
            if root.y < 0.0 or any(station.y <= 0.0 for station in outer):
                raise InputError(
                    f"surface {self.name!r} is symmetric: stations must run from y = 0 (or right of it) to the right"
                )
        _refuse_crossing(self.name, self._trace())

    def _trace(self) -> Array:
        """The surface seen from behind: (y, z) of its stations, from end to end, shape (n, 2)."""
        points = np.array([[s.y, s.z] for s in self.stations])
        if not self.symmetric or self.stations[0].y > 0.0:
            return points
        return np.concatenate([points[:0:-1] * [-1.0, 1.0], points])

    @classmethod
    def wing(
        cls,
        name: str,
        span: float,
        root_chord: float,
        *,
        taper: float = 1.0,
        sweep: float = 0.0,
        dihedral: float = 0.0,
        washout: float = 0.0,
        incidence: float = 0.0,
        sections: tuple[WingSection, WingSection] | None = None,
        root_leading_edge: tuple[float, float] = (0.0, 0.0),
    ) -> Self:
        """A symmetric trapezoidal wing.

        Parameters
        ----------
        span, root_chord : float
            [m]
        taper : float
            Tip chord over root chord.
        sweep, dihedral, washout, incidence : float
            Of the quarter-chord line, aft; tips up; tip nose down against the root; root nose up [rad].
        sections : pair of WingSection, optional
            At root and tip; flat if not given.
        root_leading_edge : tuple of float
            (x, z) [m].
        """
        require_positive("wing", span=span, root_chord=root_chord, taper=taper)
        require(abs(sweep) < 1.4 and abs(dihedral) < 1.4, "wing", "sweep, dihedral", (sweep, dihedral), "below 1.4 rad")
        root_section, tip_section = sections or (WingSection.flat(), WingSection.flat())
        x, z = root_leading_edge
        half, tip = 0.5 * span, taper * root_chord
        aft = 0.25 * (root_chord - tip) + half * math.tan(sweep)
        stations = (
            SpanStation(x, 0.0, z, root_chord, incidence, root_section),
            SpanStation(x + aft, half, z + half * math.tan(dihedral), tip, incidence - washout, tip_section),
        )
        return cls(name, stations)

    @property
    def area(self) -> float:
        """Of both halves, along the surface [m^2]."""
        pairs = zip(self.stations[:-1], self.stations[1:], strict=True)
        half = sum(0.5 * (a.chord + b.chord) * math.hypot(b.y - a.y, b.z - a.z) for a, b in pairs)
        return half * (2.0 if self.symmetric else 1.0)

    @property
    def span(self) -> float:
        """Between the outermost stations, across [m]; of a vertical surface, its height."""
        across = [s.y for s in self.stations]
        width = 2.0 * max(across) if self.symmetric else max(across) - min(across)
        return width or max(s.z for s in self.stations) - min(s.z for s in self.stations)

    @property
    def mean_chord(self) -> float:
        """Mean aerodynamic chord, ``integral of c^2 / integral of c`` over the surface [m]."""
        total = moment = 0.0
        for a, b in zip(self.stations[:-1], self.stations[1:], strict=True):
            width = math.hypot(b.y - a.y, b.z - a.z)
            total += 0.5 * (a.chord + b.chord) * width
            moment += (a.chord**2 + a.chord * b.chord + b.chord**2) / 3.0 * width
        return moment / total

    def reference(self, moment_reference: tuple[float, float, float]) -> ReferenceQuantities:
        """This surface's area and mean chord, its span for roll and yaw."""
        return ReferenceQuantities(self.mean_chord, self.area, moment_reference, lateral_length=self.span)


def check_together(surfaces: Sequence[LiftingSurface]) -> None:
    """Refuse surfaces that cannot stand together.

    Raises
    ------
    InputError
        If there are none, or two have one name.
    """
    names = [surface.name for surface in surfaces]
    if not names:
        raise InputError("at least one lifting surface is needed")
    if len(set(names)) != len(names):
        raise InputError(f"lifting surfaces must have names of their own, not {', '.join(names)}")


def _refuse_crossing(name: str, trace: Array) -> None:
    """No two pieces of the surface, seen from behind, may cross or touch but neighbours at their common station."""
    pieces = list(pairwise(trace))
    for i, (a, b) in enumerate(pieces):
        for j in range(i + 1, len(pieces)):
            c, d = pieces[j]
            if j == i + 1:
                folded = _cross(b - a, d - c) == 0.0 and float((b - a) @ (d - c)) < 0.0
                if folded:
                    raise InputError(f"surface {name!r} folds back on itself at y = {b[0]:g}, z = {b[1]:g}")
            elif _meet(a, b, c, d):
                raise InputError(f"surface {name!r} crosses itself between y = {a[0]:g} and {b[0]:g}")


def _cross(a: Array, b: Array) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def _meet(a: Array, b: Array, c: Array, d: Array) -> bool:
    """Whether segments ab and cd of the plane have a point in common."""
    sides = [_cross(b - a, c - a), _cross(b - a, d - a), _cross(d - c, a - c), _cross(d - c, b - c)]
    if sides[0] * sides[1] < 0.0 and sides[2] * sides[3] < 0.0:
        return True

    def on(p: Array, q: Array, r: Array, side: float) -> bool:
        return side == 0.0 and bool(np.all(np.minimum(p, q) <= r) and np.all(r <= np.maximum(p, q)))

    return on(a, b, c, sides[0]) or on(a, b, d, sides[1]) or on(c, d, a, sides[2]) or on(c, d, b, sides[3])
