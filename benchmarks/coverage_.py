"""Coverage: how often 95% intervals hold the true derivatives, with white and with strongly coloured noise.

Output error of 200 simulated records of one 3-2-1-1 (500 samples, 4 derivatives, unknown start): parameter by
parameter, the share of intervals that hold the truth, and the reported standard error over the true scatter, with
white noise and with noise of first order, 0.9 from sample to sample. aeroid's standard errors beside it, on 40 of the
coloured records, its start known, where it is installed.
"""

from __future__ import annotations

import importlib.util
import math
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from figures import Figure
from peers import longitudinal

from indicial.conventions import Array

RECORDS, PEER_RECORDS, COLOURED = 200, 40, 0.9
NAMES = tuple(longitudinal.TRUTH)
SURE = 1.96

Fitted = tuple[list[float], list[float]]


def measure() -> list[Figure]:
    """Each derivative with each noise, then the peer."""
    figures = []
    with ProcessPoolExecutor(os.cpu_count() or 1) as pool:
        for noise, memory in (("white", 0.0), (f"first order {COLOURED}", COLOURED)):
            errors, reported = _fitted(pool, _ours, memory, RECORDS)
            held = np.mean(np.abs(errors) < SURE * reported, axis=0)
            ratio = reported.mean(axis=0) / errors.std(axis=0)
            for name, share, size in zip(NAMES, held, ratio, strict=True):
                figures.append(_within(f"{name}, {noise}: coverage of 95% intervals", share, 0.90, 0.98))
                figures.append(_within(f"{name}, {noise}: standard error over scatter", size, 0.85, 1.15))
        if importlib.util.find_spec("aeroid") is None:
            return [*figures, Figure("aeroid is not installed: not compared", math.nan, "")]
        errors, reported = _fitted(pool, _theirs, COLOURED, PEER_RECORDS)
    for name, size in zip(NAMES, reported.mean(axis=0) / errors.std(axis=0), strict=True):
        figures.append(Figure(f"{name}, coloured: aeroid's standard error over scatter", float(size), ""))
    return figures


def _within(name: str, value: float, low: float, high: float) -> Figure:
    return Figure(name, float(value), "", f"{low:g} to {high:g}", bool(low <= value <= high))


def _fitted(
    pool: ProcessPoolExecutor, fit: Callable[[tuple[int, float]], Fitted], memory: float, count: int
) -> tuple[Array, Array]:
    """Errors and standard errors, shapes (count, 4)."""
    errors, reported = zip(*pool.map(fit, ((seed, memory) for seed in range(count))), strict=True)
    return np.array(errors), np.array(reported)


def _ours(case: tuple[int, float]) -> Fitted:
    found = longitudinal.fit(longitudinal.record(*case))
    return (
        [found[name].value - value for name, value in longitudinal.TRUTH.items()],
        [found[name].standard_error for name in NAMES],
    )


def _theirs(case: tuple[int, float]) -> Fitted:
    found = longitudinal.peer_fit(longitudinal.record(*case))
    return (
        [found.parameters[name] - value for name, value in longitudinal.TRUTH.items()],
        [found.stderr[name] for name in NAMES],
    )
