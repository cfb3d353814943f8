r"""Forces besides the aerodynamic ones: a motor, and whatever a user writes down.

A force acts on the vehicle by an expression of the flow, of `indicial.flightsim.expressions` and of symbols of its own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import casadi as ca
import numpy as np

from indicial.errors import InputError
from indicial.flightsim.aerodynamics import AerodynamicLoads, FlowState
from indicial.flightsim.expressions import TIME
from indicial.flightsim.vehicle import Vehicle


class Force(Protocol):
    """Force [N] and moment about the centre of gravity [N m], body axes."""

    def loads(self, flow: FlowState, vehicle: Vehicle) -> AerodynamicLoads:
        """Casadi expressions (3, 1)."""
        ...


@dataclass(frozen=True)
class Motor:
    r"""Thrust along a line through the nozzle, and the damping of its jet.

    The mass that leaves takes the angular momentum it has at the nozzle; what it lacked of it inside, it takes from
    the body. With ``mu = -dm/dt`` and the nozzle's arm r_n from the centre of gravity,

        M = r_n x T - [ mu r_n x (omega x r_n) + (dI/dt) omega ]

    (Thomson, Introduction to Space Dynamics (1961), sec. 7.10). Mass and inertia are those of the vehicle, as they
    depend on `TIME`; a vehicle that does not burn has no jet damping.

    Parameters
    ----------
    thrust : float or casadi expression
        [N], for instance ``table(TIME, times, thrusts)`` or a symbol.
    nozzle : tuple of float
        Mesh axes [m]: (x, y, z) from the nose, x aft.
    direction : tuple of float
        Of the thrust, body axes; forward by default.
    """

    thrust: Any
    nozzle: tuple[float, float, float]
    direction: tuple[float, float, float] = (1.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not np.all(np.isfinite(self.nozzle)) or not np.linalg.norm(self.direction) > 0.0:
            raise InputError("a motor needs a finite nozzle position and a direction that is not zero")

    def loads(self, flow: FlowState, vehicle: Vehicle) -> AerodynamicLoads:
        """Thrust, its moment, and jet damping."""
        direction = np.asarray(self.direction, dtype=float)
        force = ca.SX(self.thrust) * ca.DM(direction / np.linalg.norm(direction))
        arm, rate = vehicle.arm_to(self.nozzle), flow.inertial_rate
        flow_out = -ca.jacobian(ca.SX(vehicle.mass), TIME)
        inertia_rate = ca.reshape(ca.jacobian(ca.vec(ca.SX(vehicle.inertia)), TIME), 3, 3)
        damping = flow_out * ca.cross(arm, ca.cross(rate, arm)) + ca.mtimes(inertia_rate, rate)
        return AerodynamicLoads(force, ca.cross(arm, force) - damping)


@dataclass(frozen=True)
class FunctionForce:
    """A force that a function of the flow gives.

    Parameters
    ----------
    function : callable
        From `FlowState` to (force [N], moment about the centre of gravity [N m]), body axes, each of three numbers or
        casadi expressions. It is called once, with expressions: use casadi's functions, and no branches.
    """

    function: Callable[[FlowState], tuple[Any, Any]]

    def loads(self, flow: FlowState, vehicle: Vehicle) -> AerodynamicLoads:
        """What the function gives."""
        del vehicle
        force, moment = (ca.vertcat(*(ca.SX(v) for v in _three(part))) for part in self.function(flow))
        return AerodynamicLoads(force, moment)


def _three(vector: Any) -> list[Any]:
    parts = ca.vertsplit(vector) if isinstance(vector, ca.SX | ca.DM) else list(vector)
    if len(parts) != 3:
        raise InputError(f"a force function must give two vectors of three components, one of them has {len(parts)}")
    return parts
