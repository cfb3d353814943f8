"""The three reductions of a group of shots side by side, as the ranges print them: linear, single fit, multiple fit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from indicial.errors import DivergenceError, InputError
from indicial.flightsim import Atmosphere, DerivativeAerodynamics, Earth, Vehicle
from indicial.identification.estimate import Estimate
from indicial.identification.linear_theory import LinearTheory
from indicial.identification.measurement import RangeRecord
from indicial.identification.range_fit import FREE_FLIGHT, RangeFit, RangeModel, identify

_PROBABLE = 0.6744897501960817


@dataclass(frozen=True)
class RangeReduction:
    """A group of shots reduced three ways.

    Parameters
    ----------
    linear : tuple of LinearTheory
        Of each shot.
    single : tuple of RangeFit or None
        Six degrees of freedom, each shot by itself; None where it does not converge.
    multiple : RangeFit
        All together, coefficients in common: the best estimate.
    """

    linear: tuple[LinearTheory, ...]
    single: tuple[RangeFit | None, ...]
    multiple: RangeFit

    @property
    def names(self) -> tuple[str, ...]:
        """Coefficients of the multiple fit."""
        return tuple(e.name for e in self.multiple.derivatives)

    def rows(self) -> list[dict[str, Any]]:
        """One row a shot and reduction, then the multiple fit: coefficients and probable errors in per cent."""
        found = []
        for i, theory in enumerate(self.linear):
            fit = self.single[i]
            yaw = math.degrees(1.0) ** 2 * theory.mean_square_yaw
            found.append(self._row(f"shot {i + 1}", "linear", theory.mach, yaw, theory.derivatives))
            if fit is not None:
                yaw = math.degrees(1.0) ** 2 * fit.mean_square_yaw
                found.append(self._row(f"shot {i + 1}", "single", fit.mach, yaw, fit.derivatives))
        best = self.multiple
        yaw = math.degrees(1.0) ** 2 * best.mean_square_yaw
        return [*found, self._row("all", "multiple", best.mach, yaw, best.derivatives)]

    def _row(self, shot: str, kind: str, mach: float, yaw: float, estimates: tuple[Estimate, ...]) -> dict[str, Any]:
        row: dict[str, Any] = {"shot": shot, "reduction": kind, "mach": mach, "mean_square_yaw_deg2": yaw}
        for e in estimates:
            if e.name in self.names:
                row[e.name] = e.value
                row[f"{e.name}_pe_pct"] = 100.0 * _PROBABLE * e.standard_error / abs(e.value) if e.value else math.nan
        return row

    def summary(self) -> str:
        """The table: value and probable error in per cent."""
        head = f"{'shot':<8}{'reduction':<10}{'Mach':>7}{'yaw^2':>7}" + "".join(f"{n:>24}" for n in self.names)
        lines = [head]
        for row in self.rows():
            cells = "".join(
                f"{row[n]:>14.5g} ({row[f'{n}_pe_pct']:>5.2g}%) " if n in row else f"{'-':>24}" for n in self.names
            )
            lines.append(
                f"{row['shot']:<8}{row['reduction']:<10}{row['mach']:>7.3f}{row['mean_square_yaw_deg2']:>7.2f}{cells}"
            )
        lines += [f"shot {i + 1}: the single fit does not converge" for i, fit in enumerate(self.single) if fit is None]
        return "\n".join([*lines, "yaw^2: mean square total yaw [deg^2]; in brackets probable errors, 0.6745 sigma"])


def reduce_range(
    records: Sequence[RangeRecord],
    vehicle: Vehicle,
    aerodynamics: DerivativeAerodynamics | None = None,
    free: Sequence[str] = FREE_FLIGHT,
    *,
    atmosphere: Atmosphere | None = None,
    earth: Earth | None = None,
    model: RangeModel | None = None,
) -> RangeReduction:
    """Reduce a group of shots by linear theory, by single fits and by a multiple fit.

    Parameters
    ----------
    records : sequence of RangeRecord
        Shots near enough in Mach number that their coefficients are one.
    vehicle, aerodynamics, free, atmosphere, earth, model
        As `identify`.

    Raises
    ------
    InputError, DivergenceError
        What `identify` raises for all shots together.
    """
    shots = tuple(records)
    if not shots:
        raise InputError("a range reduction needs at least one record")
    if model is None:
        roll = shots[0].roll is not None
        model = RangeModel.of(vehicle, aerodynamics, free, roll=roll, atmosphere=atmosphere, earth=earth)
    multiple = identify(shots, vehicle, model=model)
    single: list[RangeFit | None] = []
    for shot in shots:
        try:
            single.append(identify(shot, vehicle, model=model))
        except DivergenceError:
            single.append(None)
    return RangeReduction(multiple.theories, tuple(single), multiple)
