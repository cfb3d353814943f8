"""Case, aircraft and flight test files: what they may say, how they are read and checked."""

from indicial.case.aircraft import AircraftFile, read_aircraft
from indicial.case.describe import case_reference
from indicial.case.flight_test import FlightTest, read_flight_test
from indicial.case.model import Case
from indicial.case.reading import parse_case, read_case

__all__ = [
    "AircraftFile",
    "Case",
    "FlightTest",
    "case_reference",
    "parse_case",
    "read_aircraft",
    "read_case",
    "read_flight_test",
]
