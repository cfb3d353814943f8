"""An airfoil in subsonic flow: derivatives at k = 0 and above, sensitivities by the adjoint, two degrees of pitch.

In plane subsonic flow the wake leaves some derivatives without a limit as k goes to 0: they are refused there and given
at each k. The mesh is coarse and its far field near, for speed.
"""

import math

from indicial.cfd import FiniteVolumeSolver
from indicial.cfd.mesh import airfoil_mesh
from indicial.cfd.shapes import Airfoil
from indicial.conventions import ReferenceQuantities
from indicial.methods import adjoint, operator, reduced_frequency
from indicial.motion import FlightCondition

k = 0.1
chord = 1.0  # m; the layer of cells is as wide, so that the area is chord times 1 m
mesh = airfoil_mesh(Airfoil.naca("0012"), chord, n_around=48, n_normal=24, farfield=50.0)
reference = ReferenceQuantities(length=chord, area=chord**2, moment_reference=(0.25 * chord, 0.0, 0.0))
solver = FiniteVolumeSolver(mesh, reference)
condition = FlightCondition(mach=0.5)

response = operator.run(solver, condition, [k])
table = operator.derivatives(response)
print(table.summary())
for reason in operator.refusals(response).values():
    print("refused:", reason)

# The adjoint: two linear solutions a load, whatever the number of things that it changes with.
sensitivities = adjoint.run(solver, condition)
print(sensitivities.summary())
assert abs(sensitivities.derivative("CN", "alpha") / table.value("CN_alpha", k=None) - 1.0) < 1e-5

# An amplitude that is not small, by two harmonics; where the flow is subcritical it still is nearly linear.
periodic = reduced_frequency.run(solver, condition, amplitude=math.radians(2.0), k=k, harmonics=2)
print(periodic.summary())
periodic.plot("Cm").figure.savefig("loop.png")
small = operator.pitch_oscillation(response, "CN", k)[0]
assert abs(periodic.derivatives().value("CN_alpha") / small - 1.0) < 0.02
