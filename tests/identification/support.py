"""A flight down a 230 m range, and its measurement, used by several tests."""

import math
from functools import cache
from typing import Any

import numpy as np

from flightsim.support import FINNER, SPEED, derivative_model
from indicial.conventions import Array
from indicial.flightsim import End, InitialState, Trajectory, simulate
from indicial.identification import RangeModel

MODEL = derivative_model()
TRUTH = {"CA_0": 0.55, "CN_alpha": 12.0, "Cm_alpha": -28.0, "Cm_q+Cm_alphadot": -360.0, "Cl_p": -22.0}


def fly_range(
    aerodynamics: Any = MODEL, alpha_deg: float = 2.0, beta_deg: float = 1.0, roll_rate: float = 0.0
) -> Trajectory:
    """230 m of flight at Mach 2, sampled finely enough for its interpolation to be exact to 1e-9."""
    initial = InitialState.from_path(
        SPEED, alpha=math.radians(alpha_deg), beta=math.radians(beta_deg), rate=(roll_rate, 0.0, 0.0)
    )
    return simulate(FINNER, aerodynamics, initial, 1.0, step=2e-4, end=End(x=230.0), estimate_error=False)


@cache
def flight() -> Trajectory:
    """The flight of `MODEL`, not rolling."""
    return fly_range()


@cache
def range_model() -> RangeModel:
    """Of `MODEL`, with what a free flight determines free."""
    return RangeModel.of(FINNER, MODEL)


def truth(names: tuple[str, ...]) -> Array:
    """True values of derivatives."""
    return np.array([TRUTH[name] for name in names])
