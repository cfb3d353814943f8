r"""Every derivative from the linearised flow: static ones and those of rates, at k = 0 and at any k.

A steady solution and a few linear solves with its exact Jacobian replace the marches of the other methods. With H_j the
transfer functions of `indicial.frequency`,

    C_ja = H_a(0),   C_jq = H_q(0),   C_jad = H_a'(0);    at k:   in phase Re H, out of phase Im H / k,

so ``C_jq + C_jad`` of a forced pitch oscillation at k is exactly ``Im(H_a(ik) + ik H_q(ik))/k``. Linear by nature: the
effects of a finite amplitude are the business of `forced_oscillation` and `reduced_frequency`.

In subsonic flow ``H_a'(0)`` need not exist: in two dimensions it grows like log k, and what a bounded mesh gives at
k = 0 is a property of the mesh. So below Mach 1 two more frequencies are solved and the trend is looked at.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError, NoLimitError
from indicial.frequency import FrequencyResponse, reduced_frequencies
from indicial.motion import FlightCondition
from indicial.solver import FrequencySolver

LOADS = {
    "alpha": ("CA", "CN", "Cm"),
    "q": ("CA", "CN", "Cm"),
    "beta": ("CY", "Cl", "Cn"),
    "p": ("CY", "Cl", "Cn"),
    "r": ("CY", "Cl", "Cn"),
}
"""The loads read for each input: longitudinal with longitudinal, lateral with lateral."""

PROBES = (0.01, 0.02)
"""Reduced frequencies at which the trend of the out-of-phase part towards k = 0 is looked at below Mach 1."""

_NEGLIGIBLE = 0.01


def run(
    solver: FrequencySolver,
    condition: FlightCondition,
    k: ArrayLike = (),
    inputs: tuple[str, ...] = ("alpha", "q"),
) -> FrequencyResponse:
    """Solve for the response to `inputs` at k = 0, and at reduced frequencies `k`; read it with `derivatives`.

    Raises
    ------
    InputError
        If a frequency is negative or not finite, or the flow has no such input.
    """
    ks = reduced_frequencies(k)
    if condition.mach < 1.0:
        ks = np.union1d(ks, PROBES)
    return solver.frequency_response(condition, ks, inputs)


def derivatives(response: FrequencyResponse, source: str = "linearised flow") -> DerivativeTable:
    """The records, method ``operator``: those of k = 0, then for each k > 0 in `response` those at k.

    A derivative at k = 0 that has no limit is left out; `refusals` says why.
    """
    refused = refusals(response)
    records: list[Derivative] = []
    for k in (None, *(float(k) for k in response.k if k > 0.0)):
        for motion in (name for name in response.inputs if name in LOADS):
            for load in LOADS[motion]:
                for name, value in _values(response, load, motion, k).items():
                    if k is not None or name not in refused:
                        records.append(_record(response, name, value, source, k))
    return DerivativeTable(tuple(records)).with_sums()


def value(response: FrequencyResponse, name: str) -> float:
    """One derivative at k = 0, such as ``Cm_q`` or ``CN_alphadot``.

    Raises
    ------
    NoLimitError
        If it has no limit.
    """
    refused = refusals(response)
    if name in refused:
        raise NoLimitError(refused[name])
    return derivatives(response).value(name, k=None)


def refusals(response: FrequencyResponse) -> dict[str, str]:
    """Derivatives that have no limit as k goes to 0, with the reason.

    The out-of-phase part ``g(k) = Im H(ik)/k`` of a flow that forgets fast enough is even and smooth in k, so it
    changes by four times less with each halving of k. One that changes by as much between 0 and k as between k and 2k
    has not settled: the number at k = 0 then shows how far the mesh reaches.
    """
    at = [np.flatnonzero(np.isclose(response.k, probe)) for probe in PROBES]
    if response.condition.mach >= 1.0 or any(found.size == 0 for found in at):
        return {}
    refused = {}
    for motion in (name for name in ("alpha", "beta") if name in response.inputs):
        for load in LOADS[motion]:
            h = response.channel(load, motion)
            limit = response.at_zero(load, motion)[1]
            near, far = (float(h[found[0]].imag) / probe for found, probe in zip(at, PROBES, strict=True))
            scale = max(abs(limit), abs(far), abs(response.at_zero(load, motion)[0]))
            if abs(near - limit) > max(0.5 * abs(far - near), _NEGLIGIBLE * scale):
                name = f"{load}_{motion}dot"
                refused[name] = (
                    f"{name} has no limit as k goes to 0: out of phase {far:.4g} at k = {PROBES[1]:g}, {near:.4g} at "
                    f"k = {PROBES[0]:g}, {limit:.4g} at 0 on this mesh; ask for a value at a reduced frequency"
                )
    return refused


def _values(response: FrequencyResponse, load: str, motion: str, k: float | None) -> dict[str, float]:
    """Derivatives of one channel by name, rates per half length over speed."""
    static, slope = response.at_zero(load, motion)
    if k is not None:
        h = complex(response.channel(load, motion)[int(np.flatnonzero(response.k == k)[0])])
        static, slope = h.real, h.imag / k
    if motion in ("alpha", "beta"):
        return {f"{load}_{motion}": static, f"{load}_{motion}dot": slope}
    return {f"{load}_{motion}": static}


def _record(response: FrequencyResponse, name: str, value: float, source: str, k: float | None) -> Derivative:
    motion = name.partition("_")[2]
    is_angle = motion in ("alpha", "beta")
    per = 1.0 if is_angle or response.reference.rate_normalisation == "c/2V" else 0.5
    return Derivative.at(response.condition, response.reference, name, "operator", value * per, source, k=k)


def pitch_oscillation(response: FrequencyResponse, output: str, k: float) -> tuple[float, float]:
    r"""What a small forced pitch oscillation at k gives: in phase, and out of phase over k (per ``c/2V``).

    ``H_a(ik) + ik H_q(ik)``, whose parts Eqs. (3) and (4) call ``C_ja - k^2 C_jqd`` and ``C_jad + C_jq``.
    """
    place = int(np.argmin(np.abs(response.k - k)))
    if not math.isclose(float(response.k[place]), k, rel_tol=1e-9) or k <= 0.0:
        known = ", ".join(f"{value:g}" for value in response.k)
        raise InputError(f"k = {k:g} is not among the reduced frequencies solved for: {known}")
    h = complex(response.channel(output, "alpha")[place] + 1j * k * response.channel(output, "q")[place])
    return h.real, h.imag / k
