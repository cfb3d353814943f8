"""The least of filter error's J: damped scoring steps that learn how J bends where the model is wrong.

Dennis, Gay & Welsch, ACM Trans. Math. Softw. 7 (1981) 348, for what the information misses of the second derivative;
here by symmetric rank-one updates.
"""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass

import numpy as np

from indicial.conventions import Array
from indicial.errors import DivergenceError, InputError
from indicial.identification.filter_error_problem import FilterErrorProblem, Unknown
from indicial.identification.maximum_likelihood import gauss_newton_step

log = logging.getLogger(__name__)

_SHORT = 1e-3  # standard errors; a step shorter than this is the last
_MAX_STEPS = 100
_MAX_DAMPING = 1e9
_DIFFERENCE = 1e-3  # standard errors
_FIRST_DIFFERENCE = 1e-5
_LEAST_BEND, _MOST_BEND = 0.1, 10.0  # of J against the information, in any direction
_MOST = 1.0  # change of a logarithm in one step
_UNSEEN = 0.03  # information on a logarithm, as 1 over its standard error, below which noise is not seen
_NO_EFFECT = 1e-6
_LEAST_NOISE = 1e-3  # of the stated


@dataclass(frozen=True)
class Minimum:
    """Where J is least.

    Parameters
    ----------
    problem : FilterErrorProblem
        With the unknowns that are left.
    at : ndarray
        Coordinates, shape (n,).
    slopes : ndarray
        Rows there whose squares are the information, shape (number, n).
    cost : tuple of float
        J after each step.
    unseen : tuple of str
        Noise that the records do not show.
    """

    problem: FilterErrorProblem
    at: Array
    slopes: Array
    cost: tuple[float, ...]
    unseen: tuple[str, ...]


def minimise(problem: FilterErrorProblem) -> Minimum:
    """Damped scoring from the start; noise that is not seen is set to where it goes, and left there.

    Raises
    ------
    InputError
        If an unknown has no effect, or nothing is left.
    DivergenceError
        If the filter breaks down at the start, or the steps do not settle.
    """
    at = problem.start
    slopes, right, first = _first_system(problem, at)
    cost, damping, unseen = [first], 0.0, list[str]()
    bend = np.zeros((at.size, at.size))  # of J, beyond the information
    for _ in range(_MAX_STEPS):
        lost = [_is_unseen(u, slopes[:, j], right) for j, u in enumerate(problem.unknowns)]
        if any(lost):
            unseen += [u.name for u, gone in zip(problem.unknowns, lost, strict=True) if gone]
            problem, at = problem.without(at, lost)
            slopes, right, after = _system_without(problem, at, slopes[:, ~np.array(lost)], unseen[-1])
            bend = np.zeros((at.size, at.size))
            cost.append(after)
            continue
        _, length = gauss_newton_step(slopes, right, damping)
        step = _bent_step(slopes, right, bend, damping)
        logarithms = np.array([u.logarithmic for u in problem.unknowns])
        step[logarithms] = np.clip(step[logarithms], -_MOST, _MOST)
        seen = problem.look(at + step)
        after = math.inf if seen is None else problem.cost(at + step, seen)
        if seen is not None and (after <= cost[-1] or length < _SHORT):
            at = at + step
            _check_noise(problem, at)
            log.info("filter error: J = %.6g after a step of %.2g standard errors", after, length)
            before, along = right @ slopes, slopes @ step
            promised = float(right @ along) - 0.5 * float(along @ along + step @ bend @ step)
            slopes, right = problem.system(at, seen, _differences(slopes))
            cost.append(after)
            if length < _SHORT:
                return Minimum(problem, at, slopes, tuple(cost), tuple(unseen))
            damping = _next_damping(damping, (cost[-2] - after) / promised)
            bend = _learnt(bend, step, before - right @ slopes - slopes.T @ (slopes @ step))
            continue
        damping = max(1e-3, 10.0 * damping)
        if damping > _MAX_DAMPING:
            break
    raise DivergenceError(
        f"filter error did not converge (J {cost[0]:.6g} to {cost[-1]:.6g}): free less, or give better start values"
    )


def _first_system(problem: FilterErrorProblem, at: Array) -> tuple[Array, Array, float]:
    """Rows and right side at the start, and J; twice, as only the first tells how long differences should be."""
    seen = problem.look(at)
    if seen is None:
        raise DivergenceError("the filter breaks down at the start values: give better ones, or larger start errors")
    size = np.array([1.0 if u.logarithmic else max(1.0, abs(u.start)) for u in problem.unknowns])
    slopes, _ = problem.system(at, seen, _FIRST_DIFFERENCE * size)
    _check_effects(problem, slopes, size)
    return *problem.system(at, seen, _differences(slopes)), problem.cost(at, seen)


def _system_without(problem: FilterErrorProblem, at: Array, slopes: Array, lost: str) -> tuple[Array, Array, float]:
    """Rows, right side and J of what is left."""
    if not at.size:
        raise InputError(f"the records show no {lost}, and nothing else was asked")
    seen = problem.look(at)
    if seen is None:
        raise DivergenceError(f"the filter breaks down without {lost}: hold it at a positive value")
    return *problem.system(at, seen, _differences(slopes)), problem.cost(at, seen)


def _next_damping(damping: float, kept: float) -> float:
    """After a step that kept this share of the fall of J that it promised."""
    if kept < 0.25:
        return max(1e-3, 4.0 * damping)
    if kept < 0.75:
        return damping
    return 0.0 if damping < 1e-3 else damping / 10.0


def _bent_step(slopes: Array, right: Array, bend: Array, damping: float) -> Array:
    """Damped Newton step with the information and what J was found to bend beyond it."""
    size = np.linalg.norm(slopes, axis=0)
    scaled = slopes / size
    information = scaled.T @ scaled
    left = np.linalg.cholesky(information + (damping + np.finfo(float).eps * len(slopes)) * np.eye(size.size))
    half = np.linalg.solve(left, np.linalg.solve(left, bend / np.outer(size, size)).T)
    bends, directions = np.linalg.eigh(np.eye(size.size) + 0.5 * (half + half.T))
    along = directions.T @ np.linalg.solve(left, scaled.T @ right)
    step: Array = np.linalg.solve(left.T, directions @ (along / np.clip(bends, _LEAST_BEND, _MOST_BEND))) / size
    return step


def _learnt(bend: Array, step: Array, missing: Array) -> Array:
    """Symmetric rank-one update, after which `bend` explains what the information misses of the gradient's change."""
    rest = missing - bend @ step
    along = float(rest @ step)
    if abs(along) <= 1e-8 * float(np.linalg.norm(rest) * np.linalg.norm(step)):
        return bend
    return bend + np.outer(rest, rest) / along


def _differences(slopes: Array) -> Array:
    """Steps of central differences, shape (n,): a small part of the standard error of each unknown alone."""
    steps: Array = _DIFFERENCE / np.maximum(np.linalg.norm(slopes, axis=0), _DIFFERENCE)
    return steps


def _is_unseen(unknown: Unknown, slope: Array, right: Array) -> bool:
    """Whether noise falls, and has fallen below what the records show."""
    if unknown.kind not in ("intensity", "noise") or unknown.prior is not None:
        return False
    return float(np.linalg.norm(slope)) < _UNSEEN and float(slope @ right) <= 0.0


def _check_effects(problem: FilterErrorProblem, slopes: Array, size: Array) -> None:
    effect = np.max(np.abs(slopes), axis=0) * size
    for unknown, largest in zip(problem.unknowns, effect, strict=True):
        if largest < _NO_EFFECT and unknown.kind != "intensity":
            raise InputError(
                f"{unknown.name} has no effect on these records: hold it, or give a flight that depends on it"
            )


def _check_noise(problem: FilterErrorProblem, at: Array) -> None:
    for unknown, coordinate in zip(problem.unknowns, at, strict=True):
        if unknown.kind == "noise" and unknown.value(float(coordinate)) < _LEAST_NOISE * unknown.start:
            raise DivergenceError(
                f"{unknown.name} falls below a thousandth of the {unknown.start:g} stated: hold it (estimate_noise)"
            )
