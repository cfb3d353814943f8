"""Case files and aircraft files: what they may say, how they are read and checked."""

from indicial.case.aircraft import AircraftFile, read_aircraft
from indicial.case.describe import case_reference
from indicial.case.model import Case
from indicial.case.reading import parse_case, read_case

__all__ = ["AircraftFile", "Case", "case_reference", "parse_case", "read_aircraft", "read_case"]
