"""The identify stage: the flight as a spark range measures it, and the derivatives that such a record gives."""

from __future__ import annotations

import math
from typing import Any

from indicial.derivatives import DerivativeTable
from indicial.files import write_text
from indicial.identification import FREE_FLIGHT, Precision, RangeFit, RangeRecord, identify, measure
from indicial.pipeline.context import Context, Outcome
from indicial.pipeline.flying import atmosphere, load_flights, vehicle


def identify_flight(context: Context) -> Outcome:
    """Measure the flight that had the reduced-order model in the loop, and identify its derivatives.

    What is identified knows nothing of the CFD: linear theory of the record gives the start, and derivatives that a
    free flight hardly feels are held at zero.
    """
    settings, folder = context.case.range, context.folder
    rolls = context.case.flight.roll_rate_deg_s != 0.0
    precision = Precision(
        settings.position_noise_m, math.radians(settings.angle_noise_deg), math.radians(settings.roll_noise_deg)
    )
    record = measure(
        load_flights(context)["rom"], settings.stations, seed=settings.seed, precision=precision, roll=rolls
    )
    record.to_csv(folder.histories / "range_record.csv")
    record.to_netcdf(folder.histories / "range_record.nc")
    context.reporter.update(0.2, "output error")
    free = (*FREE_FLIGHT, *(("Cl_p",) if rolls else ()))
    result = identify(record, vehicle(context), free=free, atmosphere=atmosphere(context))
    result.fitted[0].save(folder.histories / "identified_flight.nc")
    table = result.table(context.case.flight_condition)
    write_text(folder.path / "identification.txt", result.summary() + "\n")
    results = {
        "derivatives": table.to_records(),
        "stations": len(record),
        "iterations": len(result.fit.cost),
        "noise": dict(zip(record.channels, result.noise.tolist(), strict=True)),
        "residuals": {name: result.fit.residuals[0][:, i].tolist() for i, name in enumerate(record.channels)},
        "against_flown": _against_flown(context, result),
        "summary": result.summary(),
    }
    shown = ", ".join(f"{e.name} {e.value:.4g} ±{e.standard_error:.2g}" for e in result.derivatives[:4])
    return Outcome(results, shown)


def load_record(context: Context) -> RangeRecord:
    """The measurements that the stage kept."""
    return RangeRecord.from_netcdf(context.folder.histories / "range_record.nc")


def _against_flown(context: Context, result: RangeFit) -> list[dict[str, Any]]:
    """Each identified value beside what the flight was flown with."""
    flown = {r.name: r.value for r in DerivativeTable.from_records(context.folder.read("fly")["flown"])}
    flown["Cm_q+Cm_alphadot"] = flown["Cm_q"] + flown["Cm_alphadot"]
    found = []
    for estimate in result.derivatives:
        if estimate.name in flown:
            true = flown[estimate.name]
            found.append(
                {
                    "name": estimate.name,
                    "identified": estimate.value,
                    "standard_error": estimate.standard_error,
                    "flown": true,
                    "standard_errors_off": (estimate.value - true) / estimate.standard_error,
                }
            )
    return found
