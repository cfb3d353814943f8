r"""Aerodynamic coefficients and regressors of a flight record, sample by sample.

    (CX, CY, CZ) = (m a - T)/(qbar S)
    (Cl, Cm, Cn) = (I omegadot + omega x I omega - r x (m a - T))/(qbar S (l, c, l))

with specific force a at the centre of gravity, thrust T along x through it and r from it to the moment reference point;
``CA = -CX``, ``CN = -CZ``. Klein & Morelli, "Aircraft System Identification" (2006), sec. 3.4 and 5.1.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array, ReferenceQuantities
from indicial.errors import InputError
from indicial.flightsim import Vehicle
from indicial.flightsim.expressions import is_number
from indicial.identification.differentiation import differentiate
from indicial.identification.record import FlightRecord

FORCES = {"CX": (0, 1.0), "CY": (1, 1.0), "CZ": (2, 1.0), "CA": (0, -1.0), "CN": (2, -1.0)}
MOMENTS = {"Cl": 0, "Cm": 1, "Cn": 2}
_RATES = {"p": 0, "q": 1, "r": 2, "alphadot": 1, "betadot": 2}


def aerodynamic_coefficient(record: FlightRecord, vehicle: Vehicle, name: str, *, thrust: ArrayLike = 0.0) -> Array:
    """One of CX CY CZ CA CN Cl Cm Cn (body axes, about the vehicle's moment reference), NaN where unknown, (n,).

    Angular accelerations are the channels ``pdot qdot rdot`` if the record has all three, else slopes of ``p q r`` by
    `differentiate`.

    Parameters
    ----------
    record : FlightRecord
        With `dynamic_pressure`; ``ax``, ``ay`` or ``az`` for a force; ``p q r`` for a moment, and ``ax ay az`` if the
        moment reference is not the centre of gravity.
    vehicle : Vehicle
        With mass, inertia and centre of gravity in numbers.
    name : str
    thrust : array_like
        Force along x through the centre of gravity, besides the aerodynamic one [N], scalar or (n,).

    Raises
    ------
    InputError
        If the name is not known, a channel is lacking or dead, the accelerometers were elsewhere, or the vehicle is
        not in numbers.
    """
    if name not in FORCES and name not in MOMENTS:
        raise InputError(f"aerodynamic coefficient {name!r} is none of {', '.join((*FORCES, *MOMENTS))}")
    if not all(is_number(v) for v in (vehicle.mass, *vehicle.centre_of_gravity)) or not isinstance(
        vehicle.inertia, np.ndarray
    ):
        raise InputError(f"mass, inertia and centre of gravity of {vehicle.name} must be numbers")
    record.require("dynamic_pressure")
    pressure = record["dynamic_pressure"]
    if np.nanmin(pressure) <= 0.0:
        raise InputError("dynamic_pressure of the flight record must be positive for aerodynamic coefficients")
    loads = pressure * vehicle.reference.area
    if name in FORCES:
        axis, sign = FORCES[name]
        made: Array = sign * _force(record, vehicle, thrust, axis) / loads
        return made
    axis = MOMENTS[name]
    moment: Array = _moment(record, vehicle, thrust)[:, axis] / (loads * vehicle.reference.moment_lengths[axis])
    return moment


def _force(record: FlightRecord, vehicle: Vehicle, thrust: ArrayLike, axis: int) -> Array:
    """Aerodynamic force along a body axis [N]."""
    channel = ("ax", "ay", "az")[axis]
    record.require(channel)
    place = record.provenance.get("installation", {}).get("accelerometers", ())
    if np.any(place):
        raise InputError(f"{channel} was measured at {tuple(place)} m; correct it to the centre of gravity first")
    force: Array = float(vehicle.mass) * record[channel]
    return force - np.asarray(thrust, dtype=float) if axis == 0 else force


def _moment(record: FlightRecord, vehicle: Vehicle, thrust: ArrayLike) -> Array:
    """Aerodynamic moment about the moment reference point, body axes [N m], shape (n, 3)."""
    names = ("p", "q", "r")
    record.require(*names)
    omega = np.stack([record[name] for name in names], axis=1)
    if all(f"{name}dot" in record.channels for name in names):
        record.require(*(f"{name}dot" for name in names))
        turning = np.stack([record[f"{name}dot"] for name in names], axis=1)
    else:
        turning = np.stack([differentiate(name, record.time, record[name]) for name in names], axis=1)
    moment: Array = turning @ vehicle.inertia + np.cross(omega, omega @ vehicle.inertia)
    aft, right, up = np.subtract(vehicle.reference.moment_reference, vehicle.centre_of_gravity).astype(float)
    if aft or right or up:
        force = np.stack([_force(record, vehicle, thrust, axis) for axis in range(3)], axis=1)
        moment = moment - np.cross([-aft, right, -up], force)
    return moment


def regressor(record: FlightRecord, name: str, reference: ReferenceQuantities) -> Array:
    """A regressor by name, NaN where unknown, shape (n,).

    A name is a channel or input (``alpha``, ``elevator``) or a product of powers of them (``alpha^2*q``). ``p q r
    alphadot betadot`` are dimensionless as the reference says (``q c/2V``); the last two are slopes by `differentiate`
    unless an input has the name.

    Raises
    ------
    InputError
        If the record has none of that name or the power is not a whole number from 1.
    """
    product = np.ones(len(record))
    for factor in name.split("*"):
        base, hat, power = factor.strip().partition("^")
        if hat and not (power.isdigit() and int(power) > 0):
            raise InputError(f"power of regressor {name!r} must be a whole number from 1, not {power!r}")
        product = product * _factor(record, base, reference) ** (int(power) if hat else 1)
    return product


def _factor(record: FlightRecord, name: str, reference: ReferenceQuantities) -> Array:
    if name in record.inputs or name not in _RATES:
        record.require(name)
        return record[name]
    record.require("V")
    if name in record.channels:
        record.require(name)
        rate = record[name]
    else:
        source = name.removesuffix("dot")
        record.require(source)
        rate = differentiate(source, record.time, record[source])
    scaled: Array = rate * reference.rate_scale(1.0)[_RATES[name]] / record["V"]
    return scaled


def polynomial_terms(names: Sequence[str], degree: int) -> tuple[str, ...]:
    """Names of all products of regressors up to a total degree: ``alpha, q, alpha^2, alpha*q, q^2``.

    Raises
    ------
    InputError
        If the degree is less than 1.
    """
    if degree < 1:
        raise InputError(f"degree of polynomial terms is {degree}, must be 1 or more")
    terms = []
    for total in range(1, degree + 1):
        for factors in combinations_with_replacement(names, total):
            powers = {name: factors.count(name) for name in factors}
            terms.append("*".join(name if n == 1 else f"{name}^{n}" for name, n in powers.items()))
    return tuple(terms)
