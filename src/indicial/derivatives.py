r"""A table of derivatives: value, uncertainty, method, condition and reference, one record each."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from indicial.conventions import RateNormalisation, ReferenceQuantities
from indicial.errors import InputError
from indicial.files import parse_json, write_text
from indicial.motion import FlightCondition

if TYPE_CHECKING:
    from matplotlib.axes import Axes

SCHEMA_VERSION = 1

METHODS = (
    "mrf",
    "fom",
    "irm",
    "operator",
    "identified",
    "measured",
    "reduced_frequency",
    "adjoint",
    "rom",
    "theory",
)
REDUCTIONS = ("phase_angle", "regression", "fourier")


@dataclass(frozen=True)
class Derivative:
    """One derivative and all that is needed to compare it with another.

    Parameters
    ----------
    name : str
        ``CN_alpha``, ``Cm_q``, ``Cm_alphadot``, ``Cm_q+Cm_alphadot``, ``Cl_p``, ``CA_0``, ...: per rad, rates
        as `rate_normalisation` says.
    method : str
        One of `METHODS`.
    value : float
    mach, alpha_deg, beta_deg : float
        Condition.
    source : str
        Who or what made it.
    reference_length_m, reference_area_m2 : float
    moment_reference_m : tuple of float
        (x, y, z) from the nose, x aft [m].
    uncertainty : float, optional
        Half-width of about one standard deviation, in units of the value.
    k, amplitude_deg, reduction : optional
        Of a forced oscillation or of a step, where they apply.
    axes : str
    rate_normalisation : {"c/2V", "c/V"}
    """

    name: str
    method: str
    value: float
    mach: float
    alpha_deg: float
    beta_deg: float
    source: str
    reference_length_m: float
    reference_area_m2: float
    moment_reference_m: tuple[float, float, float]
    uncertainty: float | None = None
    k: float | None = None
    amplitude_deg: float | None = None
    reduction: str | None = None
    axes: str = "body"
    rate_normalisation: RateNormalisation = "c/2V"

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise InputError(f"derivative method {self.method!r} is none of {', '.join(METHODS)}")
        if self.reduction is not None and self.reduction not in REDUCTIONS:
            raise InputError(f"reduction {self.reduction!r} is none of {', '.join(REDUCTIONS)}")
        if not math.isfinite(self.value):
            raise InputError(f"derivative {self.name} by {self.method} is {self.value}, must be finite")

    @classmethod
    def at(
        cls,
        condition: FlightCondition,
        reference: ReferenceQuantities,
        name: str,
        method: str,
        value: float,
        source: str,
        *,
        uncertainty: float | None = None,
        k: float | None = None,
        amplitude: float | None = None,
        reduction: str | None = None,
    ) -> Derivative:
        """A derivative at a flight condition, `amplitude` in rad."""
        return cls(
            name=name,
            method=method,
            value=float(value),
            mach=condition.mach,
            alpha_deg=math.degrees(condition.alpha),
            beta_deg=math.degrees(condition.beta),
            source=source,
            reference_length_m=reference.length,
            reference_area_m2=reference.area,
            moment_reference_m=reference.moment_reference,
            uncertainty=uncertainty,
            k=k,
            amplitude_deg=None if amplitude is None else math.degrees(amplitude),
            reduction=reduction,
            rate_normalisation=reference.rate_normalisation,
        )


@dataclass(frozen=True)
class DerivativeTable:
    """Derivatives of any methods and conditions, in the order they were added."""

    records: tuple[Derivative, ...] = field(default_factory=tuple)

    def __iter__(self) -> Iterator[Derivative]:
        return iter(self.records)

    def __len__(self) -> int:
        return len(self.records)

    def __add__(self, other: DerivativeTable | Iterable[Derivative]) -> DerivativeTable:
        return DerivativeTable(self.records + tuple(other))

    def select(self, **wanted: Any) -> DerivativeTable:
        """Records whose fields equal `wanted`: ``table.select(method="mrf", name="Cm_q")``."""
        return DerivativeTable(
            tuple(r for r in self.records if all(getattr(r, key) == value for key, value in wanted.items()))
        )

    def one(self, name: str, **wanted: Any) -> Derivative:
        """The single record of that name.

        Raises
        ------
        InputError
            If there is none, or more than one.
        """
        found = self.select(name=name, **wanted)
        if len(found) != 1:
            detail = "".join(f", {key} {value}" for key, value in wanted.items())
            raise InputError(f"{len(found)} records of {name}{detail} in the table, one is needed")
        return found.records[0]

    def value(self, name: str, **wanted: Any) -> float:
        """The value of `one`."""
        return self.one(name, **wanted).value

    def names(self) -> tuple[str, ...]:
        """Names in order of first appearance."""
        return tuple(dict.fromkeys(r.name for r in self.records))

    def with_sums(self) -> DerivativeTable:
        """The table with ``Cm_q+Cm_alphadot`` and ``CN_q+CN_alphadot`` added where both parts have one source."""
        added = []
        for record in self.records:
            coefficient, _, motion = record.name.partition("_")
            if motion != "q":
                continue
            twin = replace(record, name=f"{coefficient}_alphadot")
            partners = [
                r for r in self.records if replace(r, value=record.value, uncertainty=record.uncertainty) == twin
            ]
            total = f"{coefficient}_q+{coefficient}_alphadot"
            if len(partners) == 1:
                parts = (record.uncertainty, partners[0].uncertainty)
                spread = None if None in parts else math.hypot(*(u for u in parts if u is not None))
                added.append(replace(record, name=total, value=record.value + partners[0].value, uncertainty=spread))
        return self + added

    def to_records(self) -> list[dict[str, Any]]:
        """Plain records, as they stand in ``results.json``."""
        return [{**asdict(r), "moment_reference_m": list(r.moment_reference_m)} for r in self.records]

    @classmethod
    def from_records(cls, records: Iterable[dict[str, Any]]) -> Self:
        """Inverse of `to_records`."""
        built = []
        for values in records:
            try:
                x, y, z = values["moment_reference_m"]
                built.append(Derivative(**{**values, "moment_reference_m": (x, y, z)}))
            except (KeyError, TypeError, ValueError) as error:
                raise InputError(f"bad derivative record {values.get('name', values)!r}: {error}") from error
        return cls(tuple(built))

    def to_json(self, path: str | Path) -> None:
        """Write the table as a JSON file with a schema version."""
        write_text(path, json.dumps({"schema_version": SCHEMA_VERSION, "derivatives": self.to_records()}, indent=1))

    @classmethod
    def from_json(cls, path: str | Path) -> Self:
        """Read the derivatives of `to_json`, or of any ``results.json``."""
        content = parse_json(path)
        if not isinstance(content, dict) or content.get("schema_version") != SCHEMA_VERSION:
            raise InputError(f"{path}: schema_version must be {SCHEMA_VERSION}")
        return cls.from_records(content.get("derivatives", []))

    def summary(self) -> str:
        """A text table, one record a line."""
        rows = [f"{'derivative':<18}{'method':<12}{'reduction':<13}{'k':>7}{'value':>13}  uncertainty"]
        for r in self.records:
            k = "" if r.k is None else f"{r.k:g}"
            spread = "" if r.uncertainty is None else f"+- {r.uncertainty:.2g}"
            rows.append(f"{r.name:<18}{r.method:<12}{r.reduction or '':<13}{k:>7}{r.value:>13.5g}  {spread}")
        return "\n".join(rows)

    def plot(self, name: str, ax: Axes | None = None) -> Axes:
        """One derivative against Mach number, a series for each method and source."""
        import matplotlib.pyplot as plt

        axes: Axes = plt.subplots()[1] if ax is None else ax
        chosen = self.select(name=name).records
        for method, source in dict.fromkeys((r.method, r.source) for r in chosen):
            series = sorted((r for r in chosen if (r.method, r.source) == (method, source)), key=lambda r: r.mach)
            spread = [r.uncertainty or 0.0 for r in series]
            axes.errorbar(
                [r.mach for r in series], [r.value for r in series], spread, fmt="o-", label=f"{method}: {source}"
            )
        axes.set_xlabel("Mach number")
        axes.set_ylabel(f"{name} [1/rad]")
        axes.legend()
        return axes
