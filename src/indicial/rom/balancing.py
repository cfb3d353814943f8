r"""Fewer states for a model that has them, by balanced truncation.

A state counts by what inputs excite of it and what loads show of it: the Hankel singular values. Two ways:

- of all frequencies alike: the square-root method. D is kept, the model stays stable, and the error of H, inputs and
  outputs scaled, is at no frequency more than twice the sum of the singular values left out (Enns, 1984; Glover,
  Int. J. Control 39, 1984);
- of motions up to a reduced frequency: the states these excite most, in the energy that the loads still have
  to see. D, H(0) and H'(0), so all derivatives at k -> 0, are kept exactly, and the model stays stable (`reduction`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.rom.projection import STATES_PER_INPUT, OrderTrial
from indicial.rom.reduction import Reduced, gramian_factor, impose, nest
from indicial.rom.state_space import StateSpaceModel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

METHOD = "balanced truncation"

_LOG = logging.getLogger(__name__)

_Cut = Callable[[int], Reduced | None]

_FREQUENCIES = 300
_DECADES = 2.0  # beyond the slowest and the fastest pole
_RESOLVED = 2e-8
"""Hankel singular values below this, of the largest, are round-off: it enters the factors of Gramians as its root."""


@dataclass(frozen=True)
class Truncation:
    """A model cut down, and what that cost.

    Parameters
    ----------
    model : StateSpaceModel
    hankel : ndarray
        Hankel singular values of the full model, inputs and outputs scaled, shape (n,).
    error : float
        Largest error of H over the band, or over all frequencies, relative to the size of its output and input.
    bound : float or None
        What no channel's error can exceed at any frequency; None for a band.
    trials : tuple of OrderTrial
        Numbers of states tried.
    """

    model: StateSpaceModel
    hankel: Array
    error: float
    bound: float | None
    trials: tuple[OrderTrial, ...]

    def summary(self) -> str:
        """States kept, error, and what was tried."""
        bound = "" if self.bound is None else f", {self.bound:.2e} at most"
        lines = [
            f"balanced truncation: {self.model.order} of {self.hankel.size} states, "
            f"error of H {self.error:.2e} of its size{bound}"
        ]
        lines += [
            f"  {trial.order} states: error {trial.error:.2e}{' <- chosen' if trial.chosen else ''}"
            for trial in self.trials
        ]
        return "\n".join(lines)

    def plot(self) -> Figure:
        """Hankel singular values, those kept apart from those left out."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(figsize=(6.0, 3.6), layout="constrained")
        index = np.arange(1, self.hankel.size + 1)
        kept = index <= self.model.order
        axes.semilogy(index[kept], self.hankel[kept], "o", label=f"{self.model.order} states kept")
        axes.semilogy(index[~kept], self.hankel[~kept], "o", color="0.6", fillstyle="none", label="left out")
        axes.set_xlabel("state")
        axes.set_ylabel("Hankel singular value")
        axes.legend()
        return figure


def truncate(
    model: StateSpaceModel,
    order: int | None = None,
    *,
    k_max: float | None = None,
    tolerance: float = 1e-3,
) -> Truncation:
    """A model of fewer states.

    Parameters
    ----------
    model : StateSpaceModel
    order : int, optional
        Number of states; the fewest within `tolerance` if not given.
    k_max : float, optional
        Highest reduced frequency that matters; all do if not given.
    tolerance : float
        Largest error of H over these frequencies, relative to the size of its output and input. Where
        every order is tried and none that was meets it, a warning is logged.

    Raises
    ------
    InputError
        If the model has no states, `tolerance` is no number, or `order` is out of range; with `k_max` two states
        per input are the fewest.
    """
    if model.order == 0:
        raise InputError("the model has no states, there is nothing to leave out")
    if k_max is not None and not (np.isfinite(k_max) and k_max > 0.0):
        raise InputError(f"k_max is {k_max}, must be positive and finite")
    if not tolerance >= 0.0:
        raise InputError(f"tolerance is {tolerance}, must be 0 or more")
    full = Reduced(model.a, model.b, model.c, model.d)
    k = _band(model, k_max)
    transfer = full.transfer(k)
    scale = _scale(np.max(np.abs(transfer), axis=0))
    least = 1 if k_max is None else min(STATES_PER_INPUT * len(model.inputs), model.order)
    if order is not None and not least <= order <= model.order:
        raise InputError(f"order is {order}, must be from {least} to {model.order} for this model")
    cut, hankel = _balanced(full, scale) if k_max is None else _nested(full, scale, k_max, model)
    trials: list[OrderTrial] = []
    reduced: Reduced | None = None
    for n in range(least, model.order + 1) if order is None else (order,):
        reduced = cut(n)
        if reduced is None:
            continue
        trials.append(OrderTrial(n, float(np.max(np.abs(reduced.transfer(k) - transfer) / scale))))
        if trials[-1].error <= tolerance:
            break
    if reduced is None:
        raise InputError(f"no model of {order or model.order} states keeps H(0) and H'(0); ask for more states")
    if order is None and trials[-1].error > tolerance:
        _LOG.warning(
            "truncated model: no order meets the tolerance %.2g, the error of H is %.2g with %d states",
            tolerance, trials[-1].error, trials[-1].order,
        )  # fmt: skip
    trials[-1] = replace(trials[-1], chosen=True)
    small = replace(
        model, a=reduced.a, b=reduced.b, c=reduced.c, d=reduced.d, method=f"{model.method}, {METHOD}", errors=()
    )
    known = np.maximum(hankel, _RESOLVED * np.max(hankel))
    bound = float(2.0 * np.sum(known[reduced.order :])) if k_max is None else None
    return Truncation(small, hankel, trials[-1].error, bound, tuple(trials))


def hankel_values(model: StateSpaceModel) -> Array:
    """Hankel singular values, each channel scaled by its peak, shape (n,)."""
    full = Reduced(model.a, model.b, model.c, model.d)
    return _balanced(full, _scale(np.max(np.abs(full.transfer(_band(model, None))), axis=0)))[1]


def _band(model: StateSpaceModel, k_max: float | None) -> Array:
    """Frequencies at which the error is looked at, 0 among them, shape (n_k,)."""
    if k_max is not None:
        return np.append(0.0, np.geomspace(1e-3 * k_max, k_max, _FREQUENCIES))
    size = np.abs(model.poles)
    return np.append(0.0, np.geomspace(10.0**-_DECADES * np.min(size), 10.0**_DECADES * np.max(size), _FREQUENCIES))


def _scale(peak: Array) -> Array:
    """Size of each channel as a product of an output's and an input's, so that one scaling serves all channels."""
    return np.asarray(np.outer(*_sizes(peak)))


def _sizes(peak: Array) -> tuple[Array, Array]:
    """Sizes of the outputs and of the inputs."""
    outputs = np.maximum(np.max(peak, axis=1), 1e-300)
    inputs = np.maximum(np.max(peak / outputs[:, None], axis=0), 1e-300)
    return outputs, inputs


def _balanced(full: Reduced, scale: Array) -> tuple[_Cut, Array]:
    """Square-root balanced truncation (Laub, Heath, Paige and Ward, IEEE Trans. Automatic Control 32, 1987)."""
    outputs, inputs = _sizes(scale)
    excited = gramian_factor(full.a, full.b / inputs)
    seen = gramian_factor(full.a.T, (full.c / outputs[:, None]).T)
    left, hankel, right = np.linalg.svd(seen.T @ excited)
    resolved = int(np.count_nonzero(hankel > _RESOLVED * np.max(hankel)))

    def cut(order: int) -> Reduced | None:
        if order == full.order:
            return full
        kept = min(order, resolved)
        root = np.sqrt(hankel[:kept])
        return full.within(seen @ left[:, :kept] / root, excited @ right[:kept].T / root)

    return cut, np.asarray(hankel)


def _nested(full: Reduced, scale: Array, k_max: float, model: StateSpaceModel) -> tuple[_Cut, Array]:
    """Cut in the coordinates of `nest`, with H(0) and H'(0) imposed."""
    nested = nest(full, k_max, scale)

    def cut(order: int) -> Reduced | None:
        return impose(nested.truncate(min(order, nested.order)), model.static_gain, model.rate_gain)

    return cut, nested.hankel
