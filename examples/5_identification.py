"""Measure a flight as a spark range does, with noise, and identify its derivatives."""

import math

from indicial.flightsim import DerivativeAerodynamics, End, InitialState, basic_finner_range_model, simulate
from indicial.identification import identify, measure

vehicle = basic_finner_range_model()
true = {"CA_0": 0.55, "CN_alpha": 11.4, "Cm_alpha": -25.0, "Cm_q": -355.0}
flight = simulate(
    vehicle,
    DerivativeAerodynamics(reference=vehicle.reference, **true),
    InitialState.from_path(686.0, alpha=math.radians(2.0)),
    duration=1.0,
    end=End(x=230.0),
)

record = measure(flight, stations=54, seed=1)
print(record.summary())

result = identify(record, vehicle)
print(result.summary())

for name, value in (*list(true.items())[:3], ("Cm_q+Cm_alphadot", true["Cm_q"])):
    found = result[name]
    assert abs(found.value - value) < 4.0 * found.standard_error, name
