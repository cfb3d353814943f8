r"""Nonlinear indicial model: a static curve, and step responses that change with the angle of attack.

    C(s) = C_static(alpha(s)) + C_q(alpha(s)) q(s)
           - integral F_a(s - t; alpha(t)) dalpha(t) - lagged part of the response to q

with the deficiency functions of small steps about each angle (Tobak and Schiff, NASA TR R-454, 1976). With lags common
to all angles, ``F_a(s; alpha) = sum_i a_i(alpha) exp(-p_i s)``, the integrals are linear lags of static curves
``G_i(alpha) = integral a_i dalpha`` and ``a_qi(alpha) q``: the model is stable whatever the motion, gives the static
curve exactly when the motion is slow, and is the linear model where nothing depends on the angle. It knows no history
of the angle beyond its lags: where a flow has two states at one angle (static hysteresis) it does not hold.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BSpline, CubicHermiteSpline, make_interp_spline

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities
from indicial.errors import InputError
from indicial.files import parts_of, read_json, write_text
from indicial.history import History
from indicial.motion import FlightCondition, Motion
from indicial.rom.model import ComplexArray
from indicial.rom.response import StepResponses
from indicial.rom.schedule import schedule
from indicial.rom.signals import MotionInputs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCHEMA_VERSION = 1
FORMAT = "indicial nonlinear model"


@dataclass(frozen=True)
class AngleResponses:
    """Step responses of one input over the angle of attack.

    Parameters
    ----------
    input : str
        alpha or q.
    rates, pairs : ndarray
        The lags, see `rom.modes.Modes`; the same at every angle.
    static : ndarray
        Final values at each angle, shape (n_angles, n_outputs).
    amplitudes : ndarray
        Of the deficiency functions, shape (n_angles, order, n_outputs).
    """

    input: str
    rates: Array
    pairs: Array
    static: Array
    amplitudes: Array

    @property
    def poles(self) -> ComplexArray:
        """One for each real lag and each pair, shape (n_lags,)."""
        return np.concatenate([-self.rates.astype(complex), -self.pairs[:, 0] + 1j * self.pairs[:, 1]])

    @property
    def residues(self) -> ComplexArray:
        """``F = Re sum residue exp(pole s)``, shape (n_angles, n_lags, n_outputs)."""
        real, n = self.amplitudes.astype(complex), self.rates.size
        return np.concatenate([real[:, :n], real[:, n::2] - 1j * real[:, n + 1 :: 2]], axis=1)


@dataclass(frozen=True)
class NonlinearModel:
    """Loads of motions through large angles of attack at one Mach number; a `Solver`.

    Parameters
    ----------
    alpha : ndarray
        Angles at which it is known [rad], increasing, shape (n_angles,).
    baselines : ndarray
        Six steady coefficients at each, shape (n_angles, 6).
    responses : tuple of AngleResponses
        To alpha, and to q where it is known.
    outputs : tuple of str
    condition : FlightCondition
        At the first angle.
    reference : ReferenceQuantities
    """

    alpha: Array
    baselines: Array
    responses: tuple[AngleResponses, ...]
    outputs: tuple[str, ...]
    condition: FlightCondition
    reference: ReferenceQuantities
    provenance: dict[str, Any] = field(default_factory=dict)

    @property
    def inputs(self) -> tuple[str, ...]:
        """alpha, and q where it is known."""
        return tuple(one.input for one in self.responses)

    @cached_property
    def static_curve(self) -> CubicHermiteSpline:
        """Outputs over alpha, through the steady states with the final values of small steps as slopes."""
        rows = [COEFFICIENTS.index(name) for name in self.outputs]
        return CubicHermiteSpline(self.alpha, self.baselines[:, rows], self.responses[0].static)

    def mismatch(self) -> Array:
        """How far steady states and final values of steps contradict one another, shape (n_outputs,).

        Largest difference between a change of the steady loads from one angle to the next and the mean of the final
        values there times the change of angle, relative to the range of the loads.
        Small where the angles are close enough and steps and steady states are of one solver.
        """
        rows = [COEFFICIENTS.index(name) for name in self.outputs]
        steady, slopes = self.baselines[:, rows], self.responses[0].static
        by_steps = 0.5 * (slopes[1:] + slopes[:-1]) * np.diff(self.alpha)[:, None]
        off = np.max(np.abs(np.diff(steady, axis=0) - by_steps), axis=0)
        return np.asarray(off / np.maximum(np.ptp(steady, axis=0), 1e-300))

    def predict(
        self,
        motion: History | Motion,
        times: ArrayLike | None = None,
        *,
        neglect: tuple[str, ...] = (),
        substeps: int = 8,
    ) -> History:
        """Loads under a motion at `times` [s], or under the motion of a history; see `ReducedModel.predict`.

        Raises
        ------
        InputError
            If the motion leaves the angles that are known, varies another input, or comes from a history of other
            reference quantities.
        """
        names = self.inputs
        if isinstance(motion, History):
            if times is not None:
                raise InputError("times are those of the history to predict; give times with a Motion only")
            self._check(motion.condition)
            if motion.reference != self.reference:
                raise InputError("history and model differ in reference quantities; convert one of them first")
            given = MotionInputs.from_history(motion, names, self.condition, neglect=neglect, substeps=substeps)
            time, velocity, rate = motion.time, motion.velocity, motion.rate
            condition, described = motion.condition, motion.motion
        else:
            if times is None:
                raise InputError("a Motion is predicted at given times: times is missing")
            time, condition, described = np.asarray(times, dtype=float), self.condition, motion.describe()
            given = MotionInputs.from_motion(
                motion, time, condition.speed, names, condition, self.reference, neglect=neglect, substeps=substeps
            )
            velocity, rate = motion.velocity(time), motion.rate(time)
        loads, before = self.respond(given)
        six = self._filled(np.vstack([before, loads]), np.append(given.before[0], given.values[:: given.stride, 0]))
        return History(
            time, six[1:], velocity, rate, six[0], condition, self.reference, described,
            {"rom": type(self).__name__, "outputs": list(self.outputs)},
        )  # fmt: skip

    def unsteady(self, condition: FlightCondition, motion: Motion, times: ArrayLike) -> History:
        """Loads at `times` [s] under `motion`."""
        self._check(condition)
        return replace(self.predict(motion, times), condition=condition)

    def respond(self, given: MotionInputs) -> tuple[Array, Array]:
        """Outputs, shape (n, n_outputs), at every stride-th sample, and those of the state before, (n_outputs,).

        Exact for static curves that are linear between samples.
        """
        u = np.vstack([given.before, given.values])
        angle = u[:, 0] + self.condition.alpha
        if np.min(angle) < self.alpha[0] - 1e-9 or np.max(angle) > self.alpha[-1] + 1e-9:
            low, high, least, most = np.degrees([self.alpha[0], self.alpha[-1], np.min(angle), np.max(angle)])
            raise InputError(
                f"the motion goes from alpha {least:.4g} to {most:.4g} deg, "
                f"the model is known from {low:.4g} to {high:.4g}"
            )
        loads = np.asarray(self.static_curve(angle), dtype=float)
        for j, one in enumerate(self.responses):
            curve = self._curves[one.input]
            residues = curve(angle) if one.input == "alpha" else curve(angle) * u[:, j, None, None]
            if one.input != "alpha":
                loads = loads + self._settled[one.input](angle) * u[:, j, None]
            loads[1:] -= _lagged(given.s, one.poles, residues)
        return loads[1:][:: given.stride], loads[0]

    @cached_property
    def _curves(self) -> dict[str, BSpline]:
        """Of alpha: integrals of the residues over the angle; of q: the residues."""
        degree = min(3, self.alpha.size - 1)
        splines = {one.input: make_interp_spline(self.alpha, one.residues, k=degree) for one in self.responses}
        return {name: one.antiderivative() if name == "alpha" else one for name, one in splines.items()}

    @cached_property
    def _settled(self) -> dict[str, BSpline]:
        degree = min(3, self.alpha.size - 1)
        return {one.input: make_interp_spline(self.alpha, one.static, k=degree) for one in self.responses}

    def _filled(self, loads: Array, deviation: Array) -> Array:
        """All six coefficients: those that are not outputs follow the steady states."""
        angle = deviation + self.condition.alpha
        six = np.stack([np.interp(angle, self.alpha, column) for column in self.baselines.T], axis=1)
        six[:, [COEFFICIENTS.index(name) for name in self.outputs]] = loads
        return six

    def _check(self, condition: FlightCondition) -> None:
        if abs(condition.mach - self.condition.mach) > 1e-6 * self.condition.mach:
            raise InputError(f"the model is for Mach {self.condition.mach:g}, not for Mach {condition.mach:g}")

    def to_json(self, path: str | Path) -> None:
        """Write a JSON file; numbers are exact."""
        values = {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "alpha": self.alpha.tolist(),
            "baselines": self.baselines.tolist(),
            "responses": [
                {key: part.tolist() if isinstance(part, np.ndarray) else part for key, part in vars(one).items()}
                for one in self.responses
            ],
            "outputs": list(self.outputs),
            "condition": asdict(self.condition),
            "reference": self.reference.to_dict(),
            "provenance": self.provenance,
        }
        write_text(path, json.dumps(values, indent=1))

    @classmethod
    def from_json(cls, path: str | Path) -> Self:
        """Read a file of `to_json`.

        Raises
        ------
        InputError
            If the file is missing, damaged or holds something else.
        """
        values = read_json(path, FORMAT, SCHEMA_VERSION)
        with parts_of(path):
            responses = tuple(
                AngleResponses(
                    one["input"], np.array(one["rates"]), np.array(one["pairs"]).reshape(-1, 2),
                    np.array(one["static"]), np.array(one["amplitudes"]),
                )
                for one in values["responses"]
            )  # fmt: skip
            return cls(
                np.array(values["alpha"]),
                np.array(values["baselines"]),
                responses,
                tuple(values["outputs"]),
                FlightCondition(**values["condition"]),
                ReferenceQuantities.from_dict(values["reference"]),
                values["provenance"],
            )

    def summary(self) -> str:
        """Angles, lags, and how well steps and steady states go together."""
        low, high = np.degrees([self.alpha[0], self.alpha[-1]])
        lags = sum(one.poles.size for one in self.responses)
        off = ", ".join(f"{name} {part:.2%}" for name, part in zip(self.outputs, self.mismatch(), strict=True))
        return (
            f"nonlinear indicial model at M {self.condition.mach:g}, alpha {low:.4g} to {high:.4g} deg "
            f"({self.alpha.size} angles): {lags} lags, {', '.join(self.inputs)} to {', '.join(self.outputs)}\n"
            f"  steady states and final values of steps differ by, of the range: {off}"
        )

    def plot(self) -> Figure:
        """The static curves, and the deficiencies at 0+ over the angle."""
        import matplotlib.pyplot as plt

        rows = len(self.outputs)
        figure, axes = plt.subplots(rows, 2, squeeze=False, figsize=(9.0, 2.8 * rows), layout="constrained")
        fine, known = np.linspace(self.alpha[0], self.alpha[-1], 200), np.degrees(self.alpha)
        for i, name in enumerate(self.outputs):
            axes[i, 0].plot(np.degrees(fine), self.static_curve(fine)[:, i], label="static curve")
            axes[i, 0].plot(known, self.baselines[:, COEFFICIENTS.index(name)], "k.", label="steady states")
            axes[i, 0].set_ylabel(name)
            for one in self.responses:
                initial = one.residues.real.sum(axis=1)[:, i]
                axes[i, 1].plot(known, initial, ".-", label=f"to {one.input}")
            axes[i, 1].set_ylabel(f"{name}: final value less jump")
        axes[0, 0].legend()
        axes[0, 1].legend()
        for one in axes[-1]:
            one.set_xlabel("alpha [deg]")
        return figure


def _lagged(s: Array, poles: ComplexArray, curves: ComplexArray) -> Array:
    """``Re integral exp(pole (s - t)) d(curve)``, curves linear between samples, shape (n, n_outputs).

    Parameters
    ----------
    s : ndarray
        Shape (n,).
    poles : ndarray
        Shape (n_lags,).
    curves : ndarray
        At rest, then at every s: a difference of the first two is a jump at ``s[0]``; shape (n + 1, n_lags, n_outputs).
    """
    step = np.diff(s)[:, None]
    decay = np.exp(poles * step)
    gain = np.expm1(poles * step) / (poles * step)
    change = np.diff(curves, axis=0)
    state = change[0].astype(complex)
    lagged = np.empty((s.size, curves.shape[2]))
    lagged[0] = state.real.sum(axis=0)
    for i in range(1, s.size):
        state = decay[i - 1, :, None] * state + gain[i - 1, :, None] * change[i]
        lagged[i] = state.real.sum(axis=0)
    return lagged


def nonlinear_model(points: Sequence[StepResponses], order: int = 4) -> NonlinearModel:
    """A nonlinear model from small steps about several angles of attack, and the steady loads there.

    Parameters
    ----------
    points : sequence of StepResponses
        At one Mach number, to alpha, and to q if wanted; `baseline` of each is its steady state. Where the loads bend
        the angles must be close: see `NonlinearModel.mismatch`.
    order : int
        Lags for each input, the same at all angles.

    Raises
    ------
    InputError
        If the points differ in anything but alpha, or there is no response to alpha, or one to another input.
    """
    if len({one.condition.mach for one in points}) > 1:
        raise InputError("a nonlinear model is for one Mach number")
    names = {name for one in points for name in one.inputs}
    if not {"alpha"} <= names <= {"alpha", "q"}:
        raise InputError(f"a nonlinear model answers to alpha and q; there are responses to {', '.join(sorted(names))}")
    common = schedule(points, order, degree=0)
    responses = []
    for j, name in enumerate(common.inputs):
        # the schedule's own amplitudes: with jump, final value and integral exactly those of the data at each angle
        modes = common.families[j].at(common.nodes, *common.nodes.points[0])
        responses.append(AngleResponses(name, modes.rates, modes.pairs, common.static[:, :, j], common.amplitudes[j]))
    responses.sort(key=lambda one: one.input)
    return NonlinearModel(
        common.nodes.alpha, common.baselines, tuple(responses), common.outputs, common.condition, common.reference
    )
