"""Flight: time of a Runge-Kutta step and of whole flights, beside JSBSim's and RocketPy's.

The Finner range model at 687 m/s and 2 degrees, about 230 m. A step is timed inside a whole flight, ends looked at, by
the processor time of one thread. JSBSim flies the same derivatives from an XML file written here (its own Earth and
atmosphere come on top, as they always do); RocketPy a body of the same mass, drag and four fins without a motor, its
adaptive LSODA at its own tolerances against DOP853 at the same. Peers that are not installed are left out.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import math
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import control
import numpy as np
from figures import Figure, best_time

from indicial.flightsim import (
    DerivativeAerodynamics,
    Dispersion,
    Dynamics,
    End,
    InitialState,
    StateSpaceAerodynamics,
    basic_finner_range_model,
    build_dynamics,
    fly,
    monte_carlo,
)
from indicial.flightsim.march import runge_kutta
from indicial.flightsim.signals import Schedule

FINNER, SPEED, ALPHA, STEP = basic_finner_range_model(), 687.0, math.radians(2.0), 1e-5
STEPS = 30_000
DERIVATIVES: dict[str, Any] = {
    "CA_0": 0.55,
    "CN_alpha": 11.0,
    "CN_q": 80.0,
    "CN_alphadot": 10.0,
    "Cm_alpha": -26.0,
    "Cm_q": -320.0,
    "Cm_alphadot": -15.0,
    "Cl_p": -22.0,
}
RANGE = End(x=230.0)
ADAPTIVE_TIME, TOLERANCE = 2.0, 1e-6

START_UP = """
import time; start = time.perf_counter()
from indicial.flightsim import DerivativeAerodynamics, InitialState, basic_finner_range_model, build_dynamics, fly
body = basic_finner_range_model()
model = DerivativeAerodynamics(reference=body.reference, {})
fly(build_dynamics(body, model), InitialState.from_path(687.0), 1e-4, step=1e-4, estimate_error=False)
print(time.perf_counter() - start)
""".format(", ".join(f"{name}={value}" for name, value in DERIVATIVES.items()))


def measure() -> list[Figure]:
    """Time steps, flights, and starting."""
    model = DerivativeAerodynamics(reference=FINNER.reference, **DERIVATIVES)
    plain, memory = _step_time(model), _step_time(_lagging())
    figures = [
        Figure.at_most("derivative model, a Runge-Kutta step", plain * 1e6, 0.6, "us"),
        Figure.at_most("10-state model, a Runge-Kutta step", memory * 1e6, 1.2, "us"),
        Figure.at_most("1000 flights of the range shot", _shots(), 5.0, "s"),
        Figure.at_most("import to first step of a stored model", _start_up(), 2.0, "s"),
    ]
    for name, peer in (("jsbsim", _jsbsim_step), ("rocketpy", _rocketpy_flight)):
        if importlib.util.find_spec(name) is None:
            figures.append(Figure(f"{name} is not installed: not compared", math.nan, ""))
            continue
        if name == "jsbsim":
            figures.append(Figure.at_least("JSBSim's step over ours", peer() / plain, 8.0))
        else:
            figures.append(Figure.at_least("RocketPy's adaptive flight over ours", peer() / _adaptive(model), 50.0))
    return figures


def _lagging() -> StateSpaceAerodynamics:
    """Five states in each plane, every element of A used."""
    random = np.random.default_rng(0)
    a = 0.05 * random.standard_normal((5, 5)) - np.diag(np.linspace(0.2, 1.0, 5))
    b, c = 0.1 * random.standard_normal((5, 2)), 0.1 * random.standard_normal((2, 5))
    system = control.ss(a, b, c, [[11.0, 80.0], [-26.0, -320.0]])
    return StateSpaceAerodynamics(reference=FINNER.reference, CA_0=0.55, Cl_p=-22.0, system=system)


def _step_time(model: Any) -> float:
    dynamics = build_dynamics(FINNER, model)
    start = dynamics.initial_vector(InitialState.from_path(SPEED, alpha=ALPHA))
    codes, drive = (dynamics.rate_kernel.code, dynamics.monitor_kernel.code), Schedule((), ()).drive
    times, states = np.empty(4), np.empty((4, start.size))

    def flight() -> None:
        _, outcome = runge_kutta(
            *codes, start, np.zeros(0), drive, STEPS * STEP, STEP, STEPS, RANGE.rows, times, states
        )
        assert outcome == 0

    return best_time(flight, clock=time.process_time) / STEPS


def _shots() -> float:
    """From drawing to the result; the model is compiled before."""
    mass, damping = ca.SX.sym("mass"), ca.SX.sym("Cm_q")
    model = DerivativeAerodynamics(reference=FINNER.reference, **{**DERIVATIVES, "Cm_q": damping})
    dynamics = build_dynamics(replace(FINNER, mass=mass), model)
    spread = Dispersion.independent(alpha=0.02, beta=0.02, q=3.0, r=3.0, speed=3.0, mass=0.003, Cm_q=15.0)

    def flights(count: int) -> None:
        monte_carlo(
            dynamics,
            {"speed": SPEED},
            spread,
            0.5,
            flights=count,
            seed=1,
            step=1e-4,
            parameters={"mass": FINNER.mass, "Cm_q": DERIVATIVES["Cm_q"]},
            end=RANGE,
        )

    flights(2)
    start = time.perf_counter()
    flights(1000)
    return time.perf_counter() - start


def _start_up() -> float:
    """In a process of its own, the second time: the model is kept then."""
    said = [subprocess.run([sys.executable, "-c", START_UP], capture_output=True, text=True, check=True) for _ in "ab"]
    return float(said[-1].stdout)


def _adaptive(model: Any) -> float:
    dynamics: Dynamics = build_dynamics(FINNER, model)
    start = InitialState.from_path(SPEED, alpha=ALPHA)
    return best_time(
        lambda: fly(
            dynamics, start, ADAPTIVE_TIME, method="dop853", step=0.01, tolerance=TOLERANCE, estimate_error=False
        )
    )


def _jsbsim_step() -> float:
    import jsbsim

    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / "aircraft" / "finner"
        place.mkdir(parents=True)
        (place / "finner.xml").write_text(_jsbsim_xml(), encoding="utf-8")
        jsbsim.FGJSBBase().debug_lvl = 0
        program = jsbsim.FGFDMExec(folder)
        if not program.load_model("finner"):
            raise RuntimeError("JSBSim does not take the model")
        program.set_dt(1e-4)
        program.disable_output()
        foot = 0.3048
        for name, value in (("ic/h-sl-ft", 1000.0), ("ic/u-fps", SPEED / foot), ("ic/w-fps", SPEED * ALPHA / foot)):
            program[name] = value
        program.run_ic()
        steps = 3000

        def flight() -> None:
            for _ in range(steps):
                program.run()

        return best_time(flight, repeats=3, clock=time.process_time) / steps


def _jsbsim_xml() -> str:
    """The derivative model in JSBSim's language, feet and pounds, body axes."""
    reference = FINNER.reference
    foot, slug_ft2, area = 0.3048, 1.3558179483, reference.area / 0.3048**2
    d = DERIVATIVES

    def function(name: str, *factors: str) -> str:
        return f'<function name="{name}"><product>{"".join(factors)}</product></function>'

    def value(number: float) -> str:
        return f"<value>{number:.12g}</value>"

    def prop(name: str) -> str:
        return f"<property>{name}</property>"

    q_area = prop("aero/qbar-psf") + prop("metrics/Sw-sqft")
    rate = prop("aero/ci2vel")
    chord = prop("metrics/cbarw-ft")
    q_hat, r_hat, p_hat = (prop(f"velocities/{axis}-aero-rad_sec") + rate for axis in "qrp")
    alpha, beta = prop("aero/alpha-rad"), prop("aero/beta-rad")
    terms = {
        "AXIAL": [("drag", d["CA_0"], "")],
        "SIDE": [("side", -d["CN_alpha"], beta)],
        "NORMAL": [("normal_alpha", d["CN_alpha"], alpha), ("normal_q", d["CN_q"], q_hat)],
        "ROLL": [("roll_p", d["Cl_p"], p_hat)],
        "PITCH": [("pitch_alpha", d["Cm_alpha"], alpha), ("pitch_q", d["Cm_q"], q_hat)],
        "YAW": [("yaw_beta", -d["Cm_alpha"], beta), ("yaw_r", d["Cm_q"], r_hat)],
    }
    lines = {
        axis: [
            function(name, q_area, chord if axis in ("ROLL", "PITCH", "YAW") else "", value(size), motion)
            for name, size, motion in parts
        ]
        for axis, parts in terms.items()
    }
    axes = "".join(f'<axis name="{axis}">{"".join(parts)}</axis>' for axis, parts in lines.items())
    inertia = [FINNER.inertia[i, i] / slug_ft2 for i in range(3)]
    return f"""<?xml version="1.0"?>
<fdm_config name="finner" version="2.0">
 <metrics><wingarea unit="FT2">{area:.12g}</wingarea><wingspan unit="FT">{reference.length / foot:.12g}</wingspan>
  <chord unit="FT">{reference.length / foot:.12g}</chord>
  <location name="AERORP" unit="M"><x>0.165</x><y>0</y><z>0</z></location></metrics>
 <mass_balance><ixx unit="SLUG*FT2">{inertia[0]:.12g}</ixx><iyy unit="SLUG*FT2">{inertia[1]:.12g}</iyy>
  <izz unit="SLUG*FT2">{inertia[2]:.12g}</izz><emptywt unit="KG">{FINNER.mass:.12g}</emptywt>
  <location name="CG" unit="M"><x>0.165</x><y>0</y><z>0</z></location></mass_balance>
 <ground_reactions/><propulsion/><flight_control name="none"/>
 <aerodynamics>{axes}</aerodynamics>
</fdm_config>
"""


def _rocketpy_flight() -> float:
    from rocketpy import Environment, Flight, Rocket

    with contextlib.redirect_stdout(io.StringIO()):
        air = Environment()
        ix, iy, _ = np.diag(FINNER.inertia)
        drag = DERIVATIVES["CA_0"]
        rocket = Rocket(
            radius=0.015,
            mass=FINNER.mass,
            inertia=(iy, iy, ix),
            power_off_drag=drag,
            power_on_drag=drag,
            center_of_mass_without_motor=0.165,
            coordinate_system_orientation="nose_to_tail",
        )
        rocket.add_nose(length=0.085, kind="conical", position=0.0)
        rocket.add_trapezoidal_fins(n=4, root_chord=0.03, tip_chord=0.03, span=0.03, position=0.27)
        half = math.radians(45.0)
        # upright attitude turned so that the nose points along x (east), flying along it at a small angle
        start = [
            0.0,
            0.0,
            0.0,
            500.0,
            SPEED,
            0.0,
            -SPEED * ALPHA,
            math.cos(half),
            0.0,
            math.sin(half),
            0.0,
            0.0,
            0.0,
            0.0,
        ]

        def flight() -> None:
            Flight(
                rocket=rocket,
                environment=air,
                rail_length=1.0,
                initial_solution=start,
                max_time=ADAPTIVE_TIME,
                rtol=TOLERANCE,
                verbose=False,
            )

        return best_time(flight, repeats=3)
