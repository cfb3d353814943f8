"""Ptera Software's unsteady ring vortex lattice with its prescribed wake, in a Python of its own.

It is no dependency of ours: install `pterasoftware` anywhere and name that Python in the variable PTERA_PYTHON.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

CASE = Path(__file__).parent / "ptera_case.py"


def interpreter() -> str:
    """The Python that has it."""
    return os.environ.get("PTERA_PYTHON", sys.executable)


def available() -> bool:
    """Whether that Python can import it."""
    found = subprocess.run([interpreter(), "-c", "import pterasoftware"], capture_output=True, check=False)
    return found.returncode == 0


def run(case: dict[str, Any]) -> dict[str, Any]:
    """Solve a heaving wing: ``seconds`` of processor time without compilation, ``lift`` at every step, ``version``.

    Raises
    ------
    RuntimeError
        If the solver fails.
    """
    # PYTHONPATH and the like are ours, not its
    own = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    with tempfile.TemporaryDirectory() as cache:
        done = subprocess.run(
            [interpreter(), str(CASE), json.dumps(case)],
            capture_output=True,
            text=True,
            check=False,
            env=own | {"NUMBA_CACHE_DIR": cache},
        )
    if done.returncode:
        raise RuntimeError(f"Ptera Software failed: {done.stderr.strip()[-500:]}")
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result
