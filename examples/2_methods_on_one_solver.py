"""The three methods on one solver, and what must agree on a linear flow.

The solver here is a state-space model of two lags, so that the answers are known exactly and this takes no time; the
finite-volume solver is used in the same way.
"""

import math

import numpy as np

from indicial.conventions import ReferenceQuantities
from indicial.methods import forced_oscillation, indicial_response, moving_frame
from indicial.motion import FlightCondition
from indicial.rom import StateSpaceModel

k = 0.05
condition = FlightCondition(mach=2.0)
reference = ReferenceQuantities(length=0.030, area=math.pi * 0.030**2 / 4.0, moment_reference=(0.165, 0.0, 0.0))
solver = StateSpaceModel(
    a=np.diag([-0.2, -0.5]),
    b=np.array([[0.4, 3.0], [0.5, 4.0]]),
    c=np.array([[1.5, 0.5], [-4.0, -1.0]]),
    d=np.array([[8.0, 60.0], [-18.0, -220.0]]),
    inputs=("alpha", "q"),
    outputs=("CN", "Cm"),
    baseline=np.zeros(6),
    condition=condition,
    reference=reference,
)

mrf = moving_frame.run(solver, condition)
print(mrf.summary())

s = indicial_response.step_times(first=0.05, growth=1.05, largest=0.5, end=80.0)
alpha = indicial_response.read(indicial_response.run(solver, condition, 0.005, s, "alpha"))
q = indicial_response.read(indicial_response.run(solver, condition, 0.001, s, "q"))
irm = indicial_response.derive(alpha, q)
print(irm.summary())

history = forced_oscillation.run(solver, condition, amplitude=0.005, k=k, periods=3, steps_per_period=64)
for reduce in (forced_oscillation.phase_angle, forced_oscillation.regression, forced_oscillation.fourier):
    print(reduce(history).summary())

# MRF and IRM are values at k = 0 and agree there; FOM is the value at its k.
assert abs(irm["Cm_q"] / mrf["Cm_q"] - 1.0) < 1e-6
h = solver.frequency_response([k])[0, 1]
exact = np.imag(h[0] + 1j * k * h[1]) / k
assert abs(forced_oscillation.fourier(history).value("Cm") / exact - 1.0) < 1e-3
