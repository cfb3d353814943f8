r"""What bound rings and wakes induce at a lattice's points, in compressible flow too.

In the linear theory of subsonic flow the potential of a lattice at Mach number M is that of an incompressible one
that is drawn out by ``1/beta`` along x, ``beta^2 = 1 - M^2``, with the same normalwash and the same potential jumps
(Goethert's rule in the form of Prandtl and Glauert). So points and filaments are drawn out before
Biot and Savart's law, and the velocity along x is divided by beta after it. Steady flow gets its linear
compressibility from this. Unsteady flow gets the same factor at every instant, as if pressure signals ran at
once: it is good while ``k M^2/beta^2`` is small, and says nothing of the first ``2M/(1 - M)`` reduced
times after a jump.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from indicial.cfd.lattice.biot_savart import ring_velocities, sheet_velocity, strip_velocities
from indicial.cfd.lattice.panels import Lattice
from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError

LARGEST_MACH = 0.7
"""Beyond it thin surfaces at incidence have supersonic pockets, and the linear rule fails."""


@dataclass(frozen=True)
class Influence:
    """Of a lattice at one Mach number.

    Points are, in this order, the P collocation points, the middles of the P sides across, and those of the E sides
    along.

    Parameters
    ----------
    lattice : Lattice
    beta : float
        ``sqrt(1 - M^2)``; 1 in incompressible flow.
    core : float
        Radius of the cores of wake filaments [m].
    bound : ndarray
        Velocities at the points per unit circulation of each panel, shape (3, n_points, P) [1/m].
    """

    lattice: Lattice
    beta: float
    core: float
    bound: Array

    @classmethod
    def of(cls, lattice: Lattice, mach: float, core: float) -> Self:
        """For one Mach number; 0 for incompressible flow.

        Raises
        ------
        InputError
            If the flow is beyond `LARGEST_MACH`.
        """
        if not 0.0 <= mach <= LARGEST_MACH:
            raise InputError(f"Mach number is {mach:g}, the vortex lattice is good up to {LARGEST_MACH:g}")
        beta = math.sqrt(1.0 - mach**2)
        drawn = np.array([1.0 / beta, 1.0, 1.0])
        places = np.concatenate([lattice.collocation, lattice.across[0], lattice.along[0]])
        bound = np.empty((3, len(places), lattice.n_panels))
        ring_velocities(np.ascontiguousarray(lattice.corners * drawn), np.ascontiguousarray(places * drawn), bound)
        bound[0] /= beta
        return cls(lattice, beta, core, bound)

    @cached_property
    def places(self) -> Array:
        """The points [m], shape (n_points, 3)."""
        return np.concatenate([self.lattice.collocation, self.lattice.across[0], self.lattice.along[0]])

    @cached_property
    def _drawn(self) -> Array:
        return np.array([1.0 / self.beta, 1.0, 1.0])

    @cached_property
    def _drawn_places(self) -> Array:
        return np.ascontiguousarray((self.places * self._drawn).T)

    @cached_property
    def inverse(self) -> Array:
        """Circulation per normalwash without a wake, shape (P, P) [m].

        Raises
        ------
        DivergenceError
            If panels coincide.
        """
        p = self.lattice.n_panels
        matrix = self.normal(self.bound[:, :p])
        try:
            inverse = np.asarray(np.linalg.inv(matrix), dtype=float)
        except np.linalg.LinAlgError:
            inverse = np.full(matrix.shape, np.nan)
        if not np.all(np.isfinite(inverse)):
            raise DivergenceError("the lattice's influence matrix is singular: do two surfaces coincide?")
        return inverse

    def impulse(self, jump: Array) -> Array:
        """Circulation (P,) that a jump of the panels' velocity (P, 3) [m/s] gives at once: the wake has no part in it.

        It ends at the trailing edge, and the added mass of a plate is exact for any number of panels along the chord.
        """
        return np.asarray(self.inverse @ np.sum(jump * self.lattice.normal, axis=1))

    def normal(self, velocity: Array) -> Array:
        """Components along the normals of velocities at the collocation points (3, P, ...), shape (P, ...)."""
        return np.asarray(np.einsum("cp...,pc->p...", velocity, self.lattice.normal))

    def sheet(self, nodes: Array, strength: Array, tail: Array, far: Array) -> Array:
        """Velocity (3, n_points) from a wake; see `sheet_velocity`."""
        out = np.zeros((3, len(self.places)))
        sheet_velocity(
            np.ascontiguousarray(nodes * self._drawn),
            strength,
            tail,
            self._far(far),
            self._core2,
            self._drawn_places,
            out,
        )
        out[0] /= self.beta
        return out

    def strips(self, nodes: Array, weights: Array, far: Array) -> Array:
        """Velocities (n_weights, 3, n_points, columns) per unit strength of a wake's strips; see `strip_velocities`."""
        out = np.empty((len(weights), 3, nodes.shape[1] - 1, len(self.places)))
        drawn = np.ascontiguousarray(nodes * self._drawn)
        strip_velocities(drawn, np.ascontiguousarray(weights), self._far(far), self._core2, self._drawn_places, out)
        out[:, 0] /= self.beta
        return out.transpose(0, 1, 3, 2)

    @property
    def _core2(self) -> float:
        return self.core**2

    def _far(self, direction: Array) -> Array:
        drawn: Array = direction * self._drawn
        return drawn / np.linalg.norm(drawn)
