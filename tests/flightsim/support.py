"""A missile and models used by several tests."""

from typing import Any

import control
import numpy as np

from indicial.flightsim import DerivativeAerodynamics, StateSpaceAerodynamics, basic_finner_range_model

FINNER = basic_finner_range_model()
DENSITY = 101325.0 / (8314.32 / 28.9644 * 293.15)
SPEED = 687.0


def derivative_model(**changed: Any) -> DerivativeAerodynamics:
    """Round numbers of the Finner's size, about its centre of gravity."""
    values: dict[str, Any] = {
        "reference": FINNER.reference,
        "CA_0": 0.55,
        "CN_alpha": 12.0,
        "CN_q": 100.0,
        "CN_alphadot": 30.0,
        "Cm_alpha": -28.0,
        "Cm_q": -300.0,
        "Cm_alphadot": -60.0,
        "Cl_p": -22.0,
    }
    return DerivativeAerodynamics(**(values | changed))


def first_order_lag(pole: float, **changed: Any) -> StateSpaceAerodynamics:
    """`derivative_model` with ``s`` replaced by ``s/(1 + s/pole)`` in its alphadot terms."""
    d = derivative_model()
    slopes = np.array([d.CN_alphadot, d.Cm_alphadot])
    system = control.ss(
        [[-pole]],
        [[1.0, 0.0]],
        -(pole**2) * slopes[:, None],
        [[d.CN_alpha + pole * slopes[0], d.CN_q], [d.Cm_alpha + pole * slopes[1], d.Cm_q]],
    )
    values: dict[str, Any] = {"reference": d.reference, "CA_0": d.CA_0, "Cl_p": d.Cl_p, "system": system}
    return StateSpaceAerodynamics(**(values | changed))
