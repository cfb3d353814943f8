r"""State-space models from step responses.

Each input gets modes of its own, shared by all outputs (`modes`). However the poles are found, the model keeps

- the value at 0+ as direct feedthrough D (the piston jump),
- the final value as static gain, and
- the integral of the deficiency function, hence the alphadot derivative of Eq. (17),

exactly as the data give them, and it is stable by construction. Ways to the poles:

``exponential``
    real poles by variable projection: the classical sum of exponentials;
``era``
    real and complex poles by the eigensystem realisation algorithm;
``modal``
    the latter refined by variable projection. Complex pairs stand for delays: fins see the body's wave late, and
    a supersonic response settles in finite time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.linalg import block_diag
from threadpoolctl import threadpool_limits

from indicial.conventions import Array
from indicial.errors import InputError, NoLimitError
from indicial.rom.deficiency import deficiency_integral
from indicial.rom.era import era_modes, settling_time
from indicial.rom.modes import Modes, Target, clipped, fit_amplitudes, refine
from indicial.rom.response import StepResponse, StepResponses
from indicial.rom.signals import quadrature_weights
from indicial.rom.state_space import Candidate, ChannelError, StateSpaceModel

Method = Literal["auto", "exponential", "era", "modal"]
METHODS = ("exponential", "era", "modal")

_WORST_CANCELLATION = 1e4  # amplitudes may exceed the deficiency function by this, no more
_RESAMPLED = 240
_RACE = 15  # evaluations after which the two best starts are chosen
_QUASI_STEADY = 1e-3


@dataclass(frozen=True)
class _Trial:
    modes: Modes
    candidate: Candidate


def realise(
    responses: StepResponses,
    method: Method = "auto",
    order: int | None = None,
    *,
    max_order: int = 6,
    tolerance: float = 2e-3,
    match_integral: bool = True,
) -> StateSpaceModel:
    """State-space model of step responses.

    Orders are compared by their error at every second sample, held out of the fit, relative to the deficiency
    functions. The smallest order within a quarter of the best error, or below `tolerance`, is taken, and refitted
    to all samples. ``auto`` compares ``exponential`` and ``modal`` so.

    Parameters
    ----------
    responses : StepResponses
        At least six samples of each.
    method : {"auto", "exponential", "era", "modal"}
    order : int, optional
        States for each input; chosen by held-out error if not given.
    max_order : int
        Most states for each input that are tried.
    tolerance : float
        Held-out error at which no larger order is tried.
    match_integral : bool
        Impose the integral of the deficiency function (needs two states or more).

    Returns
    -------
    StateSpaceModel

    Raises
    ------
    InputError
        If the samples are too few, or no realisation of the order asked for is well posed.
    """
    if method not in ("auto", *METHODS):
        raise InputError(f"method is {method!r}, must be one of auto, {', '.join(METHODS)}")
    if order is not None and order < 1:
        raise InputError(f"order is {order}, must be at least 1")
    methods = ("exponential", "modal") if method == "auto" else (method,)
    orders = range(1, max_order + 1) if order is None else range(order, order + 1)
    blocks, candidates = [], []
    for response in responses.responses:
        with threadpool_limits(limits=1, user_api="blas"):  # small matrices: threads would only fight
            trials = _trials(response, methods, orders, tolerance, match_integral)
            best = _choose(trials, tolerance)
            blocks.append(_fit_all(response, best, match_integral))
        candidates += [replace(t.candidate, chosen=t is best) for t in trials]
    model = StateSpaceModel(
        a=block_diag(*(block[0] for block in blocks)),
        b=block_diag(*(block[1] for block in blocks)),
        c=np.hstack([block[2] for block in blocks]),
        d=responses.initial,
        inputs=responses.inputs,
        outputs=responses.outputs,
        baseline=responses.baseline,
        condition=responses.condition,
        reference=responses.reference,
        method=", ".join(dict.fromkeys(c.method for c in candidates if c.chosen)),
        candidates=tuple(candidates),
        refused=responses.without_limit(),
    )
    return replace(model, errors=channel_errors(model, responses))


def channel_errors(model: StateSpaceModel, responses: StepResponses) -> tuple[ChannelError, ...]:
    """Error of the model's step responses against `responses`, channel by channel."""
    errors = []
    for response in responses.responses:
        misfit = model.step(response.s)[response.input].values - response.values
        weights, scale = quadrature_weights(response.s), _scale(response)
        rms = np.sqrt(weights @ misfit**2) / scale
        peak = np.max(np.abs(misfit), axis=0) / _peak(response)
        errors += [
            ChannelError(output, response.input, float(rms[i]), float(peak[i]))
            for i, output in enumerate(responses.outputs)
        ]
    return tuple(errors)


def _peak(response: StepResponse) -> Array:
    """Largest absolute value of each output; an output that is nothing beside the others counts as they do, 1e-6."""
    peak = np.max(np.abs(np.vstack([response.values, response.settled])), axis=0)
    return np.asarray(np.maximum(peak, max(1e-6 * float(np.max(peak)), 1e-300)))


def _scale(response: StepResponse) -> Array:
    """Norm of each deficiency function, or of 0.1% of the response where that is larger (a quasi-steady output)."""
    weights = quadrature_weights(response.s)
    norm = np.sqrt(weights @ response.deficiency**2)
    return np.asarray(np.maximum(norm, _QUASI_STEADY * _peak(response) * np.sqrt(response.s[-1])))


def _target(response: StepResponse, keep: NDArray[np.intp], match_integral: bool) -> Target:
    """The fit's data: samples `keep`; initial value and integral of all samples."""
    integral, horizon = _integral(response)
    return Target(
        s=response.s[keep],
        values=response.deficiency[keep],
        initial=response.deficiency[0],
        integral=integral if match_integral else None,
        horizon=horizon,
        weights=quadrature_weights(response.s[keep]),
        scale=_scale(response),
    )


def _integral(response: StepResponse) -> tuple[Array, float]:
    """Integral of the deficiency functions, shape (n_outputs,), and up to when.

    Of all time, with the tail beyond the record where the final value is known and the tail can be judged; if it
    cannot, or has no integral, of the record.
    """
    end = float(response.s[-1])
    over_record = np.asarray(response.curve().integrate(0.0, end))
    if response.final is None:
        return over_record, np.inf
    try:
        parts = [
            deficiency_integral(response.s, response.values[:, i], float(final))
            for i, final in enumerate(response.final)
        ]
    except (NoLimitError, InputError):
        return over_record, end
    return np.array([part.value for part in parts]), np.inf


def _halves(response: StepResponse, match_integral: bool) -> tuple[Target, Target]:
    """Every second sample to fit, the others held out; the errors of both are means over the whole record."""
    index = np.arange(response.s.size)
    train = np.union1d(index[::2], index[-1:])
    held = np.setdiff1d(index, train)
    fitted = _target(response, train, match_integral)
    weights = quadrature_weights(response.s)[held]
    weights *= response.s[-1] / np.sum(weights)
    return fitted, replace(fitted, s=response.s[held], values=response.deficiency[held], weights=weights)


def _trials(
    response: StepResponse, methods: tuple[str, ...], orders: range, tolerance: float, match_integral: bool
) -> list[_Trial]:
    if response.s.size < 6:
        raise InputError(f"step response to {response.input} has {response.s.size} samples, a realisation needs six")
    fitted, unseen = _halves(response, match_integral)
    trials = []
    for method in methods:
        found: Modes | None = None
        errors: list[float] = []
        for order in orders:
            modes = _best_modes(method, order, fitted, found)
            amplitudes = fit_amplitudes(modes, fitted)
            if np.any(np.max(np.abs(amplitudes), axis=0) > _WORST_CANCELLATION * _peak(response)):
                continue
            found = modes
            errors.append(unseen.error(modes, amplitudes))
            trials.append(_Trial(modes, Candidate(response.input, method, modes.order, errors[-1])))
            stalled = len(errors) > 3 and min(errors[-2:]) > 0.95 * min(errors[:-2])
            if errors[-1] < tolerance or stalled:
                break
    if not trials:
        raise InputError(f"no well-posed realisation of the response to {response.input}; try another order or method")
    return trials


def _best_modes(method: str, order: int, target: Target, smaller: Modes | None) -> Modes:
    """Modes of least error: of all starts the two best after a few steps, refined to the end."""

    def error(modes: Modes) -> float:
        return target.error(modes, fit_amplitudes(modes, target))

    starts = [clipped(start, target.s) for start in _starts(method, order, target, smaller)]
    if method == "era":
        return min(starts, key=error)
    race = sorted((refine(start, target, evaluations=_RACE) for start in starts), key=error)
    return min((refine(modes, target) for modes in race[:2]), key=error)


def _starts(method: str, order: int, target: Target, smaller: Modes | None) -> list[Modes]:
    """Where to look for poles: from the data, and from the next smaller set with one mode added."""
    no_pairs = np.zeros((0, 2))
    settled = settling_time(target.s, target.values)
    if method == "exponential":
        starts = [Modes(np.geomspace(1.0 / settled, fast / settled, order), no_pairs) for fast in (10.0, 100.0)]
    else:
        starts = [
            era_modes(_resampled(target, part * settled), part * settled / (_RESAMPLED - 1), order)
            for part in (1.1, 0.5)
        ]
        starts = [modes for modes in starts if modes.order == order] or starts[:1]
    if method != "era" and smaller is not None and smaller.order == order - 1:
        starts += [Modes(np.append(smaller.rates, rate / settled), smaller.pairs) for rate in (2.0, 20.0)]
    return starts


def _resampled(target: Target, end: float) -> Array:
    """Uniform samples of the scaled deficiency function up to `end`."""
    grid = np.linspace(0.0, min(end, float(target.s[-1])), _RESAMPLED)
    return np.asarray(PchipInterpolator(target.s, target.values / target.scale, axis=0)(grid))


def _choose(trials: list[_Trial], tolerance: float) -> _Trial:
    """The fewest states within a quarter of the best held-out error, or below the tolerance."""
    enough = max(1.25 * min(t.candidate.held_out for t in trials), tolerance)
    good = [t for t in trials if t.candidate.held_out <= enough]
    return min(good, key=lambda t: (t.candidate.order, t.candidate.held_out))


def _fit_all(response: StepResponse, trial: _Trial, match_integral: bool) -> tuple[Array, Array, Array]:
    """(A, b, C) of the chosen modes, refitted to all samples."""
    target = _target(response, np.arange(response.s.size), match_integral)
    modes = trial.modes
    if trial.candidate.method != "era":
        modes = refine(modes, target, tolerance=1e-14)
    return modes.state_space(fit_amplitudes(modes, target))
