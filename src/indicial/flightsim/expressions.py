r"""What any value of a model may depend on: time and flight condition, and tables of them.

A model's value is a number, a symbol of the user's own (which the model then carries as a parameter: a control, a
derivative to be identified, a mass to be varied), or any casadi expression of such symbols and of

    TIME [s], ALTITUDE [m], MACH, ALPHA = atan2(w, u), BETA = asin(v/V), TOTAL_ANGLE [rad],

those of the moment reference point through the air. ``Cm_q=table(MACH, machs, values)`` is a derivative that changes
with the Mach number, ``mass=table(TIME, times, masses)`` a vehicle that burns.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import ArrayLike

from indicial.conventions import Array
from indicial.errors import InputError

TIME = ca.SX.sym("TIME")
ALTITUDE = ca.SX.sym("ALTITUDE")
MACH = ca.SX.sym("MACH")
ALPHA = ca.SX.sym("ALPHA")
BETA = ca.SX.sym("BETA")
TOTAL_ANGLE = ca.SX.sym("TOTAL_ANGLE")

CONDITIONS = (ALTITUDE, MACH, ALPHA, BETA, TOTAL_ANGLE)
"""What the flight itself says; `build_dynamics` puts it in."""

_RESERVED = {symbol.name() for symbol in (TIME, *CONDITIONS)}


def free_symbols(values: Iterable[Any]) -> tuple[Any, ...]:
    """Casadi symbols among values, each once, in their order; those of this module left out.

    Raises
    ------
    InputError
        If two different symbols have one name.
    """
    symbols: dict[str, Any] = {}
    for value in values:
        if not isinstance(value, ca.SX):
            continue
        for symbol in ca.symvar(value):
            known = symbols.setdefault(symbol.name(), symbol)
            if not ca.is_equal(known, symbol):
                raise InputError(f"two different symbols of the model are called {symbol.name()!r}: make it one symbol")
    return tuple(symbol for name, symbol in symbols.items() if name not in _RESERVED)


def is_number(value: Any) -> bool:
    """Whether a value of a model is a plain number."""
    return not isinstance(value, ca.SX) or bool(value.is_constant())


def table(arguments: Any, nodes: Any, values: ArrayLike) -> Any:
    """Linear interpolation in a table, as an expression without branches; beyond the ends the last value holds.

    Give the model a `Validity` of the table's reach: a flight that leaves it is then flagged.

    Parameters
    ----------
    arguments : expression or sequence of them
        What to look up: one argument, or one for each axis of the table.
    nodes : array_like or sequence of them
        Where the values stand along each axis, increasing.
    values : array_like
        One number for each combination of nodes, shape (n_1, n_2, ...).

    Raises
    ------
    InputError
        If nodes do not increase, a value is missing, or the shapes do not fit.
    """
    several = isinstance(arguments, Sequence)
    wanted = list(arguments) if several else [arguments]
    axes = [np.asarray(axis, dtype=float) for axis in (nodes if several else [nodes])]
    numbers = np.asarray(values, dtype=float)
    if len(wanted) != len(axes) or numbers.shape != tuple(axis.size for axis in axes):
        raise InputError(
            f"a table of {len(wanted)} arguments has nodes of shape {tuple(axis.size for axis in axes)} and values of "
            f"shape {numbers.shape}"
        )
    for axis in axes:
        if axis.ndim != 1 or axis.size < 2 or not np.all(np.diff(axis) > 0.0) or not np.all(np.isfinite(axis)):
            raise InputError(f"nodes of a table must be two or more, finite and increasing, not {axis}")
    if not np.all(np.isfinite(numbers)):
        raise InputError("a value of the table is missing or not finite")
    if len(axes) == 1:
        return _along(wanted[0], axes[0], numbers)
    weights = [hat_weights(argument, axis) for argument, axis in zip(wanted, axes, strict=True)]
    total = ca.SX(0.0)
    for index in itertools.product(*(range(axis.size) for axis in axes)):
        if numbers[index] != 0.0:
            product = ca.SX(float(numbers[index]))
            for one, i in zip(weights, index, strict=True):
                product = product * one[i]
            total += product
    return total


def _along(argument: Any, nodes: Array, values: Array) -> Any:
    """The first value, and from each interval what has been climbed in it."""
    slopes = np.diff(values) / np.diff(nodes)
    total = ca.SX(float(values[0]))
    for start, length, slope in zip(nodes, np.diff(nodes), slopes, strict=False):
        if slope != 0.0:
            total += float(slope) * ca.fmin(ca.fmax(argument - float(start), 0.0), float(length))
    return total


def hat_weights(argument: Any, nodes: Array) -> list[Any]:
    """What each node counts in linear interpolation; their sum is 1, beyond the ends the last node counts alone."""
    inside = ca.fmin(ca.fmax(argument, float(nodes[0])), float(nodes[-1]))
    weights = []
    for i, node in enumerate(nodes):
        sides = []
        if i > 0:
            sides.append((inside - float(nodes[i - 1])) / float(node - nodes[i - 1]))
        if i < nodes.size - 1:
            sides.append((float(nodes[i + 1]) - inside) / float(nodes[i + 1] - node))
        weight = sides[0] if len(sides) == 1 else ca.fmin(*sides)
        weights.append(ca.fmax(weight, 0.0))
    return weights
