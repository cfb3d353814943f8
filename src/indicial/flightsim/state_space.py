r"""Loads of a missile from state-space models in reduced time: one, or a schedule of them over the Mach number."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from indicial.conventions import Array, ReferenceQuantities
from indicial.errors import InputError
from indicial.flightsim.aerodynamics import DerivativeAerodynamics, FlowState, SymmetricMissile, Validity
from indicial.flightsim.expressions import MACH, hat_weights, table

if TYPE_CHECKING:
    from control import StateSpace

Matrices = tuple[Any, Any, Any, Any]

_INPUTS, _OUTPUTS = ("alpha", "q"), ("CN", "Cm")
_SHARED = fields(SymmetricMissile)


@dataclass(frozen=True, kw_only=True)
class _LagAerodynamics(SymmetricMissile):
    """What one model and a schedule have in common."""

    @property
    @abstractmethod
    def order(self) -> int:
        """Lag states of one plane."""

    @abstractmethod
    def matrices_in(self, flow: FlowState) -> Matrices:
        """A, B, C, D in a flow, as casadi matrices."""

    @property
    def lag_names(self) -> tuple[str, ...]:
        """``lag_pitch_0, ..., lag_yaw_0, ...``."""
        return tuple(f"lag_{plane}_{i}" for plane in ("pitch", "yaw") for i in range(self.order))

    def plane(self, flow: FlowState, incidence: Any, rate: Any, turning: Any, lag: Any) -> tuple[Any, Any]:
        """Normal force [N] and moment [N m] of one plane."""
        del turning
        _, _, c, d = self.matrices_in(flow)
        static = 0.5 * flow.density * flow.speed**2 * self.reference.area
        damping = flow.density * self.rate_scale * flow.speed
        load = static * (ca.mtimes(c, lag) + d[:, 0] * incidence) + damping * d[:, 1] * rate
        return load[0], self.reference.length * load[1]

    def lag_rate(self, flow: FlowState, lag: Any) -> Any:
        """``(2V/c)(A x + B_1 e) + B_2 q`` of both planes, turned with the roll if they do not roll [1/s]."""
        pitch, yaw = lag[: self.order], lag[self.order :]
        pitch_rate = self._plane_lag_rate(flow, flow.incidence[1], flow.rate[1], pitch)
        yaw_rate = self._plane_lag_rate(flow, flow.incidence[0], -flow.rate[2], yaw)
        if self.lag_axes == "body":
            return ca.vertcat(pitch_rate, yaw_rate)
        spin = flow.rate[0]
        return ca.vertcat(pitch_rate - spin * yaw, yaw_rate + spin * pitch)

    def _derivatives(self, steady: Any, slope: Any) -> DerivativeAerodynamics:
        """Of H(0) and H'(0), rows (CN, Cm), columns (alpha, q)."""
        return DerivativeAerodynamics(
            CN_alpha=steady[0][0],
            CN_q=steady[0][1],
            Cm_alpha=steady[1][0],
            Cm_q=steady[1][1],
            CN_alphadot=slope[0][0],
            Cm_alphadot=slope[1][0],
            **{item.name: getattr(self, item.name) for item in _SHARED},
        )

    def _plane_lag_rate(self, flow: FlowState, incidence: Any, rate: Any, lag: Any) -> Any:
        a, b, _, _ = self.matrices_in(flow)
        return 2.0 * flow.speed / self.reference.length * (ca.mtimes(a, lag) + b[:, 0] * incidence) + b[:, 1] * rate


@dataclass(frozen=True, kw_only=True)
class StateSpaceAerodynamics(_LagAerodynamics):
    r"""Loads of a missile of fourfold symmetry from a state-space model in reduced time ``s = 2Vt/c``.

    In each plane ``dx/ds = A x + B (e, q c/2V)``, ``(CN, Cm) = C x + D (e, q c/2V)``, advanced with ``ds = (2V/c) dt``,
    V varying: ``dx/dt = (2V/c)(A x + B_1 e) + B_2 q``.

    Parameters
    ----------
    system : control.StateSpace
        Inputs alpha and ``q c/2V``, outputs CN and Cm, increments about zero incidence, time in s; taken by
        name if the system's signals are named ``alpha``, ``q``, ``CN`` and ``Cm`` (further outputs are left alone),
        in this order if not named.

    Raises
    ------
    InputError
        If the system is not of that form, not in continuous time, or not stable.
    """

    system: StateSpace

    def __post_init__(self) -> None:
        super().__post_init__()
        _check(self.system, self.reference)

    @property
    def order(self) -> int:
        """Lag states of one plane."""
        return int(self.system.nstates)

    @property
    def matrices(self) -> tuple[Array, Array, Array, Array]:
        """A, B, C, D with inputs (alpha, q c/2V) and outputs (CN, Cm)."""
        return _matrices(self.system)

    def quasi_steady(self) -> DerivativeAerodynamics:
        r"""The derivatives that the model has at k = 0: ``H_a(0)``, ``H_q(0)`` and ``H_a'(0)``.

        With ``H(s) = D + C (sI - A)^-1 B``: ``H(0) = D - C A^-1 B`` and ``H'(0) = -C A^-2 B``.
        """
        steady, slope = _quasi_steady(self.system)
        return self._derivatives(steady.tolist(), slope.tolist())

    def matrices_in(self, flow: FlowState) -> Matrices:
        """`matrices`, with their zeros left out of the expressions."""
        del flow
        a, b, c, d = (ca.sparsify(ca.DM(matrix)) for matrix in self.matrices)
        return a, b, c, d

    def summary(self) -> str:
        """Order and slowest pole in one line."""
        if not self.system.nstates:
            return "state-space model of order 0"
        slowest = np.max(np.linalg.eigvals(self.system.A).real)
        return f"state-space model of order {self.system.nstates} in each plane, slowest pole {slowest:.4g} per unit s"


@dataclass(frozen=True, kw_only=True)
class ScheduledStateSpaceAerodynamics(_LagAerodynamics):
    r"""Loads from state-space models at several Mach numbers, A to D linear in the Mach number between them.

    Meaningful only for models in the same coordinates, such as those that one schedule gives at its Mach numbers
    (``ScheduledModel.at(mach)``): each lag state must mean the same at all of them. Beyond the first and last Mach
    number their models hold, and the flight is flagged (`validity`).

    Parameters
    ----------
    machs : tuple of float
        Increasing.
    systems : tuple of control.StateSpace
        One for each; as that of `StateSpaceAerodynamics`, all of one order.

    Raises
    ------
    InputError
        If there are fewer than two, their orders differ, one is not of the form, or one between two of them is not
        stable.
    """

    machs: tuple[float, ...]
    systems: tuple[StateSpace, ...]

    def __post_init__(self) -> None:
        super().__post_init__()
        nodes = np.asarray(self.machs, dtype=float)
        if nodes.size < 2 or len(self.systems) != nodes.size or not np.all(np.diff(nodes) > 0.0):
            raise InputError(
                f"a schedule needs two or more increasing Mach numbers and a system for each, not {nodes.size} and "
                f"{len(self.systems)}"
            )
        for system in self.systems:
            _check(system, self.reference)
        orders = {system.nstates for system in self.systems}
        if len(orders) != 1:
            raise InputError(f"systems of a schedule must be of one order, these are of {sorted(orders)}")
        states = [_matrices(system)[0] for system in self.systems]
        for first, one, other in zip(nodes, states, states[1:], strict=False):
            for share in np.linspace(0.0, 1.0, 9):
                if one.size and np.max(np.linalg.eigvals((1.0 - share) * one + share * other).real) >= 0.0:
                    raise InputError(f"the schedule is not stable between Mach {first:g} and the next")
        if self.validity == Validity():
            object.__setattr__(self, "validity", Validity(mach_min=float(nodes[0]), mach_max=float(nodes[-1])))

    @property
    def order(self) -> int:
        """Lag states of one plane."""
        return int(self.systems[0].nstates)

    def at(self, mach: float) -> StateSpaceAerodynamics:
        """The model held at one Mach number.

        Raises
        ------
        InputError
            Outside the schedule.
        """
        nodes = np.asarray(self.machs)
        if not nodes[0] <= mach <= nodes[-1]:
            raise InputError(f"the schedule reaches from Mach {nodes[0]:g} to {nodes[-1]:g}, not to {mach:g}")
        weights = [float(np.interp(mach, nodes, unit)) for unit in np.eye(nodes.size)]
        parts = zip(*(_matrices(system) for system in self.systems), strict=True)
        matrices = [sum(w * m for w, m in zip(weights, part, strict=True)) for part in parts]
        import control

        system = control.ss(*matrices, inputs=list(_INPUTS), outputs=list(_OUTPUTS))
        return StateSpaceAerodynamics(system=system, **{item.name: getattr(self, item.name) for item in _SHARED})

    def matrices_in(self, flow: FlowState) -> Matrices:
        """By the Mach number of the flow."""
        weights = hat_weights(flow.speed / flow.speed_of_sound, np.asarray(self.machs, dtype=float))
        parts = zip(*(_matrices(system) for system in self.systems), strict=True)
        a, b, c, d = (_weighted(weights, part) for part in parts)
        return a, b, c, d

    def quasi_steady(self) -> DerivativeAerodynamics:
        """The derivatives at k = 0 of each Mach number, linear between them."""
        found = [_quasi_steady(system) for system in self.systems]
        steady, slope = (np.array(part) for part in zip(*found, strict=True))
        over_mach = [
            [[table(MACH, self.machs, part[:, i, j]) for j in (0, 1)] for i in (0, 1)] for part in (steady, slope)
        ]
        return self._derivatives(*over_mach)

    def summary(self) -> str:
        """Order and Mach numbers in one line."""
        listed = ", ".join(f"{mach:g}" for mach in self.machs)
        return f"state-space models of order {self.order} in each plane, linear between Mach {listed}"


def _check(system: StateSpace, reference: ReferenceQuantities) -> None:
    if reference.rate_normalisation != "c/2V":
        raise InputError("a state-space model's rate input is q c/2V: its reference must say rate_normalisation c/2V")
    if system.ninputs != 2 or system.noutputs < 2:
        raise InputError(
            f"a state-space model needs inputs (alpha, q c/2V) and outputs (CN, Cm), "
            f"this one has {system.ninputs} and {system.noutputs}"
        )
    _order(system.input_labels, _INPUTS)
    _order(system.output_labels, _OUTPUTS)
    if system.dt:
        raise InputError(f"a state-space model must be in continuous reduced time, this one has dt = {system.dt}")
    if system.nstates and np.max(np.linalg.eigvals(system.A).real) >= 0.0:
        raise InputError("a state-space model must be stable, this one has a pole with real part >= 0")


def _matrices(system: StateSpace) -> tuple[Array, Array, Array, Array]:
    """A, B, C, D with inputs (alpha, q c/2V) and outputs (CN, Cm)."""
    columns, rows = _order(system.input_labels, _INPUTS), _order(system.output_labels, _OUTPUTS)
    a, b, c, d = (np.asarray(m, dtype=float) for m in (system.A, system.B, system.C, system.D))
    return a, b[:, columns], c[rows], d[np.ix_(rows, columns)]


def _quasi_steady(system: StateSpace) -> tuple[Array, Array]:
    """H(0) and H'(0)."""
    a, b, c, d = _matrices(system)
    settled = np.linalg.solve(a, b)
    return d - c @ settled, -c @ np.linalg.solve(a, settled)


def _weighted(weights: list[Any], matrices: Iterable[Array]) -> Any:
    """The weighted sum, with common zeros left out of the expression."""
    total: Any = 0.0
    for weight, matrix in zip(weights, matrices, strict=True):
        total = total + weight * ca.sparsify(ca.DM(matrix))
    return total


def _order(labels: list[str], wanted: tuple[str, ...]) -> list[int]:
    """Where the wanted signals stand: by name if the system names them, in order if it has default names."""
    if all(name in labels for name in wanted):
        return [labels.index(name) for name in wanted]
    if len(labels) == len(wanted) and all("[" in label for label in labels):
        return list(range(len(wanted)))
    raise InputError(f"a state-space model's signals are named {labels}, must be {list(wanted)}")
