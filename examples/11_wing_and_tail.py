"""A wing with a tail by the unsteady vortex lattice: derivatives by three methods, H(ik), a state space in steps.

Inviscid, attached flow; everything here takes seconds.
"""

import math

from indicial.cfd.lattice import Lattice, LatticeSolver, discrete
from indicial.cfd.shapes import LiftingSurface, WingSection
from indicial.methods import forced_oscillation, moving_frame, operator
from indicial.motion import FlightCondition

section = WingSection.naca("23012")
wing = LiftingSurface.wing(
    "wing", span=6.0, root_chord=1.0, taper=0.6, sweep=math.radians(15.0), dihedral=math.radians(4.0),
    sections=(section, section),
)  # fmt: skip
tail = LiftingSurface.wing("tail", span=2.0, root_chord=0.5, root_leading_edge=(4.0, 0.8))
lattice = Lattice.of([wing, tail], chordwise=4, spanwise={"wing": 10, "tail": 5})
print(lattice.summary())
solver = LatticeSolver(lattice, wing.reference((0.45, 0.0, 0.0)))
condition = FlightCondition(mach=0.2, alpha=math.radians(3.0))

# The operator: all motions at k = 0 and at any k.
k = 0.2
response = operator.run(solver, condition, [k], ("alpha", "q", "beta", "p", "r"))
table = operator.derivatives(response)
print(table.summary())

# The moving frame: differences of steady flows, the wake of a rotation on its helix.
frame = moving_frame.run(solver, condition, ("alpha", "q", "p"))
print(frame.summary())
for name in ("CN_alpha", "Cm_q", "Cl_p"):
    assert abs(frame[name] / table.value(name, k=None) - 1.0) < 2e-3

# A forced oscillation: at k, not at 0.
history = forced_oscillation.run(solver, condition, math.radians(1.0), k, periods=2, steps_per_period=60)
reading = forced_oscillation.fourier(history, 1)
print(reading.summary())
assert abs(reading.value("Cm") / table.value("Cm_q+Cm_alphadot", k=k) - 1.0) < 0.02

# A discrete state space, about a flight without lift.
plain = LatticeSolver(
    Lattice.of(LiftingSurface.wing("wing", 6.0, 1.0), chordwise=3, spanwise=4), wing.reference((0.25, 0, 0))
)
model = discrete(plain.linearise(FlightCondition(0.2)), step=0.5, length=20.0, inputs=("alpha", "q"))
print(model.summary())
