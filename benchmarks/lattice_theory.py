"""The vortex lattice against unsteady theory, and how it converges with panels and with steps.

A wing of aspect ratio 2000 about its quarter chord against Theodorsen's function (lift and moment to plunge and to
pitch rate, k from 0.05 to 1) and Wagner's; a swept wing with a tail forced at k = 0.4 against its own linear response.
The plot goes to benchmarks/out/lattice_theory.png.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
from figures import Figure

from indicial.cfd.lattice import Lattice, LatticeSettings, LatticeSolver
from indicial.cfd.shapes import LiftingSurface
from indicial.conventions import Array
from indicial.methods import forced_oscillation
from indicial.motion import AlphaStep, FlightCondition

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from theory.linear import theodorsen, wagner

PANELS = (4, 8, 16)
STEPS = (24, 48, 96)
K = np.array([0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0])
STILL = FlightCondition(0.1)


def measure() -> list[Figure]:
    """Errors, their orders, the plot."""
    errors = {n: _theodorsen_errors(n) for n in PANELS}
    figures = []
    for row, name in enumerate(("lift to plunge", "moment to plunge", "lift to pitch rate", "moment to pitch rate")):
        found = [float(np.max(errors[n][row])) for n in PANELS]
        listed = ", ".join(f"{100 * value:.2g}%" for value in found)
        figures.append(Figure(f"{name}, 4, 8, 16 panels: {listed}; order", _order(PANELS, found), ""))
    s, history, final = _step(16)
    late = s >= 1.0
    gap = np.abs(history[late] / final / wagner(s[late]) - 1.0)
    figures.append(Figure("step in alpha against Wagner from s = 1 on, 16 panels", float(np.max(gap)), ""))
    gaps = _march_gaps()
    figures.append(Figure("oscillation of 96 steps against H(ik), worst part", gaps[-1], ""))
    figures.append(Figure("its order in the time step", _order(STEPS, gaps), ""))
    _draw(s, history / final)
    return figures


def _plate(chordwise: int) -> LatticeSolver:
    wing = LiftingSurface.wing("plate", 2000.0, 1.0)
    lattice = Lattice.of(wing, chordwise=chordwise, spanwise=2)
    settings = LatticeSettings(wake="frozen", compressible=False)
    return LatticeSolver(lattice, wing.reference((0.25, 0.0, 0.0)), settings)


def _exact() -> Array:
    """Lift and moment to plunge, lift and moment to pitch rate per qc/2U, about the quarter chord, shape (4, n)."""
    c = np.array([theodorsen(k) for k in K])
    mass = 1j * math.pi * K
    # Theodorsen's L and M with a = -1/2; a pitching rate with alpha held at the axis has h' = -U theta
    return np.array(
        [2.0 * math.pi * c + mass, -mass / 4.0, 2.0 * math.pi * c + mass / 2.0, -math.pi / 4.0 - 3.0 / 16.0 * mass]
    )


def _found(chordwise: int) -> Array:
    response = _plate(chordwise).frequency_response(STILL, K, ("alpha", "q"))
    return np.array([response.channel(load, source) for source in ("alpha", "q") for load in ("CN", "Cm")])


def _theodorsen_errors(chordwise: int) -> Array:
    """Of each channel, relative to its size, shape (4, n)."""
    exact = _exact()
    return np.asarray(np.abs(_found(chordwise) - exact) / np.abs(exact))


def _step(chordwise: int) -> tuple[Array, Array, float]:
    solver = _plate(chordwise)
    s = np.arange(0.0, 12.0, 0.1)
    history = solver.unsteady(STILL, AlphaStep(STILL, 0.01), 0.5 * s / STILL.speed)
    return s, history["CN"], solver.steady(FlightCondition(0.1, alpha=0.01))["CN"]


def _march_gaps() -> list[float]:
    """Largest difference of a forced plunge from H(ik), relative, for each number of steps to a period."""
    wing = LiftingSurface.wing("wing", 6.0, 1.0, taper=0.6, sweep=0.3, dihedral=0.1)
    tail = LiftingSurface.wing("tail", 2.0, 0.5, root_leading_edge=(4.0, 0.3))
    lattice = Lattice.of([wing, tail], chordwise=4, spanwise=6)
    solver = LatticeSolver(lattice, wing.reference((0.5, 0.0, 0.0)))
    condition, k = FlightCondition(0.3, alpha=0.05), 0.4
    exact = solver.frequency_response(condition, [k], ("alpha",))
    gaps = []
    for steps in STEPS:
        history = forced_oscillation.run(solver, condition, 1e-3, k, "plunge", periods=3, steps_per_period=steps)
        reading = forced_oscillation.fourier(history, 1)
        found = {load: reading.value(load, "in_phase") + 1j * k * reading.value(load) for load in ("CN", "Cm")}
        gaps.append(max(float(abs(found[load] / exact.channel(load, "alpha")[0] - 1.0)) for load in found))
    return gaps


def _order(sizes: tuple[int, ...], errors: list[float]) -> float:
    return -float(np.polyfit(np.log(sizes), np.log(errors), 1)[0])


def _draw(s: Array, step: Array) -> None:
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9.5, 3.8), layout="constrained")
    exact, found = _exact(), _found(8)
    for row, name in ((0, "CN to alpha"), (2, "CN to q"), (1, "Cm to alpha"), (3, "Cm to q")):
        (line,) = left.plot(exact[row].real, exact[row].imag, "-", label=name)
        left.plot(found[row].real, found[row].imag, "o", color=line.get_color(), mfc="none")
    left.set(xlabel="in phase", ylabel="out of phase", title="k = 0.05 to 1: Theodorsen (lines), 8 panels (rings)")
    left.legend(fontsize="small")
    right.plot(s, wagner(s), "-", label="Wagner")
    right.plot(s[2:], step[2:], "--", label="16 panels, AR 2000")
    right.set(
        xlabel="reduced time s = 2Ut/c", ylabel="lift over its final value", ylim=(0.4, 1.0), title="step in alpha"
    )
    right.legend()
    folder = Path(__file__).parent / "out"
    folder.mkdir(exist_ok=True)
    figure.savefig(folder / "lattice_theory.png", dpi=130)
    plt.close(figure)
