"""The protocols of solvers (finite volumes, lattice, a ROM, exact theory) and of flows linearised about a state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities
from indicial.errors import InputError
from indicial.frequency import FrequencyResponse
from indicial.history import History
from indicial.motion import FlightCondition, Motion, Rates
from indicial.sensitivity import Sensitivities


@dataclass(frozen=True)
class SteadyLoads:
    """Loads of a steady state.

    Parameters
    ----------
    coefficients : ndarray
        (CA, CY, CN, Cl, Cm, Cn), shape (6,).
    condition : FlightCondition
    rates : Rates
    reference : ReferenceQuantities
    convergence : dict
        How it was got: residual drop, iterations, mesh, ... (plain values).
    """

    coefficients: Array
    condition: FlightCondition
    rates: Rates
    reference: ReferenceQuantities
    convergence: dict[str, float | int | str] = field(default_factory=dict)

    def __getitem__(self, name: str) -> float:
        return float(self.coefficients[COEFFICIENTS.index(name)])


@runtime_checkable
class Solver(Protocol):
    """Motion in, loads out.

    `unsteady` starts from the steady state of ``motion.velocity_before, motion.rate_before`` and returns the
    loads at exactly `times` [s]. ``times[0]`` must be 0 and means t = 0+: after any jump of the motion,
    before the flow has moved (the piston instant). A marching solver takes `times` as its steps.
    """

    @property
    def reference(self) -> ReferenceQuantities:
        """What the loads are made dimensionless with."""
        ...

    def steady(self, condition: FlightCondition, rates: Rates = ...) -> SteadyLoads:
        """Loads of the steady state at constant velocity and body rates."""
        ...

    def unsteady(self, condition: FlightCondition, motion: Motion, times: ArrayLike) -> History:
        """Loads at `times` [s] under `motion`."""
        ...


@runtime_checkable
class PeriodicSolver(Protocol):
    """Periodic motion in, periodic loads out, without a march: the reduced-frequency methods."""

    @property
    def reference(self) -> ReferenceQuantities:
        """What the loads are made dimensionless with."""
        ...

    def periodic(self, condition: FlightCondition, motion: Motion, period: float, harmonics: int = ...) -> History:
        """Loads at the `instants` of one period [s] of the flow that follows `motion`, truncated after `harmonics`.

        There is no start: the history's `before` are its loads at t = 0.
        """
        ...


class SteppedFlow(Protocol):
    """A flow that goes on step by step, under a motion that is not known beforehand.

    Loads are (CA, CY, CN, Cl, Cm, Cn) by the dynamic pressure of the condition it was started with, shape (6,).
    """

    def loads(self) -> Array:
        """Of the accepted state."""
        ...

    def try_step(self, dt: float, velocity: Array, rate: Array) -> Array:
        """Loads a step [s] after the accepted state, under a motion (body axes, m/s and rad/s) reached by then.

        May be tried again with another motion; takes effect with `accept`.
        """
        ...

    def accept(self) -> None:
        """Take the step tried last."""
        ...

    def arrays(self) -> dict[str, Array]:
        """What `restore` needs to go on from the accepted state."""
        ...

    def restore(self, arrays: Mapping[str, Array]) -> None:
        """Go on from stored `arrays`."""
        ...


@runtime_checkable
class SteppingSolver(Protocol):
    """A solver in the loop of a flight: its own loads make the motion that it follows."""

    @property
    def reference(self) -> ReferenceQuantities:
        """What the loads are made dimensionless with."""
        ...

    def stepping(self, condition: FlightCondition, velocity: Array, rate: Array) -> SteppedFlow:
        """The flow at rest in a motion of the moment reference point, body axes [m/s], [rad/s]."""
        ...


def instants(harmonics: int) -> Array:
    """Phases omega t of the N = 2h + 1 equispaced instants that tell h harmonics, from 0, shape (N,).

    Raises
    ------
    InputError
        If `harmonics` is not a whole number of at least 1.
    """
    if not (np.isfinite(harmonics) and harmonics >= 1 and harmonics % 1 == 0):
        raise InputError(f"harmonics is {harmonics}, must be a whole number of at least 1")
    count = 2 * int(harmonics) + 1
    return 2.0 * np.pi * np.arange(count) / count


class LinearisedFlow(Protocol):
    r"""``E dx/ds + J x = -B u``, ``loads - baseline = C x + D u``, in reduced time ``s = 2Vt/c``.

    ``H(ik) = D - C (ik E + J)^{-1} B`` from the inputs u, deviations from `condition`, to the loads.

    Attributes
    ----------
    condition : FlightCondition
    reference : ReferenceQuantities
        Makes loads and rates dimensionless.
    baseline : ndarray
        (CA, CY, CN, Cl, Cm, Cn) of the steady state, shape (6,).
    inputs : tuple of str
        Of alpha, beta [rad] and ``q c/2V, p b/2V, r b/2V``.
    outputs : tuple of str
        Of the six coefficients.
    plane : bool
        Whether the flow is two-dimensional.
    b, c, d : ndarray
        Real, shapes (n, n_inputs), (n_outputs, n), (n_outputs, n_inputs); n unknowns.
    """

    @property
    def condition(self) -> FlightCondition: ...

    @property
    def reference(self) -> ReferenceQuantities: ...

    @property
    def baseline(self) -> Array: ...

    @property
    def inputs(self) -> tuple[str, ...]: ...

    @property
    def outputs(self) -> tuple[str, ...]: ...

    @property
    def plane(self) -> bool: ...

    @property
    def b(self) -> Array: ...

    @property
    def c(self) -> Array: ...

    @property
    def d(self) -> Array: ...

    def apply(self, x: NDArray[Any], *, transposed: bool = False) -> NDArray[Any]:
        """``J x``, or ``J^T x``; x real or complex, shape (n,)."""
        ...

    def apply_mass(self, x: NDArray[Any], *, transposed: bool = False) -> NDArray[Any]:
        """``E x``, or ``E^T x``; E is block diagonal, not symmetric."""
        ...

    def solve(
        self,
        rhs: NDArray[Any],
        shift: complex = 0.0,
        *,
        transposed: bool = False,
        start: NDArray[Any] | None = None,
    ) -> NDArray[Any]:
        """x with ``(shift E + J) x = rhs``, or with the plain transpose (not the conjugate one), shape (n,).

        Real for real `shift` and `rhs`, else complex; iterative from `start`, to a stated relative tolerance.

        Raises
        ------
        DivergenceError
            If the tolerance is not reached.
        """
        ...


@runtime_checkable
class FrequencySolver(Protocol):
    """A solver that linearises itself and answers in the frequency domain."""

    @property
    def reference(self) -> ReferenceQuantities:
        """What the loads are made dimensionless with."""
        ...

    def frequency_response(
        self, condition: FlightCondition, k: ArrayLike = ..., inputs: tuple[str, ...] | None = ...
    ) -> FrequencyResponse:
        """H(ik) from motion to loads at reduced frequencies `k`, with H(0) and H'(0)."""
        ...


@runtime_checkable
class AdjointSolver(Protocol):
    """A solver that gives what its steady loads change with."""

    def sensitivities(self, condition: FlightCondition, rates: Rates = ...) -> Sensitivities:
        """Derivatives of all six coefficients with respect to every input."""
        ...
