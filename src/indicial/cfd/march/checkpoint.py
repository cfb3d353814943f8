"""Saved states, so that a killed run goes on where it was."""

from __future__ import annotations

import time
import zipfile
from pathlib import Path

import numpy as np

from indicial.conventions import Array
from indicial.files import atomic_path


class Checkpoint:
    """Named arrays in one file that belongs to one computation.

    Parameters
    ----------
    path : Path
        The file; need not exist.
    key : str
        What the state belongs to. A file with another key is not read.
    interval : float
        Least time between two saves [s], so that saving never rules the run.
    """

    def __init__(self, path: Path, key: str, interval: float = 20.0) -> None:
        self.path = path
        self._key = key
        self._interval = interval
        self._saved = time.monotonic()

    def load(self) -> dict[str, Array] | None:
        """The arrays of the last save, or None."""
        try:
            with np.load(self.path, allow_pickle=False) as stored:
                if str(stored["key"]) != self._key:
                    return None
                return {name: stored[name] for name in stored.files if name != "key"}
        except (OSError, EOFError, KeyError, ValueError, zipfile.BadZipFile):
            return None

    def save(self, **arrays: Array) -> None:
        """Save now."""
        with atomic_path(self.path) as temporary, open(temporary, "wb") as file:
            np.savez(file, allow_pickle=False, key=np.array(self._key), **arrays)
        self._saved = time.monotonic()

    def save_if_due(self, **arrays: Array) -> None:
        """Save if the interval has passed."""
        if time.monotonic() - self._saved >= self._interval:
            self.save(**arrays)

    def remove(self) -> None:
        """Delete the file: the computation is complete."""
        self.path.unlink(missing_ok=True)
