"""Damping: modes over the flight envelope, what damps them, what the flow's memory changes, a frequency response."""

import math
from dataclasses import replace
from pathlib import Path

import control
import numpy as np

from indicial.derivatives import DerivativeTable
from indicial.flightsim import (
    DerivativeAerodynamics,
    StateSpaceAerodynamics,
    basic_finner_range_model,
    damping_over_k,
    linear_flight,
    missile_damping,
    missile_mode_sweep,
)
from indicial.pipeline.damping import damping_of_aircraft, sweep_of_aircraft
from indicial.reference_data import find_aircraft, finner_range, finner_range_at

out = Path("runs/examples")
out.mkdir(parents=True, exist_ok=True)

# A missile from a table over the Mach number. A range measures the sum of Cm_q and Cm_alphadot: it stands for Cm_q.
body = basic_finner_range_model()
measured = DerivativeTable(
    tuple(replace(r, name="Cm_q") if r.name == "Cm_q+Cm_alphadot" else r for r in finner_range("multifit"))
)
model = DerivativeAerodynamics.over_mach(measured, CN_q=0.0, CN_alphadot=0.0, Cm_alphadot=0.0)
sweep = missile_mode_sweep(body, model, np.linspace(1.1, 4.2, 9), [0.0, 10e3], roll_rate=60.0)
print(sweep.summary())
sweep.plot().savefig(out / "finner_modes.png")
sweep.to_csv(out / "finner_modes.csv")
assert np.all(sweep["fast arm"].real < 0.0)
assert np.all(sweep["slow arm"].real < 0.0)
assert np.all(np.abs(sweep["fast arm"].imag) > np.abs(sweep["slow arm"].imag))

# At one Mach number: four ways, what of, how sure, without and with roll.
two = finner_range_at(2.0)
at_two = DerivativeAerodynamics(
    reference=body.reference,
    CA_0=two.value("CA_0"),
    CN_alpha=two.value("CN_alpha"),
    Cm_alpha=two.value("Cm_alpha"),
    Cm_q=two.value("Cm_q+Cm_alphadot"),
    Cl_p=two.value("Cl_p"),
)
error = two.one("Cm_q+Cm_alphadot").uncertainty
assert error is not None
verdict = missile_damping(body, at_two, 686.0, roll_rate=math.radians(3600.0), uncertainties={"Cm_q": error})
print(verdict.summary())
assert verdict.check is not None
for arm in verdict.check.arms:
    assert abs(arm.decay_difference) < 1e-3
    assert abs(arm.fit_difference) < 1e-3
    assert abs(arm.closed_form_difference) < 1e-3

# Memory: a tenth of the normal force and moment comes late, with one pole at 0.1 per half calibre flown.
late, pole = 0.1, 0.1
system = control.ss(
    [[-pole]],
    [[pole, 0.0]],
    [[late * at_two.CN_alpha], [late * at_two.Cm_alpha]],
    [[(1.0 - late) * at_two.CN_alpha, 0.0], [(1.0 - late) * at_two.Cm_alpha, at_two.Cm_q]],
)
lagging = StateSpaceAerodynamics(reference=body.reference, CA_0=at_two.CA_0, Cl_p=at_two.Cl_p, system=system)
over_k = damping_over_k(body, lagging, 686.0)
print(over_k.summary())
over_k.plot().savefig(out / "damping_over_k.png")
assert abs(over_k.ratio_change[0]) < 1e-3 < abs(over_k.ratio_change[-1])

# An aircraft: each of its modes, over the envelope, and its levels.
boeing = find_aircraft("boeing_747")
assert boeing is not None
aircraft = damping_of_aircraft(boeing)
print(aircraft.summary())
aircraft.all_modes.plot().savefig(out / "boeing_modes.png")
envelope = sweep_of_aircraft(boeing, np.linspace(0.5, 0.9, 5), [6000.0, 12000.0])
print(envelope.summary())
assert envelope.names == ("short period", "phugoid", "Dutch roll", "roll", "spiral")

# Bode plot of pitch rate to a pitching moment, which the balance of loads left as a parameter.
linear = linear_flight(aircraft.steady, controls=("Cm_0",), outputs=("q", "alpha"))
response = control.frequency_response(linear.to_control(), np.geomspace(1e-2, 10.0, 200))
peak = float(response.omega[np.argmax(response.magnitude[0, 0])])
assert abs(math.log(peak / aircraft.all_modes["phugoid"].natural_frequency)) < 0.1
