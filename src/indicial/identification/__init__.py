"""Derivatives from flight: range measurements, linear theory, output and filter error, and how well they are known."""

from indicial.identification.accuracy import Whiteness
from indicial.identification.coefficients import aerodynamic_coefficient, polynomial_terms, regressor
from indicial.identification.compatibility import Compatibility, check_compatibility
from indicial.identification.diagnosis import RecordDiagnosis, diagnose
from indicial.identification.differentiation import differentiate
from indicial.identification.equation_error import EquationError, equation_error
from indicial.identification.estimate import Estimate
from indicial.identification.filter_error import filter_error
from indicial.identification.filter_error_fit import FilterErrorFit
from indicial.identification.filtering import Consistency, FilterResult, filter_record
from indicial.identification.fit import OutputErrorFit, Verdict
from indicial.identification.flight_state_model import flight_model, flight_start
from indicial.identification.input_design import Experiment, Promise, Ranking, improve_input, rank_manoeuvres
from indicial.identification.instruments import Installation, Sensor, measure_flight
from indicial.identification.lag_support import LagSupport, lag_support
from indicial.identification.linear_theory import LinearTheory, linear_theory
from indicial.identification.maximum_likelihood import fit_manoeuvres
from indicial.identification.measurement import Precision, RangeRecord, measure
from indicial.identification.multisine import multisines, relative_peak_factor
from indicial.identification.parameter_functions import polynomial, spline
from indicial.identification.problem import Manoeuvre, Parameter
from indicial.identification.profile_likelihood import Profile, profile_likelihood
from indicial.identification.range_columns import RangeReduction, reduce_range
from indicial.identification.range_fit import FREE_FLIGHT, RangeFit, RangeModel, identify, reduce_linearly
from indicial.identification.reading import read_flight_record
from indicial.identification.record import CHANNEL_UNITS, FlightRecord
from indicial.identification.sensitivity import SensitivityModel
from indicial.identification.state_model import Process, StateModel, state_model
from indicial.identification.structure import Structure, model_structure
from indicial.identification.term_model import term_model, term_names
from indicial.identification.to_centre_of_gravity import to_centre_of_gravity

__all__ = [
    "CHANNEL_UNITS",
    "FREE_FLIGHT",
    "Compatibility",
    "Consistency",
    "EquationError",
    "Estimate",
    "Experiment",
    "FilterErrorFit",
    "FilterResult",
    "FlightRecord",
    "Installation",
    "LagSupport",
    "LinearTheory",
    "Manoeuvre",
    "OutputErrorFit",
    "Parameter",
    "Precision",
    "Process",
    "Profile",
    "Promise",
    "RangeFit",
    "RangeModel",
    "RangeRecord",
    "RangeReduction",
    "Ranking",
    "RecordDiagnosis",
    "SensitivityModel",
    "Sensor",
    "StateModel",
    "Structure",
    "Verdict",
    "Whiteness",
    "aerodynamic_coefficient",
    "check_compatibility",
    "diagnose",
    "differentiate",
    "equation_error",
    "filter_error",
    "filter_record",
    "fit_manoeuvres",
    "flight_model",
    "flight_start",
    "identify",
    "improve_input",
    "lag_support",
    "linear_theory",
    "measure",
    "measure_flight",
    "model_structure",
    "multisines",
    "polynomial",
    "polynomial_terms",
    "profile_likelihood",
    "rank_manoeuvres",
    "read_flight_record",
    "reduce_linearly",
    "reduce_range",
    "regressor",
    "relative_peak_factor",
    "spline",
    "state_model",
    "term_model",
    "term_names",
    "to_centre_of_gravity",
]
