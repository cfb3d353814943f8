r"""The unsteady vortex lattice behind the solver protocol: motion in, history out."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from indicial import __version__
from indicial.cfd.lattice.influence import Influence
from indicial.cfd.lattice.instant import Instant, StripLoads
from indicial.cfd.lattice.linear import LinearLattice
from indicial.cfd.lattice.linear_response import frequency_response
from indicial.cfd.lattice.march import March, steady_instant
from indicial.cfd.lattice.panels import Lattice
from indicial.cfd.lattice.wake import RigidMotion, WakeModel
from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities, mesh_from_body
from indicial.errors import InputError
from indicial.frequency import INPUTS, FrequencyResponse, check_inputs, reduced_frequencies
from indicial.history import History
from indicial.motion import FlightCondition, Motion, Rates
from indicial.solver import SteadyLoads

_SOLVER = "unsteady vortex lattice"


@dataclass(frozen=True)
class LatticeSettings:
    """How the lattice is solved.

    Parameters
    ----------
    wake : {"shed", "frozen"}
        Left in still air where the body was (helical in a steady rotation), or carried along the stream of the
        flight condition, as in linear theory.
    compressible : bool
        Whether the Mach number counts (Prandtl and Glauert's rule, up to M 0.7).
    core : float
        Radius of the wake's cores over the reference length: what a tail feels in a wake that cuts it.
    """

    wake: WakeModel = "shed"
    compressible: bool = True
    core: float = 1e-3

    def __post_init__(self) -> None:
        if self.wake not in ("shed", "frozen"):
            raise InputError(f"wake is {self.wake!r}, must be 'shed' or 'frozen'")
        if not (np.isfinite(self.core) and self.core >= 0.0):
            raise InputError(f"core is {self.core}, must be finite and at least 0")


class LatticeSolver:
    """Inviscid attached flow about lifting surfaces.

    Parameters
    ----------
    lattice : Lattice
    reference : ReferenceQuantities
        Of loads, moments and rates.
    settings : LatticeSettings, optional
    """

    def __init__(
        self, lattice: Lattice, reference: ReferenceQuantities, settings: LatticeSettings = LatticeSettings()
    ) -> None:
        self.lattice = lattice
        self.settings = settings
        self._reference = reference
        self._influence = lru_cache(maxsize=4)(self._influence_at)

    @property
    def reference(self) -> ReferenceQuantities:
        """What the loads are made dimensionless with."""
        return self._reference

    def influence(self, condition: FlightCondition) -> Influence:
        """What panels induce on one another at a flight condition."""
        return self._influence(condition.mach if self.settings.compressible else 0.0)

    def _influence_at(self, mach: float) -> Influence:
        return Influence.of(self.lattice, mach, self.settings.core * self._reference.length)

    def motion(self, velocity: ArrayLike, rate: ArrayLike) -> RigidMotion:
        """Mesh axes, from V_b [m/s] and omega [rad/s] in body axes.

        Raises
        ------
        InputError
            If they are not finite.
        """
        v, w = mesh_from_body(velocity), mesh_from_body(rate)
        if not (np.all(np.isfinite(v)) and np.all(np.isfinite(w))):
            raise InputError(f"the motion is not finite: velocity {v} m/s, rate {w} rad/s in mesh axes")
        return RigidMotion(v, w, np.asarray(self._reference.moment_reference, dtype=float))

    def frozen(self, condition: FlightCondition) -> RigidMotion | None:
        """What a frozen wake follows; None for one that is shed."""
        return self.motion(condition.velocity, np.zeros(3)) if self.settings.wake == "frozen" else None

    def steady(self, condition: FlightCondition, rates: Rates = Rates()) -> SteadyLoads:
        """Loads of the steady state at constant velocity and body rates.

        Raises
        ------
        InputError
            If the Mach number is beyond the linear rule.
        """
        motion = self.motion(condition.velocity, rates.as_array())
        instant = steady_instant(self.influence(condition), motion, self.frozen(condition))
        loads = self.coefficients(instant.loads(instant.circulation()), condition)
        return SteadyLoads(loads, condition, rates, self._reference, self.provenance)

    def unsteady(self, condition: FlightCondition, motion: Motion, times: ArrayLike) -> History:
        r"""Loads at `times` [s], which are the steps of the march too.

        A jump of the motion at t = 0 gives an incompressible flow an impulse (its added mass), which no instant's loads
        can show. It is left out of them and kept in ``provenance["impulse"]``: ``integral of C ds`` over the jump, by
        load. The loads at t = 0+ are those just after it, with the rate of change of the first step. The time in which
        the wing goes the length of two panels is not resolved.
        """
        t = np.asarray(times, dtype=float)
        if t.ndim != 1 or t.size < 1 or t[0] != 0.0 or np.any(np.diff(t) <= 0.0) or not np.all(np.isfinite(t)):
            raise InputError("times must be finite, start at 0 and increase")
        influence, frozen = self.influence(condition), self.frozen(condition)
        before = self.motion(motion.velocity_before, motion.rate_before)
        start = steady_instant(influence, before, frozen)
        settled = start.circulation()
        march = March(influence, before, settled, frozen)
        velocity, rate = motion.velocity(t), motion.rate(t)
        loads = np.empty((t.size, 6))
        kept: list[tuple[Instant, Array]] = []
        with threadpool_limits(limits=1, user_api="blas"):  # small matrices: threads would only fight
            for n in range(t.size):
                instant = march.advance(float(t[n]), self.motion(velocity[n], rate[n]))
                circulation = instant.circulation()
                march.accept(circulation)
                loads[n] = self.coefficients(instant.loads(circulation), condition)
                kept = [*kept, (instant, circulation)] if n < 2 else kept
        if t.size > 1:
            (first, after_jump), (_, later) = kept
            loads[0] = self.coefficients(first.loads(after_jump, (later - after_jump) / t[1]), condition)
        per_time = 2.0 * condition.speed / self._reference.length
        impulse = self.coefficients(jump_impulse(kept[0][0], start), condition) * per_time
        return History(
            time=t,
            coefficients=loads,
            velocity=velocity,
            rate=rate,
            before=self.coefficients(start.loads(settled), condition),
            condition=condition,
            reference=self._reference,
            motion=motion.describe(),
            provenance=self.provenance | {"impulse": dict(zip(COEFFICIENTS, impulse.tolist(), strict=True))},
        )

    def linearise(self, condition: FlightCondition) -> LinearLattice:
        """The lattice linearised about steady flight at a condition, without rotation.

        The wake is that of the settings: one that is shed is displaced by the disturbance too.
        """
        motion = self.motion(condition.velocity, np.zeros(3))
        baseline = self.steady(condition).coefficients
        return LinearLattice.about(
            self.influence(condition),
            motion,
            baseline,
            condition,
            self._reference,
            shed=self.settings.wake == "shed",
        )

    def frequency_response(
        self, condition: FlightCondition, k: ArrayLike = (), inputs: tuple[str, ...] | None = None
    ) -> FrequencyResponse:
        """H(ik) from motion to the six loads at reduced frequencies `k`, with H(0) and H'(0).

        An incompressible flow follows a jump with an impulse: `direct` is that of alphadot, and not a number for what
        has none.

        Raises
        ------
        InputError
            If a frequency is negative or not finite, or an input is unknown.
        """
        names, ks = INPUTS if inputs is None else inputs, reduced_frequencies(k)
        check_inputs(names)
        return frequency_response(self.linearise(condition), names, ks, self.provenance)

    def coefficients(self, loads: StripLoads, condition: FlightCondition) -> Array:
        """The six coefficients of all strips together, shape (6,)."""
        force, moment = loads.total
        moment = mesh_from_body(moment) / self._reference.moment_lengths
        out: Array = np.concatenate([force, moment]) / (0.5 * condition.speed**2 * self._reference.area)
        return out

    @property
    def provenance(self) -> dict[str, Any]:
        """How loads are made (plain values)."""
        return {
            "solver": _SOLVER,
            "version": __version__,
            "panels": self.lattice.n_panels,
            "wake": self.settings.wake,
            "compressible": int(self.settings.compressible),
        }


def jump_impulse(after: Instant, before: Instant) -> StripLoads:
    """Impulse of the jump between two instants, loads times seconds."""
    influence = after.influence
    lattice = influence.lattice
    circulation = influence.impulse((before.wind - after.wind)[: lattice.n_panels])
    pushes = circulation[:, None] * lattice.ring_area
    turns = np.cross(lattice.ring_centre - after.motion.centre, pushes)
    force, moment = np.zeros((lattice.n_strips, 3)), np.zeros((lattice.n_strips, 3))
    np.add.at(force, lattice.strip, pushes)
    np.add.at(moment, lattice.strip, turns)
    return StripLoads(force, moment)
