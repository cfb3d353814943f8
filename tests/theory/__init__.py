"""Exact solutions as solvers: the oracles that methods, reduced-order models and solvers are tested against."""
