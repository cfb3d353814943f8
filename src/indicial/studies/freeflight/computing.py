"""How a shot is flown three ways from one flow solver."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import block_diag

from indicial.cfd import FiniteVolumeSolver
from indicial.conventions import Array
from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError
from indicial.flightsim import (
    MACH,
    ConstantAtmosphere,
    DerivativeAerodynamics,
    End,
    InitialState,
    ScheduledStateSpaceAerodynamics,
    Trajectory,
    basic_finner_range_model,
    build_dynamics,
    compare,
    fly,
    fly_in_flow,
    table,
)
from indicial.methods import operator
from indicial.motion import FlightCondition
from indicial.reference_data import FINNER_MOMENT_REFERENCE
from indicial.rom import project
from indicial.studies.finner.meshes import RELAY, finner_solver
from indicial.studies.freeflight.pieces import FLIGHTS
from indicial.studies.piece import Piece, PieceResult, file_path, version
from indicial.studies.study import Progress

AIR = ConstantAtmosphere()
LONGITUDINAL = ("CN_alpha", "CN_q", "CN_alphadot", "Cm_alpha", "Cm_q", "Cm_alphadot")


def compute(piece: Piece, folder: Path | None, progress: Progress | None = None) -> PieceResult:
    """Fly one shot three ways, and keep the flights.

    Raises
    ------
    InputError, DivergenceError
        What solver, models and flights raise.
    """
    if folder is None:
        raise InputError(f"{piece.name} keeps files: it needs a folder for them")
    solver = finner_solver(piece.mesh, piece.level, piece.mach, FINNER_MOMENT_REFERENCE, folder)
    nodes = [condition_of(mach) for mach in piece.settings["nodes"]]
    spent: dict[str, float] = {}

    def timed(name: str, action: Callable[[], Any]) -> Any:
        start = time.process_time()
        result = action()
        spent[f"{name}_cpu_s"] = round(time.process_time() - start, 4)
        return result

    RELAY.listener = None
    derivatives = timed("linearising", lambda: [_derivatives(solver, node) for node in nodes])
    models = timed("projecting", lambda: _model(solver, nodes, piece.settings, derivatives))
    flights = dict[str, Trajectory]()
    by_table = build_dynamics(basic_finner_range_model(), _tabled(solver, nodes, derivatives), AIR)
    by_model = build_dynamics(basic_finner_range_model(), models, AIR)
    for name, dynamics in zip(FLIGHTS, (by_table, by_model), strict=False):
        _ = dynamics.rate_kernel, dynamics.monitor_kernel  # compiling is not flying
        flights[name] = timed(name, partial(_flown, dynamics, piece))
    flights["flow"] = timed("flow", lambda: _in_flow(solver, piece, folder, progress))
    provenance = {
        "command": f"indicial study freeflight --compute {piece.name}",
        "version": version(),
        "cells": solver.grid.n_cells,
        "order": models.order,
        "cost": spent,
        "steps": len(flights["flow"]) - 1,
        "trials": flights["flow"].provenance["trials"],
        "against_flow": {name: difference(flights["flow"], flights[name]) for name in FLIGHTS[:2]},
        "flow": ends(flights["flow"]),
    }
    files = {}
    for name, flight in flights.items():
        files[name] = file_path(piece, folder, f"{name}.nc")
        flight.save(files[name])
    last = nodes[-1]
    known = derivatives[-1].items()
    records = tuple(Derivative.at(last, solver.reference, name, "operator", value, "k = 0") for name, value in known)
    return PieceResult(piece, DerivativeTable(records), provenance, files)


def condition_of(mach: float) -> FlightCondition:
    """The air of the range."""
    return FlightCondition(mach, temperature=AIR.temperature, pressure=AIR.pressure)


def _derivatives(solver: FiniteVolumeSolver, condition: FlightCondition) -> dict[str, float]:
    response = operator.run(solver, condition, [], ("alpha", "q"))
    found = operator.derivatives(response)
    return {name: found.value(name, k=None) for name in LONGITUDINAL} | {"CA_0": solver.steady(condition)["CA"]}


def _over_mach(nodes: list[FlightCondition], derivatives: list[dict[str, float]], name: str) -> Any:
    return table(MACH, [node.mach for node in nodes], [values[name] for values in derivatives])


def _tabled(
    solver: FiniteVolumeSolver, nodes: list[FlightCondition], derivatives: list[dict[str, float]]
) -> DerivativeAerodynamics:
    """Derivatives at k = 0, linear in the Mach number."""
    values = {name: _over_mach(nodes, derivatives, name) for name in (*LONGITUDINAL, "CA_0")}
    return DerivativeAerodynamics(reference=solver.reference, **values)


def _model(
    solver: FiniteVolumeSolver,
    nodes: list[FlightCondition],
    settings: dict[str, Any],
    derivatives: list[dict[str, float]],
) -> ScheduledStateSpaceAerodynamics:
    """The projected models of all nodes side by side, their loads weighted by the Mach number."""
    import control

    found = []
    for node in nodes:
        flow = solver.linearise(node)[0]
        system = project(flow, float(settings["k_max"])).model.system
        columns = [list(system.input_labels).index(name) for name in ("alpha", "q")]
        rows = [list(system.output_labels).index(name) for name in ("CN", "Cm")]
        a, b, c, d = (np.array(matrix) for matrix in (system.A, system.B, system.C, system.D))
        found.append((a, b[:, columns], c[rows], d[np.ix_(rows, columns)]))
    a, b = block_diag(*(one[0] for one in found)), np.vstack([one[1] for one in found])
    systems = []
    for i, (_, _, _, d) in enumerate(found):
        c = np.hstack([one[2] if j == i else 0.0 * one[2] for j, one in enumerate(found)])
        systems.append(control.ss(a, b, c, d, inputs=["alpha", "q"], outputs=["CN", "Cm"]))
    return ScheduledStateSpaceAerodynamics(
        reference=solver.reference,
        CA_0=_over_mach(nodes, derivatives, "CA_0"),
        machs=tuple(node.mach for node in nodes),
        systems=tuple(systems),
    )


def _start(piece: Piece) -> InitialState:
    return InitialState.from_path(condition_of(piece.mach).speed, alpha=math.radians(piece.settings["alpha_deg"]))


def _longest(piece: Piece) -> float:
    """Time [s] in which the shot is over, whatever its drag."""
    return 1.2 * float(piece.settings["distance_m"]) / condition_of(piece.mach).speed


def _flown(dynamics: Any, piece: Piece) -> Trajectory:
    end = End(x=float(piece.settings["distance_m"]))
    return fly(dynamics, _start(piece), _longest(piece), end=end, method="dop853", step=_step(piece), tolerance=1e-9)


def _step(piece: Piece) -> float:
    return float(piece.settings["step_m"]) / condition_of(piece.mach).speed


def _in_flow(solver: FiniteVolumeSolver, piece: Piece, folder: Path, progress: Progress | None) -> Trajectory:
    return fly_in_flow(
        basic_finner_range_model(),
        solver,
        _start(piece),
        _longest(piece),
        _step(piece),
        end=End(x=float(piece.settings["distance_m"])),
        atmosphere=AIR,
        checkpoint=folder / "states" / f"flight-{piece.name}-{piece.key}.npz",
        progress=progress,
    )


def difference(flow: Trajectory, other: Trajectory) -> dict[str, float]:
    """Of a flight from that in the flow, at the same stations: angles, damping, turning, phase, swerve, speed."""
    seen = compare(flow, other, aligned="station", arms=True)
    arm = seen.arms[0]
    swerve = seen.second.position[:, 2] - seen.first.position[:, 2]
    return {
        "incidence": seen.rms_angle("alpha") / _rms(seen.first.alpha),
        "damping": arm.damping / arm.damping_first,
        "phase_deg": math.degrees(arm.phase),
        "swerve_m": _rms(swerve),
        "speed": _rms(seen.second.speed / seen.first.speed - 1.0),
    }


def ends(flow: Trajectory) -> dict[str, float]:
    """Where the flight in the flow ended, and how it was damped."""
    from indicial.flightsim import fit_trajectory

    fit = fit_trajectory(flow)
    return {
        "time_s": float(flow.time[-1]),
        "mach": float(flow.mach[-1]),
        "alpha_rms_deg": math.degrees(_rms(flow.alpha)),
        "damping_1_m": fit.fast.eigenvalue.real,
        "turning_rad_m": abs(fit.fast.eigenvalue.imag),
        "z_m": float(flow.position[-1, 2]),
    }


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
