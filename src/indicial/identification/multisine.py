r"""Multisines for several controls at once: each has frequencies of its own, so that their effects tell apart.

    u_j(t) = A_j sum over k in K_j of  c_k sin(2 pi k t/T + phi_k)

over the record of length T, the harmonics K_j dealt out in turn. Sums over whole periods of different harmonics are
orthogonal, whatever the phases; these are Schroeder's, then chosen for a low peak factor. Source: Morelli, "Multiple
input design for real-time parameter estimation in the frequency domain", IFAC SYSID (2003); Schroeder, IEEE Trans.
Inf. Theory 16 (1970) 85.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from indicial.conventions import Array, Index
from indicial.errors import InputError
from indicial.flightsim import Signal

_ROUNDS = 400


def multisines(
    time: Array,
    amplitudes: Mapping[str, float],
    band: tuple[float, float],
    *,
    seed: int = 0,
) -> dict[str, Signal]:
    """One multisine for each control, orthogonal over the record.

    Parameters
    ----------
    time : ndarray
        Evenly spaced instants of the record [s], shape (n,); its length is n spacings.
    amplitudes : mapping of str to float
        Largest value of each control, in its unit.
    band : pair of float
        Lowest and highest frequency [Hz].
    seed : int
        Of the search for phases.

    Raises
    ------
    InputError
        If time is uneven, an amplitude is not positive, or the band has fewer than two harmonics for each control.
    """
    t = np.asarray(time, dtype=float)
    spacing = np.diff(t)
    if t.size < 8 or not np.allclose(spacing, spacing[0], rtol=1e-6):
        raise InputError("a multisine needs evenly spaced instants, eight or more")
    for name, size in amplitudes.items():
        if not (np.isfinite(size) and size > 0.0):
            raise InputError(f"amplitude of {name} is {size}, must be positive and finite")
    length = t.size * float(spacing[0])
    low, high = int(np.ceil(band[0] * length - 1e-9)), int(np.floor(band[1] * length + 1e-9))
    harmonics = np.arange(max(low, 1), high + 1)
    if harmonics.size < 2 * len(amplitudes) or high >= t.size / 2:
        raise InputError(
            f"a record of {length:g} s has {max(harmonics.size, 0)} harmonics between {band[0]:g} and {band[1]:g} Hz: "
            f"{len(amplitudes)} controls need two each, below half the sampling frequency"
        )
    rng = np.random.default_rng(seed)
    found = {}
    for j, (name, size) in enumerate(amplitudes.items()):
        own = harmonics[j :: len(amplitudes)]
        values = _low_peak((t - t[0]) / length, own, rng)
        found[name] = Signal(t, size * values / np.max(np.abs(values)))
    return found


def relative_peak_factor(values: Array) -> float:
    """Range over twice the root of two times the root mean square: 1 for a sine."""
    spread = float(np.ptp(values))
    rms = float(np.sqrt(np.mean(np.square(values))))
    return spread / (2.0 * math.sqrt(2.0) * rms)


def _low_peak(share: Array, harmonics: Index, rng: np.random.Generator) -> Array:
    """Sum of equal sines whose phases make the peak low: Schroeder's, bettered by random changes of one at a time."""
    turns = 2.0 * np.pi * np.multiply.outer(share, harmonics.astype(float))
    count = turns.shape[1]
    index = np.arange(count)
    phases = -np.pi * index * (index + 1) / count
    parts = np.sin(turns + phases)
    total = parts.sum(axis=1)
    best = relative_peak_factor(total)
    for _ in range(_ROUNDS):
        k = int(rng.integers(count))
        trial = np.sin(turns[:, k] + rng.uniform(0.0, 2.0 * np.pi))
        changed = total - parts[:, k] + trial
        factor = relative_peak_factor(changed)
        if factor < best:
            best, total = factor, changed
            parts[:, k] = trial
    started: Array = total
    return started
