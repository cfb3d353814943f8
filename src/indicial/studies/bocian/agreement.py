"""The figures asked of the study, from kept results."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from indicial.studies.claim import Claim
from indicial.studies.kept import Results
from indicial.studies.piece import PieceResult

PAPER = {0.1: -2.392, 0.5: -2.445}
"""C_lp of the paper at alpha = 4 deg by k, both on half the span."""

LINEAR_CHANGE = -0.016
"""Change of C_lp's size from k = 0.1 to 0.5 by linear lifting-surface theory of a planform like this one."""

AT_FOUR, WHILE_ATTACHED = 0.04, 0.02
ATTACHED_UP_TO = 8.0
"""Incidence up to which the paper's flow is attached [deg]; it parts from 10 on."""

REDUCTIONS = ("phase_angle", "regression", "fourier")


def claims(results: Results) -> tuple[Claim, ...]:
    """Every asked figure, and what is reported beside them."""
    frequency, frame = piece(results, "frequency"), piece(results, "frame", level="fine")
    forced, rocking = piece(results, "forced"), piece(results, "rocking")
    return (
        _at_four(frequency),
        _shortfall(piece(results, "shortfall"), frequency),
        _variants(piece(results, "variants")),
        *_changes(frequency),
        _attached(frame, forced),
        *_stalled(frame, forced),
        _meeting(piece(results, "frame", mesh="beyond"), piece(results, "forced", mesh="beyond"), forced),
        _rocking(
            (frame, piece(results, "frame", mesh="beyond")), (forced, piece(results, "forced", mesh="beyond")), rocking
        ),
        _freedom(piece(results, "freedom")),
        _states(frame),
        _rates(piece(results, "rates")),
        *_cells(piece(results, "cells"), "one_sided"),
        *_cells(piece(results, "cells", mesh="forced"), "fourier"),
        _rocking(
            (piece(results, "frame", mesh="spread"),),
            (piece(results, "forced", mesh="spread"),),
            piece(results, "rocking", mesh="spread"),
            "with separation spread: where free rocking contradicts both",
        ),
        *_spread(
            piece(results, "frame", mesh="spread"),
            piece(results, "forced", mesh="spread"),
            piece(results, "rates", mesh="spread"),
        ),
    )


def piece(results: Results, method: str, *, mesh: str = "base", level: str | None = None) -> PieceResult | None:
    """The one result of a method, None if it is not computed."""
    found = [r for r in results.select(method=method, mesh=mesh) if level in (None, r.piece.level)]
    return found[0] if found else None


def rows(result: PieceResult) -> list[dict[str, Any]]:
    """What it found, incidence by incidence or k by k."""
    listed: list[dict[str, Any]] = result.provenance["rows"]
    return listed


def by_alpha(result: PieceResult, name: str) -> dict[float, float]:
    """One number of each row, by incidence [deg]."""
    return {float(row["alpha_deg"]): float(row[name]) for row in rows(result)}


def _at_four(frequency: PieceResult | None) -> Claim:
    name = "Cl_p at alpha 4 deg, k = 0.1: deviation from the paper"
    if frequency is None:
        return Claim(name, None, AT_FOUR)
    value = next(float(row["fourier"]) for row in rows(frequency) if row["k"] == 0.1)
    note = f"{value:.3f} against {PAPER[0.1]} on half the span, {value / 4.0:.4f} on the span"
    return Claim(name, abs(value / PAPER[0.1] - 1.0), AT_FOUR, note=note)


def _shortfall(shortfall: PieceResult | None, frequency: PieceResult | None) -> Claim:
    """The deviation in parts of the paper's value: each case changes one thing of the case before."""
    name = "the same: what its parts leave unexplained"
    if shortfall is None or frequency is None:
        return Claim(name, None, None)
    found = {label: float(value) / PAPER[0.1] - 1.0 for label, value in shortfall.provenance["rows"].items()}
    order = ("slope 2 pi, no drag", "slope 2 pi", "attached slope of the polars", "base")
    parts = [found[later] - found[earlier] for earlier, later in itertools.pairwise(order)]
    alone = float(frequency.provenance["linear"][0]) / PAPER[0.1] - 1.0
    words = ("drag", "attached slope of sections below 2 pi", "their lift curve bending")
    said = ", ".join(f"{word} {100.0 * part:+.2f}" for word, part in zip(words, parts, strict=True))
    rest = abs(found["base"] - alone - sum(parts))
    return Claim(name, rest, None, note=f"in points: inviscid lattice {100.0 * alone:+.2f}, {said}")


def _variants(variants: PieceResult | None) -> Claim:
    name = "the same: largest change with what is not published"
    if variants is None:
        return Claim(name, None, None)
    found = {label: float(row["fom"]) for label, row in variants.provenance["rows"].items()}
    changes = {label: value / found["base"] - 1.0 for label, value in found.items() if label != "base"}
    worst = max(changes, key=lambda label: abs(changes[label]))
    return Claim(name, abs(changes[worst]), None, f"{worst}: {changes[worst]:+.1%}")


def _changes(frequency: PieceResult | None) -> list[Claim]:
    names = (
        "size of Cl_p from k = 0.1 to 0.5: change by sections and lattice",
        "the same, by the lattice alone: deviation from linear theory",
    )
    if frequency is None:
        return [Claim(name, None, None) for name in names]
    by_k = {float(row["k"]): float(row["fourier"]) for row in rows(frequency)}
    linear = dict(zip(frequency.piece.settings["k"], frequency.provenance["linear"], strict=True))
    own, alone = (found[0.5] / found[0.1] - 1.0 for found in (by_k, linear))
    paper = PAPER[0.5] / PAPER[0.1] - 1.0
    return [
        Claim(names[0], abs(own), None, f"{own:+.2%}, the paper's {paper:+.1%}"),
        Claim(names[1], abs(alone - LINEAR_CHANGE), None, f"{alone:+.2%} against {LINEAR_CHANGE:+.1%}"),
    ]


def _attached(frame: PieceResult | None, forced: PieceResult | None) -> Claim:
    name = f"MRF, FOM and its three reductions up to {ATTACHED_UP_TO:g} deg: spread"
    if frame is None or forced is None:
        return Claim(name, None, WHILE_ATTACHED)
    steady = by_alpha(frame, "one_sided")
    spreads = {}
    for row in rows(forced):
        alpha = float(row["alpha_deg"])
        if alpha <= ATTACHED_UP_TO:
            values = np.array([steady[alpha], *(row[reduction] for reduction in REDUCTIONS)])
            spreads[alpha] = float(np.ptp(values) / abs(np.mean(values)))
    worst = max(spreads, key=lambda alpha: spreads[alpha])
    return Claim(name, spreads[worst], WHILE_ATTACHED, f"worst at {worst:g} deg")


def _stalled(frame: PieceResult | None, forced: PieceResult | None) -> list[Claim]:
    names = (
        "parting of MRF and FOM from 10 to 18 deg, of Cl_p at 4 deg",
        "spread of the three reductions there",
        "difference of MRF and FOM at 20 deg",
        "largest Cl_p in stall by MRF, with its sign turned: autorotation",
        "the same by FOM",
        "largest Cl_p by FOM less that by MRF",
    )
    if frame is None or forced is None:
        return [Claim(name, None, None) for name in names]
    steady, swung = by_alpha(frame, "one_sided"), by_alpha(forced, "fourier")
    unit = abs(swung[4.0])
    parting = {alpha: abs(swung[alpha] - steady[alpha]) / unit for alpha in swung if 10.0 <= alpha <= 18.0}
    spread = {
        float(row["alpha_deg"]): float(np.ptp([row[reduction] for reduction in REDUCTIONS])) / unit
        for row in rows(forced)
        if 10.0 <= row["alpha_deg"] <= 18.0
    }
    most, widest = (max(found, key=lambda alpha: found[alpha]) for found in (parting, spread))
    top, top_swung = max(steady, key=lambda a: steady[a]), max(swung, key=lambda a: swung[a])
    return [
        Claim(names[0], parting[most], None, f"worst at {most:g} deg: {steady[most]:.3f} and {swung[most]:.3f}"),
        Claim(names[1], spread[widest], None, f"worst at {widest:g} deg"),
        Claim(names[2], abs(swung[20.0] - steady[20.0]) / unit, None, f"{steady[20.0]:.3f} and {swung[20.0]:.3f}"),
        Claim(names[3], -steady[top], 0.0, f"at {top:g} deg", unit=""),
        Claim(names[4], -swung[top_swung], 0.0, f"at {top_swung:g} deg", unit=""),
        Claim(names[5], swung[top_swung] - steady[top], 0.0, "the paper's MRF is the stronger", unit=""),
    ]


def _meeting(frame: PieceResult | None, swung: PieceResult | None, forced: PieceResult | None) -> Claim:
    name = "the same beyond the paper's range, at 24 deg"
    if frame is None or swung is None or forced is None:
        return Claim(name, None, None)
    pairs = {alpha: (value, by_alpha(swung, "fourier")[alpha]) for alpha, value in by_alpha(frame, "one_sided").items()}
    said = ", ".join(f"{alpha:g} deg: {one:.2f} and {two:.2f}" for alpha, (one, two) in pairs.items())
    one, two = pairs[24.0]
    return Claim(name, abs(two - one) / abs(by_alpha(forced, "fourier")[4.0]), None, said)


def _rocking(
    frame: tuple[PieceResult | None, ...],
    forced: tuple[PieceResult | None, ...],
    rocking: PieceResult | None,
    name: str = "incidences at which free rocking contradicts MRF and FOM both",
) -> Claim:
    if None in (*frame, *forced) or rocking is None:
        return Claim(name, None, 0.0, unit="")
    steady = {alpha: value for one in frame if one for alpha, value in by_alpha(one, "one_sided").items()}
    swung = {alpha: value for one in forced if one for alpha, value in by_alpha(one, "fourier").items()}
    judged, against = [], []
    for row in rows(rocking):
        alpha = float(row["alpha_deg"])
        if alpha in swung and (steady[alpha] > 0.0) == (swung[alpha] > 0.0):
            judged.append(alpha)
            if bool(row["autorotates"]) != (swung[alpha] > 0.0):
                against.append(alpha)
    said = ", ".join(f"{alpha:g} deg" for alpha in against) or "none"
    both = ", ".join(f"{alpha:g}" for alpha in judged if swung[alpha] > 0.0) or "none"
    note = f"{said} of {len(judged)}; both say autorotation at {both} deg"
    return Claim(name, float(len(against)), 0.0, note, unit="")


def _freedom(freedom: PieceResult | None) -> Claim:
    name = "how far FOM moves from 10 to 18 deg with its own choices"
    if freedom is None:
        return Claim(name, None, None, unit="")
    found = freedom.provenance["rows"]
    base = np.array([row["fourier"] for row in found["base"]])
    moved = {label: np.array([row["fourier"] for row in listed]) - base for label, listed in found.items()}
    label = max(moved, key=lambda one: float(np.max(np.abs(moved[one]))))
    at = int(np.argmax(np.abs(moved[label])))
    alpha = freedom.piece.settings["alpha_deg"][at]
    return Claim(
        name, float(np.abs(moved[label][at])), None, f"{label}, {alpha:g} deg: {moved[label][at]:+.3f}", unit=""
    )


def _states(frame: PieceResult | None) -> Claim:
    name = "incidences at which there are several steady states"
    if frame is None:
        return Claim(name, None, None, unit="")
    several = [row["alpha_deg"] for row in rows(frame) if max(row["states"], row["states_turning"]) > 1]
    said = ", ".join(f"{alpha:g}" for alpha in several) or "none"
    return Claim(name, float(len(several)), None, f"{said} [deg] of {len(rows(frame))}", unit="")


def _rates(
    rates: PieceResult | None, name: str = "Cl_p by MRF from 14 to 20 deg: range over rates and panels"
) -> Claim:
    """In stall a quotient of differences is no derivative: how far it moves with its own rate and the panels."""
    if rates is None:
        return Claim(name, None, None, unit="")
    found: dict[float, list[float]] = {}
    for row in rows(rates):
        found.setdefault(float(row["alpha_deg"]), []).append(float(row["one_sided"]))
    said = "; ".join(f"{alpha:g} deg: {min(values):.2f} to {max(values):.2f}" for alpha, values in found.items())
    return Claim(name, max(float(np.ptp(values)) for values in found.values()), None, said, unit="")


def by_strips(cells: PieceResult, spread: float, name: str = "one_sided") -> dict[int, dict[float, float]]:
    """Cl_p (MRF's if not named) by strips across half a wing, then by incidence [deg], of one spread."""
    found: dict[int, dict[float, float]] = {}
    for row in rows(cells):
        if row["spread"] == spread:
            found.setdefault(int(row["across"]), {})[float(row["alpha_deg"])] = float(row[name])
    return found


def _cells(cells: PieceResult | None, reading: str) -> list[Claim]:
    """What the number of strips does where stall comes in cells, and what is left of it where separation spreads."""
    said = {"one_sided": "MRF from 16 to 22 deg", "fourier": "FOM from 18 to 22 deg"}[reading]
    names = (f"Cl_p by {said}: range over 8 to 20 strips", "the same, separation spread over one chord")
    if cells is None:
        return [Claim(name, None, None, unit="") for name in names]
    ranges = {}
    for spread in cells.piece.settings["spreads"]:
        values = np.array([list(one.values()) for one in by_strips(cells, spread, reading).values()])
        ranges[spread] = np.ptp(values, axis=0)
    alphas = cells.piece.settings["alpha_deg"]
    worst = {spread: f"worst at {alphas[int(np.argmax(found))]:g} deg" for spread, found in ranges.items()}
    others = ", ".join(
        f"over {spread:g}: {np.max(found):.2f}" for spread, found in ranges.items() if spread not in (0.0, 1.0)
    )
    return [
        Claim(names[0], float(np.max(ranges[0.0])), None, worst[0.0], unit=""),
        Claim(names[1], float(np.max(ranges[1.0])), None, worst[1.0], others, unit=""),
    ]


def _spread(frame: PieceResult | None, swung: PieceResult | None, rates: PieceResult | None) -> list[Claim]:
    """MRF and FOM in stall once more, with a separation that does not depend on the strips."""
    name = "difference of MRF and FOM at 20 deg with that spread, of Cl_p at 14 deg"
    of_rates = _rates(rates, "Cl_p by MRF from 14 to 20 deg with it: range over rates and panels")
    if frame is None or swung is None:
        return [Claim(name, None, None), of_rates]
    steady, forced = by_alpha(frame, "one_sided"), by_alpha(swung, "fourier")
    said = ", ".join(f"{alpha:g} deg: {value:.2f} and {forced[alpha]:.2f}" for alpha, value in steady.items())
    return [Claim(name, abs(forced[20.0] - steady[20.0]) / abs(forced[14.0]), None, said), of_rates]
