"""The compare stage: every derivative by every method beside the measured one, and ``results.json``."""

from __future__ import annotations

import json
import platform
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from indicial import __version__
from indicial.derivatives import SCHEMA_VERSION, DerivativeTable
from indicial.files import write_text
from indicial.pipeline.context import Context, Outcome
from indicial.reference_data import finner_range_at
from indicial.report.comparison import comparison, comparison_text, operator_at, statement

COMPUTED = ("mrf", "fom", "irm", "operator", "rom", "identify")
SECTIONS = ("mesh", *COMPUTED, "fly")


def compare(context: Context) -> Outcome:
    """Write ``results.json`` and ``comparison.txt``."""
    folder, case = context.folder, context.case
    records = {stage: folder.read(stage) for stage in SECTIONS}
    table = sum((context.derivatives(stage) for stage in COMPUTED), start=DerivativeTable())
    measured, excuse = _measured(context)
    table = table + measured
    rows = comparison(table)
    mesh = f"this mesh of {records['mesh']['half']['n_cells']:,} cells for half the body"
    sentence = statement(rows, mesh)
    agreement = _agreement(table, records)
    results = {
        "schema_version": SCHEMA_VERSION,
        "title": case.title,
        "derivatives": table.to_records(),
        "case": case.model_dump(),
        "versions": _versions(),
        "mesh": _plain(records["mesh"]),
        "timings_s": {stage: record["seconds"] for stage, record in records.items()},
        "linearity": [entry for method in ("mrf", "fom", "irm") for entry in records[method]["linearity"]],
        "agreement": agreement,
        "operator": _plain(records["operator"]),
        "rom": _plain(records["rom"]),
        "flight": _plain(records["fly"]),
        "identification": _plain(records["identify"]),
        "damping": records["fly"]["damping"],
        "refused": records["irm"]["refused"],
        "statement": sentence,
        "measured_data": excuse or "DREV-TM-9703, see data/README.md",
    }
    write_text(folder.path / "results.json", json.dumps(results, indent=1, allow_nan=False))
    text = "\n\n".join([case.title, comparison_text(rows), sentence, _agreement_text(agreement), excuse]).strip()
    write_text(folder.path / "comparison.txt", text + "\n")
    return Outcome({"statement": sentence}, f"{len(table)} derivatives in {folder.path / 'results.json'}")


def _measured(context: Context) -> tuple[DerivativeTable, str]:
    """Measured derivatives at the case's Mach number, or why there are none."""
    case = context.case
    if case.comparison.measured == "none":
        return DerivativeTable(), "The case names no measured data to be compared with."
    measured = finner_range_at(case.condition.mach)
    taken_at = measured.records[0].moment_reference_m[0] / measured.records[0].reference_length_m
    if abs(taken_at - case.reference.moment_reference_calibres) > 1e-6:
        return DerivativeTable(), (
            f"The measured data are about {taken_at:g} calibres, this case is about "
            f"{case.reference.moment_reference_calibres:g}: they are not set side by side."
        )
    return measured, ""


def _agreement(table: DerivativeTable, records: dict[str, Any]) -> list[dict[str, Any]]:
    """What theory says must agree on a linear flow, and by how much it does.

    Differences are relative to the damping sum of the same load, so that a small Cm_alphadot is not held to a
    standard that none of its neighbours is.
    """
    found: list[dict[str, Any]] = []

    def pair(what: str, name: str, first: float, second: float, size: float) -> None:
        found.append(
            {"what": what, "name": name, "first": first, "second": second, "difference": (first - second) / abs(size)}
        )

    mrf, irm = table.select(method="mrf"), table.select(method="irm")
    fom = table.select(method="fom", reduction="fourier")
    operator = table.select(method="operator", k=None)
    oscillation = fom.records[0].k
    assert oscillation is not None
    operator_at_k = operator_at(table, oscillation)
    for load in ("CN", "Cm"):
        total = f"{load}_q+{load}_alphadot"
        size = fom.value(total)
        alpha = f"{load}_alpha"
        ends = records["irm"]["ends"]
        pair("end of the step in alpha, MRF", alpha, ends["alpha"][load], mrf.value(alpha), mrf.value(alpha))
        pair("end of the step in q, MRF", f"{load}_q", ends["q"][load], mrf.value(f"{load}_q"), size)
        pair("slope: MRF, operator", alpha, mrf.value(alpha), operator.value(alpha), mrf.value(alpha))
        pair("rate: MRF, operator", f"{load}_q", mrf.value(f"{load}_q"), operator.value(f"{load}_q"), size)
        if f"{load}_alphadot" in irm.names():
            lag = irm.value(f"{load}_alphadot")
            if f"{load}_alphadot" in operator.names():
                pair("lag: IRM, operator", f"{load}_alphadot", lag, operator.value(f"{load}_alphadot"), size)
            pair("lag: FOM at k, IRM at k = 0", f"{load}_alphadot", fom.value(f"{load}_alphadot"), lag, size)
            pair("sum: FOM at k, MRF + IRM at k = 0", total, size, mrf.value(f"{load}_q") + lag, size)
        pair("sum at the same k: FOM, operator", total, size, operator_at_k.value(total), size)
        at_k = records["rom"]["out_of_phase_at_k"][load]
        pair("sum at the same k: FOM, reduced-order model", total, at_k["fom"], at_k["rom"], size)
        by_reduction = [r.value for r in table.select(method="fom", name=total)]
        pair("reductions of FOM: largest, smallest", total, max(by_reduction), min(by_reduction), size)
    if "Cl_p" in operator.names():
        whole, half = mrf.value("Cl_p"), operator.value("Cl_p")
        pair("roll: MRF (whole body), operator (half)", "Cl_p", whole, half, whole)
    return found


def _agreement_text(agreement: list[dict[str, Any]]) -> str:
    lines = ["agreement of the methods (of the damping sum; static slopes of themselves)"]
    lines += [
        f"  {a['what']:<44}{a['name']:<18}{a['first']:>11.5g}{a['second']:>11.5g}  {a['difference']:+.2%}"
        for a in agreement
    ]
    return "\n".join(lines)


def _plain(record: dict[str, Any]) -> dict[str, Any]:
    """A stage's results without its bookkeeping and without derivatives, which have a list of their own."""
    return {
        name: value
        for name, value in record.items()
        if name not in ("stage", "key", "version", "seconds", "derivatives")
    }


def _versions() -> dict[str, str]:
    found = {"indicial": __version__, "python": platform.python_version()}
    for name in ("numpy", "scipy", "numba", "casadi", "control"):
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not a distribution"
    return found
