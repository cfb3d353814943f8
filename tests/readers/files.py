"""The exact supersonic plate in the files of other codes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from indicial.conventions import Array, ReferenceQuantities, time_from_reduced
from indicial.history import History
from indicial.motion import AlphaStep, FlightCondition, Motion, PitchOscillation, PitchRateStep
from theory.plate import SupersonicPlate

REFERENCE = ReferenceQuantities(length=0.5, area=0.3, moment_reference=(0.2, 0.0, 0.0))
CONDITION = FlightCondition(mach=2.0, temperature=280.0, pressure=9e4)
PLATE = SupersonicPlate(REFERENCE, chord=0.5, span=0.7)
AMPLITUDE = np.radians(0.5)
RATE = 0.01 * 2.0 * CONDITION.speed / REFERENCE.length
PERIOD = PitchOscillation.from_reduced_frequency(CONDITION, REFERENCE, AMPLITUDE, 0.2).period

CODE_LENGTH, CODE_AREA, CODE_DENSITY, CODE_SPEED = 1.0, 2.0, 1.1, 300.0
"""What the code is told for its coefficients: none of it that of the condition."""


def seconds(s: Array | float) -> Array:
    return np.asarray(time_from_reduced(s, CONDITION.speed, REFERENCE.length))


def history(kind: str, times: Array) -> History:
    motions: dict[str, Motion] = {
        "alpha": AlphaStep(CONDITION, AMPLITUDE),
        "q": PitchRateStep(CONDITION, RATE),
        "pitch": PitchOscillation.from_reduced_frequency(CONDITION, REFERENCE, AMPLITUDE, 0.2),
    }
    return PLATE.unsteady(CONDITION, motions[kind], times)


def newtons(one: History) -> Array:
    """Forces and moments in mesh axes (x aft, y right, z up), shape (n, 6), written down here a second time."""
    qs = CONDITION.dynamic_pressure * REFERENCE.area
    c = one.coefficients
    signs = np.array([1.0, 1.0, 1.0, -1.0, 1.0, -1.0])  # CA aft, CY right, CN up; roll and yaw the other way round
    return np.asarray(c * signs * qs * np.array([1.0, 1.0, 1.0, 0.5, 0.5, 0.5]))


def code_coefficients(one: History) -> Array:
    force = 0.5 * CODE_DENSITY * CODE_SPEED**2 * CODE_AREA
    return newtons(one) / (force * np.array([1.0, 1.0, 1.0, CODE_LENGTH, CODE_LENGTH, CODE_LENGTH]))


def base_map(**changes: Any) -> dict[str, Any]:
    content: dict[str, Any] = {
        "condition": {"mach": 2.0, "alpha_deg": 0.0, "temperature_K": 280.0, "pressure_Pa": 9e4},
        "reference": {"length_m": 0.5, "area_m2": 0.3, "moment_reference_m": [0.2, 0.0, 0.0]},
        "made_with": {
            "length_m": CODE_LENGTH,
            "area_m2": CODE_AREA,
            "density_kg_m3": CODE_DENSITY,
            "speed_m_s": CODE_SPEED,
        },
        "time": {"unit": "s"},
        "axes": {"frame": "x aft, z up", "body_pitch_deg": 0.0, "turn_with_body": True},
        "columns": {"Cz": "cz", "Cmy": "cm"},
        "histories": [{"motion": ALPHA, "before": {"CN": 0.0, "Cm": 0.0}}],
    }
    return {**content, **changes}


ALPHA = {"kind": "alpha_step", "amplitude_deg": 0.5, "start": 0.0}


def fluent(path: Path, columns: dict[str, Array], *, title: str = "loads") -> Path:
    names = " ".join(f'"{name}"' for name in columns)
    first = list(columns)[1]
    lines = [f'"{title}-rfile"', f'"Time Step" "{first} etc.."', f"({names})"]
    for row in zip(*columns.values(), strict=True):
        shown = [str(int(v)) if name == "Time Step" else f"{v:.15g}" for name, v in zip(columns, row, strict=True)]
        lines.append(" ".join(shown))
    path.write_text("\n".join(lines) + "\n")
    return path


def su2(path: Path, columns: dict[str, Array]) -> Path:
    head = ",".join(f'"{name}"' if "Iter" in name else f"{chr(34) + name + chr(34):^18}" for name in columns)
    rows = [",".join(f"{v:>18.15g}" for v in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


def openfoam(path: Path, header: dict[str, Any], columns: dict[str, Array]) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = ["# Force and moment coefficients"]
    for key, value in header.items():
        shown = f"({value[0]:e} {value[1]:e} {value[2]:e})" if isinstance(value, tuple) else f"{value:e}"
        lines.append(f"# {key:<12}: {shown}")
    lines += ["#", "# " + "\t".join(f"{name:<16}" for name in columns)]
    lines += ["\t".join(f"{v:<16.12e}" for v in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n")
    return path
