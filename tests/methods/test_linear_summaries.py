"""What the summaries of a linearised flow say, and what they must not."""

import numpy as np
import pytest

from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.frequency import FrequencyResponse, check_inputs, reduced_frequencies
from indicial.methods import forced_oscillation
from indicial.motion import FlightCondition
from indicial.sensitivity import Sensitivities

REFERENCE = ReferenceQuantities(1.0, 1.0)


def response(mach: float, plane: bool) -> FrequencyResponse:
    """CN changes with alpha and q, Cm with q alone, as about the aerodynamic centre."""
    static, slope = np.zeros((6, 2)), np.ones((6, 2))
    static[2], static[4] = (6.0, 7.0), (0.0, -1.0)
    values = np.zeros((0, 6, 2), dtype=complex)
    condition = FlightCondition(mach)
    return FrequencyResponse(
        np.zeros(0), ("alpha", "q"), values, static, slope, static, np.zeros(6), condition, REFERENCE, plane
    )


def test_a_slope_without_a_limit_is_not_printed_as_a_number() -> None:
    lines = response(mach=0.5, plane=True).summary().splitlines()
    for source in ("alpha", "q"):
        assert any(f"CN to {source}" in line and line.endswith("H'(0) has no limit") for line in lines)
    assert any("Cm to q" in line and line.endswith("H'(0) = 1") for line in lines)


def test_every_slope_is_printed_where_all_have_limits() -> None:
    for mach, plane in ((0.5, False), (2.0, True)):
        assert "no limit" not in response(mach, plane).summary()


def sensitivities(plane: bool) -> Sensitivities:
    return Sensitivities(np.ones((6, 10)), np.ones((6, 6)), np.zeros(6), FlightCondition(0.5), REFERENCE, plane)


def test_sensitivities_are_printed_with_their_units() -> None:
    names, units, *rows = (line.split() for line in sensitivities(plane=False).summary().splitlines()[1:])
    assert names == ["u", "v", "w", "p", "q", "r", "mach", "x_ref", "y_ref", "z_ref"]
    assert " ".join(units) == " ".join(["per m/s"] * 3 + ["per rad/s"] * 3 + ["per M"] + ["per m"] * 3)
    assert [row[0] for row in rows] == ["CA", "CY", "CN", "Cl", "Cm", "Cn"]


def test_what_is_not_known_of_a_plane_flow_is_not_printed() -> None:
    names, _, *rows = (line.split() for line in sensitivities(plane=True).summary().splitlines()[1:])
    assert names == ["u", "w", "q", "mach", "x_ref", "z_ref"]
    assert [row[0] for row in rows] == ["CA", "CN", "Cm"]


def test_each_input_is_plotted_with_the_loads_that_answer_to_it() -> None:
    k = np.array([0.5, 0.1])
    values = np.zeros((2, 6, 2), dtype=complex)
    values[:, 2, 0], values[:, 3, 1] = 6.0 + 1j * k, -20.0 + 1j * k
    zero = np.zeros((6, 2))
    figure = FrequencyResponse(
        k, ("alpha", "p"), values, zero, zero, zero, np.zeros(6), FlightCondition(2.0), REFERENCE
    ).plot()
    drawn = {panel.get_title(): len(panel.lines) for panel in figure.axes}
    assert drawn == {"CN to alpha": 2, "Cl to p": 2, "Cm to alpha": 0, "Cn to p": 0}
    assert [list(line.get_xdata()) for line in figure.axes[0].lines] == [[0.1, 0.5]] * 2


@pytest.mark.parametrize("inputs", [(), "alpha", ("alfa",), ("alpha", "alpha")])
def test_inputs_must_be_known_names_each_once(inputs) -> None:
    with pytest.raises(InputError):
        check_inputs(inputs)


@pytest.mark.parametrize("k", ["x", -0.1, np.nan, [[0.1]], [None, "a"]])
def test_reduced_frequencies_must_be_numbers_from_0(k) -> None:
    with pytest.raises(InputError, match="reduced frequenc"):
        reduced_frequencies(k)


@pytest.mark.parametrize("k", [0.0, -1.0, np.nan, np.inf])
def test_an_oscillation_is_refused_in_the_terms_in_which_it_was_asked_for(k) -> None:
    with pytest.raises(InputError, match="reduced frequency k is"):
        forced_oscillation.experiment(FlightCondition(2.0), REFERENCE, 0.01, k)
