r"""The modes of an aircraft about any steady flight, named by the states that take part in them.

The participation of state k in the mode of eigenvalue lambda, with right and left eigenvectors v and w, is

    p_k = |w_k v_k| / sum_j |w_j v_j|,

which does not depend on the units of the states (Perez-Arriaga et al. 1982; w_k v_k is also the derivative of lambda
with respect to a_kk, over w.v). States belong to groups, each with room for as many eigenvalues as it has states:

    phugoid: V, theta    short period: alpha, q    Dutch roll: beta, r    roll: p    spiral: phi    lag, altitude

Eigenvalues are shared out so that the sum of participations in their groups is largest. A pair that takes places of two
groups, or a mode to which another group lends more than a third, is called by all of them: "roll-spiral".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim.epicycle import Complex
from indicial.flightsim.linear import LinearFlight
from indicial.flightsim.modes import Mode, Modes

GROUPS: Mapping[str, tuple[str, ...]] = {
    "short period": ("alpha", "q"),
    "phugoid": ("V", "theta"),
    "Dutch roll": ("beta", "r"),
    "roll": ("p",),
    "spiral": ("phi",),
    "altitude": ("altitude",),
}
"""Names of modes and the states they are mostly made of; all other states are lag states."""

_COUPLED = 1.0 / 3.0  # participation of another group from which a mode bears its name too
_ANGLES = ("alpha", "theta", "beta", "phi")


def aircraft_modes(linear: LinearFlight) -> Modes:
    """Named modes of a linear model, each with its shape and participations.

    Names are those of `GROUPS` and "lag", joined by "-" where modes couple, and numbered from the slowest to die out
    where several have the same: "lag 1", "short period 2".

    Raises
    ------
    InputError
        If the nose is vertical: such a body has no phugoid and no spiral.
    """
    if "phi" not in linear.states:
        raise InputError(
            "with the nose vertical modes have no names of an aircraft: take the eigenvalues of LinearFlight.a"
        )
    values, shapes, participation = _eigen(linear.a)
    speed, modes = linear.trim.variables["speed"], []
    for i, name in _names(linear.states, values, participation).items():
        shares = dict(zip(linear.states, (float(share) for share in participation[:, i]), strict=True))
        modes.append(Mode(name, complex(values[i]), speed, _shape(linear.states, shapes[:, i], speed), shares))
    return Modes(tuple(_numbered(modes)), speed, linear.trim["p"])


def _eigen(matrix: Array) -> tuple[Complex, Complex, Array]:
    """Eigenvalues, right eigenvectors in columns and participations, shape (states, modes)."""
    from scipy.linalg import eig

    values, left, right = eig(matrix, left=True, right=True)
    shares = np.abs(left) * np.abs(right)
    return values, right, shares / shares.sum(axis=0)


def _names(states: tuple[str, ...], values: Complex, participation: Array) -> dict[int, str]:
    """A name for each real eigenvalue and for the first of each pair, which LAPACK puts side by side."""
    from scipy.optimize import linear_sum_assignment

    group_of = [next((name for name, members in GROUPS.items() if state in members), "lag") for state in states]
    order = (*GROUPS, "lag")
    shares = {group: participation[[own == group for own in group_of]].sum(axis=0) for group in order}
    _, place = linear_sum_assignment(np.array([shares[group] for group in group_of]).T, maximize=True)
    names = {}
    for i in np.flatnonzero(values.imag >= 0.0):
        held = {group_of[place[j]] for j in ((i, i + 1) if values[i].imag else (i,))}
        names[int(i)] = "-".join(group for group in order if group in held or shares[group][i] > _COUPLED)
    return names


def _shape(states: tuple[str, ...], vector: Complex, speed: float) -> dict[str, complex]:
    """Eigenvector whose largest of V/speed and the angles (of anything, if these are at rest) is 1."""
    size = np.array([1.0 / speed if name == "V" else float(name in _ANGLES) for name in states])
    seen = vector * size
    if np.max(np.abs(seen)) < 1e-9 * np.max(np.abs(vector)):
        seen = vector
    scaled = vector / seen[int(np.argmax(np.abs(seen)))]
    return dict(zip(states, (complex(value) for value in scaled), strict=True))


def _numbered(modes: list[Mode]) -> list[Mode]:
    """In the order of the groups; numbers for those of one name, and for lag modes always."""
    order = (*GROUPS, "lag")
    first = {mode.name: min(order.index(g) for g in order if mode.name.startswith(g)) for mode in modes}
    ordered = sorted(modes, key=lambda m: (first[m.name], m.name, -m.eigenvalue.real))
    counts = {name: sum(mode.name == name for mode in ordered) for name in first}
    seen: dict[str, int] = {}
    numbered = []
    for mode in ordered:
        seen[mode.name] = seen.get(mode.name, 0) + 1
        alone = counts[mode.name] == 1 and mode.name != "lag"
        name = mode.name if alone else f"{mode.name} {seen[mode.name]}"
        numbered.append(replace(mode, name=name))
    return numbered
