r"""What the memory of the flow does to a missile's damping, over the reduced frequency of its motion.

The same body is made heavier or lighter to turn (its inertia scaled), so that the pitching frequency, and with it
``k = omega c/2V``, changes while the air stays as it is. At each k the angular motion is solved with the state-space
model and with its derivatives at k = 0, which is what a quasi-steady model knows. At low k both agree; where they part,
derivatives are no longer enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.aerodynamics import SymmetricMissile
from indicial.flightsim.atmosphere import Atmosphere, ConstantAtmosphere
from indicial.flightsim.dynamics import build_dynamics
from indicial.flightsim.earth import FlatEarth
from indicial.flightsim.epicycle import Complex
from indicial.flightsim.modes import missile_modes
from indicial.flightsim.state_space import StateSpaceAerodynamics
from indicial.flightsim.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure

K = tuple(np.geomspace(1e-3, 0.2, 25).tolist())
"""Reduced frequencies looked at if none are given."""


@dataclass(frozen=True)
class DampingOverK:
    """The fast arm with both models, over reduced frequency.

    Parameters
    ----------
    k : ndarray
        ``omega c/2V`` of the quasi-steady model, shape (n,).
    quasi_steady, lagging : ndarray
        Eigenvalues [1/s] over distance times V, shape (n,).
    k_here : float
        Of the vehicle as it is.
    speed : float
        [m/s].
    """

    k: Array
    quasi_steady: Complex
    lagging: Complex
    k_here: float
    speed: float

    @property
    def damping_change(self) -> Array:
        """Damping with the model, relative to the quasi-steady one, less 1; shape (n,)."""
        change: Array = self.lagging.real / self.quasi_steady.real - 1.0
        return change

    @property
    def frequency_change(self) -> Array:
        """The same of the turning rate."""
        change: Array = self.lagging.imag / self.quasi_steady.imag - 1.0
        return change

    @property
    def ratio_change(self) -> Array:
        """The same of the damping ratio."""
        change: Array = _ratio(self.lagging) / _ratio(self.quasi_steady) - 1.0
        return change

    def k_of_change(self, share: float) -> float:
        """Least k from which on the damping ratio differs by more than `share`; infinite if it does not."""
        beyond = np.abs(self.ratio_change) > share
        if not beyond[-1]:
            return float("inf")
        within = np.flatnonzero(~beyond)
        return float(self.k[0]) if not within.size else float(self.k[within[-1] + 1])

    def summary(self) -> str:
        """Changes at some k, and where they pass 1 and 5 per cent."""
        lines = [
            f"damping with the state-space model against its derivatives at k = 0, {self.speed:.5g} m/s; "
            f"this vehicle: k = {self.k_here:.4g}",
            f"  {'k':>9}{'ratio, derivatives':>20}{'ratio, model':>14}{'ratio':>9}{'frequency':>11}",
        ]
        chosen = np.unique(np.linspace(0, self.k.size - 1, min(7, self.k.size)).astype(int))
        slow, lag = _ratio(self.quasi_steady), _ratio(self.lagging)
        lines += [
            f"  {self.k[i]:>9.4g}{slow[i]:>20.5g}{lag[i]:>14.5g}{self.ratio_change[i]:>+9.2%}"
            f"{self.frequency_change[i]:>+11.2%}"
            for i in chosen
        ]
        said = []
        for share in (0.01, 0.05):
            at = self.k_of_change(share)
            where = f"from k = {at:.3g} on" if at < float("inf") else f"nowhere up to k = {self.k[-1]:.3g}"
            said.append(f"{share:.0%} {where}")
        return "\n".join([*lines, f"  the damping ratio differs by more than {', '.join(said)}"])

    def plot(self) -> Figure:
        """Damping ratio with both models, and the relative change, over k."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(1, 2, figsize=(10.0, 4.0), layout="constrained", sharex=True)
        axes[0].loglog(self.k, np.abs(_ratio(self.quasi_steady)), label="derivatives at k = 0")
        axes[0].loglog(self.k, np.abs(_ratio(self.lagging)), "--", label="state-space model")
        axes[0].set(xlabel="reduced frequency k = omega c/2V", ylabel="damping ratio")
        axes[1].semilogx(self.k, 100.0 * self.ratio_change, label="damping ratio")
        axes[1].semilogx(self.k, 100.0 * self.frequency_change, "--", label="frequency")
        axes[1].set(xlabel="reduced frequency k = omega c/2V", ylabel="model over derivatives, change [%]")
        for ax in axes:
            ax.axvline(self.k_here, color="0.6", linewidth=0.8, label="this vehicle")
            ax.legend(fontsize="small")
        return figure


def damping_over_k(
    vehicle: Vehicle,
    model: StateSpaceAerodynamics,
    speed: float,
    *,
    k: Sequence[float] | None = None,
    atmosphere: Atmosphere | None = None,
    altitude: float = 0.0,
) -> DampingOverK:
    """Damping of a missile that does not roll with a state-space model and with its derivatives, over k.

    Parameters
    ----------
    vehicle : Vehicle
    model : StateSpaceAerodynamics
    speed : float
        [m/s].
    k : sequence of float
        Reduced frequencies ``omega c/2V`` that the pitching motion is to have; if not given, `K` as far as it
        oscillates.
    atmosphere : Atmosphere, optional
        20 C and 1 atm if not given.
    altitude : float
        [m].

    Raises
    ------
    InputError
        If k is not positive, or the missile does not oscillate.
    """
    wanted = np.asarray(K if k is None else k, dtype=float)
    if not wanted.size or not np.all(np.isfinite(wanted)) or not np.all(wanted > 0.0):
        raise InputError("reduced frequencies must be positive and finite")
    air = ConstantAtmosphere() if atmosphere is None else atmosphere
    length = vehicle.reference.length

    def arm(body: Vehicle, aerodynamics: SymmetricMissile) -> complex:
        dynamics = build_dynamics(body, aerodynamics, air, FlatEarth(0.0))
        return missile_modes(dynamics, speed, altitude=altitude)["fast arm"].eigenvalue

    derivatives = model.quasi_steady()
    here = abs(arm(vehicle, derivatives)) * length / (2.0 * speed)
    if arm(vehicle, derivatives).imag == 0.0:
        raise InputError("the angles of this missile do not oscillate: it has no k")
    bodies = [replace(vehicle, inertia=vehicle.inertia * (here / one) ** 2) for one in wanted]
    quasi_steady = np.array([arm(body, derivatives) for body in bodies])
    lagging = np.array([arm(body, model) for body in bodies])
    turning = (quasi_steady.imag > 0.0) & (lagging.imag > 0.0)
    if k is None and np.any(turning):
        quasi_steady, lagging = quasi_steady[turning], lagging[turning]
    elif not np.all(turning):
        raise InputError("at the largest k the angles do not oscillate: ask for smaller ones")
    return DampingOverK(np.abs(quasi_steady) * length / (2.0 * speed), quasi_steady, lagging, here, speed)


def _ratio(values: Complex) -> Array:
    ratio: Array = -values.real / np.abs(values)
    return ratio
