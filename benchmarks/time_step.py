"""Change of the Basic Finner's out-of-phase derivatives when the time step of a forced oscillation is refined.

Pitch and pitch rate at k = omega d/2U = 0.025 and 0.5 degrees, on quick meshes: M 2 (without a wake) and M 1 (with a
sting). Steps are told as U dt/d: 0.3 is 420 steps a period. Published for another code, M 1, 0.3 against 0.05: 2.47%
(Cm_q) and 1.93% (CN_q). Body and motion are symmetric, so ``C(t + T/2) = -C(t)`` once the start has died out, and half
a period holds all that a whole one does: one and a half periods are marched, the last half is read. At M 1 the start
dies out slowly; as it is the same for all steps, what differs is the steps. Half an hour on two cores.
"""

from __future__ import annotations

import math
from pathlib import Path
from tempfile import gettempdir

import numpy as np
from figures import Figure

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import Mesh, finned_body_mesh
from indicial.cfd.shapes import FinnedBody
from indicial.conventions import COEFFICIENTS
from indicial.history import History
from indicial.methods import forced_oscillation
from indicial.methods.forced_oscillation import OscillationMotion
from indicial.motion import FlightCondition
from indicial.reference_data import FINNER_MOMENT_REFERENCE

K, AMPLITUDE, HALF_PERIODS = 0.025, math.radians(0.5), 3
STEPS = {0.6: 210, 0.3: 420, 0.15: 840}
"""Steps a period by U dt/d, within 0.3%: a period is 2 pi/0.05 = 125.7 d/U."""

FINEST, ASKED = 0.15, 0.5
"""What the others are compared with; largest change of a derivative at 0.3 that is allowed [%]."""

NAMES: dict[OscillationMotion, str] = {"pitch": "_q + {}_alphadot", "pitch_rate": "_q"}


def measure() -> list[Figure]:
    """Each derivative with the finest step, and its change with the others [%]."""
    body = FinnedBody.basic_finner()
    meshes = {2.0: finned_body_mesh(body, "quick", mach=2.0), 1.0: finned_body_mesh(body, "quick", wake="sting")}
    return [
        figure
        for mach, mesh in meshes.items()
        for motion in NAMES
        for figure in _changes(mach, motion, readings(mach, mesh, body, motion))
    ]


def readings(mach: float, mesh: Mesh, body: FinnedBody, motion: OscillationMotion) -> dict[float, dict[str, float]]:
    """Out-of-phase derivatives of Cm and CN by U dt/d; states and unfinished marches are kept for a restart."""
    folder = Path(gettempdir()) / "indicial-time-step"
    folder.mkdir(exist_ok=True)
    solver = FiniteVolumeSolver(mesh, body.reference(FINNER_MOMENT_REFERENCE), folder=folder)
    condition = FlightCondition(mach)
    oscillation = forced_oscillation.experiment(condition, solver.reference, AMPLITUDE, K, motion)
    found = {}
    for step, count in STEPS.items():
        times = oscillation.period * np.arange(HALF_PERIODS * count // 2 + 1) / count
        history = solver.unsteady(condition, oscillation, times)
        found[step] = {name: _last_half_period(history, name, count // 2) for name in ("Cm", "CN")}
    return found


def _last_half_period(history: History, name: str, samples: int) -> float:
    """Eq. (12) over the last half period: ``2/(A k) mean(C cos wt)``."""
    phase = float(history.motion["omega"]) * history.time[-samples:]
    loads = history.coefficients[-samples:, COEFFICIENTS.index(name)]
    return float(2.0 * np.mean(loads * np.cos(phase)) / (AMPLITUDE * K))


def _changes(mach: float, motion: OscillationMotion, found: dict[float, dict[str, float]]) -> list[Figure]:
    figures = []
    for name, best in found[FINEST].items():
        label = name + NAMES[motion].format(name)
        figures.append(Figure(f"M {mach:g} {label}, U dt/d = {FINEST:g}", best, ""))
        for step in STEPS:
            if step == FINEST:
                continue
            change = 100.0 * (found[step][name] / best - 1.0)
            asked = step == 0.3
            figures.append(
                Figure(
                    f"M {mach:g} {label}, change at {step:g}", change, "%",
                    f"at most {ASKED:g}% either way" if asked else None,
                    abs(change) <= ASKED if asked else None,
                )
            )  # fmt: skip
    return figures
