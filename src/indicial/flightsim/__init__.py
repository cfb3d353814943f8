"""Flight of a rigid vehicle with unsteady aerodynamics: one symbolic model, flown, linearised and checked."""

from indicial.flightsim.aerodynamics import (
    DERIVATIVES,
    AerodynamicLoads,
    Aerodynamics,
    DerivativeAerodynamics,
    FlowState,
    SymmetricMissile,
    Validity,
)
from indicial.flightsim.aircraft import BodyAxisAerodynamics
from indicial.flightsim.aircraft_closed_forms import classical_modes
from indicial.flightsim.aircraft_damping import AircraftDamping, ModeDamping, aircraft_damping, balanced_flight
from indicial.flightsim.aircraft_modes import aircraft_modes
from indicial.flightsim.atmosphere import Air, Atmosphere, ConstantAtmosphere, StandardAtmosphere, air_at
from indicial.flightsim.comparison import ArmDifference, TrajectoryComparison, compare, swerve
from indicial.flightsim.damping import (
    ArmDamping,
    DampingChange,
    DampingCheck,
    arm_decay,
    check_damping,
    epicyclic_roots,
    holding_roll,
)
from indicial.flightsim.damping_over_k import DampingOverK, damping_over_k
from indicial.flightsim.damping_sensitivity import ArmSensitivity, DampingSensitivity, damping_sensitivity
from indicial.flightsim.deficiency import DeficiencyAerodynamics, DeficiencyTerm
from indicial.flightsim.dynamics import Dynamics, build_dynamics
from indicial.flightsim.earth import WGS84, Earth, FlatEarth
from indicial.flightsim.epicycle import Arm, EpicyclicFit, fit_epicycle, fit_trajectory
from indicial.flightsim.expressions import ALPHA, ALTITUDE, BETA, MACH, TIME, TOTAL_ANGLE, table
from indicial.flightsim.forces import Force, FunctionForce, Motor
from indicial.flightsim.handling_qualities import HandlingQualities, Rating, rate_modes
from indicial.flightsim.in_flow import LoadFunction, fly_in_flow
from indicial.flightsim.initial import InitialState
from indicial.flightsim.linear import LINEAR_OUTPUTS, LinearFlight, linear_flight, matrix_derivatives
from indicial.flightsim.missile_damping import MissileDamping, missile_damping
from indicial.flightsim.mode_decay import fitted_eigenvalue
from indicial.flightsim.mode_sweep import ModeSweep, aircraft_mode_sweep, missile_mode_sweep, sweep_modes
from indicial.flightsim.modes import LinearModel, Mode, Modes, linearise, missile_modes
from indicial.flightsim.monte_carlo import Dispersion, MonteCarlo, monte_carlo
from indicial.flightsim.outputs import OUTPUTS
from indicial.flightsim.signals import Signal
from indicial.flightsim.simulate import End, fly, simulate
from indicial.flightsim.spin_stability import SpinStability, spin_stability
from indicial.flightsim.state_space import ScheduledStateSpaceAerodynamics, StateSpaceAerodynamics
from indicial.flightsim.trajectory import Trajectory
from indicial.flightsim.trim import Trim, Unknown, trim
from indicial.flightsim.turbulence import DrydenTurbulence
from indicial.flightsim.vehicle import Vehicle, axisymmetric_inertia, basic_finner_range_model
from indicial.flightsim.wind import CosineGust, SteadyWind, Wind, WindProfile, Winds

__all__ = [
    "ALPHA",
    "ALTITUDE",
    "BETA",
    "DERIVATIVES",
    "LINEAR_OUTPUTS",
    "MACH",
    "OUTPUTS",
    "TIME",
    "TOTAL_ANGLE",
    "WGS84",
    "AerodynamicLoads",
    "Aerodynamics",
    "Air",
    "AircraftDamping",
    "Arm",
    "ArmDamping",
    "ArmDifference",
    "ArmSensitivity",
    "Atmosphere",
    "BodyAxisAerodynamics",
    "ConstantAtmosphere",
    "CosineGust",
    "DampingChange",
    "DampingCheck",
    "DampingOverK",
    "DampingSensitivity",
    "DeficiencyAerodynamics",
    "DeficiencyTerm",
    "DerivativeAerodynamics",
    "Dispersion",
    "DrydenTurbulence",
    "Dynamics",
    "Earth",
    "End",
    "EpicyclicFit",
    "FlatEarth",
    "FlowState",
    "Force",
    "FunctionForce",
    "HandlingQualities",
    "InitialState",
    "LinearFlight",
    "LinearModel",
    "LoadFunction",
    "MissileDamping",
    "Mode",
    "ModeDamping",
    "ModeSweep",
    "Modes",
    "MonteCarlo",
    "Motor",
    "Rating",
    "ScheduledStateSpaceAerodynamics",
    "Signal",
    "SpinStability",
    "StandardAtmosphere",
    "StateSpaceAerodynamics",
    "SteadyWind",
    "SymmetricMissile",
    "Trajectory",
    "TrajectoryComparison",
    "Trim",
    "Unknown",
    "Validity",
    "Vehicle",
    "Wind",
    "WindProfile",
    "Winds",
    "air_at",
    "aircraft_damping",
    "aircraft_mode_sweep",
    "aircraft_modes",
    "arm_decay",
    "axisymmetric_inertia",
    "balanced_flight",
    "basic_finner_range_model",
    "build_dynamics",
    "check_damping",
    "classical_modes",
    "compare",
    "damping_over_k",
    "damping_sensitivity",
    "epicyclic_roots",
    "fit_epicycle",
    "fit_trajectory",
    "fitted_eigenvalue",
    "fly",
    "fly_in_flow",
    "holding_roll",
    "linear_flight",
    "linearise",
    "matrix_derivatives",
    "missile_damping",
    "missile_mode_sweep",
    "missile_modes",
    "monte_carlo",
    "rate_modes",
    "simulate",
    "spin_stability",
    "sweep_modes",
    "swerve",
    "table",
    "trim",
]
