"""The figures asked of the study, from kept results."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from indicial.conventions import Array
from indicial.derivatives import DerivativeTable
from indicial.reference_data import finner_arl, finner_range, read_table
from indicial.studies.claim import Claim, largest, relative_rms
from indicial.studies.finner import experiment_claims
from indicial.studies.finner.axial_force import axial_force
from indicial.studies.finner.pieces import (
    LEVELS,
    LOWEST_WITHOUT_WAKE,
    OUTLYING,
    PIECES,
    SONIC,
    STEPS_PER_PERIOD,
    SUPERSONIC,
)
from indicial.studies.finner.selection import (
    OTHER_MOMENT_REFERENCE,
    about,
    convergence,
    derivative,
    finest,
    levels_of,
    pairs,
    suitable,
)
from indicial.studies.finner.variants import FINNER
from indicial.studies.kept import Results

SUM = "Cm_q+Cm_alphadot"

LOWEST_DAMPING, LOWEST_STATIC = 1.29, 1.8
"""Lowest Mach numbers of the comparisons of damping, and of static and roll derivatives."""

FORCED_K = 0.025


def claims(results: Results) -> tuple[Claim, ...]:
    """Every asked figure, and what is reported beside them."""
    asked = (*_flights(results), *_context(), *_methods(results), *_time_steps(results))
    return (*asked, *_meshes(results), *_cost(results), *experiment_claims.claims(results))


def _flights(results: Results) -> list[Claim]:
    """The operator at k = 0 on the finest mesh against the multiple-fit groups."""
    best = finest(results)
    listed = []
    asked: tuple[tuple[str, str, float | None, float, bool], ...] = (
        ("damping sum, RMS of five flights", SUM, 0.06, LOWEST_DAMPING, True),
        ("damping sum, RMS of all seven flights (hope: 9%)", SUM, None, LOWEST_DAMPING, False),
        ("CN_alpha, RMS of flights from M 1.8", "CN_alpha", 0.08, LOWEST_STATIC, False),
        ("Cm_alpha, RMS of flights from M 1.8", "Cm_alpha", 0.08, LOWEST_STATIC, False),
        ("Cl_p, RMS of flights from M 1.8", "Cl_p", 0.15, LOWEST_STATIC, False),
    )
    for title, name, target, lowest, without in asked:
        wanted = flights(name, lowest, without)
        there = {mach: value for mach, value in wanted.items() if best.at(mach) is not None}
        found = [derivative(r, name, k=None) for mach in there if (r := best.at(mach)) is not None]
        claim = relative_rms(title, target, list(there), np.array(found), np.array(list(there.values())))
        used = Results(tuple(r for r in best if r.piece.mach in there))
        missing = len(wanted) - len(there)
        note = f"mesh: {levels_of(used)}" + (f"; {missing} of {len(wanted)} not computed" if missing else "")
        listed.append(_with(claim, note, complete=not missing))
    return [*listed, _axial_force(best)]


def _axial_force(best: Results) -> Claim:
    """Total of the inviscid part and of the estimates."""
    wanted = {m: v for m, v in flights("CA_0", LOWEST_STATIC).items() if best.at(m) is not None}
    found = [
        axial_force(FINNER, mach, derivative(r, "CA_0")).total for mach in wanted if (r := best.at(mach)) is not None
    ]
    title = "CA_0 with estimated friction and base, RMS of flights from M 1.8"
    return relative_rms(title, None, list(wanted), np.array(found), np.array(list(wanted.values())))


def flights(name: str, lowest: float, without_outlying: bool = False) -> dict[float, float]:
    """Multiple-fit values by Mach number."""
    return {
        r.mach: r.value
        for r in finner_range("multifit").select(name=name)
        if r.mach >= lowest and not (without_outlying and r.mach in OUTLYING)
    }


def _context() -> list[Claim]:
    """The same figure for the paper's curve and for ARL's, read between their points."""
    listed = []
    paper = read_table("basic_finner_paper_figures")
    rows = [i for i, series in enumerate(paper.text("series")) if series == "sum_MRF_plus_FOM"]
    curves = {
        "the paper's curve": (paper.numbers("mach")[rows], paper.numbers("value")[rows]),
        "ARL's RANS": _curve(finner_arl(), SUM),
    }
    for without, count in ((True, "five"), (False, "seven")):
        wanted = flights(SUM, LOWEST_DAMPING, without)
        for title, (mach, value) in curves.items():
            found = np.interp(list(wanted), mach, value)
            name = f"for comparison: {title}, damping sum, RMS of {count} flights"
            listed.append(relative_rms(name, None, list(wanted), found, np.array(list(wanted.values()))))
    return listed


def _curve(table: DerivativeTable, name: str) -> tuple[Array, Array]:
    records = table.select(name=name).records
    return np.array([r.mach for r in records]), np.array([r.value for r in records])


def _methods(results: Results) -> list[Claim]:
    """The methods against each other, on one mesh, at one k."""
    asked: tuple[tuple[str, str, str, float | None, str | None, float], ...] = (
        ("Cm_q: MRF against H_q(0)", "mrf", "Cm_q", None, None, 0.01),
        ("Cm_q: FOM at k against H_q(ik)", "fom_pitch_rate", "Cm_q", FORCED_K, None, 0.01),
        ("Cm_alphadot: FOM at k against H_a(ik), of Cm_q", "fom_plunge", "Cm_alphadot", FORCED_K, "Cm_q", 0.02),
        ("Cm_q+Cm_alphadot: FOM at k against the operator", "fom_pitch", SUM, FORCED_K, None, 0.01),
        ("Cm_q: IRM against H_q(0)", "irm", "Cm_q", None, None, 0.01),
        ("Cm_alphadot: IRM against H_a'(0), of Cm_q", "irm", "Cm_alphadot", None, "Cm_q", 0.02),
    )
    listed = []
    for title, method, name, k, scale, target in asked:
        found = pairs(results, method, name, k, scale)
        claim = largest(title, target, [one.mach for one in found], np.array([one.deviation for one in found]))
        planned = sum(piece.method == method for piece in PIECES)
        missing = "" if len(found) == planned else f"{planned - len(found)} of {planned} not computed"
        listed.append(_with(claim, missing, complete=len(found) == planned))
    best = finest(results)
    gap = [derivative(r, "Cm_q", k=FORCED_K) / derivative(r, "Cm_q", k=None) - 1.0 for r in best]
    listed.append(largest(f"Cm_q: from k = 0 to k = {FORCED_K}, operator", None, list(best.machs()), np.array(gap)))
    arl = dict(zip(*_curve(finner_arl(), SUM), strict=True))
    shared = [r for r in best if r.piece.mach in arl]
    found_at = np.array([derivative(r, SUM, k=0.1) for r in shared])
    wanted = np.array([arl[r.piece.mach] for r in shared])
    title = "damping sum at k = 0.1 against ARL's RANS, RMS"
    return [*listed, relative_rms(title, None, [r.piece.mach for r in shared], found_at, wanted), _transfer(results)]


def _transfer(results: Results) -> Claim:
    """Moment transfer against a direct computation about the other point."""
    title = f"moment transfer to {OTHER_MOMENT_REFERENCE:g}d against a direct computation"
    direct = results.select(method=f"operator_about_{OTHER_MOMENT_REFERENCE:g}d")
    for one in direct:
        base = results.select(method="operator", mesh=one.piece.mesh, level=one.piece.level).at(one.piece.mach)
        if base is None:
            continue
        moved = about(base, OTHER_MOMENT_REFERENCE)
        # The zero of a moment is nowhere near these points, so relative differences are fair.
        deviation = [value / one.derivatives.value(name, k=None) - 1.0 for name, value in moved.items()]
        worst = int(np.argmax(np.abs(deviation)))
        return Claim(title, abs(deviation[worst]), 1e-4, f"worst {list(moved)[worst]} at M {one.piece.mach:g}")
    return Claim(title, None, 1e-4)


def _time_steps(results: Results) -> list[Claim]:
    """What smaller time steps change of forced oscillations at M 1, from the largest to the smallest of the paper."""
    large, small = max(STEPS_PER_PERIOD), min(STEPS_PER_PERIOD)
    methods = [f"time_step_{step:g}" for step in (large, small)]
    levels = [level for level in LEVELS if all(len(results.select(method=one, level=level)) for one in methods)]
    listed = []
    for name in ("Cm_q", "CN_q"):
        coarsely, finely = (
            np.array([derivative(r, name) for level in levels for r in results.select(method=one, level=level)])
            for one in methods
        )
        title = f"{name}: FOM with U dt/d = {large:g} against {small:g}"
        claim = largest(title, 0.005, [SONIC] * len(levels), coarsely / finely - 1.0)
        listed.append(_with(claim, f"mesh: {', '.join(levels)}" if levels else ""))
    return listed


def _meshes(results: Results) -> list[Claim]:
    """What refinement does to the numbers."""
    complete = [m for m in suitable(results).machs() if _levels_at(results, m) == len(LEVELS)]
    listed = []
    for name, target in (("Cm_q", 0.02), (SUM, None), ("CN_alpha", None), ("Cm_alpha", None), ("Cl_p", None)):
        high = [m for m in complete if m >= LOWEST_WITHOUT_WAKE]
        judged = [c for m in high if (c := convergence(results, m, name)) is not None]
        title = f"{name}: last change of the mesh, from M {LOWEST_WITHOUT_WAKE:g}"
        claim = largest(title, target, high, np.array([c.change for c in judged]))
        settled = sum(c.asymptotic for c in judged)
        worst = max((c.index / abs(c.value) for c in judged), default=0.0)
        note = f"asymptotic at {settled} of {len(judged)}; largest grid-convergence index {worst:.1%}" if judged else ""
        listed.append(_with(claim, note, complete=len(high) == len(SUPERSONIC)))
    return [*listed, _kinds(results), *_domains(results)]


def _levels_at(results: Results, mach: float) -> int:
    return len([r for r in suitable(results) if r.piece.mach == mach])


def _kinds(results: Results) -> Claim:
    """The mesh with a sting against that to the base plane, where both are computed, on the finest common level."""
    operators = results.select(method="operator")
    machs, deviations = [], []
    for mach in operators.select(mesh="sting").machs():
        for level in reversed(LEVELS):
            both = [operators.select(mesh=kind, level=level).at(float(mach)) for kind in ("sting", "base")]
            if both[0] is not None and both[1] is not None:
                machs.append(float(mach))
                deviations.append(derivative(both[0], SUM, k=None) / derivative(both[1], SUM, k=None) - 1.0)
                break
    return largest("damping sum: mesh with a sting against mesh without a wake", None, machs, np.array(deviations))


def _domains(results: Results) -> list[Claim]:
    """What the domain's size changes on the quick mesh with a sting."""
    listed = []
    for mesh, words in (
        ("sting_wide", "domain twice as far behind and beside"),
        ("needle", "20 calibres ahead, not 2"),
    ):
        for k in (None, FORCED_K):
            found = pairs(results, "operator", SUM, k, mesh=mesh, against="sting")
            title = f"damping sum at k = {0.0 if k is None else k:g}: {words}"
            listed.append(largest(title, None, [one.mach for one in found], np.array([one.deviation for one in found])))
    return listed


def _cost(results: Results) -> list[Claim]:
    """CPU time of the operator sweep."""
    title = "cost of 12 Mach numbers by the operator on the medium mesh, 2 cores"
    spent = [float(r.provenance["cpu_s"]) for r in suitable(results).select(level="medium")]
    if not spent:
        return [Claim(title, None, 60.0, unit="min")]
    minutes = 12.0 * float(np.mean(spent)) / 2.0 / 60.0
    return [Claim(title, minutes, 60.0, note=f"from the CPU time of {len(spent)} pieces", unit="min")]


def _with(claim: Claim, note: str, complete: bool = True) -> Claim:
    """The claim with a note; one of which points are missing does not count as reached."""
    return replace(claim, note=note, complete=complete)
