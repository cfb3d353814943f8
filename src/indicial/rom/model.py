r"""What all reduced-order models share: the reading of motions, the loads they return, their derivatives.

A model is linear about one flight condition: ``C_j = C_j0 + sum over inputs of the responses``. Let H(s) be its
transfer functions in reduced time from alpha [rad] and ``q c/2V`` to the coefficients. Then ``C_ja = H_a(0)``,
``C_jad = H_a'(0)``, ``C_jq = H_q(0)``, and the out-of-phase part of a forced pitch oscillation at reduced frequency
k is ``Im(H_a(ik) + ik H_q(ik))/k``. Every model is a `Solver`: the methods run on it unchanged.
"""

from __future__ import annotations

import logging
from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities
from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError
from indicial.history import History
from indicial.motion import FlightCondition, Motion, Rates
from indicial.rom.signals import ANGLES, INPUTS, MotionInputs, check_names, rate_factor
from indicial.solver import SteadyLoads

_LOG = logging.getLogger(__name__)

ComplexArray = NDArray[np.complex128]


class ReducedModel(ABC):
    """A linear model of unsteady loads about a flight condition; a `Solver`.

    Attributes
    ----------
    inputs : tuple of str
        Of alpha, beta [rad] and p, q, r (``q c/2V``); deviations from `condition`.
    outputs : tuple of str
        Of the six coefficients. Those not modelled stay at their value in `baseline`.
    baseline : ndarray
        (CA, CY, CN, Cl, Cm, Cn) of the steady state at `condition`, shape (6,).
    condition : FlightCondition
    reference : ReferenceQuantities
    """

    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    baseline: Array
    condition: FlightCondition
    reference: ReferenceQuantities

    @property
    @abstractmethod
    def static_gain(self) -> Array:
        """``H(0)``: settled loads per unit input, shape (n_outputs, n_inputs)."""

    @property
    @abstractmethod
    def rate_gain(self) -> Array:
        """``H'(0)``: settled loads per unit ``d(input)/ds``, shape (n_outputs, n_inputs)."""

    def refusals(self) -> dict[str, str]:
        """Derivatives for which the data give no limit at k -> 0, with the reason."""
        return {}

    @abstractmethod
    def frequency_response(self, k: ArrayLike) -> ComplexArray:
        """``H(ik)`` at reduced frequencies k, shape (n_k, n_outputs, n_inputs)."""

    @abstractmethod
    def respond(self, inputs: MotionInputs) -> Array:
        """Loads less `baseline` under `inputs`, shape (n, n_outputs), at every stride-th sample."""

    def describe(self) -> dict[str, Any]:
        """Kind and parameters as plain values, stored with every predicted history."""
        return {"rom": type(self).__name__, "inputs": list(self.inputs), "outputs": list(self.outputs)}

    def predict(
        self,
        motion: History | Motion,
        times: ArrayLike | None = None,
        *,
        neglect: tuple[str, ...] = (),
        substeps: int = 8,
    ) -> History:
        """Loads under a motion, or under the motion of a history.

        Parameters
        ----------
        motion : History or Motion
            A history's motion is followed along local cubics through its samples.
        times : array_like, optional
            Instants [s], from 0 (0+); for a `Motion` only.
        neglect : tuple of str
            Inputs that may vary although the model has no response to them.
        substeps : int
            Into how many pieces, each linear, every interval is cut; 1 takes the motion linear between samples.

        Returns
        -------
        History
            At the instants given; coefficients that are not outputs of the model stay at `baseline`.

        Raises
        ------
        InputError
            If the motion varies an input that the model lacks, is at another Mach number, or comes from a history of
            other reference quantities (its reduced time and rates would be others).
        """
        if isinstance(motion, History):
            self._check(motion.condition)
            if motion.reference != self.reference:
                raise InputError("history and model differ in reference quantities; convert one of them first")
            if times is not None:
                raise InputError("times are those of the history to predict; give times with a Motion only")
            inputs = MotionInputs.from_history(motion, self.inputs, self.condition, neglect=neglect, substeps=substeps)
            time, velocity, rate = motion.time, motion.velocity, motion.rate
            condition, described = motion.condition, motion.motion
        else:
            if times is None:
                raise InputError("a Motion is predicted at given times: times is missing")
            time = np.asarray(times, dtype=float)
            condition = self.condition
            inputs = self._sample(condition, motion, time, neglect, substeps)
            velocity, rate, described = motion.velocity(time), motion.rate(time), motion.describe()
        return self._history(inputs, time, velocity, rate, condition, described)

    def steady(self, condition: FlightCondition, rates: Rates = Rates()) -> SteadyLoads:
        """Settled loads at constant velocity and body rates: ``C_0 + H(0) u``.

        Raises
        ------
        InputError
            At another Mach number, or if an input is asked for that the model lacks.
        """
        self._check(condition)
        deviations = {"alpha": condition.alpha - self.condition.alpha, "beta": condition.beta - self.condition.beta}
        for name in "pqr":
            deviations[name] = getattr(rates, name) * rate_factor(name, condition.speed, self.reference)
        left = [name for name in INPUTS if deviations[name] != 0.0 and name not in self.inputs]
        if left:
            raise InputError(f"the state has {', '.join(left)}, but the model's inputs are {', '.join(self.inputs)}")
        loads = self._filled((self.static_gain @ np.array([deviations[name] for name in self.inputs]))[None])[0]
        return SteadyLoads(loads, condition, rates, self.reference, {"rom": type(self).__name__})

    def unsteady(self, condition: FlightCondition, motion: Motion, times: ArrayLike) -> History:
        """Loads at `times` [s] under `motion`, each interval taken as eight linear pieces of it."""
        self._check(condition)
        time = np.asarray(times, dtype=float)
        inputs = self._sample(condition, motion, time, (), 8)
        return self._history(inputs, time, motion.velocity(time), motion.rate(time), condition, motion.describe())

    def derivatives(self, k: float | None = None) -> DerivativeTable:
        r"""Derivatives of every output, by method ``rom``.

        At k -> 0 (k not given): ``C_ja = H_a(0)``, ``C_jad = H_a'(0)``, ``C_jq = H_q(0)``. At a given k those that
        oscillations would give: plunging ``Re H_a(ik)`` and ``Im H_a(ik)/k``, pitching at constant alpha
        ``Re H_q(ik)``; the sum of the latter two is the out-of-phase part of a pitching oscillation.
        Rate derivatives are per ``c/2V`` or ``c/V`` as the reference quantities say. What is in `refusals` has no
        limit, is left out at k -> 0, and is logged with its reason.
        """
        if k is None:
            static, rate = self.static_gain, self.rate_gain
            refusals = self.refusals()
            for reason in refusals.values():
                _LOG.warning("left out of the derivatives: %s", reason)
        else:
            if not (np.isfinite(k) and k > 0.0):
                raise InputError(f"k is {k}, must be positive and finite, or left out for the limit k -> 0")
            h = self.frequency_response([k])[0]
            static, rate, refusals = h.real, h.imag / k, {}
        per_rate = 1.0 if self.reference.rate_normalisation == "c/2V" else 0.5
        source = self.describe()["rom"]
        lengths = dict(zip(ANGLES, self.reference.moment_lengths[[1, 2]] / self.reference.length, strict=True))
        records = []
        for i, output in enumerate(self.outputs):
            values: dict[str, float] = {}
            for j, name in enumerate(self.inputs):
                if name in ANGLES:
                    values[name] = static[i, j]
                    values[f"{name}dot"] = rate[i, j] * per_rate / lengths[name]
                else:
                    values[name] = static[i, j] * per_rate
            records += [
                Derivative.at(self.condition, self.reference, f"{output}_{name}", "rom", value, source, k=k)
                for name, value in values.items()
                if f"{output}_{name}" not in refusals
            ]
        return DerivativeTable(tuple(records)).with_sums()

    def _check(self, condition: FlightCondition) -> None:
        if abs(condition.mach - self.condition.mach) > 1e-6 * self.condition.mach:
            raise InputError(f"the model is for Mach {self.condition.mach:g}, not for Mach {condition.mach:g}")

    def _check_names(self) -> None:
        check_names(self.inputs, INPUTS, "model inputs")
        check_names(self.outputs, COEFFICIENTS, "model outputs")
        if np.shape(self.baseline) != (6,):
            raise InputError(f"model baseline has shape {np.shape(self.baseline)}, must be (6,)")

    def _sample(
        self, condition: FlightCondition, motion: Motion, time: Array, neglect: tuple[str, ...], substeps: int
    ) -> MotionInputs:
        return MotionInputs.from_motion(
            motion,
            time,
            condition.speed,
            self.inputs,
            self.condition,
            self.reference,
            neglect=neglect,
            substeps=substeps,
        )

    def _filled(self, loads: Array) -> Array:
        """All six coefficients, shape (n, 6), from the outputs' deviations (n, n_outputs)."""
        full = np.repeat(np.asarray(self.baseline, dtype=float)[None], len(loads), axis=0)
        full[:, [COEFFICIENTS.index(name) for name in self.outputs]] += loads
        return full

    def _history(
        self,
        inputs: MotionInputs,
        time: Array,
        velocity: Array,
        rate: Array,
        condition: FlightCondition,
        described: dict[str, Any],
    ) -> History:
        return History(
            time=time,
            coefficients=self._filled(self.respond(inputs)),
            velocity=velocity,
            rate=rate,
            before=self._filled((self.static_gain @ inputs.before)[None])[0],
            condition=condition,
            reference=self.reference,
            motion=described,
            provenance=self.describe(),
        )
