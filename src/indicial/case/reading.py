"""Reading a case file: everything wrong with it is said in one line before any core is spent."""

from __future__ import annotations

import difflib
import tomllib
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from indicial.case.describe import allowed, field_at, known_keys
from indicial.case.model import Case
from indicial.errors import InputError
from indicial.files import why

M = TypeVar("M", bound=BaseModel)


def read_case(path: str | Path) -> Case:
    """Read and check a case file.

    Raises
    ------
    InputError
        ``FILE: key.path: what is wrong; allowed: ...`` for the first thing that is wrong, with the number of others.
    """
    return parse_case(read_text(path), str(path))


def parse_case(text: str, name: str = "case") -> Case:
    """The case that a TOML text describes; `name` heads error messages."""
    return parse(Case, text, name)


def read_text(path: str | Path) -> str:
    """The text of a file.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        return Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({why(error)})") from error


def parse(model: type[M], text: str, name: str) -> M:
    """What a TOML text describes, checked against a model; `name` heads error messages.

    Raises
    ------
    InputError
        As `read_case`.
    """
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{name}: not valid TOML: {error}") from error
    try:
        return model.model_validate(content)
    except ValidationError as error:
        # A misspelt key leaves another one missing: say the misspelling, which explains both.
        found = sorted(error.errors(), key=lambda e: e["type"] != "extra_forbidden")
        rest = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
        raise InputError(f"{name}: {_say(dict(found[0]), model)}{rest}") from None


def _say(problem: dict[str, Any], model: type[BaseModel]) -> str:
    # an entry of a list is described by the list
    location = tuple(part for part in problem["loc"] if isinstance(part, str))
    key = ".".join(location)
    kind = problem["type"]
    if kind == "extra_forbidden":
        keys = known_keys(location[:-1], model)
        near = _nearest(location[-1], keys)
        hint = f"did you mean {near!r}? " if near else ""
        return f"{key}: unknown key; {hint}allowed: {', '.join(keys)}"
    if kind == "value_error":
        # Checks across keys name the key themselves, from the table in which they are made.
        return f"{key + '.' if key else ''}{problem['ctx']['error']}"
    field = field_at(location, model)
    if field is None:
        return f"{key}: {problem['msg']}"
    if kind == "missing":
        return f"{key}: missing; allowed: {allowed(location[-1], field)}"
    return f"{key}: is {_shown(problem['input'])}; allowed: {allowed(location[-1], field)}"


def _nearest(key: str, keys: list[str]) -> str | None:
    """The key that was meant: the same quantity in another unit, or the closest spelling."""
    stem = key.rpartition("_")[0]
    same = [known for known in keys if stem and known.rpartition("_")[0] == stem]
    close = difflib.get_close_matches(key, keys, n=1, cutoff=0.6)
    return (same + close + [None])[0]


def _shown(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."
