"""Filters: a step of the compiled extended filter beside filterpy's with the same model, in the same run.

A light aircraft's record, 500 samples of four channels: velocity, pitch angle and rate with four derivatives as states.
filterpy's `ExtendedKalmanFilter` is given our compiled states, outputs and Jacobians; what is left to it is the filter.
On one thread.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from figures import Figure, best_time
from filterpy.kalman import ExtendedKalmanFilter
from peers import longitudinal
from threadpoolctl import threadpool_limits

from indicial.conventions import Array
from indicial.identification import (
    FilterErrorFit,
    FlightRecord,
    Parameter,
    Process,
    StateModel,
    filter_error,
    filter_record,
    flight_model,
    flight_start,
)
from indicial.identification.kalman import noise_covariance

STATES = ("u", "w", "theta", "q")
INTENSITY = {"w": 0.3, "q": 0.02}
ERRORS = {"u": 0.5, "w": 0.5, "theta": 0.01, "q": 0.01, "CZ_alpha": 1.0, "Cm_alpha": 0.2, "Cm_q": 5.0}


@cache
def model(joint: bool) -> StateModel:
    unknown = {name: Process() for name in longitudinal.TRUTH} if joint else {}
    return flight_model(longitudinal.aircraft(), STATES, longitudinal.CHANNELS, intensity=INTENSITY, processes=unknown)


def start(joint: bool) -> dict[str, float]:
    dynamics = longitudinal.aircraft()
    first = flight_start(dynamics, longitudinal.START, STATES, np.zeros(len(dynamics.parameter_names)))
    return first | (longitudinal.TRUTH if joint else {})


def peer(record: FlightRecord) -> Array:
    """States by filterpy, shape (500, 8)."""
    m, errors = model(True), np.array([{**ERRORS, "Cm_elevator": 0.3}[n] for n in model(True).state_names])
    ekf = ExtendedKalmanFilter(errors.size, len(m.channels))
    ekf.x, ekf.P = np.array(list(start(True).values())), np.diag(errors**2)
    ekf.R = np.diag([record.standard_deviations[c] ** 2 for c in m.channels])
    measured = np.column_stack([record[c] for c in m.channels])
    given, states = record["elevator"][:, None], []
    for k, z in enumerate(measured):
        if k:
            step = record.time[k] - record.time[k - 1]
            moved, ekf.F, slope = m.advance(ekf.x, given[k - 1], given[k], step, record.time[k - 1])
            ekf.Q = noise_covariance(np.ascontiguousarray(slope), m.intensity, step)
            ekf.predict_x = lambda u, moved=moved: setattr(ekf, "x", moved)
            ekf.predict()
        seen, jacobian = m.outputs(ekf.x, given[k], record.time[k])
        ekf.update(z, lambda x, jacobian=jacobian: jacobian, lambda x, seen=seen: seen)
        states.append(ekf.x)
    return np.array(states)


def fit(record: FlightRecord) -> FilterErrorFit:
    own = [Parameter(name, 1.1 * value) for name, value in longitudinal.TRUTH.items()]
    own += [Parameter(f"intensity_{name}", value) for name, value in INTENSITY.items()]
    return filter_error(model(False), [record], [start(False)], own)


def measure() -> list[Figure]:
    """Filters on one record, then a fit."""
    record = longitudinal.record(seed=1, memory=0.0)
    errors = {**ERRORS, "Cm_elevator": 0.3}

    def run(method: str) -> Array:
        return filter_record(model(True), record, start(True), errors, method=method).filtered

    with threadpool_limits(limits=1):
        ours, theirs = best_time(lambda: run("extended")), best_time(lambda: peer(record), repeats=3)
        unscented = best_time(lambda: run("unscented"), repeats=2)
        apart = np.max(np.abs(run("extended") - peer(record)) / np.abs(peer(record)).max(axis=0))
        fitted = best_time(lambda: fit(record), repeats=3)
    steps = len(record)
    return [
        Figure("extended filter, 8 states and 4 channels, a step", 1e6 * ours / steps, "us"),
        Figure("filterpy's, a step", 1e6 * theirs / steps, "us"),
        Figure.at_least("filterpy's extended filter over ours", theirs / ours, 5.0),
        Figure.at_most("states apart, of the largest", float(apart), 1e-10),
        Figure("unscented filter (filterpy's), a step", 1e6 * unscented / steps, "us"),
        Figure("filter error, 500 samples and 10 unknowns", 1e3 * fitted, "ms"),
    ]
