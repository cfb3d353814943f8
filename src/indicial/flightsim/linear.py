r"""The exact linear model of small motions about a steady flight, for modes and for control design.

A steady flight is a helix about the vertical (`indicial.flightsim.trim`): velocity, rates, lag states and the downward
unit vector n are constant in body axes, ``omega0 = Omega n``. A small rotation ``dtheta`` of the body (body axes) obeys

    d(dtheta)/dt = d(omega) - omega0 x dtheta,      dn = n x dtheta.

Its part along n turns the heading: it changes no load and, as ``omega0 x n = 0``, no other rate, so it integrates and
feeds nothing back. Left is ``dtheta = L (dphi, dtheta)``, ``L = [e_x, (0, cos(phi), -sin(phi))]``, with P that of
``P L = I, P n = 0``:

    d(dphi, dtheta)/dt = P (d(omega) - omega0 x L (dphi, dtheta)),      dq = q0 o (0, L (dphi, dtheta))/2.

No term is neglected and no small angle assumed of the steady flight. Where the nose is vertical, and Euler angles
are not, the states are the tilts about the body's y and z axes instead.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.attitude import matrix_from_quaternion
from indicial.flightsim.dynamics import QUATERNION, RATE, RIGID_STATES, VELOCITY, Dynamics
from indicial.flightsim.outputs import OUTPUTS, flight_outputs
from indicial.flightsim.trim import Trim

if TYPE_CHECKING:
    from control import StateSpace

LINEAR_OUTPUTS = ("V", "alpha", "q", "theta", "beta", "p", "r", "phi")
"""Outputs of a linear model if none are named."""

_VERTICAL = 1e-6  # cosine of the pitch angle below which Euler angles are not used
_PATH = ("V", "alpha", "beta")
_BODY_RATES = ("p", "q", "r")
_DOWN = RIGID_STATES.index("z")


@dataclass(frozen=True)
class LinearFlight:
    """``dx/dt = a x + b u``, ``y = c x + d u``: small changes from a steady flight, exact to first order.

    Parameters
    ----------
    a, b, c, d : ndarray
        Shapes (n, n), (n, nu), (ny, n), (ny, nu), of states, controls and outputs in SI units and radians.
    states : tuple of str
        V, alpha, q, theta, beta, p, r, phi; then altitude, if it was asked for, and the lag states. With the nose
        vertical tilt_y and tilt_z stand for theta and phi.
    controls, outputs : tuple of str
    trim : Trim
        The steady flight.
    """

    a: Array
    b: Array
    c: Array
    d: Array
    states: tuple[str, ...]
    controls: tuple[str, ...]
    outputs: tuple[str, ...]
    trim: Trim

    @property
    def lag_states(self) -> tuple[str, ...]:
        """Names of the aerodynamic lag states."""
        return self.trim.dynamics.state_names[len(RIGID_STATES) :]

    def to_control(self) -> StateSpace:
        """The model with its names for `control`: Bode plots, step responses, control design.

        Raises
        ------
        InputError
            If it has no controls.
        """
        if not self.controls:
            raise InputError("this linear model has no controls: name some of the model's parameters as controls")
        import control

        names = {"states": list(self.states), "inputs": list(self.controls), "outputs": list(self.outputs)}
        return control.ss(self.a, self.b, self.c, self.d, **names)

    def summary(self) -> str:
        """What it is about, its names and its eigenvalues."""
        v = self.trim.variables
        values = sorted(np.linalg.eigvals(self.a), key=lambda value: (value.real, abs(value.imag)))
        return "\n".join(
            [
                f"linear model of {self.trim.dynamics.vehicle.name} about {v['speed']:.5g} m/s, {v['altitude']:.6g} m",
                f"  states    {', '.join(self.states)}",
                f"  controls  {', '.join(self.controls) or 'none'}",
                f"  outputs   {', '.join(self.outputs)}",
                f"  eigenvalues [1/s]  {', '.join(_eigenvalue(value) for value in values if value.imag >= 0.0)}",
            ]
        )


def linear_flight(
    trim: Trim, *, controls: Iterable[str] = (), outputs: Iterable[str] | None = None, altitude: bool = False
) -> LinearFlight:
    """Linear model of small motions about a steady flight.

    Parameters
    ----------
    trim : Trim
        A model that depends on time is taken as it is at the time of the trim.
    controls : sequence of str
        Parameters of the model (its free symbols), the inputs u.
    outputs : sequence of str, optional
        Of `indicial.flightsim.outputs.OUTPUTS`; `LINEAR_OUTPUTS` if not given (without theta and phi if the nose
        is vertical).
    altitude : bool
        Keep altitude [m] as a state, so that the air's density changes with it. Without, the air is as at the trim.

    Raises
    ------
    InputError
        If the flight lasts only an instant (rates beyond those of the turn), names are unknown or there twice, or an
        output is not differentiable there or needs the altitude that is left out.
    """
    if not trim.is_steady:
        raise InputError(
            "a linear model needs a steady flight: this trim, with rates beyond its turn, lasts an instant"
        )
    u, _, w = trim.state[VELOCITY]
    if math.hypot(u, w) < 1e-9 * trim.variables["speed"]:
        raise InputError("a linear model in alpha and beta needs beta other than 90 deg")
    dynamics = trim.dynamics
    inputs = _checked("control", tuple(controls), dynamics.parameter_names)
    lift, attitude = _attitude(trim.state)
    if outputs is None:
        outputs = [name for name in LINEAR_OUTPUTS if name not in ("theta", "phi") or "phi" in attitude]
    measured = _checked("output", tuple(outputs), OUTPUTS)
    if "altitude" in measured and not altitude:
        raise InputError("the output altitude needs altitude among the states: altitude=True")
    states = _state_names(dynamics, attitude, altitude)
    tangent = _tangent(trim.state, states, lift, attitude)
    jacobian, sensitivity = _rate_derivatives(trim)
    by_output, by_parameter = _output_derivatives(trim, measured)
    columns = [dynamics.parameter_names.index(name) for name in inputs]
    model = LinearFlight(
        a=_rows(trim.state, states, jacobian @ tangent, lift, attitude, tangent),
        b=_rows(trim.state, states, sensitivity[:, columns], lift, attitude, None),
        c=by_output @ tangent,
        d=by_parameter[:, columns],
        states=states,
        controls=inputs,
        outputs=measured,
        trim=trim,
    )
    for name, row in zip(measured, np.hstack([model.c, model.d]), strict=True):
        if not np.all(np.isfinite(row)):
            raise InputError(f"the output {name} has no derivative in this flight: leave it out")
    return model


def matrix_derivatives(linear: LinearFlight, parameters: Iterable[str]) -> Array:
    """Exact derivatives of `LinearFlight.a` by parameters of the model, shape (n_parameters, n, n).

    The steady flight itself is held: right for what does not act in it, such as derivatives in stability axes.
    """
    dynamics, state = linear.trim.dynamics, linear.trim.state
    names = _checked("parameter", tuple(parameters), dynamics.parameter_names)
    lift, attitude = _attitude(state)
    tangent = _tangent(state, linear.states, lift, attitude)
    x, p = ca.SX.sym("state", state.size), ca.SX.sym("parameters", len(dynamics.parameter_names))
    jacobian = ca.densify(ca.jacobian(dynamics.derivative(x, p, linear.trim.time), x))
    columns = [dynamics.parameter_names.index(name) for name in names]
    slopes = ca.Function("slopes", [x, p], [ca.jacobian(ca.vec(jacobian), p)[:, columns]])
    values = np.array(slopes(state, linear.trim.parameter_vector))
    n = state.size
    return np.array(
        [
            _rows(state, linear.states, values[:, j].reshape((n, n), order="F") @ tangent, lift, attitude, None)
            for j in range(len(names))
        ]
    ).reshape(len(names), *linear.a.shape)


def _checked(kind: str, names: tuple[str, ...], known: tuple[str, ...]) -> tuple[str, ...]:
    for name in names:
        if name not in known:
            raise InputError(f"no {kind} {name!r}; there are {', '.join(known) or 'none'}")
    if kind == "output" and not names:
        raise InputError(f"a linear model needs an output; there are {', '.join(known)}")
    if len(set(names)) < len(names):
        raise InputError(f"a {kind} is named twice: {', '.join(names)}")
    return names


def _state_names(dynamics: Dynamics, attitude: tuple[str, str], altitude: bool) -> tuple[str, ...]:
    sideways, upwards = attitude
    flight = ("V", "alpha", "q", upwards, "beta", "p", "r", sideways, *(("altitude",) if altitude else ()))
    return (*flight, *dynamics.state_names[len(RIGID_STATES) :])


def _attitude(state: Array) -> tuple[Array, tuple[str, str]]:
    """L (3, 2) and the names of its columns."""
    down = matrix_from_quaternion(state[QUATERNION])[2]
    horizontal = math.hypot(down[1], down[2])  # cosine of the pitch angle
    if horizontal < _VERTICAL:
        return np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]), ("tilt_z", "tilt_y")
    lift = np.array([[1.0, 0.0], [0.0, down[2] / horizontal], [0.0, -down[1] / horizontal]])
    return lift, ("phi", "theta")


def _tangent(state: Array, states: tuple[str, ...], lift: Array, attitude: tuple[str, str]) -> Array:
    """Derivative of the whole state with respect to those kept, shape (nx, n)."""
    full = np.zeros((state.size, len(states)))
    at = states.index
    full[VELOCITY, [at(name) for name in _PATH]] = np.linalg.inv(_path_derivative(state[VELOCITY]))
    full[RATE, [at(name) for name in _BODY_RATES]] = np.eye(3)
    scalar, x, y, z = state[QUATERNION]
    turned = 0.5 * np.array([[-x, -y, -z], [scalar, -z, y], [z, scalar, -x], [-y, x, scalar]])
    full[QUATERNION, [at(name) for name in attitude]] = turned @ lift
    if "altitude" in states:
        full[_DOWN, at("altitude")] = -1.0
    lags = state.size - len(RIGID_STATES)
    full[len(RIGID_STATES) :, len(states) - lags :] = np.eye(lags)
    return full


def _rows(
    state: Array,
    states: tuple[str, ...],
    rates: Array,
    lift: Array,
    attitude: tuple[str, str],
    tangent: Array | None,
) -> Array:
    """Rates of the states kept, of those of the whole state (nx, m); without `tangent` attitude and rates are held."""
    kept = np.zeros((len(states), rates.shape[1]))
    at = states.index
    kept[[at(name) for name in _PATH]] = _path_derivative(state[VELOCITY]) @ rates[VELOCITY]
    kept[[at(name) for name in _BODY_RATES]] = rates[RATE]
    if "altitude" in states:
        kept[at("altitude")] = -rates[_DOWN]
    lags = state.size - len(RIGID_STATES)
    kept[len(states) - lags :] = rates[len(RIGID_STATES) :]
    if tangent is not None:
        down = matrix_from_quaternion(state[QUATERNION])[2]
        projection = np.linalg.inv(np.column_stack([lift, down]))[:2]
        change = tangent[RATE].copy()
        change[:, [at(name) for name in attitude]] -= np.cross(state[RATE], lift, axisb=0, axisc=0)
        kept[[at(name) for name in attitude]] = projection @ change
    return kept


def _path_derivative(velocity: Array) -> Array:
    """d(V, alpha, beta)/d(u, v, w)."""
    u, v, w = velocity
    speed, across = float(np.linalg.norm(velocity)), math.hypot(u, w)
    by_beta = [-u * v / (speed**2 * across), across / speed**2, -w * v / (speed**2 * across)]
    return np.array([velocity / speed, [-w / across**2, 0.0, u / across**2], by_beta])


def _rate_derivatives(trim: Trim) -> tuple[Array, Array]:
    """Of the rates of the whole state, with respect to state and parameters."""
    return _evaluated(trim, lambda x, p: trim.dynamics.derivative(x, p, trim.time))


def _output_derivatives(trim: Trim, names: tuple[str, ...]) -> tuple[Array, Array]:
    def outputs(state: Any, parameters: Any) -> Any:
        values = flight_outputs(trim.dynamics, state, parameters, trim.time)
        return ca.vertcat(*(values[name] for name in names))

    return _evaluated(trim, outputs)


def _evaluated(trim: Trim, expression: Any) -> tuple[Array, Array]:
    dynamics = trim.dynamics
    state = ca.SX.sym("state", len(dynamics.state_names))
    parameters = ca.SX.sym("parameters", len(dynamics.parameter_names))
    value = ca.densify(expression(state, parameters))
    function = ca.Function("d", [state, parameters], [ca.jacobian(value, state), ca.jacobian(value, parameters)])
    by_state, by_parameter = function(trim.state, trim.parameter_vector)
    return np.array(by_state), np.array(by_parameter).reshape(value.shape[0], len(dynamics.parameter_names))


def _eigenvalue(value: complex) -> str:
    return f"{value.real:.5g}" if value.imag == 0.0 else f"{value.real:.5g} +/- {value.imag:.5g}i"
