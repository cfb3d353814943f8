"""Stepwise choice of terms: those that made a coefficient are found among many, and noise adds none."""

import numpy as np
import pytest

from identification.test_equation_error import PLANE, manoeuvre
from indicial.errors import InputError
from indicial.identification import FlightRecord, model_structure, polynomial_terms
from indicial.identification.structure import _orthogonal_order

CANDIDATES = ["alpha", "q", "elevator", "alpha^2", "alpha*q", "alpha*elevator", "elevator^2", "alpha^3"]
TRUTH = {"alpha": -0.7, "q": -11.0, "elevator": -1.1, "alpha^2": -2.5}


def made(seed, noise=2e-4):
    """A record in which Cm is a sum of known terms: the pitching moment is written into qdot."""
    base = manoeuvre(number=600, exact_rates=True)
    rng = np.random.default_rng(seed)
    elevator = 0.05 * np.sign(np.sin(1.9 * base.time + 0.4)) + 0.01 * rng.standard_normal(base.time.size)
    alpha, q_hat = base["alpha"], base["q"] * 2.0 / (2.0 * base["V"])
    values = {"alpha": alpha, "q": q_hat, "elevator": elevator, "alpha^2": alpha**2}
    coefficient = 0.02 + sum(c * values[n] for n, c in TRUTH.items()) + noise * rng.standard_normal(alpha.size)
    loads = base["dynamic_pressure"] * PLANE.reference.area * PLANE.reference.length
    omega = np.stack([base[n] for n in "pqr"], axis=1)
    force = np.stack([1200.0 * base["ax"] - 2500.0, 1200.0 * base["ay"], 1200.0 * base["az"]], axis=1)
    arm = np.array([-0.1, 0.1, -0.2])
    turning = np.stack([base[f"{n}dot"] for n in "pqr"], axis=1)
    wanted = loads * coefficient + np.cross(arm, force)[:, 1] - np.cross(omega, omega @ PLANE.inertia)[:, 1]
    turning[:, 1] += (wanted - (turning @ PLANE.inertia)[:, 1]) / PLANE.inertia[1, 1]
    channels = {**base.channels, **dict(zip(("pdot", "qdot", "rdot"), turning.T, strict=True))}
    return FlightRecord(base.time, channels, {"elevator": elevator})


@pytest.mark.parametrize("seed", range(5))
def test_the_terms_that_made_the_moment_are_found_and_no_others(seed):
    found = model_structure(made(seed), PLANE, "Cm", CANDIDATES, thrust=2500.0)
    assert set(found.chosen) == set(TRUTH)
    for name, value in TRUTH.items():
        estimate = found.model[f"Cm_{name}"]
        assert abs(estimate.value - value) < 5.0 * estimate.standard_error, name
    assert found.r_squared[-1] >= found.r_squared[1]
    assert "kept" in found.summary()
    assert found.plot().axes[0].get_yscale() == "log"


def test_predicted_squared_error_is_its_definition_and_the_fit_that_of_least_squares():
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((200, 4))
    response = columns @ np.array([3.0, 0.0, -1.0, 0.2]) + 0.1 * rng.standard_normal(200)
    order, errors, explained = _orthogonal_order(response, columns)
    assert order[:3] == [0, 2, 3]
    z = response - response.mean()
    for k in range(5):
        basis = np.column_stack([np.ones(200), columns[:, order[:k]]])
        left = response - basis @ np.linalg.lstsq(basis, response, rcond=None)[0]
        assert errors[k] == pytest.approx(left @ left / 200 + z @ z / 200 * k / 200)
        assert explained[k] == pytest.approx(1.0 - left @ left / (z @ z), abs=1e-12)


def test_a_candidate_that_others_make_up_is_not_tried_twice():
    rng = np.random.default_rng(4)
    one, other = rng.standard_normal((2, 100))
    order, *_ = _orthogonal_order(one + other, np.column_stack([one, other, one + other]))
    assert order[0] == 2
    assert len(order) == 2


def test_noise_alone_explains_nothing_worth_a_term():
    record = made(1)
    noise = np.random.default_rng(9).standard_normal((2, len(record)))
    spoilt = FlightRecord(record.time, dict(record.channels), {"a": noise[0], "b": noise[1]})
    with pytest.raises(InputError, match="none of the candidates"):
        model_structure(spoilt, PLANE, "CY", ["a", "b"], thrust=2500.0)
    assert polynomial_terms
