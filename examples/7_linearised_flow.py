"""Every derivative of a missile from one linearised flow, a model projected from it, and that model in flight.

No march anywhere: a steady solution, linear solves with its exact Jacobian, and a state-space model of a few states
that answers to any small motion. The mesh is far too coarse to trust; on a finer one nothing else changes.
"""

import math

import numpy as np

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import finned_body_mesh
from indicial.cfd.shapes import FinnedBody
from indicial.flightsim import End, InitialState, StateSpaceAerodynamics, basic_finner_range_model, simulate
from indicial.methods import operator
from indicial.motion import FlightCondition
from indicial.report.frequency import model_step_figure
from indicial.rom import project
from indicial.rom.inverse import step_responses

body, condition = FinnedBody.basic_finner(), FlightCondition(mach=2.0)
solver = FiniteVolumeSolver(finned_body_mesh(body, 0.5, mach=2.0), body.reference(moment_reference=5.5))

# H(ik), and with it the derivatives at k = 0 and at each k; roll too, on half a body.
response = operator.run(solver, condition, np.geomspace(0.05, 20.0, 12), inputs=("alpha", "q", "p"))
table = operator.derivatives(response)
print(table.select(k=None).summary())
response.plot().savefig("frequency_response.png")

# A model of the loads due to alpha and q, good up to k = 0.5; at k = 0 it is the flow itself.
longitudinal, _ = solver.linearise(condition)
projection = project(longitudinal, k_max=0.5, tolerance=0.01)
model = projection.model
print(projection.summary())
assert projection.met
for name in ("CN_alpha", "Cm_q", "Cm_alphadot"):
    assert abs(model.derivatives().value(name) / table.value(name, k=None) - 1.0) < 1e-4

# Its step responses beside those that H(ik) gives by Fourier's integral: at 0+ both are the piston jump.
s = np.linspace(0.0, 40.0, 200)
rebuilt = step_responses(response, s)
model_step_figure(rebuilt, {"projected": model}, known="from H(ik)").savefig("steps.png")
jump = model.step(s)["alpha"].values[0, model.outputs.index("CN")]
assert abs(jump / rebuilt.channel("CN", "alpha")[1][0] - 1.0) < 1e-6

# The model in the loop of a flight, with the roll damping of the operator.
vehicle = basic_finner_range_model()
aerodynamics = StateSpaceAerodynamics(
    reference=model.reference,
    CA_0=solver.steady(condition)["CA"],
    Cl_p=table.value("Cl_p", k=None),
    system=model.system,
)
start = InitialState.from_path(condition.speed, alpha=math.radians(2.0))
flight = simulate(vehicle, aerodynamics, start, duration=1.0, end=End(x=100.0))
late = np.degrees(np.max(flight.total_angle[flight.position[:, 0] > 80.0]))
print(f"{flight.time[-1]:.3f} s over the range; from 2 degrees the angle has fallen to {late:.2f}")
assert late < 2.0
