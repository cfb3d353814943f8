r"""How well a record determines what was estimated from it.

With residuals v_i of station i, sensitivities S_i and noise covariance R (diagonal: channels are independent), the
Fisher information is ``F = sum S_i^T R^-1 S_i``, and its inverse D the Cramer-Rao bound for white noise.

Coloured residuals are made white first (`coloured`).

Klein & Morelli, "Aircraft System Identification" (2006), sec. 6.1.3; Belsley, Kuh & Welsch, "Regression Diagnostics"
(1980), ch. 3 (condition indices).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array

WHITE_LEVEL = 0.01
"""Probability at which white residuals are taken to be coloured, over all channels together."""

_MOST_CORRELATED = 0.98
_COLLINEAR = 30.0  # condition index from which Belsley, Kuh & Welsch speak of moderate to strong dependence
_SEVERE = 100.0  # condition index from which they speak of a serious one
_SHARE = 0.5  # of the variance of an estimate: what they ask for to name it
_LINKED = 0.1  # of the projector onto what is not told: smaller entries are no link
_TOLD = 0.1  # of the error alone: so well known a combination is worth naming
_LEAST_TOLD = 1e-7
_WEAK = 0.5  # relative standard error from which a value is called undetermined


@dataclass(frozen=True)
class Whiteness:
    """Test of one channel's residuals against correlation of neighbours.

    Parameters
    ----------
    channel : str
    neighbours : float
        Correlation of the noise at neighbouring stations.
    probability : float
        Of so large a correlation, of either sign, if the noise is white.
    """

    channel: str
    neighbours: float
    probability: float


def cramer_rao(whitened: Array) -> Array:
    """``(S^T R^-1 S)^-1`` from whitened sensitivities (n_data, n), by singular values, shape (n, n).

    A direction that is told less than 1e-7 times as well as the best (columns scaled) counts as told so well: in double
    precision the matrix would hold nothing of the others.
    """
    size = np.linalg.norm(whitened, axis=0)
    _, singular, rows = np.linalg.svd(whitened / size, full_matrices=False)
    half = rows.T / np.maximum(singular, _LEAST_TOLD * singular[0]) / size[:, None]
    covariance: Array = half @ half.T
    return covariance


def neighbour_test(channel: str, residuals: Array, slope: Array, bound: Array) -> Whiteness:
    """Test residuals (n,) for correlation of neighbouring stations.

    Residuals of white noise are correlated by the fit itself: with the projection ``H = S F^-1 S^T`` (whitened), those
    of neighbours by ``-sum H_i,i+1/(n - sum H_ii)``. What is beyond that has a standard deviation of ``1/sqrt(n)``.

    Parameters
    ----------
    channel : str
    residuals : ndarray
        Of the channel, shape (n,).
    slope : ndarray
        Its sensitivities over noise, shape (n, n_unknowns).
    bound : ndarray
        Inverse Fisher information F^-1, shape (n_unknowns, n_unknowns).
    """
    n = residuals.size
    power = float(residuals @ residuals)
    correlation = float(residuals[1:] @ residuals[:-1]) / power if power > 0.0 else 0.0
    projected = slope @ bound
    leverage = float(np.sum(projected * slope))
    by_fit = -float(np.sum(projected[1:] * slope[:-1])) / (n - leverage)
    excess = float(np.clip(correlation - by_fit, -_MOST_CORRELATED, _MOST_CORRELATED))
    return Whiteness(channel, excess, math.erfc(abs(excess) * math.sqrt(n / 2.0)))


def undetermined(names: tuple[str, ...], values: Array, covariance: Array) -> tuple[str, ...]:
    """What the record cannot tell of the derivatives, in words.

    Their information, what the other unknowns leave of it, is scaled to a unit diagonal, with eigenvalues l_k and
    directions v_k. Those whose condition index ``sqrt(l_max/l_k)`` is above 30 are what the record does not tell, and a
    derivative takes part if they make more than half of its variance, ``sum_k v_jk^2/l_k`` (the variance-decomposition
    proportions of Belsley, Kuh & Welsch). Those that go together are named together, with the combination of them that
    the record does tell, if there is one. Where the index is below 100 and each is determined all the same (standard
    errors below half of the values), it is told that small differences separate them.

    Parameters
    ----------
    names : tuple of str
    values : ndarray
        Shape (n,).
    covariance : ndarray
        Of the derivatives, shape (n, n).
    """
    errors = np.sqrt(np.diag(covariance))
    information = np.linalg.pinv(covariance / np.outer(errors, errors), hermitian=True, rcond=1e-15)
    scale = np.sqrt(np.diag(information))
    powers, directions = np.linalg.eigh(information / np.outer(scale, scale))
    powers = np.maximum(powers, np.finfo(float).tiny)
    index = np.sqrt(powers[-1] / powers)
    lost = index > _COLLINEAR
    findings: list[str] = []
    dependent: set[int] = set()
    for group in _groups(directions, powers, lost):
        dependent.update(group)
        worst = max(index[k] for k in np.flatnonzero(lost) if np.max(np.abs(directions[group, k])) > _LINKED)
        weak = worst > _SEVERE or bool(np.any(errors[group] > _WEAK * np.abs(values[group])))
        findings.append(_dependence([names[i] for i in group], worst, covariance[np.ix_(group, group)], weak))
    for i, (name, value, error) in enumerate(zip(names, values, errors, strict=True)):
        if i not in dependent and error > _WEAK * abs(value):
            findings.append(f"the record hardly determines {name}: {value:.4g} +- {error:.2g}")
    return tuple(findings)


def _groups(directions: Array, powers: Array, lost: NDArray[np.bool_]) -> list[list[int]]:
    """Which derivatives go together in what is lost, those with the largest part in it first."""
    from scipy.sparse.csgraph import connected_components

    parts = directions**2 / powers
    taking = np.flatnonzero(parts[:, lost].sum(axis=1) > _SHARE * parts.sum(axis=1))
    null = directions[np.ix_(taking, np.flatnonzero(lost))]
    projector = null @ null.T
    _, label = connected_components(np.abs(projector) > _LINKED, directed=False)
    order = np.argsort(-np.diag(projector), kind="stable")
    groups = [[int(taking[i]) for i in order if label[i] == number] for number in dict.fromkeys(label)]
    return [group for group in groups if len(group) > 1]


def _dependence(names: list[str], index: float, covariance: Array, weak: bool) -> str:
    errors = np.sqrt(np.diag(covariance))
    listed = ", ".join(f"{name} +- {error:.2g}" for name, error in zip(names, errors, strict=True))
    how = "cannot separate" if weak else "separates by small differences only"
    text = f"the record {how} {' and '.join(names)} (condition index {index:.0f}; {listed})"
    if len(names) == 2:
        text += f", correlation {covariance[0, 1] / (errors[0] * errors[1]):.5f}"
        total = math.sqrt(max(covariance.sum(), 0.0))
        if total < _TOLD * float(errors.min()):
            return text + f"; it determines their sum, +- {total:.2g}: identify the sum"
    factors = -np.linalg.lstsq(covariance[1:, 1:], covariance[1:, 0], rcond=None)[0]
    weights = np.append(1.0, factors)
    told = math.sqrt(max(float(weights @ covariance @ weights), 0.0))
    if told < _TOLD * errors[0]:
        terms = "".join(
            f" {'-' if f < 0.0 else '+'} {abs(f):.3g} {name}" for f, name in zip(factors, names[1:], strict=True)
        )
        text += f"; it determines {names[0]}{terms}, +- {told:.2g}"
    return text
