"""Many flights at once: distributions against closed forms, threads, seeds, and what cannot vary."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from flightsim.support import FINNER, SPEED, derivative_model
from indicial.errors import InputError
from indicial.flightsim import (
    ConstantAtmosphere,
    Dispersion,
    End,
    InitialState,
    SteadyWind,
    build_dynamics,
    fly,
    monte_carlo,
)

MASS, SLOPE, GUST = (ca.SX.sym(name) for name in ("mass", "Cm_q", "crosswind"))
VARIED = build_dynamics(replace(FINNER, mass=MASS), derivative_model(Cm_q=SLOPE), wind=SteadyWind((0.0, GUST, 0.0)))
MEAN = {"mass": FINNER.mass, "Cm_q": -300.0, "crosswind": 0.0}
SPREAD = Dispersion.independent(alpha=0.02, q=2.0, mass=0.01, Cm_q=30.0, crosswind=3.0)
VACUUM = build_dynamics(FINNER, derivative_model(), ConstantAtmosphere(pressure=0.0))


def shots(**changed: Any) -> Any:
    options = {"flights": 40, "seed": 3, "step": 5e-4, "parameters": MEAN, "end": End(x=100.0)} | changed
    return monte_carlo(VARIED, {"speed": SPEED}, SPREAD, 0.5, **options)


def test_vacuum_arcs_scatter_as_their_closed_form_says() -> None:
    """z = -V sin(gamma) t + g t^2/2 for every draw; the footprint is that of the draws."""
    spread = Dispersion(("speed", "path_angle"), [[9.0, 0.006], [0.006, 1e-4]])
    found = monte_carlo(VACUUM, {"speed": 100.0, "path_angle": 0.3}, spread, 2.0, flights=300, seed=1, step=0.01)
    speed, angle = 100.0 + found.drawn[:, 0], 0.3 + found.drawn[:, 1]
    assert found.column("x") == pytest.approx(speed * np.cos(angle) * 2.0, abs=1e-9)
    assert found.column("z") == pytest.approx(-speed * np.sin(angle) * 2.0 + 9.80665 * 2.0, abs=1e-9)
    # standard error of a covariance of n draws: sqrt((s11 s22 + s12^2)/n); three of them
    error = np.sqrt((np.outer([9.0, 1e-4], [9.0, 1e-4]) + np.square(spread.covariance)) / 300.0)
    error[0, 1] = error[1, 0] = np.sqrt((9e-4 + 0.006**2) / 300.0)
    assert np.all(np.abs(np.cov(found.drawn.T) - spread.covariance) < 3.0 * error)
    centre, half = found.footprint(("x", "z"), 0.95)
    inside = np.linalg.solve(half, np.stack([found.column("x"), found.column("z")]) - centre[:, None])
    assert 0.91 < np.mean(np.sum(inside**2, axis=0) < 1.0) < 0.98


def test_each_flight_is_the_one_that_flies_alone() -> None:
    found = shots()
    i = 7
    parameters = {n: MEAN[n] + found.drawn[i, found.names.index(n)] for n in MEAN}
    alpha, q = found.drawn[i, 0], found.drawn[i, 1]
    alone = fly(
        VARIED,
        InitialState.from_path(SPEED, alpha=alpha, rate=(0.0, q, 0.0)),
        0.5,
        step=5e-4,
        parameters=parameters,
        end=End(x=100.0),
        estimate_error=False,
    )
    assert found.final[i, :3] == pytest.approx(alone.position[-1], abs=1e-12)
    assert found.time[i] == pytest.approx(alone.time[-1], abs=1e-14)
    assert np.all(found.ended)


def test_results_depend_on_the_seed_and_not_on_the_threads() -> None:
    one, two, other = shots(threads=1), shots(threads=2), shots(seed=4)
    assert np.array_equal(one.final, two.final)
    assert not np.array_equal(one.final, other.final)


def test_the_result_speaks_for_itself(tmp_path: Path) -> None:
    found = shots()
    assert "40 flights, seed 3: 40 met their end, 0 failed" in found.summary()
    low, middle, high = found.percentiles("y")
    assert low < middle < high
    found.to_csv(tmp_path / "shots.csv")
    rows = (tmp_path / "shots.csv").read_text().splitlines()
    assert len(rows) == 41
    assert rows[0].startswith("drawn alpha,drawn q,drawn mass")
    assert found.plot().axes


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Dispersion(("a",), np.eye(2)), "covariance of shape"),
        (lambda: Dispersion(("a", "b"), [[1.0, 2.0], [2.0, 1.0]]), "negative"),
        (lambda: shots(flights=0), "must be positive"),
        (lambda: shots(parameters={"mass": 1.0}), "parameters given"),
        (
            lambda: monte_carlo(VACUUM, {"alpha": 0.1}, SPREAD, 1.0, flights=1, seed=0, step=0.1),
            "needs a speed",
        ),
        (
            lambda: monte_carlo(
                VACUUM, {"speed": 9.0}, Dispersion.independent(colour=1.0), 1.0, flights=1, seed=0, step=0.1
            ),
            "colour cannot vary",
        ),
        (lambda: shots().column("colour"), "no 'colour'"),
    ],
)
def test_what_makes_no_sense_is_refused(make: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        make()
