r"""Derivatives by the adjoint: one transposed solve for a load gives what it changes with, all inputs at once.

With ``J^T y = c^T`` the derivative of the load C with respect to any input u is ``D - y^T B``; a second solve,
``J^T z = E^T y``, gives those with respect to the inputs' time derivatives, ``z^T B``. The cost does not grow with the
number of inputs: V_b and omega, their rates of change, Mach number and moment reference come together. The values are
those of `operator` at k = 0.
"""

from __future__ import annotations

from indicial.derivatives import Derivative, DerivativeTable
from indicial.frequency import without_limit
from indicial.motion import FlightCondition, Rates
from indicial.sensitivity import Sensitivities
from indicial.solver import AdjointSolver

LONGITUDINAL = ("alpha", "alphadot", "q")
LATERAL = ("beta", "betadot", "p", "r")


def run(solver: AdjointSolver, condition: FlightCondition, rates: Rates = Rates()) -> Sensitivities:
    """Sensitivities of the six coefficients about one steady state; read them with `derivatives`."""
    return solver.sensitivities(condition, rates)


def derivatives(sensitivities: Sensitivities, source: str = "adjoint") -> DerivativeTable:
    """The records, method ``adjoint``, longitudinal loads with longitudinal motions and lateral with lateral.

    Derivatives without a limit are left out as `operator.derivatives` does, and so are lateral ones of a plane flow.
    """
    s = sensitivities
    wanted = [(load, motion) for load in ("CA", "CN", "Cm") for motion in LONGITUDINAL]
    if not s.plane:
        wanted += [(load, motion) for load in ("CY", "Cl", "Cn") for motion in LATERAL]
    refused = refusals(s)
    return DerivativeTable(
        tuple(
            Derivative.at(s.condition, s.reference, f"{load}_{motion}", "adjoint", s.derivative(load, motion), source)
            for load, motion in wanted
            if f"{load}_{motion}" not in refused
        )
    ).with_sums()


def refusals(sensitivities: Sensitivities) -> dict[str, str]:
    """Derivatives that have no limit as k goes to 0, with the reason; see `operator.refusals`."""
    slopes = {load: sensitivities.derivative(load, "alpha") for load in ("CA", "CN", "Cm")}
    return without_limit(sensitivities.condition, sensitivities.plane, slopes)
