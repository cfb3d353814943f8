"""How a run tells what it is doing."""

from __future__ import annotations

import logging
import threading
from typing import Protocol

log = logging.getLogger(__name__)


class Reporter(Protocol):
    """Told about stages and their progress; called from several threads."""

    def start(self, title: str) -> None:
        """A stage begins."""
        ...

    def update(self, fraction: float, text: str) -> None:
        """The fraction of the stage that is done (0 to 1), and what is going on."""
        ...

    def finish(self, seconds: float, text: str) -> None:
        """The stage is complete; what came of it."""
        ...


class LogReporter:
    """Reports to the log."""

    def start(self, title: str) -> None:
        """A stage begins."""
        log.info("%s", title)

    def update(self, fraction: float, text: str) -> None:
        """Progress, at debug level."""
        log.debug("%3.0f %% %s", 100.0 * fraction, text)

    def finish(self, seconds: float, text: str) -> None:
        """The stage is complete."""
        log.info("%s (%.1f s)", text, seconds)


class Tally:
    """Adds up the progress of many experiments, some of them running side by side.

    Parameters
    ----------
    reporter : Reporter
    expected : float
        Sum of the weights of all experiments that will come.
    weights : dict
        Weight of an experiment by the start of its label; others count 1.
    """

    def __init__(self, reporter: Reporter, expected: float, weights: dict[str, float]) -> None:
        self._reporter = reporter
        self._expected = expected
        self._weights = weights
        self._done: dict[str, float] = {}
        self._lock = threading.Lock()

    def __call__(self, label: str, fraction: float) -> None:
        """An experiment has got so far."""
        with self._lock:
            self._done[label] = max(fraction, self._done.get(label, 0.0))
            total = sum(self._weight(name) * part for name, part in self._done.items())
            running = [f"{name} {part:.0%}" for name, part in self._done.items() if part < 1.0]
            self._reporter.update(min(total / self._expected, 1.0), ", ".join(running))

    def _weight(self, label: str) -> float:
        return next((weight for start, weight in self._weights.items() if label.startswith(start)), 1.0)
