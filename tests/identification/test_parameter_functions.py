"""Polynomials and splines of the flight condition: values, slopes, and coefficients found back from a flight."""

import casadi as ca
import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from indicial.errors import InputError
from indicial.flightsim import MACH, DerivativeAerodynamics, InitialState, basic_finner_range_model, build_dynamics, fly
from indicial.identification import RangeRecord, fit_manoeuvres, measure, polynomial, spline
from indicial.identification.problem import Manoeuvre, Parameter
from indicial.identification.sensitivity import SensitivityModel
from indicial.identification.start_state import StartState


def values_of(expression, argument, given, at):
    symbols = [s for s in ca.symvar(expression) if s.name() != argument.name()]
    function = ca.Function("f", [argument, *symbols], [expression])
    return np.array([float(function(x, *(given[s.name()] for s in symbols))) for x in at])


def test_a_polynomial_has_its_coefficients():
    x = ca.SX.sym("x")
    at = np.linspace(-1.0, 3.0, 7)
    found = values_of(polynomial("c", x, 2, about=1.0), x, {"c_0": 2.0, "c_1": -1.0, "c_2": 0.5}, at)
    np.testing.assert_allclose(found, 2.0 - (at - 1.0) + 0.5 * (at - 1.0) ** 2)


def test_a_spline_is_scipy_s_natural_one_and_straight_beyond():
    x, knots = ca.SX.sym("x"), np.array([-1.0, 0.0, 0.5, 2.0])
    heights = {"s_0": 1.0, "s_1": -0.5, "s_2": 2.0, "s_3": 0.3}
    inside = np.linspace(-1.0, 2.0, 31)
    reference = CubicSpline(knots, list(heights.values()), bc_type="natural")
    found = values_of(spline("s", x, knots), x, heights, inside)
    np.testing.assert_allclose(found, reference(inside), atol=1e-12)
    beyond = values_of(spline("s", x, knots), x, heights, [-3.0, 5.0])
    np.testing.assert_allclose(beyond, [1.0 - 2.0 * reference(-1.0, 1), 0.3 + 3.0 * reference(2.0, 1)], rtol=1e-9)
    line = values_of(spline("s", x, knots), x, {f"s_{i}": 2.0 * k for i, k in enumerate(knots)}, [-4.0, 0.2, 7.0])
    np.testing.assert_allclose(line, [-8.0, 0.4, 14.0], atol=1e-12)


def test_a_damping_that_changes_with_mach_is_found_from_a_flight_that_slows():
    body = basic_finner_range_model()
    truth = {"CA_0_0": 0.6, "CA_0_1": -0.2, "Cm_alpha_0": -26.0, "Cm_alpha_1": 14.0}
    model = DerivativeAerodynamics(
        reference=body.reference,
        CA_0=polynomial("CA_0", MACH, 1, about=1.9),
        CN_alpha=11.0,
        Cm_alpha=polynomial("Cm_alpha", MACH, 1, about=1.9),
        Cm_q=-350.0,
    )
    dynamics = build_dynamics(body, model)
    start = InitialState.from_path(690.0, alpha=0.05)
    flown = fly(dynamics, start, 1.2, step=2e-4, parameters=truth, estimate_error=False)
    record = measure(flown, 150, seed=None)
    assert isinstance(record, RangeRecord)
    near = StartState.of(dynamics, dynamics.initial_vector(start, dynamics.parameter_vector(truth)), ("pitch", "q"))
    seen = SensitivityModel.of(dynamics, ("x", "y", "z", "yaw", "pitch"))
    shot = Manoeuvre.of_range(record, seen, near, 150.0)
    found = fit_manoeuvres([shot], [Parameter(n, 0.9 * v) for n, v in truth.items()], estimate_noise=False)
    for name, value in truth.items():
        assert found[name].value == pytest.approx(value, rel=2e-3), name


def test_what_makes_no_sense_is_refused():
    x = ca.SX.sym("x")
    with pytest.raises(InputError, match="degree of 0 or more"):
        polynomial("c", x, -1)
    with pytest.raises(InputError, match="three or more knots"):
        spline("s", x, [0.0, 1.0])
    with pytest.raises(InputError, match="increasing"):
        spline("s", x, [0.0, 1.0, 1.0])
