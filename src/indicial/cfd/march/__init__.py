"""Steady and unsteady solution of the flow residual."""

from indicial.cfd.march.convergence import ConvergenceHistory
from indicial.cfd.march.harmonic import PeriodicState, converge_periodic
from indicial.cfd.march.ilu import BlockILU, Pattern
from indicial.cfd.march.known_solutions import KnownSolutions
from indicial.cfd.march.krylov import KrylovResult, gmres
from indicial.cfd.march.preconditioner import TwoLevel
from indicial.cfd.march.steady import SteadyState, converge
from indicial.cfd.march.unsteady import March, march

__all__ = [
    "BlockILU",
    "ConvergenceHistory",
    "KnownSolutions",
    "KrylovResult",
    "March",
    "Pattern",
    "PeriodicState",
    "SteadyState",
    "TwoLevel",
    "converge",
    "converge_periodic",
    "gmres",
    "march",
]
