"""Flight in moving air: tables over the Mach number, a gust, turbulence, a control, and the scatter of many shots."""

import math
from dataclasses import replace
from pathlib import Path

import casadi as ca

from indicial.flightsim import (
    MACH,
    CosineGust,
    DerivativeAerodynamics,
    Dispersion,
    DrydenTurbulence,
    End,
    InitialState,
    Signal,
    SteadyWind,
    Winds,
    basic_finner_range_model,
    build_dynamics,
    fly,
    monte_carlo,
    table,
)

out = Path("runs/examples")
body = basic_finner_range_model()

# A value of a model is a number, a symbol of one's own, or an expression of these and of the flight condition.
fin, crosswind, mass = (ca.SX.sym(name) for name in ("fin", "crosswind", "mass"))
model = DerivativeAerodynamics(
    reference=body.reference,
    CA_0=0.55,
    CN_alpha=table(MACH, [1.5, 2.0, 2.5], [13.5, 11.1, 9.4]),
    Cm_alpha=table(MACH, [1.5, 2.0, 2.5], [-36.0, -24.5, -17.5]) * (1.0 + fin),
    Cm_q=table(MACH, [1.5, 2.0, 2.5], [-480.0, -350.0, -290.0]),
    Cl_p=-22.0,
)
wind = Winds(
    (
        SteadyWind((0.0, crosswind, 0.0)),
        CosineGust((0.0, 0.0, -15.0), length=25.0, start=60.0),
        DrydenTurbulence((1.0, 1.0, 1.0), (60.0, 60.0, 60.0), seed=1),
    )
)
dynamics = build_dynamics(replace(body, mass=mass), model, wind=wind)
print("parameters:", ", ".join(dynamics.parameter_names))

# Parameters may be functions of time: here the static stability is kicked for 20 ms.
values = {"fin": Signal.pieces([0.1, 0.12], [0.2]), "crosswind": 3.0, "mass": body.mass}
start = InitialState.from_path(687.0, alpha=math.radians(1.0))
flight = fly(dynamics, start, 1.0, end=End(x=230.0), parameters=values)
print(flight.summary())
out.mkdir(parents=True, exist_ok=True)
flight.plot().savefig(out / "gusty_flight.png")

# Many shots: what varies is a symbol of the model or a quantity of the start.
spread = Dispersion.independent(alpha=0.01, beta=0.01, q=3.0, r=3.0, crosswind=2.0, mass=0.003)
shots = monte_carlo(
    dynamics, {"speed": 687.0}, spread, 0.6, flights=60, seed=1, step=2e-4, parameters=values, end=End(x=230.0)
)
print(shots.summary())
assert shots.ended.all()
low, _, high = shots.percentiles("y")
assert 0.01 < high - low < 1.0
