r"""The march of a flight in compiled code: fixed steps, and steps that follow the error.

A rate of change and a monitor (see `Dynamics`) come in as the addresses of compiled functions, so that one compiled
march serves every model; it holds no Python object and can run in several threads at once. Ends are rows
``(monitored quantity, sign, level)``: a flight ends where ``sign (quantity - level)`` falls to zero.

Parameters that are signals are written into the vector of parameters before every evaluation; at a jump, the stages at
the end of a step see what was before it and those at its beginning what comes after.

Runge-Kutta of fourth order with fixed steps, and DOP853 of Dormand and Prince: order 8, error by orders 5 and 3, dense
output of order 7, with the coefficients that SciPy has. Source: Hairer, Norsett and Wanner, Solving Ordinary
Differential Equations I, sec. II.4 to II.6 and II.10.
"""

from __future__ import annotations

import functools
import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from indicial.conventions import Array
from indicial.flightsim.compiled import Code, evaluate_code

MONITORED = ("x", "altitude", "climb rate")
"""What a monitor gives [m, m, m/s]."""

FLOWN, ENDED, NOT_FINITE, TOO_MANY_STEPS = 0, 1, 2, 3
"""How a march came out: to its duration, at an end, or not."""

_BISECTIONS = 200
_NUDGE = 1e-9  # of a step: what times of steps and of jumps may differ by in round-off
_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 10.0


class Drive(NamedTuple):
    """Parameters that are signals, as arrays that compiled code takes."""

    which: NDArray[np.int64]
    """Parameter that each one drives, shape (n,)."""
    first: NDArray[np.int64]
    """Where each one's points begin, and where the last one's end, shape (n + 1,)."""
    time: Array
    """Of all points [s], one signal after the other."""
    value: Array
    breaks: Array
    """Times of all points, each once, increasing: the adaptive march stops at them."""


class Tableau(NamedTuple):
    """Coefficients of DOP853, as arrays that compiled code takes."""

    a: Array
    """Of the stages, those of the dense output included, shape (16, 16)."""
    b: Array
    """Shape (12,)."""
    c: Array
    """Shape (16,)."""
    error: Array
    """Of orders 5 and 3, shape (2, 13)."""
    dense: Array
    """Shape (4, 16)."""


@functools.cache
def dop853() -> Tableau:
    """The coefficients, from `scipy.integrate.DOP853`."""
    from scipy.integrate import DOP853 as METHOD

    a = np.zeros((16, 16))
    a[:12, :12] = METHOD.A
    a[12, :12] = METHOD.B
    a[13:] = METHOD.A_EXTRA
    c = np.concatenate([METHOD.C, [1.0], METHOD.C_EXTRA])
    return Tableau(a, np.array(METHOD.B), c, np.stack([METHOD.E5, METHOD.E3]), np.array(METHOD.D))


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def feed(drive: Drive, time: float, nudge: float, parameters: Array) -> None:
    """Write the signals' values into the parameters, from their pieces at ``time + nudge``: a side of a jump."""
    for j in range(drive.which.size):
        start, stop = drive.first[j], drive.first[j + 1]
        low, high = start, stop  # the first point beyond `time` is sought
        while low < high:
            middle = (low + high) // 2
            if drive.time[middle] <= time + nudge:
                low = middle + 1
            else:
                high = middle
        if low == start:
            value = drive.value[start]
        elif low == stop:
            value = drive.value[stop - 1]
        else:
            t0, t1 = drive.time[low - 1], drive.time[low]
            share = (time - t0) / (t1 - t0)
            value = drive.value[low - 1] + share * (drive.value[low] - drive.value[low - 1])
        parameters[drive.which[j]] = value


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _margin(monitor: Code, y: Array, parameters: Array, drive: Drive, time: float, ends: Array, seen: Array) -> float:
    """What is left until the nearest end."""
    feed(drive, time, 0.0, parameters)
    evaluate_code(monitor, y, parameters, time, seen)
    left = math.inf
    for row in ends:
        left = min(left, row[1] * (seen[int(row[0])] - row[2]))
    return left


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _finite(y: Array) -> bool:
    total = 0.0
    for value in y:
        total += value - value
    return total == 0.0


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _step(
    rate: Code, y: Array, parameters: Array, drive: Drive, time: float, h: float, k: Array, stage: Array, after: Array
) -> None:
    """One step of the classical Runge-Kutta method of order 4, from `y` to `after`."""
    n = y.size
    half, sixth = 0.5 * h, h / 6.0
    feed(drive, time, _NUDGE * h, parameters)
    evaluate_code(rate, y, parameters, time, k)
    for i in range(n):
        after[i] = y[i] + sixth * k[i]
        stage[i] = y[i] + half * k[i]
    feed(drive, time + half, 0.0, parameters)
    evaluate_code(rate, stage, parameters, time + half, k)
    for i in range(n):
        after[i] += 2.0 * sixth * k[i]
        stage[i] = y[i] + half * k[i]
    evaluate_code(rate, stage, parameters, time + half, k)
    for i in range(n):
        after[i] += 2.0 * sixth * k[i]
        stage[i] = y[i] + h * k[i]
    feed(drive, time + h, -_NUDGE * h, parameters)
    evaluate_code(rate, stage, parameters, time + h, k)
    for i in range(n):
        after[i] += sixth * k[i]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def runge_kutta(
    rate: Code,
    monitor: Code,
    start: Array,
    parameters: Array,
    drive: Drive,
    duration: float,
    step: float,
    every: int,
    ends: Array,
    times: Array,
    states: Array,
) -> tuple[int, int]:
    """Fixed steps over the duration, the last one cut to meet it, or an end, exactly.

    Parameters
    ----------
    rate, monitor : Code
    start : ndarray
        Shape (nx,).
    parameters : ndarray
    drive : Drive
        Those of the parameters that are signals.
    duration, step : float
        [s].
    every : int
        Every how many steps an instant is kept.
    ends : ndarray
        Shape (n, 3).
    times, states : ndarray
        Filled with the instants kept, the first and the last included, shapes (n,) and (n, nx).

    Returns
    -------
    kept : int
        How many instants were kept.
    outcome : int
        `FLOWN`, `ENDED`, or `NOT_FINITE` (the last instant kept is the last good one).
    """
    y, after, k, stage, seen = start.copy(), start.copy(), start.copy(), start.copy(), np.empty(3)
    p = parameters.copy()
    whole = math.floor(duration / step * (1.0 + 1e-12))
    steps = whole if duration - whole * step < 1e-9 * step else whole + 1
    times[0], kept = 0.0, 1
    states[0] = y
    for index in range(1, steps + 1):
        before = (index - 1) * step
        h = step if index <= whole else duration - before
        _step(rate, y, p, drive, before, h, k, stage, after)
        if not _finite(after):
            times[kept], states[kept] = before, y
            return kept + 1 if before > times[kept - 1] else kept, NOT_FINITE
        if ends.size and _margin(monitor, after, p, drive, before + h, ends, seen) <= 0.0:
            low, high = 0.0, h
            for _ in range(_BISECTIONS):
                middle = 0.5 * (low + high)
                if middle <= low or middle >= high or high - low < 1e-15 * h:
                    break
                _step(rate, y, p, drive, before, middle, k, stage, after)
                if _margin(monitor, after, p, drive, before + middle, ends, seen) > 0.0:
                    low = middle
                else:
                    high = middle
            _step(rate, y, p, drive, before, high, k, stage, after)
            times[kept], states[kept] = before + high, after
            return kept + 1, ENDED
        y, after = after, y
        if index % every == 0 or index == steps:
            times[kept], states[kept] = (index * step if index < steps else duration), y
            kept += 1
    return kept, FLOWN


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _stages(
    rate: Code,
    y: Array,
    parameters: Array,
    drive: Drive,
    time: float,
    h: float,
    tableau: Tableau,
    k: Array,
    chosen: tuple[int, int],
) -> None:
    """Stages ``chosen[0]`` up to, not with, ``chosen[1]``."""
    n = y.size
    stage = np.empty(n)
    for s in range(chosen[0], chosen[1]):
        for i in range(n):
            stage[i] = 0.0
        for j in range(s):
            weight = tableau.a[s, j]
            if weight != 0.0:
                for i in range(n):
                    stage[i] += weight * k[j, i]
        for i in range(n):
            stage[i] = y[i] + h * stage[i]
        nudge = -_NUDGE * h if tableau.c[s] == 1.0 else 0.0
        feed(drive, time + tableau.c[s] * h, nudge, parameters)
        evaluate_code(rate, stage, parameters, time + tableau.c[s] * h, k[s])


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _error(y: Array, after: Array, h: float, k: Array, coefficients: Array, relative: float, absolute: Array) -> float:
    """Of a step, over what is allowed: the mixed norm of the estimates of orders 5 and 3."""
    fifth, third = 0.0, 0.0
    for i in range(y.size):
        e5, e3 = 0.0, 0.0
        for j in range(13):
            e5 += coefficients[0, j] * k[j, i]
            e3 += coefficients[1, j] * k[j, i]
        scale = absolute[i] + relative * max(abs(y[i]), abs(after[i]))
        fifth += (e5 / scale) ** 2
        third += (e3 / scale) ** 2
    if fifth == 0.0 and third == 0.0:
        return 0.0
    return h * fifth / math.sqrt((fifth + 0.01 * third) * y.size)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _prepare_dense(y: Array, after: Array, h: float, k: Array, weights: Array, f: Array) -> None:
    """Coefficients of the interpolant over a step, shape (7, n)."""
    for i in range(y.size):
        change = after[i] - y[i]
        f[0, i] = change
        f[1, i] = h * k[0, i] - change
        f[2, i] = 2.0 * change - h * (k[12, i] + k[0, i])
        for m in range(4):
            total = 0.0
            for j in range(16):
                total += weights[m, j] * k[j, i]
            f[3 + m, i] = h * total


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _interpolate(y: Array, f: Array, x: float, result: Array) -> None:
    """The state at a fraction x of the step."""
    for i in range(y.size):
        value = 0.0
        for m in range(7):
            value = (value + f[6 - m, i]) * (x if m % 2 == 0 else 1.0 - x)
        result[i] = y[i] + value


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _first_step(
    rate: Code, y: Array, parameters: Array, k: Array, relative: float, absolute: Array, duration: float
) -> float:
    """A step that the method's order suits, from the first two derivatives (Hairer, II.4)."""
    n = y.size
    scale = absolute + relative * np.abs(y)
    d0, d1 = math.sqrt(np.sum((y / scale) ** 2) / n), math.sqrt(np.sum((k[0] / scale) ** 2) / n)
    h0 = min(duration, 1e-6 if d0 < 1e-5 or d1 < 1e-5 else 0.01 * d0 / d1)
    ahead = y + h0 * k[0]
    evaluate_code(rate, ahead, parameters, h0, k[1])
    d2 = math.sqrt(np.sum(((k[1] - k[0]) / scale) ** 2) / n) / h0
    h1 = max(1e-6, 1e-3 * h0) if d1 <= 1e-15 and d2 <= 1e-15 else (0.01 / max(d1, d2)) ** 0.125
    return min(100.0 * h0, h1, duration)


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def adaptive(
    rate: Code,
    monitor: Code,
    start: Array,
    parameters: Array,
    drive: Drive,
    instants: Array,
    tolerance: tuple[float, Array],
    largest: float,
    ends: Array,
    tableau: Tableau,
    limit: int,
    times: Array,
    states: Array,
) -> tuple[int, int, int]:
    """DOP853 from the first instant to the last, or to an end.

    Parameters
    ----------
    rate, monitor, start, parameters, drive, ends
        As those of `runge_kutta`.
    instants : ndarray
        Increasing [s], from the start at ``instants[0]`` on, shape (n,).
    tolerance : tuple
        Relative, and absolute of each state, shape (nx,).
    largest : float
        Longest step that it may take [s].
    tableau : Tableau
    limit : int
        Steps that it may take.
    times, states : ndarray
        Filled with the instants, and the end if that is met; shapes (n + 1,) and (n + 1, nx).

    Returns
    -------
    kept, outcome, steps : int
    """
    relative, absolute = tolerance
    y, after, here, seen = start.copy(), start.copy(), start.copy(), np.empty(3)
    n = y.size
    k, f, p = np.zeros((16, n)), np.empty((7, n)), parameters.copy()
    time, duration = instants[0], instants[-1] - instants[0]
    feed(drive, time, 0.0, p)
    evaluate_code(rate, y, p, time, k[0])
    h = _first_step(rate, y, p, k, relative, absolute, duration)
    times[0], kept, steps, rejected = time, 1, 0, False
    states[0] = y
    coming = 0  # of the breaks
    while coming < drive.breaks.size and drive.breaks[coming] <= time:
        coming += 1
    while kept < instants.size:
        steps += 1
        if steps > limit:
            return kept, TOO_MANY_STEPS, steps
        h = min(h, largest)
        stop_at = instants[-1]
        if coming < drive.breaks.size:
            stop_at = min(stop_at, drive.breaks[coming])
        reaching = time + h >= stop_at or stop_at - time - h < 1e-3 * h
        last = reaching and stop_at == instants[-1]
        h = stop_at - time if reaching else h
        _stages(rate, y, p, drive, time, h, tableau, k, (1, 12))
        for i in range(n):
            total = 0.0
            for j in range(12):
                total += tableau.b[j] * k[j, i]
            after[i] = y[i] + h * total
        feed(drive, time + h, -_NUDGE * h, p)
        evaluate_code(rate, after, p, time + h, k[12])
        error = _error(y, after, h, k, tableau.error, relative, absolute)
        if not error < 1.0:  # too large, or not a number
            h *= max(_SHRINK, _SAFETY * error**-0.125) if error < math.inf else _SHRINK
            rejected = True
            if not h > 1e-15 * max(abs(time), duration):
                return kept, NOT_FINITE, steps
            continue
        ended = ends.size > 0 and _margin(monitor, after, p, drive, time + h, ends, seen) <= 0.0
        if ended or time + h >= instants[kept]:
            _stages(rate, y, p, drive, time, h, tableau, k, (13, 16))
            _prepare_dense(y, after, h, k, tableau.dense, f)
        stop = 1.0
        if ended:
            low = 0.0
            for _ in range(_BISECTIONS):
                middle = 0.5 * (low + stop)
                if middle <= low or middle >= stop:
                    break
                _interpolate(y, f, middle, here)
                if _margin(monitor, here, p, drive, time + middle * h, ends, seen) > 0.0:
                    low = middle
                else:
                    stop = middle
        reached = instants[-1] if last and not ended else time + stop * h
        while kept < instants.size and instants[kept] <= reached:
            _interpolate(y, f, (instants[kept] - time) / h, states[kept])
            times[kept] = instants[kept]
            kept += 1
        if ended:
            if reached > times[kept - 1]:
                _interpolate(y, f, stop, states[kept])
                times[kept] = reached
                kept += 1
            return kept, ENDED, steps
        time = stop_at if reaching else time + h
        grow = _GROW if error == 0.0 else min(_GROW, _SAFETY * error**-0.125)
        h *= min(1.0, grow) if rejected else grow
        rejected = False
        y, after = after, y
        for i in range(n):
            k[0, i] = k[12, i]
        if coming < drive.breaks.size and time == drive.breaks[coming]:
            coming += 1
            feed(drive, time, 0.0, p)
            evaluate_code(rate, y, p, time, k[0])  # as it is after the break
    return kept, FLOWN, steps
