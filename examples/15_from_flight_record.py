"""From a record of instruments to derivatives: compatibility, structure, output error, profile, and a better input."""

import math

import casadi as ca
import numpy as np

from indicial.conventions import ReferenceQuantities
from indicial.flightsim import BodyAxisAerodynamics, InitialState, Vehicle, build_dynamics, fly
from indicial.identification import (
    Experiment,
    Installation,
    Manoeuvre,
    Parameter,
    Sensor,
    check_compatibility,
    fit_manoeuvres,
    improve_input,
    measure_flight,
    model_structure,
    multisines,
    polynomial_terms,
    profile_likelihood,
    to_centre_of_gravity,
)

reference = ReferenceQuantities(1.5, 16.0, lateral_length=11.0)
vehicle = Vehicle("light aircraft", 1000.0, np.diag([1200.0, 1800.0, 2700.0]), reference, (0.0, 0.0, 0.0))
truth = {"CZ_alpha": -5.0, "Cm_alpha": -0.8, "Cm_q": -14.0, "Cm_elevator": -1.2}
free = {name: ca.SX.sym(name) for name in truth}
dynamics = build_dynamics(
    vehicle,
    BodyAxisAerodynamics(
        reference=reference,
        CD_0=0.05,
        CZ_0=-0.03,
        CZ_alpha=free["CZ_alpha"],
        Cm_alpha=free["Cm_alpha"],
        Cm_q=free["Cm_q"],
        Cm_0=0.04 + free["Cm_elevator"] * ca.SX.sym("elevator"),
    ),
)

# The flight, its elevator moved as a multisine, and what instruments show of it: vanes on a boom, two biases.
elevator = multisines(np.arange(0.0, 10.0, 0.02), {"elevator": 0.04}, (0.1, 1.5), seed=1)["elevator"]
start = InitialState.from_path(60.0, alpha=0.05)
flight = fly(dynamics, start, 10.0, method="dop853", step=0.01, parameters={**truth, "elevator": elevator})
noise = {"ax": 0.02, "ay": 0.02, "az": 0.02, "p": 5e-4, "q": 5e-4, "r": 5e-4, "V": 0.1, "alpha": 1e-3, "beta": 1e-3}
noise |= {"phi": 1e-3, "theta": 1e-3, "psi": 1e-3, "altitude": 0.3, "dynamic_pressure": 5.0}
biases = {"q": 0.01, "alpha": 0.02}
sensors = {name: Sensor(50.0, white=sd, bias=biases.get(name, 0.0)) for name, sd in noise.items()}
boom = Installation(vanes=(2.0, 0.0, 0.0))
raw = measure_flight(flight, vehicle, sensors, seed=1, inputs={"elevator": elevator}, installation=boom)

# Do the instruments agree with each other?
checked = check_compatibility(to_centre_of_gravity(raw))
print(checked.summary())
for name, bias in biases.items():
    assert abs(checked[f"bias_{name}"].value - bias) < 4.0 * checked[f"bias_{name}"].standard_error, name
record = checked.corrected()

# Which terms does the pitching moment need?
structure = model_structure(record, vehicle, "Cm", polynomial_terms(["alpha", "q", "elevator"], 2))
print(structure.summary())
assert {"alpha", "elevator"} <= set(structure.chosen)

# Output error, and an interval that does not lean on the bound.
channels = ("alpha", "q", "theta", "az")
manoeuvre = Manoeuvre.of_flight(record, dynamics, start, channels=channels, free_start=("alpha", "theta", "q", "V"))
unknown = [Parameter(name, 0.7 * value) for name, value in truth.items()]
fit = fit_manoeuvres([manoeuvre], unknown)
print(fit.summary())
for name, value in truth.items():
    assert abs(fit[name].value - value) < 5.0 * fit[name].standard_error, name
print(profile_likelihood(fit, unknown, "Cm_q").summary())
for verdict in fit.against({"Cm_q": (-13.0, 1.5), "Cm_alpha": -0.8}):
    print(verdict.summary())

# An elevator that would have told more, within the same limits.
plan = Experiment(dynamics, start, truth, {c: noise[c] for c in channels}, record.time[::2], ("alpha", "theta", "q"))
before = plan.judge({"elevator": elevator})
better = improve_input(plan, "elevator", elevator, 0.03, steps=12, limits={"alpha": (-0.1, 0.3)})
print(better.summary())
assert better.log_determinant <= before.log_determinant
assert math.isfinite(better.log_determinant)
