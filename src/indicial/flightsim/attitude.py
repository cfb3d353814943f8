"""Quaternions, rotation matrices and Euler angles of body axes in earth axes, for arrays of attitudes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array


def quaternion_from_matrix(rotation: ArrayLike) -> Array:
    """Unit quaternion (scalar first, scalar >= 0) of a rotation matrix body -> earth, shape (4,)."""
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(np.asarray(rotation, dtype=float)).as_quat(canonical=True)
    return np.array([w, x, y, z])


def matrix_from_quaternion(quaternion: ArrayLike) -> Array:
    """Rotation matrices body -> earth of quaternions ``(..., 4)`` of any norm, shape (..., 3, 3)."""
    q = np.asarray(quaternion, dtype=float)
    w, x, y, z = np.moveaxis(q / np.linalg.norm(q, axis=-1, keepdims=True), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def quaternion_from_euler(yaw: float, pitch: float, roll: float) -> Array:
    """Quaternion of the z-y-x Euler angles psi, theta, phi [rad], shape (4,)."""
    cy, sy, cp, sp = math.cos(yaw / 2), math.sin(yaw / 2), math.cos(pitch / 2), math.sin(pitch / 2)
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def euler_angles(quaternion: ArrayLike) -> Array:
    """Euler angles (yaw, pitch, roll) [rad] of quaternions ``(..., 4)``, shape (..., 3)."""
    r = matrix_from_quaternion(quaternion)
    yaw = np.arctan2(r[..., 1, 0], r[..., 0, 0])
    pitch = -np.arcsin(np.clip(r[..., 2, 0], -1.0, 1.0))
    roll = np.arctan2(r[..., 2, 1], r[..., 2, 2])
    return np.stack([yaw, pitch, roll], axis=-1)
