"""From step responses in files to a state-space model, checked on a motion that it has not seen.

The step responses are the exact ones of a flat plate at Mach 2, from the packaged table.
"""

import numpy as np

from indicial.conventions import ReferenceQuantities
from indicial.motion import FlightCondition, PitchOscillation
from indicial.reference_data import read_table
from indicial.rom import ConvolutionModel, StepResponse, StepResponses, check_prediction, realise

table = read_table("plate_supersonic")
rows = table.numbers("M") == 2.0
s = table.numbers("s")[rows]
lift_alpha, moment_alpha, lift_q, moment_q = (
    table.numbers(name)[rows] for name in ("cl_alpha", "cm_alpha_LE", "cl_q_LE", "cm_q_LE")
)

condition = FlightCondition(mach=2.0)
reference = ReferenceQuantities(length=1.0, area=1.0)
responses = StepResponses(
    responses=(
        StepResponse("alpha", s, np.stack([lift_alpha, moment_alpha], axis=1)),
        StepResponse("q", s, np.stack([lift_q, moment_q], axis=1) / 2.0),  # the table is per q c/V
    ),
    outputs=("CN", "Cm"),
    baseline=np.zeros(6),
    condition=condition,
    reference=reference,
)

model = realise(responses)
print(model.summary())

# Eq. (13) with the exact responses is the truth here: the model has never seen this oscillation.
truth = ConvolutionModel(responses)
motion = PitchOscillation.from_reduced_frequency(condition, reference, amplitude=0.01, k=0.3)
measured = truth.predict(motion, np.linspace(0.0, 2.0 * motion.period, 200))
check = check_prediction(model, measured)
print(check.summary())
assert check.worst < 0.02

# The derivatives of alphadot are -2/beta^3 and 4/(3 beta^3) per c/V, twice that per c/2V.
derivatives = model.derivatives()
assert abs(derivatives.value("CN_alphadot") / (-4.0 / 3.0**1.5) - 1.0) < 0.01
assert abs(derivatives.value("Cm_alphadot") / (8.0 / 3.0 / 3.0**1.5) - 1.0) < 0.01
