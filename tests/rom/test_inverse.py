"""Step responses rebuilt from frequency responses with known inverse transforms."""

import numpy as np
import pytest

from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.frequency import FrequencyResponse, reduced_frequencies
from indicial.motion import FlightCondition
from indicial.rom.inverse import step_responses, truncation

POLES, WEIGHTS, DIRECT = np.array([0.05, 0.4, 3.0]), np.array([1.0, -0.6, 2.0]), 4.0
"""C(s) = D + sum of w (1 - exp(-p s)), H(ik) = D + sum of w p / (ik + p)."""


def response(k: np.ndarray) -> FrequencyResponse:
    values = np.zeros((k.size, 6, 1), dtype=complex)
    values[:, 2, 0] = DIRECT + np.sum(WEIGHTS * POLES / (1j * k[:, None] + POLES), axis=1)
    static, slope, direct = np.zeros((6, 1)), np.zeros((6, 1)), np.zeros((6, 1))
    static[2], slope[2], direct[2] = DIRECT + np.sum(WEIGHTS), -np.sum(WEIGHTS / POLES), DIRECT
    return FrequencyResponse(
        k, ("alpha",), values, static, slope, direct, np.zeros(6), FlightCondition(2.0), ReferenceQuantities(1.0, 1.0)
    )


def exact(s: np.ndarray) -> np.ndarray:
    return DIRECT + np.sum(WEIGHTS * (1.0 - np.exp(-POLES * s[:, None])), axis=1)


def test_a_step_response_with_known_poles_is_rebuilt() -> None:
    s = np.concatenate([[0.0], np.geomspace(0.01, 200.0, 60)])
    found = step_responses(response(np.geomspace(1e-3, 100.0, 80)), s).channel("CN", "alpha")[1]
    assert np.max(np.abs(found - exact(s))) < 2e-4 * np.max(np.abs(exact(s)))
    assert found[0] == DIRECT


def test_the_error_falls_as_frequencies_are_added() -> None:
    s = np.linspace(0.0, 60.0, 50)
    errors = []
    for n in (20, 40, 80):
        found = step_responses(response(np.geomspace(1e-3, 100.0, n)), s).channel("CN", "alpha")[1]
        errors.append(np.max(np.abs(found - exact(s))))
    assert errors[1] < errors[0] / 3.0
    assert errors[2] < errors[1] / 3.0


def test_truncation_tells_how_much_lies_above_the_highest_frequency() -> None:
    assert truncation(response(np.geomspace(1e-3, 100.0, 40)), "CN", "alpha") < 2e-3
    assert truncation(response(np.geomspace(1e-3, 3.0, 40)), "CN", "alpha") > 0.2


def test_too_few_frequencies_are_refused() -> None:
    with pytest.raises(InputError, match="four reduced frequencies"):
        step_responses(response(np.array([0.0, 0.1, 0.2, 0.3])), np.linspace(0.0, 1.0, 5))


@pytest.mark.parametrize("k", [[-0.1], [np.nan], [np.inf]], ids=["negative", "nan", "infinite"])
def test_impossible_frequencies_are_refused(k: list[float]) -> None:
    with pytest.raises(InputError, match="reduced frequency"):
        reduced_frequencies(k)


def test_a_frequency_response_survives_its_file(tmp_path) -> None:  # type: ignore[no-untyped-def]
    first = response(np.geomspace(0.01, 1.0, 5))
    first.to_netcdf(tmp_path / "h.nc")
    again = FrequencyResponse.from_netcdf(tmp_path / "h.nc")
    assert np.array_equal(again.values, first.values)
    assert again.condition == first.condition
    assert again.reference == first.reference
    assert again.inputs == first.inputs
