r"""Trim: the steady flight of any `Dynamics` - straight, turning, climbing, gliding, spinning.

Steady flight is a helix about the vertical: velocity and rates constant in body axes, attitude turning with the
heading alone. With speed V, angles alpha and beta, path angle gamma, bank mu about the velocity, and turn rate Omega,

    (u, v, w) = V (cos(alpha) cos(beta), sin(beta), sin(alpha) cos(beta)),   R = R(chi, gamma, mu) Rz(-beta) Ry(alpha),
    (p, q, r) = R^T (0, 0, Omega),      d(u, v, w, p, q, r, lag)/dt = 0.

A dive at gamma = -pi/2 that turns is one that rolls about its path: the autorotation of a symmetric body. The
equations are solved by least squares with their exact Jacobian and bounds, then by Newton's method to round-off.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.attitude import euler_angles
from indicial.flightsim.dynamics import RIGID_STATES, Dynamics
from indicial.flightsim.outputs import OUTPUTS, flight_outputs, require_steady_surroundings, vertical_in_body

VARIABLES = ("speed", "alpha", "beta", "path_angle", "bank", "turn_rate", "roll_rate", "pitch_rate", "yaw_rate")
"""What describes a steady flight, beside the parameters of the model; altitude and heading are always given."""

_GIVEN = ("altitude", "heading")
_ACCELERATIONS = ("u", "v", "w", "p", "q", "r")
_NEWTON_STEPS = 8
_ROUND_OFF = 1e-13  # of the largest term of an equation
_SMALLEST = 1e-10  # m/s^2, rad/s^2: below this an equation holds
_UNDETERMINED = 1e-9  # of the largest singular value of the scaled Jacobian


@dataclass(frozen=True)
class Unknown:
    """What a trim is to find, where to start and between which bounds.

    Parameters
    ----------
    guess, low, high : float
        In SI units and radians.
    """

    guess: float = 0.0
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        if not (math.isfinite(self.guess) and self.low < self.high and self.low <= self.guess <= self.high):
            raise InputError(f"an unknown needs low <= guess <= high, not {self.low}, {self.guess}, {self.high}")


@dataclass(frozen=True)
class Trim:
    """A steady flight.

    Parameters
    ----------
    dynamics : Dynamics
    state : ndarray
        State vector, lag states settled, shape (nx,).
    parameters : mapping of str to float
        All parameters of the model, those found among them.
    variables : mapping of str to float
        `VARIABLES`, altitude and heading [m/s, rad, rad/s, m].
    found : tuple of str
        What was unknown.
    targets : mapping of str to float
    residual : float
        Largest of the equations left [m/s^2, rad/s^2, units of the targets].
    outputs : mapping of str to float
        Every one of `indicial.flightsim.outputs.OUTPUTS`.
    time : float
        At which a model that depends on time was trimmed [s].
    """

    dynamics: Dynamics
    state: Array
    parameters: Mapping[str, float]
    variables: Mapping[str, float]
    found: tuple[str, ...]
    targets: Mapping[str, float]
    residual: float
    outputs: Mapping[str, float]
    time: float = 0.0

    def __getitem__(self, name: str) -> float:
        for values in (self.variables, self.parameters, self.outputs):
            if name in values:
                return values[name]
        raise InputError(f"a trim has no {name!r}")

    @property
    def parameter_vector(self) -> Array:
        """Values of the parameters in the order of the model, shape (n,)."""
        return self.dynamics.parameter_vector(self.parameters)

    @property
    def is_steady(self) -> bool:
        """Whether it lasts: False if rates beyond those of the turn were given, as in a pull-up."""
        return not any(self.variables[name] for name in ("roll_rate", "pitch_rate", "yaw_rate"))

    def summary(self) -> str:
        """The flight in some lines; what was found is marked."""
        v, lines = self.variables, []
        yaw, pitch, roll = np.degrees(euler_angles(self.state[6:10]))
        lines.append(
            f"{self.dynamics.vehicle.name} trimmed at {v['speed']:.5g} m/s (Mach {self.outputs['mach']:.4g}), "
            f"{v['altitude']:.6g} m"
        )
        for name in VARIABLES[1:]:
            if v[name] or name in self.found:
                unit = "deg/s" if name.endswith("rate") else "deg"
                lines.append(f"  {name:<14}{math.degrees(v[name]):>12.6g} {unit:<6}{self._mark(name)}")
        lines += [f"  {name:<14}{value:>12.6g}       {self._mark(name)}" for name, value in self.parameters.items()]
        rates = ", ".join(f"{math.degrees(rate):.4g}" for rate in self.state[10:13])
        lines.append(f"  attitude psi, theta, phi = {yaw:.4g}, {pitch:.4g}, {roll:.4g} deg; p, q, r = {rates} deg/s")
        lines.append(f"  load factor {self.outputs['load_factor']:.5g}; equations left {self.residual:.1e}")
        return "\n".join(lines)

    def _mark(self, name: str) -> str:
        return "found" if name in self.found else ""


def trim(
    dynamics: Dynamics,
    *,
    unknown: Iterable[str] | Mapping[str, float | Unknown],
    given: Mapping[str, float],
    targets: Mapping[str, float] | None = None,
    time: float = 0.0,
) -> Trim:
    """Find the steady flight in which the equations of motion hold.

    Parameters
    ----------
    dynamics : Dynamics
        In still air on a flat earth.
    unknown : sequence of names, or mapping of names to guesses or `Unknown`
        Of `VARIABLES` and the model's parameters. Six equations (three of force, three of moment) and the targets have
        to hold; fewer unknowns do where symmetry makes the rest hold by itself. Guesses are 0 if not given.
    given : mapping of str to float
        The other variables [SI, rad], 0 where left out (but the speed), "altitude" [m], "heading", and all other
        parameters. ``roll_rate``, ``pitch_rate`` and ``yaw_rate`` are body rates beyond those of the turn: with them
        the flight is one of an instant, as at the bottom of a pull-up.
    targets : mapping of str to float, optional
        What outputs (`indicial.flightsim.outputs.OUTPUTS`) must be: ``{"load_factor": 2.0}``, ``{"ay": 0.0}``.
    time : float
        [s], of a model that depends on it.

    Raises
    ------
    InputError
        If names are unknown, missing or there twice, there are more unknowns than equations, an unknown is not
        determined by them, or no such flight is found: the nearest is then told, with the equation not met.
    """
    require_steady_surroundings(dynamics)
    unknowns = _unknowns(unknown)
    wanted = dict(targets or {})
    known = _check_names(dynamics, unknowns, given, wanted)
    problem = _Problem(dynamics, tuple(unknowns), known, wanted, time)
    x, residual, jacobian, allowed = problem.solve(list(unknowns.values()))
    result = problem.result(x, residual)
    missed = np.abs(residual) > allowed
    if np.any(missed):
        raise InputError(_no_trim(problem, unknowns, x, residual, missed))
    _check_determined(problem.names, jacobian, unknowns)
    return result


def _unknowns(unknown: Iterable[str] | Mapping[str, float | Unknown]) -> dict[str, Unknown]:
    if isinstance(unknown, str):
        raise InputError("unknown takes a sequence of names or a mapping, not one string")
    if isinstance(unknown, Mapping):
        return {name: v if isinstance(v, Unknown) else Unknown(float(v)) for name, v in unknown.items()}
    return {name: Unknown() for name in unknown}


def _check_names(
    dynamics: Dynamics, unknowns: Mapping[str, Unknown], given: Mapping[str, float], targets: Mapping[str, float]
) -> dict[str, float]:
    """Everything that is known, by name."""
    parameters = dynamics.parameter_names
    for name in unknowns:
        if name not in (*VARIABLES, *parameters):
            raise InputError(f"no unknown {name!r}; there are {', '.join((*VARIABLES, *parameters))}")
        if name in given:
            raise InputError(f"{name} is both given and unknown")
    for name, value in given.items():
        if name not in (*VARIABLES, *_GIVEN, *parameters):
            raise InputError(f"no variable {name!r}; there are {', '.join((*VARIABLES, *_GIVEN, *parameters))}")
        if not math.isfinite(value):
            raise InputError(f"{name} is {value}, must be finite")
    for name in targets:
        if name not in OUTPUTS:
            raise InputError(f"no output {name!r} to aim at; there are {', '.join(OUTPUTS)}")
    missing = [name for name in ("speed", *parameters) if name not in given and name not in unknowns]
    if missing:
        raise InputError(f"{', '.join(missing)} must be given or unknown")
    if not given.get("speed", unknowns.get("speed", Unknown(1.0)).guess) > 0.0:
        raise InputError("the speed of a trim must be positive, also where it is guessed")
    equations = len(_ACCELERATIONS) + len(targets)
    if len(unknowns) > equations:
        raise InputError(f"{len(unknowns)} unknowns for {equations} equations: give some of {', '.join(unknowns)}")
    known = {name: 0.0 for name in (*VARIABLES, *_GIVEN) if name not in unknowns}
    return known | {name: float(value) for name, value in given.items()}


class _Problem:
    """The equations of one trim, compiled: unknowns and lag states in, residual and Jacobian out."""

    def __init__(
        self,
        dynamics: Dynamics,
        unknown: tuple[str, ...],
        known: Mapping[str, float],
        targets: Mapping[str, float],
        time: float,
    ) -> None:
        self.dynamics, self.unknown, self.known, self.targets, self.time = dynamics, unknown, known, targets, time
        lag_names = dynamics.state_names[len(RIGID_STATES) :]
        self.names = (*unknown, *lag_names)
        x = ca.SX.sym("x", len(self.names))
        values: dict[str, Any] = {name: ca.SX(value) for name, value in known.items()}
        values |= {name: x[i] for i, name in enumerate(unknown)}
        state = _state(values, x[len(unknown) :])
        parameters = ca.vertcat(ca.SX(0, 1), *(values[name] for name in dynamics.parameter_names))
        rate = dynamics.derivative(state, parameters, time)
        outputs = flight_outputs(dynamics, state, parameters, time)
        equations = [rate[3:6], rate[10:], *(outputs[name] - value for name, value in targets.items())]
        self.equation_names = (
            *(f"d{name}/dt" for name in (*_ACCELERATIONS, *lag_names)),
            *(f"{name} - {value:g}" for name, value in targets.items()),
        )
        residual = ca.densify(ca.vertcat(*equations))
        jacobian = ca.densify(ca.jacobian(residual, x))
        self._function = ca.Function("trim", [x], [residual, jacobian])
        every = ca.vertcat(*(ca.SX(outputs[name]) for name in OUTPUTS))
        self._describe = ca.Function("trim", [x], [state, parameters, every])

    def evaluate(self, x: Array) -> tuple[Array, Array]:
        residual, jacobian = self._function(x)
        return np.array(residual).ravel(), np.array(jacobian)

    def solve(self, unknowns: list[Unknown]) -> tuple[Array, Array, Array, Array]:
        """Unknowns with lag states, residual, Jacobian, and what round-off leaves of each equation."""
        from scipy.optimize import least_squares

        lags = len(self.names) - len(unknowns)
        low = np.array([u.low for u in unknowns] + [-math.inf] * lags)
        high = np.array([u.high for u in unknowns] + [math.inf] * lags)
        x = self._settle(np.array([u.guess for u in unknowns] + [0.0] * lags))
        start = np.clip(x, *_inside(low, high))
        residual, jacobian = self.evaluate(start)
        if not (np.all(np.isfinite(residual)) and np.all(np.isfinite(jacobian))):
            raise InputError("the equations of motion are not finite at the guesses of the trim")
        # rows of equal weight: what the largest change of one unknown by its own size does
        weight = 1.0 / np.maximum(np.max(np.abs(jacobian), axis=1, initial=0.0), 1.0)
        found = least_squares(
            lambda y: weight * self.evaluate(y)[0],
            start,
            jac=lambda y: weight[:, None] * self.evaluate(y)[1],
            bounds=(low, high),
            x_scale="jac",
            xtol=1e-15,
            ftol=1e-15,
            gtol=1e-15,
            max_nfev=500,
        )
        x = found.x
        residual, jacobian = self.evaluate(x)
        for _ in range(_NEWTON_STEPS):
            step = np.linalg.lstsq(weight[:, None] * jacobian, -weight * residual, rcond=1e-13)[0]
            trial = np.clip(x + step, low, high)
            after, slope = self.evaluate(trial)
            if not np.linalg.norm(weight * after) < np.linalg.norm(weight * residual):
                break
            x, residual, jacobian = trial, after, slope
        terms = np.max(np.abs(jacobian) * np.abs(x), axis=1, initial=0.0)
        return x, residual, jacobian, np.maximum(_SMALLEST, _ROUND_OFF * terms)

    def _settle(self, x: Array) -> Array:
        n = len(self.unknown)
        if n == x.size:
            return x
        residual, jacobian = self.evaluate(x)
        rows = slice(len(_ACCELERATIONS), len(_ACCELERATIONS) + x.size - n)
        x[n:] = np.linalg.lstsq(jacobian[rows, n:], -residual[rows], rcond=None)[0]
        return x

    def result(self, x: Array, residual: Array) -> Trim:
        state, parameters, outputs = (np.array(part).ravel() for part in self._describe(x))
        values = dict(self.known) | dict(zip(self.unknown, (float(v) for v in x), strict=False))
        return Trim(
            dynamics=self.dynamics,
            state=state,
            parameters=dict(zip(self.dynamics.parameter_names, (float(v) for v in parameters), strict=True)),
            variables={name: values[name] for name in (*VARIABLES, *_GIVEN)},
            found=self.unknown,
            targets=self.targets,
            residual=float(np.max(np.abs(residual))),
            outputs=dict(zip(OUTPUTS, (float(v) for v in outputs), strict=True)),
            time=self.time,
        )


def _inside(low: Array, high: Array) -> tuple[Array, Array]:
    """Bounds a little narrower: the solver wants to start inside."""
    room = 1e-6 * np.where(np.isfinite(high - low), high - low, 1.0)
    return low + room, high - room


def _check_determined(names: tuple[str, ...], jacobian: Array, unknowns: Mapping[str, Unknown]) -> None:
    if not names:
        return
    scale = np.linalg.norm(jacobian, axis=0)
    if np.any(scale == 0.0):
        raise InputError(f"{names[int(np.argmin(scale))]} has no effect on the equations of this trim: give it instead")
    _, singular, right = np.linalg.svd(jacobian / scale, full_matrices=False)
    if singular[-1] < _UNDETERMINED * singular[0]:
        share = np.abs(right[-1])
        among = [name for name, part in zip(names, share, strict=True) if part > 0.1 and name in unknowns]
        raise InputError(f"this trim does not tell {', '.join(among)} apart: give one of them")


def _no_trim(problem: _Problem, unknowns: Mapping[str, Unknown], x: Array, residual: Array, missed: Any) -> str:
    """What could not be met, and the nearest flight."""
    left = ", ".join(
        f"{name} = {value:.3g}"
        for name, value, out in zip(problem.equation_names, residual, missed, strict=True)
        if out
    )
    nearest = ", ".join(f"{name} = {value:.5g}" for name, value in zip(unknowns, x, strict=False))
    held = [
        f"{name} at its bound {value:.5g}"
        for (name, u), value in zip(unknowns.items(), x, strict=False)
        if min(abs(value - u.low), abs(u.high - value)) < 1e-6 * max(1.0, abs(value))
    ]
    return f"no such steady flight: {left} left at the nearest, {nearest}" + (f" ({', '.join(held)})" if held else "")


def _state(values: Mapping[str, Any], lag: Any) -> Any:
    """State vector of a steady flight."""
    speed, alpha, beta = values["speed"], values["alpha"], values["beta"]
    velocity = speed * ca.vertcat(ca.cos(alpha) * ca.cos(beta), ca.sin(beta), ca.sin(alpha) * ca.cos(beta))
    turns = (("heading", 2, 1.0), ("path_angle", 1, 1.0), ("bank", 0, 1.0), ("beta", 2, -1.0), ("alpha", 1, 1.0))
    quaternion = ca.SX([1.0, 0.0, 0.0, 0.0])
    for name, axis, sign in turns:
        quaternion = _turned(quaternion, sign * values[name], axis)
    beyond = ca.vertcat(values["roll_rate"], values["pitch_rate"], values["yaw_rate"])
    rate = values["turn_rate"] * vertical_in_body(quaternion) + beyond
    return ca.vertcat(0.0, 0.0, -values["altitude"], velocity, quaternion, rate, lag)


def _turned(quaternion: Any, angle: Any, axis: int) -> Any:
    """A quaternion followed by a turn about an axis of the turned frame."""
    scalar, vector = quaternion[0], quaternion[1:]
    c, s = ca.cos(angle / 2.0), ca.sin(angle / 2.0)
    about = ca.SX.zeros(3)
    about[axis] = s
    return ca.vertcat(scalar * c - ca.dot(vector, about), scalar * about + c * vector + ca.cross(vector, about))
