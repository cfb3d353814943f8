"""How the pieces are computed: shots flown with the published coefficients, measured with noise, and reduced."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError
from indicial.flightsim import (
    DerivativeAerodynamics,
    End,
    InitialState,
    Trajectory,
    basic_finner_range_model,
    simulate,
)
from indicial.identification import (
    FREE_FLIGHT,
    Precision,
    RangeFit,
    RangeModel,
    RangeRecord,
    identify,
    measure,
    reduce_range,
)
from indicial.motion import FlightCondition
from indicial.reference_data import PROBABLE_ERROR, finner_range
from indicial.studies.kept import Results
from indicial.studies.piece import Piece, PieceResult, version
from indicial.studies.range.pieces import NAMES, groups
from indicial.studies.study import Progress

Found = tuple[list[Derivative], dict[str, Any]]
"""Derivatives and provenance of a piece."""

FINNER = basic_finner_range_model()

DAMPING = "Cm_q+Cm_alphadot"


def compute(piece: Piece, folder: Path | None, progress: Progress | None = None) -> PieceResult:
    """Compute one piece.

    Raises
    ------
    InputError, DivergenceError
        What flights and fits raise.
    """
    del folder
    if piece.method not in _METHODS:
        raise InputError(f"no piece {piece.name!r} in this study")
    wall, cpu = time.perf_counter(), time.process_time()
    records, told = _METHODS[piece.method](piece, progress or (lambda fraction: None))
    provenance = {
        "command": f"indicial study range --compute {piece.name}",
        "version": version(),
        **told,
        "wall_s": round(time.perf_counter() - wall, 1),
        "cpu_s": round(time.process_time() - cpu, 1),
    }
    return PieceResult(piece, DerivativeTable(tuple(records)), provenance)


def published(mach: float) -> dict[str, tuple[float, float | None]]:
    """Coefficients of a multiple-fit group with the probable error of those that have one in print [per cent]."""
    rows = {r.name: r for r in finner_range("multifit") if abs(r.mach - mach) < 1e-9}
    found: dict[str, tuple[float, float | None]] = {}
    for name in NAMES:
        sigma = rows[name].uncertainty
        error = None if sigma is None else 100.0 * PROBABLE_ERROR * sigma / abs(rows[name].value)
        found[name] = (rows[name].value, error)
    return found


def _model(truth: dict[str, float]) -> DerivativeAerodynamics:
    return DerivativeAerodynamics(
        reference=FINNER.reference,
        CA_0=truth["CA_0"],
        CN_alpha=truth["CN_alpha"],
        Cm_alpha=truth["Cm_alpha"],
        Cm_q=truth["Cm_q+Cm_alphadot"],
        Cl_p=truth["Cl_p"],
    )


def shot(truth: dict[str, float], mach: float, yaw_deg2: float, clock: float, settings: dict[str, Any]) -> Trajectory:
    """A shot down the range with this mean square total yaw [deg^2], first seen at the angle `clock` [rad].

    Its shots begin at an angle of attack that one trial flight of 1 degree tells: the motion is linear.
    """

    def flown(size_deg: float) -> Trajectory:
        size = math.radians(size_deg)
        start = InitialState.from_path(
            FlightCondition(mach).speed,
            alpha=size * math.cos(clock),
            beta=size * math.sin(clock),
            rate=(settings["roll_rate_rad_s"], 0.0, 0.0),
        )
        end = End(x=float(settings["length_m"]))
        return simulate(FINNER, _model(truth), start, 2.0, step=1e-4, end=end, estimate_error=False)

    trial = flown(1.0)
    size = math.sqrt(yaw_deg2 / float(np.mean(np.degrees(trial.total_angle) ** 2)))
    return flown(max(size, 0.05))


def group_flights(
    truth: dict[str, float], shots: Sequence[Sequence[float]], settings: dict[str, Any]
) -> list[Trajectory]:
    """Shots of these Mach numbers and mean square yaws [deg^2], first seen at angles all round."""
    return [shot(truth, mach, yaw, 2.0 * math.pi * i / len(shots), settings) for i, (mach, yaw) in enumerate(shots)]


def damping_error(flights: list[Trajectory], truth: dict[str, float], stations: int, settings: dict[str, Any]) -> float:
    """Probable error of the damping sum [per cent] that the stated precision gives, from records without noise."""
    records = [measure(f, stations, seed=None, precision=precision(settings), roll=True) for f in flights]
    fit = identify(records, FINNER, model=range_model(), noise="stated", threads=1)
    return 100.0 * fit.probable_error(DAMPING) / abs(truth[DAMPING])


def implied_angle(mach: float, settings: dict[str, Any]) -> float:
    """Noise of the angles [deg] with which a group's probable error is the printed one, positions as they are.

    The error does not grow in proportion: what positions tell of the motion does not get worse with the angles.
    """
    told = published(mach)
    truth, printed = {name: value for name, (value, _) in told.items()}, told[DAMPING][1]
    if printed is None:
        raise InputError(f"no probable error of {DAMPING} is printed at M {mach:g}")
    flights = group_flights(truth, groups()[mach], settings)

    def excess(angle: float) -> float:
        return damping_error(flights, truth, settings["stations"], {**settings, "angle_deg": angle}) - printed

    return float(brentq(excess, 0.01, 2.0, xtol=1e-4))


def precision(settings: dict[str, Any]) -> Precision:
    """Of the range."""
    return Precision(
        1e-3 * settings["position_mm"], math.radians(settings["angle_deg"]), math.radians(settings["roll_deg"])
    )


@cache
def range_model() -> RangeModel:
    """Nothing held but what is 0 in the flights."""
    return RangeModel.of(FINNER, None, (*FREE_FLIGHT, "Cl_p"), roll=True)


def _measured(flights: list[Trajectory], piece: Piece, number: int) -> list[RangeRecord]:
    """The group's record of this number, with noise that no other record of any group has."""
    settings, first = piece.settings, 100_000 * round(1000.0 * piece.mach) + 100 * number
    return [
        measure(flight, settings["stations"], seed=first + i, precision=precision(settings), roll=True)
        for i, flight in enumerate(flights)
    ]


def _closing(piece: Piece, progress: Progress) -> Found:
    settings, told = piece.settings, published(piece.mach)
    truth = {name: value for name, (value, _) in told.items()}
    flights = group_flights(truth, settings["shots"], settings)
    columns = reduce_range(_measured(flights, piece, 0), FINNER, model=range_model())
    errors, reported = [], []
    for number in range(settings["records"]):
        fit = identify(_measured(flights, piece, number), FINNER, model=range_model(), threads=1)
        errors.append([fit[name].value - truth[name] for name in NAMES])
        reported.append([fit[name].standard_error for name in NAMES])
        progress((number + 1) / settings["records"])
    best = columns.multiple
    return _records(best, piece.mach), {
        "truth": truth,
        "printed_pe_pct": {name: error for name, (_, error) in told.items() if error is not None},
        "columns": columns.rows(),
        "multiple": {name: [best[name].value, best[name].standard_error] for name in NAMES},
        "errors": np.array(errors).round(9).tolist(),
        "standard_errors": np.array(reported).round(9).tolist(),
    }


def _implied(piece: Piece, progress: Progress) -> Found:
    """Probable error of the damping sum by yaw, stations and noise; noise that each group's printed error implies."""
    settings = piece.settings
    truth = {name: value for name, (value, _) in published(piece.mach).items()}
    rows, done = [], 0
    total = len(settings["yaw_deg"]) * len(settings["count"]) * len(settings["angles_deg"]) + len(groups())
    for yaw in settings["yaw_deg"]:
        flight = shot(truth, piece.mach, yaw**2, 0.0, settings)
        for stations in settings["count"]:
            for angle in settings["angles_deg"]:
                share = damping_error([flight], truth, stations, {**settings, "angle_deg": angle})
                rows.append({"yaw_deg": yaw, "stations": stations, "angle_deg": angle, "pe_pct": share})
                done += 1
                progress(done / total)
    implied = []
    for mach in groups():
        implied.append({"mach": mach, "printed_pe_pct": published(mach)[DAMPING][1]})
        implied[-1]["angle_deg"] = implied_angle(mach, settings)
        done += 1
        progress(done / total)
    flight = shot(truth, piece.mach, 1.0, 0.0, settings)
    record = measure(flight, settings["stations"], seed=None, precision=precision(settings), roll=True)
    fit = identify(record, FINNER, model=range_model(), noise="stated")
    return _records(fit, piece.mach), {"rows": rows, "implied": implied}


def _in_flow(piece: Piece, progress: Progress) -> Found:
    """Identify from the flights that the flow solver flew, exactly seen and with the range's noise."""
    settings = piece.settings
    flights = [_kept_flight(angle) for angle in settings["flights"]]
    known = _cfd()
    model = RangeModel.of(FINNER, _cfd_model(known), FREE_FLIGHT)
    length = min(float(flight.position[-1, 0]) for flight in flights)
    stations = np.linspace(0.0, length, settings["stations"])
    exact = [measure(flight, stations, seed=None, precision=precision(settings)) for flight in flights]
    seen = [measure(flight, stations, seed=1 + i, precision=precision(settings)) for i, flight in enumerate(flights)]
    rows = {}
    for name, records in (
        ("exact, 1 deg", exact[:1]),
        ("exact, 3 deg", exact[1:]),
        ("exact, both", exact),
        ("seen, both", seen),
    ):
        fit = identify(records, FINNER, model=model, noise="stated")
        rows[name] = {e.name: [e.value, e.standard_error] for e in fit.derivatives}
        progress(len(rows) / 4.0)
    fit = identify(seen, FINNER, model=model, noise="stated")
    there = _moved(known, fit.mach)
    verdicts = {
        method: {v.estimate.name: v.verdict for v in fit.against({n: x for n, x in values.items() if n in FREE_FLIGHT})}
        for method, values in there.items()
    }
    return _records(fit, piece.mach), {"rows": rows, "cfd": there, "verdicts": verdicts, "mach": fit.mach}


def _moved(known: dict[str, dict[str, float]], mach: float) -> dict[str, dict[str, float]]:
    """Values at M 2 moved to the flight's mean Mach number, as the operator's change over the Mach number."""
    from scipy.interpolate import PchipInterpolator

    from indicial.studies.finner import STUDY as SWEEP

    swept = Results.kept(SWEEP.name, SWEEP.pieces).select(method="operator", mesh="base", level="quick")
    growth: dict[str, float] = {}
    for name in ("CN_alpha", "Cm_alpha", "Cm_q", "Cm_alphadot"):
        machs, values = swept.series(name, k=None)
        curve = PchipInterpolator(machs, values)
        growth[name] = float(curve(mach) / curve(2.0))
    growth["Cm_q+Cm_alphadot"] = growth["Cm_q"]  # the lag's part is a twentieth, and changes alike
    return {
        method: {name: value * growth.get(name, 1.0) for name, value in values.items()}
        for method, values in known.items()
    }


def _kept_flight(angle: float) -> Trajectory:
    from indicial.studies.freeflight import STUDY

    kept = Results.kept(STUDY.name, STUDY.pieces).select(method=f"shot_{angle:g}deg").at(2.0)
    if kept is None:
        raise InputError(f"the flight in the flow from {angle:g} deg is not kept: compute `indicial study freeflight`")
    return Trajectory.load(kept.file("flow"))


def _cfd() -> dict[str, dict[str, float]]:
    """What the same flow gave at M 2 on the same mesh, by method: derivatives and the damping sum."""
    from indicial.studies.finner import STUDY as SWEEP
    from indicial.studies.freeflight import STUDY as FLIGHTS

    kept = Results.kept(SWEEP.name, SWEEP.pieces)
    flown = Results.kept(FLIGHTS.name, FLIGHTS.pieces).select(method="shot_1deg").at(2.0)
    frame, steps, swung = (
        kept.select(method=method, mesh="base", level="quick").at(2.0) for method in ("mrf", "irm", "fom_pitch")
    )
    if flown is None or frame is None or steps is None or swung is None:
        raise InputError("the studies finner and freeflight are not all kept: compute them first")
    linear = {r.name: r.value for r in flown.derivatives}
    of_frame = {r.name: r.value for r in frame.derivatives}
    of_steps = {r.name: r.value for r in steps.derivatives}
    damping, lag = DAMPING, of_steps["Cm_alphadot"]
    pitching = swung.derivatives.select(name=damping, reduction="fourier").records
    return {
        "operator": {**linear, damping: linear["Cm_q"] + linear["Cm_alphadot"]},
        "MRF, alphadot by IRM": {
            "CN_alpha": of_frame["CN_alpha"],
            "Cm_alpha": of_frame["Cm_alpha"],
            damping: of_frame["Cm_q"] + lag,
        },
        "IRM": {
            "CN_alpha": of_steps["CN_alpha"],
            "Cm_alpha": of_steps["Cm_alpha"],
            damping: of_steps["Cm_q"] + lag,
        },
        "FOM, k = 0.1": {damping: pitching[0].value} if pitching else {},
    }


def _cfd_model(known: dict[str, dict[str, float]]) -> DerivativeAerodynamics:
    """What is held: the lesser derivatives of the same flow."""
    values = {n: v for n, v in known["operator"].items() if "+" not in n}
    return DerivativeAerodynamics(reference=FINNER.reference, **values)  # type: ignore[arg-type]


def _records(fit: RangeFit, mach: float) -> list[Derivative]:
    return list(fit.table(FlightCondition(mach), "indicial study range"))


_METHODS: dict[str, Callable[[Piece, Progress], Found]] = {
    "closing": _closing,
    "implied": _implied,
    "in_flow": _in_flow,
}
