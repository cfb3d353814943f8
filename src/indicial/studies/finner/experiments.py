"""Pieces that ask where something comes from: one thing is changed, and what changes with it is looked at."""

from __future__ import annotations

from typing import Any

from indicial.reference_data import FINNER_MOMENT_REFERENCE
from indicial.studies.finner.pieces import DOMAINS, OUTLYING
from indicial.studies.finner.variants import VARIANTS
from indicial.studies.piece import Piece

NEAR_ONE = tuple(round(1.06 + 0.02 * n, 2) for n in range(14))
"""Mach numbers about the jump of Cm_alphadot."""

DRAWN_ACROSS = (1.1, 1.16, 1.24)
"""Mach numbers of the pictures of the flow across the fins."""

FINS_CHANGED = {
    "no_fins": NEAR_ONE[::4],
    "plate_fins": NEAR_ONE[::2],
    "thickness_0.02": NEAR_ONE[:8],
    "thickness_0.04": NEAR_ONE[:10],
    "thickness_0.12": NEAR_ONE[3:],
    "half_span": NEAR_ONE[::2],
}
"""Variants computed about the jump, and their Mach numbers."""

OF_UNKNOWN_SIZE = ("thickness_0.04", "thickness_0.088", "chord_0.95")
"""Variants computed at the outlying groups of flights."""

INCIDENCES = dict.fromkeys((1.077, 1.16, 1.254), (1.0, 2.0)) | dict.fromkeys(OUTLYING, (3.0, 5.0))
"""Angles of attack [deg] about which the flow is linearised, by Mach number; free flights yaw by 1 to 6 degrees."""

AMPLITUDES = {1.077: (2.0,), 1.16: (0.5, 1.0, 2.0), 1.254: (2.0,), 2.718: (2.0,), 4.3: (4.5,)}
"""Amplitudes of pitch oscillations [deg]: up to what the flights' mean squared yaw is of a plane motion."""

SMALL_RATES = {1.05: (1e-4, 1e-5), 1.1: (1e-4, 1e-5)}
"""Reduced pitch rates of moving frames where the usual one is too large to be linear, by Mach number."""

SLOW = (0.0024, 0.004)
"""Reduced frequencies of the flights themselves."""


def _experiment(method: str, kind: str, level: str, mach: float, **settings: Any) -> Piece:
    """About the usual moment reference; domain and changes of the body are among the settings."""
    domain, _, variant = kind.partition("+")
    if domain in DOMAINS:
        settings["domain"] = list(DOMAINS[domain])
    if variant:
        settings["changes"] = VARIANTS[variant]
    return Piece(method, kind, level, mach, {**settings, "moment_reference": FINNER_MOMENT_REFERENCE})


def _near_one() -> list[Piece]:
    """Where the jump sits on the body, and what of the fins it depends on."""
    listed = [_experiment("parts", "sting", "quick", mach) for mach in NEAR_ONE]
    listed += [_experiment("parts", "sting", "coarse", mach) for mach in (1.1, 1.14, 1.16, 1.2)]
    listed += [_experiment("across_fins", "sting", "coarse", mach) for mach in DRAWN_ACROSS]
    for variant, machs in FINS_CHANGED.items():
        listed += [_experiment("operator", f"sting+{variant}", "quick", mach, k=[]) for mach in machs]
    return listed


def _about_incidence() -> list[Piece]:
    """Derivatives about an angle of attack."""
    listed = []
    for mach, incidences in INCIDENCES.items():
        kind, level = ("base", "coarse") if mach in OUTLYING else ("sting", "quick")
        for alpha in incidences:
            settings = {"k": [], "alpha_deg": alpha}
            listed.append(_experiment(f"operator_at_{alpha:g}deg", kind, level, mach, **settings))
    return listed


def _of_finite_amplitude() -> list[Piece]:
    """Oscillations as slow as the flights' and as large."""
    listed = []
    for mach, amplitudes in AMPLITUDES.items():
        kind, level = ("base", "coarse") if mach in OUTLYING else ("sting", "quick")
        for amplitude in amplitudes:
            settings = {"amplitude_deg": amplitude, "k": SLOW[1], "harmonics": 2}
            listed.append(_experiment(f"periodic_{amplitude:g}deg", kind, level, mach, **settings))
    return listed


def _outlying() -> list[Piece]:
    """What may differ between the flights and the flow that is computed."""
    listed = []
    for mach in OUTLYING:
        listed += [_experiment("operator", f"base+{name}", "coarse", mach, k=[]) for name in OF_UNKNOWN_SIZE]
        listed.append(_experiment("operator_without_k", "sting", "coarse", mach, k=[]))
        listed.append(_experiment("operator_slow", "base", "coarse", mach, k=list(SLOW)))
    return listed


def _small_rates() -> list[Piece]:
    """Steady turns near M 1, ever slower; and a loose steady state beside a settled one."""
    turns = [
        _experiment(f"mrf_rate_{rate:g}", "sting", "quick", mach, pitch_rate=rate)
        for mach, rates in SMALL_RATES.items()
        for rate in rates
    ]
    loose = _experiment("operator_loose", "base", "medium", 4.0, k=[], steady_tolerance=1e-6)
    return [*turns, loose]


EXPERIMENTS: tuple[Piece, ...] = (
    *_small_rates(),
    *_near_one(),
    *_about_incidence(),
    *_of_finite_amplitude(),
    *_outlying(),
)
"""All of them."""
