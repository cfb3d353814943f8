r"""A model of motion with noise, discretised and compiled, as filters and input designs take it.

    dx/dt = f(x, p, t) + w,   E w(t) w(t')^T = W delta(t - t'),         y_k = g(x(t_k), p, t_k) + v_k

From one instant to the next, classical Runge-Kutta steps with controls linear between the instants; the transition
matrix F is the exact Jacobian of those steps. The covariance that the noise leaves in the state obeys
``dQ/dt = A Q + Q A^T + W``, taken over the same steps to fourth order with A at the interval's middle
(`kalman.noise_covariance`).

Unknown constants, random walks and first-order Gauss-Markov processes (``db/dt = -b/tau + w``: gusts, drifting biases)
are states like any other: a state's name says which symbol of the model it stands for.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.compiled import Kernel, compile_function
from indicial.flightsim.expressions import TIME


@dataclass(frozen=True)
class Process:
    """A symbol of the model as a random process, ``db/dt = -b/time_constant + w``.

    Parameters
    ----------
    intensity : float
        Square root of the density of w, in units of the symbol over sqrt(s). In the long run the standard deviation
        is ``intensity sqrt(time_constant/2)``. 0 with no time constant is an unknown constant.
    time_constant : float
        [s]; infinite (the default) makes it a random walk.
    follows : str, optional
        Another process, which it lags behind: ``db/dt = (that - b)/time_constant + w``. A vertical gust of Dryden's
        spectrum is ``sqrt(3) a + (1 - sqrt(3)) b`` with b following a, both of time constant ``T = L_w/V``, and a of
        intensity ``sigma_w/sqrt(T)``; a horizontal one is a process by itself, of intensity ``sigma_u sqrt(2/T)``.
    """

    intensity: float = 0.0
    time_constant: float = math.inf
    follows: str | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.intensity) and self.intensity >= 0.0 and self.time_constant > 0.0):
            raise InputError("a process needs a finite intensity of 0 or more and a positive time constant")
        if self.follows is not None and not math.isfinite(self.time_constant):
            raise InputError(f"a process that follows {self.follows} needs a finite time constant")


@dataclass(frozen=True)
class StateModel:
    """States, outputs and noise, compiled.

    Parameters
    ----------
    state_names : tuple of str
        States of motion, then the processes.
    motion : int
        Number of states of motion.
    channels : tuple of str
        Outputs.
    parameter_names : tuple of str
        Symbols that are neither: controls, and values that are given.
    intensity : ndarray
        sqrt of the diagonal of W, units of the state over sqrt(s), shape (nx,).
    step : Kernel
        (state, parameters at both ends and the interval [s], time at its start) -> state after it, F and A.
    view : Kernel
        (state, parameters, time) -> outputs and their Jacobian H.
    substeps : int
        Runge-Kutta steps between two instants, over which the noise is taken too.
    """

    state_names: tuple[str, ...]
    motion: int
    channels: tuple[str, ...]
    parameter_names: tuple[str, ...]
    intensity: Array
    step: Kernel
    view: Kernel
    substeps: int = 1

    def advance(self, state: Array, before: Array, after: Array, interval: float, time: float) -> tuple[Array, ...]:
        """State after an interval [s], shape (nx,), its Jacobian F and A at the middle, shape (nx, nx)."""
        n = len(self.state_names)
        found = self.step(state, np.concatenate([before, after, [interval]]), time)
        return found[:n], found[n : n + n * n].reshape(n, n), found[n + n * n :].reshape(n, n)

    def outputs(self, state: Array, parameters: Array, time: float) -> tuple[Array, Array]:
        """Outputs (nc,) and their Jacobian (nc, nx)."""
        nc = len(self.channels)
        found = self.view(state, parameters, time)
        return found[:nc], found[nc:].reshape(nc, -1)


def state_model(
    rates: Mapping[str, Any],
    outputs: Mapping[str, Any],
    symbols: Sequence[Any],
    *,
    intensity: Mapping[str, float] | None = None,
    processes: Mapping[str, Process] | None = None,
    substeps: int = 1,
) -> StateModel:
    """A model from expressions.

    Parameters
    ----------
    rates : mapping of str to casadi expression
        Time derivative of each state of motion.
    outputs : mapping of str to casadi expression
        What each channel measures.
    symbols : sequence of casadi symbols
        All that the expressions hold: the states by their names, controls, parameters (`TIME` apart).
    intensity : mapping of str to float
        Square roots of the noise density of states, units over sqrt(s); 0 where not given.
    processes : mapping of str to Process
        Symbols that are estimated with the states.
    substeps : int
        Runge-Kutta steps between two instants, for the noise too: each should be a fraction of the shortest time
        constant.

    Raises
    ------
    InputError
        If a name is unknown or a number out of its range.
    """
    intensity, processes = dict(intensity or {}), dict(processes or {})
    known = {symbol.name(): symbol for symbol in symbols}
    names = (*rates, *processes)
    check_names("state or process", names, known)
    check_names("state with noise", intensity, rates)
    if len(set(names)) != len(names):
        raise InputError("a process cannot be a state of motion too")
    if not outputs or substeps < 1:
        raise InputError("a model needs a channel at least, and substeps of 1 or more")
    state = ca.vertcat(*(known[name] for name in names))
    given = ca.vertcat(ca.SX(0, 1), *(symbol for name, symbol in known.items() if name not in names))
    check_names("process to follow", [p.follows for p in processes.values() if p.follows is not None], processes)
    drift = [
        ((0.0 if p.follows is None else known[p.follows]) - known[name]) / p.time_constant
        for name, p in processes.items()
    ]
    rate = ca.Function("rate", [state, given, TIME], [ca.densify(ca.vertcat(*rates.values(), *drift))])
    seen = ca.densify(ca.vertcat(*outputs.values()))
    noise = [intensity.get(name, 0.0) for name in rates] + [p.intensity for p in processes.values()]
    if not all(math.isfinite(value) and value >= 0.0 for value in noise):
        raise InputError("intensities of noise must be finite and not negative")
    return StateModel(
        state_names=names,
        motion=len(rates),
        channels=tuple(outputs),
        parameter_names=tuple(name for name in known if name not in names),
        intensity=np.array(noise, dtype=float),
        step=_compiled_step(rate, state.numel(), given.numel(), substeps),
        view=compile_function(
            ca.Function("view", [state, given, TIME], [ca.vertcat(seen, _rows(ca.jacobian(seen, state)))])
        ),
        substeps=substeps,
    )


def _compiled_step(rate: Any, nx: int, n: int, substeps: int) -> Kernel:
    state, given, time = ca.SX.sym("state", nx), ca.SX.sym("given", 2 * n + 1), ca.SX.sym("time")
    first, last, interval = given[:n], given[n : 2 * n], given[2 * n]
    h = interval / substeps

    def at(y: Any, share: float) -> Any:
        return rate(y, first + share * (last - first), time + share * interval)

    after = state
    for i in range(substeps):
        start, middle, end = i / substeps, (i + 0.5) / substeps, (i + 1) / substeps
        k1 = at(after, start)
        k2 = at(after + h / 2 * k1, middle)
        k3 = at(after + h / 2 * k2, middle)
        k4 = at(after + h * k3, end)
        after = after + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    transition = ca.jacobian(after, state)
    point = ca.SX.sym("point", nx)
    slope = ca.substitute(ca.jacobian(at(point, 0.5), point), point, (state + after) / 2)
    return compile_function(
        ca.Function("step", [state, given, time], [ca.vertcat(after, _rows(transition), _rows(slope))])
    )


def _rows(matrix: Any) -> Any:
    """A matrix row after row, dense."""
    return ca.densify(ca.vec(matrix.T))


def check_names(what: str, names: Iterable[str], allowed: Iterable[str]) -> None:
    """Raise InputError at the first of the names that is not allowed."""
    allowed = tuple(allowed)
    for name in names:
        if name not in allowed:
            raise InputError(f"no {what} {name!r} in the model; there are {', '.join(allowed)}")
