"""Fly the range model of the Basic Finner with measured derivatives, and check its damping three ways."""

import math

from indicial.flightsim import DerivativeAerodynamics, End, InitialState, basic_finner_range_model, simulate
from indicial.flightsim.damping import check_damping
from indicial.reference_data import finner_range_at

vehicle = basic_finner_range_model()
measured = {record.name: record.value for record in finner_range_at(2.0)}
aerodynamics = DerivativeAerodynamics(
    reference=vehicle.reference,
    CA_0=measured["CA_0"],
    CN_alpha=measured["CN_alpha"],
    Cm_alpha=measured["Cm_alpha"],
    Cm_q=measured["Cm_q+Cm_alphadot"],  # free flight tells only the sum
    Cl_p=measured["Cl_p"],
)

speed = 686.0
flight = simulate(
    vehicle, aerodynamics, InitialState.from_path(speed, alpha=math.radians(2.0)), duration=1.0, end=End(x=230.0)
)
print(f"{flight.time[-1]:.3f} s over the range, Mach {flight.mach[0]:.3f} to {flight.mach[-1]:.3f}")

check = check_damping(vehicle, aerodynamics, speed)
print(check.summary())
for arm in check.arms:
    assert arm.linearised.real < 0.0
    assert abs(arm.fit_difference) < 0.01
    assert abs(arm.closed_form_difference) < 0.02
