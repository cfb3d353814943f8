"""One model over Mach number: exact where it was made, right where it was not, stable while Mach number changes."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.motion import FlightCondition, PitchOscillation
from indicial.rom import (
    ScheduledModel,
    StepResponse,
    StepResponses,
    best_schedule,
    check_prediction,
    leave_one_out,
    schedule,
)
from indicial.rom.convolution import ConvolutionModel
from indicial.rom.signals import MotionInputs
from rom.cases import responses
from theory.plate import SupersonicPlate

PLATE = SupersonicPlate(ReferenceQuantities(1.0, 1.0, (0.25, 0.0, 0.0)))
MACHS = tuple(np.arange(1.5, 3.01, 0.25).tolist())


@cache
def plate_points() -> tuple[StepResponses, ...]:
    return tuple(responses(PLATE, FlightCondition(mach=mach), np.linspace(0.0, 8.0, 121)) for mach in MACHS)


@cache
def plate_schedule() -> ScheduledModel:
    return schedule(plate_points())


def test_step_responses_of_the_plate_at_mach_numbers_left_out_are_within_three_per_cent():
    left = leave_one_out(plate_points())
    assert [one.mach for one in left] == list(MACHS[1:-1])
    assert max(one.worst for one in left) < 0.03


def test_oscillations_at_a_mach_number_left_out_are_within_three_per_cent():
    model = schedule([one for one in plate_points() if one.condition.mach != 2.0]).at(2.0)
    condition = FlightCondition(mach=2.0)
    for k in (0.1, 0.4):
        motion = PitchOscillation.from_reduced_frequency(condition, PLATE.reference, 0.01, k)
        exact = PLATE.unsteady(condition, motion, np.linspace(0.0, motion.period, 80))
        assert check_prediction(model, exact).worst_peak < 0.03


def test_where_it_was_made_jump_final_value_and_integral_are_those_of_the_data():
    for point in plate_points():
        model = plate_schedule().at(point.condition.mach)
        np.testing.assert_allclose(model.d, point.initial, rtol=1e-9)
        np.testing.assert_allclose(model.static_gain, point.final, rtol=1e-7)
        np.testing.assert_allclose(model.rate_gain, ConvolutionModel(point).rate_gain, rtol=1e-6, atol=1e-8)


def test_the_states_decay_however_the_condition_changes():
    # A + A^T < 0 everywhere: no change of the condition can make the states grow
    for mach in np.linspace(1.5, 3.0, 31):
        a = plate_schedule().matrices(float(mach))[0]
        assert np.max(np.linalg.eigvalsh(a + a.T)) < 0.0


def test_at_a_constant_condition_the_schedule_answers_as_its_model_there():
    s = np.linspace(0.0, 10.0, 60)
    u = np.random.default_rng(1).normal(size=(60, 2))
    model = plate_schedule().at(1.9)
    found = plate_schedule().respond(s, u, np.full(60, 1.9))
    np.testing.assert_allclose(found, model.respond(MotionInputs(s, u, u[0])), rtol=1e-9, atol=1e-11)


def test_a_slow_change_of_mach_number_keeps_to_the_settled_loads():
    s = np.linspace(0.0, 4000.0, 120)
    mach = np.linspace(1.6, 2.9, 120)
    found = plate_schedule().respond(s, np.tile([1.0, 0.0], (120, 1)), mach)
    settled = np.array([plate_schedule().at(float(m)).static_gain[:, 0] for m in mach])
    np.testing.assert_allclose(found[1:], settled[1:], rtol=2e-3)


def test_the_file_gives_the_same_model_to_the_last_digit(tmp_path):
    plate_schedule().to_json(tmp_path / "schedule.json")
    again = ScheduledModel.from_json(tmp_path / "schedule.json")
    for one, other in zip(again.matrices(2.1), plate_schedule().matrices(2.1), strict=True):
        np.testing.assert_array_equal(one, other)
    assert again.summary() == plate_schedule().summary()


def manufactured(mach: float, alpha: float) -> StepResponses:
    """Two lags whose rates and gains change with Mach number and alpha."""
    rates = np.array([0.1 * np.exp(0.7 * mach), 0.9 * np.exp(alpha)])
    gains = np.array([[-1.0 - alpha, 0.4 * mach], [0.3 * mach, -0.2 + alpha]])  # lag, output
    s = 40.0 * np.linspace(0.0, 1.0, 61) ** 2
    final = np.array([3.0 / mach, -1.0 - 2.0 * alpha**2])
    values = final + np.exp(-np.outer(s, rates)) @ gains
    condition = FlightCondition(mach=mach, alpha=alpha)
    response = StepResponse("alpha", s, values, final=final)
    return StepResponses((response,), ("CN", "Cm"), np.zeros(6), condition, PLATE.reference)


def test_a_plant_over_mach_number_and_alpha_is_found_between_its_points():
    points = [manufactured(m, a) for a in (0.0, 0.1, 0.2) for m in (1.5, 1.8, 2.1, 2.4)]
    model = schedule(points, order=2)
    for mach, alpha in ((1.6, 0.05), (1.95, 0.17), (2.3, 0.11)):
        exact = manufactured(mach, alpha)["alpha"]
        found = model.at(mach, alpha).step(exact.s)["alpha"].values
        assert np.max(np.abs(found - exact.values) / np.max(np.abs(exact.values), axis=0)) < 0.005


def test_order_is_chosen_by_what_is_left_out():
    points = [manufactured(m, 0.0) for m in (1.5, 1.8, 2.1, 2.4)]
    model, left = best_schedule(points, orders=(1, 2), degrees=(1,))
    assert model.order == 2  # the second lag is there
    assert max(one.worst for one in left) < 0.01


def test_what_does_not_make_a_schedule_is_refused():
    points = plate_points()
    with pytest.raises(InputError, match=r"reaches from Mach 1\.5 to 3, not to 3\.2"):
        plate_schedule().at(3.2)
    with pytest.raises(InputError, match="every Mach number with every angle"):
        schedule([manufactured(1.5, 0.0), manufactured(1.5, 0.1), manufactured(2.0, 0.0)])
    with pytest.raises(InputError, match="two conditions or more"):
        schedule(points[:1])
    hot = replace(points[1], condition=replace(points[1].condition, temperature=400.0))
    with pytest.raises(InputError, match="Mach number and alpha only"):
        schedule([points[0], hot])
    with pytest.raises(InputError, match="not a readable JSON file"):
        ScheduledModel.from_json("nothing.json")
