r"""Panels of lifting surfaces: bound rings, collocation points, segments and strips.

A ring's front side lies on its panel's quarter chord, its back side on the next panel's; the last one's is the trailing
edge. The boundary condition holds at three quarters of each panel, midway between its sides. Circulation is positive
from left to right along the front side, which lifts along the normal. Mesh axes: x aft, y right, z up [m].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from indicial.cfd.lattice.crossing import refuse_crossing
from indicial.cfd.lattice.lofting import Spacing, chord_edges, span_edges
from indicial.cfd.lattice.sheets import Sheet, Strips, sheets_of
from indicial.cfd.shapes import LiftingSurface
from indicial.cfd.shapes.lifting_surface import check_together
from indicial.conventions import Array, Index
from indicial.errors import InputError


@dataclass(frozen=True)
class Lattice:
    """All panels, P of them in S strips, sheet after sheet, row after row.

    `Lattice.of` makes one.
    """

    surfaces: tuple[LiftingSurface, ...]
    sheets: tuple[Sheet, ...]
    camber: bool = True

    @classmethod
    def of(
        cls,
        surfaces: LiftingSurface | Sequence[LiftingSurface],
        *,
        chordwise: int | Mapping[str, int] = 6,
        spanwise: int | Mapping[str, int] = 20,
        chord_spacing: Spacing = "equal",
        span_spacing: Spacing = "cosine",
        camber: bool = True,
    ) -> Lattice:
        """Cut surfaces into panels.

        Parameters
        ----------
        chordwise, spanwise : int or mapping by the surface's name
            Panels along the chord, and across half a symmetric surface or the whole of another.
        chord_spacing, span_spacing : {"cosine", "equal"}
            Equal panels along the chord are second order in time too; cosine ones resolve a cambered nose.
        camber : bool
            Whether panels lie on the sections' mean lines, or on their chords: for section data, which have the camber.

        Raises
        ------
        InputError
            If there are too few panels, or surfaces cross or cover one another.
        """
        listed = (surfaces,) if isinstance(surfaces, LiftingSurface) else tuple(surfaces)
        check_together(listed)
        sheets: list[Sheet] = []
        for surface in listed:
            u = chord_edges(_count(chordwise, surface.name, "chordwise"), chord_spacing)
            places = span_edges(surface, _count(spanwise, surface.name, "spanwise"), span_spacing)
            sheets += sheets_of(surface, u, places, span_spacing, camber)
        refuse_crossing(sheets)
        return cls(listed, tuple(sheets), camber)

    @cached_property
    def n_panels(self) -> int:
        """P."""
        return len(self.normal)

    @cached_property
    def size(self) -> float:
        """Largest extent along an axis [m]."""
        return float(np.max(np.ptp(self.corners.reshape(-1, 3), axis=0)))

    @cached_property
    def n_strips(self) -> int:
        """S."""
        return sum(sheet.columns for sheet in self.sheets)

    @cached_property
    def collocation(self) -> Array:
        """Shape (P, 3)."""
        return np.concatenate([sheet.collocation.reshape(-1, 3) for sheet in self.sheets])

    @cached_property
    def normal(self) -> Array:
        """Unit normals at the collocation points, shape (P, 3)."""
        return np.concatenate([sheet.normal.reshape(-1, 3) for sheet in self.sheets])

    @cached_property
    def corners(self) -> Array:
        """Of the bound rings: front left, front right, back right, back left, shape (P, 4, 3)."""
        rings = []
        for sheet in self.sheets:
            n = sheet.nodes
            rings.append(np.stack([n[:-1, :-1], n[:-1, 1:], n[1:, 1:], n[1:, :-1]], axis=2).reshape(-1, 4, 3))
        return np.concatenate(rings)

    @cached_property
    def ring_area(self) -> Array:
        """Area vectors of the rings [m^2], along the normal, shape (P, 3)."""
        c = self.corners
        return np.asarray(0.5 * np.cross(c[:, 2] - c[:, 0], c[:, 1] - c[:, 3]))

    @cached_property
    def load_corners(self) -> Array:
        """Of the rings, the last one's only as far as its collocation point, shape (P, 4, 3).

        Between there and the trailing edge ``V gamma + dGamma/dt`` is nought, and the filaments do not have that gamma.
        """
        c = self.corners.copy()
        t = self.trailing
        c[t, 2] = c[t, 1] + (2.0 / 3.0) * (c[t, 2] - c[t, 1])
        c[t, 3] = c[t, 0] + (2.0 / 3.0) * (c[t, 3] - c[t, 0])
        return c

    @cached_property
    def load_area(self) -> Array:
        """Area vectors on which dGamma/dt acts [m^2], shape (P, 3)."""
        c = self.load_corners
        return np.asarray(0.5 * np.cross(c[:, 2] - c[:, 0], c[:, 1] - c[:, 3]))

    @cached_property
    def load_centre(self) -> Array:
        """Shape (P, 3)."""
        return np.asarray(np.mean(self.load_corners, axis=1))

    @cached_property
    def ring_centre(self) -> Array:
        """Shape (P, 3)."""
        return np.asarray(np.mean(self.corners, axis=1))

    @cached_property
    def numbers(self) -> tuple[Index, ...]:
        """Panel numbers of each sheet, shape (rows, columns)."""
        first, found = 0, []
        for sheet in self.sheets:
            size = sheet.rows * sheet.columns
            found.append(np.arange(first, first + size).reshape(sheet.rows, sheet.columns))
            first += size
        return tuple(found)

    @cached_property
    def strip(self) -> Index:
        """Strip of each panel, shape (P,)."""
        first, found = 0, []
        for sheet in self.sheets:
            found.append(np.tile(np.arange(first, first + sheet.columns), sheet.rows))
            first += sheet.columns
        return np.concatenate(found)

    @cached_property
    def trailing(self) -> Index:
        """The panel at the trailing edge of each strip, shape (S,)."""
        return np.concatenate([numbers[-1] for numbers in self.numbers])

    @cached_property
    def ahead(self) -> Index:
        """The panel in front of each; itself number P for the first ones, shape (P,)."""
        found = [np.concatenate([np.full((1, n.shape[1]), self.n_panels), n[:-1]]).ravel() for n in self.numbers]
        return np.concatenate(found)

    @cached_property
    def across(self) -> tuple[Array, Array]:
        """Places of the wind, and vectors, of the front sides of the rings, from left to right, shapes (P, 3)."""
        c = self.corners
        return np.concatenate([sheet.front.reshape(-1, 3) for sheet in self.sheets]), c[:, 1] - c[:, 0]

    @cached_property
    def along(self) -> tuple[Array, Array]:
        """Middles and vectors of the sides between rings, from front to back, shapes (E, 3)."""
        fronts = np.concatenate([sheet.nodes[:-1].reshape(-1, 3) for sheet in self.sheets])
        backs = np.concatenate([sheet.nodes[1:].reshape(-1, 3) for sheet in self.sheets])
        return 0.5 * (fronts + backs), backs - fronts

    @cached_property
    def beside(self) -> tuple[Index, Index]:
        """Panels on the left and right of each side in `along`; P where there is none, shapes (E,)."""
        lefts, rights = [], []
        for n in self.numbers:
            none = np.full((n.shape[0], 1), self.n_panels)
            lefts.append(np.hstack([none, n]).ravel())
            rights.append(np.hstack([n, none]).ravel())
        return np.concatenate(lefts), np.concatenate(rights)

    @cached_property
    def strips(self) -> Strips:
        """All strips in one."""
        parts = [sheet.strips for sheet in self.sheets]

        def joined_field(name: str) -> Array:
            return np.concatenate([getattr(part, name) for part in parts])

        vectors = ("chord", "width", "area", "quarter_chord", "three_quarter_chord", "aft", "up", "span")
        return Strips(
            surface=tuple(name for part in parts for name in part.surface),
            **{name: joined_field(name) for name in vectors},
            sections=tuple(one for part in parts for one in part.sections),
        )

    def summary(self) -> str:
        """One line: surfaces and panels."""
        parts = ", ".join(f"{sheet.name} {sheet.rows} x {sheet.columns}" for sheet in self.sheets)
        return f"{self.n_panels} panels ({parts})"


def _count(counts: int | Mapping[str, int], name: str, what: str) -> int:
    value = counts.get(name) if isinstance(counts, Mapping) else counts
    if not (isinstance(value, int | np.integer) and value >= 1):
        raise InputError(f"{what} panels of surface {name!r} are {value}, must be a whole number of at least 1")
    return int(value)
