"""Progress on the terminal: one line a stage, with a bar and the time left; plain lines where there is no terminal."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn

_PLAIN_INTERVAL = 10.0
_FORESEEABLE = 0.02
"""Fraction from which the time left is told: a start says little of the rest."""


class ConsoleReporter:
    """Shows stages on stderr; a context, so that the terminal is left clean whatever happens."""

    def __init__(self) -> None:
        self._console = Console(stderr=True, highlight=False)
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(bar_width=24),
            TextColumn("{task.percentage:>3.0f}%"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(elapsed_when_finished=False),
            TextColumn("[dim]{task.fields[detail]}"),
            console=self._console,
            transient=True,
        )
        self._task: TaskID | None = None
        self._title = ""
        self._begun = self._said = 0.0

    def __enter__(self) -> Self:
        if self._console.is_terminal:
            self._progress.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._console.is_terminal:
            self._progress.stop()

    def start(self, title: str) -> None:
        """A stage begins."""
        self._title = title
        self._begun = self._said = time.monotonic()
        if self._console.is_terminal:
            self._task = self._progress.add_task(f"{title:<28}", total=1.0, detail="")
        else:
            self._console.print(f"{title} ...")

    def update(self, fraction: float, text: str) -> None:
        """Progress of the stage."""
        if self._task is not None:
            self._progress.update(self._task, completed=fraction, detail=escape(text[:60]))
        elif (now := time.monotonic()) - self._said > _PLAIN_INTERVAL and fraction > 0.0:
            self._said = now
            left = (now - self._begun) * (1.0 - fraction) / fraction
            foreseen = f", about {left:.0f} s left" if fraction >= _FORESEEABLE else ""
            self._console.print(f"  {fraction:.0%}{foreseen}: {escape(text)}", soft_wrap=True)

    def finish(self, seconds: float, text: str) -> None:
        """The stage is complete."""
        if self._task is not None:
            self._progress.remove_task(self._task)
            self._task = None
        self._console.print(f"[green]done[/] {self._title:<28} {seconds:7.1f} s  {escape(text)}", soft_wrap=True)
