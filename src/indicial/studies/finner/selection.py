"""The results that a figure is read from: at each Mach number the mesh that suits it, and the finest level there is."""

from __future__ import annotations

from dataclasses import dataclass

from indicial.conventions import Array, transfer_longitudinal
from indicial.errors import InputError
from indicial.studies.finner.experiments import SMALL_RATES
from indicial.studies.finner.pieces import LEVELS, LOWEST_WITHOUT_WAKE
from indicial.studies.grid_convergence import GridConvergence, grid_convergence
from indicial.studies.kept import Results
from indicial.studies.piece import PieceResult

OTHER_MOMENT_REFERENCE = 6.1
"""Calibres; the paper's text."""


def suitable(results: Results, method: str = "operator") -> Results:
    """Results of a method on the mesh of their Mach number: to the base plane from M 1.5, with a sting below."""
    chosen = results.select(method=method)
    return Results(
        tuple(r for r in chosen if r.piece.mesh == ("base" if r.piece.mach >= LOWEST_WITHOUT_WAKE else "sting"))
    )


def finest(results: Results, method: str = "operator") -> Results:
    """The finest of `suitable` at each Mach number, in order of Mach number."""
    best: dict[float, PieceResult] = {}
    for level in LEVELS:
        best |= {r.piece.mach: r for r in suitable(results, method).select(level=level)}
    return Results(tuple(best[mach] for mach in sorted(best)))


def levels_of(results: Results) -> str:
    """How many points are of which mesh, in words."""
    counts = {level: len(results.select(level=level)) for level in reversed(LEVELS)}
    return ", ".join(f"{count} {level}" for level, count in counts.items() if count)


def derivative(result: PieceResult, name: str, **wanted: object) -> float:
    """A derivative of one result; sums are made of their parts unless the method gives them whole."""
    if "+" in name and not result.derivatives.select(name=name, **wanted).records:
        return sum(result.derivatives.value(part, **wanted) for part in name.split("+"))
    return result.derivatives.value(name, **wanted)


def about(result: PieceResult, moment_reference: float, k: float | None = None) -> dict[str, float]:
    """Longitudinal derivatives about another point [calibres from the nose]."""
    records = {r.name: r for r in result.derivatives.select(k=k)}
    diameter = next(iter(records.values())).reference_length_m
    present = next(iter(records.values())).moment_reference_m[0] / diameter
    return transfer_longitudinal({name: r.value for name, r in records.items()}, moment_reference - present)


def convergence(results: Results, mach: float, name: str) -> GridConvergence | None:
    """Grid convergence of a derivative by the operator at k = 0; None with fewer than two meshes."""
    found = [r for level in LEVELS if (r := suitable(results).select(level=level).at(mach)) is not None]
    if len(found) < 2:
        return None
    return grid_convergence([derivative(r, name, k=None) for r in found], [int(r.provenance["cells"]) for r in found])


def values(results: Results, machs: Array, name: str, **wanted: object) -> list[float]:
    """A derivative at Mach numbers that must all be there."""
    out = []
    for mach in machs:
        result = results.at(float(mach))
        if result is None:
            raise InputError(f"no result at M {mach:g}")
        out.append(derivative(result, name, **wanted))
    return out


@dataclass(frozen=True)
class Pair:
    """Two methods at one Mach number on one mesh."""

    mach: float
    found: float
    wanted: float
    scale: float

    @property
    def deviation(self) -> float:
        """Difference over the scale."""
        return (self.found - self.wanted) / abs(self.scale)


def pairs(
    results: Results,
    method: str,
    name: str,
    k: float | None,
    scale: str | None = None,
    *,
    mesh: str | None = None,
    against: str | None = None,
) -> list[Pair]:
    """A method's derivative against the operator's at the same k, level and Mach number.

    Parameters
    ----------
    scale : str, optional
        The operator's derivative that the difference is measured by; that of `name` if not given.
    mesh, against : str, optional
        Results on one kind of mesh against the operator on another; the same kind if not given.
    """
    found = []
    operators = results.select(method="operator")
    chosen = results.select(method=method) if mesh is None else results.select(method=method, mesh=mesh)
    for one in slowest_turns(results, chosen) if method == "mrf" else chosen:
        kind = one.piece.mesh if against is None else against
        base = operators.select(mesh=kind, level=one.piece.level).at(one.piece.mach)
        # a method may refuse a derivative that has no limit
        if base is None or (method != "operator" and not one.derivatives.select(name=name).records):
            continue
        # an operator's table has records at several k, those of the other methods at one
        wanted = {"k": k} if method == "operator" else {}
        size = derivative(base, scale or name, k=k)
        found.append(Pair(one.piece.mach, derivative(one, name, **wanted), derivative(base, name, k=k), size))
    return found


def slowest_turns(results: Results, found: Results) -> Results:
    """Moving frames, each by the slowest turn that was computed at its Mach number.

    Near M 1 the flow is linear in the rate of a steady turn only where that is small: an experiment turns slower.
    """
    slowest = {one.piece.mach: one for one in found}
    for mach, rates in SMALL_RATES.items():
        for rate in rates:
            slower = results.select(method=f"mrf_rate_{rate:g}").at(mach)
            slowest |= {mach: slower} if slower is not None else {}
    return Results(tuple(slowest[mach] for mach in sorted(slowest)))
