"""Checks of the fields of a shape."""

from __future__ import annotations

import math

from indicial.errors import InputError


def require(holds: bool, shape: str, field: str, value: object, allowed: str) -> None:
    """Raise an InputError that names the field and what is allowed, unless `holds`."""
    if not holds:
        raise InputError(f"{shape}.{field} is {value!r}, must be {allowed}")


def require_positive(shape: str, **fields: float) -> None:
    """Raise an InputError for the first field that is not positive and finite."""
    for field, value in fields.items():
        require(math.isfinite(value) and value > 0.0, shape, field, value, "positive and finite")
