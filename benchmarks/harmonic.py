"""Loops of a pitching NACA 0012 by a few harmonics against time marching, with the cost of each (AGARD CT1, CT2, CT5).

AGARD R-702 (Landon 1982), pitch about c/4, inviscid here: compared with each other, not with the wind tunnel. The
difference of two loops is the root mean square over the period relative to the marched loop's half-range. Costs are
products with the Jacobian of one instant, the steady states from which both start not counted.
``python benchmarks/harmonic.py loops.png 64`` draws the loops as well, with so many cells round the section.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from figures import Figure

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import airfoil_mesh
from indicial.cfd.shapes import Airfoil
from indicial.conventions import ReferenceQuantities
from indicial.history import History
from indicial.methods import forced_oscillation, reduced_frequency
from indicial.methods.reduced_frequency import PeriodicLoads
from indicial.motion import FlightCondition

AROUND, FARFIELD = 96, 50.0
HARMONICS = (1, 2, 3, 5)
PERIODS, STEPS = 3, 120


@dataclass(frozen=True)
class Case:
    """One test of AGARD R-702: mean incidence and amplitude in degrees."""

    name: str
    mach: float
    mean: float
    amplitude: float
    k: float
    around: int = AROUND

    @property
    def condition(self) -> FlightCondition:
        return FlightCondition(self.mach, alpha=np.radians(self.mean))

    @cached_property
    def solver(self) -> FiniteVolumeSolver:
        normal = 3 * self.around // 8
        mesh = airfoil_mesh(Airfoil.naca("0012"), n_around=self.around, n_normal=normal, farfield=FARFIELD)
        return FiniteVolumeSolver(mesh, ReferenceQuantities(1.0, 1.0, (0.25, 0.0, 0.0)))

    def periodic(self, harmonics: int) -> PeriodicLoads:
        amplitude = np.radians(self.amplitude)
        return reduced_frequency.run(self.solver, self.condition, amplitude, self.k, harmonics=harmonics)

    def marched(self, steps: int = STEPS) -> History:
        amplitude = np.radians(self.amplitude)
        return forced_oscillation.run(
            self.solver, self.condition, amplitude, self.k, periods=PERIODS, steps_per_period=steps
        )


CASES = (
    Case("CT1", 0.600, 2.89, 2.41, 0.0808),
    Case("CT2", 0.600, 3.16, 4.59, 0.0811),
    Case("CT5", 0.755, 0.016, 2.51, 0.0814),
)


@dataclass(frozen=True)
class Comparison:
    """One case by all harmonics and by the march; `seconds` by harmonics, 0 for the march."""

    case: Case
    marched: History
    loads: dict[int, PeriodicLoads]
    seconds: dict[int, float]

    @classmethod
    def of(cls, case: Case) -> Comparison:
        # the start of both, and the compiled kernels
        case.solver.steady(case.condition)
        case.solver.steady(replace(case.condition, alpha=case.condition.alpha + 1e-3))
        seconds, loads = {}, {}
        for harmonics in HARMONICS:
            start = time.perf_counter()
            loads[harmonics] = case.periodic(harmonics)
            seconds[harmonics] = time.perf_counter() - start
        start = time.perf_counter()
        marched = case.marched()
        seconds[0] = time.perf_counter() - start
        return cls(case, marched, loads, seconds)

    def figures(self) -> list[Figure]:
        cost = self.marched.provenance["jacobian_products"]
        reading = forced_oscillation.fourier(self.marched, 1)
        periodicity = reading.periodicity
        assert periodicity is not None
        figures = [
            Figure(f"{self.case.name}: march, {PERIODS} periods", cost, "products"),
            Figure(f"{self.case.name}: march, {PERIODS} periods", self.seconds[0], "s"),
            Figure(f"{self.case.name}: march, change of CN from period to period", 100.0 * periodicity[2], "%"),
            Figure(f"{self.case.name}: march, change of Cm from period to period", 100.0 * periodicity[4], "%"),
        ]
        for h, loads in self.loads.items():
            name = f"{self.case.name}: h = {h}"
            for load in ("CN", "Cm"):
                figures.append(
                    Figure(f"{name}, {load} off the march", 100.0 * loads.difference(self.marched, load), "%")
                )
                damping = loads.reading().value(load) / reading.value(load) - 1.0
                figures.append(Figure(f"{name}, {load} out of phase off the march", 100.0 * damping, "%"))
            figures.append(Figure(f"{name}", loads.provenance["jacobian_products"], "products"))
            figures.append(Figure(f"{name}", self.seconds[h], "s"))
        return figures


def measure() -> list[Figure]:
    """All cases; some minutes each."""
    return [figure for case in CASES for figure in Comparison.of(case).figures()]


def picture(comparisons: list[Comparison], path: str) -> None:
    """Loops of CN and Cm, a column for each case."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(2, len(comparisons), figsize=(4.0 * len(comparisons), 7.0), squeeze=False)
    for column, one in enumerate(comparisons):
        last = one.marched.time >= one.marched.time[-1] * (1.0 - 1.0 / PERIODS) - 1e-12
        offset = np.degrees(one.case.condition.alpha)
        for row, name in enumerate(("CN", "Cm")):
            ax = axes[row, column]
            alpha = np.degrees(one.marched.alpha[last]) - offset
            ax.plot(alpha, one.marched[name][last], color="0.6", lw=3.0, label="march")
            for loads in one.loads.values():
                loads.plot(name, ax)
            if ax is not axes[0, 0]:
                ax.get_legend().remove()
            ax.set_title(f"{one.case.name}, M {one.case.mach:g}, mean {one.case.mean:g} deg" if row == 0 else "")
    figure.tight_layout()
    figure.savefig(path, dpi=75)


if __name__ == "__main__":
    found = []
    for case in CASES:
        found.append(Comparison.of(replace(case, around=int(sys.argv[2]))))
        for figure in found[-1].figures():
            print(figure.line(), flush=True)
    picture(found, sys.argv[1])
