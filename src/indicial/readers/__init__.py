"""Histories of other codes: Fluent, SU2, OpenFOAM and plain tables, with a map of what their files do not say."""

from indicial.readers.diagnosis import Finding
from indicial.readers.mapping import HistoryMap, Mapping, parse_mapping, read_mapping
from indicial.readers.reading import Reading, read_histories, read_history
from indicial.readers.registry import FORMATS, Reader, read_table
from indicial.readers.table import Table

__all__ = [
    "FORMATS",
    "Finding",
    "HistoryMap",
    "Mapping",
    "Reader",
    "Reading",
    "Table",
    "parse_mapping",
    "read_histories",
    "read_history",
    "read_mapping",
    "read_table",
]
