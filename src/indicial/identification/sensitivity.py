r"""A flight model marched together with its exact sensitivities, compiled.

With unknowns theta, ``xdot = f(x, p, t)`` and ``S = dx/dtheta``,

    Sdot = f_x S + f_p dp/dtheta,        y = g(x, p, t),        dy/dtheta = g_x S + g_p dp/dtheta,

the partial derivatives formed symbolically and compiled with f and g into two stretches of code. Runge-Kutta of x and
S together gives the derivatives of the very numbers that Runge-Kutta of x gives, not those of the equations.

**Multiple shooting.** At a node k the state is set to a value s_k of its own. S goes on as if it were not, and one more
column e gathers the defects, ``e += x - s_k`` at each node. To first order, then, a step of the unknowns that closes
all gaps changes node k by ``G_k dtheta + e_k`` (G_k is S there) and the outputs by ``dy/dtheta dtheta + g_x e``: the
condensed, or lifted, Newton method. Source: Albersmeyer & Diehl, SIAM J. Optim. 20 (2010) 1655; Bock, Springer Ser.
Chem. Phys. 18 (1981) 102.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numba import njit
from numpy.typing import NDArray

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim import Dynamics
from indicial.flightsim.compiled import Code, Kernel, compile_function, evaluate_code
from indicial.flightsim.march import Drive, feed
from indicial.identification.channels import channel_expressions
from indicial.identification.instruments import Installation

BIAS = "bias_"
"""A parameter of this name and a channel's is added to what the channel sees."""

_NUDGE = 1e-9  # of a step: on which side of a jump a stage at its end looks
Integers = NDArray[np.int64]


class Pattern(NamedTuple):
    """Where the nonzeros of partial derivatives stand, in their order behind the value itself."""

    state_rows: Integers
    state_columns: Integers
    parameter_rows: Integers
    parameter_columns: Integers


@dataclass(frozen=True)
class SensitivityModel:
    """Rates and outputs of a flight model with their partial derivatives, compiled.

    Parameters
    ----------
    dynamics : Dynamics
    channels : tuple of str
    parameter_names : tuple of str
        Those of the dynamics, then biases of channels.
    rate, view : Kernel
        (state, parameters, time) -> value, then the nonzeros of its derivatives by state and by parameters.
    rate_pattern, view_pattern : Pattern
    """

    dynamics: Dynamics
    channels: tuple[str, ...]
    parameter_names: tuple[str, ...]
    rate: Kernel
    view: Kernel
    rate_pattern: Pattern
    view_pattern: Pattern

    @classmethod
    def of(
        cls,
        dynamics: Dynamics,
        channels: Sequence[str],
        biases: Sequence[str] = (),
        installation: Installation | None = None,
    ) -> SensitivityModel:
        """Compile a model that sees some channels, of which some have a bias, from where the instruments are.

        Raises
        ------
        InputError
            If a channel is unknown, or a bias is of none that is seen.
        """
        stray = set(biases) - set(channels)
        if stray:
            raise InputError(f"bias of {', '.join(sorted(stray))}, which is no channel of this record")
        n = len(dynamics.parameter_names)
        state, time = ca.SX.sym("state", len(dynamics.state_names)), ca.SX.sym("time")
        parameters = ca.SX.sym("parameters", n + len(biases))
        own = parameters[:n]
        seen = channel_expressions(dynamics, channels, state, own, time, installation)
        for i, name in enumerate(biases):
            seen[channels.index(name)] += parameters[n + i]
        inputs = [state, parameters, time]
        rate, rate_pattern = _with_partials("rate", inputs, dynamics.derivative(state, own, time))
        view, view_pattern = _with_partials("view", inputs, ca.vertcat(*seen))
        names = (*dynamics.parameter_names, *(BIAS + name for name in biases))
        return cls(dynamics, tuple(channels), names, rate, view, rate_pattern, view_pattern)

    def march(
        self,
        start: tuple[Array, Array],
        parameters: Array,
        drive: Drive,
        columns: Integers,
        time: Array,
        substeps: Integers,
        nodes: tuple[Integers, Array] | None = None,
    ) -> Marched:
        """March from the first instant to the last.

        Parameters
        ----------
        start : tuple of ndarray
            State (nx,), and its derivatives by the n unknowns (nx, n).
        parameters : ndarray
            Values of those that do not change with time, shape (np,).
        drive : Drive
            Those that do.
        columns : ndarray of int
            Which unknown each parameter is, -1 for none, shape (np,).
        time : ndarray
            Instants [s], shape (n_times,).
        substeps : ndarray of int
            Runge-Kutta steps in each interval, shape (n_times - 1,).
        nodes : tuple of ndarray, optional
            At which instants (not the first) the state is set, and to what (n_nodes, nx).
        """
        state, slope = start
        at, values = (np.zeros(0, np.int64), np.zeros((0, state.size))) if nodes is None else nodes
        slopes = np.zeros((state.size, slope.shape[1] + 1))  # one more column for defects
        slopes[:, :-1] = slope
        width, n = slopes.shape[1], time.size
        made = Marched(
            outputs=np.empty((n, len(self.channels))),
            slopes=np.empty((n, len(self.channels), width)),
            states=np.empty((n, state.size)),
            node_slopes=np.empty((at.size, state.size, width)),
        )
        work = np.empty(max(self.rate.results, self.view.results))
        _march(
            (self.rate.code, self.rate_pattern),
            (self.view.code, self.view_pattern),
            (np.ascontiguousarray(state), slopes),
            np.array(parameters, dtype=float),
            drive,
            columns,
            (np.ascontiguousarray(time), substeps),
            (at, np.ascontiguousarray(values)),
            work,
            made,
        )
        return made


class Marched(NamedTuple):
    """What a march gives; the last column of slopes belongs to defects."""

    outputs: Array
    """Shape (n_times, n_channels)."""
    slopes: Array
    """Shape (n_times, n_channels, n + 1)."""
    states: Array
    """Shape (n_times, nx)."""
    node_slopes: Array
    """Shape (n_nodes, nx, n + 1)."""


def _with_partials(name: str, inputs: list[Any], value: Any) -> tuple[Kernel, Pattern]:
    by_state, by_parameters = ca.jacobian(value, inputs[0]), ca.jacobian(value, inputs[1])
    result = ca.densify(ca.vertcat(ca.densify(value), by_state.nz[:], by_parameters.nz[:]))
    triplets = [*by_state.sparsity().get_triplet(), *by_parameters.sparsity().get_triplet()]
    pattern = Pattern(*(np.array(indices, dtype=np.int64) for indices in triplets))
    return compile_function(ca.Function(name, inputs, [result])), pattern


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _chain(pattern: Pattern, work: Array, first: int, columns: Integers, slopes: Array, result: Array) -> None:
    """Derivatives by the unknowns, from those by state and parameters that stand in `work` from `first` on."""
    result[:] = 0.0
    width = slopes.shape[1]
    for k in range(pattern.state_rows.size):
        i, j, value = pattern.state_rows[k], pattern.state_columns[k], work[first + k]
        for c in range(width):
            result[i, c] += value * slopes[j, c]
    first += pattern.state_rows.size
    for k in range(pattern.parameter_rows.size):
        c = columns[pattern.parameter_columns[k]]
        if c >= 0:
            result[pattern.parameter_rows[k], c] += work[first + k]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _march(
    rate: tuple[Code, Pattern],
    view: tuple[Code, Pattern],
    start: tuple[Array, Array],
    parameters: Array,
    drive: Drive,
    columns: Integers,
    grid: tuple[Array, Integers],
    nodes: tuple[Integers, Array],
    work: Array,
    made: Marched,
) -> None:
    y, slopes = start[0].copy(), start[1].copy()
    nx, nc = y.size, made.outputs.shape[1]
    stage, change, total = np.empty(nx), np.empty(nx), np.empty(nx)
    stage_slopes, slope_change, slope_total = np.empty_like(slopes), np.empty_like(slopes), np.empty_like(slopes)
    weights, ahead = np.array([1.0, 2.0, 2.0, 1.0]), np.array([0.0, 0.5, 0.5, 1.0])
    sides = np.array([_NUDGE, 0.0, 0.0, -_NUDGE])
    time, coming = grid[0], 0
    for index in range(time.size):
        if index > 0:
            steps = grid[1][index - 1]
            h = (time[index] - time[index - 1]) / steps
            for step in range(steps):
                before = time[index - 1] + step * h
                total[:] = 0.0
                slope_total[:] = 0.0
                for s in range(4):
                    if s == 0:
                        stage[:] = y
                        stage_slopes[:] = slopes
                    else:
                        for i in range(nx):
                            stage[i] = y[i] + ahead[s] * h * change[i]
                            for c in range(slopes.shape[1]):
                                stage_slopes[i, c] = slopes[i, c] + ahead[s] * h * slope_change[i, c]
                    feed(drive, before + ahead[s] * h, sides[s] * h, parameters)
                    evaluate_code(rate[0], stage, parameters, before + ahead[s] * h, work)
                    change[:] = work[:nx]
                    _chain(rate[1], work, nx, columns, stage_slopes, slope_change)
                    for i in range(nx):
                        total[i] += weights[s] * change[i]
                        for c in range(slopes.shape[1]):
                            slope_total[i, c] += weights[s] * slope_change[i, c]
                for i in range(nx):
                    y[i] += h / 6.0 * total[i]
                    for c in range(slopes.shape[1]):
                        slopes[i, c] += h / 6.0 * slope_total[i, c]
        if coming < nodes[0].size and nodes[0][coming] == index:
            for i in range(nx):
                slopes[i, -1] += y[i] - nodes[1][coming, i]
                y[i] = nodes[1][coming, i]
            made.node_slopes[coming] = slopes
            coming += 1
        feed(drive, time[index], 0.0, parameters)
        evaluate_code(view[0], y, parameters, time[index], work)
        made.states[index] = y
        made.outputs[index] = work[:nc]
        _chain(view[1], work, nc, columns, slopes, made.slopes[index])
