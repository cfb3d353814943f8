"""Meshes of the study.

One ends at the base plane; one has a sting behind the base, for Mach numbers at which the wake acts upstream.
"""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from indicial.cfd import FiniteVolumeSolver, FlowSettings
from indicial.cfd.mesh import Mesh, WideDomain, finned_body_mesh
from indicial.errors import InputError
from indicial.studies.finner.pieces import DOMAINS
from indicial.studies.finner.variants import FINNER, VARIANTS, body_of
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

for _variant in VARIANTS:
    for _kind in ("base", "sting"):
        FINENESS[f"{_kind}+{_variant}"] = FINENESS[_kind]
        NAMES[f"{_kind}+{_variant}"] = f"{NAMES[_kind]}; the body's variant {_variant}"


def finner_mesh(kind: str, level: str, mach: float) -> Mesh:
    """Half a Basic Finner, or half of a variant of it.

    Parameters
    ----------
    kind : {"base", "sting", "sting_wide", "needle"}
        The first two also with a variant of the body, such as ``"sting+half_span"``.
    level : {"quick", "coarse", "medium"}
    mach : float
        The mesh to the base plane follows the bow shock of this Mach number; the one with a sting is for all.
    """
    if kind not in FINENESS or level not in FINENESS[kind]:
        known = "; ".join(f"{name}: {', '.join(levels)}" for name, levels in FINENESS.items())
        raise InputError(f"no mesh {kind!r} of level {level!r}; there are {known}")
    body, domain = body_of(kind), kind.partition("+")[0]
    if follows_shock(kind):
        return finned_body_mesh(body, FINENESS[kind][level], mach=mach)
    return finned_body_mesh(body, FINENESS[kind][level], wake="sting", domain=WideDomain(*DOMAINS[domain]))


def follows_shock(kind: str) -> bool:
    """Whether a kind of mesh is made for one Mach number."""
    return kind.partition("+")[0] == "base"


class Relay:
    """A solver's progress callback whose listener may change from piece to piece."""

    listener: Progress | None = None

    def __call__(self, fraction: float) -> None:
        """Pass it on."""
        if self.listener is not None:
            self.listener(fraction)


RELAY = Relay()


def finner_solver(
    kind: str,
    level: str,
    mach: float,
    moment_reference: float,
    folder: Path | None,
    settings: FlowSettings | None = None,
) -> FiniteVolumeSolver:
    """A solver on that mesh; the one before is used again where it is the same, and starts from its nearest state."""
    flow = FlowSettings() if settings is None else settings
    return _solver(kind, level, mach if follows_shock(kind) else None, moment_reference, folder, flow)


@lru_cache(maxsize=1)
def _solver(
    kind: str, level: str, mach: float | None, moment_reference: float, folder: Path | None, settings: FlowSettings
) -> FiniteVolumeSolver:
    mesh = finner_mesh(kind, level, 0.0 if mach is None else mach)
    states = None if folder is None else folder / "states"
    return FiniteVolumeSolver(mesh, FINNER.reference(moment_reference), settings, folder=states, progress=RELAY)
