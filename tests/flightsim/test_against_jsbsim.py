"""The same bodies flown here and in JSBSim: a missile with tables over Mach number, an aircraft with moving surfaces.

JSBSim integrates with fixed steps, set to Adams and Bashforth's second order here; its rotating WGS-84 earth with J2
and its 1976 atmosphere are ours too. The difference falls with the square of its step, down to what 8e-6 in density
(its gas constant) makes; with that in our loads too it goes on falling.
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from flightsim.support import FINNER, derivative_model
from indicial.conventions import ReferenceQuantities
from indicial.flightsim import (
    MACH,
    TIME,
    WGS84,
    BodyAxisAerodynamics,
    InitialState,
    StandardAtmosphere,
    Trajectory,
    Vehicle,
    build_dynamics,
    fly,
    table,
)
from indicial.flightsim.attitude import euler_angles, matrix_from_quaternion, quaternion_from_euler

jsbsim = pytest.importorskip("jsbsim")

FOOT, SLUG_FT2 = 0.3048, 1.3558179483314004
HEIGHT = 1000.0
ADAMS_BASHFORTH_2 = 3

MACHS, SLOPES, DAMPING = [1.0, 1.5, 2.0, 2.5], [-45.0, -38.0, -26.0, -19.0], [-420.0, -380.0, -330.0, -310.0]
MISSILE = derivative_model(
    CN_alphadot=0.0,
    Cm_alphadot=0.0,
    Cm_alpha=table(MACH, MACHS, SLOPES),
    Cm_q=table(MACH, MACHS, DAMPING),
)

LIGHT_REFERENCE = ReferenceQuantities(1.5, 16.0, (0.0, 0.0, 0.0), lateral_length=11.0)
LIGHT = Vehicle("light aircraft", 1000.0, np.diag([1200.0, 1800.0, 2700.0]), LIGHT_REFERENCE, (0.0, 0.0, 0.0))
ELEVATOR = 0.05 * ca.sin(2.0 * TIME)
AILERON = 0.02 * ca.sin(1.1 * TIME)
LIGHT_VALUES = {
    "CD_0": 0.05,
    "CZ_0": -0.05,
    "CZ_alpha": -5.0,
    "Cm_0": 0.03,
    "Cm_alpha": -0.8,
    "Cm_q": -14.0,
    "CY_beta": -0.4,
    "Cl_beta": -0.07,
    "Cl_p": -0.5,
    "Cl_r": 0.1,
    "Cn_beta": 0.08,
    "Cn_p": -0.03,
    "Cn_r": -0.12,
}


def number(value: float) -> str:
    return f"<value>{value:.17g}</value>"


def prop(name: str) -> str:
    return f"<property>{name}</property>"


def product(*factors: str) -> str:
    return f"<product>{''.join(factors)}</product>"


def ratio(top: str, bottom: str) -> str:
    return f"<quotient>{top}{bottom}</quotient>"


V = prop("velocities/vt-fps")
E_Z, E_Y = ratio(prop("velocities/w-aero-fps"), V), ratio(prop("velocities/v-aero-fps"), V)
PRESSURE = product(prop("aero/qbar-psf"), prop("metrics/Sw-sqft"))
P, Q, R = (prop(f"velocities/{axis}-aero-rad_sec") for axis in "pqr")
LONGITUDINAL, LATERAL = prop("aero/ci2vel"), prop("aero/bi2vel")
CHORD, SPAN = prop("metrics/cbarw-ft"), prop("metrics/bw-ft")


def over_mach(values: list[float]) -> str:
    rows = "".join(f"{mach} {value}\n" for mach, value in zip(MACHS, values, strict=True))
    return f"<table><independentVar>velocities/mach</independentVar><tableData>{rows}</tableData></table>"


def sine(amplitude: float, rate: float) -> str:
    return product(number(amplitude), f"<sin>{product(number(rate), prop('simulation/sim-time-sec'))}</sin>")


def xml(name: str, body: Vehicle, axes: dict[str, list[str]]) -> str:
    reference = body.reference
    lateral = float(reference.moment_lengths[0])
    written = "".join(
        f'<axis name="{axis}">'
        + "".join(f'<function name="{axis}_{i}">{product(PRESSURE, part)}</function>' for i, part in enumerate(parts))
        + "</axis>"
        for axis, parts in axes.items()
    )
    ixx, iyy, izz = (body.inertia[i, i] / SLUG_FT2 for i in range(3))
    x = body.centre_of_gravity[0]
    return f"""<?xml version="1.0"?>
<fdm_config name="{name}" version="2.0">
 <metrics><wingarea unit="FT2">{reference.area / FOOT**2:.17g}</wingarea>
  <wingspan unit="FT">{lateral / FOOT:.17g}</wingspan><chord unit="FT">{reference.length / FOOT:.17g}</chord>
  <location name="AERORP" unit="M"><x>{x}</x><y>0</y><z>0</z></location></metrics>
 <mass_balance><ixx unit="SLUG*FT2">{ixx:.17g}</ixx><iyy unit="SLUG*FT2">{iyy:.17g}</iyy>
  <izz unit="SLUG*FT2">{izz:.17g}</izz><emptywt unit="KG">{body.mass:.17g}</emptywt>
  <location name="CG" unit="M"><x>{x}</x><y>0</y><z>0</z></location></mass_balance>
 <ground_reactions/><propulsion/><flight_control name="none"/>
 <aerodynamics>{written}</aerodynamics>
</fdm_config>
"""


def missile_xml() -> str:
    m = MISSILE
    return xml(
        "missile",
        FINNER,
        {
            "AXIAL": [number(m.CA_0)],
            "SIDE": [product(number(-m.CN_alpha), E_Y), product(number(m.CN_q), R, LONGITUDINAL)],
            "NORMAL": [product(number(m.CN_alpha), E_Z), product(number(m.CN_q), Q, LONGITUDINAL)],
            "ROLL": [product(number(m.Cl_p), P, LATERAL, SPAN)],
            "PITCH": [
                product(over_mach(SLOPES), E_Z, CHORD),
                product(over_mach(DAMPING), Q, LONGITUDINAL, CHORD),
            ],
            "YAW": [
                product(number(-1.0), over_mach(SLOPES), E_Y, CHORD),
                product(over_mach(DAMPING), R, LONGITUDINAL, CHORD),
            ],
        },
    )


def light_xml() -> str:
    c = LIGHT_VALUES
    drag = number(c["CD_0"])
    return xml(
        "light",
        LIGHT,
        {
            "AXIAL": [product(drag, ratio(prop("velocities/u-aero-fps"), V))],
            "SIDE": [product(number(c["CY_beta"]), E_Y), product(number(-1.0), drag, E_Y)],
            "NORMAL": [number(-c["CZ_0"]), product(number(-c["CZ_alpha"]), E_Z), product(drag, E_Z)],
            "ROLL": [
                product(number(c["Cl_beta"]), E_Y, SPAN),
                product(number(c["Cl_p"]), P, LATERAL, SPAN),
                product(number(c["Cl_r"]), R, LATERAL, SPAN),
                product(sine(0.02, 1.1), SPAN),
            ],
            "PITCH": [
                product(number(c["Cm_0"]), CHORD),
                product(number(c["Cm_alpha"]), E_Z, CHORD),
                product(number(c["Cm_q"]), Q, LONGITUDINAL, CHORD),
                product(sine(-0.06, 2.0), CHORD),
            ],
            "YAW": [
                product(number(c["Cn_beta"]), E_Y, SPAN),
                product(number(c["Cn_p"]), P, LATERAL, SPAN),
                product(number(c["Cn_r"]), R, LATERAL, SPAN),
            ],
        },
    )


def light_model() -> BodyAxisAerodynamics:
    values: dict[str, Any] = dict(LIGHT_VALUES)
    values["Cm_0"] = LIGHT_VALUES["Cm_0"] - 1.2 * ELEVATOR
    values["Cl_0"] = AILERON
    return BodyAxisAerodynamics(reference=LIGHT_REFERENCE, **values)


def in_jsbsim(folder: Path, name: str, text: str, start: InitialState, duration: float, step: float) -> dict[str, Any]:
    """Place (latitude, longitude [rad], altitude [m]), velocity over ground, attitude and inertial rates at the end."""
    place = folder / "aircraft" / name
    place.mkdir(parents=True, exist_ok=True)
    (place / f"{name}.xml").write_text(text, encoding="utf-8")
    jsbsim.FGJSBBase().debug_lvl = 0
    program = jsbsim.FGFDMExec(str(folder))
    assert program.load_model(name)
    program.set_dt(step)
    program.disable_output()
    for kind in ("rate/rotational", "rate/translational", "position/rotational", "position/translational"):
        program[f"simulation/integrator/{kind}"] = ADAMS_BASHFORTH_2
    u, v, w = start.velocity / FOOT
    yaw, pitch, roll = euler_angles(start.quaternion)
    # JSBSim's initial rates are relative to the ground
    p, q, r = start.rate - matrix_from_quaternion(start.quaternion).T @ WGS84().rotation
    given = {
        "ic/lat-geod-deg": 0.0, "ic/long-gc-deg": 0.0, "ic/h-sl-ft": HEIGHT / FOOT, "ic/u-fps": u, "ic/v-fps": v,
        "ic/w-fps": w, "ic/psi-true-rad": yaw, "ic/theta-rad": pitch, "ic/phi-rad": roll, "ic/p-rad_sec": p,
        "ic/q-rad_sec": q, "ic/r-rad_sec": r,
    }  # fmt: skip
    for key, value in given.items():
        program[key] = float(value)
    assert program.run_ic()
    for _ in range(round(duration / step)):
        program.run()
    angles = [program[f"attitude/{name}-rad"] for name in ("psi", "theta", "phi")]
    return {
        "place": np.array(
            [
                math.radians(program["position/lat-geod-deg"]),
                math.radians(program["position/long-gc-deg"]),
                program["position/geod-alt-ft"] * FOOT,
            ]
        ),
        "velocity": np.array([program[f"velocities/{a}-fps"] for a in "uvw"]) * FOOT,
        "attitude": matrix_from_quaternion(quaternion_from_euler(*angles)),
        "rate": np.array([program[f"velocities/{a}i-rad_sec"] for a in "pqr"]),
        "density": program["atmosphere/rho-slugs_ft3"] * 14.593902937206364 / FOOT**3,
    }


def differences(flight: Trajectory, other: dict[str, Any]) -> dict[str, float]:
    """Position [m], velocity [m/s], attitude [rad], rates [rad/s] at the end."""
    earth = WGS84()
    there = earth.position(*other["place"])
    ours = earth.local_axes(flight.position[-1]).T @ matrix_from_quaternion(flight.quaternion[-1])
    turned = other["attitude"].T @ ours
    return {
        "position": float(np.linalg.norm(flight.position[-1] - there)),
        "velocity": float(np.linalg.norm(flight.velocity[-1] - other["velocity"])),
        "attitude": 2.0 * math.asin(float(np.linalg.norm(turned - np.eye(3))) / math.sqrt(8.0)),
        "rate": float(np.linalg.norm(flight.rate[-1] - other["rate"])),
    }


def with_their_density(body: Vehicle, model: Any, ratio_of_densities: float) -> tuple[Vehicle, Any]:
    """Loads are in proportion to density times area: the same area times the ratio of the densities."""
    reference = replace(body.reference, area=body.reference.area * ratio_of_densities)
    return replace(body, reference=reference), replace(model, reference=reference)


def flown(body: Vehicle, model: Any, start: InitialState, duration: float) -> Trajectory:
    dynamics = build_dynamics(body, model, StandardAtmosphere(), WGS84())
    return fly(dynamics, start, duration, method="dop853", step=duration / 100.0, tolerance=1e-11, estimate_error=False)


CASES = {
    "missile": (
        FINNER,
        MISSILE,
        missile_xml,
        InitialState.from_path(687.0, alpha=0.03, beta=0.01, rate=(30.0, 0.0, 0.0), position=(0.0, 0.0, -HEIGHT)),
        0.5,
        (4e-4, 2e-4, 1e-4),
        {"position": 4e-6, "velocity": 2e-3, "attitude": 5e-6, "rate": 4e-3},
    ),
    "light": (
        LIGHT,
        light_model(),
        light_xml,
        InitialState.from_path(60.0, alpha=0.05, position=(0.0, 0.0, -HEIGHT)),
        10.0,
        (8e-3, 4e-3, 2e-3),
        {"position": 1e-4, "velocity": 2e-5, "attitude": 5e-7, "rate": 2e-6},
    ),
}


@pytest.mark.parametrize("name", list(CASES))
def test_flights_are_jsbsim_s_as_its_step_vanishes(tmp_path: Path, name: str) -> None:
    """Differences fall with the square of the step, to what the densities leave, and further when they agree."""
    body, model, text, start, duration, steps, bounds = CASES[name]
    theirs = [in_jsbsim(tmp_path, name, text(), start, duration, step) for step in steps]
    ours = flown(body, model, start, duration)
    density = theirs[-1]["density"] / float(ours.density[-1])
    assert density == pytest.approx(1.0, abs=1e-5)
    same_air = flown(*with_their_density(body, model, density), start, duration)
    found = [differences(same_air, one) for one in theirs]
    assert found[0]["rate"] / found[1]["rate"] == pytest.approx(4.0, rel=0.15)
    assert found[1]["rate"] / found[2]["rate"] == pytest.approx(4.0, rel=0.15)
    for what, bound in bounds.items():
        assert found[-1][what] < bound, what
    assert found[-1]["position"] < 0.1 * differences(ours, theirs[-1])["position"]
