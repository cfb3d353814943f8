r"""Step responses rebuilt from a frequency response.

A load that answers causally to a unit step of an input has, for s > 0,

    C(s) = D + 2/pi integral_0^inf Re[H(ik) - D] sin(ks)/k dk,

D the jump at 0+. ``Re(H - D)`` is interpolated through the given frequencies and integrated against the sine exactly,
piece by piece; above the highest frequency it falls off as 1/k^2 (that is what a response without a second jump has),
which is integrated too.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import PchipInterpolator
from scipy.special import sici

from indicial.conventions import COEFFICIENTS, Array
from indicial.errors import InputError
from indicial.frequency import FrequencyResponse
from indicial.rom.response import StepResponse, StepResponses
from indicial.rom.signals import INPUTS

_FINE = 40
"""Pieces into which each interval between two given frequencies is cut: straight lines on so fine a grid."""


def step_responses(response: FrequencyResponse, s: ArrayLike, outputs: tuple[str, ...] = ("CN", "Cm")) -> StepResponses:
    """Responses to unit steps of every input of `response` (but alphadot) at reduced times `s`, from 0 (0+).

    Good as long as `response` covers the frequencies of what is asked: from well below ``1/s[-1]``, where H is near
    its limit at 0 (known by its slope), to where ``Re H`` has come close to D. `truncation` measures that.

    Raises
    ------
    InputError
        If `response` has fewer than four frequencies above 0, or `s` does not start at 0 and increase.
    """
    grid = np.asarray(s, dtype=float)
    moving = np.unique(response.k[response.k > 0.0])
    if moving.size < 4:
        raise InputError(f"a step response needs four reduced frequencies above 0 or more, there are {moving.size}")
    fine = _fine_grid(moving)
    order = [int(np.flatnonzero(response.k == k)[0]) for k in moving]
    rebuilt = []
    for name in (name for name in response.inputs if name in INPUTS):
        j = response.inputs.index(name)
        rows = [COEFFICIENTS.index(output) for output in outputs]
        direct, static = response.direct[rows, j], response.static[rows, j]
        real = np.concatenate([[static - direct], response.values[order][:, rows, j].real - direct])
        # in log k, with k = 0 a decade below the lowest, where Re H differs from H(0) by k^2
        places = np.log(np.concatenate([[moving[0] / 10.0], moving]))
        values = np.asarray(PchipInterpolator(places, real, axis=0)(np.log(fine)))
        loads = direct + 2.0 / np.pi * _sine_integral(fine, values, grid)
        loads[grid == 0.0] = direct
        rebuilt.append(StepResponse(name, grid, loads, final=static))
    return StepResponses(
        tuple(rebuilt),
        outputs,
        response.baseline,
        response.condition,
        response.reference,
        {"source": "frequency response", "k": [float(moving[0]), float(moving[-1])]},
    )


def truncation(response: FrequencyResponse, output: str, input: str) -> float:
    """How far from D the response still is at its highest frequency: ``|Re H - D|`` over the largest there is."""
    real = response.channel(output, input).real
    direct = float(response.direct[COEFFICIENTS.index(output), response.inputs.index(input)])
    static = response.at_zero(output, input)[0]
    largest = max(float(np.max(np.abs(real - direct))), abs(static - direct))
    return abs(float(real[int(np.argmax(response.k))]) - direct) / max(largest, 1e-300)


def _fine_grid(k: Array) -> Array:
    """Logarithmic between the given frequencies, from a decade below the lowest."""
    edges = np.log(np.concatenate([[k[0] / 10.0], k]))
    inner = edges[:-1, None] + np.diff(edges)[:, None] * np.arange(_FINE) / _FINE
    fine: Array = np.exp(np.append(inner.ravel(), edges[-1]))
    return fine


def _sine_integral(k: Array, g: Array, s: Array) -> Array:
    """``integral_0^inf g(k) sin(ks)/k dk`` of straight lines through g (n, p) at k, shape (len(s), p).

    g is constant below k[0] and falls as 1/k^2 above k[-1].
    """
    ks = np.multiply.outer(s, k)
    si = sici(ks)[0]
    slope = np.diff(g, axis=0) / np.diff(k)[:, None]
    level = g[:-1] - slope * k[:-1, None]
    # integral of (level + slope k) sin(ks)/k over a piece; (cos ks - cos ks')/s is bounded as s goes to 0
    change = -np.diff(np.cos(ks), axis=1)
    cosine = np.divide(change, s[:, None], out=np.zeros_like(change), where=s[:, None] > 0.0)
    total = si[:, :1] * g[0] + np.diff(si, axis=1) @ level + cosine @ slope
    # beyond: k1^2 integral_k1^inf sin(ks)/k^3 dk = [sin(u) + u cos(u)]/2 - u^2 (pi/2 - Si(u))/2 at u = k1 s
    u = ks[:, -1]
    tail = 0.5 * (np.sin(u) + u * np.cos(u)) - 0.5 * u * u * (np.pi / 2.0 - si[:, -1])
    result: Array = total + tail[:, None] * g[-1]
    return result
