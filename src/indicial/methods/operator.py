r"""Every derivative from the linearised flow: static ones and those of rates, at k = 0 and at any k.

A steady solution and a few linear solves with its exact Jacobian replace the marches of the other methods. With H_j the
transfer functions of `indicial.frequency`,

    C_ja = H_a(0),   C_jq = H_q(0),   C_jad = H_a'(0);    at k:   in phase Re H, out of phase Im H / k,

so ``C_jq + C_jad`` of a forced pitch oscillation at k is exactly ``Im(H_a(ik) + ik H_q(ik))/k``. Linear by nature: the
effects of a finite amplitude are the business of `forced_oscillation` and `reduced_frequency`.

In two-dimensional subsonic flow ``H_a'(0)`` of a load exists only where its static derivative is zero: see `refusals`.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError, NoLimitError
from indicial.frequency import FrequencyResponse, reduced_frequencies, without_limit
from indicial.motion import FlightCondition
from indicial.solver import FrequencySolver

LOADS = {
    "alpha": ("CA", "CN", "Cm"),
    "alphadot": ("CA", "CN", "Cm"),
    "q": ("CA", "CN", "Cm"),
    "beta": ("CY", "Cl", "Cn"),
    "p": ("CY", "Cl", "Cn"),
    "r": ("CY", "Cl", "Cn"),
}
"""The loads read for each input: longitudinal with longitudinal, lateral with lateral."""


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
    return solver.frequency_response(condition, reduced_frequencies(k), inputs)


def derivatives(response: FrequencyResponse, source: str = "linearised flow") -> DerivativeTable:
    """The records, method ``operator``: those of k = 0, then for each k > 0 in `response` those at k.

    A derivative at k = 0 that has no limit is left out; `refusals` says why.
    """
    refused = refusals(response)
    records: list[Derivative] = []
    # alpha tells of alphadot too, at no loss
    motions = [name for name in response.inputs if name != "alphadot" or "alpha" not in response.inputs]
    for k in (None, *dict.fromkeys(float(k) for k in response.k if k > 0.0)):
        for motion in motions:
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
    """Derivatives that have no limit as k goes to 0, with the reason: see `indicial.frequency.without_limit`."""
    if "alpha" in response.inputs:
        slopes = {load: response.at_zero(load, "alpha")[0] for load in LOADS["alpha"]}
        return without_limit(response.condition, response.plane, slopes)
    if response.condition.mach >= 1.0 or not response.plane:
        return {}
    unknown = "may have no limit as k goes to 0 in two-dimensional subsonic flow: ask for the input alpha, which tells"
    asked = LOADS["alphadot"] if "alphadot" in response.inputs else ()
    return {f"{load}_alphadot": f"{load}_alphadot {unknown}" for load in asked}


def _values(response: FrequencyResponse, load: str, motion: str, k: float | None) -> dict[str, float]:
    """Derivatives of one channel by name, rates per half length over speed."""
    static, slope = response.at_zero(load, motion)
    if k is not None:
        h = complex(response.channel(load, motion)[int(np.flatnonzero(response.k == k)[0])])
        static, slope = h.real, h.imag / k
    if motion == "alpha":
        return {f"{load}_alpha": static, f"{load}_alphadot": slope}
    if motion == "beta":
        # the response is in the time 2Vt/c; with the other lateral rates, betadot is made dimensionless by b
        lengths = response.reference.moment_lengths
        return {f"{load}_beta": static, f"{load}_betadot": slope * float(lengths[1] / lengths[2])}
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
    place = int(np.argmin(np.abs(response.k - k))) if response.k.size else -1
    if place < 0 or not math.isclose(float(response.k[place]), k, rel_tol=1e-9) or k <= 0.0:
        known = ", ".join(f"{value:g}" for value in response.k) or "none"
        raise InputError(f"k = {k:g} is not among the reduced frequencies solved for: {known}")
    h = complex(response.channel(output, "alpha")[place] + 1j * k * response.channel(output, "q")[place])
    return h.real, h.imag / k
