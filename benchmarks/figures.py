"""What a benchmark reports, and how it times."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Figure:
    """One measured number; `holds` tells whether it meets `target`, and is None where there is none."""

    name: str
    value: float
    unit: str
    target: str | None = None
    holds: bool | None = None

    @classmethod
    def at_most(cls, name: str, value: float, limit: float, unit: str = "") -> Figure:
        """A figure that holds up to `limit`."""
        return cls(name, float(value), unit, f"at most {limit:g}", bool(value <= limit))

    @classmethod
    def at_least(cls, name: str, value: float, limit: float, unit: str = "") -> Figure:
        """A figure that holds from `limit` on."""
        return cls(name, float(value), unit, f"at least {limit:g}", bool(value >= limit))

    def line(self) -> str:
        """The figure for a reader."""
        verdict = "" if self.holds is None else ("  holds" if self.holds else "  FALLS SHORT")
        wanted = "" if self.target is None else f"  (asked: {self.target})"
        return f"{self.name:<60}{self.value:>10.3g} {self.unit}{wanted}{verdict}"


def best_time(action: Callable[[], object], repeats: int = 7, clock: Callable[[], float] = time.perf_counter) -> float:
    """Least of several timings [s], after one run that is not timed: what the machine can do when left alone.

    With `time.process_time` for a clock, the processor time of all threads.
    """
    action()
    times = []
    for _ in range(repeats):
        start = clock()
        action()
        times.append(clock() - start)
    return min(times)
