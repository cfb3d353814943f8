r"""The lattice linearised about a steady flight, exactly: small motions at any reduced frequency.

In reduced time ``s = 2Vt/c`` a small motion ``exp(iks)`` makes circulations of which a wake ring at distances x' has
the mean of ``exp(-2ik x'/c)``: the circulations satisfy ``(A + sum of m_r(k) A_r T) dGamma = -d(W.n)``, a system of
the size of the panels. Where the steady flight has lift, the wake that is left in still air is shed along the disturbed
path of the trailing edge, and what that changes of the wind is taken along: the response of a shed wake is that of the
march to small motions and small steps. A frozen wake stays where it is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from indicial.cfd.lattice.influence import Influence
from indicial.cfd.lattice.instant import Instant
from indicial.cfd.lattice.march import WAKE_SPANS, steady_instant
from indicial.cfd.lattice.shedding import START, departure, sides
from indicial.cfd.lattice.wake import RigidMotion
from indicial.conventions import Array, ReferenceQuantities, mesh_from_body, turning
from indicial.motion import FlightCondition

ComplexArray = NDArray[np.complex128]

WAKE_LENGTH = 1000.0
"""Length of the wake that is cut into rings, in the lattice's largest dimension: a strip's far field falls as 1/x^2."""

_DISPLACED = 1e-5
"""Displacement of wake lines for central differences, over the reference length per unit of input."""

_CHUNK = 8


@dataclass(frozen=True)
class LoadMatrices:
    """Six coefficients, linear in small changes about a steady flow.

    Parameters
    ----------
    circulation : ndarray
        Per circulation of the panels at a fixed wind, and what their bound filaments induce, shape (6, P) [s/m^2].
    wind : ndarray
        Per velocity at the filaments, those across before those along, shape (6, P + E, 3) [s/m].
    rate, whole_rate : ndarray
        Per dGamma/dt of the panels, without and with what is behind the last collocation point, shape (6, P) [s^2/m^2].
    """

    circulation: Array
    wind: Array
    rate: Array
    whole_rate: Array

    @classmethod
    def of(
        cls, instant: Instant, circulation: Array, condition: FlightCondition, reference: ReferenceQuantities
    ) -> LoadMatrices:
        """About a steady flow of these circulations (P,)."""
        lattice = instant.influence.lattice
        p = lattice.n_panels
        places, vectors = (np.concatenate([a, b]) for a, b in zip(lattice.across, lattice.along, strict=True))
        to_segments = _segments(instant.influence)
        strength = to_segments @ circulation
        centre = instant.motion.centre
        wind = instant.velocity(circulation)[p:]
        per_strength = _six(np.cross(wind, vectors), places - centre)
        axes = np.eye(3)
        per_wind = np.stack(
            [_six(strength[:, None] * np.cross(axis, vectors), places - centre) for axis in axes], axis=-1
        )
        rate = _six(lattice.load_area, lattice.load_centre - centre)
        whole = _six(lattice.ring_area, lattice.ring_centre - centre)
        induced = np.einsum("kse,esp->kp", per_wind, instant.influence.bound[:, p:])
        scale = np.concatenate([np.ones(3), mesh_from_body(np.ones(3)) / reference.moment_lengths])
        scale = (scale / (0.5 * condition.speed**2 * reference.area))[:, None]
        return cls(
            scale * (per_strength @ to_segments + induced), scale[..., None] * per_wind, scale * rate, scale * whole
        )


def _six(forces: Array, arms: Array) -> Array:
    """Force and moment of each, shape (6, n)."""
    return np.concatenate([forces.T, np.cross(arms, forces).T])


def _segments(influence: Influence) -> Array:
    """Strength of the filaments, those across before those along, per circulation of the panels, shape (P + E, P)."""
    lattice = influence.lattice
    p = lattice.n_panels
    left, right = lattice.beside
    out = np.zeros((p + len(left), p + 1))
    out[np.arange(p), np.arange(p)] = 1.0
    out[np.arange(p), lattice.ahead] -= 1.0
    rows = p + np.arange(len(left))
    out[rows, left] += 1.0
    out[rows, right] -= 1.0
    return out[:, :p]


@dataclass(frozen=True)
class LinearLattice:
    """The lattice linearised about a steady flight without rotation.

    `LinearLattice.about` makes one.

    Parameters
    ----------
    instant : Instant
    circulation : ndarray
        Of the steady flow (P,).
    baseline : ndarray
        Its six coefficients.
    loads : LoadMatrices
    rings : ndarray
        Distances x' of the sides of the wake's rings for each strip, from 0 on, shape (n + 1, S) [m].
    wash, lift : ndarray
        Normalwash (n + 1, P, S) and loads (n + 1, 6, S) per circulation of the wake's rings and, last, of its tail.
    condition : FlightCondition
    reference : ReferenceQuantities
    shed : bool
        Whether the wake is left in still air, or frozen.
    """

    instant: Instant
    circulation: Array
    baseline: Array
    loads: LoadMatrices
    rings: Array
    wash: Array
    lift: Array
    condition: FlightCondition
    reference: ReferenceQuantities
    shed: bool

    @classmethod
    def about(
        cls,
        influence: Influence,
        motion: RigidMotion,
        baseline: Array,
        condition: FlightCondition,
        reference: ReferenceQuantities,
        *,
        shed: bool,
    ) -> LinearLattice:
        """Linearise about a constant velocity."""
        instant = steady_instant(influence, motion)
        circulation = instant.circulation()
        loads = LoadMatrices.of(instant, circulation, condition, reference)
        rings, wash, lift = _ring_responses(influence, loads, _away(motion))
        return cls(instant, circulation, baseline, loads, rings, wash, lift, condition, reference, shed)

    @property
    def half_chord(self) -> float:
        """Distance per reduced time, c/2 [m]."""
        return 0.5 * self.reference.length

    def response(self, k: float, inputs: Sequence[str]) -> ComplexArray:
        """``H(ik)`` from inputs of alpha, beta, p, q, r to the six coefficients, shape (6, len(inputs))."""
        lag = 1j * k / self.half_chord
        weights = _ring_means(lag, self.rings)
        matrix = self.bound_wash.astype(complex)
        trailing = self.instant.influence.lattice.trailing
        matrix[:, trailing] += np.einsum("rs,rps->ps", weights, self.wash)
        wind = np.stack([self.wind(name, k) for name in inputs], axis=-1)
        p = self.instant.influence.lattice.n_panels
        normalwash = np.einsum("pci,pc->pi", wind[:p], self.instant.influence.lattice.normal)
        circulation = np.linalg.solve(matrix, -normalwash)
        rate = 1j * k * self.condition.speed / self.half_chord
        out: ComplexArray = (
            (self.loads.circulation + rate * self.loads.rate) @ circulation
            + np.einsum("rs,rks->ks", weights, self.lift) @ circulation[trailing]
            + np.einsum("kse,sei->ki", self.loads.wind, wind[p:])
        )
        return out

    @cached_property
    def bound_wash(self) -> Array:
        """Normalwash per circulation of the bound rings, shape (P, P) [1/m]."""
        influence = self.instant.influence
        return influence.normal(influence.bound[:, : influence.lattice.n_panels])

    def impulse(self, name: str) -> Array:
        """``integral of dC ds`` over a unit jump of an input: added masses, shape (6,)."""
        influence = self.instant.influence
        jump = self._disturbance(name).at(influence.places[: influence.lattice.n_panels])
        pushes = influence.impulse(jump)
        return np.asarray(self.loads.whole_rate @ pushes * self.condition.speed / self.half_chord)

    def _disturbance(self, name: str) -> RigidMotion:
        """Velocity and rate per unit of an input, mesh axes."""
        speed, nothing = self.condition.speed, np.zeros(3)
        centre = self.instant.motion.centre
        if name in ("alpha", "beta"):
            turned = turning(name, self.condition.alpha, self.condition.beta)
            return RigidMotion(mesh_from_body(speed * turned), nothing, centre)
        axis = np.eye(3)["pqr".index(name)]
        rate = axis * 2.0 * speed / self.reference.moment_lengths
        return RigidMotion(nothing, mesh_from_body(rate), centre)

    def wind(self, name: str, k: float, *, displaced: bool = True) -> ComplexArray:
        """Change of the wind at all points per unit of an input, at fixed circulations, shape (n_points, 3).

        With `displaced`, that of a shed wake's new place is in it.
        """
        disturbance = self._disturbance(name)
        wind = -disturbance.at(self.instant.influence.places).astype(complex)
        if displaced and self.shed and np.any(self.circulation):
            wind += self._displaced_wake(disturbance, k)
        return wind

    def _displaced_wake(self, disturbance: RigidMotion, k: float) -> ComplexArray:
        """What the steady wake's circulations induce more, shed along the disturbed path, shape (n_points, 3)."""
        influence = self.instant.influence
        lattice = influence.lattice
        away = _away(self.instant.motion)
        out = np.zeros((len(influence.places), 3), dtype=complex)
        step = _DISPLACED
        for sheet, at in zip(lattice.sheets, _columns(influence), strict=True):
            edge, chord = sheet.nodes[-1], sheet.last_chord
            circulation = self.circulation[lattice.trailing][at]
            relative = sides(WAKE_SPANS * influence.lattice.size / float(np.mean(chord)))
            path = np.outer(relative, chord)
            start = departure(edge, away, chord)
            nodes = np.concatenate([edge[None], start + path[..., None] * away])
            strength = np.tile(circulation, (len(relative), 1))
            moved = self._displacement(disturbance, k, start, path, chord)
            for part, unit in ((moved.real, 1.0), (moved.imag, 1.0j)):
                if not np.any(part):
                    continue
                shift = np.concatenate([np.zeros((1, *edge.shape)), part]) * step
                ahead, behind = (influence.sheet(nodes + sign * shift, strength, circulation, away) for sign in (1, -1))
                out += unit * (ahead - behind).T / (2.0 * step)
        return out

    def _displacement(
        self, disturbance: RigidMotion, k: float, start: Array, path: Array, chord: Array
    ) -> ComplexArray:
        """Of still air that left the sheet at `start` and has gone `path` (n, columns + 1) since, shape (..., 3) [m].

        ``-integral over the time since of (dV + domega x (r - r0)) exp(i omega t)`` along the steady path r; the start
        itself turns with the wind at the trailing edge.
        """
        speed = self.condition.speed
        lag = 1j * k / self.half_chord
        first, second = _integrals(lag, path)
        away = _away(self.instant.motion)
        constant = disturbance.at(start)
        growing = np.cross(disturbance.rate, away)
        moved = -(first[..., None] * constant + second[..., None] * growing) / speed
        wind = -disturbance.at(start + START * chord[:, None] * away)
        across = (wind - (wind @ away)[:, None] * away) / speed
        turned = -START * chord[:, None] * across * np.exp(-lag * path)[..., None]
        out: ComplexArray = moved + turned
        return out


def _away(motion: RigidMotion) -> Array:
    """Unit vector along the wind of a steady flight."""
    return np.asarray(-motion.velocity / np.linalg.norm(motion.velocity))


def _columns(influence: Influence) -> list[slice]:
    """Strips of each sheet."""
    ends = [0, *accumulate(sheet.columns for sheet in influence.lattice.sheets)]
    return [slice(a, b) for a, b in pairwise(ends)]


def _ring_responses(influence: Influence, loads: LoadMatrices, away: Array) -> tuple[Array, Array, Array]:
    """Sides of the rings (n + 1, S), and normalwash (n + 1, P, S) and loads (n + 1, 6, S) of each ring and the tail."""
    p = influence.lattice.n_panels
    cuts = [
        sides(WAKE_LENGTH * influence.lattice.size / float(np.mean(sheet.last_chord)))
        for sheet in influence.lattice.sheets
    ]
    n = max(len(cut) for cut in cuts)
    strips = influence.lattice.n_strips
    rings, wash, lift = np.zeros((n + 1, strips)), np.zeros((n + 1, p, strips)), np.zeros((n + 1, 6, strips))
    for sheet, relative, at in zip(influence.lattice.sheets, cuts, _columns(influence), strict=True):
        edge, chord = sheet.nodes[-1], sheet.last_chord
        nodes = np.concatenate([edge[None], departure(edge, away, chord) + np.outer(relative, chord)[..., None] * away])
        own = len(relative)
        rings[1 : own + 1, at] = np.outer(relative, 0.5 * (chord[1:] + chord[:-1]))
        rings[own + 1 :, at] = rings[own, at]
        for first in range(0, own + 1, _CHUNK):
            chosen = np.arange(first, min(first + _CHUNK, own + 1))
            weights = np.zeros((len(chosen), own + 1, sheet.columns))
            weights[np.arange(len(chosen)), chosen] = 1.0
            velocity = influence.strips(nodes, weights, away)
            rows = np.where(chosen == own, n, chosen)
            wash[rows, :, at] = np.einsum("rcps,pc->rps", velocity[:, :, :p], influence.lattice.normal)
            lift[rows, :, at] = np.einsum("kec,rces->rks", loads.wind, velocity[:, :, p:])
    return rings, wash, lift


def _ring_means(lag: complex, rings: Array) -> ComplexArray:
    """Means of ``exp(-lag x')`` over rings and, last, over a tail as long as all of them, shape (n + 1, S).

    The first ring has the panels' circulation of now, as in the march.
    """
    ends = np.concatenate([rings, 2.0 * rings[-1:]])
    lengths = np.diff(ends, axis=0)
    z = lag * lengths
    small = np.abs(z) < 1e-8
    ratio = np.where(small, 1.0 - 0.5 * z, -np.expm1(-z) / np.where(small, 1.0, z))
    means: ComplexArray = np.exp(-lag * ends[:-1]) * ratio
    means[0] = 1.0
    return means


def _integrals(lag: complex, path: Array) -> tuple[ComplexArray, ComplexArray]:
    """``int exp(-lag x) dx`` and ``int (path - x) exp(-lag x) dx`` over 0 < x < path, without cancellation."""
    z = lag * path
    small = np.abs(z) < 1e-3
    safe = np.where(small, 1.0, z)
    one = np.where(small, 1.0 - z / 2.0 + z**2 / 6.0 - z**3 / 24.0, -np.expm1(-z) / safe)
    two = np.where(small, 0.5 - z / 6.0 + z**2 / 24.0 - z**3 / 120.0, (1.0 - one) / safe)
    return path * one, path**2 * two
