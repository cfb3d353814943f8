r"""Samples that do not belong: spikes of a channel beside its neighbours, and residuals no noise would leave.

A size is judged in standard deviations by the median of the sizes, ``1.483 median|d|``, which outliers do not move; the
limit is that which one of all the samples passes by chance in a hundred records of Gaussian noise whose deviation is
known (Rousseeuw & Croux, J. American Statistical Association 88 (1993) 1273, for the scale). As it is estimated, a
few more do: 8 of 300 records of 21 channels of 1000 samples.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array

Mask = NDArray[np.bool_]

_BY_CHANCE = 0.01
_REACH = 4  # samples on each side that a spike is judged by
_LEAST = 1e-3  # of the channel's range; smaller is no spike's scale
_DIGIT = 0.3  # of the last digit: the same
_ROUNDS = 20
_STRETCHED = 2.0


def robust_scale(values: Array) -> float:
    """Standard deviation of Gaussian values about 0, by their median size."""
    return float(np.median(np.abs(values))) / 0.6745


def outlier_limit(number: int) -> float:
    """Standard deviations that one of `number` Gaussian values exceeds in one case of a hundred."""
    from scipy.special import ndtri

    return float(-ndtri(0.5 * _BY_CHANCE / max(number, 1)))


def outlying(white: Array, reach: int = 0, number: int | None = None, scale: float | None = None) -> Mask:
    """Which of white residuals (n,) are outliers; of several within `reach` samples the largest only.

    One outlier in noise that remembers spoils the white residuals behind it as well. Without it these may be sound, so
    they are judged again in the next fit.

    Parameters
    ----------
    white : ndarray
    reach : int
    number : int, optional
        Of residuals among which one may be so large by chance, if these are only a part.
    scale : float, optional
        Their standard deviation, by the median if not given.
    """
    size = np.abs(white)
    deviation = robust_scale(white) if scale is None else scale
    if white.size == 0 or deviation == 0.0:
        return np.zeros(white.shape, dtype=bool)
    loud = size > outlier_limit(number or white.size) * deviation
    return loud & (size >= _largest_near(np.where(loud, size, 0.0), reach))


def spikes(time: Array, values: Array, number: int | None = None) -> tuple[Mask, float]:
    """Single samples that stand out from a channel, and the largest in standard deviations.

    A sample is held against the cubic through its two neighbours on each side, and against straight lines through the
    four before and the four behind: a spike is off the cubic by more than the limit and lies on the same side of both
    lines by more than half of that. A jump or a kink of the motion is no spike: there a sample agrees with one side.
    The four first and last samples, and those beside gaps, are not judged; of several spikes side by side only the
    largest may be seen.

    Parameters
    ----------
    time, values : ndarray
        Shape (n,), NaN for dropouts.
    number : int, optional
        Of samples among which one may stand out by chance, if these are only a part.
    """
    found = np.zeros(values.shape, dtype=bool)
    worst = 0.0
    least = _least_scale(values)
    if least == 0.0:
        return found, worst
    for _ in range(_ROUNDS):
        known = np.flatnonzero(np.isfinite(values) & ~found)
        if known.size < 4 * _REACH:
            break
        at, off, same_side = _beside_neighbours(time, values, known)
        scale = max(robust_scale(off), least)
        loud = (np.abs(off) > outlier_limit(number or known.size) * scale) & same_side
        size = np.where(loud, np.abs(off), 0.0)
        chosen = loud & (size >= _largest_near(size, 2))
        if not np.any(chosen):
            break
        found[at[chosen]] = True
        worst = max(worst, float(np.max(size)) / scale)
    return found, worst


def _least_scale(values: Array) -> float:
    """A scale below which nothing stands out: a part of the range, or of the last digit; 0 if nothing moves."""
    known = values[np.isfinite(values)]
    if known.size < 4 * _REACH:
        return 0.0
    steps = np.abs(np.diff(known))
    steps = steps[steps > 1e-9 * np.ptp(known)]
    return max(_LEAST * float(np.ptp(known)), _DIGIT * float(np.min(steps))) if steps.size else 0.0


def _beside_neighbours(time: Array, values: Array, known: NDArray[np.int64]) -> tuple[NDArray[np.int64], Array, Mask]:
    """Samples that can be judged, how far each is off its neighbours' cubic, and whether both sides say so."""
    rows = np.arange(_REACH, known.size - _REACH)
    window = known[rows[:, None] + np.arange(-_REACH, _REACH + 1)]
    span = time[window[:, -1]] - time[window[:, 0]]
    window = window[span <= _STRETCHED * np.median(span)]
    t = time[window] - time[window[:, _REACH]][:, None]
    y = values[window]
    near = [_REACH - 2, _REACH - 1, _REACH + 1, _REACH + 2]
    weights = np.ones((len(t), 4))
    for i, a in enumerate(near):
        for b in near:
            if b != a:
                weights[:, i] *= -t[:, b] / (t[:, a] - t[:, b])
    middle = y[:, _REACH]
    off = middle - np.sum(weights * y[:, near], axis=1)
    sides = [middle - _line_at_zero(t[:, part], y[:, part]) for part in (slice(_REACH), slice(_REACH + 1, None))]
    agree = np.all([side * off > 0.0 for side in sides], axis=0)
    agree &= np.all([np.abs(side) > 0.5 * np.abs(off) for side in sides], axis=0)
    return window[:, _REACH], off / np.sqrt(1.0 + np.sum(weights**2, axis=1)), agree


def _line_at_zero(t: Array, y: Array) -> Array:
    """At t = 0, the straight lines through rows of points."""
    middle = t.mean(axis=1, keepdims=True)
    slope = np.sum((t - middle) * y, axis=1) / np.sum((t - middle) ** 2, axis=1)
    value: Array = y.mean(axis=1) - slope * middle[:, 0]
    return value


def _largest_near(size: Array, reach: int) -> Array:
    """Largest within `reach` samples on each side, shape (n,)."""
    padded = np.pad(size, reach)
    largest: Array = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1).max(axis=1)
    return largest
