"""The finite-volume flow step by step, for a motion that its own loads make."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from indicial.cfd.flow.residual import MeshMotion, Residual
from indicial.cfd.march.unsteady import Stepping
from indicial.conventions import Array

MotionOf = Callable[[Array, Array], MeshMotion]
LoadsOf = Callable[[], Array]

_LEAST_ANGLE = 0.0175  # rad: of incidence, whose effect on the residual is the least scale of the steps' tolerance


class SteppedFiniteVolumes:
    """A `indicial.solver.SteppedFlow` on a mesh.

    Parameters
    ----------
    residual, pattern
        Of the mesh.
    start : ndarray
        Steady state (nc, 5) under the first motion.
    motion_of : callable
        Mesh motion of a velocity and a rate in body axes.
    loads_of : callable
        The six coefficients of the state that the residual saw last.
    unit : float
        Solver units of time in a second.
    first : tuple of ndarray
        Velocity and rate that the start is steady in.
    tolerance : float
        Residual that a step may leave, over what incidence and rates of the first motion (or one degree) do to it.
    """

    def __init__(
        self,
        residual: Residual,
        pattern: Any,
        start: Array,
        motion_of: MotionOf,
        loads_of: LoadsOf,
        unit: float,
        first: tuple[Array, Array],
        tolerance: float,
    ) -> None:
        velocity, rate = first
        motion = motion_of(velocity, rate)
        base = residual(start, motion)
        speed = float(np.linalg.norm(velocity))
        kicks = []
        for lean in (0.0, _LEAST_ANGLE):
            straight = np.array([speed, 0.0, lean * speed])
            kicks.append(float(np.linalg.norm(residual(start, motion_of(straight, np.zeros(3))) - base)))
        self._stepping = Stepping(residual, pattern, start, motion, tolerance * max(kicks))
        self._motion_of, self._loads_of, self._unit = motion_of, loads_of, unit
        residual(start, motion)
        self._loads = self._trial = loads_of()

    def loads(self) -> Array:
        """Of the accepted state."""
        return self._loads

    def try_step(self, dt: float, velocity: Array, rate: Array) -> Array:
        """Loads a step [s] on; see `indicial.solver.SteppedFlow`.

        Raises
        ------
        InputError
            If the motion crosses the mesh's symmetry plane.
        DivergenceError
            If the step cannot be solved.
        """
        self._stepping.try_step(dt * self._unit, self._motion_of(velocity, rate))
        self._trial = self._loads_of()
        return self._trial

    def accept(self) -> None:
        """Take the step tried last."""
        self._stepping.accept()
        self._loads = self._trial

    def arrays(self) -> dict[str, Array]:
        """What `restore` needs."""
        return {**self._stepping.arrays(), "loads": self._loads}

    def restore(self, arrays: Mapping[str, Array]) -> None:
        """Go on from stored `arrays`."""
        self._stepping.restore(arrays)
        self._loads = arrays["loads"]

    @property
    def work(self) -> dict[str, int]:
        """Newton steps and products with the Jacobian so far."""
        return {"newton_steps": self._stepping.newton_steps, "jacobian_products": self._stepping.products}
