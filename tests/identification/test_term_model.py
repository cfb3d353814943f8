"""The flight model made of terms has the coefficients that its terms say, and gives them back."""

import numpy as np
import pytest

from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.flightsim import InitialState, Signal, StandardAtmosphere, Vehicle, fly
from indicial.identification import Sensor, equation_error, measure_flight, term_model, term_names

REFERENCE = ReferenceQuantities(1.5, 16.0, lateral_length=11.0)
INERTIA = np.array([[1200.0, 0.0, -80.0], [0.0, 1800.0, 0.0], [-80.0, 0.0, 2700.0]])
VEHICLE = Vehicle("light aircraft", 1000.0, INERTIA, REFERENCE, (0.0, 0.0, 0.0))
TERMS = {
    "CX": ["alpha", "alpha^2"],
    "CZ": ["alpha", "q", "elevator"],
    "Cm": ["alpha", "q", "elevator", "alpha*elevator"],
    "CY": ["beta", "rudder"],
    "Cl": ["beta", "p", "r", "aileron"],
    "Cn": ["beta", "p", "alpha*p", "r", "rudder"],
}
VALUES = {
    **{"CX_0": -0.05, "CX_alpha": 0.2, "CX_alpha^2": 2.0},
    **{"CZ_0": -0.3, "CZ_alpha": -5.0, "CZ_q": -6.0, "CZ_elevator": -0.4},
    **{"Cm_0": 0.03, "Cm_alpha": -0.7, "Cm_q": -14.0, "Cm_elevator": -1.2, "Cm_alpha*elevator": 0.5},
    **{"CY_0": 0.0, "CY_beta": -0.5, "CY_rudder": 0.15},
    **{"Cl_0": 0.0, "Cl_beta": -0.09, "Cl_p": -0.5, "Cl_r": 0.1, "Cl_aileron": 0.15},
    **{"Cn_0": 0.0, "Cn_beta": 0.08, "Cn_p": -0.03, "Cn_alpha*p": -0.4, "Cn_r": -0.1, "Cn_rudder": -0.07},
}


def test_names_of_all_parameters():
    assert set(term_names(TERMS)) == set(VALUES)
    model = term_model(VEHICLE, TERMS, ("elevator", "aileron", "rudder"))
    assert set(model.parameter_names) == set(VALUES) | {"elevator", "aileron", "rudder"}


def test_every_coefficient_of_a_flight_comes_back_by_equation_error():
    """Sensors without error show it; what is left is the error of slopes between samples."""
    time = np.arange(0.0, 6.0, 0.01)
    moves = {
        "elevator": Signal(time, -0.02 + 0.04 * np.sin(3.0 * time)),
        "aileron": Signal(time, 0.05 * np.sin(2.0 * time)),
        "rudder": Signal(time, 0.05 * np.sin(2.7 * time + 1.0)),
    }
    model = term_model(VEHICLE, TERMS, tuple(moves), StandardAtmosphere())
    start = InitialState.from_path(60.0, alpha=0.05, position=(0.0, 0.0, -1000.0))
    flight = fly(model, start, 5.9, method="dop853", step=0.01, parameters={**VALUES, **moves})
    channels = ["V", "alpha", "beta", "p", "q", "r", "pdot", "qdot", "rdot", "ax", "ay", "az", "dynamic_pressure"]
    exact = measure_flight(flight, VEHICLE, {c: Sensor(100.0) for c in channels}, seed=None, inputs=moves)
    for name, chosen in TERMS.items():
        fit = equation_error(exact, VEHICLE, name, chosen)
        for estimate in fit.estimates:
            assert estimate.value == pytest.approx(
                VALUES[estimate.name], abs=2e-4 * max(1.0, abs(fit[estimate.name].value))
            )


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        ({"CD": ["alpha"]}, "coefficient 'CD' is none of CX, CZ, Cm, CY, Cl, Cn"),
        ({"Cm": ["alpha", "elevatr"]}, r"'elevatr' in term 'elevatr' of Cm is no factor; allowed: powers of alpha, b"),
        ({"Cm": ["p"]}, "'p' in term 'p' of Cm is no factor.*once one of q, alphadot"),
        ({"Cl": ["p*r"]}, "'r' in term 'p\\*r' of Cl is no factor"),
        ({"Cm": ["q^2"]}, "'q\\^2' in term"),
        ({"Cm": ["alpha^x"]}, "must be a whole number from 1, not 'x'"),
        ({"Cm": ["alpha", "alpha"]}, "term 'alpha' of Cm stands twice"),
    ],
)
def test_terms_that_cannot_be_are_refused(terms, message):
    with pytest.raises(InputError, match=message):
        term_model(VEHICLE, terms, ("elevator",))
