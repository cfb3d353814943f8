r"""Section data on a lattice: the circulation of every strip is that of its section at the incidence it meets.

Additional normalwash w, uniform over a strip, turns the lattice's attached flow into that of the section. In two
dimensions the circulation of a strip is ``2 pi g (v + w)`` with the wind v across its chord, ``g = c cos(Lambda) /
(2 sqrt(1 - M^2 cos^2(Lambda)))`` (Prandtl and Glauert across the sweep); so on a wing, where all other strips and all
wakes induce their part of v,

    v = Gamma/(2 pi g) - w,   alpha = atan2(v, u),   Gamma = g sqrt(u^2 + v^2) cl(alpha, x),   Gamma = Gamma_0 + R w

with the wind u along the chord, the lattice's own ``Gamma_0`` and its response R to w. For given separation points x
these are S equations for v, solved by Newton's method. With ``cl = 2 pi sin(alpha)`` w is nought and the lattice is
left as it is.

Incidence is read from circulation: of what is unsteady within a section (the part of its own wake in its lift, its
added mass) the lattice keeps its own, and the section sees none.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from indicial.cfd.lattice.instant import Instant, StripLoads
from indicial.cfd.lattice.panels import Lattice
from indicial.cfd.lattice.separation import StripSections
from indicial.conventions import Array
from indicial.errors import DivergenceError

_ITERATIONS = 60
TOLERANCE = 1e-11
"""Of the circulation, relative to that of a section of unit lift."""

_SMALLEST_STEP = 1e-6


@dataclass(frozen=True)
class StripProblem:
    """The lattice as its strips see it at one instant.

    Parameters
    ----------
    free : ndarray
        Gamma_0, circulation of the strips without additional normalwash (S,) [m^2/s].
    response : ndarray
        R, shape (S, S) [m].
    along : ndarray
        u, the undisturbed wind along the chords (S,) [m/s].
    size : ndarray
        g, shape (S,) [m].
    """

    free: Array
    response: Array
    along: Array
    size: Array

    @classmethod
    def at(cls, instant: Instant) -> StripProblem:
        """Of an instant of the lattice."""
        lattice = instant.influence.lattice
        return cls(
            instant.circulation()[lattice.trailing],
            instant.response[lattice.trailing],
            np.sum(instant.strip_wind * lattice.strips.aft, axis=1),
            _size(instant),
        )

    def between(self, later: StripProblem, fraction: float) -> StripProblem:
        """Linear between two instants."""

        def mean(one: Array, two: Array) -> Array:
            return (1.0 - fraction) * one + fraction * two

        return StripProblem(
            mean(self.free, later.free),
            mean(self.response, later.response),
            mean(self.along, later.along),
            self.size,
        )

    @cached_property
    def inner(self) -> Array:
        """``I - R/(2 pi g)``: what Gamma is of ``Gamma_0 - R v``, shape (S, S)."""
        return np.eye(self.size.size) - self.response / (2.0 * np.pi * self.size)

    def incidence(self, across: Array) -> Array:
        """alpha of the strips (S,) [rad] with the wind v across their chords (S,) [m/s]."""
        return np.arctan2(across, self.along)

    def wash(self, across: Array, circulation: Array) -> Array:
        """w (S,) [m/s]."""
        return circulation / (2.0 * np.pi * self.size) - across

    def circulation(self, sections: StripSections, across: Array, point: Array | None) -> tuple[Array, Array]:
        """Gamma of the sections (S,) and its slope against v, (S,) for given points, (S, S) at rest (None)."""
        speed = np.maximum(np.hypot(self.along, across), 1e-12)
        alpha = self.incidence(across)
        if point is not None:
            cl, slope = sections.lift(alpha, point)
            return self.size * speed * cl, self.size * (across / speed * cl + self.along / speed * slope)
        cl, slopes = sections.settled_lift(alpha)
        turned = (self.size * speed)[:, None] * slopes * (self.along / speed**2)
        return self.size * speed * cl, np.diag(self.size * across / speed * cl) + turned

    def solve(
        self, sections: StripSections, across: Array, point: Array | None, tolerance: float = TOLERANCE
    ) -> tuple[Array, Array]:
        """v and Gamma (S,) for fixed separation points, or static ones; from a guess of v.

        Raises
        ------
        DivergenceError
            If Newton's method stalls.
        """
        inner = self.inner

        def residual(v: Array) -> tuple[Array, Array, Array]:
            gamma, slope = self.circulation(sections, v, point)
            return inner @ gamma + self.response @ v - self.free, gamma, slope

        v = across.copy()
        off, gamma, slope = residual(v)
        scale = float(np.max(self.size * np.hypot(self.along, v))) + 1e-300
        for _ in range(_ITERATIONS):
            size = float(np.max(np.abs(off)))
            if size <= tolerance * scale:
                return v, gamma
            try:
                answer = inner * slope if slope.ndim == 1 else inner @ slope
                step = np.linalg.solve(answer + self.response, -off)
            except np.linalg.LinAlgError:
                break
            part = 1.0
            while True:
                trial = residual(v + part * step)
                if float(np.max(np.abs(trial[0]))) < size or part < _SMALLEST_STEP:
                    break
                part *= 0.5
            if part < _SMALLEST_STEP:
                break
            v = v + part * step
            off, gamma, slope = trial
        # what round-off leaves is no failure
        if float(np.max(np.abs(off))) <= 1e3 * TOLERANCE * scale:
            return v, gamma
        raise DivergenceError(f"section lift and lattice do not meet: residual {np.max(np.abs(off)) / scale:.1e}")


def _size(instant: Instant) -> Array:
    """g of the strips (S,) [m]: drawing out by 1/beta along x stretches the chords and lessens the sweep."""
    cosine = sweep_cosine(instant.influence.lattice)
    normal_mach2 = (1.0 - instant.influence.beta**2) * cosine**2
    return np.asarray(0.5 * instant.influence.lattice.strips.chord * cosine / np.sqrt(1.0 - normal_mach2))


def sweep_cosine(lattice: Lattice) -> Array:
    """Cosine of the angle between quarter-chord line and the plane across the chord, of each strip (S,)."""
    found = []
    for sheet in lattice.sheets:
        line = 0.75 * sheet.edges[0] + 0.25 * sheet.edges[-1]
        side = line[1:] - line[:-1]
        aft = np.sum(side * sheet.strips.aft, axis=1)
        length = np.linalg.norm(side, axis=1)
        found.append(np.sqrt(np.maximum(1.0 - (aft / length) ** 2, 0.0)))
    return np.concatenate(found)


def viscous_loads(instant: Instant, sections: StripSections, across: Array, point: Array) -> StripLoads:
    """Drag and moment of the sections, which the lattice has not, per unit density."""
    strips = instant.influence.lattice.strips
    along = np.sum(instant.strip_wind * strips.aft, axis=1)
    alpha = np.arctan2(across, along)
    cd, cm = sections.drag_and_moment(alpha, point)
    wind = along[:, None] * strips.aft + across[:, None] * strips.up
    speed = np.linalg.norm(wind, axis=1)
    force = 0.5 * (strips.area * speed * cd)[:, None] * wind
    # nose up is a turn about the span, to the right
    pitch = 0.5 * (strips.area * strips.chord * speed**2 * cm)[:, None] * strips.span
    return StripLoads(force, pitch + np.cross(strips.quarter_chord - instant.motion.centre, force))
