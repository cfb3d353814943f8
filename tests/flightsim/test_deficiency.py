"""Deficiency functions on top of other models: a second implementation, the step response, the slow limit."""

import casadi as ca
import numpy as np
import pytest

from flightsim.support import FINNER, SPEED, derivative_model, first_order_lag
from indicial.errors import InputError
from indicial.flightsim import (
    BodyAxisAerodynamics,
    DeficiencyAerodynamics,
    DeficiencyTerm,
    FlatEarth,
    InitialState,
    build_dynamics,
    fly,
)

POLE = 0.3
QUASI_STEADY = derivative_model()
BASE = derivative_model(CN_alphadot=0.0, Cm_alphadot=0.0)
TERM = DeficiencyTerm(rate=POLE, CN=-POLE * QUASI_STEADY.CN_alphadot, Cm=-POLE * QUASI_STEADY.Cm_alphadot)


@pytest.mark.parametrize("axes", ["non_rolling", "body"])
def test_a_rolling_missile_flies_as_with_the_state_space_model_of_the_same_response(axes: str) -> None:
    start = InitialState.from_path(SPEED, alpha=0.05, beta=-0.02, rate=(120.0, 1.0, 0.0))
    models = (
        DeficiencyAerodynamics(base=BASE, terms=(TERM,), planes="both", lag_axes=axes),
        first_order_lag(POLE, lag_axes=axes),
    )
    one, other = (
        fly(build_dynamics(FINNER, m, earth=FlatEarth(0.0)), start, 0.05, step=2e-5, every=100, estimate_error=False)
        for m in models
    )
    np.testing.assert_allclose(one.velocity, other.velocity, atol=1e-8)
    np.testing.assert_allclose(one.rate, other.rate, atol=1e-8)


def test_right_after_a_step_in_incidence_the_deficiency_is_owed_and_nothing_later() -> None:
    """Loads with the lag state of the incidence before, and settled: CN and Cm short by a, then by nothing."""
    model = DeficiencyAerodynamics(base=BASE, terms=(TERM,), planes="pitch")
    dynamics = build_dynamics(FINNER, model, earth=FlatEarth(0.0))
    plain = build_dynamics(FINNER, BASE, earth=FlatEarth(0.0))
    alpha = 0.05
    moments, forces = [], []
    for lag in (0.0, np.sin(alpha)):
        state = dynamics.initial_vector(InitialState.from_path(SPEED, alpha=alpha, lag=np.array([lag])))
        force, moment, density, *_ = dynamics.loads(state, [], 0.0)
        forces.append(float(force[2]))
        moments.append(float(moment[1]))
    settled, about, *_ = plain.loads(state[:13], [], 0.0)
    pressure_area = 0.5 * float(density) * SPEED**2 * FINNER.reference.area
    assert forces[1] == pytest.approx(float(settled[2]), rel=1e-12)
    assert moments[1] == pytest.approx(float(about[1]), rel=1e-12)
    owed = pressure_area * np.sin(alpha)
    assert forces[0] - forces[1] == pytest.approx(owed * TERM.CN, rel=1e-10)
    assert moments[0] - moments[1] == pytest.approx(-owed * TERM.Cm * FINNER.reference.length, rel=1e-10)


def test_what_is_owed_dies_out_as_exp_of_minus_b_s() -> None:
    model = DeficiencyAerodynamics(base=BASE, terms=(TERM, DeficiencyTerm(rate=2.0)))
    dynamics = build_dynamics(FINNER, model, earth=FlatEarth(0.0))
    state = dynamics.initial_vector(InitialState.from_path(SPEED, alpha=0.05, lag=np.zeros(2)))
    rate = dynamics.rate(state)[13:]
    pace = 2.0 * SPEED / FINNER.reference.length
    np.testing.assert_allclose(rate, pace * np.array([POLE, 2.0]) * np.sin(0.05), rtol=1e-12)
    slopes = np.diag(dynamics.jacobian(state))[13:]
    np.testing.assert_allclose(slopes, -pace * np.array([POLE, 2.0]), rtol=1e-12)


def test_a_quick_lag_is_a_derivative_in_alphadot() -> None:
    """b a hundred times the motion's frequency: the flight of the derivative model, to first order in k/b."""
    start = InitialState.from_path(SPEED, alpha=0.02)
    differences = []
    for pole in (2.0, 4.0):
        term = DeficiencyTerm(rate=pole, CN=-pole * QUASI_STEADY.CN_alphadot, Cm=-pole * QUASI_STEADY.Cm_alphadot)
        model = DeficiencyAerodynamics(base=BASE, terms=(term,), planes="both")
        one, other = (
            fly(build_dynamics(FINNER, m, earth=FlatEarth(0.0)), start, 0.1, step=5e-6, every=400, estimate_error=False)
            for m in (model, QUASI_STEADY)
        )
        differences.append(np.max(np.abs(one.rate[:, 1] - other.rate[:, 1])) / np.max(np.abs(other.rate[:, 1])))
    assert differences[0] < 0.01
    assert differences[0] / differences[1] == pytest.approx(2.0, rel=0.1)


def test_an_aircraft_carries_symbols_of_its_terms() -> None:
    a, b = ca.SX.sym("a"), ca.SX.sym("b")
    base = BodyAxisAerodynamics(reference=FINNER.reference, CZ_alpha=-5.0, Cm_alpha=ca.SX.sym("Cm_alpha"))
    model = DeficiencyAerodynamics(base=base, terms=(DeficiencyTerm(rate=b, Cm=a),))
    assert build_dynamics(FINNER, model).parameter_names == ("Cm_alpha", "b", "a")
    assert model.lag_names == ("deficiency_pitch_0",)
    assert "exp(-b s)" in model.summary()


def test_what_makes_no_sense_is_refused() -> None:
    with pytest.raises(InputError, match="must be positive"):
        DeficiencyTerm(rate=0.0)
    with pytest.raises(InputError, match="at least one term"):
        DeficiencyAerodynamics(base=BASE, terms=())
    with pytest.raises(InputError, match="planes"):
        DeficiencyAerodynamics(base=BASE, terms=(TERM,), planes="yaw")  # type: ignore[arg-type]
