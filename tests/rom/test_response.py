"""Step responses: reading histories, averaging, refusals, files."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from indicial.errors import InputError
from indicial.motion import PitchOscillation
from indicial.rom import StepResponse, StepResponses
from rom.cases import COLUMNS, CONDITION, OUTPUTS, REFERENCE, ROWS, graded, known_system, responses, steps
from theory.linear import LinearSystem

GRID = graded(40.0, 60)


def test_responses_are_per_rad_and_per_q_c_over_2v() -> None:
    exact = known_system().step(GRID)[:, ROWS]
    found = responses(known_system(), CONDITION, GRID)
    for name, column in zip(("alpha", "q"), COLUMNS, strict=True):
        np.testing.assert_allclose(found[name].values, exact[:, :, column], atol=1e-11)
    np.testing.assert_allclose(found.baseline, known_system().steady(CONDITION).coefficients, atol=1e-14)


def test_rate_input_is_per_c_over_2v_whatever_the_reference_prefers() -> None:
    other = replace(known_system(), reference=replace(REFERENCE, rate_normalisation="c/V"))
    # the same C per q c/V means twice the load per q c/2V
    found, usual = responses(other, CONDITION, GRID), responses(known_system(), CONDITION, GRID)
    np.testing.assert_allclose(found["q"].values, 2.0 * usual["q"].values, atol=1e-10)


def test_plus_and_minus_steps_average_to_the_linear_response() -> None:
    def quadratic(inputs: np.ndarray) -> np.ndarray:
        extra = np.zeros((*inputs.shape[:-1], 6))
        extra[..., 2] = 3.0 * (inputs[..., 0] - CONDITION.alpha) ** 2
        return extra

    bent: LinearSystem = replace(known_system(), distortion=quadratic)
    plus, minus = steps(bent, CONDITION, GRID, 0.01)[0], steps(bent, CONDITION, GRID, -0.01)[0]
    averaged = StepResponses.from_histories([plus, minus], OUTPUTS)["alpha"]
    np.testing.assert_allclose(averaged.values, known_system().step(GRID)[:, ROWS, 0], atol=1e-11)
    assert averaged.spread is not None
    np.testing.assert_allclose(averaged.spread, np.outer(np.ones(GRID.size), [0.03, 0.0]), atol=1e-11)
    alone = StepResponses.from_histories([plus], OUTPUTS)["alpha"]
    assert np.max(np.abs(alone.values[:, 0] - known_system().step(GRID)[:, 2, 0])) > 0.02


def test_each_input_keeps_its_own_grid() -> None:
    fine = graded(40.0, 80)
    both = [steps(known_system(), CONDITION, GRID)[0], steps(known_system(), CONDITION, fine)[1]]
    found = StepResponses.from_histories(both, OUTPUTS)
    assert (found["alpha"].s.size, found["q"].s.size) == (60, 80)


def test_bad_histories_are_refused_with_the_reason() -> None:
    good = steps(known_system(), CONDITION, GRID)
    oscillation = PitchOscillation.from_reduced_frequency(CONDITION, REFERENCE, 0.01, 0.1)
    with pytest.raises(InputError, match="no step response"):
        StepResponses.from_histories([known_system().unsteady(CONDITION, oscillation, [0.0, 0.1])])
    late = replace(good[0], time=good[0].time + 1e-3)
    with pytest.raises(InputError, match="must start at 0"):
        StepResponses.from_histories([late])
    with pytest.raises(InputError, match="differ in flight condition"):
        StepResponses.from_histories([good[0], replace(good[1], condition=replace(CONDITION, mach=2.1))])
    with pytest.raises(InputError, match="different instants"):
        StepResponses.from_histories([good[0], steps(known_system(), CONDITION, graded(40.0, 61))[0]])
    with pytest.raises(InputError, match="no histories"):
        StepResponses.from_histories([])


@pytest.mark.parametrize("s", [[0.0, np.nan, 2.0], [0.0, 1.0, np.inf]])
def test_reduced_times_that_are_none_are_refused(s: list[float]) -> None:
    with pytest.raises(InputError, match="increase strictly"):
        StepResponse("alpha", np.array(s), np.ones((3, 1)))
    with pytest.raises(InputError, match="n_outputs"):
        StepResponse("alpha", np.arange(3.0), np.ones(3))


def test_final_value_given_takes_the_place_of_the_last_sample() -> None:
    short = StepResponse("alpha", np.array([0.0, 1.0, 2.0]), np.array([[1.0], [2.0], [3.0]]), final=np.array([4.0]))
    np.testing.assert_array_equal(short.deficiency[:, 0], [3.0, 2.0, 1.0])


@pytest.mark.parametrize("interpolation", ["linear", "cubic"])
def test_curve_passes_through_the_samples(interpolation: str) -> None:
    response = responses(known_system(), CONDITION, GRID)["q"]
    np.testing.assert_allclose(response.curve(interpolation)(GRID), response.deficiency, atol=1e-12)  # type: ignore[arg-type]


def test_netcdf_round_trip_is_exact(tmp_path: Path) -> None:
    written = responses(known_system(), CONDITION, GRID)
    first = replace(written.responses[0], final=np.array([7.0, -1.0]), spread=0.1 * np.abs(written.responses[0].values))
    written = replace(written, responses=(first, written.responses[1]))
    written.to_netcdf(tmp_path / "steps.nc")
    read = StepResponses.from_netcdf(tmp_path / "steps.nc")
    assert (read.condition, read.reference, read.outputs) == (CONDITION, REFERENCE, OUTPUTS)
    assert (read.inputs, read.provenance) == (written.inputs, written.provenance)
    np.testing.assert_array_equal(read.baseline, written.baseline)
    for one, other in zip(read.responses, written.responses, strict=True):
        for name in ("s", "values", "final", "spread"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_file_of_something_else_is_refused(tmp_path: Path) -> None:
    steps(known_system(), CONDITION, GRID)[0].to_netcdf(tmp_path / "history.nc")
    with pytest.raises(InputError, match="not a file of indicial step responses"):
        StepResponses.from_netcdf(tmp_path / "history.nc")
    with pytest.raises(InputError, match="no such file"):
        StepResponses.from_netcdf(tmp_path / "absent.nc")


def test_summary_and_plot_show_every_channel() -> None:
    found = responses(known_system(), CONDITION, GRID)
    assert "Cm to q: -6 at 0+" in found.summary()
    assert len(found.plot().axes) == 4
