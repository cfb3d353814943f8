r"""One model over Mach number and angle of attack.

At every condition ``dx/ds = A x + B u``, ``C = C_0 + C x + D u`` in the same coordinates: each state is the input of
the model seen through one lag (or one pair of them), at rest 1 for a unit input. Only the lags and the weights of the
states change with the condition, and A + A^T is negative at all of them, so that the states die out however quickly the
condition changes. The value at 0+, the final value and the integral of each step response are those of the data,
interpolated.
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
from scipy.linalg import block_diag
from threadpoolctl import threadpool_limits

from indicial.conventions import Array, ReferenceQuantities
from indicial.errors import InputError
from indicial.files import parts_of, read_json, write_text
from indicial.motion import FlightCondition
from indicial.rom.mode_fitting import TimeTarget
from indicial.rom.modes import Modes
from indicial.rom.realisation import realise
from indicial.rom.response import StepResponses
from indicial.rom.scheduled_modes import ModeFamily, Nodes, fit_family
from indicial.rom.simulation import simulate
from indicial.rom.sources import StepSource
from indicial.rom.state_space import StateSpaceModel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCHEMA_VERSION = 1
FORMAT = "indicial scheduled model"

_ENOUGH = 1.25
_EVALUATIONS = 60


@dataclass(frozen=True)
class LeftOut:
    """What a schedule says of a Mach number that it was not made from.

    Parameters
    ----------
    mach : float
    errors : dict
        Largest error of each step response relative to its peak, by ``(output, input)``, over all alpha.
    """

    mach: float
    errors: dict[tuple[str, str], float]

    @property
    def worst(self) -> float:
        """Over the channels."""
        return max(self.errors.values())

    def summary(self) -> str:
        """One line."""
        output, input_ = max(self.errors, key=lambda channel: self.errors[channel])
        return f"M {self.mach:g} left out: off by {self.worst:.2%} of the peak at worst ({output} to {input_})"


@dataclass(frozen=True)
class ScheduledModel:
    """A state-space model whose lags and gains change with the flight condition.

    Parameters
    ----------
    nodes : Nodes
        Where it was made.
    families : tuple of ModeFamily
        Modes of each input.
    amplitudes : tuple of ndarray
        Of each input, shape (n_points, order, n_outputs).
    direct, static, integral : ndarray
        Values at 0+, final values, and integrals of the deficiency functions, shape (n_points, n_outputs, n_inputs).
    baselines : ndarray
        Six coefficients of each steady state, shape (n_points, 6).
    inputs, outputs : tuple of str
    condition : FlightCondition
        One of the points; the others differ in Mach number and alpha.
    reference : ReferenceQuantities
    refused : dict
        Derivatives without a limit at k -> 0 at any point, with the reason.
    """

    nodes: Nodes
    families: tuple[ModeFamily, ...]
    amplitudes: tuple[Array, ...]
    direct: Array
    static: Array
    integral: Array
    baselines: Array
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    condition: FlightCondition
    reference: ReferenceQuantities
    refused: dict[str, str] = field(default_factory=dict)

    @property
    def order(self) -> int:
        """Number of states."""
        return sum(family.coefficients.shape[1] for family in self.families)

    def matrices(self, mach: float, alpha: float = 0.0) -> tuple[Array, Array, Array, Array]:
        """A, B, C, D at one condition.

        Raises
        ------
        InputError
            Outside the schedule.
        """
        weights = self.nodes.weights(mach, alpha)
        direct, static, integral = (np.tensordot(weights, one, 1) for one in (self.direct, self.static, self.integral))
        blocks = []
        for j, (family, known) in enumerate(zip(self.families, self.amplitudes, strict=True)):
            modes = family.at(self.nodes, mach, alpha)
            amplitudes = np.tensordot(weights, known, 1)
            # initial value and integral are those of the data, whatever the interpolation made of them
            rows = np.array([modes.basis(np.zeros(1))[0], modes.integral(np.inf)][: modes.order])
            wanted = np.array([static[:, j] - direct[:, j], integral[:, j]])[: modes.order]
            amplitudes = amplitudes + np.linalg.pinv(rows) @ (wanted - rows @ amplitudes)
            blocks.append(modes.state_space(amplitudes))
        a, b = block_diag(*(block[0] for block in blocks)), block_diag(*(block[1] for block in blocks))
        return a, b, np.hstack([block[2] for block in blocks]), direct

    def at(self, mach: float, alpha: float | None = None) -> StateSpaceModel:
        """The model at one condition; at the alpha of the schedule if it has only one."""
        angle = self._only_alpha if alpha is None else alpha
        a, b, c, d = self.matrices(mach, angle)
        return StateSpaceModel(
            a, b, c, d, self.inputs, self.outputs,
            baseline=self.nodes.weights(mach, angle) @ self.baselines,
            condition=replace(self.condition, mach=mach, alpha=angle),
            reference=self.reference, method="schedule", refused=dict(self.refused),
        )  # fmt: skip

    def respond(self, s: ArrayLike, inputs: ArrayLike, mach: ArrayLike, alpha: ArrayLike | None = None) -> Array:
        """Loads less the baseline while the condition changes, from rest under ``inputs[0]``, shape (n, n_outputs).

        Parameters
        ----------
        s : array_like
            Increasing reduced time of the moment (``ds = 2V dt/c``), shape (n,).
        inputs : array_like
            Deviations from the condition of the moment, linear between samples, shape (n, n_inputs).
        mach, alpha : array_like
            The condition, shape (n,); in each interval that of its middle is taken.
        """
        grid, u, m = (np.asarray(one, dtype=float) for one in (s, inputs, mach))
        angle = np.full(grid.size, self._only_alpha) if alpha is None else np.asarray(alpha, dtype=float)
        a, b, c, d = self.matrices(m[0], angle[0])
        state = -np.linalg.solve(a, b @ u[0])
        loads = [c @ state + d @ u[0]]
        for i in range(1, grid.size):
            a, b, _, _ = self.matrices(0.5 * (m[i - 1] + m[i]), 0.5 * (angle[i - 1] + angle[i]))
            state = simulate(a, b, grid[i - 1 : i + 1], u[i - 1 : i + 1], state)[-1]
            _, _, c, d = self.matrices(m[i], angle[i])
            loads.append(c @ state + d @ u[i])
        return np.array(loads)

    @cached_property
    def _only_alpha(self) -> float:
        if self.nodes.alpha.size > 1:
            raise InputError("the schedule goes over alpha too: give it")
        return float(self.nodes.alpha[0])

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for files."""
        arrays = ("direct", "static", "integral", "baselines")
        return {
            "format": FORMAT,
            "schema_version": SCHEMA_VERSION,
            "mach": self.nodes.mach.tolist(),
            "alpha": self.nodes.alpha.tolist(),
            "families": [
                {"real": one.real, "degree": one.degree, "coefficients": one.coefficients.tolist()}
                for one in self.families
            ],
            "amplitudes": [one.tolist() for one in self.amplitudes],
            **{name: getattr(self, name).tolist() for name in arrays},
            "inputs": list(self.inputs),
            "outputs": list(self.outputs),
            "condition": asdict(self.condition),
            "reference": self.reference.to_dict(),
            "refused": dict(self.refused),
        }

    def to_json(self, path: str | Path) -> None:
        """Write a JSON file; numbers are exact."""
        write_text(path, json.dumps(self.to_dict(), indent=1))

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
            return cls(
                nodes=Nodes(np.array(values["mach"]), np.array(values["alpha"])),
                families=tuple(
                    ModeFamily(one["real"], one["degree"], np.array(one["coefficients"])) for one in values["families"]
                ),
                amplitudes=tuple(np.array(one) for one in values["amplitudes"]),
                **{name: np.array(values[name]) for name in ("direct", "static", "integral", "baselines")},
                inputs=tuple(values["inputs"]),
                outputs=tuple(values["outputs"]),
                condition=FlightCondition(**values["condition"]),
                reference=ReferenceQuantities.from_dict(values["reference"]),
                refused=dict(values["refused"]),
            )

    def summary(self) -> str:
        """Range, states, and the slowest lag at both ends."""
        mach, alpha = self.nodes.mach, np.degrees(self.nodes.alpha)
        over = f"M {mach[0]:g} to {mach[-1]:g} ({mach.size} points)"
        if alpha.size > 1:
            over += f", alpha {alpha[0]:g} to {alpha[-1]:g} deg ({alpha.size})"
        ends = [self.at(float(m), float(self.nodes.alpha[0])).poles[0].real for m in (mach[0], mach[-1])]
        lines = [
            f"scheduled model over {over}: {self.order} states, {', '.join(self.inputs)} to {', '.join(self.outputs)}",
            f"  slowest pole in reduced time {ends[0]:.4g} at the lowest Mach number, {ends[1]:.4g} at the highest",
        ]
        return "\n".join(lines + [f"  refused: {reason}" for reason in self.refused.values()])

    def plot(self) -> Figure:
        """Poles, and final values of every channel, over Mach number at the first alpha."""
        import matplotlib.pyplot as plt

        figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.6), layout="constrained")
        mach, alpha = np.linspace(self.nodes.mach[0], self.nodes.mach[-1], 60), float(self.nodes.alpha[0])
        models = [self.at(float(m), alpha) for m in mach]
        left.plot(mach, [-np.sort(model.poles.real) for model in models], color="C0", lw=1.0)
        left.set_ylabel("decay rates, per 2V/c")
        gains = np.array([model.static_gain for model in models])
        for j, name in enumerate(self.inputs):
            for i, output in enumerate(self.outputs):
                right.plot(mach, gains[:, i, j], label=f"{output} to {name}")
                right.plot(self.nodes.mach, self.static[:: self.nodes.alpha.size, i, j], "k.", ms=4)
        right.set_ylabel("final value per unit input")
        right.legend(fontsize="small")
        for axes in (left, right):
            axes.set_xlabel("Mach number")
        return figure


def schedule(
    points: Sequence[StepResponses], order: int = 4, *, degree: int = 1, evaluations: int = _EVALUATIONS
) -> ScheduledModel:
    """A model over the conditions of several sets of step responses.

    Parameters
    ----------
    points : sequence of StepResponses
        Of the same inputs and outputs; every Mach number with every alpha, once, in any order.
    order : int
        Poles for each input.
    degree : int
        Of the polynomials of Mach number, and of alpha, that the logarithms of the poles follow.
    evaluations : int
        Most evaluations of the misfit.

    Raises
    ------
    InputError
        If the points do not fill a grid, or differ in anything but Mach number and alpha.
    """
    return _scheduled([_Point.of(one) for one in points], order, degree, evaluations)


@dataclass(frozen=True)
class _Point:
    """Step responses at one condition, and what is fitted of them, made once for all fits."""

    data: StepResponses
    sources: dict[str, StepSource]

    @classmethod
    def of(cls, data: StepResponses) -> _Point:
        return cls(data, {response.input: StepSource(response) for response in data.responses})


def _scheduled(points: Sequence[_Point], order: int, degree: int, evaluations: int) -> ScheduledModel:
    points = sorted(points, key=lambda one: (one.data.condition.mach, one.data.condition.alpha))
    known = [one.data for one in points]
    if len(known) < 2:
        raise InputError("a schedule needs two conditions or more")
    first = known[0]
    for one in known[1:]:
        same = (one.inputs, one.outputs, one.reference) == (first.inputs, first.outputs, first.reference)
        moved = replace(one.condition, mach=first.condition.mach, alpha=first.condition.alpha)
        if not same or moved != first.condition:
            raise InputError("points of a schedule may differ in Mach number and alpha only")
    nodes = Nodes.of([(one.condition.mach, one.condition.alpha) for one in known])
    middle = known[len(known) // 2]
    families, amplitudes, integrals = [], [], []
    with threadpool_limits(limits=1, user_api="blas"):
        for name in first.inputs:
            sources = [one.sources[name] for one in points]
            targets = [source.target("all", match_integral=True) for source in sources]
            times = np.array([source.slowest for source in sources]) / sources[len(known) // 2].slowest
            alone = replace(middle, responses=(middle[name],))
            start = realise(alone, "modal", order)
            family, found = fit_family(_modes_of(start), times, nodes, targets, degree, evaluations)
            families.append(family)
            amplitudes.append(found)
            integrals.append([_integral(target) for target in targets])
    return ScheduledModel(
        nodes=nodes,
        families=tuple(families),
        amplitudes=tuple(amplitudes),
        direct=np.array([one.initial for one in known]),
        static=np.array([one.final for one in known]),
        integral=np.moveaxis(np.array(integrals), 0, -1),
        baselines=np.array([one.baseline for one in known]),
        inputs=first.inputs,
        outputs=first.outputs,
        condition=first.condition,
        reference=first.reference,
        refused={name: reason for one in known for name, reason in one.without_limit().items()},
    )


def leave_one_out(
    points: Sequence[StepResponses], order: int = 4, *, degree: int = 1, evaluations: int = _EVALUATIONS
) -> tuple[LeftOut, ...]:
    """Each Mach number but the first and last in turn left out of the schedule, and predicted by it."""
    return _left_out([_Point.of(one) for one in points], order, degree, evaluations)


def _left_out(points: Sequence[_Point], order: int, degree: int, evaluations: int) -> tuple[LeftOut, ...]:
    machs = sorted({one.data.condition.mach for one in points})
    results = []
    for mach in machs[1:-1]:
        others = [one for one in points if one.data.condition.mach != mach]
        model = _scheduled(others, order, degree, evaluations)
        errors: dict[tuple[str, str], float] = {}
        for one in (one.data for one in points if one.data.condition.mach == mach):
            here = model.at(mach, one.condition.alpha)
            for response in one.responses:
                found = here.step(response.s)[response.input].values
                peak = np.max(np.abs(response.values), axis=0)
                off = np.max(np.abs(found - response.values), axis=0) / np.maximum(peak, 1e-300)
                for i, output in enumerate(one.outputs):
                    channel = (output, response.input)
                    errors[channel] = max(errors.get(channel, 0.0), float(off[i]))
        results.append(LeftOut(mach, errors))
    return tuple(results)


def best_schedule(
    points: Sequence[StepResponses],
    orders: Sequence[int] = (2, 3, 4, 6),
    degrees: Sequence[int] = (0, 1),
    *,
    tolerance: float = 2e-3,
) -> tuple[ScheduledModel, tuple[LeftOut, ...]]:
    """The schedule of fewest states within a quarter of the least error at Mach numbers left out, or below `tolerance`.

    With it come those errors.

    Raises
    ------
    InputError
        If there are fewer than three Mach numbers, so that none can be left out.
    """
    if len({one.condition.mach for one in points}) < 3:
        raise InputError("no Mach number can be left out of fewer than three: choose order and degree yourself")
    prepared = [_Point.of(one) for one in points]
    tried: list[tuple[float, int, int, tuple[LeftOut, ...]]] = []
    reason = ""
    for order in orders:
        for degree in degrees:
            try:
                found = _left_out(prepared, order, degree, _EVALUATIONS)
            except InputError as error:
                reason = str(error)
                continue
            tried.append((max(one.worst for one in found), order, degree, found))
    if not tried:
        raise InputError(reason)
    enough = max(_ENOUGH * min(one[0] for one in tried), tolerance)
    _, order, degree, errors = min((one for one in tried if one[0] <= enough), key=lambda one: (one[1], one[0]))
    return _scheduled(prepared, order, degree, _EVALUATIONS), errors


def _modes_of(model: StateSpaceModel) -> Modes:
    real = -model.poles.real[model.poles.imag == 0.0]
    upper = model.poles[model.poles.imag > 0.0]
    return Modes(np.sort(real), np.stack([-upper.real, upper.imag], axis=1))


def _integral(target: TimeTarget) -> Array:
    """Of the deficiency functions, shape (n_outputs,)."""
    if target.integral is None:
        raise InputError("a schedule imposes the integrals of the deficiency functions, one is missing")
    return target.integral
