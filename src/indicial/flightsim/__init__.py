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
from indicial.flightsim.aircraft import BodyAxisAerodynamics
from indicial.flightsim.atmosphere import Air, Atmosphere, ConstantAtmosphere, StandardAtmosphere, air_at
from indicial.flightsim.comparison import ArmDifference, TrajectoryComparison, compare
from indicial.flightsim.damping import (
    ArmDamping,
    DampingChange,
    DampingCheck,
    check_damping,
    epicyclic_roots,
    holding_roll,
)
from indicial.flightsim.dynamics import Dynamics, build_dynamics
from indicial.flightsim.earth import WGS84, Earth, FlatEarth
from indicial.flightsim.epicycle import Arm, EpicyclicFit, fit_epicycle, fit_trajectory
from indicial.flightsim.initial import InitialState
from indicial.flightsim.modes import LinearModel, Mode, Modes, linearise, missile_modes
from indicial.flightsim.simulate import End, fly, simulate
from indicial.flightsim.trajectory import Trajectory
from indicial.flightsim.vehicle import Vehicle, axisymmetric_inertia, basic_finner_range_model

__all__ = [
    "DERIVATIVES",
    "WGS84",
    "AerodynamicLoads",
    "Aerodynamics",
    "Air",
    "Arm",
    "ArmDamping",
    "ArmDifference",
    "Atmosphere",
    "BodyAxisAerodynamics",
    "ConstantAtmosphere",
    "DampingChange",
    "DampingCheck",
    "DerivativeAerodynamics",
    "Dynamics",
    "Earth",
    "End",
    "EpicyclicFit",
    "FlatEarth",
    "FlowState",
    "InitialState",
    "LinearModel",
    "Mode",
    "Modes",
    "StandardAtmosphere",
    "StateSpaceAerodynamics",
    "SymmetricMissile",
    "Trajectory",
    "TrajectoryComparison",
    "Validity",
    "Vehicle",
    "air_at",
    "axisymmetric_inertia",
    "basic_finner_range_model",
    "build_dynamics",
    "check_damping",
    "compare",
    "epicyclic_roots",
    "fit_epicycle",
    "fit_trajectory",
    "fly",
    "holding_roll",
    "linearise",
    "missile_modes",
    "simulate",
]
