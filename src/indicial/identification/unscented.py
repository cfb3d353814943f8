"""The unscented Kalman filter: filterpy's, on a `StateModel`."""

from __future__ import annotations

import numpy as np
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from numpy.typing import NDArray

from indicial.conventions import Array
from indicial.identification.kalman import Filtered, noise_covariance
from indicial.identification.state_model import StateModel


def unscented_filter(
    model: StateModel,
    time: Array,
    parameters: Array,
    measured: Array,
    turning: NDArray[np.bool_],
    variance: Array,
    intensity: Array,
    mean: Array,
    spread: Array,
    made: Filtered,
) -> int:
    """Filter a record into `made`; the instant at which it broke down, or -1. See `kalman.extended_filter`.

    Sigma points are Merwe's with alpha 0.1, beta 2 and kappa 3 - nx; the noise between instants is that of the
    linearised motion. Errors are made independent by the Cholesky factor of S, in the order of the channels.
    """
    nx, nc = mean.size, variance.size
    points = MerweScaledSigmaPoints(nx, alpha=0.1, beta=2.0, kappa=3.0 - nx, sqrt_method=_root)
    ukf = UnscentedKalmanFilter(nx, nc, dt=0.0, hx=None, fx=None, points=points)
    ukf.x, ukf.P = mean.copy(), spread.copy()
    for k in range(time.size):
        try:
            if k:
                span = (parameters[k - 1], parameters[k], time[k] - time[k - 1], time[k - 1])
                made.cross_covariance[k] = _predict(ukf, model, span, intensity)
            else:
                ukf.sigmas_f = points.sigma_points(ukf.x, ukf.P)
            made.predicted[k], made.predicted_covariance[k] = ukf.x, ukf.P
            there = np.flatnonzero(np.isfinite(measured[k]))
            if there.size:
                target = measured[k, there]

                def look(x: Array, k: int = k, there: NDArray[np.int64] = there, target: Array = target) -> Array:
                    apart = _finite(model.outputs(x, parameters[k], time[k])[0][there]) - target
                    turns = turning[there]
                    apart[turns] = (apart[turns] + np.pi) % (2.0 * np.pi) - np.pi
                    return apart  # angles near the measured one have a mean

                ukf.update(np.zeros(there.size), R=np.diag(variance[there]), hx=look)
                factor = np.linalg.cholesky(ukf.S)
                made.innovations[k, there] = ukf.y
                made.variances[k, there] = np.diag(factor) ** 2
                made.errors[k, there] = np.linalg.solve(factor, ukf.y) * np.diag(factor)
        except np.linalg.LinAlgError:
            return k
        if not (np.all(np.isfinite(ukf.x)) and np.all(np.diag(ukf.P) > 0.0)):
            return k
        made.filtered[k], made.filtered_covariance[k] = ukf.x, ukf.P
    return -1


def _predict(
    ukf: UnscentedKalmanFilter, model: StateModel, span: tuple[Array, Array, float, float], intensity: Array
) -> Array:
    """One interval; the covariance of the state before it with the one after it, shape (nx, nx)."""
    before, slope = ukf.x.copy(), model.advance(ukf.x, *span)[2]
    old = ukf.points_fn.sigma_points(ukf.x, ukf.P) - before
    moved: list[Array] = []

    def move(x: Array, dt: float) -> Array:
        moved.append(_finite(model.advance(x, *span)[0]))
        return moved[-1]

    ukf.Q = noise_covariance(np.ascontiguousarray(slope), intensity, span[2], model.substeps)
    ukf.predict(dt=span[2], fx=move)
    cross: Array = (ukf.Wc[:, None] * old).T @ (np.array(moved) - ukf.x)
    return cross


def _root(matrix: Array) -> Array:
    """Upper Cholesky factor, as filterpy takes it; LinAlgError where there is none."""
    return np.asarray(np.linalg.cholesky(_finite(matrix)).T, dtype=float)


def _finite(values: Array) -> Array:
    if not np.all(np.isfinite(values)):
        raise np.linalg.LinAlgError("a number of the filter is not finite")
    return values
