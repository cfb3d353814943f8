"""What each key of a case file allows, in words: for error messages and for the documentation."""

from __future__ import annotations

from collections.abc import Iterator
from types import NoneType
from typing import Annotated, Any, Literal, get_args, get_origin

from annotated_types import Ge, Gt, Le, Lt, MaxLen, MinLen, MultipleOf
from pydantic import BaseModel
from pydantic.fields import FieldInfo

from indicial.case.model import UNITS, Case, Section

_TYPES = {float: "a number", int: "a whole number", str: "a text", bool: "true or false"}


def field_at(location: tuple[str, ...], root: type[BaseModel] = Case) -> FieldInfo | None:
    """The field of a key path such as ``("shape", "fins", "count")``; None if there is none."""
    model: type[BaseModel] | None = root
    field: FieldInfo | None = None
    for part in location:
        if model is None or part not in model.model_fields:
            return None
        field = model.model_fields[part]
        model = _section(field)
    return field


def known_keys(location: tuple[str, ...], root: type[BaseModel] = Case) -> list[str]:
    """The keys of the table at a key path."""
    field = field_at(location, root)
    return list(root.model_fields) if field is None else _keys(field)


def allowed(key: str, field: FieldInfo) -> str:
    """Type, unit and bounds of a key in words."""
    if _section(field):
        return f"a table [{key}] with {', '.join(_keys(field))}"
    kind, bounds = _given(field.annotation), field.metadata
    if get_origin(kind) is dict:
        return (
            f"a table [{key}] of names and {_value('', *_unpacked(get_args(kind)[1])).replace('a number', 'numbers')}"
        )
    if get_origin(kind) is list:
        (item,) = get_args(kind)
        return f"a list, each {_value(key, *_unpacked(item))}"
    return _value(key, kind, bounds)


def _given(kind: Any) -> Any:
    """The type of a value that may be left out: X of ``X | None``."""
    inner = [one for one in get_args(kind) if one is not NoneType]
    return inner[0] if NoneType in get_args(kind) and len(inner) == 1 else kind


def _unpacked(kind: Any) -> tuple[Any, list[Any]]:
    """The type and the bounds of an annotated type."""
    if get_origin(kind) is not Annotated:
        return kind, []
    inner, *notes = get_args(kind)
    return inner, [bound for note in notes for bound in getattr(note, "metadata", [note])]


def _value(key: str, kind: Any, bounds: list[Any]) -> str:
    if get_origin(kind) is Literal:
        return " or ".join(repr(option) for option in get_args(kind))
    ends = sorted(UNITS.items(), key=lambda u: -len(u[0]))
    unit = next((unit for end, unit in ends if f"_{key}".endswith(f"_{end}")), "")
    words = [_TYPES.get(kind, str(kind)) if isinstance(kind, type) else str(kind)]
    if unit:
        words.append(f"in {unit}")
    return " ".join([*words, " and ".join(_bounds(bounds))]).strip()


def case_reference(root: type[BaseModel] = Case) -> str:
    """Every key of a case file (or of another file's model) as Markdown tables, made from the models."""
    plain = [_row(name, field) for name, field in root.model_fields.items() if not _section(field)]
    parts = ["| key | allowed | default | meaning |\n|---|---|---|---|\n" + "\n".join(plain)]
    parts += [_tables(name, field) for name, field in root.model_fields.items() if _section(field)]
    return "\n\n".join(parts) + "\n"


def _tables(path: str, field: FieldInfo) -> str:
    model = _section(field)
    assert model is not None
    rows = [_row(key, inner) for key, inner in model.model_fields.items() if not _section(inner)]
    text = (
        f"### `[{path}]`\n\n{(model.__doc__ or '').strip()}\n\n"
        "| key | allowed | default | meaning |\n|---|---|---|---|\n" + "\n".join(rows)
    )
    inner_tables = [
        _tables(f"{path}.{key}", inner) for key, inner in model.model_fields.items() if _section(inner) is not None
    ]
    return "\n\n".join([text, *inner_tables])


def _row(key: str, field: FieldInfo) -> str:
    default = "required" if field.is_required() else "-" if field.default is None else f"`{field.default}`"
    return f"| `{key}` | {allowed(key, field)} | {default} | {field.description} |"


def _section(field: FieldInfo) -> type[Section] | None:
    kind = field.annotation
    return kind if isinstance(kind, type) and issubclass(kind, Section) else None


def _keys(field: FieldInfo) -> list[str]:
    model = _section(field)
    return list(model.model_fields) if model else []


def _bounds(metadata: list[Any]) -> Iterator[str]:
    for bound in metadata:
        match bound:
            case Gt(gt=value):
                yield f"greater than {value:g}"
            case Ge(ge=value):
                yield f"at least {value:g}"
            case Lt(lt=value):
                yield f"less than {value:g}"
            case Le(le=value):
                yield f"at most {value:g}"
            case MultipleOf(multiple_of=value):
                yield f"in steps of {value:g}"
            case MinLen(min_length=value):
                yield f"of at least {value} {'letter' if value == 1 else 'letters'}"
            case MaxLen(max_length=value):
                yield f"of at most {value} letters"
