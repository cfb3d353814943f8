r"""Instruments' readings moved to the centre of gravity: the inverse of an installation in `measure_flight`.

With r the place of an instrument from the centre of gravity, ``a = a_r - omegadot x r - omega x (omega x r)``, and the
wind at the centre of gravity is that at the vanes less ``omega x r`` (Klein & Morelli, "Aircraft System Identification"
(2006), sec. 10.2). Angular accelerations are the channels pdot, qdot, rdot, or slopes of p, q, r.
"""

from __future__ import annotations

from dataclasses import asdict, replace

import numpy as np

from indicial.conventions import Array, flow_angles, velocity_from_angles
from indicial.errors import InputError
from indicial.identification.differentiation import differentiate
from indicial.identification.instruments import Installation
from indicial.identification.record import FlightRecord

_RATES = ("p", "q", "r")


def to_centre_of_gravity(record: FlightRecord, installation: Installation | None = None) -> FlightRecord:
    """The record as instruments at the centre of gravity would have it.

    Accelerations are NaN where a rate of change is; air data need V, alpha and beta at the same instants.

    Parameters
    ----------
    record : FlightRecord
    installation : Installation, optional
        Where the instruments are; what the record's provenance says if not given.

    Raises
    ------
    InputError
        If nothing says where they are, or a channel that the move needs is lacking.
    """
    place = _place(record) if installation is None else installation
    moved: dict[str, Array] = {}
    felt = tuple(name for name in ("ax", "ay", "az") if name in record.channels)
    omega = np.zeros((len(record), 3))
    if any(place.accelerometers) or any(place.vanes):
        record.require(*_RATES)
        omega = np.stack([record[name] for name in _RATES], axis=1)
    if felt and any(place.accelerometers):
        arm = np.array(place.accelerometers)
        extra = np.cross(_turning(record), arm) + np.cross(omega, np.cross(omega, arm))
        moved |= {name: record[name] - extra[:, "xyz".index(name[1])] for name in felt}
    if any(place.vanes) or place.upwash != 1.0 or place.sidewash != 1.0:
        moved |= _air_data(record, place, omega)
    told = {**record.provenance, "installation": asdict(Installation()), "moved_from": asdict(place)}
    return replace(record.with_channels(**moved), provenance=told)


def _place(record: FlightRecord) -> Installation:
    told = record.provenance.get("installation")
    if told is None:
        raise InputError("nothing says where the instruments are: give their installation")
    return Installation(tuple(told["accelerometers"]), tuple(told["vanes"]), told["upwash"], told["sidewash"])


def _turning(record: FlightRecord) -> Array:
    names = tuple(f"{name}dot" for name in _RATES)
    if all(name in record.channels for name in names):
        return np.stack([record[name] for name in names], axis=1)
    return np.stack([differentiate(name, record.time, record[name]) for name in _RATES], axis=1)


def _air_data(record: FlightRecord, place: Installation, omega: Array) -> dict[str, Array]:
    shown = {name: record[name] for name in ("alpha", "beta") if name in record.channels}
    corrected = {"alpha": place.upwash, "beta": place.sidewash}
    angles = {name: values / corrected[name] for name, values in shown.items()}
    if not any(place.vanes):
        return angles
    record.require("V", "alpha", "beta")
    speed, alpha, beta = record["V"], angles["alpha"], angles["beta"]
    wind = np.full((len(record), 3), np.nan)
    known = np.isfinite(speed) & np.isfinite(alpha) & np.isfinite(beta) & np.all(np.isfinite(omega), axis=1)
    parts = zip(speed[known], alpha[known], beta[known], strict=True)
    wind[known] = [velocity_from_angles(v, a, b) for v, a, b in parts]
    wind -= np.cross(omega, np.array(place.vanes))
    found = np.full((3, len(record)), np.nan)
    found[:, known] = np.stack(flow_angles(wind[known]))
    return dict(zip(("V", "alpha", "beta"), found, strict=True))
