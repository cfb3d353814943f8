"""Identification: time of output-error fits, beside aeroid's on the same record.

An aircraft's record: 500 samples of four channels, four derivatives, the initial state known, from start values 30%
off. Ours estimates the size and the colour of the noise besides; the peer takes it as stated. On one thread. The peer
runs as it comes, with dynamics in Python, an adaptive integrator and differences, and, where JAX is installed, with
gradients by JAX of Runge-Kutta steps, which it compiles anew for each fit; without the peer there is no comparison. A
range's: eight shots of 54 stations, ten coefficients in common, twelve start values each, from 20% off. Compiling a
model is left out of ours: a second or two the first time, then kept on disk; so is importing the peer.
"""

from __future__ import annotations

import importlib.util
import math

import filters
from figures import Figure, best_time
from peers import longitudinal, range_shots

FAR = 1.3


def measure() -> list[Figure]:
    """The fit, then the peer's."""
    record = longitudinal.record(seed=1, memory=0.0)
    ours = best_time(lambda: longitudinal.fit(record, start_known=True, factor=FAR))
    figures = [
        *filters.measure(),
        _range_shots(),
        Figure("output error, 500 samples and 4 parameters", 1e3 * ours, "ms"),
    ]
    if importlib.util.find_spec("aeroid") is None:
        return [*figures, Figure("aeroid is not installed: not compared", math.nan, "")]
    taken = best_time(lambda: longitudinal.peer_fit(record, FAR), repeats=2)
    peer = longitudinal.peer_fit(record, FAR)
    found = longitudinal.fit(record, start_known=True, factor=FAR)
    apart = max(abs(found[n].value - peer.parameters[n]) / peer.stderr[n] for n in longitudinal.TRUTH)
    figures += [
        Figure.at_least("aeroid's output error over ours", taken / ours, 15.0),
        Figure.at_most("estimates apart, in standard errors", apart, 0.5),
    ]
    if importlib.util.find_spec("jax") is None:
        return [*figures, Figure("JAX is not installed: aeroid's gradients by it not compared", math.nan, "")]
    by_jax = best_time(lambda: longitudinal.peer_fit(record, FAR, "jax"), repeats=2)
    return [*figures, Figure.at_least("aeroid's, gradients by JAX, over ours", by_jax / ours, 15.0)]


def _range_shots() -> Figure:
    """Compiling left out: once for a model, it is kept."""
    shots = [range_shots.shot(seed) for seed in range(8)]
    taken = best_time(lambda: range_shots.fit(shots, factor=0.8), repeats=3)
    return Figure.at_most("multiple fit of 8 shots, 10 coefficients in common", taken, 30.0, "s")
