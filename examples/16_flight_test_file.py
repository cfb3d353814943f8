"""A flight test as its files are: simulated, written as an instrument system would, and reduced by one call.

Given a folder, the files are written there and stay: so the packaged ones in data/flight_tests were made. From the
command line ``indicial identify FOLDER/light_aircraft.toml`` does the same.
"""

import csv
import math
import sys
import tempfile
from pathlib import Path

import numpy as np

from indicial.conventions import ReferenceQuantities
from indicial.flightsim import InitialState, Signal, StandardAtmosphere, Vehicle, fly
from indicial.identification import Installation, Sensor, measure_flight, term_model
from indicial.pipeline.flight_test import reduce_flight_test

TERMS = {
    "CX": ["alpha", "alpha^2"],
    "CZ": ["alpha", "q", "elevator"],
    "Cm": ["alpha", "q", "elevator"],
    "CY": ["beta", "rudder"],
    "Cl": ["beta", "p", "r", "aileron"],
    "Cn": ["beta", "p", "r", "rudder"],
}
TRUTH = {
    **{"CX_0": -0.045, "CX_alpha": 0.15, "CX_alpha^2": 3.0},
    **{"CZ_0": -0.28, "CZ_alpha": -4.9, "CZ_q": -7.0, "CZ_elevator": -0.43},
    **{"Cm_0": 0.03, "Cm_alpha": -0.65, "Cm_q": -13.5, "Cm_elevator": -1.25},
    **{"CY_0": 0.0, "CY_beta": -0.45, "CY_rudder": 0.16},
    **{"Cl_0": 0.0, "Cl_beta": -0.085, "Cl_p": -0.48, "Cl_r": 0.11, "Cl_aileron": 0.16},
    **{"Cn_0": 0.0, "Cn_beta": 0.075, "Cn_p": -0.035, "Cn_r": -0.10, "Cn_rudder": -0.07},
}
INERTIA = np.array([[1285.0, 0.0, -60.0], [0.0, 1825.0, 0.0], [-60.0, 0.0, 2670.0]])
VEHICLE = Vehicle(
    "light aircraft", 1045.0, INERTIA, ReferenceQuantities(1.49, 16.2, lateral_length=10.9), (0.0, 0.0, 0.0)
)
BOOM = Installation(accelerometers=(0.2, 0.0, 0.1), vanes=(1.8, 0.0, 0.0))
DEGREE, KNOT, FOOT, G = math.radians(1.0), 1852.0 / 3600.0, 0.3048, 9.80665
COLUMNS = {  # of the instrument system: channel, unit in the file, its size in SI units, decimals
    "TAS [kt]": ("V", "kt", KNOT, 3),
    "AOA [deg]": ("alpha", "deg", DEGREE, 4),
    "AOS [deg]": ("beta", "deg", DEGREE, 4),
    "P [deg/s]": ("p", "deg/s", DEGREE, 4),
    "Q [deg/s]": ("q", "deg/s", DEGREE, 4),
    "R [deg/s]": ("r", "deg/s", DEGREE, 4),
    "NX [g]": ("ax", "g", G, 5),
    "NY [g]": ("ay", "g", G, 5),
    "NZ [g]": ("az", "g", -G, 5),
    "PHI [deg]": ("phi", "deg", DEGREE, 4),
    "THETA [deg]": ("theta", "deg", DEGREE, 4),
    "PSI [deg]": ("psi", "deg", DEGREE, 4),
    "ALT [ft]": ("altitude", "ft", FOOT, 2),
    "QBAR [hPa]": ("dynamic_pressure", "hPa", 100.0, 4),
}


def steps(time: np.ndarray, moves: dict[tuple[float, float], float]) -> np.ndarray:
    """Deflections held from one time to another [deg], as radians, over three samples from one to the next."""
    wanted = np.zeros(time.size)
    for (begin, end), angle in moves.items():
        wanted[(time >= begin) & (time < end)] = angle * DEGREE
    return np.convolve(np.pad(wanted, 2, mode="edge"), np.full(3, 1.0 / 3.0), mode="same")[2:-2]


def fly_and_write(folder: Path, name: str, moves: dict[str, dict[tuple[float, float], float]], seed: int) -> None:
    """One flight of 12 s, as a table of 25 samples a second."""
    time = np.arange(0.0, 12.0 + 1e-9, 0.04)
    controls = {c: Signal(time, steps(time, moves.get(c, {}))) for c in ("elevator", "aileron", "rudder")}
    controls["elevator"] = Signal(time, controls["elevator"].value + 1.05 * DEGREE)
    model = term_model(VEHICLE, TERMS, tuple(controls), StandardAtmosphere())
    start = InitialState.from_path(58.0, alpha=0.011, path_angle=-0.13, position=(0.0, 0.0, -1200.0))
    flight = fly(model, start, 12.0, method="dop853", step=0.02, parameters={**TRUTH, **controls})
    noise = {
        "V": 0.15,
        "alpha": 2e-3,
        "beta": 2e-3,
        "ax": 0.03,
        "ay": 0.03,
        "az": 0.05,
        "p": 1e-3,
        "q": 1e-3,
        "r": 1e-3,
    }
    noise |= {"phi": 2e-3, "theta": 1e-3, "psi": 2e-3, "altitude": 0.5, "dynamic_pressure": 8.0}
    bias = {"q": 4e-3, "alpha": 0.012}
    sensors = {c: Sensor(25.0, white=sd, bias=bias.get(c, 0.0)) for c, sd in noise.items()}
    record = measure_flight(flight, VEHICLE, sensors, seed=seed, inputs=controls, installation=BOOM)
    with (folder / f"{name}.csv").open("w", newline="", encoding="utf-8") as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(["TIME [ms]", *COLUMNS, "DE [deg]", "DA [deg]", "DR [deg]"])
        for row, instant in enumerate(record.time):
            seen = [f"{record[c][row] / size:.{digits}f}" for c, _, size, digits in COLUMNS.values()]
            moved = [f"{record[c][row] / DEGREE:.4f}" for c in controls]
            table.writerow([f"{1000.0 * instant:.0f}", *seen, *moved])


def write_files(folder: Path) -> Path:
    """Two records, the map of their columns, and the flight test file."""
    pitch = {(1.0, 2.0): 3.0, (2.0, 2.7): -3.0, (2.7, 3.1): 3.0, (3.1, 3.5): -3.0}
    roll = {"aileron": {(1.0, 1.8): 4.0, (1.8, 2.6): -4.0}, "rudder": {(5.0, 6.0): 5.0, (6.0, 7.0): -5.0}}
    fly_and_write(folder, "light_aircraft_pitch", {"elevator": pitch}, seed=1)
    fly_and_write(folder, "light_aircraft_roll", roll, seed=2)
    lines = ["# Columns of the instrument system.", "", "[time]", 'column = "TIME [ms]"', 'unit = "ms"']
    for column, (channel, unit, size, _) in COLUMNS.items():
        lines += ["", f"[channels.{channel}]", f'column = "{column}"', f'unit = "{unit}"']
        lines += ["sign = -1 # up in the file"] if size < 0.0 else []
    for column, control in {"DE": "elevator", "DA": "aileron", "DR": "rudder"}.items():
        lines += ["", f"[inputs.{control}]", f'column = "{column} [deg]"', 'unit = "deg"']
    (folder / "light_aircraft_map.toml").write_text("\n".join([*lines, ""]), encoding="utf-8")
    file = folder / "light_aircraft.toml"
    file.write_text(FLIGHT_TEST, encoding="utf-8")
    return file


FLIGHT_TEST = """\
# A light aircraft's elevator 3-2-1-1 and its aileron and rudder doublets, simulated, with noise, biases and a boom.
# Every key, its unit and what it allows: docs/flight_test.md.

schema_version = 1
title = "Light aircraft, 3-2-1-1 and doublets"
records = ["light_aircraft_pitch.csv", "light_aircraft_roll.csv"]
map = "light_aircraft_map.toml"

[reference]
chord_m = 1.49
span_m = 10.9
area_m2 = 16.2

[mass] # body axes, about the centre of gravity
mass_kg = 1045.0
Ixx_kg_m2 = 1285.0
Iyy_kg_m2 = 1825.0
Izz_kg_m2 = 2670.0
Ixz_kg_m2 = 60.0

[instruments] # from the centre of gravity: forward, right, down
accelerometers_m = [0.2, 0.0, 0.1]
vanes_m = [1.8, 0.0, 0.0]

[longitudinal]
CX = ["alpha", "alpha^2"]
CZ = ["alpha", "q", "elevator"]
Cm = ["alpha", "q", "elevator"]

[lateral]
CY = ["beta", "rudder"]
Cl = ["beta", "p", "r", "aileron"]
Cn = ["beta", "p", "r", "rudder"]

[expected] # as a handbook would have them: some right, some not
CZ_alpha = -5.2
Cm_alpha = -0.60
Cm_q = -17.0
Cl_p = -0.47
Cn_r = -0.095

[expected_errors]
CZ_alpha = 0.3
Cm_alpha = 0.06
Cm_q = 1.0
Cl_p = 0.03
Cn_r = 0.02
"""


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        result = reduce_flight_test(write_files(Path(sys.argv[1] if len(sys.argv) > 1 else temporary)))
        print(result.summary())
        for name, value in TRUTH.items():
            assert abs(result.fit[name].value - value) < 4.5 * result.fit[name].standard_error, name
        assert {v.estimate.name: v.verdict for v in result.verdicts}["Cm_q"] == "shifted"
