r"""How well a record determines what was estimated from it.

With residuals v_i of station i, sensitivities S_i and noise covariance R (diagonal: channels are independent), the
Fisher information is ``F = sum S_i^T R^-1 S_i``, and its inverse D the Cramer-Rao bound for white noise.

Coloured noise carries less information than F says. With its covariance Omega along the record, first order in each
channel (``rho^|i-j|``, rho the correlation of neighbours), the covariance of the same estimate is

    D (S^T R^-1 Omega R^-1 S) D.

Klein & Morelli, "Aircraft System Identification" (2006), sec. 6.1.3 (bound) and 8.4 (coloured residuals, there with
sampled autocorrelations); Belsley, Kuh & Welsch, "Regression Diagnostics" (1980), ch. 3 (condition indices).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from indicial.conventions import Array

WHITE_LEVEL = 0.01
"""Probability at which white residuals are taken to be coloured, over all channels together."""

_MOST_CORRELATED = 0.98
_COLLINEAR = 30.0  # condition index from which Belsley, Kuh & Welsch speak of moderate to strong dependence
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


@dataclass(frozen=True)
class Accuracy:
    """Covariance of an estimate and what limits it.

    Parameters
    ----------
    names : tuple of str
        Unknowns.
    covariance : ndarray
        Of the unknowns: the Cramer-Rao bound if the residuals pass as white, else corrected for their colour,
        shape (n, n).
    bound : ndarray
        The Cramer-Rao bound, shape (n, n).
    whiteness : tuple of Whiteness
        One a channel.
    white : bool
        Whether the residuals pass as white.
    findings : tuple of str
        What the record cannot tell, in words; empty if it tells all.
    """

    names: tuple[str, ...]
    covariance: Array
    bound: Array
    whiteness: tuple[Whiteness, ...]
    white: bool
    findings: tuple[str, ...]

    @property
    def standard_errors(self) -> Array:
        """Standard errors of the unknowns, shape (n,)."""
        errors: Array = np.sqrt(np.diag(self.covariance))
        return errors

    @property
    def correlation(self) -> Array:
        """Correlations of the unknowns, shape (n, n)."""
        matrix: Array = self.covariance / np.outer(self.standard_errors, self.standard_errors)
        return matrix

    def summary(self) -> str:
        """Whiteness and findings."""
        lines = []
        if self.white:
            lines.append("residuals pass as white: standard errors are the Cramer-Rao bound")
        else:
            loud = min(self.whiteness, key=lambda w: w.probability)
            lines.append(
                f"residuals are coloured (most in {loud.channel}: neighbours correlate by {loud.neighbours:.2f}): "
                "standard errors are corrected for it"
            )
        return "\n".join([*lines, *self.findings])


def assess(
    names: tuple[str, ...],
    values: Array,
    derivatives: int,
    channels: tuple[str, ...],
    residuals: Array,
    sensitivities: Array,
    noise: Array,
) -> Accuracy:
    """Accuracy of an estimate.

    Parameters
    ----------
    names : tuple of str
        Unknowns, derivatives first.
    values : ndarray
        Of the unknowns, shape (n,).
    derivatives : int
        How many of them are derivatives.
    channels : tuple of str
    residuals : ndarray
        Shape (n_stations, n_channels).
    sensitivities : ndarray
        Shape (n_stations, n_channels, n).
    noise : ndarray
        Standard deviation of each channel, shape (n_channels,).
    """
    whitened = sensitivities / noise[:, None]
    bound = cramer_rao(whitened.reshape(-1, len(names)))
    whiteness = tuple(neighbour_test(name, residuals[:, i], whitened[:, i], bound) for i, name in enumerate(channels))
    white = all(w.probability > WHITE_LEVEL / len(channels) for w in whiteness)
    covariance = bound if white else coloured_covariance(whitened, bound, [w.neighbours for w in whiteness])
    findings = undetermined(names[:derivatives], values[:derivatives], covariance[:derivatives, :derivatives])
    return Accuracy(names, covariance, bound, whiteness, white, findings)


def cramer_rao(whitened: Array) -> Array:
    """``(S^T R^-1 S)^-1`` from whitened sensitivities (n_data, n), by singular values, shape (n, n)."""
    size = np.linalg.norm(whitened, axis=0)
    _, singular, rows = np.linalg.svd(whitened / size, full_matrices=False)
    half = rows.T / np.maximum(singular, np.finfo(float).eps * singular[0]) / size[:, None]
    covariance: Array = half @ half.T
    return covariance


def coloured_covariance(whitened: Array, bound: Array, neighbours: list[float]) -> Array:
    """Covariance of the estimate if each channel's noise is first order with correlation rho of neighbours, (n, n).

    Parameters
    ----------
    whitened : ndarray
        Sensitivities over noise, shape (n_stations, n_channels, n).
    bound : ndarray
        Cramer-Rao bound, shape (n, n).
    neighbours : list of float
        rho of each channel.
    """
    stations = np.arange(whitened.shape[0])
    apart = np.abs(stations[:, None] - stations[None, :])
    middle = np.zeros_like(bound)
    for channel, rho in enumerate(neighbours):
        slope = whitened[:, channel]
        middle += slope.T @ np.power(rho, apart) @ slope
    covariance: Array = bound @ middle @ bound
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

    Their information, what the other unknowns leave of it, is scaled to a unit diagonal; a condition index (largest
    over smallest singular value) above 30 is reported with the derivatives that make it.

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
    findings: list[str] = []
    dependent: set[str] = set()
    for power, direction in zip(powers, directions.T, strict=True):
        index = math.sqrt(powers[-1] / max(power, np.finfo(float).tiny))
        together = [i for i in np.argsort(-np.abs(direction)) if abs(direction[i]) > 0.3]
        if index < _COLLINEAR or len(together) < 2:
            continue
        dependent.update(names[i] for i in together)
        findings.append(_dependence([names[i] for i in together], index, covariance[np.ix_(together, together)]))
    for name, value, error in zip(names, values, errors, strict=True):
        if name not in dependent and error > _WEAK * abs(value):
            findings.append(f"the record hardly determines {name}: {value:.4g} +- {error:.2g}")
    return tuple(findings)


def _dependence(names: list[str], index: float, covariance: Array) -> str:
    errors = np.sqrt(np.diag(covariance))
    listed = ", ".join(f"{name} +- {error:.2g}" for name, error in zip(names, errors, strict=True))
    text = f"the record cannot separate {' and '.join(names)} (condition index {index:.0f}; {listed})"
    if len(names) == 2:
        total = math.sqrt(max(covariance.sum(), 0.0))
        correlation = covariance[0, 1] / (errors[0] * errors[1])
        text += f", correlation {correlation:.5f}"
        if total < 0.1 * float(errors.min()):
            text += f"; it determines their sum, +- {total:.2g}: identify the sum"
    return text
