"""How much memory a computation will take, asked before it starts."""

from __future__ import annotations

import psutil

from indicial.cfd.flow.grid import Grid
from indicial.errors import InputError

_DERIVATIVES, _FACE_WORK = 25 + 25 + 5 + 40 + 14, 5 + 10
"""Numbers a face: two 5x5 blocks, the swept slope, the slopes of the reconstruction and the geometry in blocks; fluxes
and sensitivities."""

_BLOCK, _STATE, _GRADIENT = 25, 5, 15
_WIDE_ROW = 25
"""Blocks a row of the wide preconditioner in a mesh of hexahedra."""

_REAL, _COMPLEX = 8, 16


def operator_bytes(grid: Grid, entries: int, *, restart: int, kept: int = 24) -> int:
    """Most bytes that the linearised flow on `grid` takes at a time, complex solves included.

    Parameters
    ----------
    entries : int
        Blocks of the preconditioner's pattern.
    restart : int
        Krylov vectors.
    kept : int
        Solutions from which others start; each has an image, and once more for a guess.
    """
    faces, cells = len(grid.owner), grid.n_cells
    real = faces * _DERIVATIVES + cells * (2 * _BLOCK + 2 * _GRADIENT + 3 * kept * _STATE)
    complex_ = faces * _FACE_WORK + cells * (2 * _BLOCK + 2 * _GRADIENT + (restart + 6) * _STATE)
    # factors are kept in single precision: real ones of k = 0, complex ones of one frequency, whose blocks go before
    factors = entries * _BLOCK * (_REAL // 2 + _COMPLEX // 2 + _COMPLEX)
    return _REAL * real + _COMPLEX * complex_ + factors


def steady_bytes(grid: Grid, *, restart: int = 40) -> int:
    """Most bytes that a steady state or a march on `grid` takes at a time."""
    faces, cells = len(grid.owner), grid.n_cells
    entries = cells * _WIDE_ROW
    real = faces * (_DERIVATIVES + _FACE_WORK) + cells * (3 * _BLOCK + 2 * _GRADIENT + (restart + 8) * _STATE)
    return _REAL * real + entries * _BLOCK * (_REAL + _REAL // 2)


def require(wanted: int, what: str) -> None:
    """Refuse to start what this machine has not the memory for.

    Raises
    ------
    InputError
        If `wanted` bytes are more than are available.
    """
    available = psutil.virtual_memory().available
    if wanted > available:
        raise InputError(
            f"{what} needs about {wanted / 1e9:.1f} GB of memory, {available / 1e9:.1f} GB are available: "
            "use a coarser mesh or a larger machine"
        )
