"""Options that name what is written: refused before any work where nothing can be written."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from indicial.errors import InputError


def to_file(parameter: typer.CallbackParam, value: Path | None) -> Path | None:
    """Refuse a file that is a folder, or is to lie in a file."""
    if value is not None:
        _refuse_files(value.parents, f"{parameter.opts[0]} cannot be in it")
        if value.is_dir():
            raise InputError(f"{value} is a folder; {parameter.opts[0]} must name a file")
    return value


def to_folder(parameter: typer.CallbackParam, value: Path | None) -> Path | None:
    """Refuse a folder that is a file, or is to lie in one."""
    return None if value is None else to_be_folder(value, parameter.opts[0])


def to_be_folder(value: Path, option: str) -> Path:
    """Refuse, in the name of an option, a folder that is a file, or is to lie in one."""
    _refuse_files((value, *value.parents), f"{option} must name a folder")
    return value


def _refuse_files(paths: Iterable[Path], why: str) -> None:
    for path in paths:
        if path.is_file():
            raise InputError(f"{path} is a file; {why}")


JsonFile = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Write every number into a file.", callback=to_file)
]
FiguresFolder = Annotated[
    Path | None, typer.Option("--figures", metavar="DIR", help="Draw figures into a folder.", callback=to_folder)
]
