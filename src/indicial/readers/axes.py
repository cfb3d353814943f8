r"""From a file's axes to the six coefficients: the one place where signs change.

A frame is turned into mesh axes (x aft, y right, z up), pitched onto the body, and taken to body axes (x forward, y
right, z down) by `conventions.body_from_mesh`; ``CA = -CX``, ``CN = -CZ``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from indicial.conventions import COEFFICIENTS, Array, body_from_mesh
from indicial.errors import InputError
from indicial.readers.table import Table

FRAMES: dict[str, Array] = {
    "x aft, z up": np.eye(3),
    # a plane mesh: its z points to the left, so a positive moment about it is nose down
    "x aft, y up": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]),
    "x forward, z down": np.diag([-1.0, 1.0, -1.0]),
    # along the wind and across it, as it was before the motion
    "drag, side, lift": np.eye(3),
}
"""Frame to the matrix that takes its components to mesh axes."""

FORCES, MOMENTS = ("Fx", "Fy", "Fz"), ("Mx", "My", "Mz")
_COEFFICIENTS = ("Cx", "Cy", "Cz", "Cmx", "Cmy", "Cmz")
_WIND = ("CD", "CS", "CL", "CmRoll", "CmPitch", "CmYaw")
_LARGE = 1e-12


@dataclass(frozen=True)
class FileLoads:
    """Loads in a file's axes.

    Parameters
    ----------
    values : ndarray
        Three components of force, three of moment, shape (n, 6); zero where the file has none.
    known : tuple of bool
        Which components the file holds.
    dimensional : bool
        Whether they are in N and N m.
    """

    values: Array
    known: tuple[bool, ...]
    dimensional: bool


def file_loads(table: Table, columns: dict[str, str], frame: str) -> FileLoads:
    """The columns of a table that the map names, in the order of the frame's components.

    Raises
    ------
    InputError
        If the names are not all of one kind, or not of the frame.
    """
    coefficients = _WIND if frame == "drag, side, lift" else _COEFFICIENTS
    families = {False: coefficients, True: (*FORCES, *MOMENTS)}
    for dimensional, names in families.items():
        if columns and set(columns) <= set(names):
            values = np.zeros((len(table), 6))
            for quantity, column in columns.items():
                values[:, names.index(quantity)] = table[column]
            return FileLoads(values, tuple(name in columns for name in names), dimensional)
    allowed = "; or ".join(", ".join(names) for names in families.values())
    raise InputError(f"columns are {', '.join(columns)}; in the frame {frame!r} there are {allowed}")


def body_coefficients(
    loads: Array, known: tuple[bool, ...], frame: str, pitch: Array, pitch_axis: str
) -> tuple[Array, tuple[str, ...]]:
    """(CA, CY, CN, Cl, Cm, Cn), shape (n, 6), and the names of those that the file tells.

    Parameters
    ----------
    loads : ndarray
        Dimensionless components in the frame, shape (n, 6).
    known : tuple of bool
        Which of them the file holds.
    frame : str
        Of `FRAMES`.
    pitch : ndarray
        Nose-up angle of the body against the frame [rad], shape (n,).
    pitch_axis : {"right", "left"}
        Of the frame ``drag, side, lift``: where the axis of its pitching moment points.
    """
    if frame == "drag, side, lift" and pitch_axis == "left":
        loads = loads * np.array([1.0, 1.0, 1.0, 1.0, -1.0, 1.0])
    turn = FRAMES[frame]
    parts, told = [], []
    for name, group in (("force", slice(0, 3)), ("moment", slice(3, 6))):
        mesh = loads[:, group] @ turn.T
        there = np.abs(turn) @ np.array(known[group], dtype=float) > 0.0
        if np.max(np.abs(np.sin(pitch)), initial=0.0) > _LARGE:
            if there[0] != there[2]:
                raise InputError(
                    f"the body is pitched against the frame {frame!r}: of its {name} both components in the plane "
                    "of pitch are needed, the map names one"
                )
            mesh = _pitched(mesh, pitch)
        parts.append(body_from_mesh(mesh) * (np.array([-1.0, 1.0, -1.0]) if name == "force" else 1.0))
        told += [bool(one) for one in there]
    return np.hstack(parts), tuple(name for name, is_told in zip(COEFFICIENTS, told, strict=True) if is_told)


def _pitched(mesh: Array, pitch: Array) -> Array:
    """Components along axes turned nose up by `pitch`: with the nose up, the aft axis points down."""
    c, s = np.cos(pitch), np.sin(pitch)
    x, y, z = mesh.T
    return np.stack([c * x - s * z, y, s * x + c * z], axis=1)
