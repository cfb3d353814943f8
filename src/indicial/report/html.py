"""One HTML file that holds everything: text, tables, figures."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from indicial.files import write_text


@dataclass(frozen=True)
class Picture:
    """A figure and what it shows."""

    path: Path
    caption: str

    @property
    def data(self) -> str:
        """The image as a data URI."""
        return "data:image/png;base64," + base64.b64encode(self.path.read_bytes()).decode("ascii")


@dataclass(frozen=True)
class Grid:
    """A table: headings and rows of text cells; the first column is a heading too."""

    headings: Sequence[str]
    rows: Sequence[Sequence[str]]
    caption: str = ""


@dataclass(frozen=True)
class Chapter:
    """A part of the report.

    Parameters
    ----------
    title : str
    text : sequence of str
        Paragraphs.
    grids : sequence of Grid
    pictures : sequence of Picture
    """

    title: str
    text: Sequence[str] = ()
    grids: Sequence[Grid] = ()
    pictures: Sequence[Picture] = field(default_factory=tuple)

    @property
    def anchor(self) -> str:
        """Name of its place in the page."""
        return "".join(letter if letter.isalnum() else "-" for letter in self.title.lower())


def write_html(path: Path, title: str, lead: Sequence[str], chapters: Sequence[Chapter], facts: dict[str, Any]) -> None:
    """Write the report.

    Parameters
    ----------
    path : Path
    title : str
    lead : sequence of str
        What came out, before any detail.
    chapters : sequence of Chapter
    facts : dict
        Short facts for the foot of the page: versions, times.
    """
    from jinja2 import Environment

    source = (resources.files("indicial.report") / "report.html.jinja").read_text(encoding="utf-8")
    template = Environment(autoescape=True, trim_blocks=True, lstrip_blocks=True).from_string(source)
    write_text(path, template.render(title=title, lead=lead, chapters=chapters, facts=facts))
