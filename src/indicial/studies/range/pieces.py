"""The pieces of the study: each group of shots flown and reduced, what errors imply, and the flight in the flow."""

from __future__ import annotations

from typing import Any

from indicial.reference_data import read_table
from indicial.studies.piece import Piece

NAMES = ("CA_0", "CN_alpha", "Cm_alpha", "Cm_q+Cm_alphadot", "Cl_p")
"""Coefficients that are recovered."""

LEFT_OUT = {
    "DA95030622": "the group's printed Mach number and yaw are the means of the other two shots",
    "DA95030101": "the same; ablated fins, and 47 deg^2 of yaw",
}
"""Shots near a group's Mach number that were not in its multiple fit."""

LEAST_YAW = 0.04
"""Mean square yaw [deg^2] of a shot whose printed one is 0.0: what rounds to it, near enough."""

RANGE: dict[str, Any] = {
    "stations": 54,
    "length_m": 230.0,
    "position_mm": 1.0,
    "angle_deg": 0.1,
    "roll_deg": 1.0,
    "roll_rate_rad_s": 50.0,
    "seeds": "one a group, record and shot",
}
"""The range: 54 stations on 230 m (Dupuis & Drouin, AIAA 88-2017); precision and roll are assumptions of usual size."""

RECORDS = 30
"""Records of each group, for coverage: 240 in all."""


def groups() -> dict[float, list[tuple[float, float]]]:
    """Mach number of each multiple-fit group -> Mach number and mean square yaw [deg^2] of its shots."""
    machs = read_table("basic_finner_range_multifit").numbers("mach").tolist()
    table = read_table("basic_finner_range_shots")
    found: dict[float, list[tuple[float, float]]] = {mach: [] for mach in machs}
    for shot, mach, yaw in zip(table.columns["shot"], table.numbers("mach"), table.numbers("dbsq_deg2"), strict=True):
        if shot not in LEFT_OUT:
            nearest = min(machs, key=lambda group: abs(group - mach))
            found[nearest].append((float(mach), max(float(yaw), LEAST_YAW)))
    return found


def _closing(mach: float, shots: list[tuple[float, float]]) -> Piece:
    settings = {**RANGE, "shots": [list(shot) for shot in shots], "records": RECORDS}
    return Piece("closing", "range", "sixdof", mach, settings)


IMPLIED = Piece(
    "implied",
    "range",
    "sixdof",
    2.375,
    {**RANGE, "yaw_deg": [0.25, 0.5, 1.0, 2.0, 4.0], "count": [20, 54, 100], "angles_deg": [0.03, 0.1, 0.3]},
)
IN_FLOW = Piece("in_flow", "base", "quick", 2.0, {**RANGE, "flights": [1.0, 3.0]})

PIECES: tuple[Piece, ...] = (*(_closing(mach, shots) for mach, shots in groups().items()), IMPLIED, IN_FLOW)
"""All of them."""
