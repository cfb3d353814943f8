r"""One symbolic model of the motion of a rigid vehicle, for simulation, linearisation and identification.

State: position of the centre of gravity (earth axes), its velocity over the ground (body axes), attitude quaternion
body -> earth (scalar first), body rates, aerodynamic lag states.

    m (vdot + (omega + Omega) x v - omega x cdot) = F + m R^T g        I omegadot + omega x I omega = M + r x F
    xdot = R (v + cdot)            qdot = 1/2 q o (0, omega - Omega)

with F, M the aerodynamic loads about the moment reference point and r its arm from the centre of gravity; Omega the
rotation of the earth (body axes), omega the body's in inertial space, g with the centrifugal acceleration. The air
turns with the earth: the loads see omega - Omega, and the velocity less the wind.

c is where the centre of gravity is in the body, which changes while mass burns, and v the velocity of the body's point
that is there. Mass leaves with the velocity it has in the body, which takes no force; what throws it is a `Motor`.

The rotation matrix is built from ``q/|q|``, so the motion does not depend on the quaternion's norm; and since qdot is
linear in q, neither does any Runge-Kutta step. The norm may drift in the last digits and does no harm: no
renormalisation, no stabilising term.

Loads that depend on the rate of incidence do so on ``T = V d(v/V, w/V)/dt``, which is itself linear in the
accelerations, which are linear in T: ``T = T0 + J T`` is solved exactly, so alphadot derivatives are part of the
mass matrix and nothing is lagged.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.aerodynamics import AerodynamicLoads, Aerodynamics, FlowState
from indicial.flightsim.atmosphere import Air, Atmosphere, ConstantAtmosphere
from indicial.flightsim.compiled import Kernel, compile_function
from indicial.flightsim.earth import Earth, FlatEarth
from indicial.flightsim.expressions import CONDITIONS, TIME, free_symbols
from indicial.flightsim.forces import Force
from indicial.flightsim.initial import InitialState
from indicial.flightsim.signals import Schedule
from indicial.flightsim.vehicle import Vehicle
from indicial.flightsim.wind import Wind

POSITION, VELOCITY, QUATERNION, RATE = slice(0, 3), slice(3, 6), slice(6, 10), slice(10, 13)
RIGID_STATES = ("x", "y", "z", "u", "v", "w", "q0", "q1", "q2", "q3", "p", "q", "r")

_REST = 1e-9  # m/s; makes directions smooth at rest, below round-off of V from 0.1 m/s up

_MASS_PROPERTIES = ["mass", "centre_of_gravity", "inertia"]

_MAX_INNER_STEPS = 100_000  # of CVODES from one instant to the next


@dataclass(frozen=True)
class Dynamics:
    """The equations of motion of one vehicle with one aerodynamic model.

    Parameters
    ----------
    vehicle, aerodynamics, atmosphere, earth, wind
        What the model is made of.
    derivative : casadi.Function
        (state, parameters, time [s]) -> time derivative of the state.
    loads : casadi.Function
        (state, parameters, time) -> (aerodynamic force [N], its moment about the centre of gravity [N m], density
        [kg/m^3], speed of sound [m/s], wind [m/s]), body axes.
    altitude : casadi.Function
        state -> geometric altitude [m].
    monitor : casadi.Function
        (state, parameters, time) -> what ends are asked of: x [m], altitude [m], climb rate [m/s].
    mass_properties : casadi.Function
        (parameters, time) -> (mass [kg], centre of gravity in mesh axes [m], inertia [kg m^2]).
    state_names, parameter_names : tuple of str
        Parameters are the free symbols of the aerodynamic model in its order, then those of the vehicle, then others.
    """

    vehicle: Vehicle
    aerodynamics: Aerodynamics
    atmosphere: Atmosphere
    earth: Earth
    wind: Wind | None
    derivative: Any
    loads: Any
    altitude: Any
    monitor: Any
    mass_properties: Any
    state_names: tuple[str, ...]
    parameter_names: tuple[str, ...]

    @functools.cached_property
    def time_dependent(self) -> bool:
        """Whether the equations hold time itself: controls, gusts, burning propellant."""
        return bool(self.derivative.jac_sparsity(0, 2).nnz() > 0)

    @functools.cached_property
    def rate_kernel(self) -> Kernel:
        """`derivative` as machine code."""
        return compile_function(self.derivative)

    @functools.cached_property
    def monitor_kernel(self) -> Kernel:
        """`monitor` as machine code."""
        return compile_function(self.monitor)

    @functools.cached_property
    def _jacobian(self) -> Any:
        return self.derivative.jacobian()

    def jacobian(self, state: ArrayLike, parameters: ArrayLike = (), time: float = 0.0) -> Array:
        """Exact derivative of the rate of change with respect to the state, shape (nx, nx)."""
        matrix: Array = np.array(self._jacobian(state, parameters, time, 0)[0])
        return matrix

    def rate(self, state: ArrayLike, parameters: ArrayLike = (), time: float = 0.0) -> Array:
        """Time derivative of a state, shape (nx,)."""
        change: Array = np.array(self.derivative(state, parameters, time)).ravel()
        return change

    @property
    def lag_states(self) -> int:
        """Number of aerodynamic lag states."""
        return len(self.state_names) - len(RIGID_STATES)

    def parameter_vector(self, parameters: Mapping[str, float] | None = None) -> Array:
        """Values of the parameters in their order, shape (n,).

        Raises
        ------
        InputError
            If one is missing, unknown or not finite.
        """
        return Schedule.of(self.parameter_names, parameters).at(0.0)[:, 0]

    def initial_vector(self, initial: InitialState, parameters: ArrayLike = ()) -> Array:
        """State vector of an initial state, its lag states settled if they are not given.

        Settled means ``lag_rate = 0`` at the initial incidence and rates; at rest, where reduced time stands still,
        lag states start at 0.

        Raises
        ------
        InputError
            If the number of lag states is not the model's.
        """
        lag: Array = np.zeros(self.lag_states) if initial.lag is None else initial.lag
        if lag.shape != (self.lag_states,):
            raise InputError(f"initial state has {lag.size} lag states, the aerodynamic model {self.lag_states}")
        state = np.concatenate([initial.position, initial.velocity, initial.quaternion, initial.rate, lag])
        if initial.lag is None and self.lag_states and np.any(initial.velocity):
            jacobian, forcing = self.jacobian(state, parameters), self.rate(state, parameters)
            state[13:] = -np.linalg.solve(jacobian[13:, 13:], forcing[13:])
        return state

    def step(self) -> Any:
        """Classical fourth-order Runge-Kutta step: casadi.Function (state, parameters, step [s]) -> state.

        Raises
        ------
        InputError
            If the equations hold time itself.
        """
        self._without_time("a step in CasADi")
        state, parameters = (
            ca.SX.sym("state", len(self.state_names)),
            ca.SX.sym("parameters", len(self.parameter_names)),
        )
        length = ca.SX.sym("step")
        after = _runge_kutta(lambda y: self.derivative(y, parameters, 0.0), state, length)
        return ca.Function("step", [state, parameters, length], [after], ["state", "parameters", "step"], ["after"])

    def step_in_distance(self) -> Any:
        """The step with downrange distance x as independent variable, time appended to the state.

        casadi.Function ((state, time), parameters, step [m]) -> (state, time): stations of a range are grid points, so
        nothing has to be interpolated. Needs flight in the direction of x.
        """
        state, time = ca.SX.sym("state", len(self.state_names)), ca.SX.sym("time")
        parameters, length = ca.SX.sym("parameters", len(self.parameter_names)), ca.SX.sym("step")

        def per_distance(y: Any) -> Any:
            rate = self.derivative(y[:-1], parameters, y[-1])
            return ca.vertcat(rate, 1.0) / rate[0]

        after = _runge_kutta(per_distance, ca.vertcat(state, time), length)
        names = ["state", "parameters", "step"]
        return ca.Function("step", [ca.vertcat(state, time), parameters, length], [after], names, ["after"])

    def march(self, steps: int) -> Any:
        """`step` taken `steps` times: (state, parameters, step lengths (1, n)) -> states after each (nx, n)."""
        return repeat(self.step(), steps)

    def stiff_march(self, instants: int, tolerance: float) -> Any:
        """CVODES over evenly spaced instants, for lag states far faster than the motion.

        casadi.Function (state, parameters, spacing [s]) -> states at each instant (nx, n). Backward differentiation of
        order 1 to 5 with steps chosen by the relative `tolerance` (absolute: a hundredth of it) and the exact sparse
        Jacobian. Source: Hindmarsh et al., ACM Trans. Math. Softw. 31 (2005) 363.

        Raises
        ------
        InputError
            If the equations hold time itself.
        """
        self._without_time("CVODES")
        state, parameters = (
            ca.SX.sym("state", len(self.state_names)),
            ca.SX.sym("parameters", len(self.parameter_names)),
        )
        spacing = ca.SX.sym("spacing")
        # One instant to the next is one unit of its time, so that one integrator serves every spacing.
        values = ca.vertcat(parameters, spacing)
        problem = {"x": state, "p": values, "ode": spacing * self.derivative(state, parameters, 0.0)}
        options = {
            "reltol": tolerance,
            "abstol": 0.01 * tolerance,
            "max_num_steps": _MAX_INNER_STEPS,
            "disable_internal_warnings": True,
            "show_eval_warnings": False,
        }
        integrator = ca.integrator("stiff_march", "cvodes", problem, 0.0, list(range(1, instants + 1)), options)
        first, given = ca.MX.sym("state", len(self.state_names)), ca.MX.sym("parameters", len(self.parameter_names))
        distance = ca.MX.sym("spacing")
        states = integrator(x0=first, p=ca.vertcat(given, distance))["xf"]
        return ca.Function("march", [first, given, distance], [states], ["state", "parameters", "spacing"], ["states"])

    def march_in_distance(self, steps: int) -> Any:
        """`step_in_distance` taken `steps` times; the last row of the result is time [s]."""
        return repeat(self.step_in_distance(), steps)

    def _without_time(self, what: str) -> None:
        if self.time_dependent:
            raise InputError(f"{what} does not take a model that depends on time; 'rk4' and 'dop853' do")


def repeat(step: Any, steps: int) -> Any:
    """A step function taken `steps` times in one casadi.Function with one parameter vector."""
    state, parameters = ca.MX.sym("state", step.size1_in(0)), ca.MX.sym("parameters", step.size1_in(1))
    lengths = ca.MX.sym("steps", 1, steps)
    states = step.mapaccum("march", steps)(state, ca.repmat(parameters, 1, steps), lengths)
    names = ["state", "parameters", "steps"]
    return ca.Function("march", [state, parameters, lengths], [states], names, ["states"])


def _runge_kutta(derivative: Any, state: Any, step: Any) -> Any:
    k1 = derivative(state)
    k2 = derivative(state + step / 2.0 * k1)
    k3 = derivative(state + step / 2.0 * k2)
    k4 = derivative(state + step * k3)
    return state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def build_dynamics(
    vehicle: Vehicle,
    aerodynamics: Aerodynamics,
    atmosphere: Atmosphere | None = None,
    earth: Earth | None = None,
    wind: Wind | None = None,
    forces: Sequence[Force] = (),
) -> Dynamics:
    """The equations of motion as casadi functions of state and parameters.

    Parameters
    ----------
    vehicle : Vehicle
    aerodynamics : Aerodynamics
        Its loads, about its own moment reference point, are transferred to the centre of gravity exactly.
    atmosphere : Atmosphere, optional
        `ConstantAtmosphere` at 20 C and 1 atm if not given.
    earth : Earth, optional
        `FlatEarth` if not given.
    wind : Wind, optional
        Still air if not given.
    forces : sequence of Force
        Motors and the like.

    Raises
    ------
    InputError
        If the vehicle and the aerodynamic model differ in reference length or area, or two symbols share a name.
    """
    _check_reference(vehicle, aerodynamics)
    atmosphere = ConstantAtmosphere() if atmosphere is None else atmosphere
    earth = FlatEarth() if earth is None else earth
    state = ca.SX.sym("state", len(RIGID_STATES) + len(aerodynamics.lag_names))
    position, velocity, quaternion, rate = state[POSITION], state[VELOCITY], state[QUATERNION], state[RATE]
    lag = state[len(RIGID_STATES) :]

    rotation = rotation_matrix(quaternion)
    altitude = earth.altitude(position)
    air = atmosphere.air(altitude)
    turning = ca.SX.sym("turning", 2)
    earth_rate = ca.mtimes(rotation.T, ca.sparsify(ca.DM(earth.rotation)))
    relative = rate - earth_rate
    over_ground = ca.mtimes(rotation, velocity + _drift(vehicle))
    motion = _Motion(position, quaternion, over_ground, _quaternion_rate(quaternion, relative))
    blowing, wind_rate, air_turning = _wind(wind, motion, altitude, rotation)
    arm = vehicle.arm_to(aerodynamics.reference.moment_reference)
    through_air = velocity + ca.cross(relative, arm) - blowing
    flow = _flow(air, through_air, relative - air_turning, turning, rate)
    load, about_point = aerodynamics.loads(flow, lag)
    aerodynamic = AerodynamicLoads(load, about_point + ca.cross(arm, load))
    here = _flow(air, velocity - blowing, relative - air_turning, turning, rate)
    acting = [aerodynamic, *(force.loads(here, vehicle) for force in forces)]
    force, moment = (_sum(part) for part in zip(*acting, strict=True))

    inertia = ca.sparsify(ca.SX(vehicle.inertia))
    gravity = ca.mtimes(rotation.T, earth.gravity(position))
    acceleration = (
        force / vehicle.mass + gravity - ca.cross(rate + earth_rate, velocity) + ca.cross(rate, _drift(vehicle))
    )
    turn_rate = ca.mtimes(_inverse(vehicle.inertia), moment - ca.cross(rate, ca.mtimes(inertia, rate)))
    relative_turn_rate = turn_rate + ca.cross(relative, earth_rate)
    # of the moment reference point through the air: what the centre of gravity drifts, the arm loses
    quickening = acceleration - ca.cross(relative, _drift(vehicle)) + ca.cross(relative_turn_rate, arm) - wind_rate

    solution = _solve_turning(turning, flow, through_air, quickening)
    derivative = ca.vertcat(
        over_ground, acceleration, motion.quaternion_rate, turn_rate, aerodynamics.lag_rate(flow, lag)
    )
    found = [derivative, *aerodynamic]
    found = ca.substitute(found, [turning], [solution])
    monitor = ca.vertcat(position[0], altitude, ca.jtimes(altitude, position, over_ground))
    outputs = [*found, flow.density, flow.speed_of_sound, blowing, monitor, altitude, *_mass_properties(vehicle)]
    outputs = ca.substitute([ca.densify(o) for o in outputs], list(CONDITIONS), _conditions(flow, altitude))
    symbols = _parameters(aerodynamics, vehicle, state, outputs)
    inputs, names = [state, ca.vertcat(ca.SX(0, 1), *symbols), TIME], ["state", "parameters", "time"]
    derivative, *loads, monitor, altitude, mass, centre, tensor = outputs
    return Dynamics(
        vehicle=vehicle,
        aerodynamics=aerodynamics,
        atmosphere=atmosphere,
        earth=earth,
        wind=wind,
        derivative=ca.Function("derivative", inputs, [derivative], names, ["derivative"]),
        loads=ca.Function("loads", inputs, loads, names, ["force", "moment", "rho", "a", "wind"]),
        altitude=ca.Function("altitude", [state], [altitude], ["state"], ["altitude"]),
        monitor=ca.Function("monitor", inputs, [monitor], names, ["monitored"]),
        mass_properties=ca.Function("mass_properties", inputs[1:], [mass, centre, tensor], names[1:], _MASS_PROPERTIES),
        state_names=(*RIGID_STATES, *aerodynamics.lag_names),
        parameter_names=tuple(symbol.name() for symbol in symbols),
    )


class _Motion(NamedTuple):
    """Where the vehicle is and how that changes."""

    position: Any
    quaternion: Any
    position_rate: Any
    quaternion_rate: Any


def _wind(wind: Wind | None, motion: _Motion, altitude: Any, rotation: Any) -> tuple[Any, Any, Any]:
    """Velocity of the air in body axes, its rate of change there, and its turning rate."""
    if wind is None:
        return ca.SX.zeros(3), ca.SX.zeros(3), ca.SX.zeros(3)
    blowing = ca.mtimes(rotation.T, wind.velocity(motion.position, altitude))
    turning = wind.rotation(motion.position, altitude)
    change = (
        ca.jtimes(blowing, motion.position, motion.position_rate)
        + ca.jtimes(blowing, motion.quaternion, motion.quaternion_rate)
        + ca.jacobian(blowing, TIME)
    )
    return blowing, change, ca.SX.zeros(3) if turning is None else ca.mtimes(rotation.T, turning)


def _drift(vehicle: Vehicle) -> Any:
    """Velocity of the centre of gravity in the body as mass burns, body axes [m/s]."""
    return -ca.jacobian(vehicle.arm_to((0.0, 0.0, 0.0)), TIME)


def _conditions(flow: FlowState, altitude: Any) -> list[Any]:
    """What stands for each of `CONDITIONS`."""
    u, v, w = ca.vertsplit(flow.velocity)
    across = ca.sqrt(v * v + w * w + _REST**2)
    # at rest angles are 0, and their slopes finite
    angles = [ca.atan2(w, u + _REST), ca.asin(v / flow.speed), ca.atan2(across, u + _REST)]
    return [altitude, flow.speed / flow.speed_of_sound, *angles]


def _inverse(inertia: Any) -> Any:
    if isinstance(inertia, ca.SX):
        return ca.inv_minor(inertia)
    return ca.sparsify(ca.DM(np.linalg.inv(inertia)))


def _mass_properties(vehicle: Vehicle) -> tuple[Any, Any, Any]:
    return ca.SX(vehicle.mass), ca.vertcat(*(ca.SX(c) for c in vehicle.centre_of_gravity)), ca.SX(vehicle.inertia)


def _parameters(aerodynamics: Aerodynamics, vehicle: Vehicle, state: Any, outputs: list[Any]) -> tuple[Any, ...]:
    """Free symbols: those of the aerodynamic model, of the vehicle, then of all else."""
    own = {symbol.name() for symbol in ca.symvar(state)}
    rest = (symbol for symbol in ca.symvar(ca.veccat(*outputs)) if symbol.name() not in own)
    return free_symbols((*aerodynamics.parameters, *vehicle.parameters, *rest))


def _sum(vectors: Iterable[Any]) -> Any:
    first, *others = vectors
    for other in others:
        first = first + other
    return first


def _check_reference(vehicle: Vehicle, aerodynamics: Aerodynamics) -> None:
    for name in ("length", "area"):
        own, model = getattr(vehicle.reference, name), getattr(aerodynamics.reference, name)
        if abs(model - own) > 1e-6 * own:
            raise InputError(f"reference {name} of the aerodynamic model is {model:g}, of {vehicle.name} {own:g}")


def _flow(air: Air, velocity: Any, rate: Any, turning: Any, inertial: Any) -> FlowState:
    speed = ca.sqrt(ca.sumsqr(velocity) + _REST**2)
    return FlowState(air.density, air.speed_of_sound, speed, velocity[1:] / speed, rate, turning, velocity, inertial)


def _solve_turning(turning: Any, flow: FlowState, velocity: Any, acceleration: Any) -> Any:
    """The T with ``T = T(accelerations(T))``, for accelerations of the moment reference point linear in T."""
    direction = velocity / flow.speed
    # V de/dt = (e.e) a - e (e.a): nothing at rest, where e = 0
    implied = (ca.sumsqr(direction) * acceleration - direction * ca.dot(direction, acceleration))[1:]
    slope = ca.jacobian(implied, turning)
    constant = ca.substitute(implied, turning, ca.DM.zeros(2, 1))
    if slope.nnz() == 0:
        return constant
    return ca.mtimes(ca.inv_minor(ca.densify(ca.DM.eye(2) - slope)), constant)


def rotation_matrix(quaternion: Any) -> Any:
    """Rotation matrix body -> earth of a quaternion of any norm."""
    w, x, y, z = ca.vertsplit(quaternion)
    scale = 2.0 / ca.sumsqr(quaternion)
    return ca.vertcat(
        ca.horzcat(1 - scale * (y * y + z * z), scale * (x * y - w * z), scale * (x * z + w * y)),
        ca.horzcat(scale * (x * y + w * z), 1 - scale * (x * x + z * z), scale * (y * z - w * x)),
        ca.horzcat(scale * (x * z - w * y), scale * (y * z + w * x), 1 - scale * (x * x + y * y)),
    )


def _quaternion_rate(quaternion: Any, rate: Any) -> Any:
    w, x, y, z = ca.vertsplit(quaternion)
    p, q, r = ca.vertsplit(rate)
    return 0.5 * ca.vertcat(-x * p - y * q - z * r, w * p + y * r - z * q, w * q - x * r + z * p, w * r + x * q - y * p)
