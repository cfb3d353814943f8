"""Reduced-order models: responses against python-control, recursive convolution against scipy, a streamed step."""

from __future__ import annotations

import control
import numba
import numpy as np
from figures import Figure, best_time
from scipy.signal import lfilter

from indicial.conventions import Array, ReferenceQuantities
from indicial.motion import FlightCondition
from indicial.rom import ConvolutionModel, StateSpaceModel, Stream, advance, stream
from indicial.rom.signals import MotionInputs

SAMPLES, STEP = 100_000, 0.05
RATES = (0.1, 0.3, 1.0, 4.0)
OUTPUTS = ("CA", "CY", "CN", "Cl", "Cm", "Cn")


def measure() -> list[Figure]:
    """Time all of it on this machine."""
    return [*_long_response(), *_exponentials(), *_superposition(), *_streaming()]


def ten_states() -> StateSpaceModel:
    """Two real poles and four pairs in mixed coordinates, 3 inputs, 6 outputs."""
    rng = np.random.default_rng(0)
    a = np.diag([-0.1, -0.2, *np.repeat(-0.05 * np.arange(1, 5), 2)])
    for i, frequency in zip(range(2, 10, 2), (0.3, 0.6, 0.9, 1.2), strict=True):
        a[i, i + 1], a[i + 1, i] = frequency, -frequency
    turn = np.linalg.qr(rng.normal(size=(10, 10)))[0]
    b, c, d = rng.normal(size=(10, 3)), rng.normal(size=(6, 10)), rng.normal(size=(6, 3))
    return _model(turn @ a @ turn.T, b, c, d, ("alpha", "p", "q"), OUTPUTS)


def _model(
    a: Array, b: Array, c: Array, d: Array, inputs: tuple[str, ...], outputs: tuple[str, ...]
) -> StateSpaceModel:
    reference = ReferenceQuantities(1.0, 1.0)
    return StateSpaceModel(a, b, c, d, inputs, outputs, np.zeros(6), FlightCondition(2.0), reference)


def _motion(inputs: int) -> MotionInputs:
    s = STEP * np.arange(SAMPLES)
    values = 0.01 * np.cumsum(np.random.default_rng(1).normal(size=(SAMPLES, inputs)), axis=0)
    return MotionInputs(s, values, np.zeros(inputs))


def _long_response() -> list[Figure]:
    model, motion = ten_states(), _motion(3)
    system, columns = model.system, motion.values.T.copy()
    peer = best_time(lambda: control.forced_response(system, motion.s, columns), 5)
    own = best_time(lambda: model.respond(motion), 15)
    difference = np.abs(model.respond(motion) - control.forced_response(system, motion.s, columns).outputs.T)
    uneven = MotionInputs(
        np.sort(np.random.default_rng(2).uniform(0.0, motion.s[-1], SAMPLES)), motion.values, motion.before
    )
    return [
        Figure("10 states, 3 inputs, 6 outputs, 100,000 samples", 1e3 * own, "ms"),
        Figure("the same by control.forced_response", 1e3 * peer, "ms"),
        Figure.at_least("control.forced_response / own", peer / own, 40.0),
        Figure.at_most("difference between them, of the peak", np.max(difference), 1e-9),
        Figure("100,000 samples, every step different", 1e3 * best_time(lambda: model.respond(uneven), 3), "ms"),
    ]


def _exponentials() -> list[Figure]:
    """``C = u - sum of the convolutions of w_i exp(-r_i s) with u'``, all by one recursion, or a filter for each."""
    rates, weights = np.array(RATES), np.array([0.4, 0.3, 0.2, 0.1])
    # F = sum w_i exp(-r_i s) is the deficiency of C(inf) = 1
    model = _model(np.diag(-rates), rates[:, None], weights[None], np.zeros((1, 1)), ("alpha",), ("CN",))
    motion = _motion(1)
    u = np.ascontiguousarray(motion.values[:, 0])
    filters = []
    for rate, weight in zip(rates, weights, strict=True):
        z = rate * STEP
        decay = np.exp(-z)
        after = 1.0 - (1.0 - decay) / z
        filters.append((weight * np.array([after, 1.0 - decay - after]), np.array([1.0, -decay])))

    def one_each() -> Array:
        total: Array = sum(lfilter(b, a, u) for b, a in filters)  # type: ignore[assignment]
        return total

    numerator, denominator = np.zeros(1), np.ones(1)
    for b, a in filters:
        numerator, denominator = (
            np.polyadd(np.convolve(numerator, a), np.convolve(b, denominator)),
            np.convolve(denominator, a),
        )
    peer, joined = best_time(one_each, 15), best_time(lambda: lfilter(numerator, denominator, u), 15)
    own = best_time(lambda: model.respond(motion), 15)
    found = model.respond(motion)[1:, 0] - one_each()[1:]
    # the filters start from zero before the first sample, the model at the first: a transient of that difference
    difference = np.max(np.abs(found[SAMPLES // 2 :])) / np.max(np.abs(u))
    return [
        Figure("4 exponentials, 100,000 samples", 1e3 * own, "ms"),
        Figure.at_most("time / that of scipy.signal.lfilter, one for each", own / peer, 1.0),
        Figure.at_most("time / that of one lfilter of fourth order", own / joined, 1.0),
        Figure.at_most("difference from lfilter, of the input's peak", difference, 1e-9),
    ]


def _superposition() -> list[Figure]:
    """Eq. (13) with 150 samples of each response, by direct sums and by transforms."""
    s = np.concatenate([[0.0], np.geomspace(1e-2, 60.0, 149)])
    motion = _motion(3)
    short = MotionInputs(motion.s[:5000], motion.values[:5000], motion.before)
    steps = ten_states().step(s)
    direct, fast = (ConvolutionModel(steps, evaluation=kind) for kind in ("direct", "fft"))
    uneven = MotionInputs(short.s + 0.4 * STEP * np.sin(np.arange(5000.0)), short.values, short.before)
    exact = direct.respond(short)
    difference = np.max(np.abs(fast.respond(short) - exact)) / np.max(np.abs(exact))
    ratio = best_time(lambda: direct.respond(short), 1) / best_time(lambda: fast.respond(short), 7)
    return [
        Figure("direct sums / transforms, 5,000 samples", ratio, ""),
        Figure.at_most("difference between them, of the peak", difference, 1e-9),
        Figure(
            "direct sums, 5,000 samples, every step different", 1e3 * best_time(lambda: direct.respond(uneven), 1), "ms"
        ),
        Figure("transforms, 100,000 samples", 1e3 * best_time(lambda: fast.respond(motion), 5), "ms"),
    ]


@numba.njit
def _fly(flow: Stream, values: Array, ds: float, vary: float, loads: Array) -> float:
    total = 0.0
    for k in range(values.shape[0]):
        ds += vary
        advance(flow, values[k], ds, loads)
        total += loads[0]
    return total


def _streaming() -> list[Figure]:
    model, values, loads = ten_states(), _motion(3).values, np.empty(6)
    even = best_time(lambda: _fly(stream(model), values, STEP, 0.0, loads), 25) / SAMPLES
    uneven = best_time(lambda: _fly(stream(model), values, STEP, 1e-9, loads), 25) / SAMPLES
    return [
        Figure.at_most("streaming step, 10 states, in compiled code", 1e6 * even, 1.0, "microseconds"),
        Figure("the same, every step different", 1e6 * uneven, "microseconds"),
    ]
