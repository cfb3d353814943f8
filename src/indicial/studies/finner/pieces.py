"""The pieces of the study: which method on which mesh at which Mach number."""

from __future__ import annotations

from indicial.reference_data import FINNER_MOMENT_REFERENCE, read_table
from indicial.studies.piece import Piece

LEVELS = ("quick", "coarse", "medium")
"""Systematically refined meshes, each with about 1.5 times as many cells along every direction as the one before."""

LOWEST_WITHOUT_WAKE = 1.5
"""Lowest Mach number of the mesh that ends at the base plane; below it the base and the wake act upstream."""

FLIGHTS = tuple(float(mach) for mach in read_table("basic_finner_range_multifit").numbers("mach"))
"""Mach numbers of the multiple-fit groups of flights."""

BETWEEN_TRANSONIC = (1.05, 1.1, 1.12, 1.14, 1.16, 1.18, 1.2, 1.22, 1.24, 1.26, 1.35, 1.4)
"""Fine steps where the paper finds a jump in Cm_alphadot."""

BETWEEN_SUPERSONIC = (1.5, 1.6, 1.7, 2.0, 2.2, 2.5, 3.0, 3.5, 4.0, 4.5)

JUMP = (1.12, 1.14, 1.16, 1.18, 1.2)
"""Where the jump is computed in a second domain."""

OVERLAP = (1.5, 2.0)
"""Where both kinds of mesh are computed."""

REDUCED_FREQUENCIES = (0.025, 0.1)
"""Of the paper's and of ARL's forced oscillations; k = 0 comes with every operator."""

TRANSONIC = tuple(sorted((*BETWEEN_TRANSONIC, *(mach for mach in FLIGHTS if mach < LOWEST_WITHOUT_WAKE))))
SUPERSONIC = tuple(sorted((*BETWEEN_SUPERSONIC, *(mach for mach in FLIGHTS if mach >= LOWEST_WITHOUT_WAKE))))

FIVE = (1.293, 1.5, 2.0, 2.718, 4.0)
"""Mach numbers of the time marches."""

MARCHED = ("quick", "coarse")
"""Levels of the mesh on which the methods are set against each other."""

AMPLITUDES = {"pitch_deg": 0.05, "alpha_step_deg": 0.02, "q_step": 2e-4}
"""Small, so that what the marches find is linear and can be held against the operator."""

FORCED = {"k": 0.025, "amplitude_deg": AMPLITUDES["pitch_deg"], "periods": 2, "steps_per_period": 120}
STEP = {"alpha_deg": AMPLITUDES["alpha_step_deg"], "q": AMPLITUDES["q_step"], "first": 0.02, "growth": 1.08}


def _sweep() -> list[Piece]:
    """The operator, flights' own Mach numbers first, then the steps between, level by level."""
    settings = {"k": list(REDUCED_FREQUENCIES), "moment_reference": FINNER_MOMENT_REFERENCE}
    listed = []
    for level in LEVELS:
        for kind, machs in (("base", SUPERSONIC), ("sting", (*TRANSONIC, *OVERLAP))):
            listed += [Piece("operator", kind, level, mach, settings) for mach in machs]
    return listed


def _directly_about(moment_reference: float) -> list[Piece]:
    """One direct computation about the other moment reference, to check the transfer."""
    settings = {"k": [], "moment_reference": moment_reference}
    return [Piece("operator_about_6.1d", "base", "quick", 2.0, settings)]


def _wider() -> list[Piece]:
    """About the jump in Cm_alphadot, in a domain twice as wide."""
    settings = {"k": list(REDUCED_FREQUENCIES), "moment_reference": FINNER_MOMENT_REFERENCE}
    return [Piece("operator", "sting_wide", "quick", mach, settings) for mach in JUMP]


def _kind(mach: float) -> str:
    return "base" if mach >= LOWEST_WITHOUT_WAKE else "sting"


def _moving_frame(level: str) -> list[Piece]:
    machs = (1.077, 1.2, 1.293, 1.5, 2.0, 2.718, 4.0)
    settings = {"moment_reference": FINNER_MOMENT_REFERENCE}
    return [Piece("mrf", _kind(mach), level, mach, settings) for mach in machs]


def _marches(level: str) -> list[Piece]:
    listed = []
    for mach in FIVE:
        forced = {**FORCED, "moment_reference": FINNER_MOMENT_REFERENCE}
        listed += [
            Piece(f"fom_{motion}", _kind(mach), level, mach, {**forced, "motion": motion})
            for motion in ("pitch", "pitch_rate", "plunge")
        ]
        # a supersonic response is over when the slowest wave has left; near M 1 that takes far longer
        end = 160.0 if mach < 1.4 else 80.0
        step = {**STEP, "end": end, "largest": 0.5, "moment_reference": FINNER_MOMENT_REFERENCE}
        listed.append(Piece("irm", _kind(mach), level, mach, step))
    return listed


PIECES: tuple[Piece, ...] = (
    *_sweep(),
    *_directly_about(6.1),
    *_wider(),
    *(piece for level in MARCHED for piece in (*_moving_frame(level), *_marches(level))),
)
"""All of them."""
