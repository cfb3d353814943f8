r"""Reduced-order models straight from a linearised flow, without step responses.

Two-sided rational Krylov: the flow is solved forward and adjoint at k = 0 and at a few frequencies, each where the
error is estimated largest. Projected on all of these solutions it is matched there, with its slope; the fewest
balanced states that keep the error below the tolerance are the model. H(0) and H'(0), hence all derivatives at
k -> 0, are the flow's own, and so is D, the jump at 0+.

The projection's error is estimated from its residuals (`interpolation`), what truncation adds is known exactly. At
the end the flow is solved where it has not been, and the error there told.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.frequency import without_limit
from indicial.rom.interpolation import Interpolation, Unseen
from indicial.rom.model import ComplexArray
from indicial.rom.reduction import Reduced, impose
from indicial.rom.state_space import ChannelError, StateSpaceModel
from indicial.solver import LinearisedFlow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LOG = logging.getLogger(__name__)

_QUASI_STEADY = 1e-3  # of the peak: an unsteady part smaller than this counts as this
_TIGHTEST = 1e-7
_FEWEST_POINTS = 3

STATES_PER_INPUT = 2  # that keep H(0) and H'(0)
_BASIS_SHARE = 0.5  # of the tolerance; the rest is for truncation


@dataclass(frozen=True)
class OrderTrial:
    """One number of states that was tried.

    Parameters
    ----------
    order : int
    error : float
        Estimated largest error over the band.
    chosen : bool
    """

    order: int
    error: float
    chosen: bool = False


@dataclass(frozen=True)
class HeldOut:
    """A solution of the flow that the model has not seen.

    Parameters
    ----------
    k : float
    estimated, actual : float
        Error of the model there, largest over the channels, relative to each channel's peak.
    """

    k: float
    estimated: float
    actual: float


@dataclass(frozen=True)
class Projection:
    """A model projected from a linearised flow, and how good it is.

    Errors are relative to the largest ``|H|`` of their channel over the band (channels smaller than a thousandth of
    the largest are measured by that thousandth), and are the largest over the channels where they have none.

    Parameters
    ----------
    model : StateSpaceModel
    k_max : float
        The band is ``0 <= k <= k_max``.
    tolerance : float
        What the error was to stay below over the band.
    points : ndarray
        Reduced frequencies of the solutions that span the projection, in the order taken.
    k : ndarray
        Where the error is estimated, shape (n_k,).
    estimate : ndarray
        Estimated error, shape (n_k, n_outputs, n_inputs).
    held_out : tuple of HeldOut
        Validation.
    trials : tuple of OrderTrial
        Numbers of states tried on the final projection.
    hankel : ndarray
        Hankel singular values of the projection's stable part.
    discarded : ndarray
        Unstable poles that the projection had and the model leaves out; `estimate` counts what they did.
    forward_solves, adjoint_solves : int
        Solutions of the full flow, validation included.
    """

    model: StateSpaceModel
    k_max: float
    tolerance: float
    points: Array
    k: Array
    estimate: Array
    held_out: tuple[HeldOut, ...]
    trials: tuple[OrderTrial, ...]
    hankel: Array
    discarded: ComplexArray
    forward_solves: int
    adjoint_solves: int

    @property
    def estimated_error(self) -> float:
        """Largest estimated error over the band."""
        return float(np.max(self.estimate))

    @property
    def validated_error(self) -> float:
        """Largest error at the solutions held out."""
        return max(point.actual for point in self.held_out)

    @property
    def met(self) -> bool:
        """Whether both errors are below the tolerance."""
        return max(self.estimated_error, self.validated_error) <= self.tolerance

    def summary(self) -> str:
        """Band, errors, what was solved, and the numbers of states that were compared."""
        met = "met" if self.met else "NOT MET"
        solves = f"{self.forward_solves} forward and {self.adjoint_solves} adjoint solutions"
        lines = [
            f"projection at M {self.model.condition.mach:g}, 0 <= k <= {self.k_max:g}: {self.model.order} states, "
            f"{', '.join(self.model.inputs)} to {', '.join(self.model.outputs)}",
            f"  error at most {self.estimated_error:.2e} of the peak by estimate, {self.validated_error:.2e} at "
            f"{len(self.held_out)} solutions held out; tolerance {self.tolerance:.2e} {met}",
            f"  {solves}; projected at k = {', '.join(f'{point:.4g}' for point in np.sort(self.points))}",
        ]
        lines += [f"  held out k = {p.k:.4g}: error {p.actual:.2e}, estimated {p.estimated:.2e}" for p in self.held_out]
        lines += [
            f"  {trial.order} states: error {trial.error:.2e}{' <- chosen' if trial.chosen else ''}"
            for trial in self.trials
        ]
        if self.discarded.size:
            lines.append(f"  unstable poles left out: {', '.join(f'{pole:.3g}' for pole in self.discarded)}")
        return "\n".join(lines)

    def plot(self) -> Figure:
        """Estimated error of every channel over the band, with the solutions taken and those held out."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(figsize=(6.5, 4.0))
        for i, output in enumerate(self.model.outputs):
            for j, name in enumerate(self.model.inputs):
                axes.semilogy(self.k, self.estimate[:, i, j], lw=0.9, label=f"{output} to {name}, estimated")
        axes.plot([p.k for p in self.held_out], [p.actual for p in self.held_out], "ks", label="largest, held out")
        axes.axhline(self.tolerance, color="0.5", ls="--", label="tolerance")
        for point in self.points:
            axes.axvline(point, color="0.8", lw=0.6, zorder=0)
        axes.set_xlabel("reduced frequency k")
        axes.set_ylabel("error, relative to the channel's peak")
        axes.legend(fontsize="small")
        figure.tight_layout()
        return figure


def project(
    flow: LinearisedFlow,
    k_max: float,
    tolerance: float = 1e-3,
    order: int | None = None,
    *,
    max_order: int = 30,
    max_points: int = 12,
) -> Projection:
    """Model of a linearised flow over ``0 <= k <= k_max``.

    Parameters
    ----------
    flow : LinearisedFlow
    k_max : float
    tolerance : float
        Largest error over the band, relative to the peak of each channel, between 1e-7 and 1.
    order : int, optional
        Number of states; the fewest that meet the tolerance if not given.
    max_order : int
        Most states to choose from.
    max_points : int
        Most frequencies solved at for the projection, at least 3. Each costs as many forward solutions as there are
        inputs and as many adjoint ones as there are outputs; so does a real shift, and each of two frequencies held
        out costs the forward ones.

    Returns
    -------
    Projection
        The `errors` of its model are those estimated over the band. Where the tolerance cannot be met within `order`,
        `max_order` or `max_points`, it is the stable model of least error: then `Projection.met` is false and a
        warning is logged.

    Raises
    ------
    InputError
        If an argument is out of range, `order` or `max_order` is below two states per input, or `order` is above what
        the solutions span.
    DivergenceError
        If the flow cannot be solved, or no stable model meets its H(0) and H'(0).
    """
    fewest = STATES_PER_INPUT * len(flow.inputs)
    _check(k_max, tolerance, max_points, fewest, {"order": order, "max_order": max_order})
    basis = Interpolation(flow, k_max)
    while True:
        room = len(basis.points) < max_points and not basis.saturated
        if room and not (basis.calibrated and _settled(basis, tolerance, order)):
            basis.take(basis.look(basis.worst()))
            continue
        expected = basis.error()
        unseen = _look_elsewhere(basis)  # which may raise the estimate
        if not room or _settled(basis, tolerance, order):
            break
        for point in unseen[: max_points - len(basis.points)]:
            basis.take(point)
    projection = _result(basis, *_choose(basis, tolerance, order, max_order), unseen, expected, tolerance)
    if not projection.met:
        _LOG.warning("%s", projection.summary().splitlines()[1].strip())
    return projection


def _settled(basis: Interpolation, tolerance: float, order: int | None) -> bool:
    """Whether the projection, and its stable part, leave room for truncation within the tolerance."""
    lost = np.abs(basis.stable.model.transfer(basis.k) - basis.transfer)
    enough = order is None or order <= basis.stable.order
    return enough and _largest(basis, basis.error() + lost) <= _BASIS_SHARE * tolerance


def _choose(
    basis: Interpolation, tolerance: float, order: int | None, max_order: int
) -> tuple[Reduced, tuple[OrderTrial, ...]]:
    """The fewest states within the tolerance, else those of least error; and what was tried."""
    projected, most = basis.error(), basis.stable.order
    if order is not None and order > most:
        raise InputError(f"order is {order}, must be at most {most}: the solutions taken have no more states")
    least = min(STATES_PER_INPUT * len(basis.flow.inputs), most)
    models: list[Reduced] = []
    trials: list[OrderTrial] = []
    for n in range(least, min(max_order, most) + 1) if order is None else (order,):
        model = impose(basis.stable.truncate(n), basis.static, basis.rate)
        if model is None:
            continue
        truncated = np.abs(model.transfer(basis.k) - basis.transfer)
        models.append(model)
        trials.append(OrderTrial(n, _largest(basis, projected + truncated)))
        if trials[-1].error <= tolerance:
            break
    if not models:
        raise DivergenceError(f"projection: no model of {most} states or fewer meets the flow's H(0) and H'(0)")
    best = min(range(len(trials)), key=lambda i: trials[i].error)
    trials[best] = replace(trials[best], chosen=True)
    return models[best], tuple(trials)


def _look_elsewhere(basis: Interpolation) -> tuple[Unseen, ...]:
    """The flow where the estimate is largest and where the projection has been told least."""
    worst = basis.worst()
    return basis.look(worst), basis.look(basis.widest(np.array([worst])))


def _largest(basis: Interpolation, error: Array) -> float:
    return float(np.max(error / basis.scale))


def _result(
    basis: Interpolation,
    reduced: Reduced,
    trials: tuple[OrderTrial, ...],
    unseen: tuple[Unseen, ...],
    expected: Array,
    tolerance: float,
) -> Projection:
    flow = basis.flow
    truncated = np.abs(reduced.transfer(basis.k) - basis.transfer)
    before, estimate = (expected + truncated) / basis.scale, (basis.error() + truncated) / basis.scale
    model = StateSpaceModel(
        a=reduced.a,
        b=reduced.b,
        c=reduced.c,
        d=reduced.d,
        inputs=flow.inputs,
        outputs=flow.outputs,
        baseline=flow.baseline,
        condition=flow.condition,
        reference=flow.reference,
        method="projection",
        errors=_channel_errors(basis, reduced, estimate),
        refused=_refused(flow, basis.static),
    )
    held_out = []
    for point in unseen:
        actual = np.abs(reduced.transfer(np.array([point.k]))[0] - point.transfer) / basis.scale
        at = int(np.argmin(np.abs(basis.k - point.k)))
        held_out.append(HeldOut(point.k, float(np.max(before[at])), float(np.max(actual))))
    return Projection(
        model=model,
        k_max=float(basis.k[-1]),
        tolerance=tolerance,
        points=basis.points,
        k=basis.k,
        estimate=estimate,
        held_out=tuple(held_out),
        trials=trials,
        hankel=basis.stable.hankel,
        discarded=basis.discarded,
        forward_solves=basis.forward.solves,
        adjoint_solves=basis.adjoint.solves,
    )


def _refused(flow: LinearisedFlow, static: Array) -> dict[str, str]:
    """Derivatives that the flow has not, though every model has."""
    if "alpha" not in flow.inputs or "CN" not in flow.outputs:
        return {}
    slopes = dict(zip(flow.outputs, static[:, flow.inputs.index("alpha")].tolist(), strict=True))
    return without_limit(flow.condition, flow.plane, slopes)


def _channel_errors(basis: Interpolation, reduced: Reduced, estimate: Array) -> tuple[ChannelError, ...]:
    """Estimated errors over the band: root mean square relative to the unsteady part ``H - H(0)``, and the largest."""
    band = basis.k[-1]
    unsteady = np.sqrt(np.trapezoid(np.abs(basis.transfer - basis.static) ** 2, basis.k, axis=0) / band)
    rms = np.sqrt(np.trapezoid((estimate * basis.scale) ** 2, basis.k, axis=0) / band)
    rms = rms / np.maximum(unsteady, _QUASI_STEADY * basis.scale)
    peak = np.max(estimate, axis=0)
    return tuple(
        ChannelError(output, name, float(rms[i, j]), float(peak[i, j]))
        for j, name in enumerate(basis.flow.inputs)
        for i, output in enumerate(basis.flow.outputs)
    )


def _check(k_max: float, tolerance: float, max_points: int, fewest: int, orders: dict[str, int | None]) -> None:
    if not (np.isfinite(k_max) and k_max > 0.0):
        raise InputError(f"k_max is {k_max}, must be positive and finite")
    if not _TIGHTEST <= tolerance < 1.0:
        raise InputError(f"tolerance is {tolerance}, must be at least {_TIGHTEST:g} and below 1")
    if max_points < _FEWEST_POINTS:
        raise InputError(f"max_points is {max_points}, must be at least {_FEWEST_POINTS}")
    for name, value in orders.items():
        if value is not None and value < fewest:
            raise InputError(
                f"{name} is {value}, must be at least {fewest}: H(0) and H'(0) take {STATES_PER_INPUT} states per input"
            )
