"""The three flights compared, as figures: nothing was asked of their size."""

from __future__ import annotations

from indicial.studies.claim import Claim
from indicial.studies.freeflight.pieces import ANGLES, FLIGHTS
from indicial.studies.kept import Results
from indicial.studies.piece import PieceResult

SIGNED = ("damping", "phase_deg")
"""Of these it matters which of the two has more; the others are sizes of a difference."""

WHAT = {
    "incidence": ("angle of attack, rms of the difference over rms", "%", 1.0),
    "damping": ("damping", "%", 1.0),
    "phase_deg": ("phase at the end", "deg", 1.0),
    "swerve_m": ("swerve, rms", "mm", 1e3),
    "speed": ("speed, rms", "%", 1.0),
}
TITLES = {"derivatives": "derivatives against the flow", "model": "state-space model against the flow"}


def claims(results: Results) -> tuple[Claim, ...]:
    """Differences of flights, what the time step does, and what each flight costs."""
    listed = []
    for angle in ANGLES:
        shot = results.select(method=f"shot_{angle:g}deg").at(2.0)
        listed += [_difference(shot, angle, name, key) for key in WHAT for name in FLIGHTS[:2]]
    first = results.select(method=f"shot_{ANGLES[0]:g}deg").at(2.0)
    doubled = results.select(method=f"shot_{ANGLES[0]:g}deg_doubled_step").at(2.0)
    return (*listed, *_time_step(first, doubled), *_cost(first))


def _difference(shot: PieceResult | None, angle: float, name: str, key: str) -> Claim:
    what, unit, factor = WHAT[key]
    title = f"{angle:g} deg: {what}, {TITLES[name]}"
    if shot is None:
        return Claim(title, None, None, unit=unit)
    value = shot.provenance["against_flow"][name][key] * factor
    shown = f"{value:+.2%}" if unit == "%" else f"{value:+.2f} {unit}"
    return Claim(title, abs(value), None, shown if key in SIGNED else "", unit=unit)


def _time_step(first: PieceResult | None, doubled: PieceResult | None) -> list[Claim]:
    """What twice the step changes in the flight with the flow: damping and turning."""
    listed = []
    for key, what in (("damping_1_m", "damping"), ("turning_rad_m", "turning rate")):
        title = f"flow: {what} with twice the time step"
        if first is None or doubled is None:
            listed.append(Claim(title, None, None))
            continue
        change = doubled.provenance["flow"][key] / first.provenance["flow"][key] - 1.0
        listed.append(Claim(title, abs(change), None))
    return listed


def _cost(shot: PieceResult | None) -> list[Claim]:
    if shot is None:
        return [Claim(f"cost of a flight: {name}", None, None, unit="s") for name in FLIGHTS]
    spent = shot.provenance["cost"]
    return [Claim(f"cost of a flight: {name}", spent[f"{name}_cpu_s"], None, unit="s") for name in FLIGHTS]
