"""Which realisation to take: all of them on the same data, a model from noisy motion with error bars, fewer states.

The flow is the exact supersonic flat plate, as a solver.
"""

from dataclasses import replace

import numpy as np

from indicial.conventions import ReferenceQuantities, time_from_reduced
from indicial.motion import AlphaStep, FlightCondition, Multisine, PitchOscillation, PitchRateStep
from indicial.rom import StepResponses, check_prediction, compare, identify, realise, refine_model, truncate
from indicial.studies.plate.exact import SupersonicPlate

reference = ReferenceQuantities(
    length=1.0, area=1.0, moment_reference=(-2.5, 0.0, 0.0)
)  # three chords ahead of mid-chord
plate, condition = SupersonicPlate(reference), FlightCondition(mach=2.0)


def at(s):
    return time_from_reduced(s, condition.speed, reference.length)


# What is known: step responses. What no model sees: an oscillation.
times = at(np.linspace(0.0, 8.0, 161))
steps = [AlphaStep(condition, 0.01), PitchRateStep(condition, 0.02 * condition.speed / reference.length)]
responses = StepResponses.from_histories([plate.unsteady(condition, step, times) for step in steps])
motion = PitchOscillation.from_reduced_frequency(condition, reference, amplitude=0.01, k=0.3)
unseen = plate.unsteady(condition, motion, np.linspace(0.0, 2.0 * motion.period, 200))

comparison = compare(responses, [unseen], max_order=4)
print(comparison.summary())
assert comparison.best.error < 0.02

# Fewer states for motions up to k = 0.6; every derivative at k = 0 stays what it was.
full = realise(responses, "modal")
small = truncate(full, order=4, k_max=0.6)
print(small.summary())
assert check_prediction(small.model, unseen).worst_peak < 0.02
np.testing.assert_allclose(small.model.static_gain, full.static_gain)

# One noisy multisine instead of steps: alpha and pitch rate at frequencies of their own.
wave = Multisine.from_reduced_frequencies(condition, reference, 0.1 * np.arange(1, 17), 0.004, 0.004)
clean = plate.unsteady(condition, wave, at(np.arange(0.0, 63.0, 0.15)))
noise = np.random.default_rng(0).normal(size=clean.coefficients.shape)
measured = replace(clean, coefficients=clean.coefficients + 0.02 * np.std(clean.coefficients, axis=0) * noise)
model = identify([measured], direct=responses.initial)
uncertain = refine_model(model, [measured], known_direct=True)
print(uncertain.summary())
band = uncertain.predict(unseen)
print(band.summary())
assert check_prediction(uncertain.model, unseen).worst_peak < 0.05
