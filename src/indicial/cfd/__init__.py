"""Solvers: motion in, history out."""

from indicial.cfd.field import FlowField
from indicial.cfd.finite_volume import FiniteVolumeSolver, FlowSettings
from indicial.cfd.march.convergence import ConvergenceHistory

__all__ = ["ConvergenceHistory", "FiniteVolumeSolver", "FlowField", "FlowSettings"]
