r"""Aerodynamic loads as casadi expressions: the protocol, and loads from derivatives (`state_space`: with memory).

Incidence here is sine-like: the transverse components of the unit vector along the velocity of the moment
reference point, ``e = V_b/|V_b|``, so ``e_z = w/V`` and ``e_y = v/V`` (equal to alpha and beta to first order).
Rotating the missile about x then rotates its loads exactly, and nothing is singular at any attitude or at rest.

Pitch plane and yaw plane of a missile of rotational (or fourfold) symmetry are one model used twice:

    pitch: incidence  e_z, rate  q  ->  Z = -N,  M_y =  M
    yaw:   incidence  e_y, rate -r  ->  Y = -N,  M_z = -M

with N the normal force and M the moment of one plane. Every load is coded without a division by V: the static part
with ``rho V^2 S/2``, the rate part with ``rho V S c/4 (q c/2V -> q)``, the incidence-rate part with ``rho S c/4``
times ``V de/dt``.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, NamedTuple, Protocol

import casadi as ca

from indicial.conventions import ReferenceQuantities, transfer_longitudinal
from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError
from indicial.flightsim.expressions import MACH, free_symbols
from indicial.flightsim.expressions import table as look_up

LagAxes = Literal["non_rolling", "body"]

DERIVATIVES = ("CA_0", "CN_alpha", "CN_q", "CN_alphadot", "Cm_alpha", "Cm_q", "Cm_alphadot", "Cl_p")
"""Names that `DerivativeAerodynamics` takes from a table."""


@dataclass(frozen=True)
class Validity:
    """Where an aerodynamic model holds. A flight that leaves it is flagged.

    Parameters
    ----------
    alpha_max : float
        Largest total angle of attack [rad].
    mach_min, mach_max : float
    """

    alpha_max: float = math.inf
    mach_min: float = 0.0
    mach_max: float = math.inf

    def __post_init__(self) -> None:
        if not self.alpha_max > 0.0 or not 0.0 <= self.mach_min < self.mach_max:
            raise InputError("validity needs alpha_max > 0 and 0 <= mach_min < mach_max")


class FlowState(NamedTuple):
    """Motion of the moment reference point through the air, body axes; casadi expressions."""

    density: Any
    """[kg/m^3]"""
    speed_of_sound: Any
    """[m/s]"""
    speed: Any
    """V [m/s]."""
    incidence: Any
    """(v/V, w/V), 0 at rest, shape (2, 1)."""
    rate: Any
    """(p, q, r) relative to the air [rad/s], shape (3, 1)."""
    turning: Any
    """``V d(v/V, w/V)/dt`` [m/s^2] of the body-axis components, shape (2, 1)."""
    velocity: Any
    """(u, v, w) [m/s], shape (3, 1)."""
    inertial_rate: Any
    """(p, q, r) in inertial space [rad/s], shape (3, 1): `rate`, but for the earth's rotation."""


class AerodynamicLoads(NamedTuple):
    """Force [N] and moment [N m] about the moment reference point, body axes, casadi expressions (3, 1)."""

    force: Any
    moment: Any


class Aerodynamics(Protocol):
    """Aerodynamic loads with lag states, as casadi expressions.

    Loads must be linear (affine) in ``flow.turning``; `build_dynamics` solves for it exactly.
    """

    @property
    def reference(self) -> ReferenceQuantities:
        """What the coefficients are made dimensionless with, and about which point."""
        ...

    @property
    def validity(self) -> Validity:
        """Where the model holds."""
        ...

    @property
    def parameters(self) -> tuple[Any, ...]:
        """Free casadi symbols among the model's values, in a fixed order."""
        ...

    @property
    def lag_names(self) -> tuple[str, ...]:
        """Names of the lag states."""
        ...

    def loads(self, flow: FlowState, lag: Any) -> AerodynamicLoads:
        """Force and moment about the moment reference point."""
        ...

    def lag_rate(self, flow: FlowState, lag: Any) -> Any:
        """Time derivative of the lag states [1/s], shape (n, 1)."""
        ...


@dataclass(frozen=True, kw_only=True)
class SymmetricMissile(ABC):
    r"""Axial force and roll of a missile of rotational symmetry, and one plane's model used in both.

    ``CA = CA_0``, ``Cl = Cl_0 + Cl_p p c/2V``.

    Parameters
    ----------
    reference : ReferenceQuantities
        Its `lateral_length` must be its `length` (or not given).
    CA_0 : float or casadi symbol
        Axial force coefficient, base included.
    Cl_p : float or casadi symbol
        Roll damping, per rad of the dimensionless roll rate.
    Cl_0 : float or casadi symbol
        Rolling moment of fin cant.
    lag_axes : {"non_rolling", "body"}
        In which axes the flow remembers: whether incidence rate and lag states are those of axes that pitch and yaw
        with the missile without rolling (classical aeroballistics: ``Cm_q + Cm_alphadot`` act as one sum whatever the
        spin), or of axes fixed in it (a body-axis response, as loads that live on the fins have). The two differ
        by loads in proportion to ``p c/2V``.
    validity : Validity
    """

    reference: ReferenceQuantities
    CA_0: Any
    Cl_p: Any = 0.0
    Cl_0: Any = 0.0
    lag_axes: LagAxes = "non_rolling"
    validity: Validity = Validity()

    def __post_init__(self) -> None:
        lateral = self.reference.lateral_length
        if lateral is not None and lateral != self.reference.length:
            raise InputError(
                f"lateral_length is {lateral} m; a missile of rotational symmetry has one reference length, "
                f"here {self.reference.length} m"
            )
        if self.lag_axes not in ("non_rolling", "body"):
            raise InputError(f"lag_axes is {self.lag_axes!r}, must be 'non_rolling' or 'body'")

    @property
    def parameters(self) -> tuple[Any, ...]:
        """Free casadi symbols among the values, in the order of the fields."""
        return free_symbols(getattr(self, item.name) for item in fields(self))

    @property
    def rate_scale(self) -> float:
        """``rho S c/4`` per rho: turns ``V q`` into a load, for rates per c/2V [m^3]."""
        factor = 2.0 if self.reference.rate_normalisation == "c/2V" else 1.0
        return 0.5 * self.reference.area * self.reference.length / factor

    @abstractmethod
    def plane(self, flow: FlowState, incidence: Any, rate: Any, turning: Any, lag: Any) -> tuple[Any, Any]:
        """Normal force [N] and moment [N m] of one plane."""

    @abstractmethod
    def lag_rate(self, flow: FlowState, lag: Any) -> Any:
        """Time derivative of the lag states [1/s], pitch plane then yaw plane."""

    @abstractmethod
    def summary(self) -> str:
        """The model in one line."""

    @abstractmethod
    def quasi_steady(self) -> DerivativeAerodynamics:
        """The derivatives of the model at k = 0."""

    @property
    @abstractmethod
    def lag_names(self) -> tuple[str, ...]:
        """Names of the lag states, pitch plane then yaw plane."""

    def loads(self, flow: FlowState, lag: Any) -> AerodynamicLoads:
        """Force and moment about the moment reference point."""
        half = len(self.lag_names) // 2
        turning = self._turning(flow)
        normal, pitching = self.plane(flow, flow.incidence[1], flow.rate[1], turning[1], lag[:half])
        side, yawing = self.plane(flow, flow.incidence[0], -flow.rate[2], turning[0], lag[half:])
        pressure_area = 0.5 * flow.density * flow.speed**2 * self.reference.area
        rolling = self.reference.length * (
            pressure_area * self.Cl_0 + flow.density * flow.speed * self.rate_scale * self.Cl_p * flow.rate[0]
        )
        return AerodynamicLoads(
            ca.vertcat(-pressure_area * self.CA_0, -side, -normal), ca.vertcat(rolling, pitching, -yawing)
        )

    def _turning(self, flow: FlowState) -> Any:
        if self.lag_axes == "body":
            return flow.turning
        spin = flow.rate[0] * flow.speed
        return flow.turning + ca.vertcat(-spin * flow.incidence[1], spin * flow.incidence[0])


@dataclass(frozen=True, kw_only=True)
class DerivativeAerodynamics(SymmetricMissile):
    r"""Loads of a missile of rotational symmetry from derivatives (Eq. 1).

    In each plane, with the incidence ``e`` of this module's head and dots its rate,

    ``CN = CN_alpha e + CN_alphadot (c/2V) edot + CN_q q c/2V``, and Cm likewise.

    Each value may be a casadi symbol (``casadi.SX.sym("Cm_q")``): the model then carries it as a parameter.

    Parameters
    ----------
    CN_alpha, Cm_alpha : float or casadi symbol
        Per rad.
    CN_q, CN_alphadot, Cm_q, Cm_alphadot : float or casadi symbol
        Per rad of ``q c/2V`` (or ``q c/V`` as the reference's `rate_normalisation` says).
    """

    CN_alpha: Any
    Cm_alpha: Any
    Cm_q: Any
    CN_q: Any = 0.0
    CN_alphadot: Any = 0.0
    Cm_alphadot: Any = 0.0

    @classmethod
    def from_table(
        cls,
        table: DerivativeTable,
        *,
        Cl_0: float = 0.0,
        lag_axes: LagAxes = "non_rolling",
        validity: Validity | None = None,
        **given: float,
    ) -> DerivativeAerodynamics:
        """The model of a table that holds one record of each name in `DERIVATIVES`, or is `given` it.

        Parameters
        ----------
        table : DerivativeTable
            Select from it first where several methods or conditions stand: ``table.select(method="mrf")``.
        **given : float
            Values that the table lacks, or that replace the table's, in the table's normalisation.

        Raises
        ------
        InputError
            If a name is missing or there twice, or the records do not share one reference.
        """
        unknown = set(given) - set(DERIVATIVES)
        if unknown:
            raise InputError(f"unknown derivatives {', '.join(sorted(unknown))}; there are {', '.join(DERIVATIVES)}")
        records = [table.one(name) for name in DERIVATIVES if name not in given]
        reference = _reference(records)
        values = {r.name: r.value for r in records} | given
        return cls(reference=reference, Cl_0=Cl_0, lag_axes=lag_axes, validity=validity or Validity(), **values)

    @classmethod
    def over_mach(
        cls, table: DerivativeTable, *, Cl_0: float = 0.0, lag_axes: LagAxes = "non_rolling", **given: Any
    ) -> DerivativeAerodynamics:
        """The model of a table that holds records at several Mach numbers: each value linear in the Mach number.

        It is valid between the greatest of the first and the least of the last Mach numbers.

        Parameters
        ----------
        table : DerivativeTable
            For each name in `DERIVATIVES` that is not given, two or more records of different Mach numbers, each once.
        **given : float or expression
            Values that the table lacks, or that replace the table's, in the table's normalisation.

        Raises
        ------
        InputError
            If a name has fewer than two records or two at one Mach number, or the records do not share one reference.
        """
        unknown = set(given) - set(DERIVATIVES)
        if unknown:
            raise InputError(f"unknown derivatives {', '.join(sorted(unknown))}; there are {', '.join(DERIVATIVES)}")
        rows = {
            name: sorted(table.select(name=name), key=lambda record: record.mach)
            for name in DERIVATIVES
            if name not in given
        }
        machs = {name: [record.mach for record in records] for name, records in rows.items()}
        for name, nodes in machs.items():
            if len(nodes) < 2 or len(set(nodes)) < len(nodes):
                raise InputError(
                    f"{name} needs two or more records, each of another Mach number, has {len(nodes)} at "
                    f"{len(set(nodes))}: select from the table, or give it"
                )
        if not rows:
            raise InputError("every derivative is given: there is nothing to look up in the table")
        values = {name: look_up(MACH, machs[name], [r.value for r in records]) for name, records in rows.items()}
        reach = Validity(
            mach_min=max(nodes[0] for nodes in machs.values()), mach_max=min(nodes[-1] for nodes in machs.values())
        )
        reference = _reference(record for records in rows.values() for record in records)
        return cls(reference=reference, Cl_0=Cl_0, lag_axes=lag_axes, validity=reach, **(values | given))

    def with_symbols(self, names: Iterable[str]) -> DerivativeAerodynamics:
        """The model with the named values replaced by casadi symbols of the same names."""
        wanted = tuple(names)
        allowed = (*DERIVATIVES, "Cl_0")
        for name in wanted:
            if name not in allowed:
                raise InputError(f"no derivative {name!r} to make a parameter of; there are {', '.join(allowed)}")
        symbols: dict[str, Any] = {name: ca.SX.sym(name) for name in wanted}
        return replace(self, **symbols)

    @property
    def lag_names(self) -> tuple[str, ...]:
        """None."""
        return ()

    def quasi_steady(self) -> DerivativeAerodynamics:
        """Itself."""
        return self

    def about(self, moment_reference: tuple[float, float, float]) -> DerivativeAerodynamics:
        """The model about another point of the body's axis, by `indicial.conventions.transfer_longitudinal`.

        The loads at the centre of gravity stay the same to first order, but for the rate of q: alphadot at one point
        is alphadot at the other and a term in qdot, which derivatives have no place for.

        Raises
        ------
        InputError
            If the points are not on one line along x.
        """
        here = self.reference.moment_reference
        if here[1:] != moment_reference[1:]:
            raise InputError(f"derivatives can be moved along x only, not from {here} to {moment_reference}")
        shift = (moment_reference[0] - here[0]) / self.reference.length
        longitudinal = {name: getattr(self, name) for name in DERIVATIVES if name not in ("CA_0", "Cl_p")}
        moved: dict[str, Any] = transfer_longitudinal(longitudinal, shift, self.reference.rate_normalisation)
        return replace(self, reference=self.reference.about(moment_reference), **moved)

    def plane(self, flow: FlowState, incidence: Any, rate: Any, turning: Any, lag: Any) -> tuple[Any, Any]:
        """Normal force [N] and moment [N m] of one plane."""
        del lag
        static = 0.5 * flow.density * flow.speed**2 * self.reference.area * incidence
        damping = flow.density * self.rate_scale * flow.speed * rate
        lagging = flow.density * self.rate_scale * turning
        normal = self.CN_alpha * static + self.CN_q * damping + self.CN_alphadot * lagging
        moment = self.Cm_alpha * static + self.Cm_q * damping + self.Cm_alphadot * lagging
        return normal, self.reference.length * moment

    def lag_rate(self, flow: FlowState, lag: Any) -> Any:
        """Nothing."""
        del flow, lag
        return ca.SX(0, 1)

    def summary(self) -> str:
        """The derivatives in one line."""
        values = ", ".join(f"{name} {getattr(self, name)!s:.8}" for name in DERIVATIVES)
        return f"derivative model: {values}"


def _reference(records: Iterable[Derivative]) -> ReferenceQuantities:
    """What all of the records refer to."""
    references = {
        ReferenceQuantities(
            length=r.reference_length_m,
            area=r.reference_area_m2,
            moment_reference=r.moment_reference_m,
            rate_normalisation=r.rate_normalisation,
        )
        for r in records
    }
    if len(references) != 1:
        raise InputError(f"the derivatives of a model must share one reference, these have {len(references)}")
    return references.pop()
