"""An identified derivative with its standard error, and the table of several."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from indicial.conventions import ReferenceQuantities
from indicial.derivatives import Derivative, DerivativeTable
from indicial.motion import FlightCondition


@dataclass(frozen=True)
class Estimate:
    """An estimated value.

    Parameters
    ----------
    name : str
    value : float
        Of a derivative: per rad, rates as the reference says; of a state: SI units, radians.
    standard_error : float
        One standard deviation, in units of the value.
    """

    name: str
    value: float
    standard_error: float

    def summary(self) -> str:
        """The estimate in one line."""
        relative = f" ({abs(self.standard_error / self.value):.2g} of it)" if self.value else ""
        return f"{self.name:<18}{self.value:>12.6g} +- {self.standard_error:.3g}{relative}"


def identified_table(
    estimates: Iterable[Estimate], condition: FlightCondition, reference: ReferenceQuantities, source: str
) -> DerivativeTable:
    """Derivatives of method ``identified``, their standard errors as uncertainty."""
    return DerivativeTable(
        tuple(
            Derivative.at(condition, reference, e.name, "identified", e.value, source, uncertainty=e.standard_error)
            for e in estimates
        )
    )
