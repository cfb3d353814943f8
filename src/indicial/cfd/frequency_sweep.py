r"""Frequency responses and sensitivities read from a linearised flow.

Each new solution starts from the best combination of those already found: where H(ik) varies slowly, as it does at
low reduced frequency, it is nearly there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from indicial.cfd.march.known_solutions import KnownSolutions
from indicial.cfd.march.steady import Progress
from indicial.cfd.operator import FlowOperator, SolveCount
from indicial.conventions import COEFFICIENTS, Array
from indicial.errors import InputError
from indicial.frequency import FrequencyResponse, check_inputs, reduced_frequencies

_TRANSLATIONS = {"alphadot": "alpha"}


def frequency_response(
    operators: Sequence[FlowOperator],
    inputs: tuple[str, ...],
    k: object,
    progress: Progress | None = None,
) -> FrequencyResponse:
    """H(ik) of the operators that together hold all `inputs`, with H(0) and H'(0).

    Raises
    ------
    InputError
        If an input is unknown or not one of a plane flow, or a frequency is negative or not finite.
    DivergenceError
        If a linear system cannot be solved.
    """
    check_inputs(inputs)
    ks = reduced_frequencies(k)  # type: ignore[arg-type]
    known = {name: operator for operator in operators for name in operator.inputs}
    motions = tuple(dict.fromkeys(_TRANSLATIONS.get(name, name) for name in inputs))
    for name in motions:
        if name not in known:
            raise InputError(f"this flow has no input {name!r}: a plane flow has {', '.join(known)} (and alphadot)")
    found: dict[str, _Channel] = {}
    for count, operator in enumerate(operators):
        names = tuple(name for name in motions if name in operator.inputs)
        found |= _channels(operator, names, ks, _part(progress, count, len(operators)))
    m = len(inputs)
    values = np.zeros((len(ks), 6, m), dtype=complex)
    static, slope, direct = np.zeros((6, m)), np.full((6, m), np.nan), np.full((6, m), np.nan)
    for j, name in enumerate(inputs):
        c = found[_TRANSLATIONS.get(name, name)]
        if name in _TRANSLATIONS:
            moving = ks > 0.0
            values[moving, :, j] = (c.values[moving] - c.static) / (1j * ks[moving, None])
            values[~moving, :, j] = c.slope
            static[:, j], direct[:, j] = c.slope, 0.0
        else:
            values[..., j], static[:, j], slope[:, j], direct[:, j] = c.values, c.static, c.slope, c.direct
    first = operators[0]
    spent = sum((operator.spent for operator in operators), SolveCount())
    provenance = {"solver": "linearised finite volumes", "cells": first.size // 5, "tolerance": first.tolerance}
    return FrequencyResponse(
        k=ks,
        inputs=inputs,
        values=values,
        static=static,
        slope=slope,
        direct=direct,
        baseline=first.baseline,
        condition=first.condition,
        reference=first.reference,
        plane=first.plane,
        provenance=provenance | asdict(spent),
    )


@dataclass(frozen=True)
class _Channel:
    """H at ks (n, 6), H(0), H'(0) and D, each (6,), from one input."""

    values: NDArray[np.complex128]
    static: Array
    slope: Array
    direct: Array


def _channels(
    operator: FlowOperator, names: tuple[str, ...], ks: Array, progress: Progress | None
) -> dict[str, _Channel]:
    """Frequency by frequency, so that all inputs share a frequency's factorisation."""
    rows = [COEFFICIENTS.index(output) for output in operator.outputs]
    known = KnownSolutions(lambda x: operator.apply_mass(x.ravel()).reshape(-1, 5))

    def solve(rhs: Array, shift: complex = 0.0) -> NDArray[Any]:
        guess = known.guess(rhs.reshape(-1, 5), shift)
        x = operator.solve(rhs, shift, start=None if guess is None else guess.ravel())
        image = rhs - shift * operator.apply_mass(x) if shift else rhs
        known.add(x.reshape(-1, 5), image.reshape(-1, 5))
        return x

    found = {}
    for name in names:
        j = operator.inputs.index(name)
        static, slope, direct = np.zeros(6), np.zeros(6), np.zeros(6)
        x0 = solve(-operator.b[:, j])
        x1 = solve(-operator.apply_mass(x0))
        direct[rows] = operator.d[:, j]
        static[rows] = operator.d[:, j] + operator.c @ x0
        slope[rows] = operator.c @ x1
        found[name] = _Channel(np.zeros((len(ks), 6), dtype=complex), static, slope, direct)
    for done, m in enumerate(np.argsort(ks, kind="stable")):
        shift = 1j * float(ks[m])
        for name in names:
            if shift == 0.0:
                found[name].values[m] = found[name].static
                continue
            j = operator.inputs.index(name)
            found[name].values[m, rows] = operator.d[:, j] + operator.c @ solve(-operator.b[:, j], shift)
        if progress is not None:
            progress((done + 1) / len(ks))
    return found


def _part(progress: Progress | None, done: int, parts: int) -> Progress | None:
    """Progress of one of several parts."""
    return None if progress is None else lambda fraction: progress((done + fraction) / parts)
