"""How time and memory of steady solutions and of the operator grow with the mesh: fitted exponents and a plot.

Half a Basic Finner at Mach 2 on four meshes, each in a process of its own, so that its greatest memory is its own. The
operator gives all longitudinal derivatives. The plot goes to benchmarks/out/growth.png.
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
from figures import Figure

FACTORS = (0.7, 1.0, 1.42, 2.0)
LARGEST_OPERATOR = 300_000
"""Cells of the operator that is to fit in 16 GB."""

QUANTITIES = {
    "steady_s": "steady solution [s]",
    "operator_s": "operator [s]",
    "steady_bytes": "steady memory [byte]",
    "operator_bytes": "operator memory [byte]",
}


def measure() -> list[Figure]:
    """Run the four sizes, fit, draw."""
    runs = [_run(factor) for factor in FACTORS]
    cells = np.array([run["cells"] for run in runs], dtype=float)
    figures = [Figure("cells, smallest and largest", cells[0], f"to {cells[-1]:.0f}")]
    exponents = {}
    for key, name in QUANTITIES.items():
        values = np.array([run[key] for run in runs])
        exponents[key] = float(np.polyfit(np.log(cells), np.log(values), 1)[0])
        figures.append(Figure(f"{name.split(' [')[0]}: exponent of the number of cells", exponents[key], ""))
    for key in ("steady_bytes", "operator_bytes"):
        figures.append(
            Figure(f"{QUANTITIES[key].split(' [')[0]}, largest mesh", runs[-1][key] / cells[-1], "bytes a cell")
        )
    reckoned = runs[-1]["operator_bytes"] / cells[-1] * LARGEST_OPERATOR / 1e9
    figures.append(Figure.at_most("operator on 300,000 cells at that rate", reckoned, 16.0, "GB"))
    foretold = runs[-1]["foretold"] / runs[-1]["operator_bytes"]
    figures.append(Figure.at_least("memory foretold over memory taken, largest mesh", foretold, 1.0))
    _draw(cells, runs, exponents)
    return figures


def _run(factor: float) -> dict[str, float]:
    """One size in a process of its own."""
    done = subprocess.run(
        [sys.executable, __file__, str(factor)], capture_output=True, text=True, check=True, cwd=Path(__file__).parent
    )
    values: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return values


def _one(factor: float) -> dict[str, float]:
    from indicial.cfd import FiniteVolumeSolver
    from indicial.cfd.march import Pattern
    from indicial.cfd.memory import operator_bytes
    from indicial.cfd.mesh import finned_body_mesh
    from indicial.cfd.operator import KRYLOV_VECTORS
    from indicial.cfd.shapes import FinnedBody
    from indicial.methods import operator
    from indicial.motion import FlightCondition

    condition, body = FlightCondition(2.0), FinnedBody.basic_finner()
    # a small one first, so that nothing compiles while the clock runs and what the libraries take is known
    operator.run(FiniteVolumeSolver(finned_body_mesh(body, 0.4, mach=2.0), body.reference(5.5)), condition, [0.1])
    mesh = finned_body_mesh(body, factor, mach=2.0)
    before = _peak()
    solver = FiniteVolumeSolver(mesh, body.reference(5.5))
    times = [time.perf_counter()]
    solver.steady(condition)
    times.append(time.perf_counter())
    steady = _peak() - before
    operator.run(solver, condition)
    times.append(time.perf_counter())
    operator.run(solver, condition, [0.1, 1.0])
    return {
        "cells": mesh.n_cells,
        "steady_s": times[1] - times[0],
        "operator_s": times[2] - times[1],
        "steady_bytes": steady,
        "operator_bytes": _peak() - before,
        "foretold": operator_bytes(solver.grid, len(Pattern.wide(solver.grid).indices), restart=KRYLOV_VECTORS),
    }


def _peak() -> float:
    """Most memory this process has had so far [byte]; the system tells kilobytes, on macOS bytes."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1.0 if sys.platform == "darwin" else 1024.0)


def _draw(cells: np.ndarray, runs: list[dict[str, float]], exponents: dict[str, float]) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.ticker import NullFormatter

    figure, axes = plt.subplots(1, 2, figsize=(9.0, 3.6))
    for axis, keys, label, unit in (
        (axes[0], ("steady_s", "operator_s"), "time [s]", 1.0),
        (axes[1], ("steady_bytes", "operator_bytes"), "memory [GB]", 1e-9),
    ):
        for key in keys:
            name = QUANTITIES[key].split(" [")[0]
            axis.loglog(cells, [unit * run[key] for run in runs], "o-", label=f"{name}, cells^{exponents[key]:.2f}")
        axis.set_xlabel("cells")
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_ylabel(label)
        axis.grid(True, which="both", alpha=0.3)
        axis.legend()
    figure.tight_layout()
    out = Path(__file__).parent / "out"
    out.mkdir(exist_ok=True)
    figure.savefig(out / "growth.png", dpi=120)


if __name__ == "__main__":
    print(json.dumps(_one(float(sys.argv[1]))))
