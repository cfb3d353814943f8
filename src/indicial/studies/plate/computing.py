"""How the pieces are computed: data, motions that no model sees, every realisation."""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from indicial.conventions import ReferenceQuantities, time_from_reduced
from indicial.errors import InputError
from indicial.frequency import FrequencyResponse
from indicial.history import History
from indicial.methods import forced_oscillation, indicial_response, operator
from indicial.motion import AlphaStep, FlightCondition, Multisine, PitchOscillation, PitchRateStep, TabulatedMotion
from indicial.rom import (
    Comparison,
    PredictionCheck,
    StateSpaceModel,
    StepResponses,
    check_prediction,
    compare,
    realise,
    truncate,
)
from indicial.solver import Solver
from indicial.studies.finner.meshes import RELAY, finner_solver
from indicial.studies.piece import Piece, PieceResult, file_path, version
from indicial.studies.plate.exact import SupersonicPlate
from indicial.studies.study import Progress

RECOMMENDED = "modal"
"""The realisation whose derivatives are tabled."""

SMALL = "six states within the band"
"""Of the Finner: from its frequency response, cut to as few states as are asked for."""


def compute(piece: Piece, folder: Path | None, progress: Progress | None = None) -> PieceResult:
    """Compute one piece.

    Raises
    ------
    InputError, DivergenceError
        What solvers and realisations raise.
    """
    if piece.method != "realise" or piece.mesh not in ("plate", "finner"):
        raise InputError(f"no piece {piece.name!r} in this study")
    wall, cpu = time.perf_counter(), time.process_time()
    files: dict[str, Path] = {}
    if piece.mesh == "plate":
        data, unseen = plate_data(piece.mach, piece.settings)
        comparison = compare(data, list(unseen.values()))
        found = _rows(comparison, unseen)
    else:
        if folder is None:
            raise InputError(f"{piece.name} keeps files: it needs a folder for them")
        histories, response = _finner_data(piece, folder, progress)
        files = _write({**histories, "operator": response}, piece, folder)
        data, unseen = finner_steps(histories), finner_unseen(histories)
        k_max = float(piece.settings["k_max"])
        comparison = compare(data, list(unseen.values()), response=response, k_max=k_max)
        small = finner_model(response, piece.settings)
        checks = {label: check_prediction(small, history) for label, history in unseen.items()}
        found = {**_rows(comparison, unseen), SMALL: _row(small, None, checks)}
    provenance = {
        "command": f"indicial study plate --compute {piece.name}",
        "version": version(),
        "realisations": found,
        "refused": comparison.refused,
        "wall_s": round(time.perf_counter() - wall, 1),
        "cpu_s": round(time.process_time() - cpu, 1),
    }
    return PieceResult(piece, comparison[RECOMMENDED].model.derivatives(), provenance, files)


def _rows(comparison: Comparison, unseen: Mapping[str, History]) -> dict[str, Any]:
    return {
        row.method: _row(row.model, row.residual, dict(zip(unseen, row.checks, strict=True))) for row in comparison.rows
    }


def _row(model: StateSpaceModel, residual: float | None, checks: Mapping[str, PredictionCheck]) -> dict[str, Any]:
    """What is kept of a realisation: plain values."""
    return {
        "order": model.order,
        "residual": residual,
        "unseen": {label: round(check.worst_peak, 8) for label, check in checks.items()},
        "poles": [[round(float(p.real), 6), round(float(p.imag), 6)] for p in model.poles],
    }


def plate_solver(settings: Mapping[str, Any]) -> SupersonicPlate:
    """A plate of unit chord behind its moment reference point."""
    return SupersonicPlate(ReferenceQuantities(1.0, 1.0, (0.5 - float(settings["arm"]), 0.0, 0.0)))


def plate_data(mach: float, settings: Mapping[str, Any]) -> tuple[StepResponses, dict[str, History]]:
    """Step responses of the exact plate, and motions that no model sees."""
    solver, condition = plate_solver(settings), FlightCondition(mach)
    settled = 2.0 * mach / (mach - 1.0)
    times = _times(np.linspace(0.0, 2.0 * settled, int(settings["samples"])), condition, solver)
    rate = 0.01 * 2.0 * condition.speed / solver.reference.length
    steps = [AlphaStep(condition, 0.01), PitchRateStep(condition, rate)]
    data = StepResponses.from_histories([solver.unsteady(condition, step, times) for step in steps])
    unseen = {}
    for k in settings["k"]:
        motion = PitchOscillation.from_reduced_frequency(condition, solver.reference, 0.01, float(k))
        unseen[f"k = {k:g}"] = solver.unsteady(condition, motion, np.linspace(0.0, 2.0 * motion.period, 200))
    unseen["multisine"] = _multisine(solver, condition, settings["multisine"])
    unseen["pulse"] = _pulse(solver, condition, settings["pulse"], 2.0 * settled)
    return data, unseen


def _pulse(solver: Solver, condition: FlightCondition, settings: Mapping[str, Any], end: float) -> History:
    """A triangle in alpha, and rest until `end`."""
    width, count = float(settings["width"]), int(settings["samples"])
    s = np.concatenate([np.linspace(0.0, width, 2 * count + 1), np.linspace(width, end, 200)[1:]])
    alpha = condition.alpha + float(settings["alpha"]) * np.maximum(1.0 - np.abs(2.0 * s / width - 1.0), 0.0)
    velocity = condition.speed * np.stack([np.cos(alpha), np.zeros(s.size), np.sin(alpha)], axis=1)
    times = _times(s, condition, solver)
    return solver.unsteady(condition, TabulatedMotion(times, velocity, np.zeros((s.size, 3))), times)


def _multisine(solver: Solver, condition: FlightCondition, settings: Mapping[str, Any]) -> History:
    """Loads over one period of the slowest sine."""
    k = float(settings["lowest"]) * np.arange(1, int(settings["lines"]) + 1)
    motion = Multisine.from_reduced_frequencies(condition, solver.reference, k, settings["alpha"], settings["q"])
    s = np.arange(0.0, 2.0 * math.pi / float(k[0]), float(settings["step"]))
    return solver.unsteady(condition, motion, _times(s, condition, solver))


def _times(s: Any, condition: FlightCondition, solver: Solver) -> Any:
    return time_from_reduced(s, condition.speed, solver.reference.length)


def _finner_data(piece: Piece, folder: Path, progress: Progress | None) -> tuple[dict[str, History], FrequencyResponse]:
    """Oscillations, a multisine and steps of the Finner, and its operator's frequency response."""
    settings = piece.settings
    solver = finner_solver("base", piece.level, piece.mach, float(settings["moment_reference"]), folder)
    condition = FlightCondition(piece.mach)
    RELAY.listener = progress
    try:
        band = settings["operator"]
        k = np.geomspace(band["lowest"], band["highest"], band["count"])
        response = operator.run(solver, condition, k, ("alpha", "q"))
        histories = {}
        forced = settings["oscillation"]
        for one in settings["k"]:
            histories[f"k_{one:g}"] = forced_oscillation.run(
                solver, condition, math.radians(forced["amplitude_deg"]), one, "pitch",
                periods=forced["periods"], steps_per_period=forced["steps_per_period"],
            )  # fmt: skip
        histories["multisine"] = _multisine(solver, condition, settings["multisine"])
        given = settings["steps"]
        s = indicial_response.step_times(given["first"], given["growth"], given["largest"], given["end"])
        sizes: dict[indicial_response.StepKind, float] = {"alpha": math.radians(given["alpha_deg"]), "q": given["q"]}
        for kind, amplitude in sizes.items():
            histories[f"step_{kind}"] = indicial_response.run(solver, condition, amplitude, s, kind)
    finally:
        RELAY.listener = None
    return histories, response


def _write(parts: Mapping[str, History | FrequencyResponse], piece: Piece, folder: Path) -> dict[str, Path]:
    paths = {label: file_path(piece, folder, f"{label}.nc") for label in parts}
    for label, part in parts.items():
        part.to_netcdf(paths[label])
    return paths


def finner_steps(histories: Mapping[str, History]) -> StepResponses:
    """The Finner's step responses."""
    return StepResponses.from_histories([histories["step_alpha"], histories["step_q"]])


def finner_unseen(histories: Mapping[str, History]) -> dict[str, History]:
    """The Finner's motions that no model sees."""
    return {
        label.replace("k_", "k = "): history for label, history in histories.items() if not label.startswith("step")
    }


def finner_model(response: FrequencyResponse, settings: Mapping[str, Any]) -> StateSpaceModel:
    """The Finner's model of few states, from its operator's frequency response alone."""
    full = realise(response, "modal")
    return truncate(full, int(settings["states"]), k_max=float(settings["k_max"])).model


def finner_files(result: PieceResult) -> tuple[dict[str, History], FrequencyResponse]:
    """The Finner's histories and frequency response from the files of a result."""
    histories = {label: History.from_netcdf(result.file(label)) for label in result.files if label != "operator"}
    return histories, FrequencyResponse.from_netcdf(result.file("operator"))
