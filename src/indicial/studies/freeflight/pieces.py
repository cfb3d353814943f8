"""The pieces of the study: shots, each flown three ways."""

from __future__ import annotations

from indicial.studies.piece import Piece

FLIGHTS = ("derivatives", "model", "flow")
"""Each shot's flights, in the order of what they cost."""

NODES = (1.92, 2.0)
"""Mach numbers of the linearised flows: a shot begins at the second and ends above the first."""

ANGLES = (1.0, 3.0)
"""Initial angles of attack [deg]: linear, and as the range's shots had."""

STEP = 0.3
"""Of the flow [m]; an oscillation is 33 m long."""


def _shot(level: str, angle: float, step: float, distance: float, label: str = "") -> Piece:
    settings = {"alpha_deg": angle, "step_m": step, "distance_m": distance, "nodes": list(NODES), "k_max": 0.05}
    return Piece(f"shot_{angle:g}deg{label}", "base", level, 2.0, settings)


COARSE = _shot("quick", 1.0, 0.6, 24.0, "_short")
"""Cheap enough to be computed again as a check."""

PIECES: tuple[Piece, ...] = (
    COARSE,
    *(_shot("quick", angle, STEP, 200.0) for angle in ANGLES),
    _shot("quick", ANGLES[0], 2.0 * STEP, 200.0, "_doubled_step"),
)
"""All of them."""
