"""Gas, fluxes, boundary conditions, the residual and its exact Jacobian."""

from indicial.cfd.flow.gas import GAMMA, STILL_AIR
from indicial.cfd.flow.grid import Grid
from indicial.cfd.flow.jacobian import Jacobian
from indicial.cfd.flow.residual import MeshMotion, Residual

__all__ = ["GAMMA", "STILL_AIR", "Grid", "Jacobian", "MeshMotion", "Residual"]
