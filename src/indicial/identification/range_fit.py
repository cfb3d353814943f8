r"""Range reduction by output error: one shot, or several shots with their coefficients in common.

The six-degree-of-freedom flight that fits the stations of each shot best, each with a start of its own, started from
`linear_theory`, which needs no start itself. Coefficients may grow with the square of the total angle delta,

    CA = CA_0 + CA_alpha2 sin^2 delta,     CN = (CN_alpha + CN_alpha3 sin^2 delta) e + ...,     Cm likewise,
    Cm_q = Cm_q + Cm_q_alpha2 sin^2 delta,

as the ranges write them. The engine is `fit_manoeuvres`. Source: Chapman & Kirk, AIAA J. 8 (1970) 753; Dupuis &
Hathaway, DREV-TM-9703 (1997), for the coefficients.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import casadi as ca
import numpy as np
from threadpoolctl import threadpool_limits

from indicial.conventions import Array, ReferenceQuantities
from indicial.derivatives import DerivativeTable
from indicial.errors import InputError
from indicial.flightsim import (
    DERIVATIVES,
    TOTAL_ANGLE,
    Atmosphere,
    ConstantAtmosphere,
    DerivativeAerodynamics,
    Dynamics,
    Earth,
    FlatEarth,
    InitialState,
    Trajectory,
    Vehicle,
    air_at,
    build_dynamics,
)
from indicial.flightsim.simulate import record as trajectory_of
from indicial.identification.estimate import Estimate, identified_table
from indicial.identification.fit import OutputErrorFit, Verdict
from indicial.identification.linear_theory import LinearTheory, linear_theory
from indicial.identification.maximum_likelihood import fit_manoeuvres
from indicial.identification.measurement import RangeRecord
from indicial.identification.problem import Manoeuvre, Parameter
from indicial.identification.sensitivity import SensitivityModel
from indicial.identification.start_state import StartState
from indicial.motion import FlightCondition

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Noise = Literal["estimated", "stated"]

SUMS = {"Cm_q+Cm_alphadot": ("Cm_q", "Cm_alphadot"), "CN_q+CN_alphadot": ("CN_q", "CN_alphadot")}
"""Sums that count as one derivative: their second part is held at the model's value, the first takes the rest."""

GROWING = {"CA_alpha2": "CA_0", "CN_alpha3": "CN_alpha", "Cm_alpha3": "Cm_alpha", "Cm_q_alpha2": "Cm_q"}
"""Coefficients of the square of the sine of the total angle, and what they are added to."""

FREE_FLIGHT = ("CA_0", "CN_alpha", "Cm_alpha", "Cm_q+Cm_alphadot")
"""What the free flight of a missile that does not roll determines."""

START = ("x", "y", "z", "Vx", "Vy", "Vz", "yaw", "pitch", "q", "r")
"""Unknowns of the first station: position [m], velocity [m/s] in earth axes, Euler angles [rad], body rates [rad/s]."""

ROLLING = ("roll", "p")
"""Unknowns besides, where roll is measured."""

_CHANNELS = ("x", "y", "z", "yaw", "pitch")
_LINEAR = {"CA_0": "CA_0", "CN_alpha": "CN_alpha", "Cm_alpha": "Cm_alpha", "Cm_q": "Cm_q+Cm_alphadot"}
_PROBABLE = 0.6744897501960817  # standard deviations within which half of a normal distribution lies


@dataclass(frozen=True)
class RangeModel:
    """The flight model of shots of one kind, its coefficients free: built once, for any number of them.

    Parameters
    ----------
    dynamics : Dynamics
        Its parameters are the free coefficients.
    sensitivities : SensitivityModel
    held : DerivativeAerodynamics
        The values of those that are not free.
    roll : bool
        Whether roll is measured. If not, the missile is taken not to roll.
    """

    dynamics: Dynamics
    sensitivities: SensitivityModel
    held: DerivativeAerodynamics
    roll: bool

    @classmethod
    def of(
        cls,
        vehicle: Vehicle,
        aerodynamics: DerivativeAerodynamics | None = None,
        free: Sequence[str] = FREE_FLIGHT,
        *,
        roll: bool = False,
        atmosphere: Atmosphere | None = None,
        earth: Earth | None = None,
    ) -> RangeModel:
        """The model of a vehicle; see `identify`.

        Raises
        ------
        InputError
            If a name is unknown, there twice or, being part of a sum, stands beside it.
        """
        if aerodynamics is None:
            reference = vehicle.reference.about(vehicle.centre_of_gravity)
            aerodynamics = DerivativeAerodynamics(reference=reference, CA_0=0.0, CN_alpha=0.0, Cm_alpha=0.0, Cm_q=0.0)
        dynamics = build_dynamics(vehicle, _with_symbols(aerodynamics, free), atmosphere, earth)
        channels = (*_CHANNELS, "roll") if roll else _CHANNELS
        return cls(dynamics, SensitivityModel.of(dynamics, channels), aerodynamics, roll)

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the free coefficients."""
        return self.dynamics.parameter_names

    @property
    def reference(self) -> ReferenceQuantities:
        """Of the coefficients."""
        return self.held.reference

    def manoeuvre(self, record: RangeRecord, theory: LinearTheory, start: Mapping[str, float], name: str) -> Manoeuvre:
        """A shot with the start that linear theory, or `start`, gives it."""
        if (record.roll is not None) != self.roll:
            raise InputError("the model and the record differ in whether roll is measured")
        free = (*START, *ROLLING) if self.roll else START
        near = StartState.of(self.dynamics, InitialState.from_path(theory.initial["Vx"]), free)
        given = {n: v for n, v in theory.initial.items() if self.roll or n not in ROLLING}
        given |= {n: v for n, v in start.items() if n in free}
        arms = (theory.epicycle.fast, theory.epicycle.slow)
        fastest = theory.initial["Vx"] * max(abs(a.eigenvalue) for a in arms) + abs(theory.initial["p"])
        return Manoeuvre.of_range(record, self.sensitivities, near.replace(given), fastest, name)

    def start_values(self, theories: Sequence[LinearTheory]) -> dict[str, float]:
        """Of the free coefficients: what linear theory finds in the shots, on the whole, about the model's point."""
        found = {name: _weighted([_estimate(t, name) for t in theories]) for name in _LINEAR.values()}
        rolling = [_estimate(t, "Cl_p") for t in theories if any(e.name == "Cl_p" for e in t.derivatives)]
        here = DerivativeAerodynamics(
            reference=theories[0].reference,
            CA_0=found["CA_0"],
            Cl_p=_weighted(rolling) if rolling else self.held.Cl_p,
            Cl_0=self.held.Cl_0,
            CN_alpha=found["CN_alpha"],
            Cm_alpha=found["Cm_alpha"],
            Cm_q=found["Cm_q+Cm_alphadot"],
        ).about(self.reference.moment_reference)
        values = {}
        for name in self.free:
            parts = () if name in GROWING else SUMS.get(name, (name,))
            values[name] = float(sum(float(getattr(here, part)) for part in parts))
        return values


@dataclass(frozen=True)
class RangeFit:
    """Coefficients of one or several shots.

    Parameters
    ----------
    fit : OutputErrorFit
    model : RangeModel
    records : tuple of RangeRecord
    theories : tuple of LinearTheory
        Of each shot by itself.
    """

    fit: OutputErrorFit
    model: RangeModel
    records: tuple[RangeRecord, ...]
    theories: tuple[LinearTheory, ...]

    def __getitem__(self, name: str) -> Estimate:
        """A coefficient, or a value of the start, by name.

        Raises
        ------
        InputError
            If it was not identified.
        """
        return self.fit[name]

    @property
    def derivatives(self) -> tuple[Estimate, ...]:
        """Coefficients, about the moment reference point of the model."""
        return self.fit.parameters

    @property
    def fitted(self) -> tuple[Trajectory, ...]:
        """The flights at the stations."""
        values = np.array([e.value for e in self.derivatives])
        made = {"method": "output error"}
        return tuple(
            trajectory_of(self.model.dynamics, record.time, states, values, made)
            for record, states in zip(self.records, self.fit.states, strict=True)
        )

    @property
    def noise(self) -> Array:
        """Standard deviation of each channel of the first shot, estimated or stated [m] or [rad]."""
        sizes = self.records[0].standard_deviations
        found: Array = sizes * np.array([self.fit.noise[channel] for channel in self.records[0].channels])
        return found

    @property
    def mach(self) -> float:
        """Mean over all stations."""
        return float(np.mean(np.concatenate([flight.mach for flight in self.fitted])))

    @property
    def mean_square_yaw(self) -> float:
        """Of the total angle at all stations [rad^2]."""
        return float(np.mean(np.concatenate([flight.total_angle**2 for flight in self.fitted])))

    @property
    def correlation(self) -> Array:
        """Of the coefficients, shape (n, n)."""
        n = len(self.derivatives)
        return self.fit.correlation[:n, :n]

    def probable_error(self, name: str) -> float:
        """Within which half of all estimates lie, as the ranges print it: 0.6745 standard errors."""
        return _PROBABLE * self[name].standard_error

    def against(self, before: Mapping[str, float | tuple[float, float]]) -> tuple[Verdict, ...]:
        """See `OutputErrorFit.against`."""
        return self.fit.against(before)

    def table(self, condition: FlightCondition | None = None, source: str = "output error") -> DerivativeTable:
        """The derivatives as records of method ``identified``, at the mean Mach number unless told.

        Cl_0 and the coefficients that grow with the angle, which are no derivatives, are left out.
        """
        where = FlightCondition(self.mach) if condition is None else condition
        kept = (e for e in self.derivatives if e.name != "Cl_0" and e.name not in GROWING)
        return identified_table(kept, where, self.model.reference, source)

    def summary(self) -> str:
        """Coefficients with standard errors, noise, correlations worth a word, and what the record cannot tell."""
        shots, stations = len(self.records), sum(len(record) for record in self.records)
        yaw = math.degrees(math.sqrt(self.mean_square_yaw))
        lines = [
            f"output error at Mach {self.mach:.4g}: {shots} shot{'s' if shots > 1 else ''}, {stations} stations, "
            f"{len(self.fit.cost)} steps, root mean square yaw {yaw:.3g} deg"
        ]
        lines += [f"  {estimate.summary()}" for estimate in self.derivatives]
        sizes = [
            f"{name} {1e3 * sd:.3g} mm" if name in "xyz" else f"{name} {math.degrees(sd):.3g} deg"
            for name, sd in zip(self.records[0].channels, self.noise, strict=True)
        ]
        lines.append(f"  noise: {', '.join(sizes)}")
        coloured = [name for name, memory in self.fit.memory.items() if memory.size]
        lines.append(
            f"  residuals of {', '.join(coloured)} are coloured, and fitted as such"
            if coloured
            else "  residuals pass as white"
        )
        matrix = self.correlation
        for i, one in enumerate(self.derivatives):
            for j, other in enumerate(self.derivatives[:i]):
                if abs(matrix[i, j]) > 0.7:
                    lines.append(f"  {other.name} and {one.name} correlate by {matrix[i, j]:.3f}")
        return "\n".join([*lines, *(f"  {text}" for text in (*self.fit.findings, *self.fit.suspicious()))])

    def plot(self, shot: int = 0) -> Figure:
        """Measured against fitted angles and swerve of one shot, and the residuals in standard deviations."""
        import matplotlib.pyplot as plt

        record, residuals = self.records[shot], self.fit.residuals[shot]
        figure, axes = plt.subplots(3, 1, figsize=(9, 9), sharex=True, layout="constrained")
        fitted = record.values - residuals
        for i, name in enumerate(record.channels):
            if name in ("x", "roll"):
                continue
            ax, scale = (axes[0], math.degrees(1.0)) if name in ("yaw", "pitch") else (axes[1], 1e3)
            (line,) = ax.plot(record.x, scale * fitted[:, i], label=f"{name}, fitted")
            ax.plot(record.x, scale * record.values[:, i], ".", color=line.get_color(), label=f"{name}, measured")
        for i, name in enumerate(record.channels):
            axes[2].plot(record.x, residuals[:, i] / self.noise[i], ".-", linewidth=0.5, label=name)
        axes[0].set(ylabel="angle [deg]")
        axes[1].set(ylabel="position [mm]")
        axes[2].set(xlabel="x [m]", ylabel="residual [standard deviations]")
        for ax in axes:
            ax.legend(ncols=3, fontsize="small")
        return figure


def identify(
    records: RangeRecord | Sequence[RangeRecord],
    vehicle: Vehicle,
    aerodynamics: DerivativeAerodynamics | None = None,
    free: Sequence[str] = FREE_FLIGHT,
    *,
    noise: Noise = "estimated",
    start: Mapping[str, float] | None = None,
    atmosphere: Atmosphere | None = None,
    earth: Earth | None = None,
    model: RangeModel | None = None,
    threads: int | None = None,
) -> RangeFit:
    """Identify coefficients from the record of a range, or from several shots together.

    Needs no knowledge of the coefficients: linear theory gives the start.

    Parameters
    ----------
    records : RangeRecord or sequence of them
        Several: coefficients in common, a start for each.
    vehicle : Vehicle
    aerodynamics : DerivativeAerodynamics, optional
        Values of the derivatives that are held; if not given they are 0, about the centre of gravity. Free flight
        hardly feels them (CN_q and CN_alphadot), or feels a sum (the part of Cm_alphadot).
    free : sequence of str
        Names in `flightsim.DERIVATIVES`, ``Cl_0``, the sums of `SUMS` and the terms of `GROWING`. A free flight
        separates the parts of the sums only in so far as incidence and attitude part, which is by the curvature of the
        path: too little to measure. Add ``Cl_p`` if the missile rolls and roll is measured.
    noise : {"estimated", "stated"}
        Whether the standard deviations of the channels are estimated from the residuals or taken from the record.
    start : mapping, optional
        Start values of coefficients or of the first station, in place of those of linear theory.
    atmosphere, earth : optional
        20 C and 1 atm, and flat, if not given.
    model : RangeModel, optional
        If it is built already; `vehicle`, `aerodynamics`, `free`, `atmosphere` and `earth` are then its own.
    threads : int, optional
        Shots are flown side by side in as many.

    Raises
    ------
    InputError
        If a coefficient has no effect on the records, linear theory cannot reduce one, or a name is unknown.
    DivergenceError
        If the fit does not converge.
    """
    shots = (records,) if isinstance(records, RangeRecord) else tuple(records)
    if not shots:
        raise InputError("a range fit needs at least one record")
    if noise not in ("estimated", "stated"):
        raise InputError(f"noise is {noise!r}, must be 'estimated' or 'stated'")
    if model is None:
        roll = shots[0].roll is not None
        model = RangeModel.of(vehicle, aerodynamics, free, roll=roll, atmosphere=atmosphere, earth=earth)
    given = dict(start or {})
    known = (*model.free, *START, *(ROLLING if model.roll else ()))
    unknown = set(given) - set(known)
    if unknown:
        raise InputError(f"start values of {', '.join(sorted(unknown))} given; unknowns are {', '.join(known)}")
    theories = tuple(_theories(shots, vehicle, model.dynamics))
    values = model.start_values(theories) | {n: v for n, v in given.items() if n in model.free}
    parameters = [Parameter(name, values[name], positive=name == "CA_0") for name in model.free]
    manoeuvres = [
        model.manoeuvre(shot, theory, given, f"shot {i + 1}")
        for i, (shot, theory) in enumerate(zip(shots, theories, strict=True))
    ]
    fit = fit_manoeuvres(manoeuvres, parameters, estimate_noise=noise == "estimated", threads=threads)
    return RangeFit(fit, model, shots, theories)


def _theories(shots: Sequence[RangeRecord], vehicle: Vehicle, dynamics: Dynamics) -> Iterable[LinearTheory]:
    """Linear theory of each shot; a refusal says of which."""
    for i, shot in enumerate(shots):
        try:
            yield reduce_linearly(shot, vehicle, dynamics.atmosphere, dynamics.earth)
        except InputError as error:
            if len(shots) == 1:
                raise
            raise InputError(f"shot {i + 1}: {error}") from error


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


def _with_symbols(aerodynamics: DerivativeAerodynamics, free: Iterable[str]) -> DerivativeAerodynamics:
    wanted = tuple(free)
    parts = [part for name in wanted for part in SUMS.get(name, (name,))]
    allowed = (*DERIVATIVES, "Cl_0", *SUMS, *GROWING)
    for name in wanted:
        if name not in allowed:
            raise InputError(f"no derivative {name!r} to identify; there are {', '.join(allowed)}")
    if not wanted or len(set(parts)) != len(parts):
        raise InputError(
            f"derivatives to identify must be named once, a sum without its parts, not {', '.join(wanted)}"
        )
    values: dict[str, Any] = {name: ca.SX.sym(name) for name in wanted if name not in SUMS and name not in GROWING}
    for name, (first, second) in SUMS.items():
        if name in wanted:
            values[first] = ca.SX.sym(name) - getattr(aerodynamics, second)
    for name, base in GROWING.items():
        if name in wanted:
            values[base] = values.get(base, getattr(aerodynamics, base)) + ca.SX.sym(name) * ca.sin(TOTAL_ANGLE) ** 2
    return replace(aerodynamics, **values)


def _estimate(theory: LinearTheory, name: str) -> Estimate:
    return next(e for e in theory.derivatives if e.name == name)


def _weighted(estimates: list[Estimate]) -> float:
    weights = np.array([1.0 / max(e.standard_error, 1e-12) ** 2 for e in estimates])
    return float(np.average([e.value for e in estimates], weights=weights))
