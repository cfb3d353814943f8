r"""Systems of decaying modes fitted to loads under any motion: poles, B, C and D of least output error.

``dx/ds = Lambda x + B u``, ``y = C x + D u`` with Lambda in real blocks (`Modes.matrix`). For given poles and C the
loads are linear in B and D; all together are a small nonlinear least-squares problem, whose unknown poles are
logarithms of decay rates: every model on the way is stable, whatever the data.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from indicial.conventions import Array
from indicial.rom.modes import Modes
from indicial.rom.signals import MotionInputs
from indicial.rom.simulation import simulate

_STEP = 1e-6  # of the logarithms of rates: forward differences


@dataclass(frozen=True)
class Record:
    """Loads under a motion that starts from rest, to be fitted.

    Parameters
    ----------
    inputs : MotionInputs
        Less their values before the motion.
    loads : ndarray
        Less those before the motion, at every `inputs.stride`-th sample, shape (n, n_outputs).
    weights : ndarray
        Weight of each load sample, 0 for those held out, shape (n,).
    known_start : bool
        Whether the loads before the motion are exact; if not, `refine` finds a constant of each load too.
    """

    inputs: MotionInputs
    loads: Array
    weights: Array
    known_start: bool = True

    def less_level(self, values: Array) -> Array:
        """`values`, of shape (n, ...), less what a constant of each load takes up where the start is not known."""
        if self.known_start:
            return values
        rest: Array = values - np.average(values, axis=0, weights=self.weights)
        return rest


@dataclass(frozen=True)
class ModalSystem:
    """Modes with their input, output and direct matrices.

    Parameters
    ----------
    modes : Modes
    b, c, d : ndarray
        Shapes (order, n_inputs), (n_outputs, order), (n_outputs, n_inputs).
    """

    modes: Modes
    b: Array
    c: Array
    d: Array

    def respond(self, inputs: MotionInputs) -> Array:
        """Loads from rest, shape (n, n_outputs), at every stride-th sample."""
        states = np.einsum("mni,m->ni", _driven(self.modes, self.b, inputs), np.ones(self.b.shape[1]))
        loads: Array = states @ self.c.T + inputs.values[:: inputs.stride] @ self.d.T
        return loads

    def residues(self) -> Array:
        """Of real poles: C_i B_i, shape (n_outputs, order, n_inputs)."""
        values: Array = self.c[:, :, None] * self.b[None]
        return values

    def balanced(self) -> ModalSystem:
        """The same system with the columns of C of unit size."""
        size = np.linalg.norm(self.c, axis=0)
        n = self.modes.rates.size
        pairs = size[n:].reshape(-1, 2)
        size[n:] = np.repeat(np.linalg.norm(pairs, axis=1), 2)  # one number for a pair, or its block would change
        size = np.where(size > 0.0, size, 1.0)
        return replace(self, b=self.b * size[:, None], c=self.c / size)


def _driven(modes: Modes, b: Array, inputs: MotionInputs) -> Array:
    """States that each input alone drives through its column of b, shape (n_inputs, n, order)."""
    a, start = modes.matrix(), np.zeros(modes.order)
    every = inputs.stride
    return np.array([
        simulate(a, b[:, [j]], inputs.s, inputs.values[:, [j]], start)[::every] for j in range(b.shape[1])
    ])  # fmt: skip


def _unit(modes: Modes, n_inputs: int) -> Array:
    """The B that drives every real mode and the first state of every pair, shape (order, n_inputs)."""
    b = np.ones((modes.order, n_inputs))
    b[modes.rates.size + 1 :: 2] = 0.0
    return b


def _input_columns(modes: Modes, c: Array, states: Array) -> Array:
    """What the loads change with each entry of B, shape (n, n_outputs, n_inputs order), from `_driven` by `_unit`."""
    n = modes.rates.size
    # a pair driven through its second state answers as through its first, turned by a quarter: (-x2, x1)
    through = c[None, None, :, :] * states[:, :, None, :]
    x1, x2 = states[:, :, n::2], states[:, :, n + 1 :: 2]
    c1, c2 = c[:, n::2], c[:, n + 1 :: 2]
    through[..., n::2] = c1 * x1[:, :, None, :] + c2 * x2[:, :, None, :]
    through[..., n + 1 :: 2] = c2 * x1[:, :, None, :] - c1 * x2[:, :, None, :]
    return np.moveaxis(through, 0, 2).reshape(states.shape[1], len(c), -1)


def fit_inputs(modes: Modes, c: Array, records: Sequence[Record], scale: Array, direct: Array | None) -> ModalSystem:
    """B, and D if it is not given, of least error for given poles and C.

    Parameters
    ----------
    modes : Modes
    c : ndarray
        Shape (n_outputs, order).
    records : sequence of Record
    scale : ndarray
        What errors of each output are measured by, shape (n_outputs,).
    direct : ndarray, optional
        D where it is known, shape (n_outputs, n_inputs).
    """
    m, p = records[0].inputs.values.shape[1], len(c)
    rows, wanted = [], []
    for record in records:
        u = record.inputs.values[:: record.inputs.stride]
        columns = [_input_columns(modes, c, _driven(modes, _unit(modes, m), record.inputs))]
        loads = record.loads
        if direct is None:
            columns.append(np.einsum("nj,op->nopj", u, np.eye(p)).reshape(len(u), p, -1))
        else:
            loads = loads - u @ direct.T
        weight = np.sqrt(record.weights)[:, None] / scale
        weighted = np.concatenate(columns, axis=2) * weight[..., None]
        rows.append(weighted.reshape(-1, weighted.shape[2]))
        wanted.append((loads * weight).ravel())
    found = np.linalg.lstsq(np.vstack(rows), np.concatenate(wanted), rcond=1e-12)[0]
    b = found[: m * modes.order].reshape(m, modes.order).T
    d = direct if direct is not None else found[m * modes.order :].reshape(p, m)
    return ModalSystem(modes, b, c, d).balanced()


def fit_rank_one(modes: Modes, records: Sequence[Record], scale: Array, direct: Array | None) -> ModalSystem:
    """B and C, and D if it is not given, for real poles.

    With residues of their own for every channel all is linear; of each pole's residues the nearest matrix of rank one,
    which is what one state can have, gives its column of C.
    """
    p = records[0].loads.shape[1]
    columns = []
    for output in range(p):
        alone = [replace(record, loads=record.loads[:, [output]]) for record in records]
        known = None if direct is None else direct[[output]]
        columns.append(fit_inputs(modes, np.ones((1, modes.order)), alone, scale[[output]], known).residues())
    residues = np.concatenate(columns)
    c = np.zeros((p, modes.order))
    for i in range(modes.order):
        left, singular, _ = np.linalg.svd(residues[:, i] / scale[:, None])
        c[:, i] = scale * left[:, 0] if singular[0] > 0.0 else np.ones(p)
    return fit_inputs(modes, c, records, scale, direct)


@dataclass(frozen=True)
class Parameters:
    """Which entries of a vector are poles (logarithms), B, C and D."""

    like: ModalSystem
    free_direct: bool

    def pack(self, system: ModalSystem) -> Array:
        parts = [_logs(system.modes), system.b.ravel(), system.c.ravel()]
        return np.concatenate([*parts, system.d.ravel()] if self.free_direct else parts)

    def unpack(self, vector: Array) -> ModalSystem:
        n, (p, m) = self.like.modes.order, self.like.d.shape
        poles, b, c, d = np.split(vector, np.cumsum([n, n * m, p * n]))
        modes = _from_logs(self.like.modes, poles)
        direct = d.reshape(p, m) if self.free_direct else self.like.d
        return ModalSystem(modes, b.reshape(n, m), c.reshape(p, n), direct)


def _logs(modes: Modes) -> Array:
    return np.asarray(np.log(np.concatenate([modes.rates, modes.pairs.ravel()])))


def _from_logs(like: Modes, logs: Array) -> Modes:
    n = like.rates.size
    return Modes(np.exp(logs[:n]), np.exp(logs[n:]).reshape(-1, 2))


def refine(
    start: ModalSystem, records: Sequence[Record], scale: Array, *, free_direct: bool = True, evaluations: int = 30
) -> ModalSystem:
    """Poles, B, C and D of least output error near `start`.

    Parameters
    ----------
    start : ModalSystem
    records : sequence of Record
    scale : ndarray
        What errors of each output are measured by, shape (n_outputs,).
    free_direct : bool
        Whether D is found too.
    evaluations : int
        Most evaluations of the misfit.
    """
    which = Parameters(start, free_direct)

    def misfit(vector: Array) -> Array:
        system = which.unpack(vector)
        return np.concatenate([_misfit(system, record, scale) for record in records])

    def jacobian(vector: Array) -> Array:
        system = which.unpack(vector)
        return np.vstack(
            [load_slopes(system, record, scale, free_direct=free_direct).reshape(-1, vector.size) for record in records]
        )

    found = least_squares(misfit, which.pack(start), jacobian, xtol=1e-9, ftol=1e-9, gtol=1e-14, max_nfev=evaluations)
    best = which.unpack(found.x)
    return best.balanced()


def _misfit(system: ModalSystem, record: Record, scale: Array) -> Array:
    weight = np.sqrt(record.weights)[:, None] / scale
    return np.asarray((record.less_level(system.respond(record.inputs) - record.loads) * weight).ravel())


def load_slopes(system: ModalSystem, record: Record, scale: Array, *, free_direct: bool) -> Array:
    """Changes of the weighted loads with each of the `Parameters`, shape (n, n_outputs, n_parameters)."""
    modes, (p, m) = system.modes, system.d.shape
    u = record.inputs.values[:: record.inputs.stride]
    states = _driven(modes, system.b, record.inputs).sum(axis=0)
    logs = _logs(modes)
    poles = []
    for change in _STEP * np.eye(modes.order):
        moved = _driven(_from_logs(modes, logs + change), system.b, record.inputs).sum(axis=0)
        poles.append((moved - states) @ system.c.T / _STEP)
    through = _input_columns(modes, system.c, _driven(modes, _unit(modes, m), record.inputs))
    # the columns run over inputs, then states; B is stored the other way round
    by_b = through.reshape(len(u), p, m, modes.order).transpose(0, 1, 3, 2).reshape(len(u), p, -1)
    by_c = np.einsum("ni,op->nopi", states, np.eye(p)).reshape(len(u), p, -1)
    columns = [np.stack(poles, axis=2), by_b, by_c]
    if free_direct:
        columns.append(np.einsum("nj,op->nopj", u, np.eye(p)).reshape(len(u), p, -1))
    weight = np.sqrt(record.weights)[:, None] / scale
    weighted: Array = record.less_level(np.concatenate(columns, axis=2)) * weight[..., None]
    return weighted
