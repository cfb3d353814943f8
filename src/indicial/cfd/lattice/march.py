"""Steady states of a lattice, and its march through a motion."""

from __future__ import annotations

from dataclasses import replace
from itertools import accumulate, pairwise

import numpy as np

from indicial.cfd.lattice.influence import Influence
from indicial.cfd.lattice.instant import Instant
from indicial.cfd.lattice.shedding import cut, departure
from indicial.cfd.lattice.wake import RigidMotion, WakeSheet, steady_wake
from indicial.conventions import Array

WAKE_SPANS = 30.0
"""Length over which the helical wake of a steady rotation is followed, in the lattice's largest dimension."""

_THINNED_EVERY = 64
"""Number of lines at whose multiples a wake is thinned out."""


def steady_instant(influence: Influence, motion: RigidMotion, wake_motion: RigidMotion | None = None) -> Instant:
    """The steady flow of a constant motion; the wake may follow another one (a frozen wake)."""
    parts = []
    for wake in _wakes(influence, wake_motion or motion):
        weights = np.ones((1, *wake.circulation.shape))
        parts.append(influence.strips(wake.lines, weights, wake.far)[0])
    return Instant(influence, motion, np.zeros((3, len(influence.places))), np.concatenate(parts, axis=-1))


def _wakes(influence: Influence, motion: RigidMotion) -> list[WakeSheet]:
    first = 0.25 * float(np.min(influence.lattice.strips.chord))
    return [
        steady_wake(sheet.nodes[-1], motion, first, WAKE_SPANS * influence.lattice.size)
        for sheet in influence.lattice.sheets
    ]


class March:
    """A lattice that moves and sheds its wake.

    ``instant = march.advance(time, motion)``, then ``march.accept(instant.circulation())``, again and again; what comes
    between is the business of a section model. The first advance, to time 0, is the instant after a jump: the wake is
    still that of the steady state before.

    Parameters
    ----------
    influence : Influence
    before : RigidMotion
        The steady motion before.
    circulation : ndarray
        Of that steady state (P,).
    frozen : RigidMotion, optional
        What the wake follows instead of the body's own motion.
    """

    def __init__(
        self, influence: Influence, before: RigidMotion, circulation: Array, frozen: RigidMotion | None = None
    ) -> None:
        self._influence = influence
        self._frozen = frozen
        self._motion = frozen or before
        lattice = influence.lattice
        ends = [0, *accumulate(sheet.columns for sheet in lattice.sheets)]
        self._columns = [slice(a, b) for a, b in pairwise(ends)]
        trailing = circulation[lattice.trailing]
        wakes = _wakes(influence, self._motion)
        self.wakes = [
            # the steady wake's lines count from the trailing edge, those of the march from where the wake begins
            replace(wake, lines=departure(wake.lines, wake.tangent, sheet.last_chord)).with_circulation(trailing[at])
            for wake, sheet, at in zip(wakes, lattice.sheets, self._columns, strict=True)
        ]
        self._earlier: list[tuple[float, Array]] = []
        self._time = 0.0

    @property
    def circulation(self) -> Array:
        """Of the panels at the last accepted instant (P,)."""
        return self._earlier[-1][1]

    def advance(self, time: float, motion: RigidMotion) -> Instant:
        """Go on to a time [s] and a motion: the wake is left behind, a new line is shed."""
        followed = self._frozen or motion
        influence = self._influence
        self._leave(time - self._time, followed)
        near = np.zeros((3, len(influence.places), influence.lattice.n_strips))
        older = np.zeros((3, len(influence.places)))
        for wake, sheet, at in zip(self.wakes, influence.lattice.sheets, self._columns, strict=True):
            rings = cut(wake, sheet.nodes[-1], sheet.last_chord)
            young = rings.young
            weights = np.concatenate([rings.share[:young], np.zeros((1, sheet.columns))])[None]
            near[:, :, at] = influence.strips(rings.nodes[: young + 1], weights, rings.far)[0]
            older += influence.sheet(rings.nodes, rings.strength, rings.tail, rings.far)
        self._motion, self._time = followed, time
        weight, history = self._difference(time)
        return Instant(influence, motion, older, near, history, weight)

    def _leave(self, step: float, followed: RigidMotion) -> None:
        """Leave the wakes behind for a step [s], and begin new lines of a circulation that is not known yet."""
        mean = self._motion.mean(followed)
        matrix, shift = mean.carried(step)
        wakes = []
        for wake, sheet in zip(self.wakes, self._influence.lattice.sheets, strict=True):
            edge = sheet.nodes[-1]
            wind = -followed.at(edge)
            speed = np.linalg.norm(wind, axis=1)
            moving = speed[:, None] > 0.0
            away = np.where(moving, wind / np.where(moving, speed[:, None], 1.0), wake.far)
            line = departure(edge, away, sheet.last_chord)
            carried = wake.carried(matrix, shift, step * np.linalg.norm(mean.at(edge), axis=1))
            fresh = carried.after(line, np.zeros(sheet.columns), away)
            wakes.append(fresh.thinned() if len(fresh.lines) % _THINNED_EVERY == 0 else fresh)
        self.wakes = wakes

    def accept(self, circulation: Array) -> None:
        """Keep the circulation (P,) of the instant that was advanced to."""
        self._earlier = [*self._earlier[-1:], (self._time, circulation)]
        trailing = circulation[self._influence.lattice.trailing]
        for wake, at in zip(self.wakes, self._columns, strict=True):
            wake.circulation[0] = trailing[at]

    def _difference(self, time: float) -> tuple[float, tuple[tuple[float, Array], ...]]:
        """Weights of dGamma/dt: second order backwards, first order at the first step, none at the first instant."""
        if not self._earlier:
            return 0.0, ()
        one, last = self._earlier[-1]
        h = time - one
        if len(self._earlier) == 1:
            return 1.0 / h, ((-1.0 / h, last),)
        two, before = self._earlier[0]
        g = one - two
        return (2.0 * h + g) / (h * (h + g)), ((-(h + g) / (h * g), last), (h / (g * (h + g)), before))
