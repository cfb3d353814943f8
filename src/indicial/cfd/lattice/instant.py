r"""One instant of the flow about a lattice: its circulation and its loads.

With the relative wind W and the normals n, the circulation of the panels satisfies ``(A + A_near T) Gamma = -W.n - w``:
A of the bound rings, `A_near` of what leaves the trailing edge with the circulation it has now (T picks that), and w
the normalwash of the older wake. A section model adds its own normalwash there, strip by strip, so that each
strip carries the lift its section has at the incidence it meets.

Loads are those of Kutta and Joukowski on every bound filament, ``rho gamma W x l`` with all that is induced in W, hence
with the suction of the leading edge and the induced drag, and ``rho dGamma/dt A n`` on every ring.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from indicial.cfd.lattice.influence import Influence
from indicial.cfd.lattice.wake import RigidMotion
from indicial.conventions import Array, Index


@dataclass(frozen=True)
class StripLoads:
    """Loads of each strip per unit density, mesh axes: force [m^4/s^2] and moment about r0 [m^5/s^2], shapes (S, 3)."""

    force: Array
    moment: Array

    @property
    def total(self) -> tuple[Array, Array]:
        """Force and moment of all strips, each of shape (3,)."""
        return np.sum(self.force, axis=0), np.sum(self.moment, axis=0)


@dataclass(frozen=True)
class Instant:
    """The linear problem of one instant.

    Parameters
    ----------
    influence : Influence
    motion : RigidMotion
        Of the body now.
    older : ndarray
        Velocity (3, n_points) that the older wake induces at the points of `influence` [m/s].
    near : ndarray
        Velocities (3, n_points, S) per unit circulation at the trailing edge of each strip, of what leaves it now.
    history : tuple of (float, ndarray)
        ``dGamma/dt = weight Gamma + sum of weight_i Gamma_i``: weights [1/s] and circulations (P,) of earlier instants.
    weight : float
        That of this instant's own; 0 in steady flow.
    """

    influence: Influence
    motion: RigidMotion
    older: Array
    near: Array
    history: tuple[tuple[float, Array], ...] = field(default_factory=tuple)
    weight: float = 0.0

    @cached_property
    def wind(self) -> Array:
        """Relative wind of the undisturbed air at the points, shape (n_points, 3) [m/s]."""
        return -self.motion.at(self.influence.places)

    @cached_property
    def strip_wind(self) -> Array:
        """The same at three quarters of each strip's chord, where incidence is read, shape (S, 3) [m/s]."""
        return -self.motion.at(self.influence.lattice.strips.three_quarter_chord)

    @cached_property
    def normalwash(self) -> Array:
        """What the rings have to make up for: ``W.n`` with the older wake's part, shape (P,) [m/s]."""
        p = self.influence.lattice.n_panels
        wind = np.sum(self.wind[:p] * self.influence.lattice.normal, axis=1)
        return np.asarray(wind + self.influence.normal(self.older[:, :p]))

    @cached_property
    def _coupling(self) -> tuple[Array, Array]:
        """Circulation per circulation at the trailing edges (P, S), and the factor that closes it (S, S)."""
        lattice = self.influence.lattice
        through = self.influence.inverse @ self.influence.normal(self.near[:, : lattice.n_panels])
        closing = np.asarray(np.linalg.inv(np.eye(lattice.n_strips) + through[lattice.trailing]), dtype=float)
        return through, closing

    def circulation(self, wash: Array | None = None) -> Array:
        """Circulation of the panels (P,) [m^2/s].

        Parameters
        ----------
        wash : ndarray, optional
            Additional normalwash at the collocation points, upwards, shape (P,) [m/s].
        """
        right = -self.normalwash if wash is None else -(self.normalwash + wash)
        return self._solve(right)

    @cached_property
    def response(self) -> Array:
        """Circulation of the panels per unit of additional normalwash on all panels of a strip, shape (P, S) [m]."""
        lattice = self.influence.lattice
        spread = np.zeros((lattice.n_panels, lattice.n_strips))
        spread[np.arange(lattice.n_panels), lattice.strip] = -1.0
        return self._solve(spread)

    def _solve(self, right: Array) -> Array:
        through, closing = self._coupling
        alone = self.influence.inverse @ right
        found: Array = alone - through @ (closing @ alone[self.influence.lattice.trailing])
        return found

    def velocity(self, circulation: Array) -> Array:
        """Relative wind with all that is induced at the points, shape (n_points, 3) [m/s]."""
        trailing = circulation[self.influence.lattice.trailing]
        induced = self.influence.bound @ circulation + self.near @ trailing + self.older
        return np.asarray(self.wind + induced.T)

    def rate(self, circulation: Array) -> Array:
        """dGamma/dt of the panels (P,) [m^2/s^2]."""
        total: Array = self.weight * circulation
        for weight, earlier in self.history:
            total = total + weight * earlier
        return total

    def loads(self, circulation: Array, rate: Array | None = None) -> StripLoads:
        """Loads of the strips; `rate` stands in for dGamma/dt (P,) if given."""
        lattice = self.influence.lattice
        p = lattice.n_panels
        wind = self.velocity(circulation)[p:]
        known = np.append(circulation, 0.0)
        left, right = lattice.beside
        across = (circulation - known[lattice.ahead])[:, None] * np.cross(wind[:p], lattice.across[1])
        along = (known[left] - known[right])[:, None] * np.cross(wind[p:], lattice.along[1])
        changing = (self.rate(circulation) if rate is None else rate)[:, None] * lattice.load_area
        force, moment = np.zeros((lattice.n_strips + 1, 3)), np.zeros((lattice.n_strips + 1, 3))

        def collect(forces: Array, places: Array, strips: Index) -> None:
            np.add.at(force, strips, forces)
            np.add.at(moment, strips, np.cross(places - self.motion.centre, forces))

        collect(across, lattice.across[0], lattice.strip)
        collect(changing, lattice.load_centre, lattice.strip)
        # a side between two strips belongs to both by halves, one at a tip to its only one
        strip = np.append(lattice.strip, lattice.n_strips)
        for own, other in ((left, right), (right, left)):
            share = np.where(own == p, 0.0, np.where(other == p, 1.0, 0.5))
            collect(share[:, None] * along, lattice.along[0], strip[own])
        return StripLoads(force[:-1], moment[:-1])
