"""Cost of one flow residual a cell, with one and two threads, against the memory it must move.

Second order with limiter, moving mesh, 3-D. The limit is the time in which this machine copies the bytes that the
residual cannot do without, each touched once: states, gradients, face geometry, face fluxes, tables. Where OpenFOAM is
installed and its environment set, one step of its density-based solver on the same moving mesh is timed too: an
explicit step is one residual and little else, on both sides.
"""

from __future__ import annotations

import time

import numba
import numpy as np
from figures import Figure, best_time
from peers import openfoam

from indicial.cfd.flow import STILL_AIR, Grid, Jacobian, MeshMotion, Residual
from indicial.cfd.mesh import box_mesh
from indicial.conventions import ReferenceQuantities

SHAPE = (64, 56, 56)
MOTION = MeshMotion(np.array([-2.0, 0.3, 0.5]), np.array([0.3, -0.5, 0.2]))


def measure() -> list[Figure]:
    """Time residual and Jacobian product on a skewed box of 200,000 cells."""
    mesh = box_mesh(SHAPE, skew="smooth")
    grid = Grid.from_mesh(mesh, ReferenceQuantities(1.0, 1.0, (0.5, 0.5, 0.5)))
    residual = Residual(grid)
    q = STILL_AIR * (1.0 + 0.01 * np.random.default_rng(1).standard_normal((grid.n_cells, 5)))
    jacobian = Jacobian(residual, q, MOTION)
    figures = [Figure("cells", grid.n_cells, "")]
    times: dict[tuple[str, int], float] = {}
    # rounds in turn, so that a machine that slows for a while slows all alike
    for _ in range(10):
        for threads in range(1, min(2, numba.config.NUMBA_NUM_THREADS) + 1):
            numba.set_num_threads(threads)
            for name, action in (
                ("residual", lambda: residual(q, MOTION)),
                ("Jacobian product", lambda: jacobian.apply(q)),
            ):
                taken = best_time(action, 3)
                times[name, threads] = min(taken, times.get((name, threads), taken))
    for (name, threads), seconds in times.items():
        label, cost = f"{name}, {threads} thread{'s' if threads > 1 else ''}", 1e6 * seconds / grid.n_cells
        if (name, threads) == ("residual", 1):
            figures.append(Figure.at_most(label, cost, 0.3, "microseconds a cell"))
        else:
            figures.append(Figure(label, cost, "microseconds a cell"))
    if ("residual", 2) in times:
        label = "speed-up by a second thread"
        figures.append(Figure.at_least(f"residual, {label}", times["residual", 1] / times["residual", 2], 1.8))
        figures.append(
            Figure(f"Jacobian product, {label}", times["Jacobian product", 1] / times["Jacobian product", 2], "")
        )
    bytes_moved = _bytes_moved(residual)
    figures.append(Figure("bytes the residual must move, each once", bytes_moved / grid.n_cells, "a cell"))
    figures.append(Figure("residual over a copy of them", times["residual", 1] / _copy_time(bytes_moved), ""))
    if openfoam.available():
        numba.set_num_threads(1)
        taken = best_time(lambda: residual(q, MOTION), 20, time.process_time)
        step = openfoam.step_time(mesh)
        figures.append(Figure("residual, processor time", 1e6 * taken / grid.n_cells, "microseconds a cell"))
        figures.append(Figure(f"{openfoam.SOLVER}, one step", 1e6 * step / grid.n_cells, "microseconds a cell"))
        ratio = step / taken
        figures.append(Figure.at_least(f"{openfoam.SOLVER}, step over residual", ratio, 5.0))
    return figures


def _bytes_moved(residual: Residual) -> int:
    """Size of all that one evaluation reads or writes."""
    g = residual.grid
    states = 2 * 5 * 8 * g.n_cells
    tables = (g.blocks, g.owner, g.neighbour, g.offsets, g.faces, g.signs, g.cells, g.weights, g.volume)
    return states + sum(a.nbytes for a in (residual.gradient, residual.face_flux, *tables))


def _copy_time(size: int) -> float:
    """Time [s] to copy as many bytes, one thread."""
    source, target = np.ones(size // 8), np.empty(size // 8)
    return best_time(lambda: np.copyto(target, source))
