"""The pieces of the study: each a sweep of minutes at most."""

from __future__ import annotations

from typing import Any

from indicial.studies.bocian.glider import FREE, TRIPPED, flight
from indicial.studies.piece import Piece

ALPHAS = [float(a) for a in range(0, 21)]
STALL = [10.0, 12.0, 14.0, 16.0, 18.0]

FINE, COARSE = [3, 12], [3, 8]
"""Panels along the chord, and across half a wing."""

BASE: dict[str, Any] = {"panels": FINE, "polars": TRIPPED}
FORCED: dict[str, Any] = {"amplitude_deg": 5.0, "k": 0.1, "periods": 3, "steps_per_period": 48, "compensation": "full"}
PAPER_RATE = 0.2
"""Of the moving frame [rad/s], against none."""

VARIANTS: dict[str, dict[str, Any]] = {
    "taper 0.25": {"changes": {"taper": 0.25}},
    "taper 0.35": {"changes": {"taper": 0.35}},
    "washout 2.5 deg": {"changes": {"washout": 0.0436332}},
    "no tailplane": {"changes": {"tail": False}},
    "tailplane 20% larger": {"changes": {"tail_area": 3.12, "tail_span": 3.72}},
    "with a fin": {"changes": {"fin": True}},
    "no dihedral": {"changes": {"dihedral": 0.0}},
    "free transition": {"polars": FREE},
}
"""What is not published, or not known of the paper's sections, changed one by one."""

FREEDOM: dict[str, dict[str, Any]] = {
    "amplitude 2.5 deg": {"amplitude_deg": 2.5},
    "amplitude 10 deg": {"amplitude_deg": 10.0},
    "k = 0.25": {"k": 0.25},
    "k = 0.5": {"k": 0.5},
    "1 period": {"periods": 1},
    "5 periods": {"periods": 5},
    "beta held only": {"compensation": "sideslip"},
    "no compensation": {"compensation": "none"},
    "time constants of separation doubled": {"lag": [1.7, 3.0]},
    "time constants of separation halved": {"lag": [0.425, 0.75]},
}
"""What the choice of the forced oscillation leaves open, changed one by one."""

SHORTFALL: dict[str, dict[str, Any]] = {
    "slope 2 pi, no drag": {"sections": {"lift": "plate", "drag": False}},
    "slope 2 pi": {"sections": {"lift": "plate"}},
    "attached slope of the polars": {"sections": {"lift": "attached"}},
    "inviscid slope of thick sections": {"sections": {"lift": "joukowski"}},
    "all chords at Re 0.6e6": {"sections": {"reynolds": 0.6e6}},
    "all chords at Re 4.2e6": {"sections": {"reynolds": 4.2e6}},
    "tip's section all over": {"sections": {"section": "naca43012"}},
    "root's section all over": {"sections": {"section": "naca43018"}},
    "20 strips a half": {"panels": [3, 20]},
    "6 panels along the chord": {"panels": [6, 12]},
    "96 steps a period": {"forced": {"steps_per_period": 96}},
}
"""What of the roll damping at 4 degrees comes from what: sections and resolution, changed one by one."""


SPREAD = 1.0
"""Chords over which separation sees its neighbours, where a piece has it: see `indicial.cfd.lattice.spanwise`."""

STALLED = [14.0, 16.0, *ALPHAS[17:], 22.0, 24.0]
RATES: dict[str, Any] = {"alpha_deg": [14.0, 16.0, 18.0, 20.0], "rates": [0.05, 0.1, 0.2], "across": [8, 12, 20]}
CELLS: dict[str, Any] = {
    "panels": [6, 12],
    "alpha_deg": [16.0, 17.0, 18.0, 19.0, 20.0, 21.0, 22.0],
    "across": [8, 12, 16, 20],
    "spreads": [0.0, 0.5, SPREAD, 2.0],
    "rate": PAPER_RATE,
    "sections": {"reynolds": 0.6e6},
}
"""What the number of strips does in stall, for several spreads; one Reynolds number, so that chords are alike."""


def _piece(method: str, variant: str, level: str, **settings: Any) -> Piece:
    panels = {"panels": COARSE} if level == "coarse" else {}
    return Piece(method, variant, level, round(flight(0.0).mach, 6), {**BASE, **panels, **settings})


PIECES: tuple[Piece, ...] = (
    _piece("frame", "base", "coarse", alpha_deg=ALPHAS[::4], rate=PAPER_RATE, central=True),
    _piece("frame", "base", "fine", alpha_deg=ALPHAS, rate=PAPER_RATE),
    _piece("frame", "free", "fine", alpha_deg=ALPHAS, rate=PAPER_RATE, polars=FREE),
    _piece("frame", "beyond", "fine", alpha_deg=[22.0, 24.0, 26.0], rate=PAPER_RATE),
    _piece("forced", "beyond", "fine", alpha_deg=[22.0, 24.0, 26.0], forced=FORCED),
    _piece("frequency", "base", "fine", alpha_deg=4.0, forced=FORCED, k=[0.1, 0.2, 0.3, 0.4, 0.5]),
    _piece("variants", "base", "fine", alpha_deg=4.0, forced=FORCED, rate=PAPER_RATE, variants=VARIANTS),
    _piece("loops", "base", "fine", alpha_deg=[4.0, 15.0, 20.0], forced=FORCED),
    _piece("forced", "base", "fine", alpha_deg=[*ALPHAS[:14:2], *ALPHAS[14:]], forced=FORCED),
    _piece("rates", "base", "fine", **RATES),
    _piece("cells", "base", "fine", **CELLS),
    _piece(
        "cells",
        "forced",
        "fine",
        alpha_deg=[18.0, 20.0, 22.0],
        across=[8, 12, 20],
        spreads=[0.0, SPREAD],
        rate=PAPER_RATE,
        forced=FORCED,
    ),
    _piece("frame", "spread", "fine", alpha_deg=STALLED, rate=PAPER_RATE, spread=SPREAD),
    _piece("forced", "spread", "fine", alpha_deg=STALLED, forced=FORCED, spread=SPREAD),
    _piece("rates", "spread", "fine", **RATES, spread=SPREAD),
    _piece("shortfall", "base", "fine", alpha_deg=4.0, forced=FORCED, cases=SHORTFALL),
    _piece("freedom", "base", "coarse", alpha_deg=STALL, forced=FORCED, cases=FREEDOM),
    _piece("rocking", "base", "coarse", alpha_deg=[*ALPHAS[4::4], 18.0, 19.0, 22.0], first=0.05, end=4.0, step=0.01),
    _piece(
        "rocking",
        "spread",
        "coarse",
        alpha_deg=[16.0, 18.0, 19.0, 20.0, 22.0],
        first=0.05,
        end=4.0,
        step=0.01,
        spread=SPREAD,
    ),
)
"""All of them."""
