r"""State-space models from step responses or frequency responses.

Each input gets modes of its own, shared by all outputs (`mode_fitting`), or one set of poles serves all inputs. However
the poles are found, the model keeps

- the value at 0+ as direct feedthrough D (the piston jump),
- the final value as static gain, and
- the integral of the deficiency function, hence the alphadot derivative of Eq. (17),

exactly as the data give them, and it is stable by construction. Ways to the poles:

``exponential``
    real poles by variable projection: the classical sum of exponentials;
``era``
    real and complex poles of a step response by the eigensystem realisation algorithm;
``vector fitting``
    real and complex poles of a frequency response;
``modal``
    the latter two refined by variable projection. Complex pairs stand for delays: fins see the body's wave late, and
    a supersonic response settles in finite time.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy.linalg import block_diag
from threadpoolctl import threadpool_limits

from indicial.conventions import COEFFICIENTS, Array
from indicial.errors import InputError
from indicial.frequency import FrequencyResponse, without_limit
from indicial.rom.era import era_modes
from indicial.rom.mode_fitting import Target, clipped, fit_amplitudes, joint_error, refine
from indicial.rom.modes import Modes
from indicial.rom.response import StepResponses
from indicial.rom.signals import INPUTS, check_names, quadrature_weights
from indicial.rom.sources import FrequencySource, Part, Source, StepSource
from indicial.rom.state_space import Candidate, ChannelError, StateSpaceModel
from indicial.rom.vector_fitting import vector_fit

Method = Literal["auto", "exponential", "era", "vector fitting", "modal"]
METHODS = ("exponential", "era", "vector fitting", "modal")

Poles = Literal["separate", "shared"]

_LOG = logging.getLogger(__name__)

_WORST_CANCELLATION = 1e4  # amplitudes may exceed the deficiency function by this, no more
_RACE = 15  # evaluations after which the two best starts are chosen
_FEWEST_SAMPLES = 6
_MOST_POLES = 30  # for each input; the case file allows as many
_DIRECT = ("era", "vector fitting")  # whose poles are taken as they are


@dataclass(frozen=True)
class _Trial:
    modes: Modes
    candidate: Candidate


def realise(
    data: StepResponses | FrequencyResponse,
    method: Method = "auto",
    order: int | None = None,
    *,
    poles: Poles = "separate",
    outputs: tuple[str, ...] | None = None,
    max_order: int = 6,
    tolerance: float = 2e-3,
    match_integral: bool = True,
) -> StateSpaceModel:
    """State-space model of step responses or of a frequency response.

    Orders are compared by their error at every second sample, held out of the fit, relative to the deficiency
    functions (to ``H - H(0)``). The smallest order within a quarter of the best error, or below `tolerance`, is taken,
    and refitted to all samples. ``auto`` compares ``exponential`` and ``modal`` so.

    Parameters
    ----------
    data : StepResponses or FrequencyResponse
        At least six samples, or frequencies above 0, of each input.
    method : {"auto", "exponential", "era", "vector fitting", "modal"}
        ``era`` reads step responses, ``vector fitting`` frequency responses.
    order : int, optional
        Poles for each input, 30 at most; chosen by held-out error if not given.
    poles : {"separate", "shared"}
        Whether each input has poles of its own, or all inputs the same: still with states of their own.
    outputs : tuple of str, optional
        Of a frequency response, CN and Cm if not given; step responses bring theirs.
    max_order : int
        Most poles for each input that are tried, 30 at most.
    tolerance : float
        Held-out error at which no larger order is tried. Where no order meets it, a warning is logged.
    match_integral : bool
        Impose the integral of the deficiency function, that is H'(0) (needs two poles or more).

    Returns
    -------
    StateSpaceModel

    Raises
    ------
    InputError
        If the samples are too few, `tolerance` is no number, an order is out of range, or no realisation of the order
        asked for is well posed.
    """
    _check(data, method, order, poles, outputs)
    _check_search(order, max_order, tolerance)
    sources = _sources(data, outputs)
    for source in sources:
        if source.count < _FEWEST_SAMPLES:
            raise InputError(f"response to {source.name} has {source.count} samples, a realisation needs six")
    methods = ("exponential", "modal") if method == "auto" else (method,)
    orders = range(1, max_order + 1) if order is None else range(order, order + 1)
    groups: list[Sequence[Source]] = [[source] for source in sources] if poles == "separate" else [sources]
    blocks, candidates = [], []
    for group in groups:
        with threadpool_limits(limits=1, user_api="blas"):  # small matrices: threads would only fight
            trials = _trials(group, methods, orders, tolerance, match_integral)
            best = _choose(trials, tolerance)
            blocks += _fit_all(group, best, match_integral)
        if order is None and min(t.candidate.held_out for t in trials) > tolerance:
            _LOG.warning(
                "realised model: no order meets the tolerance %.2g for the response to %s, the held-out error is %.2g "
                "with %d poles", tolerance, best.candidate.input, best.candidate.held_out, best.candidate.order,
            )  # fmt: skip
        candidates += [replace(t.candidate, chosen=t is best) for t in trials]
    model = StateSpaceModel(
        a=block_diag(*(block[0] for block in blocks)),
        b=block_diag(*(block[1] for block in blocks)),
        c=np.hstack([block[2] for block in blocks]),
        method=", ".join(dict.fromkeys(c.method for c in candidates if c.chosen)),
        candidates=tuple(candidates),
        **_known(data, sources, outputs),
    )
    return replace(model, errors=channel_errors(model, data))


def channel_errors(model: StateSpaceModel, data: StepResponses | FrequencyResponse) -> tuple[ChannelError, ...]:
    """Error of the model's step responses, or of its frequency response, against `data`, channel by channel."""
    errors = []
    for source in _sources(data, model.outputs):
        if isinstance(source, StepSource):
            misfit = model.step(source.response.s)[source.name].values - source.response.values
            weights = quadrature_weights(source.response.s)
        else:
            j = model.inputs.index(source.name)
            misfit = np.abs(model.frequency_response(source.k)[:, :, j] - source.values)
            weights = quadrature_weights(np.log(source.k))
        rms = np.sqrt(weights @ misfit**2) / source.scale
        peak = np.max(np.abs(misfit), axis=0) / source.peak
        errors += [
            ChannelError(output, source.name, float(rms[i]), float(peak[i])) for i, output in enumerate(model.outputs)
        ]
    return tuple(errors)


def _check(
    data: StepResponses | FrequencyResponse,
    method: str,
    order: int | None,
    poles: str,
    outputs: tuple[str, ...] | None,
) -> None:
    if method not in ("auto", *METHODS):
        raise InputError(f"method is {method!r}, must be one of auto, {', '.join(METHODS)}")
    if poles not in ("separate", "shared"):
        raise InputError(f"poles is {poles!r}, must be 'separate' or 'shared'")
    if isinstance(data, StepResponses):
        if method == "vector fitting":
            raise InputError("vector fitting reads a frequency response; of step responses take 'modal'")
        if outputs is not None and outputs != data.outputs:
            raise InputError("the outputs of step responses are those that they hold; leave outputs out")
    elif method == "era":
        raise InputError("era reads step responses; of a frequency response take 'vector fitting'")
    elif outputs is not None:
        check_names(outputs, COEFFICIENTS, "outputs of a realisation")


def _check_search(order: int | None, max_order: int, tolerance: float) -> None:
    for name, value in (("order", order), ("max_order", max_order)):
        if value is not None and not 1 <= value <= _MOST_POLES:
            raise InputError(f"{name} is {value}, must be from 1 to {_MOST_POLES} poles for each input")
    if not tolerance >= 0.0:
        raise InputError(f"tolerance is {tolerance}, must be 0 or more")


def _sources(
    data: StepResponses | FrequencyResponse, outputs: tuple[str, ...] | None
) -> list[StepSource] | list[FrequencySource]:
    """Data of each input."""
    if isinstance(data, StepResponses):
        return [StepSource(response) for response in data.responses]
    names = [name for name in data.inputs if name in INPUTS]
    return [FrequencySource.read(data, name, outputs or ("CN", "Cm")) for name in names]


def _known(
    data: StepResponses | FrequencyResponse, sources: Sequence[Source], outputs: tuple[str, ...] | None
) -> dict[str, Any]:
    """What of the model needs no fit."""
    shared = {"baseline": data.baseline, "condition": data.condition, "reference": data.reference}
    if isinstance(data, StepResponses):
        return {
            **shared,
            "d": data.initial,
            "inputs": data.inputs,
            "outputs": data.outputs,
            "refused": data.without_limit(),
        }
    outputs = outputs or ("CN", "Cm")
    names = tuple(source.name for source in sources)
    rows = [COEFFICIENTS.index(output) for output in outputs]
    direct = data.direct[np.ix_(rows, [data.inputs.index(name) for name in names])]
    refused = {}
    if "alpha" in names and "CN" in outputs:
        refused = without_limit(data.condition, data.plane, {name: data.at_zero(name, "alpha")[0] for name in outputs})
    return {**shared, "d": direct, "inputs": names, "outputs": outputs, "refused": refused}


def _trials(
    group: Sequence[Source], methods: tuple[str, ...], orders: range, tolerance: float, match_integral: bool
) -> list[_Trial]:
    fitted = [source.target("fitted", match_integral) for source in group]
    unseen = [source.target("held out", match_integral) for source in group]
    name = ", ".join(source.name for source in group)
    trials = []
    for method in methods:
        found: Modes | None = None
        errors: list[float] = []
        for order in orders:
            modes = _best_modes(method, order, group, fitted, found)
            if modes is None:
                continue
            amplitudes = [fit_amplitudes(modes, target) for target in fitted]
            if any(_cancels(a, source) for a, source in zip(amplitudes, group, strict=True)):
                continue
            found = modes
            missed = [target.error(modes, a) for target, a in zip(unseen, amplitudes, strict=True)]
            errors.append(float(np.linalg.norm(missed) / np.sqrt(len(missed))))
            trials.append(_Trial(modes, Candidate(name, method, modes.order, errors[-1])))
            stalled = len(errors) > 3 and min(errors[-2:]) > 0.95 * min(errors[:-2])
            if errors[-1] < tolerance or stalled:
                break
    if not trials:
        raise InputError(f"no well-posed realisation of the response to {name}; try another order or method")
    return trials


def _cancels(amplitudes: Array, source: Source) -> bool:
    """Whether large amplitudes make a small load."""
    return bool(np.any(np.max(np.abs(amplitudes), axis=0) > _WORST_CANCELLATION * source.peak))


def _best_modes(
    method: str, order: int, group: Sequence[Source], targets: Sequence[Target], smaller: Modes | None
) -> Modes | None:
    """Modes of least error: of all starts the two best after a few steps, refined to the end; None without a start."""

    def error(modes: Modes) -> float:
        return joint_error(modes, targets)

    found = _starts(method, order, group, "fitted", smaller)
    starts = [clipped(start, targets) for start in found if start.order > 0]
    if not starts:
        return None
    if method in _DIRECT:
        return min(starts, key=error)
    race = sorted((refine(start, targets, evaluations=_RACE) for start in starts), key=error)
    return min((refine(modes, targets) for modes in race[:2]), key=error)


def _starts(method: str, order: int, group: Sequence[Source], part: Part, smaller: Modes | None) -> list[Modes]:
    """Where to look for poles: from the data, and from the next smaller set with one mode added."""
    settled = max(source.slowest for source in group)
    if method == "exponential" or all(source.quasi_steady for source in group):  # without lag there is no pole to find
        no_pairs = np.zeros((0, 2))
        starts = [Modes(np.geomspace(1.0 / settled, fast / settled, order), no_pairs) for fast in (10.0, 100.0)]
    else:
        starts = _data_modes(group, part, order, settled)
    if method not in _DIRECT and smaller is not None and smaller.order == order - 1:
        starts += [Modes(np.append(smaller.rates, rate / settled), smaller.pairs) for rate in (2.0, 20.0)]
    return starts


def _data_modes(group: Sequence[Source], part: Part, order: int, settled: float) -> list[Modes]:
    """Poles that the data give without a search: by ERA in time, by vector fitting in frequency."""
    if isinstance(group[0], FrequencySource):
        some = [source.part(part) for source in group if isinstance(source, FrequencySource)]
        channels = np.hstack(
            [(one.values - one.direct) / source.scale for one, source in zip(some, group, strict=True)]
        )
        return [vector_fit(some[0].k, channels, order, weights=quadrature_weights(np.log(some[0].k)))]
    starts = []
    for share in (1.1, 0.5):
        steps = [source for source in group if isinstance(source, StepSource)]
        end = min(share * settled, max(float(source.response.s[-1]) for source in steps))
        decays = [source.decay(part, end) for source in steps]
        starts.append(era_modes(np.hstack(decays), end / (len(decays[0]) - 1), order))
    return [modes for modes in starts if modes.order == order] or starts[:1]


def _choose(trials: list[_Trial], tolerance: float) -> _Trial:
    """The fewest states within a quarter of the best held-out error, or below the tolerance."""
    enough = max(1.25 * min(t.candidate.held_out for t in trials), tolerance)
    good = [t for t in trials if t.candidate.held_out <= enough]
    return min(good, key=lambda t: (t.candidate.order, t.candidate.held_out))


def _fit_all(group: Sequence[Source], trial: _Trial, match_integral: bool) -> list[tuple[Array, Array, Array]]:
    """(A, b, C) of each input with the chosen modes, refitted to all samples."""
    targets = [source.target("all", match_integral) for source in group]
    modes = trial.modes
    if trial.candidate.method not in _DIRECT:
        modes = refine(modes, targets, tolerance=1e-14)
    return [modes.state_space(fit_amplitudes(modes, target)) for target in targets]
