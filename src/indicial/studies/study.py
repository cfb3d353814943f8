"""What a study is: pieces to compute, figures that were asked for, and pictures."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from indicial.studies.claim import Claim
from indicial.studies.kept import Results
from indicial.studies.piece import Piece, PieceResult

Progress = Callable[[float], None]
"""Told the fraction of a piece that is done, 0 to 1."""


@dataclass(frozen=True)
class Study:
    """A named study.

    Parameters
    ----------
    name : str
        On the command line, and of its folder of kept results.
    title : str
    pieces : tuple of Piece
        In the order in which they are best computed.
    compute : callable
        Piece, work folder and progress to result; a function of a module, so that a worker process finds it.
    claims : callable
        The figures asked for, from the results.
    draw : callable
        Writes the pictures of the results into a folder and returns their paths.
    subsets : dict
        Names of pieces that are cheap enough to be computed again as a check, by the subset's name.
    """

    name: str
    title: str
    pieces: tuple[Piece, ...]
    compute: Callable[[Piece, Path, Progress | None], PieceResult]
    claims: Callable[[Results], tuple[Claim, ...]]
    draw: Callable[[Results, Path], tuple[Path, ...]]
    subsets: dict[str, tuple[str, ...]]
