"""A heaving rectangular wing by Ptera Software: run by `peers.ptera` in the Python that has it.

Its vortex cores, which grow with age in the march and which its own steady solver does not have, are made very thin:
its march then ends in its steady solution, and both programs solve the same problem.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version
from typing import Any

import pterasoftware as ps
from pterasoftware import _aerodynamics_functions

# before anything is compiled; `peers.ptera` gives a compilation cache of its own
_aerodynamics_functions._four_lamb = 0.0

Solver = ps.unsteady_ring_vortex_lattice_method.UnsteadyRingVortexLatticeMethodSolver


def _thin(name: str) -> property:
    """An array of core radii of the solver, ten thousand times smaller."""
    slot = getattr(Solver, name)
    return property(lambda self: 1e-4 * slot.__get__(self), lambda self, value: slot.__set__(self, value))


class ThinCores(Solver):
    """The solver as it is, but for its cores."""

    _currentStackBoundRc0s = _thin("_currentStackBoundRc0s")
    _currentStackWakeRc0s = _thin("_currentStackWakeRc0s")


def solver(case: dict[str, Any], steps: int) -> Any:
    """The march over a number of steps."""
    half = 0.5 * case["span"]
    section = ps.geometry.airfoil.Airfoil(name="naca0012")
    root = ps.geometry.wing_cross_section.WingCrossSection(
        airfoil=section,
        num_spanwise_panels=case["spanwise"],
        chord=case["chord"],
        spanwise_spacing="uniform",
        control_surface_symmetry_type="symmetric",
    )
    tip = ps.geometry.wing_cross_section.WingCrossSection(
        airfoil=section,
        num_spanwise_panels=None,
        chord=case["chord"],
        Lp_Wcsp_Lpp=(0.0, half, 0.0),
        control_surface_symmetry_type="symmetric",
    )
    wing = ps.geometry.wing.Wing(
        wing_cross_sections=[root, tip],
        symmetric=True,
        symmetryNormal_G=(0.0, 1.0, 0.0),
        symmetryPoint_G_Cg=(0.0, 0.0, 0.0),
        num_chordwise_panels=case["chordwise"],
        chordwise_spacing="uniform",
    )
    airplane = ps.geometry.airplane.Airplane(
        wings=[wing], s_ref=case["span"] * case["chord"], c_ref=case["chord"], b_ref=case["span"]
    )
    still = [
        ps.movements.wing_cross_section_movement.WingCrossSectionMovement(base_wing_cross_section=one)
        for one in airplane.wings[0].wing_cross_sections
    ]
    heave = ps.movements.wing_movement.WingMovement(
        base_wing=airplane.wings[0],
        wing_cross_section_movements=still,
        ampLer_Gs_Cgs=(0.0, 0.0, case["amplitude"]),
        periodLer_Gs_Cgs=(0.0, 0.0, case["period"]),
    )
    point = ps.operating_point.OperatingPoint(vCg__E=case["speed"], alpha=case["alpha_deg"], beta=0.0)
    movement = ps.movements.movement.Movement(
        airplane_movements=[
            ps.movements.airplane_movement.AirplaneMovement(base_airplane=airplane, wing_movements=[heave])
        ],
        operating_point_movement=ps.movements.operating_point_movement.OperatingPointMovement(
            base_operating_point=point
        ),
        delta_time=case["time_step"],
        num_steps=steps,
    )
    problem = ps.problems.UnsteadyProblem(movement=movement, only_final_results=False)
    return ThinCores(unsteady_problem=problem)


def main() -> None:
    """March, and print seconds and lift."""
    case = json.loads(sys.argv[1])
    solver(case, 3).run(prescribed_wake=True, calculate_streamlines=False, show_progress=False)
    march = solver(case, case["steps"])
    start = time.process_time()
    march.run(prescribed_wake=True, calculate_streamlines=False, show_progress=False)
    seconds = time.process_time() - start
    lift = [-float(problem.airplanes[0].forceCoefficients_W[2]) for problem in march.steady_problems]
    print(json.dumps({"seconds": seconds, "lift": lift, "version": version("pterasoftware")}))


if __name__ == "__main__":
    main()
