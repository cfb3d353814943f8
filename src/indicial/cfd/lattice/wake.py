r"""Rigid motions, and wakes that stay in still air where they were shed.

In body axes an air particle at rest moves by ``dr/dt = -(V_b + omega x (r - r0))``, and keeps the circulation that the
panels had when it left.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.linalg import expm

from indicial.conventions import Array

WakeModel = Literal["shed", "frozen"]
"""``shed``: in still air, where the body was. ``frozen``: carried along the stream of the flight condition, whatever
the body does: the wake of linear theory."""


CLOSEST = 0.02
"""Distance between the lines that are kept of an old wake, over how far they have come."""

_TURN_STEP = 0.05
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
    """What one sheet has shed: lines of still air, newest first, with the circulation that its columns had then.

    Parameters
    ----------
    lines : ndarray
        Where they are now, body axes, shape (n, columns + 1, 3) [m].
    path : ndarray
        How far they have come since, increasing, shape (n, columns + 1) [m].
    circulation : ndarray
        Linear between the lines, constant beyond the last, shape (n, columns) [m^2/s].
    tangent : ndarray
        Where the wind blew from each point of a line when it left, turned with the air since: the derivative of the
        lines along the path, shape (n, columns + 1, 3).
    far : ndarray
        Where the wake goes on from the last line to infinity, a unit vector (3,).
    """

    lines: Array
    path: Array
    circulation: Array
    tangent: Array
    far: Array

    def carried(self, matrix: Array, shift: Array, gone: Array) -> WakeSheet:
        """Where it is after a time in which still air has gone from the edge by `gone` (columns + 1,) [m]."""
        return replace(
            self,
            lines=self.lines @ matrix.T + shift,
            path=self.path + gone,
            tangent=self.tangent @ matrix.T,
            far=matrix @ self.far,
        )

    def after(self, line: Array, circulation: Array, tangent: Array) -> WakeSheet:
        """With a new line in front."""
        return WakeSheet(
            np.concatenate([line[None], self.lines]),
            np.concatenate([np.zeros((1, len(line))), self.path]),
            np.concatenate([circulation[None], self.circulation]),
            np.concatenate([tangent[None], self.tangent]),
            self.far,
        )

    def thinned(self) -> WakeSheet:
        """Without lines that stand closer than `CLOSEST` of their distance; the newest two and the last one stay."""
        path = np.mean(self.path, axis=1)
        kept = [0, 1]
        for n in range(2, len(path) - 1):
            if path[n] - path[kept[-1]] >= CLOSEST * path[n]:
                kept.append(n)
        kept.append(len(path) - 1)
        return WakeSheet(self.lines[kept], self.path[kept], self.circulation[kept], self.tangent[kept], self.far)

    def with_circulation(self, circulation: Array) -> WakeSheet:
        """All of the same circulation (columns,), as in steady flow."""
        return replace(self, circulation=np.tile(circulation, (len(self.lines), 1)))


def steady_wake(edge: Array, motion: RigidMotion, first: float, length: float) -> WakeSheet:
    """The wake of a body in steady motion, of no circulation yet.

    Straight to infinity without rotation; with it on helices, by lines `first` [m] apart and more, a twentieth of a
    radian at most, until `length` [m] or until it runs across the wind at the body, and straight on from there: a body
    in a steady loop or turn would otherwise fly into what it shed a whole turn ago. That of a body at rest runs aft.
    """
    turning = float(np.linalg.norm(motion.rate))
    speed = np.linalg.norm(motion.at(edge), axis=1)
    fastest = float(np.max(speed))
    if fastest == 0.0:
        aft = np.array([1.0, 0.0, 0.0])
        return WakeSheet(
            edge[None], np.zeros((1, len(edge))), np.zeros((1, len(edge) - 1)), np.tile(aft, (1, len(edge), 1)), aft
        )
    lines, path, step = [edge], [np.zeros(len(edge))], first / fastest
    forwards = np.mean(motion.at(edge), axis=0)
    if turning * length > 1e-12 * fastest:
        while np.max(path[-1]) < length and forwards @ np.mean(motion.at(lines[-1]), axis=0) > 0.0:
            matrix, shift = motion.carried(step)
            lines.append(lines[-1] @ matrix.T + shift)
            path.append(path[-1] + step * speed)
            step = min(_GROWTH * step, _TURN_STEP / turning)
    away = -np.mean(motion.at(lines[-1]), axis=0)
    nothing = np.zeros((len(lines), len(edge) - 1))
    found = np.stack(lines)
    tangent = -motion.at(found) / speed[:, None]
    return WakeSheet(found, np.stack(path), nothing, tangent, away / np.linalg.norm(away))
