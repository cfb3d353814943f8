r"""Maximum-likelihood output error: the derivatives and initial state whose flight fits a record best.

With white noise of standard deviation sigma_c in each channel, the negative logarithm of the likelihood is (but for a
constant)

    J = sum over stations and channels of  r^2/(2 sigma_c^2) + ln sigma_c,

minimised by Gauss-Newton steps, damped (Levenberg-Marquardt) where they fail, with the exact sensitivities of
`output_model`, and over sigma by ``sigma_c^2 = sum r^2/(n - h_c)``. There h_c, the sum of the channel's leverages, is
how many of the unknowns the channel paid for; the plain maximum-likelihood estimate, with h_c = 0, is too small.
Klein & Morelli, "Aircraft System Identification" (2006), ch. 6; Chapman & Kirk, AIAA J. 8 (1970) for free flight.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca
import numpy as np
from threadpoolctl import threadpool_limits

from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.flightsim import (
    Atmosphere,
    ConstantAtmosphere,
    DerivativeAerodynamics,
    Earth,
    FlatEarth,
    Vehicle,
    air_at,
)
from indicial.identification.accuracy import assess
from indicial.identification.estimate import Estimate
from indicial.identification.linear_theory import LinearTheory, linear_theory
from indicial.identification.measurement import RangeRecord
from indicial.identification.output_model import (
    FREE_FLIGHT,
    SUMS,
    OutputModel,
    build_output_model,
    substeps_needed,
)
from indicial.identification.result import IdentificationResult

log = logging.getLogger(__name__)

Noise = Literal["estimated", "stated"]

_SHORT = 1e-4  # standard errors; a step shorter than this is the last
_MAX_STEPS = 60
_MAX_DAMPING = 1e9
_NOISE_CHANGE = 1e-3  # relative; noise that changes less is settled
_SMALLEST_NOISE = 1e-3  # of the stated; residuals below it are the integrator's
_NO_EFFECT = 1e-6  # standard deviations; what a value changes by less is not seen
_POSITIVE = ("CA_0", "Vx")


def identify(
    record: RangeRecord,
    vehicle: Vehicle,
    aerodynamics: DerivativeAerodynamics | None = None,
    free: Sequence[str] = FREE_FLIGHT,
    *,
    noise: Noise = "estimated",
    start: Mapping[str, float] | None = None,
    atmosphere: Atmosphere | None = None,
    earth: Earth | None = None,
) -> IdentificationResult:
    """Identify derivatives from the record of a range.

    Needs no knowledge of the derivatives: linear theory gives the start.

    Parameters
    ----------
    record : RangeRecord
    vehicle : Vehicle
    aerodynamics : DerivativeAerodynamics, optional
        Values of the derivatives that are held; if not given they are 0, about the centre of gravity. Free flight
        hardly feels them (CN_q and CN_alphadot), or feels a sum (the part of Cm_alphadot).
    free : sequence of str
        Derivatives to identify; see `build_output_model`. Add ``Cl_p`` if the missile rolls and roll is measured.
    noise : {"estimated", "stated"}
        Whether the standard deviations of the channels are estimated from the residuals or taken from the record.
    start : mapping, optional
        Start values of derivatives or states of the first station, in place of those of linear theory.
    atmosphere, earth : optional
        20 C and 1 atm, and flat, if not given.

    Raises
    ------
    InputError
        If a derivative has no effect on the record, or linear theory cannot reduce it.
    DivergenceError
        If the fit does not converge.
    """
    theory = reduce_linearly(record, vehicle, atmosphere, earth)
    if aerodynamics is None:
        reference = vehicle.reference.about(vehicle.centre_of_gravity)
        aerodynamics = DerivativeAerodynamics(reference=reference, CA_0=0.0, CN_alpha=0.0, Cm_alpha=0.0, Cm_q=0.0)
    model = build_output_model(
        vehicle,
        aerodynamics,
        free,
        stations=len(record),
        substeps=substeps_needed(record.time, _fastest(theory)),
        roll=record.roll is not None,
        atmosphere=atmosphere,
        earth=earth,
    )
    return estimate(record, model, start_values(model, theory, aerodynamics, start), noise=noise)


def reduce_linearly(
    record: RangeRecord, vehicle: Vehicle, atmosphere: Atmosphere | None = None, earth: Earth | None = None
) -> LinearTheory:
    """`linear_theory` of a record in an atmosphere, 20 C and 1 atm and flat earth if not given."""
    earth = FlatEarth() if earth is None else earth
    middle = np.array([np.mean(record.x), np.mean(record.y), np.mean(record.z)])
    symbol = ca.SX.sym("position", 3)
    local = ca.Function("local", [symbol], [earth.altitude(symbol), earth.gravity(symbol)])
    altitude, gravity = (np.array(value).ravel() for value in local(middle))
    air = air_at(ConstantAtmosphere() if atmosphere is None else atmosphere, float(altitude[0]))
    with threadpool_limits(limits=1, user_api="blas"):  # small matrices: threads would only fight
        return linear_theory(record, vehicle, float(air.density), float(air.speed_of_sound), float(gravity[2]))


def start_values(
    model: OutputModel,
    theory: LinearTheory,
    aerodynamics: DerivativeAerodynamics,
    given: Mapping[str, float] | None = None,
) -> Array:
    """Unknowns to start from, shape (n,): those of linear theory, moved to the model's moment reference point.

    What linear theory does not give starts at the model's value. A sum whose parts are free starts as its first part.

    Raises
    ------
    InputError
        If a given name is not an unknown of the model.
    """
    unknown = set(given or {}) - set(model.names)
    if unknown:
        raise InputError(f"start values of {', '.join(sorted(unknown))} given; unknowns are {', '.join(model.names)}")
    found = {e.name: e.value for e in theory.derivatives}
    here = DerivativeAerodynamics(
        reference=theory.reference,
        CA_0=found["CA_0"],
        Cl_p=found.get("Cl_p", aerodynamics.Cl_p),
        Cl_0=aerodynamics.Cl_0,
        CN_alpha=found["CN_alpha"],
        Cm_alpha=found["Cm_alpha"],
        Cm_q=found["Cm_q+Cm_alphadot"],
    ).about(aerodynamics.reference.moment_reference)
    values = dict(theory.initial)
    for name in model.derivatives:
        values[name] = sum(float(getattr(here, part)) for part in SUMS.get(name, (name,)))
    values |= given or {}
    return np.array([values[name] for name in model.names])


def _fastest(theory: LinearTheory) -> float:
    """Angular frequency of the fastest motion, spin included [rad/s]."""
    arms = (theory.epicycle.fast, theory.epicycle.slow)
    return theory.initial["Vx"] * max(abs(a.eigenvalue) for a in arms) + abs(theory.initial["p"])


@dataclass(frozen=True)
class _Point:
    """Unknowns with what they give."""

    unknowns: Array
    residuals: Array
    sensitivities: Array

    def whitened(self, noise: Array) -> tuple[Array, Array]:
        """Sensitivities (n_data, n) and residuals (n_data,) in standard deviations."""
        slopes = self.sensitivities / noise[:, None]
        return slopes.reshape(-1, self.unknowns.size), (self.residuals / noise).ravel()


def estimate(
    record: RangeRecord, model: OutputModel, start: Array, *, noise: Noise = "estimated"
) -> IdentificationResult:
    """Fit an output model to a record; see `identify`.

    Parameters
    ----------
    record : RangeRecord
    model : OutputModel
        Of as many stations and the same channels. It serves any number of records.
    start : ndarray
        Unknowns to start from, shape (n,).
    noise : {"estimated", "stated"}

    Raises
    ------
    InputError
        If an unknown has no effect on the record.
    DivergenceError
        If the fit does not converge.
    """
    if noise not in ("estimated", "stated"):
        raise InputError(f"noise is {noise!r}, must be 'estimated' or 'stated'")
    if record.channels != model.channels:
        raise InputError(f"record has channels {', '.join(record.channels)}, the model {', '.join(model.channels)}")
    with threadpool_limits(limits=1, user_api="blas"):  # small matrices: threads would only fight
        point, sigma, cost = _maximise_likelihood(record, model, np.asarray(start, dtype=float), noise)
        return _result(record, model, point, sigma, start, cost)


def _maximise_likelihood(
    record: RangeRecord, model: OutputModel, start: Array, noise: Noise
) -> tuple[_Point, Array, list[float]]:
    """The fitted point, the noise of the channels, and J at the start and after every step.

    The stated noise weighs the channels until the unknowns are within a standard error of the best; then the noise is
    estimated anew after every step.
    """
    stated = record.standard_deviations
    sigma, damping = stated, 0.0
    point = _look(record, model, start)
    _check_effects(record, model, point)
    cost = [_cost(point.residuals, sigma)]
    while len(cost) <= _MAX_STEPS and damping < _MAX_DAMPING:
        step, length = _step(*point.whitened(sigma), damping)
        trial = point.unknowns + step
        after = _cost_at(record, model, trial, sigma)
        if not (after <= _cost(point.residuals, sigma) or (length < _SHORT and math.isfinite(after))):
            damping = max(1e-3, 10.0 * damping)
            continue
        point = _look(record, model, trial)
        damping = 0.0 if damping < 1e-4 else damping / 10.0
        change = 0.0
        if noise == "estimated" and length < 1.0:
            before, sigma = sigma, _estimated_noise(point, sigma, stated)
            change = float(np.max(np.abs(sigma / before - 1.0)))
        cost.append(_cost(point.residuals, sigma))
        log.info("output error: J = %.6g after a step of %.2g standard errors", cost[-1], length)
        if length < _SHORT and change < _NOISE_CHANGE:
            return point, sigma, cost
    raise DivergenceError(
        f"output error did not converge (J {cost[0]:.6g} to {cost[-1]:.6g} in {len(cost) - 1} steps): free fewer "
        "derivatives, or give start values"
    )


def _look(record: RangeRecord, model: OutputModel, unknowns: Array) -> _Point:
    outputs, sensitivities = model.sensitivities(unknowns, record.time)
    if not (np.all(np.isfinite(outputs)) and np.all(np.isfinite(sensitivities))):
        raise DivergenceError("the flight from the start values is not finite: give better start values")
    return _Point(unknowns, _residuals(record, outputs), sensitivities)


def _residuals(record: RangeRecord, outputs: Array) -> Array:
    """Measured less computed, angles within half a turn."""
    difference: Array = record.values - outputs
    angles = [name not in "xyz" for name in record.channels]
    difference[:, angles] = (difference[:, angles] + math.pi) % (2.0 * math.pi) - math.pi
    return difference


def _check_effects(record: RangeRecord, model: OutputModel, point: _Point) -> None:
    """Refuse an unknown whose whole value, or 1, changes nothing that could be measured."""
    effect = np.max(np.abs(point.sensitivities / record.standard_deviations[:, None]), axis=(0, 1))
    for name, value, size in zip(model.names, point.unknowns, effect, strict=True):
        if size * max(1.0, abs(value)) < _NO_EFFECT:
            raise InputError(f"{name} has no effect on this record: hold it, or give a flight that depends on it")


def _cost(residuals: Array, sigma: Array) -> float:
    return float(np.sum(residuals**2 / (2.0 * sigma**2) + np.log(sigma)))


def _step(slopes: Array, residuals: Array, damping: float) -> tuple[Array, float]:
    """Damped Gauss-Newton step, and the length of the undamped one in standard errors."""
    size = np.linalg.norm(slopes, axis=0)
    left, singular, rows = np.linalg.svd(slopes / size, full_matrices=False)
    along = left.T @ residuals
    smallest = np.finfo(float).eps * slopes.shape[0] * singular[0]  # below it directions are round-off, and left alone
    gain = np.where(singular > smallest, singular / (singular**2 + damping + smallest**2), 0.0)
    return rows.T @ (gain * along) / size, float(np.linalg.norm(along))


def _cost_at(record: RangeRecord, model: OutputModel, unknowns: Array, sigma: Array) -> float:
    """J of trial unknowns; infinite where they are not physical or the flight is not finite."""
    value = dict(zip(model.names, unknowns, strict=True))
    if any(value.get(name, 1.0) <= 0.0 for name in _POSITIVE):
        return math.inf
    outputs = model.outputs(unknowns, record.time)
    return _cost(_residuals(record, outputs), sigma) if np.all(np.isfinite(outputs)) else math.inf


def _estimated_noise(point: _Point, sigma: Array, stated: Array) -> Array:
    """Standard deviation of each channel from its residuals and leverages."""
    slopes, _ = point.whitened(sigma)
    basis, _ = np.linalg.qr(slopes / np.linalg.norm(slopes, axis=0))
    leverage = np.sum(basis**2, axis=1).reshape(point.residuals.shape).sum(axis=0)
    freedom = len(point.residuals) - leverage
    if np.any(freedom < 1.0):
        raise InputError("too few stations for so many unknowns: free fewer derivatives")
    spread: Array = np.sqrt(np.sum(point.residuals**2, axis=0) / freedom)
    return np.maximum(spread, _SMALLEST_NOISE * stated)


def _result(
    record: RangeRecord, model: OutputModel, point: _Point, sigma: Array, start: Array, cost: list[float]
) -> IdentificationResult:
    n = len(model.derivatives)
    accuracy = assess(model.names, point.unknowns, n, model.channels, point.residuals, point.sensitivities, sigma)
    estimates: list[Any] = [
        Estimate(name, float(value), float(error))
        for name, value, error in zip(model.names, point.unknowns, accuracy.standard_errors, strict=True)
    ]
    return IdentificationResult(
        derivatives=tuple(estimates[:n]),
        initial=tuple(estimates[n:]),
        accuracy=accuracy,
        noise=sigma,
        residuals=point.residuals,
        fitted=model.trajectory(point.unknowns, record.time),
        record=record,
        reference=model.dynamics.aerodynamics.reference,
        start=dict(zip(model.derivatives, (float(v) for v in start[:n]), strict=True)),
        iterations=len(cost) - 1,
        cost=tuple(cost),
    )
