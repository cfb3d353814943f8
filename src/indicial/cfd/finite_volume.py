r"""The finite-volume solver behind the solver protocol: motion in, history out."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from indicial import __version__
from indicial.cfd.adjoint import sensitivities
from indicial.cfd.checks import check_moment_reference, check_outflow, check_symmetry
from indicial.cfd.field import FlowField
from indicial.cfd.flow.gas import GAMMA
from indicial.cfd.flow.grid import Grid
from indicial.cfd.flow.jacobian import Jacobian
from indicial.cfd.flow.residual import MeshMotion, Residual
from indicial.cfd.frequency_sweep import frequency_response
from indicial.cfd.kept_states import KeptStates
from indicial.cfd.loads import AMBIENT_PRESSURE, Cut, coefficients
from indicial.cfd.march.convergence import ConvergenceHistory
from indicial.cfd.march.harmonic import converge_periodic
from indicial.cfd.march.ilu import Pattern
from indicial.cfd.march.steady import Progress, SteadyState, converge
from indicial.cfd.march.unsteady import march
from indicial.cfd.memory import operator_bytes, require, steady_bytes
from indicial.cfd.mesh import Mesh
from indicial.cfd.operator import ANTISYMMETRIC, KRYLOV_VECTORS, SYMMETRIC, FlowOperator
from indicial.cfd.stepped import SteppedFiniteVolumes
from indicial.conventions import Array, ReferenceQuantities, mesh_from_body
from indicial.errors import DivergenceError, InputError
from indicial.frequency import INPUTS, FrequencyResponse, reduced_frequencies
from indicial.history import History
from indicial.motion import FlightCondition, Motion, Rates, SteadyMotion
from indicial.sensitivity import Sensitivities
from indicial.solver import SteadyLoads, instants

log = logging.getLogger(__name__)

_SOLVER = "finite volume, Euler, second order"

LINEARISED_FROM = 1e-6
"""Largest residual, relative to that of still air, of a steady state about which the flow is linearised."""


@dataclass(frozen=True)
class FlowSettings:
    """Tolerances of the finite-volume solver.

    Parameters
    ----------
    steady_tolerance : float
        Residual of a steady state relative to that of still air under the same motion; where round-off leaves more
        than that, what it leaves is wanted.
    steady_iterations : int
        Newton steps allowed to each of its phases, the first-order and the second-order one.
    unsteady_tolerance : float
        Residual left by each time step relative to the largest change that the motion makes to the residual.
    """

    steady_tolerance: float = 1e-10
    steady_iterations: int = 200
    unsteady_tolerance: float = 2e-4

    def __post_init__(self) -> None:
        for name in ("steady_tolerance", "unsteady_tolerance"):
            if not 0.0 < getattr(self, name) < 1.0:
                raise InputError(f"{name} is {getattr(self, name)}, must lie between 0 and 1")
        if not self.steady_iterations >= 1:
            raise InputError(f"steady_iterations is {self.steady_iterations}, must be at least 1")


class FiniteVolumeSolver:
    """Euler equations in still-air moving-body form on one mesh; satisfies `indicial.solver.Solver`.

    Parameters
    ----------
    mesh : Mesh
        Wall patches carry the loads. A mesh whose symmetry patches close a half body (plane y = 0) gives the loads
        of the whole body; one layer between two symmetry patches is a two-dimensional flow, with `reference.area`
        the chord times the layer's thickness.
    reference : ReferenceQuantities
    settings : FlowSettings
    folder : Path, optional
        Where converged steady states and the checkpoints of running marches are kept, so that a killed run
        resumes; without it they live in memory only.
    progress : callable, optional
        Told the fraction of the running computation that is done.
    """

    def __init__(
        self,
        mesh: Mesh,
        reference: ReferenceQuantities,
        settings: FlowSettings | None = None,
        *,
        folder: Path | None = None,
        progress: Progress | None = None,
    ) -> None:
        self.mesh = mesh
        self.settings = settings if settings is not None else FlowSettings()
        self._reference = reference
        self._progress = progress
        self.grid = Grid.from_mesh(mesh, reference)
        require(steady_bytes(self.grid), f"the flow on {mesh.n_cells} cells")
        self._residual = Residual(self.grid)
        self._pattern = Pattern.of(self.grid)
        self._cut = Cut.of(self.grid)
        check_moment_reference(mesh, self.grid, self._cut, reference)
        self._kept = KeptStates(mesh, reference, folder)

    @property
    def reference(self) -> ReferenceQuantities:
        """What the loads are made dimensionless with."""
        return self._reference

    def steady(self, condition: FlightCondition, rates: Rates = Rates()) -> SteadyLoads:
        """Loads of the steady state at constant velocity and body rates.

        Raises
        ------
        InputError
            If the motion crosses the mesh's symmetry plane or the gas is not the solver's.
        DivergenceError
            If the flow does not converge.
        """
        motion = SteadyMotion(condition, rates)
        state = self._state(condition, motion.velocity(0.0), motion.rate(0.0))
        self._residual(state.q, state.motion)
        coefficients = self._coefficients(*self._residual.forces(AMBIENT_PRESSURE), condition)
        convergence: dict[str, float | int | str] = {
            "residual": float(state.history.residual[-1]),
            "iterations": state.history.steps,
            "jacobian_products": int(state.history.products[-1]),
            "cells": self.grid.n_cells,
        }
        return SteadyLoads(coefficients, condition, rates, self._reference, convergence)

    def unsteady(self, condition: FlightCondition, motion: Motion, times: ArrayLike) -> History:
        """Loads at `times` [s], the steps of the march, from the steady state of the motion at t = 0-.

        Raises
        ------
        InputError
            If `times` does not start at 0 and increase, or the motion crosses the symmetry plane.
        DivergenceError
            If a step cannot be solved; says where and when.
        """
        t = np.asarray(times, dtype=float)
        if t.ndim != 1 or t.size < 2 or t[0] != 0.0 or not np.all(np.diff(t) > 0.0):
            raise InputError("times must start at 0 and increase strictly, with at least two of them")
        velocity, rate = motion.velocity(t), motion.rate(t)
        unit = condition.speed_of_sound / self._reference.length
        before = self._mesh_motion(condition, motion.velocity_before, motion.rate_before)

        def motion_at(time: float) -> MeshMotion:
            if time < 0.0:
                return before
            return self._mesh_motion(condition, motion.velocity(time / unit), motion.rate(time / unit))

        for m in np.unique(np.linspace(0, t.size - 1, 50).astype(int)):
            check_symmetry(self.grid, motion_at(float(t[m] * unit)))
        start = self._state(condition, motion.velocity_before, motion.rate_before)
        self._residual(start.q, start.motion)
        initial = self._coefficients(*self._residual.forces(AMBIENT_PRESSURE), condition)
        start_of = (motion.velocity_before, motion.rate_before, self.settings.steady_tolerance)
        key = self._kept.key(condition, *start_of, velocity, rate, t, self.settings.unsteady_tolerance)
        checkpoint = self._kept.checkpoint("march", key)
        try:
            result = march(
                self._residual,
                self._pattern,
                start.q,
                motion_at,
                t * unit,
                tolerance=self.settings.unsteady_tolerance,
                checkpoint=checkpoint,
                progress=self._progress,
                ambient_pressure=AMBIENT_PRESSURE,
            )
        except DivergenceError as error:
            raise DivergenceError(f"{error}; {self._place(error)}, t = {error.time / unit:.4g} s") from error
        loads = self._coefficients(result.forces, result.moments, condition)
        spent = {
            "jacobian_products": result.products,
            "newton_steps": result.newton_steps,
            "worst_step_residual": result.worst_residual,
        }
        return self._history(t, loads, initial, condition, motion, spent)

    def stepping(self, condition: FlightCondition, velocity: Array, rate: Array) -> SteppedFiniteVolumes:
        """The flow at rest in a motion, to go on step by step under one that its own loads make.

        Parameters
        ----------
        condition : FlightCondition
            The air, and whose dynamic pressure the loads are made dimensionless with.
        velocity, rate : ndarray
            Of the moment reference point, body axes [m/s], [rad/s], shape (3,).

        Raises
        ------
        InputError
            If the motion crosses the mesh's symmetry plane.
        DivergenceError
            If the steady state does not converge.
        """
        start = self._state(condition, velocity, rate)

        def motion_of(velocity: Array, rate: Array) -> MeshMotion:
            motion = self._mesh_motion(condition, velocity, rate)
            check_symmetry(self.grid, motion)
            return motion

        return SteppedFiniteVolumes(
            self._residual,
            self._pattern,
            start.q,
            motion_of,
            lambda: self._coefficients(*self._residual.forces(AMBIENT_PRESSURE), condition),
            condition.speed_of_sound / self._reference.length,
            (velocity, rate),
            self.settings.unsteady_tolerance,
        )

    def periodic(self, condition: FlightCondition, motion: Motion, period: float, harmonics: int = 1) -> History:
        """Loads at 2h + 1 instants of one period [s] of the flow under a periodic motion, truncated after h harmonics.

        All instants are solved together, from the steady state of `condition` (time-spectral method, see
        `indicial.cfd.march.harmonic`): there is no start to die out, and `before` holds the loads at t = 0.

        Raises
        ------
        InputError
            If the motion does not repeat itself after `period` or crosses the symmetry plane, or `harmonics` is not a
            whole number of at least 1.
        DivergenceError
            If the flow does not converge; says where, and keeps the last states in the folder.
        """
        phase = instants(harmonics)
        t = _within_period(motion, period, phase)
        velocity, rate = motion.velocity(t), motion.rate(t)
        motions = [self._mesh_motion(condition, v, w) for v, w in zip(velocity, rate, strict=True)]
        for one in motions:
            check_symmetry(self.grid, one)
        start = self._state(condition, condition.velocity, np.zeros(3))
        unit = condition.speed_of_sound / self._reference.length
        key = self._kept.key(condition, velocity, rate, period, self.settings.steady_tolerance)
        checkpoint = self._kept.checkpoint("periodic", key)
        try:
            found = converge_periodic(
                self._residual,
                self._pattern,
                motions,
                2.0 * np.pi / (period * unit),
                start.q,
                tolerance=self.settings.steady_tolerance,
                iterations=self.settings.steady_iterations,
                progress=self._progress,
                checkpoint=checkpoint,
            )
        except DivergenceError as error:
            kept = self._kept.keep_diverged(error, key)
            message = f"{error}; {self._place(error)}{kept}"
            raise DivergenceError(message, cell=error.cell, state=error.state) from error
        loads = np.empty((t.size, 2, 3))
        for n, one in enumerate(motions):
            self._residual(found.q[n], one)
            loads[n] = self._residual.forces(AMBIENT_PRESSURE)
        coefficients = self._coefficients(loads[:, 0], loads[:, 1], condition)
        spent = {
            "solver": f"{_SOLVER}, time-spectral",
            "harmonics": int(harmonics),
            "jacobian_products": int(found.history.products[-1]),
            "newton_steps": found.history.steps,
            "residual": float(found.history.residual[-1]),
        }
        return self._history(t, coefficients, coefficients[0], condition, motion, spent)

    def _history(
        self,
        time: Array,
        loads: Array,
        before: Array,
        condition: FlightCondition,
        motion: Motion,
        how: dict[str, Any],
    ) -> History:
        """Loads under a motion, labelled with how they were got."""
        return History(
            time=time,
            coefficients=loads,
            velocity=motion.velocity(time),
            rate=motion.rate(time),
            before=before,
            condition=condition,
            reference=self._reference,
            motion=motion.describe(),
            provenance={
                "solver": _SOLVER,
                "version": __version__,
                "mesh": self._kept.mesh_key,
                "cells": self.grid.n_cells,
                **how,
            },
        )

    def linearise(
        self, condition: FlightCondition, rates: Rates = Rates(), *, tolerance: float = 1e-8
    ) -> tuple[FlowOperator, ...]:
        """The flow linearised about a steady state: one operator, or symmetric and antisymmetric ones on half a body.

        Raises
        ------
        InputError
            If the steady state is not converged well enough, or memory would not suffice.
        """
        if self._cut.z:
            raise InputError("the mesh holds a quarter of the body: a linearised flow needs half of it or the whole")
        motion = SteadyMotion(condition, rates)
        state = self._state(condition, motion.velocity(0.0), motion.rate(0.0))
        if not state.history.residual[-1] <= LINEARISED_FROM:
            raise InputError(
                f"the steady state has a residual of {state.history.residual[-1]:.1e}: to be linearised about it "
                f"must be below {LINEARISED_FROM:.0e}; set a smaller steady_tolerance"
            )
        self._residual(state.q, state.motion)
        baseline = self._coefficients(*self._residual.forces(AMBIENT_PRESSURE), condition)
        pattern = Pattern.wide(self.grid)
        wanted = operator_bytes(self.grid, len(pattern.indices), restart=KRYLOV_VECTORS)
        require(wanted, f"the linearised flow on {self.grid.n_cells} cells")
        jacobian = Jacobian(self._residual, state.q, state.motion)
        symmetries: tuple[float | None, ...] = (SYMMETRIC, ANTISYMMETRIC) if self._cut.y else (None,)
        return tuple(
            FlowOperator(
                jacobian,
                pattern,
                state,
                baseline,
                condition,
                self._reference,
                symmetry=symmetry,
                plane=self._cut.plane,
                tolerance=tolerance,
            )
            for symmetry in symmetries
        )

    def frequency_response(
        self,
        condition: FlightCondition,
        k: ArrayLike = (),
        inputs: tuple[str, ...] | None = None,
        rates: Rates = Rates(),
    ) -> FrequencyResponse:
        """H(ik) from motion to the six loads at reduced frequencies `k`, with H(0) and H'(0).

        Parameters
        ----------
        inputs : tuple of str, optional
            Of `indicial.frequency.INPUTS`; all that the mesh allows if not given (a plane flow has no beta, p and r).

        Raises
        ------
        InputError
            If a frequency is negative or not finite, an input is unknown, or the steady state is not converged.
        DivergenceError
            If a linear system cannot be solved.
        """
        ks = reduced_frequencies(k)
        operators = self.linearise(condition, rates)
        known = {name for operator in operators for name in operator.inputs} | {"alphadot"}
        wanted = tuple(name for name in INPUTS if name in known) if inputs is None else inputs
        needed = [op for op in operators if any(name.removesuffix("dot") in op.inputs for name in wanted)]
        return frequency_response(needed or operators, wanted, ks, self._progress)

    def sensitivities(self, condition: FlightCondition, rates: Rates = Rates()) -> Sensitivities:
        """Derivatives of all six coefficients with respect to every input, by the adjoint."""
        return sensitivities(self.linearise(condition, rates))

    def field(self, condition: FlightCondition, rates: Rates = Rates()) -> FlowField:
        """The steady flow itself, for pictures and checks."""
        motion = SteadyMotion(condition, rates)
        state = self._state(condition, motion.velocity(0.0), motion.rate(0.0))
        self._residual(state.q, state.motion)
        return FlowField.of(self.mesh, self.grid, self._reference, condition, state, self._residual.face_flux)

    def convergence(self, condition: FlightCondition, rates: Rates = Rates()) -> ConvergenceHistory:
        """How a steady state converged: residual, pseudo-time step and products with J, step by step."""
        motion = SteadyMotion(condition, rates)
        return self._state(condition, motion.velocity(0.0), motion.rate(0.0)).history

    def _mesh_motion(self, condition: FlightCondition, velocity: Array, rate: Array) -> MeshMotion:
        """V_b and omega in solver units and mesh axes."""
        if not (np.all(np.isfinite(velocity)) and np.all(np.isfinite(rate))):
            raise InputError(f"the motion is not finite: velocity {velocity} m/s, rate {rate} rad/s in body axes")
        sound = condition.speed_of_sound
        return MeshMotion(mesh_from_body(velocity) / sound, mesh_from_body(rate) * self._reference.length / sound)

    def _state(self, condition: FlightCondition, velocity: Array, rate: Array) -> SteadyState:
        """The steady state under a constant motion, from memory, from the folder, or computed."""
        if condition.gamma != GAMMA:
            raise InputError(f"gamma is {condition.gamma}, the finite-volume solver has {GAMMA}")
        motion = self._mesh_motion(condition, velocity, rate)
        check_symmetry(self.grid, motion)
        key = self._kept.key(motion.velocity, motion.omega, self.settings.steady_tolerance)
        found = self._kept.find(key, motion)
        if found is None:
            found = self._converged(motion, key)
            check_outflow(self.grid, found)
            self._kept.keep(key, found)
        return found

    def _converged(self, motion: MeshMotion, key: str) -> SteadyState:
        """Compute a steady state; one that fails leaves its last good state in the folder."""
        try:
            return converge(
                self._residual,
                self._pattern,
                motion,
                self._kept.nearest(motion),
                tolerance=self.settings.steady_tolerance,
                iterations=self.settings.steady_iterations,
                progress=self._progress,
            )
        except DivergenceError as error:
            raise DivergenceError(f"{error}; {self._place(error)}{self._kept.keep_diverged(error, key)}") from error

    def _place(self, error: DivergenceError) -> str:
        """Where it went wrong, in mesh coordinates."""
        x, y, z = self.mesh.cell_centre[error.cell or 0]
        return f"worst at x = {x:.4g}, y = {y:.4g}, z = {z:.4g} m"

    def start_from(self, condition: FlightCondition, rates: Rates = Rates()) -> None:
        """Have the steady state of a condition at hand, so that later ones start near it."""
        motion = SteadyMotion(condition, rates)
        self._state(condition, motion.velocity(0.0), motion.rate(0.0))

    def _coefficients(self, force: Array, moment: Array, condition: FlightCondition) -> Array:
        """The six coefficients of the whole body, shape (..., 6), from loads in solver units and mesh axes."""
        return coefficients(force, moment, self._cut, condition, self._reference)


def _within_period(motion: Motion, period: float, phase: Array) -> Array:
    """Times [s] of phases of a period, after which the motion must repeat itself."""
    if not (np.isfinite(period) and period > 0.0):
        raise InputError(f"period is {period} s, must be positive and finite")
    t: Array = period * phase / (2.0 * np.pi)
    for values in (motion.velocity, motion.rate):
        now, later = values(t), values(t + period)
        if np.max(np.abs(later - now)) > 1e-9 * np.max(np.abs(now)):
            raise InputError(f"the motion does not repeat itself after a period of {period:.6g} s")
    return t
