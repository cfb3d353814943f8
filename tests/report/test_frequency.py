"""The figures of the linearised flow show what was solved, marched and modelled, at the place where it belongs."""

import math

import numpy as np
import pytest

from indicial.conventions import ReferenceQuantities
from indicial.motion import FlightCondition
from indicial.report.frequency import frequency_figure
from indicial.rom import project
from pipeline.oracle import Oracle, longitudinal_flow, missile

REFERENCE = ReferenceQuantities(0.03, math.pi * 0.03**2 / 4, (0.165, 0.0, 0.0))
CONDITION = FlightCondition(2.0)
K = 0.1


def lines(tmp_path, model, band):
    """By panel and label: the points drawn."""
    solver = Oracle(REFERENCE, tmp_path / "log").build(False, lambda fraction: None)
    response = solver.frequency_response(CONDITION, [0.5, K, 0.0], ("alpha", "q"))
    h = missile(REFERENCE).transfer(K)
    marched = {}
    for motion, both in (("plunge", h[:, 0]), ("pitch", h[:, 0] + 1j * K * h[:, 3])):
        marched[motion] = {name: (both[row].real, both[row].imag / K) for row, name in ((2, "CN"), (4, "Cm"))}
    figure = frequency_figure(response, model, band, marched, K)
    return [{line.get_label(): line.get_xydata() for line in axes.get_lines()} for axes in figure.axes]


def test_marched_points_lie_on_the_operator_and_on_the_model(tmp_path):
    flow = longitudinal_flow(missile(REFERENCE), CONDITION)
    panels = lines(tmp_path, project(flow, 0.5, 1e-6).model, 0.5)
    assert len(panels) == 8
    for panel in panels:
        (k, value), *_ = panel["FOM"]
        solved, curve = panel["operator"], panel["projected model"]
        assert k == K
        assert solved[:, 0].tolist() == [K, 0.5]
        assert solved[0, 1] == pytest.approx(value, rel=1e-12)
        assert np.interp(K, *curve.T) == pytest.approx(value, rel=1e-3)
        # what is drawn at k = 0 is the limit
        assert curve[0, 1] == pytest.approx(panel["operator, k = 0"][0, 1], rel=1e-3)


def test_without_a_model_there_is_no_line(tmp_path):
    for panel in lines(tmp_path, None, 0.0):
        assert set(panel) == {"FOM", "operator", "operator, k = 0"}
