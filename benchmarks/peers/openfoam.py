"""OpenFOAM's density-based solver on a mesh of ours that moves rigidly."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

from indicial.cfd.mesh import Mesh
from indicial.cfd.mesh.polymesh import write_polymesh

SOLVER = "rhoCentralDyMFoam"
CASE = Path(__file__).parent / "rho_central"
STEPS = 5
"""Steps over which its clock, which ticks in hundredths of a second, is averaged."""


def available() -> bool:
    """Whether the solver is installed, and OpenFOAM's environment set."""
    return shutil.which(SOLVER) is not None and "WM_PROJECT_DIR" in os.environ


def step_time(mesh: Mesh) -> float:
    """Processor time [s] of one explicit step: second order, limited, inviscid, moving mesh, one core.

    The least mean over a few steps in a row, in the solver's own account. A step is its fluxes, gradients, equation of
    state and the motion of the mesh.

    Raises
    ------
    RuntimeError
        If the solver fails.
    """
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(CASE, folder, dirs_exist_ok=True)
        write_polymesh(mesh, Path(folder) / "constant/polyMesh")
        run = subprocess.run([SOLVER], cwd=folder, capture_output=True, text=True, check=False)
    if run.returncode:
        raise RuntimeError(f"{SOLVER} failed: {run.stderr.strip() or run.stdout[-500:]}")
    clock = [float(t) for t in re.findall(r"ExecutionTime = (\S+) s", run.stdout)]
    return min(b - a for a, b in zip(clock, clock[STEPS:], strict=False)) / STEPS
