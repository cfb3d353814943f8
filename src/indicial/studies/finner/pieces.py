"""The pieces of the study: which method on which mesh at which Mach number."""

from __future__ import annotations

from typing import Any

from indicial.reference_data import FINNER_MOMENT_REFERENCE, read_table
from indicial.studies.piece import Piece

LEVELS = ("quick", "coarse", "medium")
"""Systematically refined meshes, each with about 1.5 times as many cells along every direction as the one before."""

OUTLYING = (2.718, 4.3)
"""Groups of flights below which all CFD lies by a fifth; the first figure of damping is taken without them."""

LOWEST_WITHOUT_WAKE = 1.5
"""Lowest Mach number of the mesh that ends at the base plane; below it the base and the wake act upstream."""

FLIGHTS = tuple(float(mach) for mach in read_table("basic_finner_range_multifit").numbers("mach"))
"""Mach numbers of the multiple-fit groups of flights."""

BETWEEN_TRANSONIC = (1.05, 1.1, 1.12, 1.14, 1.16, 1.18, 1.2, 1.22, 1.24, 1.26, 1.35, 1.4)
"""Fine steps where the paper finds a jump in Cm_alphadot."""

BETWEEN_SUPERSONIC = (1.5, 1.6, 1.7, 2.0, 2.2, 2.5, 3.0, 3.5, 4.0, 4.5)

DOMAINS = {"sting": (2.0, 20.0, 30.0), "sting_wide": (2.0, 40.0, 60.0), "needle": (20.0, 20.0, 30.0)}
"""Calibres ahead of the nose, behind the base and beside, of the meshes with a sting.

Ahead of the nose the mesh stands on a needle. In a supersonic stream nothing that matters happens there, but on cells
of a reasonable size the needle turns some of the stream: by little in incidence, by as much more in a rate as it is
long. Two calibres do; with twenty the derivatives of rates are off by several percent at low frequency.
"""

JUMP = (1.12, 1.14, 1.16, 1.18, 1.2, 1.293, 1.4)
"""Where a second domain is computed: about the jump, and beyond it."""

OVERLAP = (1.5, 2.0)
"""Where both kinds of mesh are computed."""

REDUCED_FREQUENCIES = (0.025, 0.1)
"""Of the paper's and of ARL's forced oscillations; k = 0 comes with every operator."""

TRANSONIC = tuple(sorted((*BETWEEN_TRANSONIC, *(mach for mach in FLIGHTS if mach < LOWEST_WITHOUT_WAKE))))
SUPERSONIC = tuple(sorted((*BETWEEN_SUPERSONIC, *(mach for mach in FLIGHTS if mach >= LOWEST_WITHOUT_WAKE))))

FIVE = (1.293, 1.5, 2.0, 2.718, 4.0)
"""Mach numbers of the time marches in all motions."""

ABOUT_THE_JUMP = {"quick": (1.12, 1.16, 1.2, 1.24), "medium": (1.16, 1.2)}
"""Mach numbers of the marches that give Cm_alphadot: plunging, and steps."""

MARCHED = ("quick", "medium")
"""Levels of the mesh on which the methods are set against each other."""

AMPLITUDES = {"pitch_deg": 0.05, "alpha_step_deg": 0.02, "q_step": 2e-4}
"""Small, so that what the marches find is linear and can be held against the operator."""

FORCED = {"k": 0.025, "amplitude_deg": AMPLITUDES["pitch_deg"], "periods": 2, "steps_per_period": 120}
STEP = {"alpha_deg": AMPLITUDES["alpha_step_deg"], "q": AMPLITUDES["q_step"], "first": 0.02, "growth": 1.08}

SLOWEST = {"sting": {"end": 120.0, "largest": 1.0}, "base": {"end": 80.0, "largest": 1.0}}
"""Reduced time of a step's record, and its largest interval: a supersonic response is over when the slowest wave has
left the body; near M 1 that takes far longer."""


def _piece(method: str, kind: str, level: str, mach: float, **settings: Any) -> Piece:
    """A piece about the usual moment reference, with the domain of its mesh among the settings."""
    domain = {"domain": list(DOMAINS[kind])} if kind in DOMAINS else {}
    return Piece(method, kind, level, mach, {**settings, "moment_reference": FINNER_MOMENT_REFERENCE, **domain})


LOOSE = {("medium", 4.3): 1e-6}
"""Tolerances of steady states that do not come to the solver's own: the shocks' cells of this mesh wander below it."""


def _sweep() -> list[Piece]:
    """The operator, level by level."""
    listed = []
    for level in LEVELS:
        for kind, machs in (("base", SUPERSONIC), ("sting", (*TRANSONIC, *OVERLAP))):
            for mach in machs:
                settings: dict[str, Any] = {"k": list(REDUCED_FREQUENCIES)}
                if (level, mach) in LOOSE:
                    settings["steady_tolerance"] = LOOSE[level, mach]
                listed.append(_piece("operator", kind, level, mach, **settings))
    return listed


def _directly_about(moment_reference: float) -> list[Piece]:
    """One direct computation about the other moment reference, to check the transfer."""
    settings = {"k": [], "moment_reference": moment_reference}
    return [Piece("operator_about_6.1d", "base", "quick", 2.0, settings)]


def _domains() -> list[Piece]:
    """In a domain twice as wide, and with a long needle ahead of the nose."""
    k = list(REDUCED_FREQUENCIES)
    wide = [_piece("operator", "sting_wide", "quick", mach, k=k) for mach in JUMP]
    return wide + [_piece("operator", "needle", "quick", mach, k=k) for mach in (*JUMP, *OVERLAP)]


def _kind(mach: float) -> str:
    return "base" if mach >= LOWEST_WITHOUT_WAKE else "sting"


def _moving_frame() -> list[Piece]:
    """Everywhere, on the quick mesh."""
    return [_piece("mrf", _kind(mach), "quick", mach) for mach in (*TRANSONIC, *SUPERSONIC)]


def _marches(level: str) -> list[Piece]:
    listed = []
    for mach in sorted((*ABOUT_THE_JUMP[level], *FIVE)):
        kind = _kind(mach)
        motions = ["plunge"] if mach not in FIVE else ["plunge", "pitch_rate"]
        if level == "quick" and mach in FIVE:
            motions += ["pitch"]  # the two halves together, where that is cheap
        listed += [_piece(f"fom_{motion}", kind, level, mach, **FORCED, motion=motion) for motion in motions]
        listed.append(_piece("irm", kind, level, mach, **STEP, **SLOWEST[kind]))
    return listed


def _halved_step() -> list[Piece]:
    """Plunging with half the time step, where Cm_alphadot is largest."""
    halved = {**FORCED, "steps_per_period": 2 * int(FORCED["steps_per_period"]), "motion": "plunge"}
    return [_piece("fom_plunge_halved_step", "sting", "quick", 1.16, **halved)]


SHOWN = (1.2, 2.0, 4.0)
"""Mach numbers of the pictures."""

STEPS_PER_PERIOD = {0.3: 420, 0.2: 628, 0.1: 1256, 0.05: 2514}
"""Steps of a period at k = 0.025 by U dt/d, within 0.3% (a period is 125.7 d/U); 0.3 and 0.05 as published."""

SONIC = 1.0
"""Mach number of the time-step study."""


def _shown() -> list[Piece]:
    """What keeps flows and histories beside the numbers, to be drawn."""
    listed = []
    for mach in SHOWN:
        kind = _kind(mach)
        listed.append(_piece("field", kind, "medium", mach, alpha_deg=0.0, q=0.01))
        listed += [
            _piece(f"loop_k{k:g}", kind, "quick", mach, **{**FORCED, "k": k}, motion="pitch")
            for k in REDUCED_FREQUENCIES
        ]
        end = 160.0 if mach < 1.4 else 60.0
        listed.append(_piece("steps", kind, "quick", mach, **STEP, end=end, largest=0.5))
    return listed


def _time_step(level: str, step: float) -> Piece:
    """A forced pitch rate at M 1 by steps of U dt/d."""
    settings = {**FORCED, "steps_per_period": STEPS_PER_PERIOD[step], "motion": "pitch_rate"}
    return _piece(f"time_step_{step:g}", "sting", level, SONIC, **settings)


def _time_steps() -> list[Piece]:
    """One oscillation by ever smaller steps, by more periods, and what the operator says without steps and a start."""
    operator = _piece("operator_without_steps", "sting", "quick", SONIC, k=[FORCED["k"]])
    longer = _piece("fom_pitch_rate_longer", "sting", "quick", SONIC, **{**FORCED, "periods": 6}, motion="pitch_rate")
    quick = [_time_step("quick", step) for step in STEPS_PER_PERIOD]
    coarse = [_time_step("coarse", step) for step in (max(STEPS_PER_PERIOD), min(STEPS_PER_PERIOD))]
    return [operator, *quick, *coarse, longer]


PIECES: tuple[Piece, ...] = (
    *_sweep(),
    *_directly_about(6.1),
    *_domains(),
    *_moving_frame(),
    *(piece for level in MARCHED for piece in _marches(level)),
    *_halved_step(),
    *_shown(),
    *_time_steps(),
)
"""All of them."""
