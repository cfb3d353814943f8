"""The figures asked of the study, from kept results."""

from __future__ import annotations

from typing import Any

import numpy as np

from indicial.derivatives import DerivativeTable
from indicial.studies.claim import Claim
from indicial.studies.kept import Results
from indicial.studies.piece import PieceResult
from indicial.studies.plate.computing import RECOMMENDED, SMALL, plate_solver
from indicial.studies.plate.exact import incidence_derivatives, steady_response
from indicial.studies.plate.pieces import BEYOND, MACHS, PLATE

PLATE_ERROR, FINNER_ERROR, FINNER_STATES = 0.02, 0.01, 6.0


def claims(results: Results) -> tuple[Claim, ...]:
    """Every asked figure, and what is reported beside them."""
    plates, finner = results.select(mesh="plate"), results.select(mesh="finner")
    return (
        *_plate(plates),
        _beyond(plates),
        _steps(plates),
        _derivatives(plates),
        *_finner(finner.results[0] if len(finner) else None),
    )


def methods(results: Results) -> tuple[str, ...]:
    """Realisations that the results hold, in their order."""
    return tuple(dict.fromkeys(name for result in results for name in result.provenance["realisations"]))


def _plate(plates: Results) -> list[Claim]:
    listed = []
    for method in methods(plates) or (RECOMMENDED,):
        rows = {r.piece.mach: r.provenance["realisations"].get(method) for r in plates}
        made = {mach: row for mach, row in rows.items() if row is not None}
        name = f"plate, {method}: error on motions not seen"
        if not made:
            listed.append(Claim(name, None, PLATE_ERROR))
            continue
        errors = {(m, label): e for m, row in made.items() for label, e in asked(row).items()}
        mach, label = max(errors, key=lambda place: errors[place])
        states = "/".join(str(row["order"]) for _, row in sorted(made.items()))
        listed.append(
            Claim(
                name,
                errors[mach, label],
                PLATE_ERROR,
                f"worst at M {mach:g}, {label}",
                f"{states} states at M {'/'.join(f'{m:g}' for m in sorted(made))}",
                complete=set(made) == set(MACHS),
            )
        )
    return listed


def asked(row: dict[str, Any]) -> dict[str, float]:
    """Errors of a realisation on the motions of which something is asked."""
    return {label: error for label, error in row["unseen"].items() if label != BEYOND}


def _beyond(plates: Results) -> Claim:
    name = f"plate, every realisation: error at {BEYOND}"
    errors = {
        (r.piece.mach, method): row["unseen"][BEYOND]
        for r in plates
        for method, row in r.provenance["realisations"].items()
    }
    if not errors:
        return Claim(name, None, None)
    mach, method = max(errors, key=lambda place: errors[place])
    return Claim(name, errors[mach, method], None, f"worst at M {mach:g}, {method}")


def _steps(plates: Results) -> Claim:
    """How well the models repeat what they were made from, corners included."""
    name = "plate, every realisation: error of the step responses"
    errors = {
        (r.piece.mach, method): row["residual"] for r in plates for method, row in r.provenance["realisations"].items()
    }
    if not errors:
        return Claim(name, None, PLATE_ERROR)
    mach, method = max(errors, key=lambda place: errors[place])
    return Claim(name, errors[mach, method], PLATE_ERROR, f"worst at M {mach:g}, {method}")


def exact_derivatives(mach: float) -> dict[str, float]:
    """Closed forms of the plate about its moment reference point, rates per c/2V."""
    axis = plate_solver(PLATE).axis
    cl_a, cm_a, cl_q, cm_q = (float(value) for value in steady_response(mach, axis))
    cl_ad, cm_ad = incidence_derivatives(mach, axis)
    # theory has rates per c/V
    return {
        "CN_alpha": cl_a, "Cm_alpha": cm_a, "CN_q": 2.0 * cl_q, "Cm_q": 2.0 * cm_q,
        "CN_alphadot": 2.0 * cl_ad, "Cm_alphadot": 2.0 * cm_ad,
    }  # fmt: skip


def _derivatives(plates: Results) -> Claim:
    name = f"plate, {RECOMMENDED}: derivatives at k = 0 against closed forms"
    errors = {(r.piece.mach, label): e for r in plates for label, e in _off(r.piece.mach, r.derivatives).items()}
    if not errors:
        return Claim(name, None, None)
    mach, label = max(errors, key=lambda place: errors[place])
    return Claim(name, errors[mach, label], None, f"worst {label} at M {mach:g}")


def _off(mach: float, table: DerivativeTable) -> dict[str, float]:
    return {name: abs(table.value(name) / value - 1.0) for name, value in exact_derivatives(mach).items()}


def _finner(result: PieceResult | None) -> list[Claim]:
    names = ("Finner at M 2: error on motions not seen", "Finner at M 2: states of that model")
    if result is None:
        return [Claim(names[0], None, FINNER_ERROR), Claim(names[1], None, FINNER_STATES, unit="")]
    rows = result.provenance["realisations"]
    unseen = rows[SMALL]["unseen"]
    worst = max(unseen, key=unseen.__getitem__)
    listed = [
        Claim(names[0], unseen[worst], FINNER_ERROR, f"worst at {worst}", f"others {_others(unseen, worst)}"),
        Claim(names[1], float(rows[SMALL]["order"]), FINNER_STATES, unit=""),
    ]
    for method, row in rows.items():
        if method != SMALL:
            error = float(np.max(list(row["unseen"].values())))
            listed.append(Claim(f"Finner at M 2, {method}: the same", error, None, f"{row['order']} states"))
    return listed


def _others(unseen: dict[str, float], worst: str) -> str:
    return ", ".join(f"{label}: {error:.2%}" for label, error in unseen.items() if label != worst)
