"""Moving frame against exact steady derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from indicial.conventions import ReferenceQuantities, transfer_longitudinal
from indicial.errors import InputError
from indicial.methods import moving_frame
from indicial.motion import FlightCondition
from theory.linear import random_system
from theory.plate import SupersonicPlate, steady_response

CONDITION = FlightCondition(1.6, alpha=0.03, beta=0.01)
REFERENCE = ReferenceQuantities(length=0.4, area=0.5, moment_reference=(0.3, 0.0, 0.0), lateral_length=1.3)
ROWS = {"CA": 0, "CY": 1, "CN": 2, "Cl": 3, "Cm": 4, "Cn": 5}
COLUMNS = {"alpha": 0, "beta": 1, "p": 2, "q": 3, "r": 4}


@pytest.mark.parametrize("normalisation", ["c/2V", "c/V"])
@pytest.mark.parametrize("one_sided", [False, True])
def test_moving_frame_recovers_every_derivative_of_a_linear_system(normalisation: str, one_sided: bool) -> None:
    system = random_system(replace(REFERENCE, rate_normalisation=normalisation))
    variables = ("alpha", "beta", "p", "q", "r")
    result = moving_frame.run(system, CONDITION, variables, one_sided=one_sided)
    static = system.transfer(0.0).real
    for variable in variables:
        for load in moving_frame.LOADS[variable]:
            name = f"{load}_{variable}"
            assert result[name] == pytest.approx(static[ROWS[load], COLUMNS[variable]], rel=1e-8, abs=1e-8)
            assert result.changes[name] == pytest.approx(0.0, abs=1e-8)
    assert result["CA_0"] == system.steady(CONDITION)["CA"]


def test_moving_frame_costs_a_base_and_two_pairs_a_variable() -> None:
    planned = moving_frame.experiments(CONDITION, REFERENCE, ("alpha", "q"))
    labels = ["base", "alpha+", "alpha-", "alpha++", "alpha--", "q+", "q-", "q++", "q--"]
    assert [one.label for one in planned] == labels
    rate = {one.label: one.rates.q for one in planned}
    assert rate["q++"] == pytest.approx(2.0 * rate["q+"]) == pytest.approx(-2.0 * rate["q-"])
    assert rate["q+"] * REFERENCE.length / (2.0 * CONDITION.speed) == pytest.approx(1e-3)


@pytest.mark.parametrize("axis", [0.0, 0.5, -3.5])
def test_plate_by_moving_frame_equals_closed_form_about_any_axis(axis: float) -> None:
    solver = SupersonicPlate(ReferenceQuantities(1.0, 1.0, (axis, 0.0, 0.0)))
    result = moving_frame.run(solver, FlightCondition(1.6))
    cl_a, cm_a, cl_q, cm_q = steady_response(1.6, axis)
    exact = {"CN_alpha": cl_a, "Cm_alpha": cm_a, "CN_q": 2.0 * cl_q, "Cm_q": 2.0 * cm_q}  # per c/2V
    for name, value in exact.items():
        assert result[name] == pytest.approx(value, rel=1e-9)


@pytest.mark.parametrize("normalisation", ["c/2V", "c/V"])
def test_moment_transfer_equals_solving_about_the_other_axis(normalisation: str) -> None:
    def derivatives(axis: float) -> dict[str, float]:
        reference = ReferenceQuantities(0.4, 1.0, (axis, 0.0, 0.0), rate_normalisation=normalisation)
        return moving_frame.run(SupersonicPlate(reference), FlightCondition(1.6)).values

    moved = transfer_longitudinal(derivatives(0.1), 0.7 / 0.4, normalisation)
    about = derivatives(0.8)
    assert set(moved) == {"CN_alpha", "Cm_alpha", "CN_q", "Cm_q"}
    for name, value in moved.items():
        assert about[name] == pytest.approx(value, rel=1e-9)


def test_cubic_load_shows_in_the_change_at_the_second_amplitude() -> None:
    # dC = 40 alpha^3 about alpha = 0: a central difference over h reads 40 h^2 too much
    def cubic(inputs: np.ndarray) -> np.ndarray:
        loads = np.zeros((*inputs.shape[:-1], 6))
        loads[..., 2] = 40.0 * inputs[..., 0] ** 3
        return loads

    system = replace(random_system(REFERENCE), distortion=cubic)
    result = moving_frame.run(system, FlightCondition(1.6), ("alpha",), amplitudes={"alpha": 0.02})
    true = system.transfer(0.0)[2, 0].real
    assert result["CN_alpha"] - true == pytest.approx(40.0 * 0.02**2, rel=1e-6)
    assert result.changes["CN_alpha"] == pytest.approx(40.0 * 3.0 * 0.02**2, rel=1e-6)
    assert result.derivatives().one("CN_alpha").uncertainty >= abs(result["CN_alpha"] - true)


def test_records_carry_method_reference_and_amplitude() -> None:
    table = moving_frame.run(random_system(REFERENCE), CONDITION).derivatives()
    record = table.one("Cm_alpha")
    assert (record.method, record.reference_length_m, record.k) == ("mrf", 0.4, None)
    assert record.amplitude_deg == pytest.approx(np.degrees(5e-3))
    assert table.one("Cm_q").amplitude_deg is None


def test_moving_frame_names_what_is_missing_or_unknown() -> None:
    planned = moving_frame.experiments(CONDITION, REFERENCE, ("q",), second=None)
    system = random_system(REFERENCE)
    loads = {one.label: system.steady(one.condition, one.rates) for one in planned[:-1]}
    with pytest.raises(InputError, match="q-"):
        moving_frame.read(planned, loads)
    with pytest.raises(InputError, match="no variable"):
        moving_frame.experiments(CONDITION, REFERENCE, ("u",))
    with pytest.raises(InputError, match="not be zero"):
        moving_frame.experiments(CONDITION, REFERENCE, ("q",), amplitudes={"q": 0.0})
    with pytest.raises(InputError, match="second amplitude"):
        moving_frame.experiments(CONDITION, REFERENCE, ("q",), second=1.0)
