"""What every stage is given, and what it returns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from indicial.case import Case
from indicial.derivatives import DerivativeTable
from indicial.pipeline.folder import RunFolder
from indicial.pipeline.pool import SolverFactory
from indicial.pipeline.progress import Reporter

FactoryMaker = Callable[[Case, RunFolder], SolverFactory]


@dataclass(frozen=True)
class Context:
    """One run.

    Parameters
    ----------
    case : Case
    folder : RunFolder
    workers : int
        Processes that share the CFD.
    reporter : Reporter
    make_factory : callable
        Makes the factory of the solver; another one than the finite-volume solver's may be given.
    """

    case: Case
    folder: RunFolder
    workers: int
    reporter: Reporter
    make_factory: FactoryMaker

    def derivatives(self, stage: str) -> DerivativeTable:
        """The derivatives that a stage left."""
        return DerivativeTable.from_records(self.folder.read(stage)["derivatives"])


@dataclass(frozen=True)
class Outcome:
    """What a stage leaves.

    Parameters
    ----------
    results : dict
        Plain values, kept as ``STAGE.json``.
    summary : str
        One line for the terminal.
    """

    results: dict[str, Any]
    summary: str
