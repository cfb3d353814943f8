r"""How well histories determine a model: covariance of its parameters, of derivatives, and bands on predicted loads.

A model is refined to least output error over the histories. With J the changes of the weighted loads with the
parameters (poles, B, C, D) and e the residuals, the parameters' covariance is

    M^{-1} [ sum over lags l of R(l) sum over i of J_i^T J_{i+l} ] M^{-1},      M = J^T J,

R the autocovariance of each output's residuals (Morelli and Klein, J. Aircraft 34 (1997) 83), from an autoregressive
model of them: for white residuals it is ``M^{-1} sigma^2``, for coloured ones, as models that are not quite right leave
them, much more. The scale of each state is free, so M has no inverse but a pseudo-inverse: what can be seen, loads
and derivatives, does not depend on it. All is to first order.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import NormalDist
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import solve_toeplitz

from indicial.conventions import Array
from indicial.derivatives import DerivativeTable
from indicial.errors import InputError
from indicial.history import History
from indicial.motion import Motion
from indicial.rom.identification import load_sizes, record_of
from indicial.rom.modal import ModalForm
from indicial.rom.modal_system import ModalSystem, Parameters, load_slopes, refine
from indicial.rom.modes import Modes
from indicial.rom.signals import MotionInputs
from indicial.rom.state_space import StateSpaceModel

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST_LAGS, _DIED_OUT = 12, 1e-3
_RANK = 1e-10
_UNSEEN = 1e-3
"""Part of a change that lies where the histories say nothing, from which an uncertainty is infinite."""
_DIFFERENCE = 1e-5


@dataclass(frozen=True)
class PredictedBand:
    """Loads under a motion with what the model's uncertainty makes of them.

    Parameters
    ----------
    history : History
        The prediction.
    outputs : tuple of str
    deviation : ndarray
        Standard deviation of each load, shape (n, n_outputs); noise of a measurement is not in it.
    """

    history: History
    outputs: tuple[str, ...]
    deviation: Array

    def limits(self, output: str, level: float = 0.95) -> tuple[Array, Array]:
        """Lower and upper limit of the interval that holds the load with probability `level`, each shape (n,)."""
        if not 0.0 < level < 1.0:
            raise InputError(f"level is {level}, must lie between 0 and 1")
        if output not in self.outputs:
            raise InputError(f"no output {output!r}; there are {', '.join(self.outputs)}")
        half = NormalDist().inv_cdf(0.5 + 0.5 * level) * self.deviation[:, self.outputs.index(output)]
        return self.history[output] - half, self.history[output] + half

    def summary(self) -> str:
        """One line for each load: the widest half of its 95% band."""
        lines = [f"prediction with 95% bands, {self.history.s.size} samples"]
        for output in self.outputs:
            low, high = self.limits(output)
            lines.append(
                f"  {output}: +-{np.max(high - low) / 2.0:.3g} at most, {np.ptp(self.history[output]):.3g} range"
            )
        return "\n".join(lines)

    def plot(self) -> Figure:
        """Every load against reduced time, in its 95% band."""
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(len(self.outputs), 1, squeeze=False, sharex=True, layout="constrained")
        for ax, output in zip(axes[:, 0], self.outputs, strict=True):
            ax.fill_between(self.history.s, *self.limits(output), alpha=0.3, label="95%")
            ax.plot(self.history.s, self.history[output])
            ax.set_ylabel(output)
        axes[0, 0].legend()
        axes[-1, 0].set_xlabel("reduced time s = 2Vt/c")
        return figure


@dataclass(frozen=True)
class UncertainModel:
    """A model of least output error, and how well the histories determine it.

    Parameters
    ----------
    model : StateSpaceModel
    covariance : ndarray
        Of poles (logarithms), B, C and, unless it was given, D, in modal form; shape (n_parameters, n_parameters).
    noise : ndarray
        Standard deviation of the residuals of each output, shape (n_outputs,).
    """

    model: StateSpaceModel
    covariance: Array
    noise: Array
    _system: ModalSystem
    _free_direct: bool
    _unseen: Array  # directions of the parameters that the histories say nothing of, shape (n_parameters, n_unseen)

    def derivatives(self) -> DerivativeTable:
        """Derivatives at k -> 0 with their standard deviations as uncertainty; infinite for what no history tells."""
        table = self.model.derivatives()

        def values(model: StateSpaceModel) -> Array:
            return np.array([record.value for record in model.derivatives()])

        deviation = self._deviation(lambda system: values(_as_model(self.model, system)))
        records = zip(table.records, deviation, strict=True)
        return DerivativeTable(tuple(replace(record, uncertainty=float(one)) for record, one in records))

    def frequency_deviation(self, k: ArrayLike) -> Array:
        """Standard deviation of ``|H(ik)|``'s real and imaginary parts, shape (2, n_k, n_outputs, n_inputs)."""
        ks = np.atleast_1d(np.asarray(k, dtype=float))

        def parts(system: ModalSystem) -> Array:
            h = _as_model(self.model, system).frequency_response(ks)
            return np.stack([h.real, h.imag])

        return self._deviation(parts)

    def predict(self, motion: History | Motion, times: ArrayLike | None = None) -> PredictedBand:
        """Loads under a motion, or under that of a history, with their standard deviations."""
        history = self.model.predict(motion, times)
        # the same linear pieces for the loads and for what they change with
        condition = self.model.condition
        inputs = MotionInputs.from_history(history, self.model.inputs, condition)

        def loads(system: ModalSystem) -> Array:
            return _as_model(self.model, system).respond(inputs)

        return PredictedBand(history, self.model.outputs, self._deviation(loads))

    def summary(self) -> str:
        """The derivatives with their standard deviations."""
        lines = [f"{self.model.order} states, {', '.join(self.model.inputs)} to {', '.join(self.model.outputs)}"]
        lines += [f"  {record.name} = {record.value:.5g} +- {record.uncertainty:.2g}" for record in self.derivatives()]
        noise = ", ".join(f"{o} {one:.3g}" for o, one in zip(self.model.outputs, self.noise, strict=True))
        return "\n".join([*lines, f"  residuals: {noise} (standard deviation)"])

    def _deviation(self, what: Callable[[ModalSystem], Array]) -> Array:
        """Standard deviation of anything that the parameters determine, by central differences."""
        which = Parameters(self._system, self._free_direct)
        at = which.pack(self._system)
        size = _DIFFERENCE * np.maximum(np.abs(at), 1e-3 * np.max(np.abs(at)))
        changes = []
        for j, step in enumerate(size):
            change = np.zeros_like(at)
            change[j] = step
            changes.append((what(which.unpack(at + change)) - what(which.unpack(at - change))) / (2.0 * step))
        slopes = np.stack(changes, axis=-1)
        variance = np.einsum("...i,ij,...j->...", slopes, self.covariance, slopes)
        deviation = np.sqrt(np.maximum(variance, 0.0))
        # what the histories say nothing of can be anything; the scale of a state changes nothing that can be seen
        moved = np.linalg.norm(slopes @ self._unseen, axis=-1)
        size = np.linalg.norm(slopes, axis=-1) * np.linalg.norm(self._unseen, axis=0).max(initial=0.0)
        return np.where(moved > _UNSEEN * np.max(size), np.inf, deviation)


def refine_model(
    model: StateSpaceModel,
    histories: Sequence[History],
    *,
    known_direct: bool = False,
    known_start: bool = True,
    white: bool = False,
    substeps: int = 8,
) -> UncertainModel:
    """The model of the same number of states with least output error over histories, and its uncertainty.

    Parameters
    ----------
    model : StateSpaceModel
        Where to start from: one that was realised or identified.
    histories : sequence of History
        At the model's condition, each from a steady state and, unless `white`, with an even time step.
    known_direct : bool
        Keep D as it is.
    known_start : bool
        The loads before the motion are exact, as those of a solver are. Where they are one more noisy sample of a
        measurement, say False: a constant of each load is found too. Else their error is taken for the model's, and the
        intervals do not tell.
    white : bool
        Take the residuals as independent of each other, which makes intervals too narrow where they are not.
    substeps : int
        Linear pieces in which the motion is followed between samples; 1 takes it linear.

    Raises
    ------
    InputError
        If the model has no modal form, or the histories are too short to determine it.
    """
    if not histories:
        raise InputError("no histories given")
    for history in histories:
        if history.condition != model.condition or history.reference != model.reference:
            raise InputError("histories and model differ in flight condition or reference quantities")
        if not white and np.ptp(np.diff(history.s)) > 1e-6 * float(np.max(np.diff(history.s))):
            raise InputError("a history has an uneven time step: its residuals can only be taken as white")
    records = [
        replace(record_of(history, model.inputs, model.outputs, substeps), known_start=known_start)
        for history in histories
    ]
    scale = load_sizes(records, model.outputs)
    system = refine(_as_system(model), records, scale, free_direct=not known_direct, evaluations=60)
    slopes = [load_slopes(system, record, scale, free_direct=not known_direct) for record in records]
    residuals = [record.less_level(system.respond(record.inputs) - record.loads) / scale for record in records]
    constants = 0 if known_start else len(records) * len(model.outputs)
    covariance, noise, unseen = _covariance(slopes, residuals, constants, white)
    return UncertainModel(_as_model(model, system), covariance, noise * scale, system, not known_direct, unseen)


def _covariance(
    slopes: Sequence[Array], residuals: Sequence[Array], constants: int, white: bool
) -> tuple[Array, Array, Array]:
    """Covariance of the parameters, standard deviations of the residuals, and directions of which nothing is known.

    Parameters
    ----------
    slopes : sequence of ndarray
        Changes of each record's loads with the parameters, shape (n, n_outputs, n_parameters).
    residuals : sequence of ndarray
        Shape (n, n_outputs).
    constants : int
        What else was found from them: levels of the loads.
    white : bool
        Whether lag 0 alone counts.
    """
    rows = np.concatenate([one.reshape(-1, one.shape[2]) for one in slopes])
    size = np.maximum(np.linalg.norm(rows, axis=0), 1e-300)
    values, vectors = np.linalg.eigh((rows / size).T @ (rows / size))
    kept = values > _RANK * values[-1]
    rank = int(np.count_nonzero(kept)) + constants
    if len(rows) <= rank:
        raise InputError(f"{len(rows)} loads cannot tell {rank} parameters and their uncertainty")
    inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T / size / size[:, None]
    freedom = len(rows) / (len(rows) - rank)
    middle = np.zeros_like(inverse)
    noise = np.zeros(residuals[0].shape[1])
    for output in range(noise.size):
        known = autocovariance([e[:, output] for e in residuals])
        correlation = freedom * (known[:1] if white else known)
        noise[output] = np.sqrt(correlation[0])
        for lag, one in enumerate(correlation):
            products = sum(j[: max(len(j) - lag, 0), output].T @ j[lag:, output] for j in slopes)
            middle += one * (products if lag == 0 else products + np.transpose(products))
    floored = np.maximum(size, 1e-6 * np.max(size))
    return np.asarray(inverse @ middle @ inverse), noise, vectors[:, ~kept] / floored[:, None]


def autocovariance(residuals: Sequence[Array]) -> Array:
    """Autocovariance of residuals from lag 0 on, of an autoregressive process whose order Schwarz's criterion picks.

    Parameters
    ----------
    residuals : sequence of ndarray
        Of one output in each record, evenly spaced, shape (n,).

    Returns
    -------
    ndarray
        Up to where it has died out; lag 0 alone for white residuals.
    """
    count = sum(e.size for e in residuals)
    shortest = min(e.size for e in residuals)
    most = min(_MOST_LAGS, shortest // 10)
    sampled = np.array([sum(float(e[: e.size - lag] @ e[lag:]) for e in residuals) for lag in range(most + 1)]) / count
    if sampled[0] == 0.0:
        return np.zeros(1)
    best, least = np.zeros(0), count * np.log(sampled[0])
    for order in range(1, most + 1):
        weights = solve_toeplitz(sampled[:order], sampled[1 : order + 1])
        criterion = count * np.log(max(sampled[0] - weights @ sampled[1 : order + 1], 1e-300)) + np.log(count) * order
        if criterion < least:
            best, least = weights, criterion
    values = list(sampled[: best.size + 1])
    while best.size and len(values) < shortest and max(np.abs(values[-best.size :])) > _DIED_OUT * values[0]:
        values.append(float(best @ values[: -best.size - 1 : -1]))
    return np.array(values)


def _as_system(model: StateSpaceModel) -> ModalSystem:
    """The model in real modal form."""
    form = ModalForm.of(model.a, model.b, model.c, model.d)
    if form is None:
        raise InputError("the model has poles too close to each other for a modal form; take fewer states")
    n = form.real
    modes = Modes(-form.poles[:n].real, np.stack([-form.poles[n:].real, form.poles[n:].imag], axis=1))
    b, c = [form.b[:n].real], [form.c[:, :n].real]
    for i in range(n, form.poles.size):
        b.append(np.stack([form.b[i].real, -form.b[i].imag]))
        c.append(np.stack([form.c[:, i].real, form.c[:, i].imag], axis=1))
    return ModalSystem(modes, np.vstack(b), np.hstack(c), form.d).balanced()


def _as_model(like: StateSpaceModel, system: ModalSystem) -> StateSpaceModel:
    return replace(like, a=system.modes.matrix(), b=system.b, c=system.c, d=system.d, errors=())
