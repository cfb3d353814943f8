"""Cost of one flow residual a cell, with one and two threads, against the memory it must move.

Second order with limiter, moving mesh, 3-D. The limit is the time in which this machine copies the bytes that the
residual cannot do without, each touched once: states, gradients, face geometry, face fluxes, tables.
"""

from __future__ import annotations

import numba
import numpy as np
from figures import Figure, best_time

from indicial.cfd.flow import STILL_AIR, Grid, Jacobian, MeshMotion, Residual
from indicial.cfd.mesh import box_mesh
from indicial.conventions import ReferenceQuantities

SHAPE = (64, 56, 56)
MOTION = MeshMotion(np.array([-2.0, 0.3, 0.5]), np.array([0.3, -0.5, 0.2]))


def measure() -> list[Figure]:
    """Time residual and Jacobian product on a skewed box of 200,000 cells."""
    grid = Grid.from_mesh(box_mesh(SHAPE, skew="smooth"), ReferenceQuantities(1.0, 1.0, (0.5, 0.5, 0.5)))
    residual = Residual(grid)
    q = STILL_AIR * (1.0 + 0.01 * np.random.default_rng(1).standard_normal((grid.n_cells, 5)))
    jacobian = Jacobian(residual, q, MOTION)
    figures = [Figure("cells", grid.n_cells, "")]
    times: dict[tuple[str, int], float] = {}
    # rounds in turn, so that a machine that slows for a while slows all alike
    for _ in range(4):
        for threads in range(1, min(2, numba.config.NUMBA_NUM_THREADS) + 1):
            numba.set_num_threads(threads)
            for name, action in (
                ("residual", lambda: residual(q, MOTION)),
                ("Jacobian product", lambda: jacobian.apply(q)),
            ):
                taken = best_time(action, 3)
                times[name, threads] = min(taken, times.get((name, threads), taken))
    for (name, threads), seconds in times.items():
        label = f"{name}, {threads} thread{'s' if threads > 1 else ''}"
        figures.append(Figure(label, 1e6 * seconds / grid.n_cells, "microseconds a cell"))
    for name in ("residual", "Jacobian product"):
        if (name, 2) in times:
            figures.append(Figure(f"{name}, speed-up by a second thread", times[name, 1] / times[name, 2], ""))
    figures.append(Figure("residual over a copy of what it must move", times["residual", 1] / _copy_time(residual), ""))
    return figures


def _copy_time(residual: Residual) -> float:
    """Time [s] to copy the bytes of the residual's arrays once, one thread."""
    g = residual.grid
    arrays = [residual.gradient, residual.face_flux, *(v for v in vars(g).values() if isinstance(v, np.ndarray))]
    count = sum(a.nbytes for a in arrays) // 8
    source, target = np.ones(count), np.empty(count)
    return best_time(lambda: np.copyto(target, source))
