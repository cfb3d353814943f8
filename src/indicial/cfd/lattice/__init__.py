"""Unsteady vortex lattice for any set of lifting surfaces."""

from indicial.cfd.lattice.instant import Instant, StripLoads
from indicial.cfd.lattice.march import March, steady_instant
from indicial.cfd.lattice.panels import Lattice, Strips
from indicial.cfd.lattice.solver import LatticeSettings, LatticeSolver
from indicial.cfd.lattice.wake import RigidMotion

__all__ = [
    "Instant",
    "Lattice",
    "LatticeSettings",
    "LatticeSolver",
    "March",
    "RigidMotion",
    "StripLoads",
    "Strips",
    "steady_instant",
]
