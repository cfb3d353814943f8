"""The methods run on a reduced-order model as on any solver, and read its own transfer functions back."""

from __future__ import annotations

import numpy as np
import pytest

from indicial.methods import forced_oscillation, indicial_response, moving_frame
from indicial.rom import ConvolutionModel, ReducedModel
from rom.cases import CONDITION, graded, known_system, responses
from rom.test_state_space import known_model


def models() -> list[ReducedModel]:
    return [known_model(), ConvolutionModel(responses(known_system(), CONDITION, graded(90.0, 400)))]


@pytest.mark.parametrize("model", models(), ids=["state space", "convolution"])
def test_forced_oscillation_reads_the_transfer_function(model: ReducedModel) -> None:
    k = 0.2
    history = forced_oscillation.run(model, CONDITION, 0.01, k, periods=4)
    h = model.frequency_response(k)[0, 1]
    exact = (h[0] + 1j * k * h[1]).imag / k
    found = forced_oscillation.fourier(history, periods=1).value("Cm")
    assert found == pytest.approx(exact, rel=1e-4)


@pytest.mark.parametrize("model", models(), ids=["state space", "convolution"])
def test_moving_frame_reads_the_settled_rate_derivative(model: ReducedModel) -> None:
    table = moving_frame.run(model, CONDITION).derivatives()
    assert table.value("Cm_q") == pytest.approx(model.static_gain[1, 1], rel=1e-8)
    assert table.value("CN_alpha") == pytest.approx(model.static_gain[0, 0], rel=1e-8)


@pytest.mark.parametrize("model", models(), ids=["state space", "convolution"])
def test_indicial_method_reads_the_step_response(model: ReducedModel) -> None:
    s = graded(80.0, 200)
    response = indicial_response.read(indicial_response.run(model, CONDITION, 0.01, s))
    exact = known_system().step(s)[:, 4, 0]
    np.testing.assert_allclose(response["Cm"], exact, atol=2e-4 * np.max(np.abs(exact)))
