r"""Two-sided rational Krylov projection of a linearised flow over a band, with a calibrated error estimate.

The error of the projection H_N is ``H - H_N = -r_C^T (ik E + J)^{-1} r_B``, r_B and r_C the residuals that it leaves in
the forward and the adjoint equations. So ``|H - H_N| ~ gamma ||r_B|| ||r_C||``, and gamma is known from the solutions
themselves: each, before it is taken in, shows the error of the projection that lacked it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from indicial.conventions import Array
from indicial.rom.model import ComplexArray
from indicial.rom.reduction import Interpolant, Nested, interpolate, nest, stabilise
from indicial.rom.snapshots import Snapshots, operators, residual_norms
from indicial.solver import LinearisedFlow

_SMALL_CHANNEL = 1e-3  # channels smaller than this part of the largest are measured by that part of it
_GRID = 200
_NEAR = 0.02  # of k: new solutions keep this distance from the old
_FAR = 10.0  # real shift, in k_max
_SLOWEST = 1e-4  # of the band: lowest reduced frequency of the grid


@dataclass(frozen=True)
class Unseen:
    """The flow's own response where the projection did not know it.

    Parameters
    ----------
    k : float
    solutions : ndarray
        Forward solutions, shape (n, n_inputs).
    transfer : ndarray
        H(ik), shape (n_outputs, n_inputs).
    """

    k: float
    solutions: ComplexArray
    transfer: ComplexArray


class Interpolation:
    """The projection on all solutions taken so far; starts with those at k = 0 and at the end of the band.

    A third is taken at a real shift far beyond the band. Where a stable flow has no poles it holds the projection to
    having none, and it tells the first instants of a step.

    Attributes
    ----------
    k : ndarray
        Grid over the band on which errors are estimated, shape (n_k,).
    full : Interpolant
        The projection, all states.
    stable : Nested
        Its stable part, to be cut down.
    discarded : ndarray
        Unstable poles that `stable` leaves out.
    transfer : ndarray
        Response of `full` on the grid, shape (n_k, n_outputs, n_inputs).
    scale : ndarray
        What the errors of each channel are relative to, shape (n_outputs, n_inputs).
    static, rate : ndarray
        The flow's own H(0) and H'(0).
    saturated : bool
        Whether the last solutions brought nothing new: the projection is the flow, to the solver's tolerance.
    """

    def __init__(self, flow: LinearisedFlow, k_max: float) -> None:
        self.flow = flow
        self.forward = Snapshots(flow)
        self.adjoint = Snapshots(flow, adjoint=True)
        self.k: Array = np.union1d(
            np.geomspace(_SLOWEST * k_max, k_max, _GRID // 2), np.linspace(0.0, k_max, _GRID // 2)
        )
        self.saturated = False
        self._gamma: Array | None = None
        self._start(k_max)

    @property
    def points(self) -> Array:
        """Reduced frequencies taken in, in their order."""
        return np.array([shift.imag for shift in self.forward.shifts if shift.real == 0.0])

    @property
    def calibrated(self) -> bool:
        """Whether a solution has shown how the error goes with the residuals."""
        return self._gamma is not None

    def look(self, k: float) -> Unseen:
        """Solve the flow at ik, forward, from the projection's own answer, and see how wrong that was."""
        grid = np.array([k])
        solutions = self.forward.solve(1j * k, -(self.full.right @ self.full.forward(grid)[0]))
        transfer = self.flow.d - self.flow.c @ solutions
        error = np.abs(transfer - self.full.transfer(grid)[0])
        ratio = error / np.maximum(self._residuals(grid)[0], 1e-300)
        self._gamma = ratio if self._gamma is None else np.maximum(self._gamma, ratio)
        return Unseen(k, solutions, transfer)

    def take(self, unseen: Unseen) -> None:
        """Take solutions in, with the adjoint ones at the same frequency."""
        grid = np.array([unseen.k])
        adjoint = self.adjoint.solve(1j * unseen.k, self.full.left @ self.full.adjoint(grid)[0])
        grown = [self.forward.extend(1j * unseen.k, unseen.solutions), self.adjoint.extend(1j * unseen.k, adjoint)]
        self.saturated = not any(grown)
        self._update()

    def error(self) -> Array:
        """Estimated ``|H - H_N|`` on the grid, shape (n_k, n_outputs, n_inputs)."""
        gamma = 1.0 if self._gamma is None else self._gamma
        return gamma * self._residuals(self.k)

    def worst(self) -> float:
        """Reduced frequency of the grid, away from those taken, where the estimated error is largest."""
        largest = np.max(self.error() / self.scale, axis=(1, 2))
        distance = np.min(np.abs(self.k[:, None] - self.points), axis=1)
        return float(self.k[np.argmax(np.where(distance > _NEAR * self.k, largest, -1.0))])

    def widest(self, others: Array) -> float:
        """Reduced frequency of the grid furthest from those taken and from `others`."""
        known = np.concatenate([self.points, others])
        distance = np.min(np.abs(self.k[:, None] - known), axis=1)
        return float(self.k[np.argmax(distance)])

    def _start(self, k_max: float) -> None:
        for shift in (0j, 1j * k_max, complex(_FAR * k_max)):
            for side in (self.forward, self.adjoint):
                side.extend(shift, side.solve(shift))
        x, y = self.forward, self.adjoint
        forward, adjoint = (side.basis @ side.coordinates(0j).real for side in (x, y))
        left = x.rhs - np.column_stack([self.flow.apply(column) for column in forward.T])
        mass = np.column_stack([self.flow.apply_mass(column) for column in forward.T])
        # what the forward solver left over is taken to the loads by the adjoint solution
        self.static: Array = self.flow.d - self.flow.c @ forward - adjoint.T @ left
        self.rate: Array = adjoint.T @ mass
        self._update()

    def _update(self) -> None:
        flow = operators(self.forward, self.adjoint)
        self.full: Interpolant = interpolate(flow, self.forward.gramian_factor(), self.adjoint.gramian_factor())
        self.transfer: ComplexArray = self.full.transfer(self.k)
        peak = np.max(np.abs(self.transfer), axis=0)
        self.scale: Array = np.maximum(peak, _SMALL_CHANNEL * np.max(peak, initial=1e-300))
        stable, self.discarded = stabilise(self.full, self.k, self.scale)
        self.stable: Nested = nest(stable, float(self.k[-1]), self.scale)
        self._factors = self.forward.residual_factor(), self.adjoint.residual_factor()

    def _residuals(self, k: Array) -> Array:
        """Product of the norms of adjoint and forward residuals, shape (n_k, n_outputs, n_inputs)."""
        forward = residual_norms(self._factors[0], k, -(self.full.right @ self.full.forward(k)))
        adjoint = residual_norms(self._factors[1], k, self.full.left @ self.full.adjoint(k))
        return np.asarray(adjoint[:, :, None] * forward[:, None, :])
