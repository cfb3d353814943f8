"""Unsteady vortex lattice for any set of lifting surfaces."""

from indicial.cfd.lattice.instant import Instant, StripLoads
from indicial.cfd.lattice.linear import LinearLattice
from indicial.cfd.lattice.march import March, steady_instant
from indicial.cfd.lattice.panels import Lattice
from indicial.cfd.lattice.polars import NeuralFoil, Polar, PolarSource, PolarTables
from indicial.cfd.lattice.section_solver import (
    ExtrapolationWarning,
    SectionLatticeSolver,
    SectionMarch,
    SectionSettings,
    StripRecord,
)
from indicial.cfd.lattice.separation import SeparationLag, StripSections
from indicial.cfd.lattice.sheets import Strips
from indicial.cfd.lattice.solver import LatticeSettings, LatticeSolver
from indicial.cfd.lattice.state_space import DiscreteLattice, discrete
from indicial.cfd.lattice.steady_states import SteadyStrips
from indicial.cfd.lattice.wake import RigidMotion

__all__ = [
    "DiscreteLattice",
    "ExtrapolationWarning",
    "Instant",
    "Lattice",
    "LatticeSettings",
    "LatticeSolver",
    "LinearLattice",
    "March",
    "NeuralFoil",
    "Polar",
    "PolarSource",
    "PolarTables",
    "RigidMotion",
    "SectionLatticeSolver",
    "SectionMarch",
    "SectionSettings",
    "SeparationLag",
    "SteadyStrips",
    "StripLoads",
    "StripRecord",
    "StripSections",
    "Strips",
    "discrete",
    "steady_instant",
]
