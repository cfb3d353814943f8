"""Meshes of the study.

One ends at the base plane; one has a sting behind the base, for Mach numbers at which the wake acts upstream.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import Mesh, WideDomain, finned_body_mesh
from indicial.cfd.shapes import FinnedBody
from indicial.errors import InputError
from indicial.reference_data import FINNER_DIAMETER
from indicial.studies.finner.pieces import DOMAINS
from indicial.studies.study import Progress

FINENESS = {
    "base": {"quick": 1.0, "coarse": 1.5, "medium": 2.25},
    "sting": {"quick": 0.7, "coarse": 1.0, "medium": 1.5},
    "sting_wide": {"quick": 0.7},
    "needle": {"quick": 0.7},
}
"""Cells along each direction relative to the quick preset of `finned_body_mesh`."""

NAMES = {
    "base": "half body to the base plane",
    "sting": "half body with a sting, from 2 calibres ahead of the nose",
    "sting_wide": "half body with a sting, twice as far behind and beside",
    "needle": "half body with a sting, from 20 calibres ahead of the nose",
}

FINNER = FinnedBody.basic_finner(FINNER_DIAMETER)


def finner_mesh(kind: str, level: str, mach: float) -> Mesh:
    """Half a Basic Finner.

    Parameters
    ----------
    kind : {"base", "sting", "sting_wide", "needle"}
    level : {"quick", "coarse", "medium"}
    mach : float
        The mesh to the base plane follows the bow shock of this Mach number; the one with a sting is for all.
    """
    if kind not in FINENESS or level not in FINENESS[kind]:
        known = "; ".join(f"{name}: {', '.join(levels)}" for name, levels in FINENESS.items())
        raise InputError(f"no mesh {kind!r} of level {level!r}; there are {known}")
    if kind == "base":
        return finned_body_mesh(FINNER, FINENESS[kind][level], mach=mach)
    return finned_body_mesh(FINNER, FINENESS[kind][level], wake="sting", domain=WideDomain(*DOMAINS[kind]))


class Relay:
    """A solver's progress callback whose listener may change from piece to piece."""

    listener: Progress | None = None

    def __call__(self, fraction: float) -> None:
        """Pass it on."""
        if self.listener is not None:
            self.listener(fraction)


RELAY = Relay()


def finner_solver(
    kind: str, level: str, mach: float, moment_reference: float, folder: Path | None
) -> FiniteVolumeSolver:
    """A solver on that mesh; the one before is used again where it is the same, and starts from its nearest state."""
    return _solver(kind, level, mach if kind == "base" else None, moment_reference, folder)


@lru_cache(maxsize=1)
def _solver(
    kind: str, level: str, mach: float | None, moment_reference: float, folder: Path | None
) -> FiniteVolumeSolver:
    mesh = finner_mesh(kind, level, 0.0 if mach is None else mach)
    states = None if folder is None else folder / "states"
    return FiniteVolumeSolver(mesh, FINNER.reference(moment_reference), folder=states, progress=RELAY)
