r"""Damping of a missile, four ways: linearised model, decay and epicyclic fit of the simulated flight, closed form.

All of them are the same quantity: how fast the angles grow or die out over distance, times V [1/s]. Over distance

    xi'' + (H - iP) xi' - (M + iPT) xi = 0,    lambda = (-(H - iP) +- sqrt((H - iP)^2 + 4 (M + iPT)))/2

    H = (rho S/2m)(CL_alpha - CD - (m c^2/2 Iy)(Cm_q + Cm_alphadot)),  P = (Ix/Iy) p/V,
    M = (rho S c/2 Iy) Cm_alpha,  T = (rho S/2m) CL_alpha,  CL_alpha = CN_alpha - CA,  CD = CA

(McCoy, "Modern Exterior Ballistics" (1999), ch. 10, in metres instead of calibres and with rates per c/2V; no Magnus
moment). At zero roll both arms decay with ``-H/2``; times V,

    (rho V S/4) [ -CL_alpha/m + CA/m + (c^2/2 Iy)(Cm_q + Cm_alphadot) ].

The CA/m is the effect of slowing down: as V falls so does the frequency, and the angles grow as its square root.
A missile held at its speed has the formula without it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from indicial.errors import InputError
from indicial.flightsim.aerodynamics import DerivativeAerodynamics, SymmetricMissile
from indicial.flightsim.atmosphere import Atmosphere, ConstantAtmosphere, air_at
from indicial.flightsim.dynamics import build_dynamics
from indicial.flightsim.earth import FlatEarth
from indicial.flightsim.epicycle import EpicyclicFit, fit_trajectory, order_arms
from indicial.flightsim.initial import InitialState
from indicial.flightsim.modes import Modes, missile_modes
from indicial.flightsim.simulate import MAX_STEPS, fly, suggest_method, suggest_step
from indicial.flightsim.trajectory import Trajectory
from indicial.flightsim.vehicle import Vehicle

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def epicyclic_roots(
    vehicle: Vehicle, derivatives: DerivativeAerodynamics, density: float, speed: float, roll_rate: float = 0.0
) -> tuple[complex, complex]:
    """Roots lambda [1/m] of the fast and slow arm by linear theory (this module's head).

    The derivatives are moved to the centre of gravity first. CN_q, CN_alphadot and products of damping and lift are
    neglected, as the theory does.

    Parameters
    ----------
    vehicle : Vehicle
    derivatives : DerivativeAerodynamics
    density : float
        [kg/m^3].
    speed : float
        [m/s].
    roll_rate : float
        p [rad/s].
    """
    at = derivatives.about(vehicle.centre_of_gravity)
    axial, transverse = vehicle.inertia[0, 0], vehicle.inertia[1, 1]
    area, length = at.reference.area, at.reference.length
    factor = 2.0 if at.reference.rate_normalisation == "c/2V" else 1.0
    lift_slope = at.CN_alpha - at.CA_0
    radius = vehicle.mass * length**2 / (factor * transverse)
    lift = density * area / (2.0 * vehicle.mass)
    h = lift * (lift_slope - at.CA_0 - radius * (at.Cm_q + at.Cm_alphadot))
    p = axial / transverse * roll_rate / speed
    m = density * area * length / (2.0 * transverse) * at.Cm_alpha
    middle = -(h - 1j * p) / 2.0
    root = np.sqrt(middle**2 + m + 1j * p * lift * lift_slope)
    return order_arms(complex(middle + root), complex(middle - root))


@dataclass(frozen=True)
class ArmDamping:
    """One arm, four ways.

    Parameters
    ----------
    name : str
    linearised, fitted, closed_form : complex
        Eigenvalue [1/s]: damping (real) and turning rate (imaginary), over distance times V.
    decay : float
        Damping [1/s] by the logarithmic decrement of this arm in the flight (`arm_decay`).
    """

    name: str
    linearised: complex
    fitted: complex
    closed_form: complex
    decay: float

    @property
    def decay_difference(self) -> float:
        """Decay of the flight, relative to the linearised damping, less 1."""
        return self.decay / self.linearised.real - 1.0

    @property
    def fit_difference(self) -> float:
        """Damping fitted to the flight, relative to the linearised one, less 1."""
        return self.fitted.real / self.linearised.real - 1.0

    @property
    def closed_form_difference(self) -> float:
        """Damping of the closed form, relative to the linearised one, less 1."""
        return self.closed_form.real / self.linearised.real - 1.0


@dataclass(frozen=True)
class DampingCheck:
    """Damping of both arms, four ways.

    Parameters
    ----------
    arms : tuple of ArmDamping
        Fast, slow.
    model : str
        What the aerodynamic model is.
    speed, mach, roll_rate : float
        Of the flight [m/s], [1], [rad/s].
    slowing : float
        ``rho V S CA/4m`` [1/s]: what drag adds to every damping here by slowing the missile down. Subtract it for a
        missile held at its speed.
    modes : Modes
    fit : EpicyclicFit
    trajectory : Trajectory
        The flight that was fitted, without gravity.
    """

    arms: tuple[ArmDamping, ArmDamping]
    model: str
    speed: float
    mach: float
    roll_rate: float
    slowing: float
    modes: Modes
    fit: EpicyclicFit
    trajectory: Trajectory

    def summary(self) -> str:
        """The values and their differences, and a verdict."""
        lines = [
            f"damping at {self.speed:.5g} m/s (Mach {self.mach:.4g}), roll rate {self.roll_rate:.4g} rad/s",
            f"  {self.model}",
            f"  {'arm':<10}{'linearised':>14}{'decay':>14}{'fitted':>14}{'closed form':>14}  1/s",
        ]
        for arm in self.arms:
            four = (arm.linearised.real, arm.decay, arm.fitted.real, arm.closed_form.real)
            values = "".join(f"{v:>14.6g}" for v in four)
            lines.append(
                f"  {arm.name:<10}{values}  decay {arm.decay_difference:+.3%}, fitted "
                f"{arm.fit_difference:+.3%}, closed form {arm.closed_form_difference:+.3%}; "
                f"turning {arm.linearised.imag:.6g} rad/s"
            )
        verdict = "stable" if all(arm.linearised.real < 0.0 for arm in self.arms) else "UNSTABLE"
        lines.append(f"  dynamically {verdict}; at constant speed each value is {self.slowing:.4g} 1/s less")
        return "\n".join(lines)

    def plot(self) -> Figure:
        """The flight's incidence over distance with the fitted epicycle, and the epicycle's envelope."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(1, 2, figsize=(11, 4.5), layout="constrained")
        s = self.trajectory.distance
        flown, fitted = (math.degrees(1.0) * xi for xi in (self.trajectory.non_rolling_incidence, self.fit(s)))
        axes[0].plot(s, flown.imag, label="alpha, flown")
        axes[0].plot(s, fitted.imag, "--", label="alpha, fitted epicycle")
        arms = (self.fit.fast, self.fit.slow)
        envelope = math.degrees(1.0) * sum(abs(a.amplitude) * np.exp(a.eigenvalue.real * s) for a in arms)
        axes[0].plot(s, envelope, color="0.6", label="sum of the arms")
        axes[0].set(xlabel="distance flown [m]", ylabel="angle, axes not rolling [deg]")
        axes[0].legend()
        axes[1].plot(flown.real, flown.imag)
        axes[1].set(xlabel="beta [deg]", ylabel="alpha [deg]", aspect="equal")
        axes[1].set_adjustable("datalim")
        return figure


@dataclass(frozen=True)
class DampingChange:
    """What replacing one aerodynamic model by another does to the damping.

    Parameters
    ----------
    before, after : DampingCheck
    """

    before: DampingCheck
    after: DampingCheck

    @property
    def damping(self) -> tuple[float, float]:
        """Relative change of the linearised damping of the fast and slow arm."""
        pairs = zip(self.before.arms, self.after.arms, strict=True)
        fast, slow = (b.linearised.real / a.linearised.real - 1.0 for a, b in pairs)
        return fast, slow

    @property
    def frequency(self) -> tuple[float, float]:
        """Relative change of the linearised turning rate of the fast and slow arm."""
        pairs = zip(self.before.arms, self.after.arms, strict=True)
        fast, slow = (b.linearised.imag / a.linearised.imag - 1.0 for a, b in pairs)
        return fast, slow

    def summary(self) -> str:
        """Two lines, one an arm."""
        lines = [f"from: {self.before.model}", f"to:   {self.after.model}"]
        rows = zip(self.before.arms, self.after.arms, self.damping, self.frequency, strict=True)
        lines += [
            f"  {a.name}: damping {a.linearised.real:.6g} to {b.linearised.real:.6g} 1/s ({d:+.3%}), "
            f"turning {a.linearised.imag:.6g} to {b.linearised.imag:.6g} rad/s ({f:+.3%})"
            for a, b, d, f in rows
        ]
        return "\n".join(lines)


def arm_decay(trajectory: Trajectory, other: complex, *, skip: float = 0.0) -> float:
    r"""Damping [1/m] of one arm by the logarithmic decrement of a flight from which the other arm is filtered out.

    With ``xi = K_1 e^{lambda_1 s} + K_2 e^{lambda_2 s}`` (no trim), ``xi' - lambda_2 xi`` holds the first arm alone:
    the slope of the logarithm of its size, by least squares, is ``Re lambda_1``. The derivative is that of a spline
    of fifth order.

    Parameters
    ----------
    trajectory : Trajectory
    other : complex
        lambda_2 [1/m].
    skip : float
        Distance left out at the start [m].
    """
    from scipy.interpolate import make_interp_spline

    s, xi = trajectory.distance, trajectory.non_rolling_incidence
    alone = np.abs(make_interp_spline(s, xi, k=5).derivative()(s) - other * xi)
    kept = s >= skip
    edge = 5  # where the spline has neighbours on one side only
    slope, _ = np.polyfit(s[kept][edge:-edge], np.log(alone[kept][edge:-edge]), 1)
    return float(slope)


def holding_roll(vehicle: Vehicle, aerodynamics: SymmetricMissile, speed: float, roll_rate: float) -> SymmetricMissile:
    """The model with the fin cant that holds ``p/V`` against roll damping while drag slows the missile down.

    ``Cl_0 = -(Cl_p + f Ix CA/(m c^2)) p c/fV``, with f = 2 for rates per c/2V and 1 for c/V.
    """
    reference = aerodynamics.reference
    factor = 2.0 if reference.rate_normalisation == "c/2V" else 1.0
    reduced = roll_rate * reference.length / (factor * speed)
    inertia = factor * vehicle.inertia[0, 0] / (vehicle.mass * reference.length**2)
    return replace(aerodynamics, Cl_0=-(aerodynamics.Cl_p + inertia * aerodynamics.CA_0) * reduced)


def check_damping(
    vehicle: Vehicle,
    aerodynamics: SymmetricMissile,
    speed: float,
    *,
    roll_rate: float = 0.0,
    amplitude: float = math.radians(1.0),
    atmosphere: Atmosphere | None = None,
    altitude: float = 0.0,
    wavelengths: float = 6.0,
    step: float | None = None,
) -> DampingCheck:
    """Damping of a missile: linearised, read from a nonlinear flight twice, and by the closed form of its derivatives.

    The flight is straight (no gravity), starts at an angle of attack with its lag states settled, and holds p/V by
    fin cant. The fit leaves out the start, until the aerodynamic transient of release has died out.

    Parameters
    ----------
    vehicle : Vehicle
    aerodynamics : SymmetricMissile
        For a state-space model the closed form takes its derivatives at k = 0.
    speed : float
        At the start [m/s].
    roll_rate : float
        At the start [rad/s].
    amplitude : float
        Initial angle of attack [rad].
    atmosphere : Atmosphere, optional
        20 C and 1 atm if not given.
    altitude : float
        [m].
    wavelengths : float
        Length of the flight, in turns of the slow arm (of the pitch frequency at zero roll).
    step : float, optional
        Of Runge-Kutta [s]. If not given, the method is `fly`'s; Runge-Kutta then takes half of its step, since its
        steps damp by themselves a little.

    Raises
    ------
    InputError
        If the arms do not turn (a missile without static stability, or overdamped).
    """
    air = ConstantAtmosphere() if atmosphere is None else atmosphere
    held = holding_roll(vehicle, aerodynamics, speed, roll_rate)
    dynamics = build_dynamics(vehicle, held, air, FlatEarth(0.0))
    modes = missile_modes(dynamics, speed, roll_rate=roll_rate, altitude=altitude)
    here = air_at(air, altitude)
    density, sound = float(here.density), float(here.speed_of_sound)
    derivatives = held.quasi_steady()
    closed = epicyclic_roots(vehicle, derivatives, density, speed, roll_rate)

    slowest = min(abs(modes[name].per_metre.imag) for name in ("fast arm", "slow arm"))
    if slowest < 1e-9 * abs(modes["fast arm"].per_metre):
        raise InputError("the angles of this missile do not oscillate: it has no static stability, or is overdamped")
    slowing = density * speed * vehicle.reference.area * held.CA_0 / (4.0 * vehicle.mass)
    distance = wavelengths * 2.0 * math.pi / slowest
    decay = 2.0 * slowing / speed  # of V over distance: V = V0 exp(-decay s)
    duration = math.expm1(decay * distance) / (decay * speed) if decay else distance / speed
    initial = InitialState.from_path(speed, alpha=amplitude, rate=(roll_rate, 0.0, 0.0), position=(0.0, 0.0, -altitude))
    every, method = None, None
    if step is None:
        step, kept = suggest_step(dynamics, dynamics.initial_vector(initial), np.zeros(0), duration)
        step, every, method = 0.5 * step, 2 * kept, suggest_method(kept)
        if duration > MAX_STEPS * step:
            told = f"a flight of {duration:.3g} s at a roll rate of {roll_rate:.4g} rad/s"
            raise InputError(f"{told} takes {duration / step:.2g} steps, at most {MAX_STEPS} are flown")
    trajectory = fly(dynamics, initial, duration, step=step, every=every, method=method)
    transient = max((10.0 / abs(mode.per_metre.real) for mode in modes.lag), default=0.0)
    skip = min(transient, 0.25 * distance)
    fit = fit_trajectory(trajectory, trim=False, skip=skip)
    names = ("fast arm", "slow arm")
    arms = tuple(
        ArmDamping(
            name=name,
            linearised=modes[name].eigenvalue,
            fitted=fitted.eigenvalue * speed,
            closed_form=root * speed,
            decay=arm_decay(trajectory, modes[other].per_metre, skip=skip) * speed,
        )
        for name, other, fitted, root in zip(names, names[::-1], (fit.fast, fit.slow), closed, strict=True)
    )
    return DampingCheck(
        arms=(arms[0], arms[1]),
        model=aerodynamics.summary(),
        speed=speed,
        mach=speed / sound,
        roll_rate=roll_rate,
        slowing=slowing,
        modes=modes,
        fit=fit,
        trajectory=trajectory,
    )
