r"""Modes over the flight envelope: Mach number and altitude, each mode followed by its shape so that it keeps its name.

From one point to the next modes are paired so that the sum of their modal assurance criteria is largest,

    MAC = |x^H y|^2 / ((x^H x)(y^H y)),

x and y the shapes at the two points (V over the speed, rates over the mode's frequency), less how far the eigenvalue
has moved over its size: modes that cross or meet keep their names. Modes without shapes are paired by their
eigenvalues. Source: Allemang & Brown, Proc. 1st Int. Modal Analysis Conf. (1982) 110.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.files import write_text
from indicial.flightsim.aerodynamics import SymmetricMissile
from indicial.flightsim.aircraft_modes import aircraft_modes
from indicial.flightsim.atmosphere import Atmosphere, StandardAtmosphere, air_at
from indicial.flightsim.dynamics import Dynamics, build_dynamics
from indicial.flightsim.earth import FlatEarth
from indicial.flightsim.epicycle import Complex
from indicial.flightsim.linear import linear_flight
from indicial.flightsim.modes import Mode, Modes, missile_modes
from indicial.flightsim.trim import Unknown, trim
from indicial.flightsim.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_RATES = ("p", "q", "r")


@dataclass(frozen=True)
class ModeSweep:
    """Eigenvalues of the modes at every altitude and Mach number.

    Parameters
    ----------
    machs, altitudes : ndarray
        Shapes (n,), (m,); altitudes in [m].
    names : tuple of str
        Of the modes, as they are called at the first point.
    eigenvalues : ndarray
        [1/s], NaN where there is no such flight or no such mode, shape (m, n, n_modes).
    refused : mapping
        Why there is no flight, by (altitude, Mach).
    notes : tuple of str
        What a reader must know of the model that was swept.
    """

    machs: Array
    altitudes: Array
    names: tuple[str, ...]
    eigenvalues: Complex
    refused: Mapping[tuple[float, float], str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> Complex:
        """Eigenvalues of one mode, shape (m, n)."""
        if name not in self.names:
            raise InputError(f"no mode {name!r}; there are {', '.join(self.names)}")
        one: Complex = self.eigenvalues[:, :, self.names.index(name)]
        return one

    def damping_ratio(self, name: str) -> Array:
        """``-Re/|eigenvalue|``, shape (m, n)."""
        value = self[name]
        ratio: Array = -value.real / np.abs(value)
        return ratio

    def summary(self) -> str:
        """Where each mode is least damped, and where it grows."""
        heights, machs = _extent(self.altitudes, "altitude"), _extent(self.machs, "Mach number")
        lines = [f"modes at {heights} m, {machs}"]
        for name in self.names:
            real = self[name].real
            if np.all(np.isnan(real)):
                lines.append(f"  {name:<14} nowhere")
                continue
            worst = np.unravel_index(int(np.nanargmax(real)), real.shape)
            value = self[name][worst]
            growing = np.count_nonzero(real > 0.0)
            grows = f", grows at {growing} of {np.count_nonzero(np.isfinite(real))} points" if growing else ""
            lines.append(
                f"  {name:<14} least damped at Mach {self.machs[worst[1]]:g}, {self.altitudes[worst[0]]:g} m: "
                f"{value.real:.4g} 1/s, {abs(value.imag):.4g} rad/s, ratio {-value.real / abs(value):.3g}{grows}"
            )
        if self.refused:
            (height, mach), reason = next(iter(self.refused.items()))
            lines.append(f"  no flight at {len(self.refused)} points, such as Mach {mach:g} at {height:g} m: {reason}")
        return "\n".join([*lines, *(f"  note: {note}" for note in self.notes)])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, schema version 1; null where there is no such flight or mode."""

        def plain(values: Array) -> list[list[float | None]]:
            return [[float(x) if math.isfinite(x) else None for x in row] for row in values]

        return {
            "schema_version": 1,
            "kind": "modes over Mach number and altitude",
            "machs": self.machs.tolist(),
            "altitudes_m": self.altitudes.tolist(),
            "modes": {
                name: {
                    "real_1_s": plain(self[name].real),
                    "imaginary_rad_s": plain(self[name].imag),
                    "damping_ratio": plain(self.damping_ratio(name)),
                }
                for name in self.names
            },
            "notes": list(self.notes),
            "refused": [
                {"altitude_m": height, "mach": mach, "why": why} for (height, mach), why in self.refused.items()
            ],
        }

    def to_csv(self, path: str | Path) -> None:
        """One row a mode and point, in one step."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(["altitude_m", "mach", "mode", "real_1_s", "imaginary_rad_s", "damping_ratio"])
        for i, height in enumerate(self.altitudes):
            for j, mach in enumerate(self.machs):
                for name, value in zip(self.names, self.eigenvalues[i, j], strict=True):
                    ratio = -value.real / abs(value)
                    writer.writerow([repr(float(x)) for x in (height, mach)] + [name, value.real, value.imag, ratio])
        write_text(Path(path), text.getvalue())

    def plot(self) -> Figure:
        """Frequency and damping of every mode over the Mach number, and their paths in the complex plane."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(1, 3, figsize=(13.0, 4.2), layout="constrained")
        for k, name in enumerate(self.names):
            for i in range(self.altitudes.size):
                value, style = (
                    self.eigenvalues[i, :, k],
                    {"color": f"C{k}", "alpha": 1.0 - 0.6 * i / self.altitudes.size},
                )
                label = name if i == 0 else None
                axes[0].plot(value.real, value.imag, ".-", label=label, **style)
                axes[0].plot(value.real[:1], value.imag[:1], "o", markerfacecolor="none", **style)
                axes[1].plot(self.machs, np.abs(value), ".-", **style)
                if np.any(value.imag):  # the ratio of a real mode is 1, and tells nothing
                    axes[2].plot(self.machs, -value.real / np.abs(value), ".-", **style)
        axes[0].axvline(0.0, color="0.6", linewidth=0.8)
        axes[0].set(xlabel="real part [1/s]", ylabel="imaginary part [rad/s]", title="eigenvalues (ring: lowest Mach)")
        axes[1].set(xlabel="Mach number", ylabel="natural frequency [rad/s]", yscale="log")
        axes[2].set(xlabel="Mach number", ylabel="damping ratio")
        axes[2].axhline(0.0, color="0.6", linewidth=0.8)
        if self.altitudes.size > 1:
            axes[1].set_title(f"fainter: higher, {self.altitudes[0] / 1e3:g} to {self.altitudes[-1] / 1e3:g} km")
        axes[0].legend(fontsize="small")
        return figure


def _extent(values: Array, name: str) -> str:
    """In words: one altitude, 0; 3 Mach numbers from 0.6 to 0.9."""
    if values.size == 1:
        return f"one {name}, {values[0]:g}"
    return f"{values.size} {name}s from {values[0]:g} to {values[-1]:g}"


def sweep_modes(
    modes_at: Callable[[float, float], Modes], machs: Sequence[float], altitudes: Sequence[float] = (0.0,)
) -> ModeSweep:
    """Modes at every Mach number and altitude, by any function that gives them, followed from point to point.

    Parameters
    ----------
    modes_at : callable
        (Mach number, altitude [m]) -> Modes. An `InputError` of it leaves the point out, with its reason.
    machs, altitudes : sequence of float

    Raises
    ------
    InputError
        If there is no point, or no flight at any.
    """
    grid, heights = np.asarray(machs, dtype=float), np.asarray(altitudes, dtype=float)
    if not grid.size or not heights.size or not (np.all(np.isfinite(grid)) and np.all(grid > 0.0)):
        raise InputError("a sweep needs altitudes, and Mach numbers above 0")
    found: dict[tuple[int, int], list[Mode | None]] = {}
    refused: dict[tuple[float, float], str] = {}
    names: list[str] = []
    for i, height in enumerate(heights):
        before = next((found[i - 1, j] for j in range(grid.size) if (i - 1, j) in found), None)
        for j, mach in enumerate(grid):
            try:
                modes = modes_at(float(mach), float(height)).modes
            except InputError as error:
                refused[float(height), float(mach)] = str(error)
                continue
            before = _followed(before, modes, names)
            found[i, j] = before
    if not found:
        raise InputError(f"no flight at any point: {next(iter(refused.values()))}")
    eigenvalues = np.full((heights.size, grid.size, len(names)), np.nan, dtype=complex)
    for (i, j), row in found.items():
        for k, mode in enumerate(row):
            if mode is not None:
                eigenvalues[i, j, k] = mode.eigenvalue
    return ModeSweep(grid, heights, tuple(names), eigenvalues, refused)


def missile_mode_sweep(
    vehicle: Vehicle,
    aerodynamics: SymmetricMissile,
    machs: Sequence[float],
    altitudes: Sequence[float] = (0.0,),
    *,
    roll_rate: float = 0.0,
    atmosphere: Atmosphere | None = None,
) -> ModeSweep:
    """`sweep_modes` of a missile in straight flight (`missile_modes`), derivatives or models of the Mach number.

    Parameters
    ----------
    vehicle, aerodynamics : Vehicle, SymmetricMissile
    machs, altitudes : sequence of float
        Altitudes in [m].
    roll_rate : float
        [rad/s].
    atmosphere : Atmosphere, optional
        The standard one if not given.

    Raises
    ------
    InputError
        If no point is within the model's `validity`; points that are not are left out, with the reason.
    """
    air = StandardAtmosphere() if atmosphere is None else atmosphere
    dynamics = build_dynamics(vehicle, aerodynamics, air, FlatEarth(0.0))

    def modes_at(mach: float, altitude: float) -> Modes:
        reach = aerodynamics.validity
        if not reach.mach_min <= mach <= reach.mach_max:
            raise InputError(f"the model holds from Mach {reach.mach_min:g} to {reach.mach_max:g}, not at {mach:g}")
        speed = mach * float(air_at(air, altitude).speed_of_sound)
        return missile_modes(dynamics, speed, roll_rate=roll_rate, altitude=altitude)

    return sweep_modes(modes_at, machs, altitudes)


def aircraft_mode_sweep(
    dynamics: Dynamics,
    machs: Sequence[float],
    altitudes: Sequence[float] = (0.0,),
    *,
    unknown: Sequence[str] | Mapping[str, float | Unknown],
    given: Mapping[str, float] | None = None,
) -> ModeSweep:
    """`sweep_modes` of an aircraft, trimmed at every point (`trim`) and linearised.

    Parameters
    ----------
    dynamics : Dynamics
    machs, altitudes : sequence of float
        Altitudes in [m].
    unknown, given
        As `trim` takes them; the speed and the altitude are those of the point.
    """
    air = dynamics.atmosphere

    def modes_at(mach: float, altitude: float) -> Modes:
        speed = mach * float(air_at(air, altitude).speed_of_sound)
        steady = trim(dynamics, unknown=unknown, given={**(given or {}), "speed": speed, "altitude": altitude})
        return aircraft_modes(linear_flight(steady))

    return sweep_modes(modes_at, machs, altitudes)


def _followed(before: list[Mode | None] | None, modes: tuple[Mode, ...], names: list[str]) -> list[Mode | None]:
    """Modes of a point in the order of `names`, which grows by those that have no forerunner."""
    from scipy.optimize import linear_sum_assignment

    row: list[Mode | None] = [None] * len(names)
    left = list(modes)
    if before is not None:
        old = [(k, mode) for k, mode in enumerate(before) if mode is not None]
        likeness = np.array([[_likeness(mode, new) for new in left] for _, mode in old])
        taken = set()
        for a, b in zip(*linear_sum_assignment(likeness, maximize=True), strict=True):
            # a real mode does not go on as one that turns: a pair is born of two, and gets a name of its own
            if (old[a][1].frequency == 0.0) == (left[b].frequency == 0.0):
                row[old[a][0]] = left[b]
                taken.add(b)
        left = [mode for b, mode in enumerate(left) if b not in taken]
    for mode in left:
        free = mode.name in names and row[names.index(mode.name)] is None
        if free:
            row[names.index(mode.name)] = mode
        else:
            names.append(mode.name if mode.name not in names else f"{mode.name} ({len(names)})")
            row.append(mode)
    return row


def _likeness(one: Mode, other: Mode) -> float:
    moved = abs(one.eigenvalue - other.eigenvalue) / (abs(one.eigenvalue) + abs(other.eigenvalue) + 1e-300)
    if not one.shape or not other.shape:
        return -moved
    x, y = _scaled(one), _scaled(other)
    names = sorted(set(x) | set(y))
    a, b = (np.array([shape.get(name, 0.0) for name in names]) for shape in (x, y))
    criterion = abs(np.vdot(a, b)) ** 2 / (np.vdot(a, a).real * np.vdot(b, b).real)
    return float(criterion) - moved


def _scaled(mode: Mode) -> dict[str, complex]:
    """Shape in angles: V over the speed, rates over the mode's frequency; altitude and lag states left out.

    Of a missile all states, the rate over the eigenvalue's size per metre: a lag mode has the incidence of an arm, and
    only its lag states tell them apart.
    """
    if "incidence" in mode.shape:
        return {**mode.shape, "rate": mode.shape["rate"] / max(abs(mode.per_metre), math.ulp(1.0))}
    size = {"V": mode.speed, **dict.fromkeys(_RATES, max(mode.natural_frequency, math.ulp(1.0)))}
    return {
        name: value / size.get(name, 1.0)
        for name, value in mode.shape.items()
        if name in ("V", "alpha", "theta", "beta", "phi", *_RATES)
    }
