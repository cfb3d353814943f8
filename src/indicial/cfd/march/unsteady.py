r"""Time-accurate implicit march: BDF2 with variable steps.

    V (c0 W^{n+1} + c1 W^n + c2 W^{n-1}) / dt + R(q^{n+1}; V_b(t^{n+1}), omega(t^{n+1})) = 0

with ``c0 = (1+2r)/(1+r), c1 = -(1+r), c2 = r^2/(1+r)``, r the ratio of the step to the one before; the first step
is backward Euler. The equations of a step are solved by Newton's method with the exact J of the start, renewed
when it no longer serves, to a fixed part of what the motion does to the residual.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from indicial.cfd.flow.gas import RHO, P, conservative, conservative_jacobian
from indicial.cfd.flow.jacobian import Jacobian
from indicial.cfd.flow.residual import MeshMotion, Residual
from indicial.cfd.march.ilu import BlockILU, Pattern
from indicial.cfd.march.krylov import gmres
from indicial.cfd.march.steady import Progress, limited_update
from indicial.conventions import Array
from indicial.errors import DivergenceError
from indicial.files import Checkpoint

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


class Stepping:
    """BDF2 steps of the flow from a state at rest in its motion; a step is tried, perhaps again, and then accepted.

    Parameters
    ----------
    residual : Residual
    pattern : Pattern
    start : ndarray
        State (nc, 5), steady under `motion`.
    motion : MeshMotion
    target : float
        Norm of the residual that a step may leave.
    """

    def __init__(self, residual: Residual, pattern: Pattern, start: Array, motion: MeshMotion, target: float) -> None:
        self.residual, self.pattern, self.target = residual, pattern, target
        self.q, self.before, self.trial = start.copy(), start.copy(), start
        self.last_step, self.tried_step = 0.0, 0.0
        self.products, self.newton_steps, self.worst = 0, 0, 0.0
        self._tried = False
        self._linearise(start, motion)

    def try_step(self, dt: float, motion: MeshMotion) -> None:
        """Solve for the state a step later; the residual then has its loads. It takes effect when accepted.

        Raises
        ------
        DivergenceError
            If it cannot be solved; the accepted state stays.
        """
        ratio = dt / self.last_step if self.last_step else 0.0
        c0, c1, c2 = (1.0 + 2.0 * ratio) / (1.0 + ratio), -(1.0 + ratio), ratio**2 / (1.0 + ratio)
        volume = self.residual.grid.volume
        known = (volume / dt)[:, None] * (c1 * conservative(self.q) + c2 * conservative(self.before))
        guess = self.trial if self._tried else self.q + ratio * (self.q - self.before)
        if np.any(guess[:, [RHO, P]] <= 0.0):
            guess = self.q
        self.trial, left = self._solve(guess, known, c0 / dt, motion)
        self.tried_step, self._tried = dt, True
        self.worst = max(self.worst, left)

    def accept(self) -> None:
        """Take the step tried last."""
        self.before, self.q, self.last_step = self.q, self.trial, self.tried_step
        self._tried = False

    def arrays(self) -> dict[str, Array]:
        """What `restore` needs to go on from the accepted state."""
        numbers = [self.last_step, self.products, self.newton_steps, self.worst]
        return {"q": self.q, "before": self.before, "stepping": np.array(numbers)}

    def restore(self, arrays: Mapping[str, Array]) -> None:
        """Go on from stored `arrays`."""
        self.q, self.before, self.trial = arrays["q"], arrays["before"], arrays["q"]
        last, products, newton, worst = arrays["stepping"].tolist()
        self.last_step, self.products, self.newton_steps, self.worst = last, int(products), int(newton), worst
        self._tried = False

    def _solve(self, q: Array, known: Array, shift: float, motion: MeshMotion) -> tuple[Array, float]:
        """The state of an implicit step by Newton's method from `q`, and the residual left."""
        volume = self.residual.grid.volume[:, None]

        def unsteady_residual(q: Array) -> tuple[Array, float]:
            r: Array = shift * volume * conservative(q) + known + self.residual(q, motion)
            return r, float(np.linalg.norm(r))

        r, norm = unsteady_residual(q)
        for used in range(_NEWTON_STEPS):
            if norm <= self.target:
                self.newton_steps += used
                return q, norm
            q_new = limited_update(q, -self._correction(r, shift, max(0.3 * self.target / norm, 1e-4)))
            r, norm_new = unsteady_residual(q_new)
            if not norm_new < 0.2 * norm:
                if not np.isfinite(norm_new):
                    q_new = q
                self._linearise(q_new, motion)
                r, norm_new = unsteady_residual(q_new)
            q, norm = q_new, norm_new
        worst = int(np.argmax(np.sum(r**2, axis=1)))
        raise DivergenceError(
            f"residual {norm:.1e} of {self.target:.1e} after {_NEWTON_STEPS} Newton steps; "
            "try a smaller amplitude or a smaller time step",
            cell=worst,
        )

    def _linearise(self, q: Array, motion: MeshMotion) -> None:
        self._jacobian = Jacobian(self.residual, q, motion)
        self._mass = self.residual.grid.volume[:, None, None] * conservative_jacobian(q)
        self._shift = 0.0

    def _correction(self, b: Array, shift: float, tolerance: float) -> Array:
        """(shift V dW/dq + J)^-1 b."""
        # a factorisation for a shift within a tenth still preconditions well
        if not abs(shift - self._shift) <= 0.1 * shift:
            p = self.pattern
            blocks = self._jacobian.compact_blocks(shift * self._mass, p.slots, p.diagonal, len(p.indices))
            self._ilu = BlockILU(p, blocks)
            self._shift = shift

        def apply(x: Array) -> Array:
            y: Array = self._jacobian.apply(x) + shift * np.einsum("nij,nj->ni", self._mass, x)
            return y

        solution = gmres(apply, self._ilu.solve, b, tolerance)
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
    scale = _kick(residual, start, motion_at, times)
    n = len(times)
    forces, moments = np.empty((n, 3)), np.empty((n, 3))
    stepping = Stepping(residual, pattern, start, motion_at(-1.0), tolerance * scale)
    stored = checkpoint.load() if checkpoint is not None else None
    done = 1
    if stored is not None:
        done = len(stored["forces"])
        forces[:done], moments[:done] = stored["forces"], stored["moments"]
        stepping.restore(stored)
    else:
        residual(start, motion_at(float(times[0])))
        forces[0], moments[0] = residual.forces(ambient_pressure)

    for m in range(done, n):
        try:
            stepping.try_step(float(times[m] - times[m - 1]), motion_at(float(times[m])))
        except DivergenceError as error:
            saved = ""
            if checkpoint is not None:
                checkpoint.save(forces=forces[:m], moments=moments[:m], **stepping.arrays())
                saved = f"; the last good state is in {checkpoint.path}"
            message = f"the unsteady march stopped at step {m} of {n - 1}: {error}{saved}"
            raise DivergenceError(message, cell=error.cell, time=float(times[m])) from error
        stepping.accept()
        forces[m], moments[m] = residual.forces(ambient_pressure)
        if checkpoint is not None:
            checkpoint.save_if_due(forces=forces[: m + 1], moments=moments[: m + 1], **stepping.arrays())
        if progress is not None:
            progress(m / (n - 1))
    if checkpoint is not None:
        checkpoint.remove()
    worst = stepping.worst / scale
    return March(forces, moments, stepping.q, stepping.products, stepping.newton_steps, worst)
