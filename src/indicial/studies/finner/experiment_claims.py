"""What the experiments say, as figures: reported, since nothing was asked of them beforehand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from indicial.conventions import Array
from indicial.reference_data import read_table
from indicial.studies.claim import Claim, largest, relative_rms
from indicial.studies.finner.experiment_figures import THICKNESSES, jump
from indicial.studies.finner.experiments import INCIDENCES, OF_UNKNOWN_SIZE, SLOW, SMALL_RATES
from indicial.studies.finner.pieces import OUTLYING
from indicial.studies.finner.selection import derivative
from indicial.studies.finner.wedge import sonic_mach
from indicial.studies.kept import Results

SUM = "Cm_q+Cm_alphadot"


def claims(results: Results) -> list[Claim]:
    """Reported figures of all experiments."""
    return [_jump(results), *_outlying(results), *_small_turns(results), _loose(results), _reductions()]


def _small_turns(results: Results) -> list[Claim]:
    """The moving frame against the operator where its usual rate is too large to be linear, with smaller ones."""
    listed = []
    for mach, rates in SMALL_RATES.items():
        found = [(1e-3, results.select(method="mrf").at(mach))]
        found += [(rate, results.select(method=f"mrf_rate_{rate:g}").at(mach)) for rate in rates]
        base = results.select(method="operator", mesh="sting", level="quick").at(mach)
        title = f"Cm_q at M {mach:g}: MRF against H_q(0), slowest turn"
        if base is None or any(one is None for _, one in found):
            listed.append(Claim(title, None, None))
            continue
        wanted = derivative(base, "Cm_q", k=None)
        off = [(rate, derivative(one, "Cm_q") / wanted - 1.0) for rate, one in found if one is not None]
        said = ", ".join(f"{change:+.2%} at q d/2V = {rate:g}" for rate, change in off)
        listed.append(Claim(title, abs(off[-1][1]), None, said))
    return listed


def _loose(results: Results) -> Claim:
    """What a steady state at the looser tolerance does to the damping sum, where the settled one is known."""
    title = "damping sum at M 4: steady state to 1e-6, not 1e-10"
    loose = results.select(method="operator_loose").at(4.0)
    settled = results.select(method="operator", mesh="base", level="medium").at(4.0)
    if loose is None or settled is None:
        return Claim(title, None, None)
    return Claim(title, abs(derivative(loose, SUM, k=None) / derivative(settled, SUM, k=None) - 1.0), None)


def _jump(results: Results) -> Claim:
    """How far from the Mach number of a sonic wedge flow the largest Cm_alphadot lies."""
    title = "largest Cm_alphadot: Mach number above that of a sonic wedge flow"
    thick, apart = [], []
    for kind, (thickness, _) in THICKNESSES.items():
        mach, value = jump(results, kind)
        if thickness and len(mach) > 2:
            thick.append(thickness)
            apart.append(peak(mach, value) - sonic_mach(math.atan(0.5 * thickness)))
    if not apart:
        return Claim(title, None, None, unit="Mach")
    worst = int(np.argmax(np.abs(apart)))
    where = f"worst with fins {thick[worst]:g} thick of {len(thick)}; least {min(apart):.3f}"
    return Claim(title, abs(apart[worst]), None, where, unit="Mach")


def peak(mach: Array, value: Array) -> float:
    """Mach number of the largest value: of the parabola through it and its neighbours, if it has both."""
    top = int(np.argmax(value))
    if not 0 < top < len(value) - 1:
        return float(mach[top])
    near = slice(top - 1, top + 2)
    curved, sloped, _ = np.polyfit(mach[near] - mach[top], value[near], 2)
    return float(mach[top] - 0.5 * sloped / curved)


def _outlying(results: Results) -> list[Claim]:
    """What moves the damping sum at the outlying groups, relative to that at k = 0 without incidence."""
    listed = []
    for alpha in INCIDENCES[OUTLYING[0]]:
        listed.append(_moved(results, f"about {alpha:g} deg", f"operator_at_{alpha:g}deg", "base"))
    for variant in OF_UNKNOWN_SIZE:
        listed.append(_moved(results, f"fins changed, {variant}", "operator", f"base+{variant}"))
    listed.append(_moved(results, f"at k = {SLOW[0]:g}", "operator_slow", "base", SLOW[0]))
    listed.append(_moved(results, "with a sting", "operator_without_k", "sting"))
    return listed


def _moved(results: Results, words: str, method: str, mesh: str, k: float | None = None) -> Claim:
    found = results.select(method=method, mesh=mesh, level="coarse")
    base = results.select(method="operator", mesh="base", level="coarse")
    machs, apart = [], []
    for mach in OUTLYING:
        there, usual = found.at(mach), base.at(mach)
        if there is not None and usual is not None:
            machs.append(mach)
            apart.append(derivative(there, SUM, k=k) / derivative(usual, SUM, k=None) - 1.0)
    claim = largest(f"damping sum at M {OUTLYING[0]:g} and {OUTLYING[1]:g}: {words}", None, machs, np.array(apart))
    return replace(claim, note=", ".join(f"{one:+.1%}" for one in apart), complete=len(machs) == len(OUTLYING))


def _reductions() -> Claim:
    """The same shots by linear theory and by six degrees of freedom, where neither held the damping."""
    shots, linear = read_table("basic_finner_range_shots"), read_table("basic_finner_range_linear")
    row = {name: i for i, name in enumerate(linear.text("shot"))}
    six, by_linear = shots.numbers("cmq_sum"), linear.numbers("cmq_plus_cmadot")
    machs, found, wanted = [], [], []
    for i, name in enumerate(shots.text("shot")):
        free = np.isfinite(shots.numbers("cmq_pe_pct")[i]) and "held" not in shots.text("note")[i]
        if free and linear.text("quality_flag")[row[name]] == "ok":
            machs.append(float(shots.numbers("mach")[i]))
            found.append(by_linear[row[name]])
            wanted.append(six[i])
    title = "flights: damping sum by linear theory against 6-DOF, same shots"
    return relative_rms(title, None, machs, np.array(found), np.array(wanted))
