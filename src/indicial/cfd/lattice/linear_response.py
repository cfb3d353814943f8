"""Frequency responses of a linearised lattice, labelled."""

from __future__ import annotations

from typing import Any

import numpy as np

from indicial.cfd.lattice.linear import LinearLattice
from indicial.conventions import Array
from indicial.frequency import FrequencyResponse

_SLOW = 1e-4
"""Reduced frequency at which H'(0) is read as ``Im H/k``: finite wings are even in k up to ``k^3 log k`` there."""


def frequency_response(
    linear: LinearLattice, inputs: tuple[str, ...], k: Array, provenance: dict[str, Any]
) -> FrequencyResponse:
    """H(ik) at reduced frequencies k (n,), with H(0) and H'(0)."""
    motions = tuple(dict.fromkeys(name.removesuffix("dot") for name in inputs))
    at = {name: j for j, name in enumerate(motions)}
    static = linear.response(0.0, motions).real
    slope = linear.response(_SLOW, motions).imag / _SLOW
    found = np.stack([linear.response(float(one), motions) for one in k]) if len(k) else np.zeros((0, 6, len(motions)))
    n, m = len(k), len(inputs)
    values = np.zeros((n, 6, m), dtype=complex)
    zeroth, first, direct = np.zeros((6, m)), np.full((6, m), np.nan), np.full((6, m), np.nan)
    moving = k > 0.0
    for j, name in enumerate(inputs):
        source = at[name.removesuffix("dot")]
        if name in at:
            values[..., j], zeroth[:, j], first[:, j] = found[..., source], static[:, source], slope[:, source]
            continue
        values[moving, :, j] = (found[moving, :, source] - static[:, source]) / (1j * k[moving, None])
        values[~moving, :, j] = zeroth[:, j] = slope[:, source]
        direct[:, j] = linear.impulse(motions[source])
    return FrequencyResponse(
        k=k,
        inputs=inputs,
        values=values,
        static=zeroth,
        slope=first,
        direct=direct,
        baseline=linear.baseline,
        condition=linear.condition,
        reference=linear.reference,
        provenance=provenance,
    )
