r"""Flight with a flow solver in the loop, or with any function of Python for the loads.

The flow goes in steps of time. In each, the loads at its end are guessed, the vehicle flies the step under loads that
are quadratic in time through the last two steps' and the guess, the flow follows to the state reached, and its loads
are the next guess, until they do not change any more. The two are then solved together: nothing lags. With a flow of
second order in the step the flight is of second order; with loads that depend on the present motion alone, of third.
"""

from __future__ import annotations

import hashlib
import json
import logging
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from indicial.conventions import Array, ReferenceQuantities
from indicial.errors import DivergenceError, InputError
from indicial.files import Checkpoint
from indicial.flightsim.aerodynamics import AerodynamicLoads, FlowState, Validity
from indicial.flightsim.atmosphere import ConstantAtmosphere
from indicial.flightsim.dynamics import QUATERNION, RATE, RIGID_STATES, VELOCITY, Dynamics, build_dynamics
from indicial.flightsim.earth import Earth
from indicial.flightsim.expressions import TIME, free_symbols
from indicial.flightsim.initial import InitialState
from indicial.flightsim.march import ENDED, NOT_FINITE, runge_kutta
from indicial.flightsim.signals import Schedule
from indicial.flightsim.simulate import End, record
from indicial.flightsim.trajectory import Trajectory
from indicial.flightsim.vehicle import Vehicle
from indicial.motion import FlightCondition
from indicial.solver import SteppedFlow, SteppingSolver

log = logging.getLogger(__name__)

Progress = Callable[[float], None]

_SUBSTEPS = 4  # of Runge-Kutta in a step of the flow
_MOST_TRIALS = 20


@dataclass(frozen=True)
class _PrescribedLoads:
    """Loads about the moment reference point that are quadratic in time, their coefficients parameters."""

    reference: ReferenceQuantities
    symbols: Any

    @classmethod
    def of(cls, reference: ReferenceQuantities) -> _PrescribedLoads:
        return cls(reference, ca.SX.sym("load", 6, 3))

    @property
    def validity(self) -> Validity:
        return Validity()

    @property
    def parameters(self) -> tuple[Any, ...]:
        return free_symbols((self.symbols,))

    @property
    def lag_names(self) -> tuple[str, ...]:
        return ()

    def loads(self, flow: FlowState, lag: Any) -> AerodynamicLoads:
        del flow, lag
        now = ca.mtimes(self.symbols, ca.vertcat(1.0, TIME, TIME * TIME))
        return AerodynamicLoads(now[:3], now[3:])

    def lag_rate(self, flow: FlowState, lag: Any) -> Any:
        del flow, lag
        return ca.SX(0, 1)


@dataclass(frozen=True)
class LoadFunction:
    """Loads from any function of the motion, as a solver: it has no memory.

    Parameters
    ----------
    reference : ReferenceQuantities
    function : callable
        From velocity of the moment reference point [m/s] and rate [rad/s], body axes, to the six coefficients
        (CA, CY, CN, Cl, Cm, Cn) by the dynamic pressure of that velocity.
    """

    reference: ReferenceQuantities
    function: Callable[[Array, Array], Any]

    def stepping(self, condition: FlightCondition, velocity: Array, rate: Array) -> SteppedFlow:
        """The function, behind the protocol."""
        return _SteppedFunction(self.function, condition.speed, velocity, rate)


class _SteppedFunction:
    """Coefficients by the dynamic pressure of the start."""

    def __init__(self, function: Callable[[Array, Array], Any], speed: float, velocity: Array, rate: Array) -> None:
        self._function, self._speed = function, speed
        self._loads = self._trial = self._of(velocity, rate)

    def _of(self, velocity: Array, rate: Array) -> Array:
        loads = np.asarray(self._function(velocity, rate), dtype=float)
        if loads.shape != (6,) or not np.all(np.isfinite(loads)):
            raise InputError(f"a load function must give six finite coefficients, not {loads}")
        scaled: Array = loads * float(velocity @ velocity) / self._speed**2
        return scaled

    def loads(self) -> Array:
        return self._loads

    def try_step(self, dt: float, velocity: Array, rate: Array) -> Array:
        del dt
        self._trial = self._of(velocity, rate)
        return self._trial

    def accept(self) -> None:
        self._loads = self._trial

    def arrays(self) -> dict[str, Array]:
        return {"loads": self._loads}

    def restore(self, arrays: Mapping[str, Array]) -> None:
        self._loads = arrays["loads"]


def fly_in_flow(
    vehicle: Vehicle,
    solver: SteppingSolver,
    initial: InitialState,
    duration: float,
    step: float,
    *,
    end: End | None = None,
    atmosphere: ConstantAtmosphere | None = None,
    earth: Earth | None = None,
    tolerance: float = 1e-4,
    checkpoint: Path | None = None,
    progress: Progress | None = None,
) -> Trajectory:
    """Fly a vehicle whose loads a solver computes along its own motion, from the steady flow of the initial motion.

    Parameters
    ----------
    vehicle : Vehicle
    solver : SteppingSolver
        Such as `indicial.cfd.FiniteVolumeSolver`, or a `LoadFunction`.
    initial : InitialState
    duration : float
        [s]; the flight ends there at the latest.
    step : float
        Of the flow [s]; its last one is cut to meet the duration.
    end : End, optional
    atmosphere : ConstantAtmosphere, optional
        20 C and 1 atm if not given: the same air all along the flight.
    earth : Earth, optional
        Flat if not given.
    tolerance : float
        Change of the loads, over the largest met, below which a step is solved.
    checkpoint : Path, optional
        File in which the flight is kept on its way, so that a killed one goes on; deleted at the end.
    progress : callable, optional
        Told the fraction of the duration that is flown.

    Raises
    ------
    InputError
        If duration or step make no sense, or the solver cannot follow the motion (half a body out of its plane).
    DivergenceError
        If a step of the flow or of the two together cannot be solved; the last good state stays in the checkpoint.
    """
    if not (math.isfinite(duration) and math.isfinite(step) and 0.0 < step <= duration):
        raise InputError(f"duration {duration} s and step {step} s of a flight must be positive, the step the smaller")
    atmosphere = ConstantAtmosphere() if atmosphere is None else atmosphere
    dynamics = build_dynamics(vehicle, _PrescribedLoads.of(solver.reference), atmosphere, earth)
    flight = _Coupled(dynamics, solver, initial, atmosphere, End() if end is None else end, tolerance)
    inputs = [vehicle.summary(), str(initial), str(atmosphere), str(earth), step, tolerance]
    key = hashlib.sha256(json.dumps(inputs).encode()).hexdigest()
    kept = None if checkpoint is None else Checkpoint(checkpoint, key)
    flight.resume(kept)
    while not flight.ended and flight.times[-1] < duration * (1.0 - 1e-9):
        left = duration - flight.times[-1]
        try:
            flight.advance(step if left > 1.001 * step else left)
        except DivergenceError as error:
            saved = ""
            if kept is not None:
                kept.save(**flight.arrays())
                saved = f"; the last good state is in {kept.path}"
            raise DivergenceError(f"flight stopped after t = {flight.times[-1]:.6g} s: {error}{saved}") from error
        if kept is not None:
            kept.save_if_due(**flight.arrays())
        if progress is not None:
            progress(flight.times[-1] / duration)
    if kept is not None:
        kept.remove()
    return flight.trajectory(step)


class _Coupled:
    """The flight so far: times, states and loads of the accepted steps, and the flow at the last one."""

    def __init__(
        self,
        dynamics: Dynamics,
        solver: SteppingSolver,
        initial: InitialState,
        air: ConstantAtmosphere,
        end: End,
        tolerance: float,
    ) -> None:
        self._dynamics, self._end, self._tolerance = dynamics, end, tolerance
        start = np.concatenate([initial.position, initial.velocity, initial.quaternion, initial.rate])
        if initial.lag is not None and initial.lag.size:
            raise InputError("a flight in a flow has no lag states: the flow remembers by itself")
        self._arm = np.array(ca.DM(dynamics.vehicle.arm_to(solver.reference.moment_reference))).ravel()
        speed = float(np.linalg.norm(initial.velocity))
        if speed == 0.0:
            raise InputError("a flight in a flow cannot start at rest")
        sound = float(np.array(dynamics.loads(start, np.zeros(18), 0.0)[3]).item())
        condition = FlightCondition(speed / sound, temperature=air.temperature, pressure=air.pressure)
        reference = solver.reference
        pressure = 0.5 * float(np.array(dynamics.loads(start, np.zeros(18), 0.0)[2]).item()) * speed**2
        signs = np.array([-1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
        self._scale = pressure * reference.area * signs
        self._scale[3:] *= reference.moment_lengths
        self._flow = solver.stepping(condition, *self._motion(start))
        self.times, self.states = [0.0], [start]
        self.loads, self.trials, self.ended = [self._scale * self._flow.loads()], 0, False

    def advance(self, dt: float) -> None:
        """One step of flow and vehicle together, or the part of it until the end.

        Raises
        ------
        DivergenceError
            If they cannot be solved together.
        """
        guess = self._extrapolated(dt)
        for _ in range(_MOST_TRIALS):
            self.trials += 1
            state = self._flown(dt, guess)[1]
            found = self._scale * self._flow.try_step(dt, *self._motion(state))
            largest = np.maximum(np.abs(np.array(self.loads)).max(axis=0), np.abs(found))
            # of force and of moment, each as one: a component that stays nought must not count
            sizes = np.repeat([largest[:3].max(), largest[3:].max()], 3)
            change = float(np.max(np.abs(found - guess) / np.maximum(sizes, np.finfo(float).tiny)))
            guess = found
            if change <= self._tolerance:
                break
        else:
            raise DivergenceError(f"flow and flight do not agree after {_MOST_TRIALS} trials: try a smaller time step")
        flown, state, outcome = self._flown(dt, guess)
        self.ended = outcome == ENDED
        if not self.ended:
            self._flow.accept()
        elif flown <= 0.0:
            return
        self.loads.append(guess if not self.ended else self._polynomial(dt, guess) @ flown ** np.arange(3))
        self.times.append(self.times[-1] + flown)
        self.states.append(state)

    def _extrapolated(self, dt: float) -> Array:
        """Loads of the last steps, carried on: a parabola, or what there are points for."""
        n = min(3, len(self.times))
        t, values = np.array(self.times[-n:]), np.array(self.loads[-n:])
        guess = np.zeros(6)
        for i in range(n):
            others = np.delete(t, i)
            guess += values[i] * np.prod((t[-1] + dt - others) / (t[i] - others))
        return guess

    def _polynomial(self, dt: float, guess: Array) -> Array:
        """Coefficients of 1, t, t^2 of the loads, t from the last step on, shape (6, 3)."""
        t, values = [0.0, dt], [self.loads[-1], guess]
        if len(self.times) > 1:
            t, values = [self.times[-2] - self.times[-1], *t], [self.loads[-2], *values]
        fitted = np.linalg.solve(np.vander(t, increasing=True), np.array(values)).T
        return np.hstack([fitted, np.zeros((6, 3 - fitted.shape[1]))])

    def _flown(self, dt: float, guess: Array) -> tuple[float, Array, int]:
        """Time flown, state there, and how it came out, with loads that end as guessed."""
        dynamics = self._dynamics
        times, states = np.empty(_SUBSTEPS + 3), np.empty((_SUBSTEPS + 3, len(RIGID_STATES)))
        kept, outcome = runge_kutta(
            dynamics.rate_kernel.code,
            dynamics.monitor_kernel.code,
            self.states[-1],
            self._polynomial(dt, guess).ravel(order="F"),
            Schedule((), ()).drive,
            dt,
            dt / _SUBSTEPS,
            _SUBSTEPS,
            self._end.rows,
            times,
            states,
        )
        if outcome == NOT_FINITE:
            raise DivergenceError("the state is not finite: try a smaller time step")
        return float(times[kept - 1]), states[kept - 1], outcome

    def _motion(self, state: Array) -> tuple[Array, Array]:
        """Velocity of the moment reference point and rate, body axes."""
        return state[VELOCITY] + np.cross(state[RATE], self._arm), state[RATE]

    def arrays(self) -> dict[str, Array]:
        """What `resume` needs."""
        done = {"times": np.array(self.times), "states": np.array(self.states), "flown_loads": np.array(self.loads)}
        return {**done, "trials": np.array(self.trials), **self._flow.arrays()}

    def resume(self, checkpoint: Checkpoint | None) -> None:
        """Go on from a checkpoint that is there and of this flight."""
        stored = None if checkpoint is None else checkpoint.load()
        if stored is not None:
            self.times, self.states = stored["times"].tolist(), list(stored["states"])
            self.loads, self.trials = list(stored["flown_loads"]), int(stored["trials"])
            self._flow.restore(stored)
            log.info("flight goes on from t = %.6g s", self.times[-1])

    def trajectory(self, step: float) -> Trajectory:
        """The flight, with the loads of its steps."""
        loads = np.zeros((18, len(self.times)))
        loads[:6] = np.array(self.loads).T
        provenance: dict[str, Any] = {"method": "in flow", "step_s": step, "trials": self.trials}
        provenance |= getattr(self._flow, "work", {})
        states = np.array(self.states)
        states[:, QUATERNION] /= np.linalg.norm(states[:, QUATERNION], axis=1, keepdims=True)
        return record(self._dynamics, np.array(self.times), states, loads, provenance)
