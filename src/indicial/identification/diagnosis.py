r"""What is wrong with a flight record, in words, before anything is made of it: each channel by itself and in pairs.

Attitude gyros are held against rates by least squares with coloured residuals:

    angle(t) = a + b t + s I(t - d),        I the integral of the rate,

with the scale s, and the lag d by steps linear in it. For scales the angle is what phi, theta and psi together say that
the vehicle turned about a body axis, beside the rate about it, so that a rate in degrees is told from the other two;
for lags it is one Euler angle beside its rate by p, q and r (equations in `kinematics`).
Air data are held against the standard atmosphere. Noise, biases and scales of vanes
are the matter of `check_compatibility`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from indicial.conventions import Array
from indicial.errors import InputError
from indicial.flightsim import StandardAtmosphere, air_at
from indicial.identification.compatibility import check_accelerations
from indicial.identification.differentiation import HALF_WIDTH
from indicial.identification.least_squares import coloured_covariance, solve
from indicial.identification.outliers import robust_scale, spikes
from indicial.identification.reading import check_size
from indicial.identification.record import FlightRecord, shown_unit
from indicial.identification.unit_guess import guess_unit
from indicial.readers.diagnosis import Finding, sampling

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_STUCK = 20  # samples alike, of a channel that otherwise changes from each to the next
_MISSED = 1.5  # of a channel's own interval
_SURE = 4.0  # standard errors
_WRONG_SCALE = 0.1
_LATE = 0.25  # of the interval of the record
_TURNED = 5.0  # times the noise: what the vehicle must turn by for scales and lags to be told
_ROUNDS = 4
_MOST_LAG = 0.25  # of the record
_STEEP = math.radians(80.0)
_SOUND = (250.0, 360.0)  # m/s
_DENSITY = 1.3  # times that of the standard atmosphere, or less by as much
_SPEEDS = {"kt": 0.514444, "km/h": 1.0 / 3.6, "ft/s": 0.3048}
_PRESSURES = {"hPa": 100.0, "kPa": 1e3, "psf": 47.880259, "psi": 6894.7573}


@dataclass(frozen=True)
class RecordDiagnosis:
    """What is wrong with a record.

    Parameters
    ----------
    findings : tuple of Finding
    spikes : mapping of str to ndarray
        Rows of single samples that stand out, of the channels that have some.
    record : FlightRecord
    """

    findings: tuple[Finding, ...]
    spikes: Mapping[str, NDArray[np.int64]]
    record: FlightRecord

    @property
    def sound(self) -> bool:
        """Whether there is no warning."""
        return not any(finding.severity == "warning" for finding in self.findings)

    def cleaned(self) -> FlightRecord:
        """The record with its spikes as dropouts."""
        changed = {}
        for name, rows in self.spikes.items():
            changed[name] = self.record[name].copy()
            changed[name][rows] = np.nan
        return self.record.with_channels(**changed)

    def summary(self) -> str:
        """One line for each finding."""
        lines = [finding.summary() for finding in self.findings] or ["nothing is wrong"]
        return "\n".join(["diagnosis of the flight record:", *(f"  {line}" for line in lines)])

    def plot(self) -> Figure:
        """The record, its spikes marked."""
        figure = self.record.plot()
        for ax in figure.axes:
            for line in list(ax.lines):
                name = str(line.get_label())
                if name in self.spikes:
                    rows, (_, factor) = self.spikes[name], shown_unit(name)
                    ax.plot(self.record.time[rows], factor * self.record[name][rows], "rx", ms=7)
        return figure


def diagnose(record: FlightRecord) -> RecordDiagnosis:
    """Look for dead channels, dropouts, spikes, wrong units and signs, and late instruments.

    Nothing is refused: what is wrong is told, and what cannot be judged for want of channels is passed over. A spike in
    a rate is taken out before the rate is held against attitude.
    """
    found = list(sampling(record.time))
    marked = {}
    total = sum(int(np.count_nonzero(np.isfinite(values))) for values in record.channels.values())
    for name, values in record.channels.items():
        told, rows = _alone(record, name, values, total)
        found += told
        if rows.size:
            marked[name] = rows
    clean = RecordDiagnosis((), marked, record).cleaned()
    for check in (_attitude, _accelerations, _air, _height, _forces):
        found += check(clean)
    return RecordDiagnosis(tuple(found), MappingProxyType(marked), record)


def _alone(record: FlightRecord, name: str, values: Array, total: int) -> tuple[list[Finding], NDArray[np.int64]]:
    """Of a channel by itself: dead, stuck, dropouts, spikes, too large for its unit; and rows of its spikes."""
    known, none = np.flatnonzero(np.isfinite(values)), np.zeros(0, dtype=np.int64)
    if known.size == 0:
        return [_warning(f"channel {name} has no data at all")], none
    if known.size > 2 and np.ptp(values[known]) == 0.0:
        return [_warning(f"channel {name} does not change: is it dead?")], none
    found = [*_stuck(record.time, name, values, known), *_dropouts(record.time, name, known)]
    try:
        if name not in ("phi", "psi"):
            check_size(name, values, "record")
    except InputError as error:
        found.append(_warning(str(error).removeprefix("record: ")))
    mask, worst = spikes(record.time, values, total)
    rows = np.flatnonzero(mask)
    if rows.size:
        many = f"{rows.size} spikes" if rows.size > 1 else "a spike"
        text = (
            f"channel {name} has {many}, up to {worst:.0f} standard deviations, first at {record.time[rows[0]]:.5g} s"
        )
        found.append(_warning(text))
    return found, rows


def _stuck(time: Array, name: str, values: Array, known: NDArray[np.int64]) -> list[Finding]:
    same = np.diff(values[known]) == 0.0
    if np.mean(same) > 0.5:  # a coarse last digit: being alike says nothing
        return []
    edges = np.diff(np.concatenate([[0], same.astype(int), [0]]))
    first, last = known[np.flatnonzero(edges == 1)], known[np.flatnonzero(edges == -1)]
    length = np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1) + 1
    return [
        _warning(f"channel {name} is stuck from {time[a]:.5g} to {time[b]:.5g} s")
        for a, b, n in zip(first, last, length, strict=True)
        if n >= _STUCK
    ]


def _dropouts(time: Array, name: str, known: NDArray[np.int64]) -> list[Finding]:
    """Gaps between its samples beyond its own interval; a late begin or an early end among them."""
    if known.size < 3:
        return [_warning(f"channel {name} has {known.size} samples only")]
    steps = np.diff(time[known])
    usual = float(np.median(steps))
    gaps = steps[steps > _MISSED * usual]
    lost = (
        float(np.sum(gaps - usual)) + max(0.0, time[known[0]] - time[0]) + max(0.0, time[-1] - time[known[-1]] - usual)
    )
    if lost <= usual:
        return []
    longest = max(float(np.max(gaps, initial=0.0)), time[known[0]] - time[0], time[-1] - time[known[-1]])
    part = lost / (time[-1] - time[0])
    return [Finding("note", f"channel {name} is missing {part:.2g} of the time, at most for {longest:.3g} s")]


def _attitude(record: FlightRecord) -> list[Finding]:
    """Attitude against rates: the unit of each rate by all angles together, then the lag of each angle by all rates."""
    t = record.time
    if not any(name in record.channels for name in ("p", "r", "phi", "psi")):  # a longitudinal record
        if not (_usable(record, "q") and _usable(record, "theta")):
            return []
        pitch = (t, "theta", "q", record["theta"], _filled(t, record["q"]))
        return _scale(*pitch) or _lag(*pitch)
    if not all(_usable(record, name) for name in ("p", "q", "r", "phi", "theta", "psi")):
        return []
    p, q, r, theta = (_filled(t, record[name]) for name in ("p", "q", "r", "theta"))
    phi, psi = (_filled(t, record[name], turning=True) for name in ("phi", "psi"))
    if np.max(np.abs(theta)) > _STEEP:
        return []
    by_angles = _turned_by(np.stack([phi, theta, psi]))
    pairs = tuple(zip(("phi", "theta", "psi"), ("p", "q", "r"), strict=True))
    scales = [f for i, (a, b) in enumerate(pairs) for f in _scale(t, a, b, by_angles[i], (p, q, r)[i])]
    if scales:
        return scales
    turn = q * np.sin(phi) + r * np.cos(phi)
    rates = (p + np.tan(theta) * turn, q * np.cos(phi) - r * np.sin(phi), turn / np.cos(theta))
    shown = (phi, theta, psi)
    known = [np.isfinite(record[a]) for a, _ in pairs]
    return [f for i, (a, b) in enumerate(pairs) for f in _lag(t, a, b, np.where(known[i], shown[i], np.nan), rates[i])]


def _turned_by(angles: Array) -> Array:
    """Integrals of p, q, r that Euler angles phi, theta, psi (3, n) tell, shape (3, n)."""
    phi, theta, _ = 0.5 * (angles[:, 1:] + angles[:, :-1])
    d_phi, d_theta, d_psi = np.diff(angles)
    parts = np.stack(
        [
            d_phi - np.sin(theta) * d_psi,
            np.cos(phi) * d_theta + np.sin(phi) * np.cos(theta) * d_psi,
            -np.sin(phi) * d_theta + np.cos(phi) * np.cos(theta) * d_psi,
        ]
    )
    return np.concatenate([np.zeros((3, 1)), np.cumsum(parts, axis=1)], axis=1)


def _scale(time: Array, angle: str, rate: str, measured: Array, turning: Array) -> list[Finding]:
    fitted = _against_rate(time, measured, turning)
    if fitted is None:
        return []
    (scale, error), _ = fitted
    if abs(scale - 1.0) <= max(_WRONG_SCALE, _SURE * error):
        return []
    guess = _whose_unit(angle, rate, scale)
    return [_warning(f"{angle} changes {scale:.4g} +- {error:.2g} times as far as {rate} says{guess}")]


def _lag(time: Array, angle: str, rate: str, measured: Array, turning: Array) -> list[Finding]:
    fitted = _against_rate(time, measured, turning)
    if fitted is None:
        return []
    _, (lag, error) = fitted
    if abs(lag) <= max(_SURE * error, _LATE * float(np.median(np.diff(time)))):
        return []
    word = "later" if lag > 0.0 else "earlier"
    return [_warning(f"{angle} is {abs(lag):.3g} +- {error:.1g} s {word} than {rate} says")]


def _against_rate(time: Array, measured: Array, rate: Array) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Scale and lag [s] of an angle (NaN where unknown) against its rate, with errors; None if it moves too little."""
    from scipy.interpolate import CubicSpline

    known = np.isfinite(measured)
    angle, since, lag = measured[known], time[known] - time[0], 0.0
    turned = CubicSpline(time, rate).antiderivative()
    for _ in range(_ROUNDS):
        late = np.clip(time[known] - lag, time[0], time[-1])
        columns = np.column_stack([np.ones(angle.size), since, turned(late), turned(late, 1)])
        values, inverse = solve(columns, angle)
        residuals = angle - columns @ values
        moved = np.ptp(columns[:, 2] - np.polyval(np.polyfit(since, columns[:, 2], 1), since))
        if abs(values[2]) * moved < _TURNED * robust_scale(residuals):
            return None
        lag -= float(values[3] / values[2])
        if abs(lag) > _MOST_LAG * (time[-1] - time[0]):
            return None
    covariance, _ = coloured_covariance(columns, residuals, inverse)
    errors = np.sqrt(np.diag(covariance))
    return (float(values[2]), float(errors[2])), (lag, float(errors[3] / abs(values[2])))


def _whose_unit(angle: str, rate: str, scale: float) -> str:
    if abs(scale + 1.0) < _WRONG_SCALE:
        return f": has {angle} or {rate} the other sign?"
    for name, factor in ((angle, scale), (rate, 1.0 / scale)):
        if guess_unit(factor) == "degrees":
            return f": is {name} in degrees?"
    return ""


def _accelerations(record: FlightRecord) -> list[Finding]:
    """Angular accelerations against rates."""
    found = []
    for name in ("p", "q", "r"):
        if _usable(record, name) and _usable(record, f"{name}dot"):
            turning = _filled(record.time, record[f"{name}dot"])
            found += _scale(record.time, name, f"{name}dot", record[name], turning)
    return found


def _height(record: FlightRecord) -> list[Finding]:
    if _usable(record, "altitude") and _usable(record, "z"):
        return _ratio("altitude", "-z", record["altitude"], -record["z"])
    return []


def _ratio(name: str, other: str, measured: Array, expected: Array) -> list[Finding]:
    """Where two channels move together, by how much one is larger; nothing if noise hides it."""
    known = np.isfinite(measured) & np.isfinite(expected)
    if np.count_nonzero(known) < 4:
        return []
    x, y = expected[known] - expected[known].mean(), measured[known] - measured[known].mean()
    if not (np.any(x) and np.any(y)):
        return []
    correlation = float(x @ y) / math.sqrt(float(x @ x) * float(y @ y))
    factor = math.copysign(math.sqrt(float(y @ y) / float(x @ x)), correlation)
    if correlation**2 < 0.9 or abs(factor - 1.0) <= _WRONG_SCALE:
        return []
    words = guess_unit(factor)
    return [_warning(f"{name} is {factor:.4g} times {other}" + (f": {words}?" if words else ""))]


def _air(record: FlightRecord) -> list[Finding]:
    """Speed, Mach number, dynamic pressure and altitude against the standard atmosphere."""
    found: list[Finding] = []
    if not _usable(record, "V"):
        return found
    speed = record["V"]
    if np.nanmedian(speed) <= 0.0:
        return [_warning("V is not positive")]
    if _usable(record, "mach") and np.nanmedian(record["mach"]) > 0.0:
        sound = float(np.nanmedian(speed / record["mach"]))
        if not _SOUND[0] <= sound <= _SOUND[1]:
            guess = _units(_SPEEDS, lambda f: _SOUND[0] <= f * sound <= _SOUND[1], "V")
            found.append(_warning(f"V/mach is {sound:.4g} m/s, which is no speed of sound{guess}"))
    if _usable(record, "dynamic_pressure") and _usable(record, "altitude"):
        ratio = 2.0 * record["dynamic_pressure"] / speed**2 / _standard_density(record["altitude"])
        if np.any(np.isfinite(ratio)):
            times = float(np.nanmedian(ratio))
            if not _plausible(times):
                guess = _units(_SPEEDS, lambda f: _plausible(times / f**2), "V")
                guess = guess or _units(_PRESSURES, lambda f: _plausible(times * f), "dynamic_pressure")
                guess = guess or _units({"ft": 0.3048}, lambda f: _plausible(_at(record, f)), "altitude")
                text = f"2 dynamic_pressure/V^2 is {times:.3g} times the density at that altitude{guess}"
                found.append(_warning(text))
    return found


def _at(record: FlightRecord, factor: float) -> float:
    density = _standard_density(factor * record["altitude"])
    return float(np.nanmedian(2.0 * record["dynamic_pressure"] / record["V"] ** 2 / density))


def _plausible(times: float) -> bool:
    return 1.0 / _DENSITY <= times <= _DENSITY


def _units(factors: Mapping[str, float], fits: Callable[[float], bool], name: str) -> str:
    fitting = [unit for unit, factor in factors.items() if fits(factor)]
    return f": is {name} in {' or '.join(fitting)}?" if fitting else ""


def _standard_density(altitude: Array) -> Array:
    """[kg/m^3], NaN beyond the model."""
    model = StandardAtmosphere()
    low, high = model.altitude_range
    inside = (altitude >= low) & (altitude <= high)
    density = np.full(altitude.shape, np.nan)
    density[inside] = air_at(model, altitude[inside]).density
    return density


def _forces(record: FlightRecord) -> list[Finding]:
    if not all(_usable(record, name) for name in ("ax", "ay", "az")):
        return []
    try:
        check_accelerations(record)
    except InputError as error:
        return [_warning(str(error))]
    return []


def _usable(record: FlightRecord, name: str) -> bool:
    """Whether the record has a channel that moves and has samples enough for slopes."""
    if name not in record.channels:
        return False
    known = record[name][np.isfinite(record[name])]
    return known.size > 2 * HALF_WIDTH and float(np.ptp(known)) > 0.0


def _filled(time: Array, values: Array, turning: bool = False) -> Array:
    known = np.isfinite(values)
    filled: Array = np.interp(time, time[known], np.unwrap(values[known]) if turning else values[known])
    return filled


def _warning(text: str) -> Finding:
    return Finding("warning", text)
