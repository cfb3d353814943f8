"""Derivatives of measured channels by smoothed local differentiation."""

from __future__ import annotations

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError

HALF_WIDTH = 3
"""Samples on each side of the one at which the slope is taken."""


def differentiate(name: str, time: Array, values: Array) -> Array:
    """Slope of a cubic fitted by least squares to 7 neighbouring samples, at its middle sample.

    Of the third order in the interval at the three first and last samples, which take the slope of the nearest
    window, of the fourth between; exact for cubics. With even intervals h, white noise of variance s^2 becomes noise of
    variance ``0.263 (s/h)^2``. The slope of a wave of frequency f is short by the part ``0.21 (2 pi f h)^4``. Samples
    need not be even; dropouts are passed over, and a window that a gap stretches beyond twice its width gives none.
    Local polynomial smoothing as in Klein & Morelli, "Aircraft System Identification" (2006), ch. 11, with cubics.

    Parameters
    ----------
    name : str
        Of the channel, for errors.
    time, values : ndarray
        [s] and the channel's unit, NaN for dropouts, shape (n,).

    Returns
    -------
    ndarray
        Unit per second, NaN where there is none, shape (n,).

    Raises
    ------
    InputError
        If fewer than 7 samples were measured.
    """
    width = 2 * HALF_WIDTH + 1
    known = np.flatnonzero(np.isfinite(values))
    if known.size < width:
        raise InputError(f"channel {name} has {known.size} samples; its rate of change needs at least {width}")
    rows = np.arange(known.size)
    first = np.clip(rows - HALF_WIDTH, 0, known.size - width)
    window = known[first[:, None] + np.arange(width)]
    span = time[window[:, -1]] - time[window[:, 0]]
    near = (time[window] - time[known][:, None]) / span[:, None]
    powers = near[:, :, None] ** np.arange(4)
    level = values[known][:, None]  # taken out so that slopes of large values lose no digits
    slopes = np.einsum("nj,nj->n", np.linalg.pinv(powers)[:, 1], values[window] - level) / span
    slopes[span > 2.0 * np.median(span)] = np.nan
    found = np.full(time.shape, np.nan)
    found[known] = slopes
    return found
