r"""Lift, drag and moment of sections against incidence and Reynolds number, to and beyond stall.

A `PolarSource` gives the polar of a section at a Reynolds number: `NeuralFoil`, a network trained on XFOIL's solutions
(Sharpe and Hansman, 2025), or `PolarTables`, a user's own. Each polar has a range in which it is to be trusted. Beyond
it a section is taken for a flat plate in separated flow, with

    cn = 1 / (0.222 + 0.283/sin alpha),   acting at 0.5 - 0.175 (1 - 2 alpha/pi) chords

(Hoerner, Fluid-Dynamic Drag, 1965; centre of pressure of Lindenburg, ECN-C--03-025, 2003), met from the end of the
range within `JOIN`; whoever reads it there is told so by `Polar.covers`.
"""

from __future__ import annotations

import csv
import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from scipy.interpolate import PchipInterpolator

from indicial.cfd.shapes import WingSection
from indicial.conventions import Array
from indicial.errors import InputError
from indicial.files import write_text

JOIN = math.radians(10.0)
"""Incidence beyond the end of a polar's range over which its values fade into the plate's [rad]."""

GRID = np.linspace(-math.pi, math.pi, 1441)
"""Incidences of a polar carried all round, a quarter of a degree apart [rad]."""

CONFIDENCE = 0.5
"""Least confidence that a network's own analysis must have in a value within the range of a polar."""

_COLUMNS = ("section", "reynolds", "alpha_deg", "cl", "cd", "cm")


@dataclass(frozen=True)
class Polar:
    """One section at one Reynolds number.

    Parameters
    ----------
    section : str
    reynolds : float
        On the chord.
    alpha : ndarray
        Increasing incidences against the chord [rad], within half a turn to both sides, shape (n,).
    cl, cd, cm : ndarray
        Lift, drag, and nose-up moment about the quarter chord, shape (n,).
    trusted : tuple of float, optional
        Incidences between which the values are to be trusted [rad]; all of them if not given.

    Raises
    ------
    InputError
        If they are no such table.
    """

    section: str
    reynolds: float
    alpha: Array
    cl: Array
    cd: Array
    cm: Array
    trusted: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        name = f"polar of {self.section!r} at Re {self.reynolds:.3g}"
        if not (math.isfinite(self.reynolds) and self.reynolds > 0.0):
            raise InputError(f"{name}: Reynolds number must be positive and finite")
        for field in ("alpha", "cl", "cd", "cm"):
            values = np.asarray(getattr(self, field), dtype=float)
            if values.shape != np.shape(self.alpha) or values.ndim != 1 or not np.all(np.isfinite(values)):
                raise InputError(f"{name}: {field} must be finite and as long as alpha")
            object.__setattr__(self, field, values)
        if self.alpha.size < 5 or np.any(np.diff(self.alpha) <= 0.0) or np.max(np.abs(self.alpha)) > math.pi + 1e-12:
            raise InputError(f"{name}: alpha must be at least five increasing angles from -pi to pi rad")
        if not self.alpha[0] < 0.0 < self.alpha[-1]:
            raise InputError(f"{name}: alpha must reach from below to above zero")
        if np.any(self.cd < 0.0):
            raise InputError(f"{name}: cd must be at least 0")

    @property
    def range(self) -> tuple[float, float]:
        """Incidences between which the values are to be trusted [rad]."""
        return self.trusted or (float(self.alpha[0]), float(self.alpha[-1]))

    def covers(self, alpha: Array) -> Array:
        """Whether incidences [rad] are within the trusted range (booleans)."""
        low, high = self.range
        return np.asarray((alpha >= low - 1e-12) & (alpha <= high + 1e-12))

    @cached_property
    def full(self) -> Polar:
        """Carried all round on `GRID`: the trusted values, and a separated plate beyond."""
        low, high = self.range
        inside = np.clip(GRID, low, high)
        beyond = np.abs(GRID - inside)
        weight = np.clip(1.0 - beyond / JOIN, 0.0, 1.0)
        weight = weight**2 * (3.0 - 2.0 * weight)
        columns = [
            plate + weight * (PchipInterpolator(self.alpha, values)(inside) - end)
            for values, plate, end in zip(
                (self.cl, self.cd, self.cm), plate_loads(GRID), plate_loads(inside), strict=True
            )
        ]
        return replace(
            self, alpha=GRID, cl=columns[0], cd=np.maximum(columns[1], 0.0), cm=columns[2], trusted=(low, high)
        )

    def summary(self) -> str:
        """One line."""
        low, high = (math.degrees(end) for end in self.range)
        top = int(np.argmax(np.where(np.abs(self.alpha) < 0.5 * math.pi, self.cl, -np.inf)))
        return (
            f"{self.section} at Re {self.reynolds:.3g}: {low:.1f} to {high:.1f} deg, "
            f"cl max {self.cl[top]:.3f} at {math.degrees(self.alpha[top]):.1f} deg"
        )


PolarSource = Callable[[WingSection, float], Polar]
"""The polar of a section at a Reynolds number."""


def plate_loads(alpha: Array) -> tuple[Array, Array, Array]:
    """cl, cd and cm about the quarter chord of a separated flat plate at any incidence [rad]."""
    sine, cosine = np.sin(alpha), np.cos(alpha)
    size = np.abs(sine)
    normal = np.sign(sine) * size / (0.222 * size + 0.283)
    folded = np.arctan2(size, np.abs(cosine))
    centre = 0.5 - 0.175 * (1.0 - 2.0 * folded / math.pi)
    # from behind the trailing edge leads
    centre = np.where(cosine >= 0.0, centre, 1.0 - centre)
    return normal * cosine, normal * sine, -normal * (centre - 0.25)


def mixed(polars: Iterable[tuple[Polar, float]]) -> Polar:
    """The weighted mean of polars, all round, trusted where all of a weight are."""
    parts = [(polar.full, weight) for polar, weight in polars if weight > 0.0]
    total = sum(weight for _, weight in parts)

    def mean(name: str) -> Array:
        return np.asarray(sum(weight * getattr(polar, name) for polar, weight in parts) / total)

    low = max(polar.range[0] for polar, _ in parts)
    high = min(polar.range[1] for polar, _ in parts)
    first = parts[0][0]
    return Polar(first.section, first.reynolds, GRID, mean("cl"), mean("cd"), mean("cm"), (low, high))


@dataclass(frozen=True)
class PolarTables:
    """A user's own polars: linear in the logarithm of the Reynolds number between those given.

    Parameters
    ----------
    polars : mapping
        By the name of the section, in the order of Reynolds numbers.
    """

    polars: Mapping[str, tuple[Polar, ...]]

    @classmethod
    def of(cls, polars: Iterable[Polar]) -> Self:
        """From polars in any order."""
        found: dict[str, list[Polar]] = defaultdict(list)
        for polar in polars:
            found[polar.section].append(polar)
        return cls({name: tuple(sorted(listed, key=lambda p: p.reynolds)) for name, listed in found.items()})

    def __call__(self, section: WingSection, reynolds: float) -> Polar:
        """The polar at a Reynolds number.

        Raises
        ------
        InputError
            If there is none of that section, or the Reynolds number is outside those given (a single one serves all).
        """
        if section.name not in self.polars:
            raise InputError(
                f"section {section.name!r} has no polar data; there are {', '.join(self.polars) or 'none'}"
            )
        listed = self.polars[section.name]
        if len(listed) == 1:
            return listed[0]
        places = np.log([polar.reynolds for polar in listed])
        place = math.log(reynolds)
        if not places[0] - 1e-9 <= place <= places[-1] + 1e-9:
            span = f"{listed[0].reynolds:.3g} to {listed[-1].reynolds:.3g}"
            raise InputError(f"section {section.name!r}: Re {reynolds:.3g} is outside its polars, {span}")
        n = int(np.clip(np.searchsorted(places, place) - 1, 0, len(listed) - 2))
        outer = float(np.clip((place - places[n]) / (places[n + 1] - places[n]), 0.0, 1.0))
        return replace(mixed([(listed[n], 1.0 - outer), (listed[n + 1], outer)]), reynolds=reynolds)

    @classmethod
    def from_csv(cls, path: Path) -> Self:
        """A file with the columns section, reynolds, alpha_deg, cl, cd, cm; lines that begin with # are its source.

        Raises
        ------
        InputError
            If it is not one.
        """
        try:
            lines = path.read_text(encoding="utf-8").splitlines()
        except OSError as error:
            raise InputError(f"{path}: not a readable file ({error})") from error
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
        missing = [name for name in _COLUMNS if not rows or name not in rows[0]]
        if missing:
            raise InputError(f"{path}: columns must be {', '.join(_COLUMNS)}; {', '.join(missing)} not found")
        groups: dict[tuple[str, float], list[list[float]]] = defaultdict(list)
        try:
            for row in rows:
                groups[row["section"], float(row["reynolds"])].append([float(row[name]) for name in _COLUMNS[2:]])
        except (TypeError, ValueError) as error:
            raise InputError(f"{path}: {error}") from error
        polars = []
        for (name, reynolds), values in groups.items():
            alpha, cl, cd, cm = np.array(values).T
            polars.append(Polar(name, reynolds, np.radians(alpha), cl, cd, cm))
        return cls.of(polars)

    def to_csv(self, path: Path, source: str) -> None:
        """Write the trusted part of all polars, with a source line."""
        rows = [f"# {source}", ",".join(_COLUMNS)]
        for listed in self.polars.values():
            for p in listed:
                for n in np.flatnonzero(p.covers(p.alpha)):
                    values = (math.degrees(p.alpha[n]), p.cl[n], p.cd[n], p.cm[n])
                    numbers = ",".join(f"{v:.8g}" for v in (p.reynolds, *values))
                    rows.append(f"{p.section},{numbers}")
        write_text(path, "\n".join(rows) + "\n")


@dataclass(frozen=True)
class NeuralFoil:
    """Polars of the network of that name (package `neuralfoil`).

    Trusted is the range about zero in which the network's confidence is at least `CONFIDENCE`.

    Parameters
    ----------
    size : str
        Of the network, "xxsmall" to "xxxlarge".
    n_crit : float
        Exponent of the transition criterion.
    transition : float
        Where on both sides the flow is made turbulent at the latest, fraction of the chord; 1 for free transition.
    """

    size: str = "large"
    n_crit: float = 9.0
    transition: float = 1.0

    def __call__(self, section: WingSection, reynolds: float) -> Polar:
        """The polar at a Reynolds number.

        Raises
        ------
        InputError
            If the package is not installed, or the section is none that the network knows.
        """
        try:
            import neuralfoil  # type: ignore[import-untyped]
        except ImportError as error:
            raise InputError(
                "polars by default need the package neuralfoil: pip install 'indicial[lattice]'"
            ) from error
        if 2.0 * float(np.max(section.half_thickness)) < 0.02:
            raise InputError(
                f"section {section.name!r} has no polar data: the network knows none so thin; give a table"
            )
        degrees = np.arange(-30.0, 40.5, 0.5)
        found = neuralfoil.get_aero_from_coordinates(
            section.coordinates(),
            degrees,
            reynolds,
            n_crit=self.n_crit,
            model_size=self.size,
            xtr_upper=self.transition,
            xtr_lower=self.transition,
        )
        sure = np.asarray(found["analysis_confidence"]) >= CONFIDENCE
        middle = int(np.searchsorted(degrees, 0.0))
        if not sure[middle]:
            raise InputError(
                f"section {section.name!r} at Re {reynolds:.3g} has no polar data: the network is not sure of it"
            )
        low = middle - int(np.argmin(np.append(sure[middle::-1], False))) + 1
        high = middle + int(np.argmin(np.append(sure[middle:], False))) - 1
        part = slice(low, high + 1)
        cl, cd, cm = (np.asarray(found[name], dtype=float)[part] for name in ("CL", "CD", "CM"))
        return Polar(section.name, reynolds, np.radians(degrees[part]), cl, cd, cm)
