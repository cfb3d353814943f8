"""The pieces of the study: the exact plate at four Mach numbers, the Basic Finner at one."""

from __future__ import annotations

from typing import Any

from indicial.reference_data import FINNER_MOMENT_REFERENCE
from indicial.studies.piece import Piece

MACHS = (1.2, 1.5, 2.0, 3.0)

BEYOND = "k = 2"
"""An oscillation faster than any of a rigid flight: shown, but nothing is asked there."""

PLATE: dict[str, Any] = {
    "arm": 3.0,  # chords from the moment reference point aft to mid-chord, as of a tail or a fin
    "samples": 161,  # of the step responses, up to twice the time at which they settle
    "k": [0.05, 0.2, 0.5, 2.0],  # of the oscillations not seen
    "pulse": {"alpha": 0.01, "width": 0.4, "samples": 20},  # up and down in alpha, fast beside the response
    "multisine": {"lowest": 0.05, "lines": 12, "alpha": 0.004, "q": 0.002, "step": 0.15},
}

FINNER: dict[str, Any] = {
    "moment_reference": FINNER_MOMENT_REFERENCE,
    "states": 6,
    "operator": {"lowest": 0.004, "highest": 1.5, "count": 25},
    "k": [0.025, 0.1, 0.2],
    "oscillation": {"amplitude_deg": 0.05, "periods": 2, "steps_per_period": 160},
    "multisine": {"lowest": 0.02, "lines": 12, "alpha": 2e-4, "q": 1e-4, "step": 0.25},
    "steps": {"alpha_deg": 0.02, "q": 2e-4, "first": 0.02, "growth": 1.08, "largest": 0.5, "end": 80.0},
    "k_max": 0.4,  # above those of the motions not seen
}

PIECES: tuple[Piece, ...] = (
    *(Piece("realise", "plate", "exact", mach, PLATE) for mach in MACHS),
    Piece("realise", "finner", "quick", 2.0, FINNER),
)
"""All of them."""
