"""Derivatives from a flight test file: every step from the instruments' tables to values with a verdict each."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from indicial.case import FlightTest, read_flight_test
from indicial.conventions import Array
from indicial.errors import IndicialError, InputError
from indicial.flightsim import Dynamics, InitialState, StandardAtmosphere, air_at
from indicial.identification import (
    Compatibility,
    EquationError,
    Estimate,
    FlightRecord,
    Installation,
    Manoeuvre,
    OutputErrorFit,
    Parameter,
    RecordDiagnosis,
    Verdict,
    check_compatibility,
    diagnose,
    equation_error,
    fit_manoeuvres,
    read_flight_record,
    term_model,
    term_names,
    to_centre_of_gravity,
)
from indicial.pipeline.progress import LogReporter, Reporter

_IN_PLANE = ("V", "alpha", "theta", "q", "ax", "az")
_OUT_OF_PLANE = ("beta", "phi", "p", "r", "ay")
_START = ("V", "alpha", "theta", "q"), ("beta", "phi", "p", "r")
_AT_START = 0.05  # of the record: what its start is read from
_OTHER_AIR = 0.02


@dataclass(frozen=True)
class ReducedRecord:
    """A record on its way to the fit.

    Parameters
    ----------
    name : str
    diagnosis : RecordDiagnosis
        Of the table as it was read.
    compatibility : Compatibility or None
        None where the record lacks what the check needs: `notes` say what.
    record : FlightRecord
        Without spikes, at the centre of gravity, without the errors that were found for sure.
    equation_errors : dict
        By coefficient; one that the record cannot give is left out, and told in `notes`.
    notes : tuple of str
        What was not done, and why.
    """

    name: str
    diagnosis: RecordDiagnosis
    compatibility: Compatibility | None
    record: FlightRecord
    equation_errors: dict[str, EquationError]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class FlightTestResult:
    """What a flight test gave.

    Parameters
    ----------
    test : FlightTest
    records : tuple of ReducedRecord
    fit : OutputErrorFit
    verdicts : tuple of Verdict
        On the values expected.
    left_out : int
        Samples left out of the fit as outliers.
    """

    test: FlightTest
    records: tuple[ReducedRecord, ...]
    fit: OutputErrorFit
    verdicts: tuple[Verdict, ...]
    left_out: int

    def by_equation_error(self, name: str) -> Estimate | None:
        """The mean of all records' equation errors, weighted by their variances; None if no record gives it."""
        return _mean(self.records, name)

    def summary(self) -> str:
        """Everything that was found, in the order in which it was."""
        lines = [self.test.title]
        for one in self.records:
            lines += ["", f"record {one.name}: {one.diagnosis.summary()}"]
            lines += [] if one.compatibility is None else [one.compatibility.summary()]
            lines += [f"note: {text}" for text in one.notes]
            lines += [fit.summary() for fit in one.equation_errors.values()]
        lines += ["", self.fit.summary()]
        if self.left_out:
            lines.append(f"  {self.left_out} samples were left out as outliers")
        if self.verdicts:
            lines += ["", "against what was expected", *(f"  {verdict.summary()}" for verdict in self.verdicts)]
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """Every number, as plain values; the schema is in docs/flight_test.md."""
        words = {verdict.estimate.name: verdict for verdict in self.verdicts}
        parameters = []
        for one in self.fit.parameters:
            entry: dict[str, Any] = {"name": one.name, "value": one.value, "standard_error": one.standard_error}
            other = self.by_equation_error(one.name)
            if other is not None:
                entry["equation_error"] = {"value": other.value, "standard_error": other.standard_error}
            if one.name in words:
                told = words[one.name]
                entry["expected"] = {"value": told.before, "standard_error": told.before_error}
                entry["verdict"] = told.verdict
            parameters.append(entry)
        number = len(self.fit.parameters)
        return {
            "schema_version": 1,
            "title": self.test.title,
            "parameters": parameters,
            "fixed": dict(self.test.fixed),
            "correlation": self.fit.correlation[:number, :number].tolist(),
            "findings": [*self.fit.findings, *self.fit.suspicious()],
            "samples_left_out": self.left_out,
            "noise": {
                channel: {"of_the_stated": self.fit.noise[channel], "reflections": self.fit.memory[channel].tolist()}
                for channel in self.fit.noise
            },
            "records": [_told(one) for one in self.records],
        }


def reduce_flight_test(path: str | Path, reporter: Reporter | None = None) -> FlightTestResult:
    """Diagnosis, compatibility, equation error and output error of the records that a flight test file names.

    Parameters
    ----------
    path : str or Path
        See docs/flight_test.md; records and map are looked for beside it.
    reporter : Reporter, optional
        Told what is being done; the log if not given.

    Raises
    ------
    InputError
        If something is missing, or a term has no effect.
    DivergenceError
        If the fit does not converge.
    """
    test, folder = read_flight_test(path), Path(path).parent
    told: Reporter = LogReporter() if reporter is None else reporter
    told.start("Records")
    begun = time.monotonic()
    records = []
    for done, file in enumerate(test.records):
        told.update(done / len(test.records), file)
        records.append(_reduced(test, read_flight_record(folder / file, folder / test.map), Path(file).stem))
    told.finish(time.monotonic() - begun, f"{sum(len(one.record) for one in records)} samples")
    told.start("Output error")
    begun = time.monotonic()
    result = _fitted(test, tuple(records))
    told.finish(time.monotonic() - begun, f"{len(result.fit.parameters)} values in {len(result.fit.cost)} steps")
    return result


def _reduced(test: FlightTest, raw: FlightRecord, name: str) -> ReducedRecord:
    """Steps before the fit; each that a record does not allow is told and left out."""
    notes: list[str] = []
    diagnosis = diagnose(raw)
    record = diagnosis.cleaned()
    place = test.instruments
    there = Installation(
        _triple(place.accelerometers_m), _triple(place.vanes_m), upwash=place.upwash, sidewash=place.sidewash
    )
    if there != Installation():
        record = to_centre_of_gravity(record, there)
    found: Compatibility | None = None
    try:
        found = check_compatibility(record)
        record = found.corrected()
    except IndicialError as error:
        notes.append(f"compatibility of the instruments not checked: {error}")
    record = _with_pressure(test, record, notes)
    fits = {}
    for coefficient, terms in test.terms.items():
        try:
            fits[coefficient] = equation_error(
                record, test.vehicle, coefficient, [t for t in terms if t != "alphadot"], leave_out_outliers=True
            )
        except InputError as error:
            notes.append(f"no equation error of {coefficient}: {error}")
    return ReducedRecord(name, diagnosis, found, record, fits, tuple(notes))


def _triple(place: list[float]) -> tuple[float, float, float]:
    x, y, z = place
    return x, y, z


def _atmosphere(test: FlightTest) -> StandardAtmosphere:
    return StandardAtmosphere(test.air.temperature_offset_K)


def _with_pressure(test: FlightTest, record: FlightRecord, notes: list[str]) -> FlightRecord:
    """The record with dynamic pressure, that of the atmosphere where none was measured; told where the two differ."""
    if "V" not in record.channels:
        return record
    height = record["altitude"] if "altitude" in record.channels else np.full(len(record), test.air.altitude_m)
    known = np.isfinite(height)
    filled = np.interp(record.time, record.time[known], height[known])
    computed = 0.5 * air_at(_atmosphere(test), filled).density * record["V"] ** 2
    if "dynamic_pressure" not in record.channels:
        notes.append("dynamic pressure was not measured: taken from V and the atmosphere")
        return record.with_channels(dynamic_pressure=computed)
    ratio = float(np.nanmedian(record["dynamic_pressure"] / computed))
    if abs(ratio - 1.0) > _OTHER_AIR:
        notes.append(
            f"dynamic pressure is {ratio:.3f} times that of V in the atmosphere that is flown; "
            "air.altitude_m or air.temperature_offset_K?"
        )
    return record


def _fitted(test: FlightTest, records: tuple[ReducedRecord, ...]) -> FlightTestResult:
    """Output error of all records together, from what equation error says."""
    controls = tuple(dict.fromkeys(name for one in records for name in one.record.inputs))
    dynamics = term_model(test.vehicle, test.terms, controls, _atmosphere(test))
    manoeuvres: list[Manoeuvre] = []
    for one in records:
        lacking = [name for name in controls if name not in one.record.inputs]
        if lacking:
            raise InputError(f"record {one.name} lacks the control {lacking[0]}, which another record has")
        model = manoeuvres[0].model if manoeuvres else None
        manoeuvres.append(_manoeuvre(test, one, dynamics, model))
    parameters = [*_parameters(test, records), *(Parameter(f"bias_{c}", 0.0) for c in test.output_error.biases)]
    fit = fit_manoeuvres(manoeuvres, parameters)
    left_out = 0
    if test.output_error.leave_out_outliers:
        cleaned = fit.without_outliers()
        left_out = sum(_known(m.measured) for m in manoeuvres) - sum(_known(m.measured) for m in cleaned)
        if left_out:
            fit = fit_manoeuvres(cleaned, [replace(p, start=fit[p.name].value) for p in parameters])
    before: dict[str, float | tuple[float, float]] = {
        name: (value, test.expected_errors.get(name, 0.0))
        for name, value in test.expected.items()
        if name not in test.fixed and name not in test.prior
    }
    return FlightTestResult(test, records, fit, fit.against(before), left_out)


def _known(values: Array) -> int:
    return int(np.count_nonzero(np.isfinite(values)))


def _manoeuvre(test: FlightTest, one: ReducedRecord, dynamics: Dynamics, model: Any) -> Manoeuvre:
    """A record with the model; without lateral terms it is flown in the plane of symmetry."""
    record, how = one.record, test.output_error
    lateral = "Cl" in test.terms
    seen = (*_IN_PLANE, *_OUT_OF_PLANE) if lateral else _IN_PLANE
    channels = tuple(how.channels) or tuple(name for name in seen if name in record.channels)
    free = _START[0] + (_START[1] if lateral else ())
    at = {name: _at_start(record, name) for name in (*free, "altitude", "psi")}
    if at["V"] is None or at["alpha"] is None:
        raise InputError(f"record {one.name} needs V and alpha, from which its flight starts")
    values = {name: 0.0 if value is None else value for name, value in at.items()}
    altitude = test.air.altitude_m if at["altitude"] is None else at["altitude"]
    start = InitialState.from_path(
        values["V"],
        alpha=values["alpha"],
        beta=values.get("beta", 0.0),
        path_angle=values["theta"] - values["alpha"],
        heading=values["psi"],
        bank=values.get("phi", 0.0),
        rate=(values.get("p", 0.0), values["q"], values.get("r", 0.0)),
        position=(0.0, 0.0, -altitude),
    )
    return Manoeuvre.of_flight(
        record,
        dynamics,
        start,
        channels=channels,
        free_start=free,
        known=test.fixed,
        biases=how.biases,
        segments=how.segments,
        steps_per_interval=how.steps_per_interval,
        model=model,
        name=one.name,
    )


def _at_start(record: FlightRecord, name: str) -> float | None:
    """A channel at the first instant, by a straight line through the first samples; None if it was not measured."""
    if name not in record.channels:
        return None
    known = np.flatnonzero(np.isfinite(record[name]))[: max(5, round(_AT_START * len(record)))]
    if known.size < 2:
        return None
    return float(np.polyval(np.polyfit(record.time[known], record[name][known], 1), record.time[0]))


def _parameters(test: FlightTest, records: tuple[ReducedRecord, ...]) -> list[Parameter]:
    """What is looked for, each from equation error or, failing that, from what is expected."""
    made = []
    for name in term_names(test.terms):
        if name in test.fixed:
            continue
        found = _mean(records, name)
        if found is None and name not in test.expected:
            raise InputError(f"nothing says where {name} starts: no record gives it by equation error; expect a value")
        start = test.expected[name] if found is None else found.value
        bound = (test.expected[name], test.expected_errors[name]) if name in test.prior else None
        made.append(Parameter(name, start, prior=bound))
    return made


def _mean(records: tuple[ReducedRecord, ...], name: str) -> Estimate | None:
    coefficient = name.partition("_")[0]
    given = [
        estimate
        for one in records
        if coefficient in one.equation_errors
        for estimate in one.equation_errors[coefficient].estimates
        if estimate.name == name
    ]
    if not given:
        return None
    weights = np.array([1.0 / max(e.standard_error, 1e-12) ** 2 for e in given])
    value = float(weights @ [e.value for e in given] / weights.sum())
    return Estimate(name, value, float(weights.sum() ** -0.5))


def _told(one: ReducedRecord) -> Mapping[str, Any]:
    errors = () if one.compatibility is None else one.compatibility.errors
    return {
        "name": one.name,
        "samples": len(one.record),
        "diagnosis": [finding.text for finding in one.diagnosis.findings],
        "compatibility": None if one.compatibility is None else list(one.compatibility.findings),
        "instrument_errors": {e.name: {"value": e.value, "standard_error": e.standard_error} for e in errors},
        "notes": list(one.notes),
    }
