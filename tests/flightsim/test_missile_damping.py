"""The verdict on a missile: its parts agree with the checks they are made of."""

import json
import math

import numpy as np
import pytest

from flightsim.support import FINNER, SPEED, derivative_model, first_order_lag
from indicial.flightsim import (
    InitialState,
    arm_decay,
    build_dynamics,
    check_damping,
    missile_damping,
    missile_modes,
    simulate,
)


def test_verdict_with_and_without_roll_by_derivatives_and_model() -> None:
    found = missile_damping(
        FINNER, derivative_model(), SPEED, model=first_order_lag(0.02), roll_rate=600.0, uncertainties={"Cm_q": 30.0}
    )
    assert found.stability.dynamically_stable
    assert (found.stability.roll_rate, found.without_roll.roll_rate) == (600.0, 0.0)
    assert found.change is not None
    text = found.summary()
    for said in ("roll rate 0 rad/s", "roll rate 600 rad/s", "halves in", "decay", "closed form", "Cm_alphadot"):
        assert said in text
    record = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    arm = record["arms"][0]
    for read in ("decay_1_s", "fitted_1_s", "closed_form_1_s"):
        assert arm[read] == pytest.approx(arm["linearised_1_s"], rel=1e-3)
    assert sum(arm["parts_1_s"].values()) == pytest.approx(arm["linearised_1_s"])


@pytest.mark.parametrize("roll_rate", [0.0, 1500.0])
@pytest.mark.parametrize("model", [derivative_model(), first_order_lag(0.3)], ids=["derivatives", "lag"])
def test_decay_of_each_arm_is_its_linear_damping(model: object, roll_rate: float) -> None:
    """With roll the arms differ by 9%: reading one for the other would be seen."""
    check = check_damping(FINNER, model, SPEED, roll_rate=roll_rate, amplitude=math.radians(0.02), wavelengths=3.0)
    for arm in check.arms:
        assert arm.decay == pytest.approx(arm.linearised.real, rel=1e-5)


def test_decay_of_a_motion_that_was_made() -> None:
    """Two arms put in by hand on a flight's distance: each is found with the other filtered out."""
    flight = simulate(FINNER, derivative_model(), InitialState.from_path(SPEED, alpha=0.001), 0.2, step=1e-4)
    s = flight.distance
    fast, slow = -0.004 + 0.25j, -0.009 - 0.14j

    class Made:
        distance = s
        non_rolling_incidence = 0.02 * np.exp(fast * s) + 0.01 * np.exp(slow * s)

    assert arm_decay(Made(), slow) == pytest.approx(fast.real, rel=1e-6)  # type: ignore[arg-type]
    assert arm_decay(Made(), fast) == pytest.approx(slow.real, rel=1e-6)  # type: ignore[arg-type]


@pytest.mark.parametrize("roll_rate", [0.0, 300.0])
def test_an_unstable_missile_gets_a_verdict_not_an_error(roll_rate: float) -> None:
    """300 rad/s are far too few to spin it stable."""
    found = missile_damping(FINNER, derivative_model(Cm_alpha=5.0), SPEED, roll_rate=roll_rate)
    assert found.check is None
    assert "statically unstable, dynamically UNSTABLE" in found.summary()
    record = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert record["oscillates"] is False
    assert max(arm["linearised_1_s"] for arm in record["arms"]) > 0.0
    assert set(found.plot()) == {"damping_parts"}


def test_shapes_of_the_arms_are_eigenvectors_that_turn_with_their_rates() -> None:
    """Without lift and drag incidence turns as the body does: its rate over distance is the eigenvalue in size."""
    modes = missile_modes(
        build_dynamics(FINNER, derivative_model(CN_alpha=0.0, CA_0=0.0, CN_q=0.0, CN_alphadot=0.0)), SPEED
    )
    for name in ("fast arm", "slow arm"):
        mode = modes[name]
        rate = mode.shape["rate"]
        assert mode.shape["incidence"] == pytest.approx(1.0)
        assert abs(rate) == pytest.approx(abs(mode.per_metre), rel=1e-9)
    assert modes["roll"].shape["p"] == 1.0


def test_modes_of_a_missile_are_drawn_as_phasors() -> None:
    import matplotlib.pyplot as plt

    figures = missile_damping(FINNER, derivative_model(), SPEED).plot()
    assert set(figures) == {"flight", "modes", "damping_parts"}
    assert len(figures["modes"].axes) == 3
    plt.close("all")
