"""MATLAB: a `.mat` file with one struct, for the Control System Toolbox, Simulink or Octave."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np

from indicial.conventions import COEFFICIENTS
from indicial.files import atomic_path
from indicial.rom.state_space import FORMAT, SCHEMA_VERSION, StateSpaceModel

USE = (
    "load('FILE.mat'); sys = ss(model.A, model.B, model.C, model.D, 'InputName', model.inputs, "
    "'OutputName', model.outputs); time is s = 2Vt/c. Inputs are deviations from model.condition: alpha, beta in rad, "
    "p b/2V, q c/2V, r b/2V. Outputs are added to model.baseline (rows: model.coefficients). In seconds at speed V: "
    "dx/dt = (2*V/model.reference.length_m)*(A*x + B*u)."
)
"""What the struct's field `use` says."""


def export_matlab(model: StateSpaceModel, path: Path) -> tuple[Path, ...]:
    """A MATLAB 5 file with a struct `model`: A, B, C, D in reduced time, names, baseline, condition, reference, use."""
    from scipy.io import savemat

    reference = {name: value for name, value in model.reference.to_dict().items() if value is not None}
    values = {
        "format": FORMAT,
        "schema_version": SCHEMA_VERSION,
        "A": model.a,
        "B": model.b,
        "C": model.c,
        "D": model.d,
        "inputs": np.array(model.inputs, dtype=object),
        "outputs": np.array(model.outputs, dtype=object),
        "coefficients": np.array(COEFFICIENTS, dtype=object),
        "baseline": model.baseline[:, None],
        "condition": {name: value for name, value in asdict(model.condition).items() if value is not None},
        "reference": reference,
        "method": model.method,
        "use": USE,
    }
    with atomic_path(path) as temporary:
        savemat(temporary, {"model": values}, oned_as="column")
    return (path,)
