r"""Modes that change smoothly with Mach number and angle of attack, fitted to step responses at several points at once.

The logarithms of the poles are polynomials of the flight condition, so the modes decay at every condition, between the
points as at them, and each mode keeps its identity from one end of the schedule to the other. Amplitudes are free at
each point: they follow from a linear problem (`mode_fitting`), and so change as smoothly as data and poles do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.polynomial import polyvander2d
from scipy.interpolate import BarycentricInterpolator, CubicSpline
from scipy.optimize import least_squares

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.rom.mode_fitting import LinearFit, TimeTarget, gradient_of, solve
from indicial.rom.modes import Modes

_WORST_CANCELLATION = 1e3
_NEAR = 0.03  # what a pole pays for leaving its start by a factor of e: what data do not show stays where it is


@dataclass(frozen=True)
class Nodes:
    """Where a schedule is known: every Mach number with every angle of attack.

    Parameters
    ----------
    mach, alpha : ndarray
        Increasing; alpha in rad. Points are numbered with alpha running fastest.
    """

    mach: Array
    alpha: Array

    @classmethod
    def of(cls, points: Sequence[tuple[float, float]]) -> Nodes:
        """The grid that these points (Mach, alpha) fill, each once, in its order.

        Raises
        ------
        InputError
            If they do not fill one.
        """
        mach, alpha = (np.unique(np.round([point[i] for point in points], 12)) for i in (0, 1))
        grid = [(m, a) for m in mach for a in alpha]
        if len(points) != len(grid) or not np.allclose(np.array(points), np.array(grid), atol=1e-9):
            raise InputError("a schedule needs every Mach number with every angle of attack, once")
        return cls(mach, alpha)

    def weights(self, mach: float, alpha: float) -> Array:
        """Of each point in the interpolation: cubic splines, through fewer than four nodes one polynomial.

        Raises
        ------
        InputError
            Outside the nodes.
        """
        parts = []
        for name, nodes, value in (("Mach", self.mach, mach), ("alpha", self.alpha, alpha)):
            if not nodes[0] - 1e-9 <= value <= nodes[-1] + 1e-9:
                raise InputError(f"the schedule reaches from {name} {nodes[0]:g} to {nodes[-1]:g}, not to {value:g}")
            if nodes.size == 1:
                parts.append(np.ones(1))
            else:
                kind = CubicSpline if nodes.size > 3 else BarycentricInterpolator
                parts.append(np.asarray(kind(nodes, np.eye(nodes.size))(value), dtype=float))
        return np.asarray(np.kron(*parts), dtype=float)

    def features(self, mach: float, alpha: float, degree: int) -> Array:
        """Powers of the condition, scaled to -1 ... 1, that the logarithms of the poles are made of."""
        scaled, degrees = [], []
        for nodes, value in ((self.mach, mach), (self.alpha, alpha)):
            half = 0.5 * float(nodes[-1] - nodes[0])
            scaled.append(0.0 if half == 0.0 else (value - nodes[0]) / half - 1.0)
            degrees.append(min(degree, nodes.size - 1))
        found: Array = polyvander2d(scaled[0], scaled[1], degrees).ravel()
        return found

    @property
    def points(self) -> list[tuple[float, float]]:
        """(Mach, alpha) of every point."""
        return [(float(m), float(a)) for m in self.mach for a in self.alpha]


@dataclass(frozen=True)
class ModeFamily:
    """Modes of one input over a schedule.

    Parameters
    ----------
    real : int
        Number of real modes; the rest are pairs.
    degree : int
        Of the polynomials in each of Mach number and alpha.
    coefficients : ndarray
        Of `Modes.to_vector`, shape (n_features, order).
    """

    real: int
    degree: int
    coefficients: Array

    def at(self, nodes: Nodes, mach: float, alpha: float) -> Modes:
        """The modes at one condition."""
        return self.of_vector(nodes.features(mach, alpha, self.degree) @ self.coefficients)

    def of_vector(self, vector: Array) -> Modes:
        """The modes of `Modes.to_vector`."""
        pairs = (vector.size - self.real) // 2
        return Modes(np.ones(self.real), np.ones((pairs, 2))).from_vector(vector)


def fit_family(
    start: Modes, times: Array, nodes: Nodes, targets: Sequence[TimeTarget], degree: int, evaluations: int = 60
) -> tuple[ModeFamily, Array]:
    """Modes of least error over all points, and their amplitudes at each, shape (n_points, order, n_outputs).

    Parameters
    ----------
    start : Modes
        At one of the points.
    times : ndarray
        What time is measured by at each point, relative to that one: settling times, shape (n_points,).
    nodes : Nodes
    targets : sequence of TimeTarget
        One for each point.
    degree : int
        Of the polynomials.
    evaluations : int
        Most evaluations of the misfit.

    Raises
    ------
    InputError
        If the amplitudes are so large that they cancel: fewer modes do.
    """
    features = np.array([nodes.features(*point, degree) for point in nodes.points])
    vectors = np.array([Modes(start.rates / t, start.pairs / t).to_vector() for t in times])
    first = np.linalg.lstsq(features, vectors, rcond=None)[0]
    empty = ModeFamily(start.rates.size, degree, first)

    def fits(flat: Array) -> list[tuple[Modes, LinearFit]]:
        modes = [empty.of_vector(row) for row in features @ flat.reshape(first.shape)]
        return [(one, solve(one, target)) for one, target in zip(modes, targets, strict=True)]

    def misfit(flat: Array) -> Array:
        both = zip(fits(flat), targets, strict=True)
        parts = [target.residual(fit.basis, fit.amplitudes).ravel() for (_, fit), target in both]
        return np.concatenate([*parts, _NEAR * (flat - first.ravel())])

    def gradient(flat: Array) -> Array:
        rows = []
        for (modes, fit), target, feature in zip(fits(flat), targets, features, strict=True):
            own = gradient_of(modes, fit, target)
            rows.append((feature[None, :, None] * own[:, None, :]).reshape(len(own), -1))
        return np.vstack([*rows, _NEAR * np.eye(flat.size)])

    found = least_squares(misfit, first.ravel(), gradient, xtol=1e-6, ftol=1e-6, max_nfev=evaluations)
    amplitudes = np.array([fit.amplitudes for _, fit in fits(found.x)])
    sizes = np.array([np.max(np.abs(target.values), axis=0) for target in targets])
    if np.any(np.max(np.abs(amplitudes), axis=1) > _WORST_CANCELLATION * np.max(sizes)):
        raise InputError(f"{start.order} modes for each input cancel one another: take fewer")
    return ModeFamily(start.rates.size, degree, found.x.reshape(first.shape)), amplitudes
