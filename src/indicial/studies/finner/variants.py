"""Bodies that differ from the Basic Finner in one thing: what a difference does says where an effect comes from."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from indicial.cfd.shapes import FinnedBody
from indicial.errors import InputError
from indicial.reference_data import FINNER_DIAMETER

FINNER = FinnedBody.basic_finner(FINNER_DIAMETER)

VARIANTS: dict[str, dict[str, Any]] = {
    "no_fins": {"fins": None},
    "plate_fins": {"section": "plate", "thickness_ratio": 0.0},
    "thickness_0.02": {"thickness_ratio": 0.02},
    "thickness_0.04": {"thickness_ratio": 0.04},
    "thickness_0.088": {"thickness_ratio": 0.088},
    "thickness_0.12": {"thickness_ratio": 0.12},
    "double_wedge_fins": {"section": "double_wedge"},
    "half_span": {"span": 0.5},
    "span_0.95": {"span": 0.95},
    "chord_0.95": {"root_chord": 0.95, "tip_chord": 0.95},
}
"""What is changed of the fins; their trailing edges stay at the base."""


def body_of(kind: str) -> FinnedBody:
    """The body of a kind of mesh: ``"base"`` is about the Basic Finner, ``"base+half_span"`` about that variant.

    Raises
    ------
    InputError
        If there is no such variant.
    """
    variant = kind.partition("+")[2]
    if not variant:
        return FINNER
    if variant not in VARIANTS:
        raise InputError(f"no variant {variant!r} of the body; there are {', '.join(VARIANTS)}")
    changes = VARIANTS[variant]
    if "fins" in changes or FINNER.fins is None:
        return replace(FINNER, fins=changes.get("fins"))
    return replace(FINNER, fins=replace(FINNER.fins, **changes))
