"""Derivatives from flight: what a range measures, linear theory, output error, and how well they are determined."""

from indicial.identification.accuracy import Accuracy, Whiteness
from indicial.identification.coefficients import aerodynamic_coefficient, polynomial_terms, regressor
from indicial.identification.differentiation import differentiate
from indicial.identification.equation_error import EquationError, equation_error
from indicial.identification.estimate import Estimate
from indicial.identification.fit import OutputErrorFit, Verdict
from indicial.identification.instruments import Installation, Sensor, measure_flight
from indicial.identification.lag_support import LagSupport, lag_support
from indicial.identification.linear_theory import LinearTheory, linear_theory
from indicial.identification.maximum_likelihood import fit_manoeuvres
from indicial.identification.measurement import Precision, RangeRecord, measure
from indicial.identification.output_error import estimate, identify, reduce_linearly, start_values
from indicial.identification.output_model import FREE_FLIGHT, OutputModel, build_output_model, substeps_needed
from indicial.identification.problem import Manoeuvre, Parameter
from indicial.identification.reading import read_flight_record
from indicial.identification.record import CHANNEL_UNITS, FlightRecord
from indicial.identification.result import IdentificationResult
from indicial.identification.sensitivity import SensitivityModel

__all__ = [
    "CHANNEL_UNITS",
    "FREE_FLIGHT",
    "Accuracy",
    "EquationError",
    "Estimate",
    "FlightRecord",
    "IdentificationResult",
    "Installation",
    "LagSupport",
    "LinearTheory",
    "Manoeuvre",
    "OutputErrorFit",
    "OutputModel",
    "Parameter",
    "Precision",
    "RangeRecord",
    "SensitivityModel",
    "Sensor",
    "Verdict",
    "Whiteness",
    "aerodynamic_coefficient",
    "build_output_model",
    "differentiate",
    "equation_error",
    "estimate",
    "fit_manoeuvres",
    "identify",
    "lag_support",
    "linear_theory",
    "measure",
    "measure_flight",
    "polynomial_terms",
    "read_flight_record",
    "reduce_linearly",
    "regressor",
    "start_values",
    "substeps_needed",
]
