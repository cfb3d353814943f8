"""A unit or a sign that explains a factor between what was measured and what it should be."""

from __future__ import annotations

import math

_UNITS = {
    math.degrees(1.0): "degrees",
    math.radians(1.0): "radians for degrees",
    1.0 / 9.80665: "multiples of g",
    9.80665: "multiples of g taken for m/s^2",
    -1.0: "the other sign",
    1.0 / 0.3048: "feet",
    0.3048: "metres for feet",
}
_NEAR = 0.05


def guess_unit(factor: float) -> str | None:
    """What makes a channel this many times too large, if it is something known."""
    return next((words for known, words in _UNITS.items() if abs(factor / known - 1.0) < _NEAR), None)
