"""The protocol that every solver satisfies: finite volumes, lattice, a ROM, exact theory."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from numpy.typing import ArrayLike

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities
from indicial.history import History
from indicial.motion import FlightCondition, Motion, Rates


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
