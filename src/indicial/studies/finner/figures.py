"""The figures of the study."""

from __future__ import annotations

from pathlib import Path

from indicial.studies.kept import Results


def draw(results: Results, folder: Path) -> tuple[Path, ...]:
    """None yet."""
    return ()
