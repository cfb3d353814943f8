"""A figure that was asked for: what it must reach, what it came to, and where it is worst."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from indicial.conventions import Array


@dataclass(frozen=True)
class Claim:
    """One asked figure.

    Parameters
    ----------
    name : str
    value : float or None
        As a fraction or in the figure's own unit; None where nothing is computed yet.
    target : float or None
        Largest value allowed; None for a figure that is only reported.
    worst : str
        Where it is worst, in words.
    note : str
        What the reader must know of it.
    unit : str
        ``%`` for fractions, else the unit of value and target.
    complete : bool
        Whether all points that the figure asks for are computed; if not, it does not hold.
    """

    name: str
    value: float | None
    target: float | None
    worst: str = ""
    note: str = ""
    unit: str = "%"
    complete: bool = True

    @property
    def holds(self) -> bool:
        """Whether the target is reached; a figure that is only reported holds once it is computed."""
        if self.value is None or not math.isfinite(self.value) or not self.complete:
            return False
        return self.target is None or self.value <= self.target

    @property
    def verdict(self) -> str:
        """In two words at most."""
        if self.value is None:
            return "NOT COMPUTED"
        if not self.complete:
            return "INCOMPLETE"
        if not self.holds:
            return "FALLS SHORT"
        return "reported" if self.target is None else "holds"

    def summary(self, width: int = 66) -> str:
        """One line, with so many places for the name."""
        detail = "; ".join(part for part in (self.worst, self.note) if part)
        target = "" if self.target is None else f"at most {self._shown(self.target, 0)}"
        return (
            f"{self.name:<{width}} {self._shown(self.value, 2):>9}  {target:<14}  {self.verdict:<12}  {detail}".rstrip()
        )

    def _shown(self, value: float | None, digits: int) -> str:
        if value is None:
            return "-"
        if self.unit != "%":
            return f"{value:.{digits}f} {self.unit}"
        if digits == 0:
            return f"{100.0 * value:.3g}%"
        return f"{value:.{digits}%}" if value >= 1e-3 or value == 0.0 else f"{100.0 * value:.1g}%"


def summarise(claims: Sequence[Claim]) -> str:
    """One line for each claim, in columns."""
    width = max((len(claim.name) for claim in claims), default=0)
    return "\n".join(claim.summary(width) for claim in claims)


def relative_rms(name: str, target: float | None, mach: Sequence[float], found: Array, wanted: Array) -> Claim:
    """RMS relative deviation of `found` from `wanted` over Mach numbers, its worst point named."""
    if len(mach) == 0:
        return Claim(name, None, target)
    deviation = np.asarray(found) / np.asarray(wanted) - 1.0
    worst = int(np.argmax(np.abs(deviation)))
    where = f"worst {deviation[worst]:+.1%} at M {mach[worst]:g} of {len(mach)} points"
    return Claim(name, float(np.sqrt(np.mean(deviation**2))), target, where)


def largest(name: str, target: float | None, mach: Sequence[float], deviation: Array) -> Claim:
    """Largest of relative deviations over Mach numbers."""
    if len(mach) == 0:
        return Claim(name, None, target)
    size = np.abs(np.asarray(deviation))
    worst = int(np.argmax(size))
    return Claim(name, float(size[worst]), target, f"worst at M {mach[worst]:g} of {len(mach)} points")
