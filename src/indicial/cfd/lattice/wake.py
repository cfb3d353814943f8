r"""Wakes that stay in still air where they were shed.

In body axes an air particle at rest moves by ``dr/dt = -(V_b + omega x (r - r0))``. At every instant a row of
corners is shed at a quarter of the way that the trailing edge has gone since the last one (as the bound filaments
stand at a quarter of their panels), and what circulation the trailing edge had then stays in the ring between two rows.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import expm

from indicial.conventions import Array

WakeModel = Literal["shed", "frozen"]
"""``shed``: in still air, where the body was. ``frozen``: carried along the stream of the flight condition, whatever
the body does: the wake of linear theory."""

SHED_AT = 0.25
"""Where a new row stands on the way back to the last one."""

_TURN_STEP = 0.1
_GROWTH = 1.15


@dataclass(frozen=True)
class RigidMotion:
    """Velocity of the point r0 and rate of a body, mesh axes: [m/s], [rad/s], [m], each of shape (3,)."""

    velocity: Array
    rate: Array
    centre: Array

    def at(self, points: Array) -> Array:
        """Velocity of points of the body (..., 3) [m/s]."""
        return np.asarray(self.velocity + np.cross(self.rate, points - self.centre))

    def mean(self, other: RigidMotion) -> RigidMotion:
        """Half way to another motion."""
        return RigidMotion(0.5 * (self.velocity + other.velocity), 0.5 * (self.rate + other.rate), self.centre)

    def carried(self, time: float) -> tuple[Array, Array]:
        """``r -> M r + d`` of still air in body axes in a time [s], exact for a constant motion."""
        p, q, r = self.rate
        generator = np.zeros((4, 4))
        generator[:3, :3] = [[0.0, r, -q], [-r, 0.0, p], [q, -p, 0.0]]
        generator[:3, 3] = -self.velocity - generator[:3, :3] @ self.centre
        moved = expm(generator * time)
        return moved[:3, :3], moved[:3, 3]


@dataclass(frozen=True)
class WakeSheet:
    """The wake of one sheet, newest first.

    Parameters
    ----------
    nodes : ndarray
        Corners of its rings (rows + 1, columns + 1, 3), body axes [m].
    strength : ndarray
        Circulation of its rings (rows, columns).
    tail : ndarray
        Of the strips that go on from the last row to infinity, shape (columns,).
    far : ndarray
        Where to, a unit vector (3,).
    """

    nodes: Array
    strength: Array
    tail: Array
    far: Array

    def carried(self, matrix: Array, shift: Array) -> WakeSheet:
        """As it stands in body axes after a time; see `RigidMotion.carried`."""
        return WakeSheet(self.nodes @ matrix.T + shift, self.strength, self.tail, matrix @ self.far)

    def shed(self, corners: Array, circulation: Array) -> WakeSheet:
        """With a new row of corners in front, and a ring of the circulation (columns,) behind it."""
        nodes = np.concatenate([corners[None], self.nodes])
        return WakeSheet(nodes, np.concatenate([circulation[None], self.strength]), self.tail, self.far)

    def with_circulation(self, circulation: Array) -> WakeSheet:
        """All along of the same circulation (columns,), as in steady flow."""
        return WakeSheet(self.nodes, np.tile(circulation, (len(self.nodes) - 1, 1)), circulation, self.far)


def steady_wake(edge: Array, motion: RigidMotion, first: float, length: float) -> WakeSheet:
    """The wake of a body in steady motion, of no circulation yet.

    Straight to infinity without rotation; with it on helices, by rows of `first` [m] and longer, a tenth of a radian at
    most, until `length` [m], and straight on from there.
    """
    empty = np.zeros((0, edge.shape[0] - 1)), np.zeros(edge.shape[0] - 1)
    turning = float(np.linalg.norm(motion.rate))
    speed = max(float(np.linalg.norm(motion.at(point))) for point in edge)
    if turning == 0.0 or turning * length < 1e-12 * speed:
        return WakeSheet(edge[None], *empty, -motion.velocity / np.linalg.norm(motion.velocity))
    rows, gone, step = [edge], 0.0, first / speed
    while gone * speed < length:
        matrix, shift = motion.carried(step)
        rows.append(rows[-1] @ matrix.T + shift)
        gone += step
        step = min(_GROWTH * step, _TURN_STEP / turning)
    nodes = np.stack(rows)
    away = -np.mean(motion.at(nodes[-1]), axis=0)
    return WakeSheet(nodes, np.zeros((len(nodes) - 1, edge.shape[0] - 1)), empty[1], away / np.linalg.norm(away))
