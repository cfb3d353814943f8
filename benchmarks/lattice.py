"""The unsteady vortex lattice beside Ptera Software's, and how its cost grows with panels and with steps.

A rectangular wing of aspect ratio 6 at 5 degrees heaves at k = 0.314: the same panels, steps and prescribed wake in
both, 100 steps to a period. Times are processor times of all threads, of the marches alone, without compilation.
Lift is compared over the last period, by its mean and its first harmonic: the peer takes velocities and changes of
circulation as differences from the step before, so its lift comes about a step late. Beside that, a forced roll of the
Bocian glider, wing and tail with section data. The plot goes to benchmarks/out/lattice.png. Ptera Software is looked
for in PTERA_PYTHON.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from figures import Figure
from numpy.typing import ArrayLike
from peers import ptera

from indicial.cfd.lattice import Lattice, LatticeSettings, LatticeSolver
from indicial.cfd.shapes import LiftingSurface
from indicial.conventions import Array
from indicial.motion import FlightCondition, Motion
from indicial.studies.bocian.computing import force
from indicial.studies.bocian.glider import TRIPPED, solver
from indicial.studies.bocian.pieces import FORCED

CHORD, SPAN, ALPHA, PERIOD_CHORDS = 1.0, 6.0, math.radians(5.0), 10.0
AMPLITUDE = 0.1
STEPS_PER_PERIOD, PERIODS = 100, 3
PANELS_STEPS = 60
PANELS = ((4, 5), (6, 10), (10, 20), (14, 30))
STEPS = (75, 150, 300, 600)
PEER_STEPS = (100, 300)
CONDITION = FlightCondition(0.1, alpha=ALPHA)
GLIDER_PANELS = (8, 20)


@dataclass(frozen=True)
class Heave(Motion):
    """Up and down along the body's axis, ``z = A sin(2 pi t/T)``."""

    period: float

    def velocity(self, time: ArrayLike) -> Array:
        t = np.asarray(time, dtype=float)
        up = AMPLITUDE * 2.0 * np.pi / self.period * np.cos(2.0 * np.pi * t / self.period)
        return CONDITION.velocity - np.stack([0.0 * t, 0.0 * t, up], axis=-1)

    def rate(self, time: ArrayLike) -> Array:
        return np.zeros((*np.shape(time), 3))

    def describe(self) -> dict[str, Any]:
        return {"kind": "heave", "amplitude": AMPLITUDE, "period": self.period}


def measure() -> list[Figure]:
    """Time, compare, fit, draw."""
    _march(4, 5, 5)
    by_panels = [_march(m, n, PANELS_STEPS)[0] for m, n in PANELS]
    by_steps = [_march(10, 20, steps)[0] for steps in STEPS]
    panels = np.array([2.0 * m * n for m, n in PANELS])
    whole, lift = _march(10, 20, PERIODS * STEPS_PER_PERIOD)
    glider, glider_panels = _forced_roll()
    figures = [
        Figure.at_most("400 panels, 300 steps", whole, 10.0, "s"),
        Figure.at_most(f"glider with sections, {glider_panels} panels, 300 steps, all cores", glider, 10.0, "s"),
        Figure("exponent of the number of panels, 60 steps", _exponent(panels[1:], by_panels[1:]), ""),
        Figure("exponent of the number of steps, 400 panels", _exponent(STEPS, by_steps), ""),
    ]
    theirs: list[float] = []
    if ptera.available():
        runs = [ptera.run(_case(steps)) for steps in PEER_STEPS]
        theirs = [run["seconds"] for run in runs]
        (mean, swing), (their_mean, their_swing) = (_parts(one) for one in (lift, np.array(runs[-1]["lift"])))
        lag = float(np.angle(swing / their_swing)) * STEPS_PER_PERIOD / (2.0 * math.pi)
        figures += [
            Figure.at_least("times faster than Ptera Software, 300 steps", theirs[-1] / whole, 10.0),
            Figure.at_most("mean lift against Ptera Software, relative", abs(mean / their_mean - 1.0), 0.02),
            Figure.at_most("its amplitude, relative", abs(abs(swing / their_swing) - 1.0), 0.02),
            Figure("Ptera Software's lag behind it", lag, "steps"),
            Figure("Ptera Software: 400 panels, 300 steps", theirs[-1], "s"),
            Figure("Ptera Software: exponent of the number of steps", _exponent(PEER_STEPS, theirs), ""),
        ]
    else:
        figures.append(Figure("Ptera Software not found: set PTERA_PYTHON", 0.0, "", "to be compared with", False))
    _draw(panels, by_panels, by_steps, theirs)
    return figures


def _march(chordwise: int, spanwise: int, steps: int) -> tuple[float, Array]:
    """Processor time [s], and lift over dynamic pressure and area of each step after the first instant."""
    wing = LiftingSurface.wing("wing", SPAN, CHORD)
    lattice = Lattice.of(wing, chordwise=chordwise, spanwise=spanwise, span_spacing="equal")
    solver = LatticeSolver(lattice, wing.reference((0.25, 0.0, 0.0)), LatticeSettings(compressible=False))
    period = PERIOD_CHORDS * CHORD / CONDITION.speed
    times = period / STEPS_PER_PERIOD * np.arange(steps)
    start = time.process_time()
    history = solver.unsteady(CONDITION, Heave(period), times)
    seconds = time.process_time() - start
    return seconds, history["CN"] * math.cos(ALPHA) - history["CA"] * math.sin(ALPHA)


def _forced_roll() -> tuple[float, int]:
    """Time [s] by the clock of a forced roll of the glider at 4 degrees, reductions and all, and its panels."""
    one = solver({"panels": GLIDER_PANELS, "polars": TRIPPED})
    start = time.perf_counter()
    force(one, 4.0, {**FORCED, "periods": PERIODS, "steps_per_period": STEPS_PER_PERIOD})
    return time.perf_counter() - start, one.lattice.n_panels


def _case(steps: int) -> dict[str, Any]:
    """The same for the peer."""
    speed = CONDITION.speed
    period = PERIOD_CHORDS * CHORD / speed
    return {
        "span": SPAN,
        "chord": CHORD,
        "chordwise": 10,
        "spanwise": 20,
        "amplitude": AMPLITUDE,
        "period": period,
        "speed": speed,
        "alpha_deg": math.degrees(ALPHA),
        "time_step": period / STEPS_PER_PERIOD,
        "steps": steps,
    }


def _parts(lift: Array) -> tuple[float, complex]:
    """Mean and first harmonic of the last period."""
    last = lift[-STEPS_PER_PERIOD:]
    turn = np.exp(-2j * np.pi * np.arange(len(lift))[-STEPS_PER_PERIOD:] / STEPS_PER_PERIOD)
    return float(np.mean(last)), complex(2.0 * np.mean(last * turn))


def _exponent(size: ArrayLike, seconds: ArrayLike) -> float:
    return float(np.polyfit(np.log(np.asarray(size, dtype=float)), np.log(np.asarray(seconds)), 1)[0])


def _draw(panels: Array, by_panels: list[float], by_steps: list[float], theirs: list[float]) -> None:
    """Both growths."""
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
    _fitted(left, panels, by_panels, "C0o", "this lattice, 60 steps", first=1)
    _fitted(right, STEPS, by_steps, "C0o", "this lattice, 400 panels")
    if theirs:
        _fitted(right, PEER_STEPS, theirs, "C1s", "Ptera Software, 400 panels")
    left.set(xlabel="panels", ylabel="processor time [s]")
    right.set(xlabel="steps", ylabel="processor time [s]")
    for axes, places in ((left, panels), (right, np.array(STEPS))):
        axes.minorticks_off()
        axes.set_xticks(places, [f"{place:g}" for place in places])
        axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2, fontsize=8)
        axes.grid(True, alpha=0.3)
    folder = Path(__file__).parent / "out"
    folder.mkdir(exist_ok=True)
    figure.savefig(folder / "lattice.png", dpi=150)
    plt.close(figure)


def _fitted(axes: Any, sizes: ArrayLike, seconds: list[float], style: str, label: str, first: int = 0) -> None:
    """Times, and the power of the size that is fitted to those from `first` on."""
    n, t = np.asarray(sizes, dtype=float), np.asarray(seconds)
    power, factor = np.polyfit(np.log(n[first:]), np.log(t[first:]), 1)
    axes.loglog(n, t, style, label=label)
    axes.loglog(n[first:], np.exp(factor) * n[first:] ** power, f"{style[:2]}--", label=f"fit, power {power:.2f}")
