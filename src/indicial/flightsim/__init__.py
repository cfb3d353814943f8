"""Flight of a rigid vehicle with unsteady aerodynamics: one symbolic model, flown, linearised and checked."""

from indicial.flightsim.aerodynamics import (
    DERIVATIVES,
    AerodynamicLoads,
    Aerodynamics,
    DerivativeAerodynamics,
    FlowState,
    StateSpaceAerodynamics,
    SymmetricMissile,
    Validity,
)
from indicial.flightsim.atmosphere import Air, Atmosphere, ConstantAtmosphere, StandardAtmosphere, air_at
from indicial.flightsim.dynamics import Dynamics, build_dynamics
from indicial.flightsim.earth import Earth, FlatEarth
from indicial.flightsim.initial import InitialState
from indicial.flightsim.simulate import End, fly, simulate
from indicial.flightsim.trajectory import Trajectory
from indicial.flightsim.vehicle import Vehicle, axisymmetric_inertia, basic_finner_range_model

__all__ = [
    "DERIVATIVES",
    "AerodynamicLoads",
    "Aerodynamics",
    "Air",
    "Atmosphere",
    "ConstantAtmosphere",
    "DerivativeAerodynamics",
    "Dynamics",
    "Earth",
    "End",
    "FlatEarth",
    "FlowState",
    "InitialState",
    "StandardAtmosphere",
    "StateSpaceAerodynamics",
    "SymmetricMissile",
    "Trajectory",
    "Validity",
    "Vehicle",
    "air_at",
    "axisymmetric_inertia",
    "basic_finner_range_model",
    "build_dynamics",
    "fly",
    "simulate",
]
