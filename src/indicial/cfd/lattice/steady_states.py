r"""Steady states of a lattice with section data: where stall gives several, all that its starts lead to.

With separation points given, the lift of every strip rises with its incidence and the lattice has one state; the points
then relax towards x0 of the incidences met, which is the motion of the separation model with the wake at rest in body
axes, all strips at one rate. What it comes to is polished by Newton's method on the static lifts. Stall makes
several states possible: those found from attached, separated and lop-sided starts are kept if they differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from indicial.cfd.lattice.coupling import StripProblem
from indicial.cfd.lattice.instant import Instant
from indicial.cfd.lattice.separation import SeparationLag, StripSections
from indicial.conventions import Array
from indicial.errors import DivergenceError

_RELAXATION = 0.3
_ITERATIONS = 3000
_SETTLED = 1e-9
_NEAR = 1e-3
_ALIKE = 1e-4


@dataclass(frozen=True)
class SteadyStrips:
    """One steady state of all strips.

    Parameters
    ----------
    start : str
        From where it was found.
    across, circulation, alpha, point : ndarray
        v [m/s], Gamma [m^2/s], incidence met [rad] and separation point, shape (S,).
    growth : float
        Largest real part of the eigenvalues of the separation points' motion about it, the wake at rest in body axes,
        per chord travelled: stable if negative.
    iterations : int
    """

    start: str
    across: Array
    circulation: Array
    alpha: Array
    point: Array
    growth: float
    iterations: int


def starts(instant: Instant) -> Mapping[str, Array]:
    """Separation points (S,) to start from: attached, separated, and one half of each."""
    middle = instant.influence.lattice.strips.quarter_chord[:, 1]
    ones = np.ones_like(middle)
    return {
        "attached": ones,
        "separated": 0.0 * ones,
        "left attached": np.where(middle < 0.0, 1.0, 0.0),
        "right attached": np.where(middle > 0.0, 1.0, 0.0),
    }


def settle(
    problem: StripProblem, sections: StripSections, point: Array, start: str, lag: SeparationLag
) -> SteadyStrips:
    """The steady state that the separation points come to from a start.

    Raises
    ------
    DivergenceError
        If they come to none.
    """
    across = problem.free / (2.0 * np.pi * problem.size)
    x, next_try = point, _NEAR
    count = 0
    while True:
        count += 1
        across, circulation = problem.solve(sections, across, x)
        goal, _ = sections.static(sections.seen(problem.incidence(across)))
        change = goal - x
        size = float(np.max(np.abs(change)))
        if size < next_try:
            # near enough for Newton's method? it must not jump to another state
            found = _polished(problem, sections, across, x, min(300.0 * size, 0.03))
            if found is not None or size < _SETTLED:
                break
            next_try *= 0.1
        x = x + _RELAXATION * change
        if count == _ITERATIONS:
            worst = float(np.max(np.abs(change)))
            raise DivergenceError(
                f"no steady state from the start {start!r}: separation points still move by {worst:.1e}"
            )
    across, circulation = found or problem.solve(sections, across, None)
    alpha = problem.incidence(across)
    point, _ = sections.static(sections.seen(alpha))
    return SteadyStrips(start, across, circulation, alpha, point, growth(problem, sections, across, point, lag), count)


def _polished(
    problem: StripProblem, sections: StripSections, across: Array, point: Array, within: float
) -> tuple[Array, Array] | None:
    """v and Gamma of the static lifts; None if separation points are not within so much of those given."""
    try:
        v, circulation = problem.solve(sections, across, None)
    except DivergenceError:
        return None
    moved = sections.static(sections.seen(problem.incidence(v)))[0] - point
    return (v, circulation) if float(np.max(np.abs(moved))) <= within else None


def growth(problem: StripProblem, sections: StripSections, across: Array, point: Array, lag: SeparationLag) -> float:
    """Largest real part of the eigenvalues of alpha' and x about a steady state, per chord travelled."""
    alpha = problem.incidence(across)
    speed = np.hypot(problem.along, across)
    _, slope = problem.circulation(sections, across, point)
    inner = problem.inner
    pushed = inner * (problem.size * speed * sections.lift_of_point(alpha, point))
    moved = -np.linalg.solve(inner * slope + problem.response, pushed)
    turned = (problem.along / speed**2)[:, None] * moved
    turned = turned if sections.mean is None else sections.mean @ turned
    _, answer = sections.static(sections.seen(alpha))
    one = np.eye(across.size)
    matrix = np.block([[-one / lag.delay, turned / lag.delay], [np.diag(answer) / lag.response, -one / lag.response]])
    return float(np.max(np.linalg.eigvals(matrix).real))


def distinct(states: list[SteadyStrips]) -> tuple[SteadyStrips, ...]:
    """Those that differ in circulation by more than one part in ten thousand of its largest."""
    kept: list[SteadyStrips] = []
    for state in states:
        size = float(np.max(np.abs(state.circulation))) + 1e-300
        if all(float(np.max(np.abs(state.circulation - other.circulation))) > _ALIKE * size for other in kept):
            kept.append(state)
    return tuple(kept)
