"""How the pieces are computed."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from indicial.cfd.lattice import ExtrapolationWarning, SectionLatticeSolver
from indicial.derivatives import Derivative
from indicial.derivatives import DerivativeTable as Table
from indicial.errors import InputError
from indicial.history import History
from indicial.methods import forced_oscillation, moving_frame
from indicial.methods.forced_oscillation import OscillationReading
from indicial.motion import FlightCondition, Rates
from indicial.studies.bocian.glider import dimensions, flight, solver
from indicial.studies.bocian.rocking import release
from indicial.studies.piece import Piece, PieceResult, file_path, version
from indicial.studies.study import Progress

Found = tuple[list[Derivative], dict[str, Any], dict[str, Path]]
"""Derivatives, provenance and files of a piece."""


def compute(piece: Piece, folder: Path | None, progress: Progress | None = None) -> PieceResult:
    """Compute one piece.

    Raises
    ------
    InputError, DivergenceError
        What solver and methods raise.
    """
    if piece.method not in _METHODS:
        raise InputError(f"no piece {piece.name!r} in this study")
    wall, cpu = time.perf_counter(), time.process_time()
    with warnings.catch_warnings():
        # every row says how many strips were beyond their polars
        warnings.simplefilter("ignore", ExtrapolationWarning)
        records, told, files = _METHODS[piece.method](piece, folder, progress or (lambda fraction: None))
    provenance = {
        "command": f"indicial study bocian --compute {piece.name}",
        "version": version(),
        **told,
        "wall_s": round(time.perf_counter() - wall, 1),
        "cpu_s": round(time.process_time() - cpu, 1),
    }
    return PieceResult(piece, Table(tuple(records)), provenance, files)


def frame_row(one: SectionLatticeSolver, alpha_deg: float, rate: float) -> tuple[Derivative, dict[str, Any]]:
    """Cl_p by the moving frame at one incidence, one-sided, and what the flow is like."""
    condition = flight(alpha_deg)
    still, turning = (one.steady(condition, Rates(p=p)) for p in (0.0, rate))
    reduced = rate * float(one.reference.rate_scale(condition.speed)[0])
    value = (turning["Cl"] - still["Cl"]) / reduced
    state = one.steady_states(condition)[0]
    wing = np.array([name == "wing" for name in one.lattice.strips.surface])
    share = one.lattice.strips.area[wing]
    row = {
        "alpha_deg": alpha_deg,
        "one_sided": value,
        "CN": still["CN"],
        "CA": still["CA"],
        "attached": float(np.sum(share * state.point[wing]) / np.sum(share)),
        "states": int(still.convergence["states"]),
        "states_turning": int(turning.convergence["states"]),
        "largest_Cl": float(still.convergence["largest_Cl"]),
        "least_Cl": float(still.convergence["least_Cl"]),
        "growth": float(still.convergence["growth"]),
        "extrapolated": int(turning.convergence["extrapolated"]),
    }
    return _record(one, condition, "mrf", value), row


def force(
    one: SectionLatticeSolver, alpha_deg: float, forced: dict[str, Any]
) -> tuple[History, dict[str, OscillationReading]]:
    """One forced roll and its three readings over all its periods."""
    history = forced_oscillation.run(
        one,
        flight(alpha_deg),
        math.radians(forced["amplitude_deg"]),
        forced["k"],
        "roll",
        periods=forced["periods"],
        steps_per_period=forced["steps_per_period"],
        compensation=forced["compensation"],
    )
    reductions = (forced_oscillation.phase_angle, forced_oscillation.regression, forced_oscillation.fourier)
    readings = [reduce(history, forced["periods"]) for reduce in reductions]
    return history, {reading.reduction: reading for reading in readings}


def _frame(piece: Piece, folder: Path | None, progress: Progress) -> Found:
    one, pairs = solver(piece.settings), []
    for n, alpha in enumerate(piece.settings["alpha_deg"]):
        record, row = frame_row(one, alpha, piece.settings["rate"])
        if piece.settings.get("central"):
            sizes = {"p": piece.settings["rate"] * float(one.reference.rate_scale(flight(alpha).speed)[0])}
            row["central"] = moving_frame.run(one, flight(alpha), ("p",), amplitudes=sizes, second=None)["Cl_p"]
        pairs.append((record, row))
        progress((n + 1) / len(piece.settings["alpha_deg"]))
    return [record for record, _ in pairs], {"panels": one.lattice.n_panels, "rows": [row for _, row in pairs]}, {}


def _forced(piece: Piece, folder: Path | None, progress: Progress) -> Found:
    one, records, rows = solver(piece.settings), [], []
    for n, alpha in enumerate(piece.settings["alpha_deg"]):
        history, readings = force(one, alpha, piece.settings["forced"])
        found, row = _forced_row(one, history, readings)
        records += found
        rows.append({"alpha_deg": alpha, **row})
        progress((n + 1) / len(piece.settings["alpha_deg"]))
    return records, {"panels": one.lattice.n_panels, "rows": rows}, {}


def _frequency(piece: Piece, folder: Path | None, progress: Progress) -> Found:
    one, records, rows = solver(piece.settings), [], []
    for n, k in enumerate(piece.settings["k"]):
        history, readings = force(one, piece.settings["alpha_deg"], {**piece.settings["forced"], "k": k})
        found, row = _forced_row(one, history, readings)
        records += found
        rows.append({"k": k, **row})
        progress((n + 1) / len(piece.settings["k"]))
    response = one.attached.frequency_response(flight(piece.settings["alpha_deg"]), piece.settings["k"], ("p",))
    linear = [float(value.real) for value in response.channel("Cl", "p")]
    told = {"panels": one.lattice.n_panels, "rows": rows, "linear": linear}
    return records, {**told, "linear_at_zero": float(response.at_zero("Cl", "p")[0])}, {}


def _variants(piece: Piece, folder: Path | None, progress: Progress) -> Found:
    settings = piece.settings
    alpha, rows = settings["alpha_deg"], {}
    listed = {"base": {}, **settings["variants"]}
    for n, (name, change) in enumerate(listed.items()):
        one = solver({**settings, **change})
        _, readings = force(one, alpha, settings["forced"])
        _, row = frame_row(one, alpha, settings["rate"])
        rows[name] = {"fom": readings["fourier"].value("Cl"), "mrf": row["one_sided"]}
        progress((n + 1) / len(listed))
    base = _record(solver(settings), flight(alpha), "mrf", rows["base"]["mrf"])
    return [base], {"rows": rows}, {}


def _loops(piece: Piece, folder: Path | None, progress: Progress) -> Found:
    if folder is None:
        raise InputError(f"{piece.name} keeps files: it needs a folder for them")
    one, records, flows, files = solver(piece.settings), [], {}, {}
    wing = np.array([name == "wing" for name in one.lattice.strips.surface])
    across = one.lattice.strips.quarter_chord[wing, 1]
    for n, alpha in enumerate(piece.settings["alpha_deg"]):
        history, readings = force(one, alpha, piece.settings["forced"])
        records += _forced_row(one, history, readings)[0]
        label = f"alpha_{alpha:g}"
        files[label] = file_path(piece, folder, f"{label}.nc")
        history.to_netcdf(files[label])
        state = one.steady_states(flight(alpha))[0]
        turning = one.steady_states(flight(alpha), Rates(p=0.2))[0]
        flows[label] = {
            "still": [round(float(x), 6) for x in state.point[wing]],
            "turning": [round(float(x), 6) for x in turning.point[wing]],
        }
        progress((n + 1) / len(piece.settings["alpha_deg"]))
    told = {"panels": one.lattice.n_panels, "y_m": [round(float(y), 4) for y in across], "separation": flows}
    return records, told, files


def _freedom(piece: Piece, folder: Path | None, progress: Progress) -> Found:
    settings = piece.settings
    listed = {"base": {}, **settings["cases"]}
    rows: dict[str, list[dict[str, float]]] = {}
    records = []
    for n, (name, change) in enumerate(listed.items()):
        one = solver({**settings, **({"lag": change["lag"]} if "lag" in change else {})})
        rows[name] = []
        for alpha in settings["alpha_deg"]:
            history, readings = force(one, alpha, {**settings["forced"], **change})
            rows[name].append({reduction: reading.value("Cl") for reduction, reading in readings.items()})
            if name == "base":
                records += _forced_row(one, history, readings)[0]
        progress((n + 1) / len(listed))
    return records, {"rows": rows}, {}


def _rates(piece: Piece, folder: Path | None, progress: Progress) -> Found:
    """The moving frame in stall at several rates and with several numbers of panels across half a wing."""
    settings, listed, records = piece.settings, [], []
    for n, across in enumerate(settings["across"]):
        one = solver({**settings, "panels": [settings["panels"][0], across]})
        for alpha in settings["alpha_deg"]:
            for rate in settings["rates"]:
                record, row = frame_row(one, alpha, rate)
                records.append(record)
                listed.append({"across": across, "rate": rate, **row})
        progress((n + 1) / len(settings["across"]))
    return records, {"rows": listed}, {}


def _cells(piece: Piece, folder: Path | None, progress: Progress) -> Found:
    """Both methods in stall, or MRF alone, with several numbers of strips and spreads of separation across them."""
    settings, listed, records = piece.settings, [], []
    cases = [(spread, across) for spread in settings["spreads"] for across in settings["across"]]
    for n, (spread, across) in enumerate(cases):
        one = solver({**settings, "panels": [settings["panels"][0], across], "spread": spread})
        for alpha in settings["alpha_deg"]:
            record, row = frame_row(one, alpha, settings["rate"])
            records.append(record)
            if "forced" in settings:
                history, readings = force(one, alpha, settings["forced"])
                found, swung = _forced_row(one, history, readings)
                records += found
                row = {**row, **swung}
            listed.append({"spread": spread, "across": across, **row})
        progress((n + 1) / len(cases))
    return records, {"rows": listed}, {}


def _shortfall(piece: Piece, folder: Path | None, progress: Progress) -> Found:
    """Forced roll in attached flow with sections and resolution changed one by one."""
    settings, rows, records = piece.settings, {}, []
    listed = {"base": {}, **settings["cases"]}
    for n, (name, change) in enumerate(listed.items()):
        forced = {**settings["forced"], **change.get("forced", {})}
        one = solver({**settings, **change})
        history, readings = force(one, settings["alpha_deg"], forced)
        rows[name] = readings["fourier"].value("Cl")
        if name == "base":
            records += _forced_row(one, history, readings)[0]
        progress((n + 1) / len(listed))
    return records, {"rows": rows}, {}


def _rocking(piece: Piece, folder: Path | None, progress: Progress) -> Found:
    settings = piece.settings
    one, inertia = solver(settings), dimensions()["roll_inertia"]
    records, rows = [], []
    for n, alpha in enumerate(settings["alpha_deg"]):
        condition = flight(alpha)
        found = release(one, condition, inertia, settings["first"], settings["end"], settings["step"])
        length = float(one.reference.moment_lengths[0])
        unit = condition.dynamic_pressure * one.reference.area * length / inertia
        unit *= float(one.reference.rate_scale(condition.speed)[0])
        records.append(_record(one, condition, "identified", found.growth / unit))
        rows.append(
            {
                "alpha_deg": alpha,
                "growth": found.growth,
                "autorotates": found.autorotates,
                "time_s": [round(float(t), 3) for t in found.time[::10]],
                "p": [round(float(p), 6) for p in found.rate[::10]],
            }
        )
        progress((n + 1) / len(settings["alpha_deg"]))
    return records, {"inertia": inertia, "rows": rows}, {}


def _forced_row(
    one: SectionLatticeSolver, history: History, readings: dict[str, OscillationReading]
) -> tuple[list[Derivative], dict[str, Any]]:
    records = [
        _record(
            one,
            history.condition,
            "fom",
            reading.value("Cl"),
            k=reading.k,
            amplitude=reading.amplitude,
            reduction=reading.reduction,
        )
        for reading in readings.values()
    ]
    fourier = readings["fourier"]
    row = {
        **{name: reading.value("Cl") for name, reading in readings.items()},
        "in_phase": fourier.value("Cl", "in_phase"),
        "periodicity": None if fourier.periodicity is None else float(fourier.periodicity[3]),
        "extrapolated": int(history.provenance["extrapolated"]),
    }
    return records, row


def _record(
    one: SectionLatticeSolver, condition: FlightCondition, method: str, value: float, **more: Any
) -> Derivative:
    return Derivative.at(condition, one.reference, "Cl_p", method, value, "indicial study bocian", **more)


_METHODS: dict[str, Callable[[Piece, Path | None, Progress], Found]] = {
    "frame": _frame,
    "forced": _forced,
    "frequency": _frequency,
    "variants": _variants,
    "loops": _loops,
    "freedom": _freedom,
    "rates": _rates,
    "cells": _cells,
    "shortfall": _shortfall,
    "rocking": _rocking,
}
