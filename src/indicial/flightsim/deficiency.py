r"""Loads with memory on top of any other model: exponential deficiency functions of the incidence.

    CN = CN' - integral_0^s F_N(s - sigma) (de/dsigma) dsigma,      F_N(s) = sum_i a_Ni exp(-b_i s),

Cm likewise, s = 2Vt/c and CN' the other model's, whose static derivatives are those that a step in incidence settles
at (Eqs. 13 to 15). Each term is a lag state ``dx_i/ds = b_i (e - x_i)``, and the integral ``sum_i a_i (e - x_i)``. A
motion slow against b feels ``C_alphadot = -sum_i a_i/b_i`` and no more (Eq. 17): what it cannot tell from the
derivative.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca

from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.flightsim.aerodynamics import AerodynamicLoads, Aerodynamics, FlowState, LagAxes, Validity
from indicial.flightsim.expressions import free_symbols, is_number


@dataclass(frozen=True, kw_only=True)
class DeficiencyTerm:
    """``a exp(-b s)`` of the deficiency of the normal force and of the pitching moment.

    Parameters
    ----------
    rate : float or casadi symbol
        b, per unit of s = 2Vt/c, positive.
    CN, Cm : float or casadi symbol
        a, per rad: what is still missing right after a step in incidence.
    """

    rate: Any
    CN: Any = 0.0
    Cm: Any = 0.0

    def __post_init__(self) -> None:
        if is_number(self.rate) and not float(self.rate) > 0.0:
            raise InputError(f"rate of a deficiency term is {self.rate}, must be positive")


@dataclass(frozen=True, kw_only=True)
class DeficiencyAerodynamics:
    """Another model's loads less the deficiency of the incidence.

    Parameters
    ----------
    base : Aerodynamics
        Any model; its reference and validity are those of the whole.
    terms : tuple of DeficiencyTerm
    planes : {"pitch", "both"}
        Whether sideslip of a missile of rotational symmetry has the same memory.
    lag_axes : {"non_rolling", "body"}
        As `SymmetricMissile`'s, for memory in both planes.

    Raises
    ------
    InputError
        If there is no term, a choice is unknown, or rates are not made dimensionless by c/2V.
    """

    base: Aerodynamics
    terms: tuple[DeficiencyTerm, ...]
    planes: Literal["pitch", "both"] = "pitch"
    lag_axes: LagAxes = "non_rolling"

    def __post_init__(self) -> None:
        if not self.terms:
            raise InputError("a model with deficiency functions needs at least one term")
        if self.planes not in ("pitch", "both") or self.lag_axes not in ("non_rolling", "body"):
            raise InputError(
                f"planes is {self.planes!r} and lag_axes {self.lag_axes!r}, must be 'pitch' or 'both', "
                "'non_rolling' or 'body'"
            )
        if self.reference.rate_normalisation != "c/2V":
            raise InputError("deficiency functions are of s = 2Vt/c: the reference must say rate_normalisation c/2V")

    @property
    def reference(self) -> ReferenceQuantities:
        """The base's."""
        return self.base.reference

    @property
    def validity(self) -> Validity:
        """The base's."""
        return self.base.validity

    @property
    def parameters(self) -> tuple[Any, ...]:
        """Free casadi symbols: the base's, then those of the terms."""
        own = (value for term in self.terms for value in (term.rate, term.CN, term.Cm))
        return free_symbols([*self.base.parameters, *own])

    @property
    def lag_names(self) -> tuple[str, ...]:
        """The base's, then ``deficiency_pitch_0, ...`` and, in both planes, ``deficiency_yaw_0, ...``."""
        planes = ("pitch",) if self.planes == "pitch" else ("pitch", "yaw")
        return (*self.base.lag_names, *(f"deficiency_{p}_{i}" for p in planes for i in range(len(self.terms))))

    def loads(self, flow: FlowState, lag: Any) -> AerodynamicLoads:
        """Force and moment about the moment reference point."""
        known, pitch, yaw = self._split(lag)
        force, moment = self.base.loads(flow, known)
        static = 0.5 * flow.density * flow.speed**2 * self.reference.area
        chord = static * self.reference.length
        normal, pitching = self._owed(flow.incidence[1], pitch)
        # what is owed is subtracted: N = -Z, M = M_y
        force, moment = force + ca.vertcat(0, 0, static * normal), moment - ca.vertcat(0, chord * pitching, 0)
        if self.planes == "both":
            side, yawing = self._owed(flow.incidence[0], yaw)
            force, moment = force + ca.vertcat(0, static * side, 0), moment + ca.vertcat(0, 0, chord * yawing)
        return AerodynamicLoads(force, moment)

    def lag_rate(self, flow: FlowState, lag: Any) -> Any:
        """``(2V/c) b (e - x)`` of each term, turned with the roll if the axes do not roll [1/s]."""
        known, pitch, yaw = self._split(lag)
        pace = 2.0 * flow.speed / self.reference.length
        rates = ca.vertcat(*(term.rate for term in self.terms))
        pitching = pace * rates * (flow.incidence[1] - pitch)
        if self.planes == "pitch":
            return ca.vertcat(self.base.lag_rate(flow, known), pitching)
        yawing = pace * rates * (flow.incidence[0] - yaw)
        if self.lag_axes == "non_rolling":
            spin = flow.rate[0]
            pitching, yawing = pitching - spin * yaw, yawing + spin * pitch
        return ca.vertcat(self.base.lag_rate(flow, known), pitching, yawing)

    def summary(self) -> str:
        """The base's, and the terms."""
        told = ", ".join(f"exp(-{t.rate!s:.6} s) of CN {t.CN!s:.6} and Cm {t.Cm!s:.6}" for t in self.terms)
        return f"{type(self.base).__name__} less deficiencies {told}"

    def _split(self, lag: Any) -> tuple[Any, Any, Any]:
        first, count = len(self.base.lag_names), len(self.terms)
        return lag[:first], lag[first : first + count], lag[first + count :]

    def _owed(self, incidence: Any, states: Any) -> tuple[Any, Any]:
        normal, moment = ca.SX(0.0), ca.SX(0.0)
        for i, term in enumerate(self.terms):
            normal, moment = normal + term.CN * (incidence - states[i]), moment + term.Cm * (incidence - states[i])
        return normal, moment
