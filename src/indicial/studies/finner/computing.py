"""How each method's pieces are computed."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from indicial.cfd import FiniteVolumeSolver, FlowSettings
from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError
from indicial.methods import forced_oscillation, indicial_response, moving_frame, operator, reduced_frequency
from indicial.motion import FlightCondition, Rates
from indicial.studies.finner.across_fins import AcrossFins
from indicial.studies.finner.by_part import derivatives_by_part
from indicial.studies.finner.meshes import NAMES, RELAY, finner_solver
from indicial.studies.finner.pitching_flow import PitchingFlow
from indicial.studies.finner.variants import FINNER
from indicial.studies.piece import Piece, PieceResult, file_path, version
from indicial.studies.study import Progress

LONGITUDINAL = ("CN_alpha", "CN_q", "CN_alphadot", "Cm_alpha", "Cm_q", "Cm_alphadot")

Writer = Callable[[Path], None]


@dataclass(frozen=True)
class Found:
    """What a method gives.

    Parameters
    ----------
    table : DerivativeTable
    work : dict
        Products, residuals, steps: part of the provenance.
    files : mapping
        What writes each file that may be kept beside the numbers, by its label and suffix, such as ``"alpha.nc"``.
    """

    table: DerivativeTable
    work: dict[str, Any]
    files: Mapping[str, Writer] = field(default_factory=dict)

    def write(self, piece: Piece, folder: Path) -> dict[str, Path]:
        """Write the files into a work folder; their paths by label."""
        paths = {}
        for name, write in self.files.items():
            paths[Path(name).stem] = file_path(piece, folder, name)
            write(paths[Path(name).stem])
        return paths


def compute(piece: Piece, folder: Path | None, progress: Progress | None = None) -> PieceResult:
    """Compute one piece; steady states and the checkpoints of marches are kept under `folder`.

    Pieces that are computed to be drawn write their histories or flows there too.

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
    usual = FlowSettings()
    flow = replace(usual, steady_tolerance=piece.settings.get("steady_tolerance", usual.steady_tolerance))
    solver = finner_solver(piece.mesh, piece.level, piece.mach, about, folder, flow)
    condition = FlightCondition(piece.mach)
    RELAY.listener = progress
    try:
        base = solver.steady(condition)
        found = _METHODS[method](solver, condition, piece.settings)
    finally:
        RELAY.listener = None
    provenance = {
        "command": f"indicial study finner --compute {piece.name}",
        "version": version(),
        "mesh": NAMES[piece.mesh],
        "cells": solver.grid.n_cells,
        "steady": base.convergence,
        **found.work,
        "wall_s": round(time.perf_counter() - wall, 1),
        "cpu_s": round(time.process_time() - cpu, 1),
    }
    how = found.table.records[0].method
    axial = Derivative.at(condition, solver.reference, "CA_0", how, base["CA"], "steady state")
    if method in _DRAWN and folder is None:
        raise InputError(f"{piece.name} keeps files: it needs a folder for them")
    files = found.write(piece, folder) if method in _DRAWN and folder is not None else {}
    return PieceResult(piece, DerivativeTable((*found.table, axial)), provenance, files)


def _operator(solver: FiniteVolumeSolver, condition: FlightCondition, settings: dict[str, Any]) -> Found:
    """About the angle of attack among the settings, if there is one."""
    there = replace(condition, alpha=math.radians(settings.get("alpha_deg", 0.0)))
    response = operator.run(solver, there, settings["k"], ("alpha", "q", "p"))
    kept = DerivativeTable(tuple(r for r in operator.derivatives(response) if r.name in (*LONGITUDINAL, "Cl_p")))
    return Found(kept, {"operator": {name: response.provenance[name] for name in ("tolerance", "solves", "products")}})


def _parts(solver: FiniteVolumeSolver, condition: FlightCondition, settings: dict[str, Any]) -> Found:
    """The operator at k = 0, part by part."""
    parts = derivatives_by_part(solver, condition, FINNER)
    records = tuple(
        Derivative.at(condition, solver.reference, name, "operator", sum(p[name] for p in parts.values()), "by parts")
        for name in LONGITUDINAL
    )
    return Found(DerivativeTable(records), {"parts": parts})


def _across_fins(solver: FiniteVolumeSolver, condition: FlightCondition, settings: dict[str, Any]) -> Found:
    """The flow between the fins, to be drawn."""
    loads = solver.steady(condition)
    records = tuple(
        Derivative.at(condition, solver.reference, f"{name}_0", "operator", loads[name], "steady state")
        for name in ("CN", "Cm")
    )
    return Found(DerivativeTable(records), {}, {"surface.npz": AcrossFins.of(solver, condition).save})


def _moving_frame(solver: FiniteVolumeSolver, condition: FlightCondition, settings: dict[str, Any]) -> Found:
    sizes = {**moving_frame.AMPLITUDES, "q": settings.get("pitch_rate", moving_frame.AMPLITUDES["q"])}
    result = moving_frame.run(solver, condition, ("alpha", "q"), amplitudes=sizes)
    kept = DerivativeTable(tuple(r for r in result.derivatives() if r.name in LONGITUDINAL))
    return Found(kept, {"states": {label: dict(how) for label, how in result.convergence.items()}})


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
    work = {"march": history.provenance, "periodicity": float(reading.periodicity.max())}
    return Found(reading.derivatives(), work, {"loop.nc": history.to_netcdf})


def _periodic(solver: FiniteVolumeSolver, condition: FlightCondition, settings: dict[str, Any]) -> Found:
    """A pitch oscillation of finite amplitude as a truncated Fourier series."""
    amplitude = math.radians(settings["amplitude_deg"])
    loads = reduced_frequency.run(solver, condition, amplitude, settings["k"], harmonics=settings["harmonics"])
    return Found(loads.derivatives(), {"periodic": loads.provenance, "distortion": loads.distortion("Cm")})


def _indicial_response(solver: FiniteVolumeSolver, condition: FlightCondition, settings: dict[str, Any]) -> Found:
    s = indicial_response.step_times(settings["first"], settings["growth"], settings["largest"], settings["end"])
    sizes: dict[indicial_response.StepKind, float] = {"alpha": math.radians(settings["alpha_deg"]), "q": settings["q"]}
    responses, marches = {}, {}
    files: dict[str, Writer] = {}
    for kind, amplitude in sizes.items():
        history = indicial_response.run(solver, condition, amplitude, s, kind)
        step = indicial_response.experiment(condition, solver.reference, amplitude, kind)
        responses[kind] = indicial_response.read(history, solver.steady(*indicial_response.after(step)))
        marches[kind] = history.provenance
        files[f"{kind}.nc"] = history.to_netcdf
    result = indicial_response.derive(responses["alpha"], responses["q"])
    return Found(result.derivatives(), {"marches": marches, "refused": result.refused}, files)


def _pitching_flow(solver: FiniteVolumeSolver, condition: FlightCondition, settings: dict[str, Any]) -> Found:
    """Loads and flow in a steady pitch rate."""
    there = replace(condition, alpha=math.radians(settings["alpha_deg"]))
    rates = Rates(q=settings["q"] / float(solver.reference.rate_scale(condition.speed)[1]))
    loads = solver.steady(there, rates)
    records = tuple(
        Derivative.at(there, solver.reference, f"{name}_0", "mrf", loads[name], "steady pitch") for name in ("CN", "Cm")
    )
    flow = PitchingFlow.of(solver.field(there, rates), solver.reference.length, settings["q"])
    return Found(DerivativeTable(records), {"pitching": loads.convergence}, {"flow.npz": flow.save})


_METHODS: dict[str, Callable[[FiniteVolumeSolver, FlightCondition, dict[str, Any]], Found]] = {
    "operator": _operator,
    "parts": _parts,
    "across_fins": _across_fins,
    "mrf": _moving_frame,
    "fom": _forced_oscillation,
    "periodic": _periodic,
    "irm": _indicial_response,
    "field": _pitching_flow,
    "loop": _forced_oscillation,
    "steps": _indicial_response,
    "time_step": _forced_oscillation,
}

_DRAWN = ("across_fins", "field", "loop", "steps")
"""Methods whose files are kept."""
