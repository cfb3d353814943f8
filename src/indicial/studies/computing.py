"""Computing the pieces of a study: those that are missing, one by one or side by side, each kept once it is there."""

from __future__ import annotations

import logging
import multiprocessing
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np

from indicial.errors import DivergenceError, InputError
from indicial.pipeline.progress import Reporter
from indicial.studies.kept import Results
from indicial.studies.piece import Piece, PieceResult, read_result, write_result
from indicial.studies.study import Progress, Study

log = logging.getLogger(__name__)

AGREEMENT = 1e-4
"""Largest relative difference of a recomputed derivative from the kept one. Steady states are converged to 1e-10 of
still air's residual and linear systems to 1e-8; a different order of summation is amplified by the flow's own
conditioning to no more than some 1e-6 of a derivative."""


def matching(study: Study, pattern: str) -> tuple[Piece, ...]:
    """Pieces whose names match a pattern with ``*`` and ``?``, several patterns parted by commas.

    Raises
    ------
    InputError
        If none does.
    """
    parts = [part.strip() for part in pattern.split(",")]
    found = [piece for part in parts for piece in study.pieces if fnmatchcase(piece.name, part)]
    if not found:
        raise InputError(f"no piece of study {study.name!r} matches {pattern!r}; one is {study.pieces[0].name}")
    return tuple({piece.name: piece for piece in found}.values())


def compute(study: Study, pieces: Sequence[Piece], folder: Path, workers: int, reporter: Reporter) -> dict[str, str]:
    """Compute those of `pieces` that are not in `folder` yet; what went wrong, by name of the piece.

    A piece that fails does not stop the others.
    """
    missing = [piece for piece in pieces if read_result(piece, folder) is None]
    failed: dict[str, str] = {}
    if workers > 1:
        _side_by_side(study, missing, folder, workers, reporter, failed)
        return failed
    for count, piece in enumerate(missing):
        reporter.start(piece.name)
        begun = time.perf_counter()

        def progress(fraction: float, count: int = count, name: str = piece.name) -> None:
            reporter.update((count + fraction) / len(missing), f"{name}, {count} of {len(missing)} done")

        _report(piece, _attempt(study, piece, folder, progress), begun, reporter, failed)
    return failed


def _side_by_side(
    study: Study, missing: Sequence[Piece], folder: Path, workers: int, reporter: Reporter, failed: dict[str, str]
) -> None:
    reporter.start(f"{len(missing)} pieces")
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool:
        running = {pool.submit(_attempt, study, piece, folder, None): piece for piece in missing}
        begun = time.perf_counter()
        for count, done in enumerate(as_completed(running), start=1):
            reporter.update(count / len(missing), f"{count} of {len(missing)} pieces done")
            _report(running[done], done.result(), begun, reporter, failed)


def _attempt(study: Study, piece: Piece, folder: Path, progress: Progress | None) -> PieceResult | str:
    """The result, kept in the folder, or what went wrong."""
    try:
        result = study.compute(piece, folder, progress)
    except (DivergenceError, InputError) as error:
        return str(error)
    write_result(result, folder)
    return result


def _report(piece: Piece, outcome: PieceResult | str, begun: float, reporter: Reporter, failed: dict[str, str]) -> None:
    if isinstance(outcome, str):
        failed[piece.name] = outcome
        log.error("%s: %s", piece.name, outcome)
    text = f"FAILED: {outcome}" if isinstance(outcome, str) else f"{len(outcome.derivatives)} derivatives"
    reporter.finish(time.perf_counter() - begun, f"{piece.name}: {text}")


def recompute(study: Study, subset: str, workers: int, reporter: Reporter) -> list[Drift]:
    """Compute a subset of the pieces from nothing and compare it with the kept results.

    Raises
    ------
    InputError
        If there is no such subset, or a piece of it is not kept.
    """
    if subset not in study.subsets:
        raise InputError(f"no subset {subset!r} of study {study.name!r}; there are {', '.join(study.subsets)}")
    pieces = matching(study, ",".join(study.subsets[subset]))
    kept = Results.kept(study.name, pieces)
    with tempfile.TemporaryDirectory() as folder:
        failed = compute(study, pieces, Path(folder), workers, reporter)
        if failed:
            raise DivergenceError("; ".join(f"{name}: {reason}" for name, reason in failed.items()))
        return [drift(kept, result) for result in Results.computed(Path(folder), pieces)]


@dataclass(frozen=True)
class Drift:
    """How far a recomputed piece lies from the kept one.

    Parameters
    ----------
    piece : str
    derivative : str
        The one that differs most.
    difference : float
        Relative to the kept value.
    """

    piece: str
    derivative: str
    difference: float

    @property
    def agrees(self) -> bool:
        """Whether the kept numbers are still those of the code."""
        return bool(np.isfinite(self.difference)) and self.difference <= AGREEMENT

    def summary(self) -> str:
        """One line."""
        verdict = "agrees" if self.agrees else "DIFFERS"
        return f"{self.piece:<44} {verdict}: {self.derivative} by {self.difference:.1e} (at most {AGREEMENT:.0e})"


def drift(kept: Results, again: PieceResult) -> Drift:
    """Compare a recomputed piece with its kept result.

    Raises
    ------
    InputError
        If the piece is not kept, or does not hold the same derivatives.
    """
    name = again.piece.name
    before = kept.by_name().get(name)
    if before is None:
        raise InputError(f"{name} is not among the kept results")
    pairs = list(zip(before.derivatives, again.derivatives, strict=False))
    labels = [[(r.name, r.k, r.reduction) for r in one.derivatives] for one in (before, again)]
    if labels[0] != labels[1]:
        raise InputError(f"{name}: the kept result does not hold the derivatives that are computed now")
    differences = [abs(new.value - old.value) / max(abs(old.value), 1e-12) for old, new in pairs]
    worst = int(np.argmax(differences))
    record = pairs[worst][0]
    label = record.name if record.k is None else f"{record.name} at k = {record.k:g}"
    return Drift(name, label, differences[worst])
