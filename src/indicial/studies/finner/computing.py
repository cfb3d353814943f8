"""How each method's pieces are computed."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from indicial.cfd import FiniteVolumeSolver
from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError
from indicial.methods import forced_oscillation, indicial_response, moving_frame, operator
from indicial.motion import FlightCondition
from indicial.studies.finner.meshes import NAMES, RELAY, finner_solver
from indicial.studies.piece import Piece, PieceResult, version
from indicial.studies.study import Progress

LONGITUDINAL = ("CN_alpha", "CN_q", "CN_alphadot", "Cm_alpha", "Cm_q", "Cm_alphadot")

Found = tuple[DerivativeTable, dict[str, Any]]


def compute(piece: Piece, folder: Path | None, progress: Progress | None = None) -> PieceResult:
    """Compute one piece; steady states and the checkpoints of marches are kept under `folder`.

    Raises
    ------
    InputError, DivergenceError
        What the solver raises.
    """
    method = next((name for name in _METHODS if piece.method.startswith(name)), None)
    if method is None:
        raise InputError(f"no method {piece.method!r} in this study; there are {', '.join(_METHODS)}")
    wall, cpu = time.perf_counter(), time.process_time()
    about = float(piece.settings["moment_reference"])
    solver = finner_solver(piece.mesh, piece.level, piece.mach, about, folder)
    condition = FlightCondition(piece.mach)
    RELAY.listener = progress
    try:
        base = solver.steady(condition)
        table, work = _METHODS[method](solver, condition, piece.settings)
    finally:
        RELAY.listener = None
    provenance = {
        "command": f"indicial study finner --compute {piece.name}",
        "version": version(),
        "mesh": NAMES[piece.mesh],
        "cells": solver.grid.n_cells,
        "steady": base.convergence,
        **work,
        "wall_s": round(time.perf_counter() - wall, 1),
        "cpu_s": round(time.process_time() - cpu, 1),
    }
    axial = Derivative.at(condition, solver.reference, "CA_0", table.records[0].method, base["CA"], "steady state")
    return PieceResult(piece, DerivativeTable((*table, axial)), provenance)


def _operator(solver: FiniteVolumeSolver, condition: FlightCondition, settings: dict[str, Any]) -> Found:
    response = operator.run(solver, condition, settings["k"], ("alpha", "q", "p"))
    kept = DerivativeTable(tuple(r for r in operator.derivatives(response) if r.name in (*LONGITUDINAL, "Cl_p")))
    return kept, {"operator": {name: response.provenance[name] for name in ("tolerance", "solves", "products")}}


def _moving_frame(solver: FiniteVolumeSolver, condition: FlightCondition, settings: dict[str, Any]) -> Found:
    result = moving_frame.run(solver, condition, ("alpha", "q"))
    kept = DerivativeTable(tuple(r for r in result.derivatives() if r.name in LONGITUDINAL))
    return kept, {"states": {label: dict(how) for label, how in result.convergence.items()}}


def _forced_oscillation(solver: FiniteVolumeSolver, condition: FlightCondition, settings: dict[str, Any]) -> Found:
    history = forced_oscillation.run(
        solver,
        condition,
        math.radians(settings["amplitude_deg"]),
        settings["k"],
        settings["motion"],
        periods=settings["periods"],
        steps_per_period=settings["steps_per_period"],
    )
    reading = forced_oscillation.fourier(history)
    assert reading.periodicity is not None
    return reading.derivatives(), {"march": history.provenance, "periodicity": float(reading.periodicity.max())}


def _indicial_response(solver: FiniteVolumeSolver, condition: FlightCondition, settings: dict[str, Any]) -> Found:
    s = indicial_response.step_times(settings["first"], settings["growth"], settings["largest"], settings["end"])
    sizes: dict[indicial_response.StepKind, float] = {"alpha": math.radians(settings["alpha_deg"]), "q": settings["q"]}
    responses, marches = {}, {}
    for kind, amplitude in sizes.items():
        history = indicial_response.run(solver, condition, amplitude, s, kind)
        step = indicial_response.experiment(condition, solver.reference, amplitude, kind)
        responses[kind] = indicial_response.read(history, solver.steady(*indicial_response.after(step)))
        marches[kind] = history.provenance
    result = indicial_response.derive(responses["alpha"], responses["q"])
    return result.derivatives(), {"marches": marches, "refused": result.refused}


_METHODS: dict[str, Callable[[FiniteVolumeSolver, FlightCondition, dict[str, Any]], Found]] = {
    "operator": _operator,
    "mrf": _moving_frame,
    "fom": _forced_oscillation,
    "irm": _indicial_response,
}
