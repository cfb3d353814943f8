"""Solvers: motion in, history out."""

from indicial.cfd.field import FlowField
from indicial.cfd.finite_volume import FiniteVolumeSolver, FlowSettings

__all__ = ["FiniteVolumeSolver", "FlowField", "FlowSettings"]
