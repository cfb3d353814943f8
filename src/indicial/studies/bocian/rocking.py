"""The glider free in roll: its rate answers to its own rolling moment, nothing else moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from indicial.cfd.lattice import SectionLatticeSolver, SectionMarch
from indicial.conventions import Array
from indicial.motion import FlightCondition, SteadyMotion


@dataclass(frozen=True)
class Rocking:
    """A free motion in roll.

    Parameters
    ----------
    time, rate : ndarray
        [s], p [rad/s], shape (n,).
    growth : float
        Of the rate at first, d ln|p|/dt [1/s].
    """

    time: Array
    rate: Array
    growth: float

    @property
    def autorotates(self) -> bool:
        """Whether its rate keeps up: no less in the end than half-way, and not a hundredth of the first."""
        end, middle = abs(self.rate[-1]), abs(self.rate[self.rate.size // 2])
        return bool(end >= middle and end > 0.01 * abs(self.rate[0]))


def release(
    solver: SectionLatticeSolver, condition: FlightCondition, inertia: float, first: float, end: float, step: float
) -> Rocking:
    """Set rolling with p = `first` [rad/s] in steady flight at no roll, and let go, V_b held in body axes.

    ``I_x dp/dt = L`` by the second-order method of Adams and Bashforth in steps [s] of the wake.

    Parameters
    ----------
    inertia : float
        I_x [kg m^2].
    """
    march = SectionMarch(solver, condition, SteadyMotion(condition))
    reference = solver.reference
    scale = condition.dynamic_pressure * reference.area * float(reference.moment_lengths[0]) / inertia
    time = np.linspace(0.0, end, round(end / step) + 1)
    step = float(time[1])
    rate = np.empty(time.size)
    p, before = first, 0.0
    for n, t in enumerate(time):
        rate[n] = p
        now = scale * float(march.step(float(t), condition.velocity, np.array([p, 0.0, 0.0]))[3])
        p += step * (now if n == 0 else 1.5 * now - 0.5 * before)
        before = now
    # once the impulse of the kick and the first chords travelled are over
    early = (time > 0.1) & (time < 0.4)
    growth = float(np.polyfit(time[early], np.log(np.maximum(np.abs(rate[early]), 1e-12)), 1)[0])
    return Rocking(time, rate, growth)
