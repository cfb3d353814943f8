"""Reduced-order models: step responses in, loads under any motion out; each model is a `Solver`."""

from indicial.rom.balancing import Truncation, truncate
from indicial.rom.building import BuiltModel, build_model
from indicial.rom.check import CheckedCoefficient, PredictionCheck, check_prediction
from indicial.rom.comparison import Compared, Comparison, compare
from indicial.rom.convolution import ConvolutionModel
from indicial.rom.deficiency import DeficiencyIntegral, deficiency, deficiency_integral
from indicial.rom.identification import identify
from indicial.rom.model import ReducedModel
from indicial.rom.nonlinear import NonlinearModel, nonlinear_model
from indicial.rom.projection import HeldOut, OrderTrial, Projection, project
from indicial.rom.quasi_steady import QuasiSteadyError, QuasiSteadyModel, quasi_steady_error
from indicial.rom.realisation import realise
from indicial.rom.record_length import RecordLength, record_length
from indicial.rom.response import StepResponse, StepResponses
from indicial.rom.schedule import LeftOut, ScheduledModel, best_schedule, leave_one_out, schedule
from indicial.rom.state_space import Candidate, ChannelError, StateSpaceModel
from indicial.rom.streaming import Stream, advance, stream
from indicial.rom.uncertainty import PredictedBand, UncertainModel, refine_model

__all__ = [
    "BuiltModel",
    "Candidate",
    "ChannelError",
    "CheckedCoefficient",
    "Compared",
    "Comparison",
    "ConvolutionModel",
    "DeficiencyIntegral",
    "HeldOut",
    "LeftOut",
    "NonlinearModel",
    "OrderTrial",
    "PredictedBand",
    "PredictionCheck",
    "Projection",
    "QuasiSteadyError",
    "QuasiSteadyModel",
    "RecordLength",
    "ReducedModel",
    "ScheduledModel",
    "StateSpaceModel",
    "StepResponse",
    "StepResponses",
    "Stream",
    "Truncation",
    "UncertainModel",
    "advance",
    "best_schedule",
    "build_model",
    "check_prediction",
    "compare",
    "deficiency",
    "deficiency_integral",
    "identify",
    "leave_one_out",
    "nonlinear_model",
    "project",
    "quasi_steady_error",
    "realise",
    "record_length",
    "refine_model",
    "schedule",
    "stream",
    "truncate",
]
