r"""A state-space model step by step, inside a simulation: compiled, and callable from compiled code.

    from indicial.rom.streaming import advance, stream

    flow = stream(model, before)            # at rest under the inputs `before`
    advance(flow, inputs, ds, loads)        # at every step, from Python or from a function under numba.njit

Exact for inputs that are linear over each step, whatever the steps; with ``ds = 0`` the inputs jump.
"""

from __future__ import annotations

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import COEFFICIENTS, Array
from indicial.errors import InputError
from indicial.rom.recurrence import ComplexArray, hold_factors
from indicial.rom.state_space import StateSpaceModel


class Stream(NamedTuple):
    """A model and its memory, as arrays that compiled code takes; `advance` changes the last four in place."""

    poles: ComplexArray
    """Modes in reduced time, shape (n_modes,)."""
    b: ComplexArray
    """Shape (n_modes, n_inputs)."""
    c: ComplexArray
    """Shape (n_outputs, n_modes)."""
    d: Array
    """Shape (n_outputs, n_inputs)."""
    baseline: Array
    """Coefficients at the model's condition, shape (n_outputs,)."""
    inputs: Array
    """Inputs at the last step, shape (n_inputs,)."""
    state: ComplexArray
    """Shape (n_modes,)."""
    factors: ComplexArray
    """Of the last step, shape (n_modes, 3)."""
    step: Array
    """Last step in reduced time, shape (1,)."""


def stream(model: StateSpaceModel, before: ArrayLike | None = None) -> Stream:
    """A stream of `model`, at rest under constant inputs `before` (deviations; zero if not given).

    Raises
    ------
    InputError
        If `before` does not fit the inputs, or the model has no modal form (poles that nearly share an eigenvector).
    """
    modes = model.modes()
    inputs = np.zeros(len(model.inputs)) if before is None else np.array(before, dtype=float)
    if inputs.shape != (len(model.inputs),) or not np.all(np.isfinite(inputs)):
        raise InputError(f"inputs before the start must be finite and of shape ({len(model.inputs)},): {model.inputs}")
    rows = [COEFFICIENTS.index(name) for name in model.outputs]
    return Stream(
        poles=modes.poles.copy(),
        b=np.ascontiguousarray(modes.b),
        c=np.ascontiguousarray(modes.c),
        d=np.ascontiguousarray(modes.d),
        baseline=np.ascontiguousarray(model.baseline[rows]),
        inputs=inputs,
        state=modes.settled(inputs),
        factors=np.zeros((modes.poles.size, 3), dtype=np.complex128),
        step=np.full(1, -1.0),
    )


@numba.njit(cache=True, error_model="numpy", fastmath={"contract"})
def advance(stream: Stream, inputs: Array, ds: float, loads: Array) -> None:
    """One step.

    Parameters
    ----------
    stream : Stream
        Taken to the end of the step.
    inputs : ndarray
        Inputs there: deviations of alpha and beta [rad], ``q c/2V``, in the model's order, shape (n_inputs,).
    ds : float
        The step in reduced time: ``2V dt/c``, with the mean V where it varies. Equal steps are cheaper.
    loads : ndarray
        Filled with the coefficients at the end of the step, baseline included, shape (n_outputs,).

    Raises
    ------
    InputError
        If inputs or loads are not as many as the model's, or the step is negative.
    """
    poles, b, c, d, baseline, last, state, factors, step = stream
    if inputs.size != last.size or loads.size != baseline.size:  # compiled code would read what lies beyond
        raise InputError("a step needs as many inputs, and room for as many loads, as the model has")
    if not ds >= 0.0:
        raise InputError("a step in reduced time must not be negative")
    if ds != step[0]:
        step[0] = ds
        for i in range(poles.size):
            factors[i, 0], factors[i, 1], factors[i, 2] = hold_factors(poles[i], ds)
    for j in range(loads.size):
        loads[j] = baseline[j]
        for m in range(inputs.size):
            loads[j] += d[j, m] * inputs[m]
    for i in range(poles.size):
        before, after = complex(0.0, 0.0), complex(0.0, 0.0)
        for m in range(inputs.size):
            weight = b[i, m]
            before += complex(weight.real * last[m], weight.imag * last[m])
            after += complex(weight.real * inputs[m], weight.imag * inputs[m])
        x = factors[i, 0] * state[i] + factors[i, 1] * before + factors[i, 2] * after
        state[i] = x
        for j in range(loads.size):
            loads[j] += c[j, i].real * x.real - c[j, i].imag * x.imag
    for m in range(inputs.size):
        last[m] = inputs[m]
