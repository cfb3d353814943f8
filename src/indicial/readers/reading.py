"""Histories from the files of other codes, with the motion and the quantities that a map tells of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import COEFFICIENTS, Array, ReferenceQuantities
from indicial.errors import InputError
from indicial.history import History
from indicial.motion import AlphaStep, FlightCondition, Motion, PitchOscillation, PitchRateStep
from indicial.readers import diagnosis, motions
from indicial.readers.axes import FileLoads, body_coefficients, file_loads
from indicial.readers.diagnosis import Finding
from indicial.readers.mapping import HistoryMap, Mapping, read_mapping
from indicial.readers.registry import read_table
from indicial.readers.table import Header, Table, latest

_NOW = 1e-6  # of a time step: instants closer than that are one
_SAME = 0.01  # difference of dynamic pressures that is worth a word
_PITCH_AXIS = {1.0: "right", -1.0: "left"}


@dataclass(frozen=True)
class Reading:
    """A history that was read, and what was found on the way.

    Parameters
    ----------
    history : History
    outputs : tuple of str
        The coefficients that the file tells; the others are zero in `history`.
    findings : tuple of Finding
    """

    history: History
    outputs: tuple[str, ...]
    findings: tuple[Finding, ...]

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """What makes the history doubtful."""
        return tuple(one for one in self.findings if one.severity == "warning")

    def summary(self) -> str:
        """What was read, and every finding, a line each."""
        source = self.history.provenance.get("file", "history")
        head = f"{source}: {', '.join(self.outputs)}; {self.history.summary()}"
        return "\n".join([head, *(f"  {one.summary()}" for one in self.findings)])


def read_histories(path: str | Path, files: Sequence[str | Path] = ()) -> tuple[Reading, ...]:
    """All histories of a map.

    Parameters
    ----------
    path : path
        The map; files in it are relative to its folder.
    files : sequence of paths
        Instead of those in the map, one for each of its histories in their order.

    Raises
    ------
    InputError
        If the map or a file is wrong; the message says what, and what is allowed.
    """
    mapping = read_mapping(path)
    entries = mapping.histories
    if files and len(files) != len(entries):
        raise InputError(
            f"{path}: describes {len(entries)} histories, {len(files)} files are given: give one for each, in its order"
        )
    folder = Path(path).parent
    readings = []
    for i, entry in enumerate(entries):
        own = [Path(files[i])] if files else [folder / one for one in entry.files]
        if not own:
            raise InputError(f"{path}: histories.{i} names no files, and none are given")
        readings.append(read_history(own, mapping, entry, folder))
    return tuple(readings)


def read_history(files: Sequence[Path], mapping: Mapping, entry: HistoryMap, folder: Path = Path()) -> Reading:
    """One history.

    Parameters
    ----------
    files : sequence of Path
        Of one run: see `read_table`.
    mapping : Mapping
    entry : HistoryMap
        Its motion, and the loads before it if the file does not hold them.
    folder : Path
        That of other files named in the map.
    """
    condition, reference = mapping.condition.flight_condition(), mapping.reference.quantities()
    table = read_table(files, mapping.format)
    if table.steady:
        raise InputError(f"{table.source}: its rows are iterations of a steady solution, there is no time in it")
    unit = motions.seconds_per_unit(mapping.time.unit, condition, reference)
    table, clock = _timed(table, mapping)
    used = {name: table[name] for name in mapping.columns.values()}
    diagnosis.refuse_broken(table.source, clock, used)
    motion = motions.motion_of(entry.motion, condition, reference, table, folder, unit)
    time = unit * (clock - entry.motion.start)
    findings = [Finding("note", note) for note in table.notes]
    raw = file_loads(table, mapping.columns, mapping.axes.frame)
    loads, converted = _dimensionless(raw, mapping, table, condition, reference)
    pitch = math.radians(mapping.axes.body_pitch_deg) + _turned(motion, time, mapping, table)
    axis = _pitch_axis(mapping, table)
    loads, outputs = body_coefficients(loads, raw.known, mapping.axes.frame, pitch, axis)
    samples = _Samples(time, loads, outputs, table.source)
    history, more = _assemble(samples, motion, entry, condition, reference)
    return Reading(history, outputs, (*findings, *converted, *more))


def _timed(table: Table, mapping: Mapping) -> tuple[Table, Array]:
    """The table in the order of its time, and that time in the file's unit."""
    column = mapping.time.column or table.time
    if column is not None:
        ordered = latest(table if table.index is not None else replace(table, time=column))
        return ordered, ordered[column]
    if table.index is None:
        raise InputError(f"{table.source}: which column is the time? name it in time.column")
    if mapping.time.step_s is None:
        raise InputError(f"{table.source}: counts steps but holds no time: give time.step_s, or name a column")
    if mapping.time.unit != "s":
        raise InputError("time.step_s is in seconds: time.unit must be 's'")
    return table, mapping.time.step_s * table[table.index]


def _dimensionless(
    raw: FileLoads, mapping: Mapping, table: Table, condition: FlightCondition, reference: ReferenceQuantities
) -> tuple[Array, list[Finding]]:
    """Loads made dimensionless with the condition and the reference quantities."""
    force = condition.dynamic_pressure * reference.area
    to = np.concatenate([np.full(3, force), force * reference.moment_lengths])
    if raw.dimensional:
        return raw.values / to, []
    made = _made_with(mapping, table.header)
    missing = [name for name, value in made.items() if value is None]
    if missing:
        raise InputError(
            f"{table.source}: holds coefficients; made_with must say what they were made with: {', '.join(missing)}"
        )
    length, area, density, speed = (value or 0.0 for value in made.values())
    pressure = 0.5 * density * speed**2
    found = []
    if abs(pressure / condition.dynamic_pressure - 1.0) > _SAME:
        found.append(
            Finding(
                "note",
                f"the file's coefficients are made with a dynamic pressure of {pressure:.5g} Pa, the condition has "
                f"{condition.dynamic_pressure:.5g} Pa: converted",
            )
        )
    own = np.array([1.0, 1.0, 1.0, length, length, length]) * pressure * area
    return raw.values * (own / to), found


def _made_with(mapping: Mapping, header: Header) -> dict[str, float | None]:
    """What the map says, filled up with what the file's header states.

    Raises
    ------
    InputError
        If the two disagree.
    """
    stated = {"length_m": "lRef", "area_m2": "Aref", "speed_m_s": "magUInf"}
    made: dict[str, float | None] = mapping.made_with.model_dump()
    for name, key in stated.items():
        value, own = made[name], header.get(key)
        if not isinstance(own, float):
            continue
        if value is not None and not math.isclose(value, own, rel_tol=1e-4):
            raise InputError(f"made_with.{name} is {value:g}, but the file's header states {key} = {own:g}")
        made[name] = own if value is None else value
    return made


def _turned(motion: Motion, time: Array, mapping: Mapping, table: Table) -> Array:
    """Pitch angle of the body against the file's axes that the motion has made."""
    if not motions.rotates(motion):
        return np.zeros(time.size)
    if mapping.axes.turn_with_body is None:
        raise InputError(
            f"{table.source}: the motion rotates the body: axes.turn_with_body must say whether the file's axes do too"
        )
    if mapping.axes.turn_with_body:
        return np.zeros(time.size)
    after = time >= 0.0
    angle = np.zeros(time.size)
    angle[after] = motions.attitude(motion, time[after])
    return angle


def _pitch_axis(mapping: Mapping, table: Table) -> str:
    """Where the axis of the pitching moment points, in the frame of drag and lift."""
    if mapping.axes.frame != "drag, side, lift" or not {"CmPitch", "My"} & set(mapping.columns):
        return "right"
    stated = mapping.axes.pitch_axis
    directions = [table.header.get(key) for key in ("liftDir", "dragDir", "pitchAxis")]
    vectors = [np.array(one) for one in directions if isinstance(one, tuple)]
    if len(vectors) == 3:
        lift, drag, axis = vectors
        along = float(np.dot(np.cross(lift, drag), axis))
        own = _PITCH_AXIS[math.copysign(1.0, along)]
        if stated not in (None, own):
            raise InputError(f"axes.pitch_axis is {stated!r}, but by the file's header it points {own}")
        return own
    if stated is None:
        raise InputError(
            "axes.pitch_axis must say where the axis of the pitching moment points: 'right' (nose up) or 'left'"
        )
    return stated


@dataclass(frozen=True)
class _Samples:
    """Time since the motion began [s], and coefficients in body axes."""

    time: Array
    loads: Array
    outputs: tuple[str, ...]
    source: str

    @property
    def instant(self) -> float:
        """Times closer together than that are one."""
        return _NOW * float(np.median(np.diff(self.time)))

    @property
    def columns(self) -> list[int]:
        return [COEFFICIENTS.index(name) for name in self.outputs]


def _assemble(
    samples: _Samples, motion: Motion, entry: HistoryMap, condition: FlightCondition, reference: ReferenceQuantities
) -> tuple[History, list[Finding]]:
    time, step = samples.time, isinstance(motion, (AlphaStep, PitchRateStep))
    at_start = np.abs(time) <= samples.instant
    held: Literal["before", "after"] = "after"
    if step and np.any(at_start):
        said = getattr(entry.motion, "row_at_start", None)
        if said is None:
            raise InputError(
                f"{samples.source}: has a row at the very start of the step: motion.row_at_start must say whether it "
                "holds the loads 'before' or 'after' the jump"
            )
        held = said
    earlier = time < -samples.instant
    if held == "before":
        earlier = earlier | at_start
    later = ~earlier
    if np.count_nonzero(later) < 3:
        raise InputError(f"{samples.source}: fewer than three samples after start = {entry.motion.start:g}")
    before = _before(samples, entry, earlier, step)
    t, loads = np.where(at_start, 0.0, time)[later], samples.loads[later]
    first = float(t[0])
    doubt = np.zeros(6)
    if step and first > 0.0:
        initial, doubt = _zero_plus(t, loads)
        t, loads = np.append(0.0, t), np.vstack([initial, loads])
    history = History(
        t, loads, motion.velocity(t), motion.rate(t), before, condition, reference, motion.describe(),
        {"file": samples.source, "outputs": list(samples.outputs)},
    )  # fmt: skip
    columns = samples.columns
    findings = diagnosis.sampling(t[1:] if step and first > 0.0 else t)
    change = np.ptp(np.vstack([before, loads]), axis=0)[columns]
    findings += diagnosis.drift_before(time[earlier], samples.loads[earlier][:, columns], change, samples.outputs)
    if step:
        _, size = next((key, value) for key, value in motion.describe().items() if key != "kind")
        findings += diagnosis.of_step(history, samples.outputs, float(size), first, doubt[columns])
    if isinstance(motion, PitchOscillation):
        findings += diagnosis.of_oscillation(history, samples.outputs)
    return history, findings


def _before(samples: _Samples, entry: HistoryMap, earlier: NDArray[np.bool_], step: bool) -> Array:
    """Loads of the steady state before the motion: given, or of the last row before it."""
    if entry.before is not None:
        given = {str(name): value for name, value in entry.before.items()}
        missing = [name for name in samples.outputs if name not in given]
        if missing:
            raise InputError(f"before: {', '.join(missing)} missing; the file tells {', '.join(samples.outputs)}")
        return np.array([given.get(name, 0.0) for name in COEFFICIENTS])
    if np.any(earlier):
        last: Array = samples.loads[earlier][-1]
        return last
    if step:
        raise InputError(
            f"{samples.source}: has no row before the step: give the steady loads before it, before = "
            "{ CN = ..., Cm = ... } in body axes and with [reference]"
        )
    start: Array = samples.loads[0]
    return start


def _zero_plus(t: Array, loads: Array) -> tuple[Array, Array]:
    """Loads extrapolated to 0+ along the first two samples, and how far three samples lead from there."""
    linear = loads[0] - t[0] * (loads[1] - loads[0]) / (t[1] - t[0])
    curvature = ((loads[2] - loads[1]) / (t[2] - t[1]) - (loads[1] - loads[0]) / (t[1] - t[0])) / (t[2] - t[0])
    return linear, np.abs(curvature * t[0] * t[1])
