"""What was asked of closing the loop on the range, from kept results."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.stats import binom

from indicial.conventions import Array
from indicial.studies.claim import Claim
from indicial.studies.kept import Results
from indicial.studies.piece import PieceResult
from indicial.studies.range.pieces import NAMES, PIECES

SURE = 1.959963984540054
LEAST, MOST, SCATTER = 0.90, 0.98, 0.15
"""Coverage of 95% intervals, and how far a reported standard error may be from the true scatter."""

DAMPING = "Cm_q+Cm_alphadot"


def claims(results: Results) -> tuple[Claim, ...]:
    """Recovery of every coefficient, coverage, errors reported, what printed errors imply, the flight in the flow."""
    closing = list(results.select(method="closing"))
    complete = len(closing) == sum(piece.method == "closing" for piece in PIECES)
    return (
        _recovered(closing, complete),
        *_coverage(closing, complete),
        *_implied(next(iter(results.select(method="implied")), None)),
        *_in_flow(next(iter(results.select(method="in_flow")), None)),
    )


def closing_arrays(closing: list[PieceResult]) -> tuple[Array, Array]:
    """Errors and standard errors of all records, relative to the truth, shapes (n_groups, n_records, n_names)."""
    sizes = [np.abs([r.provenance["truth"][name] for name in NAMES]) for r in closing]
    errors = [np.array(r.provenance["errors"]) / size for r, size in zip(closing, sizes, strict=True)]
    reported = [np.array(r.provenance["standard_errors"]) / size for r, size in zip(closing, sizes, strict=True)]
    return np.array(errors), np.array(reported)


def _recovered(closing: list[PieceResult], complete: bool) -> Claim:
    """Of the first record of each group: intervals that miss the truth, against what chance makes miss."""
    name = "first records: 95% intervals that miss the published coefficient"
    if not closing:
        return Claim(name, None, None, unit="")
    missed = []
    for result in closing:
        for coefficient, (value, error) in result.provenance["multiple"].items():
            if abs(value - result.provenance["truth"][coefficient]) > SURE * error:
                missed.append(f"{coefficient} at M {result.piece.mach:g}")
    total = len(closing) * len(NAMES)
    limit = float(binom.ppf(0.99, total, 0.05))
    note = f"of {total}, {0.05 * total:g} expected; at most so many by chance in 99 of 100 studies"
    return Claim(name, float(len(missed)), limit, ", ".join(missed) or "none", note, unit="", complete=complete)


def _coverage(closing: list[PieceResult], complete: bool) -> list[Claim]:
    names = (
        "all records: share of 95% intervals that miss, worst coefficient",
        "the same, best coefficient: share that hold",
        "reported standard error against the true scatter, worst",
    )
    if not closing:
        return [Claim(name, None, None) for name in names]
    errors, reported = closing_arrays(closing)
    held = np.mean(np.abs(errors) < SURE * reported, axis=(0, 1))
    # every group has a scatter of its own: normalised errors put them together
    ratio = 1.0 / np.sqrt(np.mean((errors / reported) ** 2, axis=(0, 1)))
    count = errors.shape[0] * errors.shape[1]
    low, high, worst = int(np.argmin(held)), int(np.argmax(held)), int(np.argmax(np.abs(ratio - 1.0)))
    shown = ", ".join(f"{name} {share:.3f}" for name, share in zip(NAMES, held, strict=True))
    return [
        Claim(names[0], 1.0 - held[low], 1.0 - LEAST, NAMES[low], f"{count} records; {shown}", complete=complete),
        Claim(names[1], float(held[high]), MOST, NAMES[high], complete=complete),
        Claim(names[2], abs(ratio[worst] - 1.0), SCATTER, f"{NAMES[worst]}: {ratio[worst]:.3f}", complete=complete),
    ]


def _implied(result: PieceResult | None) -> list[Claim]:
    """Noise of the angles with which the printed error of the damping sum comes out."""
    name = "angular noise that the printed error of the damping sum implies"
    if result is None:
        return [Claim(name, None, None, unit="deg")]
    noise = implied_noise(result)
    said = ", ".join(f"M {mach:g} {angle:.2f}" for mach, angle in noise.items())
    return [Claim(name, float(np.median(list(noise.values()))), None, said, "median", unit="deg")]


def implied_noise(result: PieceResult) -> dict[float, float]:
    """Angular noise [deg] by group, positions as precise as assumed."""
    return {row["mach"]: row["angle_deg"] for row in result.provenance["implied"]}


def _in_flow(result: PieceResult | None) -> list[Claim]:
    names = (
        "flight in the flow: damping sum, exactly seen, against the operator",
        "flight in the flow, range noise: coefficients that a method shifts",
    )
    if result is None:
        return [Claim(names[0], None, None), Claim(names[1], None, None, unit="")]
    rows: dict[str, Any] = result.provenance["rows"]
    known = result.provenance["cfd"]
    exact = rows["exact, both"][DAMPING][0] / known["operator"][DAMPING] - 1.0
    said = ", ".join(f"{method} {values[DAMPING]:.1f}" for method, values in known.items() if DAMPING in values)
    seen, error = rows["seen, both"][DAMPING]
    shifted = [
        f"{name} by {method}"
        for method, verdicts in result.provenance["verdicts"].items()
        for name, verdict in verdicts.items()
        if verdict == "shifted"
    ]
    return [
        Claim(names[0], abs(exact), None, f"{rows['exact, both'][DAMPING][0]:.1f}; {said}"),
        Claim(names[1], float(len(shifted)), None, ", ".join(shifted) or "none", f"{seen:.1f} +- {error:.1f}", unit=""),
    ]
