r"""State-space models from histories of general motions: multisines, chirps, noise, recorded flights.

1. `okid`: Markov parameters, from an observer's coefficients.
2. `era`: from these the poles and C of a system of a given order. Growing modes are reflected, so that all decay.
3. `modal_system`: B and D of least output error for these, then poles, B, C and D together.

The order is the one that predicts best what it has not seen: the last part of every history is held out.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from threadpoolctl import threadpool_limits

from indicial.conventions import COEFFICIENTS, Array
from indicial.errors import InputError
from indicial.history import History
from indicial.rom.era import Sampled, era, stable_modes
from indicial.rom.excitation import undetermined_shares
from indicial.rom.modal_system import ModalSystem, Record, fit_inputs, fit_rank_one, refine
from indicial.rom.modes import Modes
from indicial.rom.okid import observer_markov, system_markov
from indicial.rom.signals import INPUTS, MotionInputs, check_names
from indicial.rom.state_space import Candidate, ChannelError, StateSpaceModel

METHOD = "okid + era"

_LOG = logging.getLogger(__name__)

_HELD_OUT = 0.3
_POOR = 0.3
"""Held-out error, or uncertainty of what each input causes, relative to the loads, from which a warning is logged."""
_ENOUGH = 1.05
"""Held-out error relative to the least, up to which fewer states are taken."""
_RACE = 8
"""Evaluations after which orders are compared; the chosen one is refined to the end."""
_UNEVEN = 1e-6
_FEWEST_SAMPLES = 40
_THINNED = (1, 2, 4, 8)
_CUTOFFS = (1e-11, 1e-4)
_SLOWEST = 5.0  # time constants in a record
_LONGEST_MEMORY, _MOST_MARKOV = 40, 200
_FASTEST = 5.0  # decays and turns between two samples that these can show


def identify(
    histories: Sequence[History],
    inputs: tuple[str, ...] = ("alpha", "q"),
    outputs: tuple[str, ...] = ("CN", "Cm"),
    order: int | None = None,
    *,
    max_order: int = 10,
    direct: Array | None = None,
    substeps: int = 8,
) -> StateSpaceModel:
    """State-space model of loads under general motions (OKID, ERA, and least output error).

    Parameters
    ----------
    histories : sequence of History
        At one condition, each with a uniform time step (the same for all) and from a steady state; together they must
        move every input, independently of the others.
    inputs, outputs : tuple of str
    order : int, optional
        Number of states; chosen by the error over the last 30% of each history, held out, if not given.
    max_order : int
        Most states that are tried.
    direct : ndarray, optional
        D where it is known, as the piston jump is: shape (n_outputs, n_inputs). If not given it is found too, which
        needs motions with frequencies beyond the fastest lag.
    substeps : int
        Linear pieces in which the motion is followed between samples, along local cubics; 1 takes it linear.

    Returns
    -------
    StateSpaceModel
        Stable whatever the data. Its `candidates` are for all inputs together; where even the best predicts badly what
        was held out, or the motions do not tell what each input causes, a warning is logged.

    Raises
    ------
    InputError
        If the histories differ in condition or time step, have an uneven one, or are too short.
    """
    check_names(inputs, INPUTS, "inputs to identify")
    check_names(outputs, COEFFICIENTS, "outputs to identify")
    if direct is not None and np.shape(direct) != (len(outputs), len(inputs)):
        raise InputError(f"direct has shape {np.shape(direct)}, must be {(len(outputs), len(inputs))}")
    if max_order < 1:
        raise InputError(f"max_order is {max_order}, must be at least 1")
    step = _time_step(histories)
    records = [record_of(history, inputs, outputs, substeps) for history in histories]
    for j, name in enumerate(inputs):
        if max(np.ptp(record.inputs.values[:, j]) for record in records) == 0.0:
            raise InputError(f"no history moves {name}")
    scale = load_sizes(records, outputs)
    with threadpool_limits(limits=1, user_api="blas"):
        systems, candidates = _tried(records, scale, step, order, max_order, direct)
        best = _fewest(candidates)
        everything = [replace(record, weights=np.ones_like(record.weights)) for record in records]
        chosen = refine(systems[best], everything, scale, free_direct=direct is None)
    if candidates[best].held_out > _POOR:
        error = candidates[best].held_out
        _LOG.warning("identified model: off by %.0f%% of the loads that were held out; do not trust it", 100.0 * error)
    _warn_of_inputs_alike(chosen, everything, scale, inputs, direct is None)
    return _model(chosen, histories, records, inputs, outputs, candidates, best)


def _warn_of_inputs_alike(
    chosen: ModalSystem, records: Sequence[Record], scale: Array, inputs: tuple[str, ...], free_direct: bool
) -> None:
    if len(inputs) == 1:
        return
    shares = undetermined_shares(chosen, records, scale, free_direct=free_direct)
    alike = [name for name, share in zip(inputs, shares, strict=True) if share > _POOR]
    if alike:
        _LOG.warning(
            "identified model of %d states: the motions do not tell %s apart; do not trust what it says of each "
            "(move them independently: motion.Multisine gives alpha and q frequencies of their own)",
            chosen.modes.order,
            " and ".join(alike) if len(alike) > 1 else f"{alike[0]} and the other inputs",
        )


def _time_step(histories: Sequence[History]) -> float:
    """Reduced time between samples."""
    if not histories:
        raise InputError("no histories given")
    first = histories[0]
    steps = np.concatenate([np.diff(history.s) for history in histories])
    for history in histories:
        if history.condition != first.condition or history.reference != first.reference:
            raise InputError("histories differ in flight condition or reference quantities")
        if history.s.size < _FEWEST_SAMPLES:
            raise InputError(f"a history has {history.s.size} samples, must have {_FEWEST_SAMPLES} or more")
    step = float(np.mean(steps))
    if np.ptp(steps) > _UNEVEN * step:
        raise InputError("histories have an uneven time step: an observer needs the same step throughout")
    return step


def record_of(history: History, inputs: tuple[str, ...], outputs: tuple[str, ...], substeps: int) -> Record:
    """What a history says of some outputs under some inputs, less the steady state that it starts from."""
    moved = MotionInputs.from_history(history, inputs, history.condition, substeps=substeps)
    columns = [COEFFICIENTS.index(name) for name in outputs]
    from_rest = MotionInputs(moved.s, moved.values - moved.before, np.zeros(len(inputs)), moved.stride)
    return Record(from_rest, (history.coefficients - history.before)[:, columns], np.ones(history.s.size))


def load_sizes(records: Sequence[Record], outputs: tuple[str, ...]) -> Array:
    """Root mean square of each load over the records, shape (n_outputs,).

    Raises
    ------
    InputError
        If one does not change.
    """
    sizes: Array = np.sqrt(np.mean(np.concatenate([record.loads for record in records]) ** 2, axis=0))
    if not np.all(sizes > 0.0):
        raise InputError(f"{outputs[int(np.argmin(sizes))]} does not change in the histories")
    return sizes


def _training(record: Record) -> Record:
    """The same record with the last part held out."""
    weights = record.weights.copy()
    weights[int((1.0 - _HELD_OUT) * weights.size) :] = 0.0
    return replace(record, weights=weights)


def _tried(
    records: list[Record], scale: Array, step: float, order: int | None, max_order: int, direct: Array | None
) -> tuple[list[ModalSystem], list[Candidate]]:
    """Systems fitted to the first part of the records, and their errors over the last."""
    training = [_training(record) for record in records]
    markov = _markov(training, scale, step, max_order if order is None else order)
    systems: list[ModalSystem] = []
    candidates: list[Candidate] = []
    for n in range(1, max_order + 1) if order is None else (order,):
        starts = _starts(markov, n, training, scale, direct)
        free = direct is None
        race = [refine(start, training, scale, free_direct=free, evaluations=_RACE) for start in starts]
        system = min(race, key=lambda one: _misfit(one, training, scale))
        systems.append(system)
        candidates.append(Candidate("", METHOD, system.modes.order, _held_out(system, records, training, scale)))
        errors = [candidate.held_out for candidate in candidates]
        if len(errors) > 4 and min(errors[-3:]) > 0.98 * min(errors[:-3]):
            break
    return systems, candidates


def _markov(training: list[Record], scale: Array, step: float, order: int) -> list[tuple[float, Array]]:
    """Time steps, and Markov parameters of the part to be fitted at these, outputs scaled.

    Slow motions sampled closely tell an observer little more than that loads are smooth: of these every other
    sample, every fourth, ... says more.
    """
    found = []
    for every in _THINNED:
        cut = [int(np.count_nonzero(record.weights)) for record in training]
        u = [r.inputs.values[:: r.inputs.stride][:n:every] for r, n in zip(training, cut, strict=True)]
        y = [r.loads[:n:every] / scale for r, n in zip(training, cut, strict=True)]
        m, p, count = u[0].shape[1], y[0].shape[1], sum(len(one) for one in y)
        # four samples for every coefficient at the least
        memory = min(_LONGEST_MEMORY, (count // 4 - m) // (m + p))
        if memory < max(2, order // p) and every > 1:
            break
        length = min(_MOST_MARKOV, max(count, 4 * order))
        for cutoff in _CUTOFFS:
            observer = observer_markov(u, y, max(2, memory), cutoff)
            found.append((every * step, system_markov(*observer, length)))
    return found


def _starts(
    markov: list[tuple[float, Array]], order: int, training: list[Record], scale: Array, direct: Array | None
) -> list[ModalSystem]:
    """Of the systems that ERA finds the two of least error, and one with real poles spread over the record."""
    found = []
    for step, parameters in markov:
        modes, c = _modal(era(parameters, order), step)
        if modes.order > 0:
            found.append(fit_inputs(modes, c * scale[:, None], training, scale, direct))
    found.sort(key=lambda one: _misfit(one, training, scale))
    longest = max(float(record.inputs.s[-1]) for record in training)
    spread = Modes(np.geomspace(_SLOWEST / longest, 1.0 / markov[0][0], order + 2)[1:-1], np.zeros((0, 2)))
    return [*found[:2], fit_rank_one(spread, training, scale, direct)]


def _errors(system: ModalSystem, record: Record, scale: Array) -> Array:
    """Error of every load, shape (n, n_outputs)."""
    wrong: Array = (system.respond(record.inputs) - record.loads) / scale
    return wrong


def _misfit(system: ModalSystem, training: list[Record], scale: Array) -> float:
    """Squared error over what is to be fitted."""
    return sum(float(np.sum(one.weights[:, None] * _errors(system, one, scale) ** 2)) for one in training)


def _modal(sampled: Sampled, step: float) -> tuple[Modes, Array]:
    """Stable modes of a sampled system, and C in their coordinates, shape (n_outputs, order)."""
    z, vectors = np.linalg.eig(sampled.a)
    real = np.abs(z.imag) < 1e-9
    resolved = (np.abs(z) > np.exp(-_FASTEST)) & ~(real & (z.real < 0.0))
    first = np.flatnonzero(resolved & (real | (z.imag > 0.0)))
    first = first[np.argsort(~real[first], kind="stable")]  # real modes, then pairs
    modes = stable_modes(np.asarray(z[resolved], dtype=np.complex128), step)
    columns = []
    for i in first:
        seen = sampled.c @ vectors[:, i]
        columns += [seen.real] if real[i] else [seen.real, seen.imag]
    return modes, np.array(columns).reshape(modes.order, len(sampled.c)).T


def _held_out(system: ModalSystem, records: list[Record], training: list[Record], scale: Array) -> float:
    """Root-mean-square error over what the fit has not seen, relative to the loads there."""
    error = size = 0.0
    for record, trained in zip(records, training, strict=True):
        unseen = trained.weights == 0.0
        error += float(np.sum(_errors(system, record, scale)[unseen] ** 2))
        size += float(np.sum((record.loads[unseen] / scale) ** 2))
    return float(np.sqrt(error / size)) if size > 0.0 else np.inf


def _fewest(candidates: list[Candidate]) -> int:
    """Which has the fewest states of those whose error is about the least."""
    enough = _ENOUGH * min(candidate.held_out for candidate in candidates)
    good = [i for i, candidate in enumerate(candidates) if candidate.held_out <= enough]
    return min(good, key=lambda i: (candidates[i].order, candidates[i].held_out))


def _model(
    system: ModalSystem,
    histories: Sequence[History],
    records: list[Record],
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    candidates: list[Candidate],
    best: int,
) -> StateSpaceModel:
    first, every = histories[0], ", ".join(inputs)
    model = StateSpaceModel(
        a=system.modes.matrix(),
        b=system.b,
        c=system.c,
        d=system.d,
        inputs=inputs,
        outputs=outputs,
        baseline=first.before,
        condition=first.condition,
        reference=first.reference,
        method=METHOD,
        candidates=tuple(replace(one, input=every, chosen=i == best) for i, one in enumerate(candidates)),
    )
    # the state before a motion is the condition's own, less what a deviation there was made of the loads
    before = [MotionInputs.from_history(h, inputs, h.condition, substeps=1).before for h in histories]
    baseline = np.mean([h.before for h in histories], axis=0)
    columns = [COEFFICIENTS.index(name) for name in outputs]
    baseline[columns] -= np.mean([model.static_gain @ u for u in before], axis=0)
    misfit = np.concatenate([system.respond(r.inputs) - r.loads for r in records])
    loads = np.concatenate([r.loads for r in records])
    rms = np.sqrt(np.mean(misfit**2, axis=0)) / np.sqrt(np.mean(loads**2, axis=0))
    peak = np.max(np.abs(misfit), axis=0) / np.max(np.abs(loads), axis=0)
    errors = tuple(ChannelError(o, every, float(rms[i]), float(peak[i])) for i, o in enumerate(outputs))
    return replace(model, baseline=baseline, errors=errors)
