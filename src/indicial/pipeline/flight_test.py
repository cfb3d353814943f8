"""Derivatives from a flight test file: every step from the instruments' tables to values with a verdict each."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from indicial.case import FlightTest, read_flight_test
from indicial.conventions import Array
from indicial.errors import DivergenceError, IndicialError, InputError
from indicial.flightsim import Dynamics, InitialState, Motor, StandardAtmosphere, air_at
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
    SensitivityModel,
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

THRUST = "thrust"
"""The input of a map that is a force [N] along x through the centre of gravity, and no control."""

_IN_PLANE = ("V", "alpha", "theta", "q", "ax", "az")
_OUT_OF_PLANE = ("beta", "phi", "p", "r", "ay")
_START = ("V", "alpha", "theta", "q"), ("beta", "phi", "p", "r")
_MAY_BE_DEAD = ("alpha", "beta", "phi", "theta", "psi", "altitude")
_AT_START = 0.05  # of the record: what its start is read from
_OTHER_AIR = 0.02
_HEIGHTS = (-5e3, 30e3)


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
    fitted : FlightRecord
        The same, accelerometers where they are: the model of output error knows what they feel there.
    equation_errors : dict
        By coefficient; one that the record cannot give is left out, and told in `notes`.
    notes : tuple of str
        What was not done, and why.
    """

    name: str
    diagnosis: RecordDiagnosis
    compatibility: Compatibility | None
    record: FlightRecord
    fitted: FlightRecord
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
    try:
        result = _fitted(test, tuple(records))
    except DivergenceError as error:
        raise DivergenceError(f"{error}{_suspects(records)}") from error
    told.finish(time.monotonic() - begun, f"{len(result.fit.parameters)} values in {len(result.fit.cost)} steps")
    return result


def _suspects(records: Sequence[ReducedRecord]) -> str:
    """What was found of the records that may be why no fit is had."""
    told = [
        f"{one.name}: {finding.text}"
        for one in records
        for finding in one.diagnosis.findings
        if finding.severity == "warning"
    ]
    told += [f"{one.name}: {text}" for one in records if one.compatibility for text in one.compatibility.findings]
    return f"; of the records, {'; '.join(told)}" if told else ""


def _reduced(test: FlightTest, raw: FlightRecord, name: str) -> ReducedRecord:
    """Steps before the fit; each that a record does not allow is told and left out."""
    notes: list[str] = []
    diagnosis = diagnose(raw)
    record = _alive(diagnosis.cleaned())
    place = test.instruments
    there = Installation(
        _triple(place.accelerometers_m), _triple(place.vanes_m), upwash=place.upwash, sidewash=place.sidewash
    )
    felt = {name: record[name] for name in ("ax", "ay", "az") if name in record.channels}
    if there != Installation():
        record = to_centre_of_gravity(record, there)
    moved = record
    found: Compatibility | None = None
    try:
        found = check_compatibility(record)
        record = found.corrected()
    except IndicialError as error:
        notes.append(f"compatibility of the instruments not checked: {error}")
    record = _with_air(test, record, notes)
    fits = {}
    for coefficient, terms in test.terms.items():
        try:
            fits[coefficient] = equation_error(
                record,
                test.vehicle,
                coefficient,
                [t for t in terms if t != "alphadot"],
                thrust=record.inputs.get(THRUST, 0.0),
                leave_out_outliers=True,
            )
        except InputError as error:
            notes.append(f"no equation error of {coefficient}: {error}")
    felt = {name: values + _taken_out(moved[name], record[name]) for name, values in felt.items()}
    return ReducedRecord(name, diagnosis, found, record, record.with_channels(**felt), fits, tuple(notes))


def _taken_out(moved: Array, corrected: Array) -> float:
    """The bias of an accelerometer, if it was found, with its sign turned."""
    return float(np.nanmean(corrected - moved))


def _alive(record: FlightRecord) -> FlightRecord:
    """Without angles and altitudes that do not change: told by the diagnosis, they would stop or mislead the rest."""
    dead = [name for name in _MAY_BE_DEAD if name in record.channels and not _moves(record, name)]
    left = {name: values for name, values in record.channels.items() if name not in dead}
    return replace(record, channels=left)


def _triple(place: list[float]) -> tuple[float, float, float]:
    x, y, z = place
    return x, y, z


def _atmosphere(test: FlightTest) -> StandardAtmosphere:
    return StandardAtmosphere(test.air.temperature_offset_K)


def _with_air(test: FlightTest, record: FlightRecord, notes: list[str]) -> FlightRecord:
    """With altitude, dynamic pressure and Mach number, those of the atmosphere where none were measured."""
    if "V" not in record.channels:
        return record
    if "altitude" in record.channels:
        height = record["altitude"]
    else:
        height = np.full(len(record), _height(test, record, notes))
        record = record.with_channels(altitude=height)
    known = np.isfinite(height)
    filled = np.interp(record.time, record.time[known], height[known])
    air = air_at(_atmosphere(test), filled)
    computed = 0.5 * air.density * record["V"] ** 2
    if "mach" not in record.channels:
        record = record.with_channels(mach=record["V"] / air.speed_of_sound)
    if "dynamic_pressure" not in record.channels:
        notes.append("dynamic pressure was not measured: taken from V and the atmosphere")
        return record.with_channels(dynamic_pressure=computed)
    ratio = float(np.nanmedian(record["dynamic_pressure"] / computed))
    if abs(ratio - 1.0) > _OTHER_AIR:
        notes.append(
            f"dynamic pressure is {ratio:.3f} times that of V in the atmosphere that is flown, and derivatives by "
            "output error are as much off: air.temperature_offset_K, or a fault of altitude, V or dynamic pressure?"
        )
    return record


def _height(test: FlightTest, record: FlightRecord, notes: list[str]) -> float:
    """Altitude of a record without: the file's, or where the atmosphere is as dense as the record shows."""
    given = test.air.altitude_m
    if given is not None or "dynamic_pressure" not in record.channels:
        height = 0.0 if given is None else given
        notes.append(f"altitude was not measured: {height:g} m, {'by default' if given is None else 'as given'}")
        return height
    densities = 2.0 * record["dynamic_pressure"] / record["V"] ** 2
    known = np.isfinite(densities)
    line = np.polynomial.Polynomial.fit(record.time[known], densities[known], 1)
    density = float(line(record.time[0]))
    air = _atmosphere(test)

    def excess(height: float) -> float:
        return float(air_at(air, height).density) - density

    low, high = _HEIGHTS
    if not excess(high) < 0.0 < excess(low):
        raise InputError(
            f"dynamic_pressure and V make a density of {density:.4g} kg/m^3, that of no altitude from {low:g} to "
            f"{high:g} m: check their units, or give air.altitude_m"
        )
    height = float(brentq(excess, low, high, xtol=1.0))
    notes.append(
        f"altitude was not measured: {height:.0f} m at the start, where the air has the density that dynamic pressure "
        "and V show"
    )
    return height


def _fitted(test: FlightTest, records: tuple[ReducedRecord, ...]) -> FlightTestResult:
    """Output error of all records together, from what equation error says."""
    controls = tuple(dict.fromkeys(name for one in records for name in one.record.inputs))
    motors = [Motor(ca.SX.sym(THRUST), test.vehicle.centre_of_gravity)] if THRUST in controls else []
    deflections = [name for name in controls if name != THRUST]
    dynamics = term_model(test.vehicle, test.terms, deflections, _atmosphere(test), motors)
    manoeuvres: list[Manoeuvre] = []
    biases = _biases(test, records)
    for one in records:
        lacking = [name for name in controls if name not in one.record.inputs]
        if lacking:
            raise InputError(f"record {one.name} lacks the control {lacking[0]}, which another record has")
        manoeuvres.append(_manoeuvre(test, one, dynamics, biases, [m.model for m in manoeuvres]))
    offsets = [Parameter(f"bias_{channel}", 0.0, per_record=True) for channel in biases]
    parameters = [*_parameters(test, records), *offsets]
    fit = fit_manoeuvres(manoeuvres, parameters)
    left_out = 0
    if test.output_error.leave_out_outliers:
        cleaned = fit.without_outliers()
        left_out = sum(_known(m.measured) for m in manoeuvres) - sum(_known(m.measured) for m in cleaned)
        if left_out:
            found = {one.name: one.value for one in fit.parameters}
            fit = fit_manoeuvres(cleaned, [replace(p, start=found.get(p.name, p.start)) for p in parameters])
    before: dict[str, float | tuple[float, float]] = {
        name: (value, test.expected_errors.get(name, 0.0))
        for name, value in test.expected.items()
        if name not in test.fixed and name not in test.prior
    }
    return FlightTestResult(test, records, fit, fit.against(before), left_out)


def _known(values: Array) -> int:
    return int(np.count_nonzero(np.isfinite(values)))


def _manoeuvre(
    test: FlightTest,
    one: ReducedRecord,
    dynamics: Dynamics,
    biases: Sequence[str],
    compiled: Sequence[SensitivityModel],
) -> Manoeuvre:
    """A record with the model; without lateral terms it is flown in the plane of symmetry."""
    record, how = one.fitted, test.output_error
    lateral = "Cl" in test.terms
    channels = _channels(test, record)
    free = _START[0] + (_START[1] if lateral else ())
    at = {name: _at_start(record, name) for name in (*free, "altitude", "psi")}
    if at["V"] is None or at["alpha"] is None:
        raise InputError(f"record {one.name} needs V and alpha, from which its flight starts")
    values = {name: 0.0 if value is None else value for name, value in at.items()}
    start = InitialState.from_path(
        values["V"],
        alpha=values["alpha"],
        beta=values.get("beta", 0.0),
        path_angle=values["theta"] - values["alpha"],
        heading=values["psi"],
        bank=values.get("phi", 0.0),
        rate=(values.get("p", 0.0), values["q"], values.get("r", 0.0)),
        position=(0.0, 0.0, -values["altitude"]),
    )
    return Manoeuvre.of_flight(
        record,
        dynamics,
        start,
        channels=channels,
        free_start=free,
        known=test.fixed,
        biases=[name for name in biases if name in channels],
        segments=how.segments,
        steps_per_interval=how.steps_per_interval,
        installation=Installation(_triple(test.instruments.accelerometers_m)),
        model=next((model for model in compiled if model.channels == channels), None),
        name=one.name,
    )


def _channels(test: FlightTest, record: FlightRecord) -> tuple[str, ...]:
    """What is fitted of a record."""
    seen = (*_IN_PLANE, *_OUT_OF_PLANE) if "Cl" in test.terms else _IN_PLANE
    return tuple(test.output_error.channels) or tuple(name for name in seen if _moves(record, name))


def _biases(test: FlightTest, records: Sequence[ReducedRecord]) -> list[str]:
    """Channels with an offset in each record: those asked for, and those whose offset was found and taken out.

    What was taken out has an error, which would be missing from that of the constants if the fit did not know of it.
    """
    found = [name for one in records if one.compatibility for name in one.compatibility.biased]
    fitted = {name for one in records for name in _channels(test, one.record)}
    return list(dict.fromkeys([*test.output_error.biases, *(name for name in found if name in fitted)]))


def _moves(record: FlightRecord, name: str) -> bool:
    """Whether a channel is there and not dead: a dead one is told by the diagnosis, and would stop the fit."""
    if name not in record.channels:
        return False
    known = record[name][np.isfinite(record[name])]
    return known.size > 0 and bool(np.ptp(known) > 0.0)


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
            wanted = f"no equation error of {name.partition('_')[0]}"
            why = next((note for one in records for note in one.notes if note.startswith(wanted)), wanted)
            raise InputError(f"nothing says where {name} starts: {why}; leave the term out, or expect a value")
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
