r"""Time-accurate implicit march: BDF2 with variable steps.

    V (c0 W^{n+1} + c1 W^n + c2 W^{n-1}) / dt + R(q^{n+1}; V_b(t^{n+1}), omega(t^{n+1})) = 0

with ``c0 = (1+2r)/(1+r), c1 = -(1+r), c2 = r^2/(1+r)``, r the ratio of the step to the one before; the first step
is backward Euler. The equations of a step are solved by Newton's method with the exact J of the start, renewed
when it no longer serves, to a fixed part of what the motion does to the residual.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from indicial.cfd.flow.gas import RHO, P, conservative, conservative_jacobian
from indicial.cfd.flow.jacobian import Jacobian
from indicial.cfd.flow.residual import MeshMotion, Residual
from indicial.cfd.march.checkpoint import Checkpoint
from indicial.cfd.march.ilu import BlockILU, Pattern
from indicial.cfd.march.krylov import gmres
from indicial.cfd.march.steady import Progress, limited_update
from indicial.conventions import Array
from indicial.errors import DivergenceError

log = logging.getLogger(__name__)

MotionAt = Callable[[float], MeshMotion]

_NEWTON_STEPS = 20


@dataclass(frozen=True)
class March:
    """Loads along a march.

    Parameters
    ----------
    forces, moments : ndarray
        On the walls at each instant, solver units, mesh axes, (n, 3).
    q : ndarray
        The last state (nc, 5).
    products, newton_steps : int
        Products with J and Newton steps spent.
    worst_residual : float
        Largest residual left by a step, relative to what the motion does to the residual.
    """

    forces: Array
    moments: Array
    q: Array
    products: int
    newton_steps: int
    worst_residual: float


class _Stepper:
    """The linear side of a march: J at some state, and the factorisation for the present step length."""

    def __init__(self, residual: Residual, pattern: Pattern) -> None:
        self.residual, self.pattern = residual, pattern
        self.products = 0
        self._shift = 0.0

    def linearise(self, q: Array, motion: MeshMotion) -> None:
        self.jacobian = Jacobian(self.residual, q, motion)
        self.mass = self.residual.grid.volume[:, None, None] * conservative_jacobian(q)
        self._shift = 0.0

    def solve(self, b: Array, shift: float, tolerance: float) -> Array:
        """(shift V dW/dq + J)^-1 b."""
        # a factorisation for a shift within a tenth still preconditions well
        if not abs(shift - self._shift) <= 0.1 * shift:
            p = self.pattern
            blocks = self.jacobian.compact_blocks(shift * self.mass, p.slots, p.diagonal, len(p.indices))
            self.ilu = BlockILU(p, blocks)
            self._shift = shift

        def apply(x: Array) -> Array:
            y: Array = self.jacobian.apply(x) + shift * np.einsum("nij,nj->ni", self.mass, x)
            return y

        solution = gmres(apply, self.ilu.solve, b, tolerance)
        self.products += solution.products
        return solution.x


def _kick(residual: Residual, q: Array, motion_at: MotionAt, times: Array) -> float:
    """What the motion does to the residual of the first state: the scale of the steps' tolerance.

    Taken where V_b and where omega are furthest from the start: instants chosen beforehand may all be whole periods
    of an oscillation, where nothing has changed.
    """
    before = motion_at(-1.0)
    motions = [motion_at(float(t)) for t in times]
    furthest = {
        int(np.argmax([np.linalg.norm(motion.velocity - before.velocity) for motion in motions])),
        int(np.argmax([np.linalg.norm(motion.omega - before.omega) for motion in motions])),
    }
    base = residual(q, before)
    kick = max(float(np.linalg.norm(residual(q, motions[m]) - base)) for m in furthest)
    return kick if kick > 0.0 else 1.0


def march(
    residual: Residual,
    pattern: Pattern,
    start: Array,
    motion_at: MotionAt,
    times: Array,
    *,
    tolerance: float = 2e-4,
    checkpoint: Checkpoint | None = None,
    progress: Progress | None = None,
    ambient_pressure: float,
) -> March:
    """March through `times` (the first is 0+) from the state `start` at 0-.

    Parameters
    ----------
    motion_at : callable
        Mesh motion at a time in solver units; negative times mean before the start.
    tolerance : float
        Residual left by each step relative to the largest change of residual that the motion makes.

    Raises
    ------
    DivergenceError
        If a step cannot be solved; the last good state is kept in the checkpoint's file.
    """
    volume = residual.grid.volume
    scale = _kick(residual, start, motion_at, times)
    n = len(times)
    forces, moments = np.empty((n, 3)), np.empty((n, 3))
    stepper = _Stepper(residual, pattern)
    done, q, before, steps, worst = 1, start.copy(), start.copy(), 0, 0.0
    stored = checkpoint.load() if checkpoint is not None else None
    if stored is not None:
        done, q, before = int(stored["done"]), stored["q"], stored["before"]
        forces[:done], moments[:done] = stored["forces"], stored["moments"]
        steps, stepper.products, worst = int(stored["steps"]), int(stored["products"]), float(stored["worst"])
    else:
        residual(q, motion_at(float(times[0])))
        forces[0], moments[0] = residual.forces(ambient_pressure)
    stepper.linearise(start, motion_at(-1.0))

    def kept(done: int) -> dict[str, Array]:
        values = {"done": done, "q": q, "before": before, "forces": forces[:done], "moments": moments[:done]}
        counts = {"steps": steps, "products": stepper.products, "worst": worst}
        return {name: np.asarray(value) for name, value in {**values, **counts}.items()}

    for m in range(done, n):
        dt = float(times[m] - times[m - 1])
        ratio = dt / float(times[m - 1] - times[m - 2]) if m > 1 else 0.0
        c0, c1, c2 = (1.0 + 2.0 * ratio) / (1.0 + ratio), -(1.0 + ratio), ratio**2 / (1.0 + ratio)
        known = (volume / dt)[:, None] * (c1 * conservative(q) + c2 * conservative(before))
        guess = q + ratio * (q - before)
        if np.any(guess[:, [RHO, P]] <= 0.0):
            guess = q
        try:
            new, used, left = _step(
                residual,
                stepper,
                guess,
                known,
                c0 / dt,
                motion_at(float(times[m])),
                tolerance * scale,
            )
        except DivergenceError as error:
            saved = ""
            if checkpoint is not None:
                checkpoint.save(**kept(m))
                saved = f"; the last good state is in {checkpoint.path}"
            message = f"the unsteady march stopped at step {m} of {n - 1}: {error}{saved}"
            raise DivergenceError(message, cell=error.cell, time=float(times[m])) from error
        before, q = q, new
        steps += used
        worst = max(worst, left / scale)
        forces[m], moments[m] = residual.forces(ambient_pressure)
        if checkpoint is not None:
            checkpoint.save_if_due(**kept(m + 1))
        if progress is not None:
            progress(m / (n - 1))
    if checkpoint is not None:
        checkpoint.remove()
    return March(forces, moments, q, stepper.products, steps, worst)


def _step(
    residual: Residual, stepper: _Stepper, guess: Array, known: Array, shift: float, motion: MeshMotion, target: float
) -> tuple[Array, int, float]:
    """Solve one implicit step from `guess`; returns the state, the Newton steps spent and the residual left."""
    volume = residual.grid.volume[:, None]

    def unsteady_residual(q: Array) -> tuple[Array, float]:
        r: Array = shift * volume * conservative(q) + known + residual(q, motion)
        return r, float(np.linalg.norm(r))

    q = guess
    r, norm = unsteady_residual(q)
    for used in range(_NEWTON_STEPS):
        if norm <= target:
            return q, used, norm
        q_new = limited_update(q, -stepper.solve(r, shift, max(0.3 * target / norm, 1e-4)))
        r, norm_new = unsteady_residual(q_new)
        if not norm_new < 0.2 * norm:
            if not np.isfinite(norm_new):
                q_new = q
            stepper.linearise(q_new, motion)
            r, norm_new = unsteady_residual(q_new)
        q, norm = q_new, norm_new
    worst = int(np.argmax(np.sum(r**2, axis=1)))
    raise DivergenceError(
        f"residual {norm:.1e} of {target:.1e} after {_NEWTON_STEPS} Newton steps; "
        "try a smaller amplitude or a smaller time step",
        cell=worst,
    )
