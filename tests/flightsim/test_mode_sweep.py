"""Modes over Mach number and altitude, and damping over reduced frequency with memory."""

import json
import math

import control
import numpy as np
import pytest
from typer.testing import CliRunner

from flightsim.support import DENSITY, FINNER, SPEED, derivative_model, first_order_lag
from flightsim.test_aircraft import SPEED as CRUISE
from flightsim.test_aircraft import boeing_747
from flightsim.test_linear import level
from indicial.cli import app
from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError
from indicial.flightsim import (
    MACH,
    DerivativeAerodynamics,
    Mode,
    Modes,
    ScheduledStateSpaceAerodynamics,
    StandardAtmosphere,
    air_at,
    aircraft_mode_sweep,
    aircraft_modes,
    damping_over_k,
    epicyclic_roots,
    fitted_eigenvalue,
    linear_flight,
    missile_mode_sweep,
    rate_modes,
    sweep_modes,
    table,
    trim,
)
from indicial.pipeline.damping import damping_of_aircraft, sweep_of_aircraft
from indicial.reference_data import find_aircraft


def crossing(mach: float, altitude: float) -> Modes:
    """Two modes whose frequencies cross at Mach 1.5, each with a shape of its own, named by their frequency."""
    del altitude
    shapes = ({"alpha": 1.0 + 0j, "theta": 0.1j}, {"beta": 1.0 + 0j, "phi": 0.3j})
    values = (complex(-0.1, 1.0 + mach), complex(-0.2, 4.0 - mach))
    ordered = sorted(zip(values, shapes, strict=True), key=lambda pair: pair[0].imag)
    modes = [Mode(name, value, 100.0, shape) for name, (value, shape) in zip(("low", "high"), ordered, strict=True)]
    return Modes(tuple(modes), 100.0, 0.0)


def test_modes_that_cross_keep_their_names() -> None:
    machs = np.linspace(1.0, 2.0, 11)
    sweep = sweep_modes(crossing, machs)
    assert sweep.names == ("low", "high")
    np.testing.assert_allclose(sweep["low"][0], -0.1 + 1j * (1.0 + machs))
    np.testing.assert_allclose(sweep["high"][0], -0.2 + 1j * (4.0 - machs))


def test_a_pair_that_parts_into_two_real_modes_ends_and_two_begin() -> None:
    def modes_at(mach: float, altitude: float) -> Modes:
        del altitude
        if mach < 1.5:
            found = [Mode("short period", -1.0 + 1j * (1.5 - mach), 1.0, {"alpha": 1.0 + 0j})]
        else:
            found = [Mode(f"short period {i}", complex(-i), 1.0, {"alpha": 1.0 + 0j}) for i in (1, 2)]
        return Modes(tuple(found), 1.0, 0.0)

    sweep = sweep_modes(modes_at, [1.0, 1.4, 1.6, 2.0])
    assert sweep.names == ("short period", "short period 1", "short period 2")
    assert np.isnan(sweep["short period"][0, 2:]).all()
    np.testing.assert_allclose(sweep["short period 2"][0, 2:], -2.0)


def test_a_missile_s_arms_over_mach_and_altitude_are_those_of_the_closed_form() -> None:
    model = derivative_model(Cm_alpha=table(MACH, [1.5, 3.0], [-40.0, -16.0]), CN_q=0.0, CN_alphadot=0.0)
    machs, altitudes = [1.5, 2.25, 3.0], [0.0, 5000.0]
    sweep = missile_mode_sweep(FINNER, model, machs, altitudes, roll_rate=50.0)
    for i, height in enumerate(altitudes):
        air = air_at(StandardAtmosphere(), height)
        for j, (mach, slope) in enumerate(zip(machs, (-40.0, -28.0, -16.0), strict=True)):
            speed = mach * float(air.speed_of_sound)
            held = derivative_model(Cm_alpha=slope, CN_q=0.0, CN_alphadot=0.0)
            fast, _ = epicyclic_roots(FINNER, held, float(air.density), speed, 50.0)
            found = sweep["fast arm"][i, j]
            assert found.real == pytest.approx(fast.real * speed, rel=0.01)
            assert found.imag == pytest.approx(fast.imag * speed, rel=1e-3)
    assert "fast arm" in sweep.summary()
    assert len(sweep.plot().axes) == 3


def test_an_aircraft_is_trimmed_at_every_point_and_points_without_a_trim_are_told(tmp_path) -> None:
    steady = level()
    dynamics = steady.dynamics
    sound = steady["speed"] / steady["mach"]
    machs = [steady["speed"] / sound * f for f in (0.02, 1.0, 1.2)]
    sweep = aircraft_mode_sweep(
        dynamics,
        machs,
        unknown=("alpha", "elevator", "thrust"),
        given={name: 0.0 for name in dynamics.parameter_names if name not in ("elevator", "thrust")},
    )
    modes = aircraft_modes(linear_flight(steady))
    assert sweep["short period"][0, 1] == pytest.approx(modes["short period"].eigenvalue, rel=1e-9)
    sweep.to_csv(tmp_path / "modes.csv")
    rows = (tmp_path / "modes.csv").read_text().splitlines()
    assert rows[0].startswith("altitude_m,mach,mode")
    assert len(rows) == 1 + len(machs) * len(sweep.names)


def test_no_flight_at_all_is_refused() -> None:
    def nowhere(mach: float, altitude: float) -> Modes:
        raise InputError(f"no trim at {mach:g}")

    with pytest.raises(InputError, match=r"no flight at any point: no trim at 0\.5"):
        sweep_modes(nowhere, [0.5])
    with pytest.raises(InputError, match="above 0"):
        sweep_modes(crossing, [0.0])


def nonlinear_root(model, inertia: float, guess: complex) -> complex:
    """Root of det(lambda) [1/m] of e and q/V with H(lambda c/2) of the model in place of derivatives."""
    a, b, c, d = model.matrices
    area, length, mass = FINNER.reference.area, FINNER.reference.length, FINNER.mass
    slowing = DENSITY * area * model.CA_0 / (2.0 * mass)
    force, moment = DENSITY * area / (2.0 * mass), DENSITY * area * length / (2.0 * inertia)

    def determinant(root: complex) -> complex:
        s = 0.5 * length * root
        h = d + c @ np.linalg.solve(s * np.eye(len(a)) - a, b)
        upper = (root - slowing + force * h[0, 0], -1.0 + force * 0.5 * length * h[0, 1])
        lower = (-moment * h[1, 0], root - slowing - moment * 0.5 * length * h[1, 1])
        return upper[0] * lower[1] - upper[1] * lower[0]

    root, step = guess, 1e-6 * guess
    other = guess + step
    for _ in range(60):
        f, g = determinant(root), determinant(other)
        if f == g:
            break
        root, other = other, other - g * (other - root) / (g - f)
        if abs(root - other) < 1e-14 * abs(root):
            break
    return other


def test_damping_over_k_solves_the_eigenproblem_with_h_of_s() -> None:
    model = first_order_lag(0.05)
    found = damping_over_k(FINNER, model, SPEED, k=[0.002, 0.01, 0.05])
    for k, value in zip((0.002, 0.01, 0.05), found.lagging, strict=True):
        inertia = FINNER.inertia[1, 1] * (found.k_here / k) ** 2
        root = nonlinear_root(model, inertia, value / SPEED * (1.0 + 1e-4))
        assert value / SPEED == pytest.approx(root, rel=1e-12)


def test_lag_modes_of_a_missile_that_pass_one_another_keep_their_names() -> None:
    """Two lags whose poles trade places between Mach 1 and 3, -0.1 and -0.9, each with little of the loads."""
    d = derivative_model()
    slope, rate = np.array([[d.CN_alpha], [d.Cm_alpha]]), np.array([[d.CN_q], [d.Cm_q]])

    def system(poles: tuple[float, float]) -> control.StateSpace:
        late = 0.02 * np.hstack([slope, slope])
        return control.ss(np.diag(poles), [[-poles[0], 0.0], [-poles[1], 0.0]], late, np.hstack([0.96 * slope, rate]))

    model = ScheduledStateSpaceAerodynamics(
        reference=d.reference,
        CA_0=d.CA_0,
        Cl_p=d.Cl_p,
        machs=(1.0, 3.0),
        systems=(system((-0.1, -0.9)), system((-0.9, -0.1))),
    )
    machs = np.linspace(1.0, 3.0, 12)
    sweep = missile_mode_sweep(FINNER, model, machs)
    scale = 2.0 * machs * float(air_at(StandardAtmosphere(), 0.0).speed_of_sound) / FINNER.reference.length
    first, second = (sweep[name][0].real / scale for name in ("lag 1", "lag 2"))
    np.testing.assert_allclose(first, -0.1 - 0.4 * (machs - 1.0), atol=0.01)
    np.testing.assert_allclose(second, -0.9 + 0.4 * (machs - 1.0), atol=0.01)


def test_memory_does_nothing_at_low_k_and_its_effect_grows_as_the_square() -> None:
    found = damping_over_k(FINNER, first_order_lag(0.3), SPEED, k=[0.0005, 0.001, 0.002])
    change = np.abs(found.lagging - found.quasi_steady) / np.abs(found.quasi_steady)
    assert change[0] < 1e-3
    assert np.all(np.diff(np.abs(found.ratio_change)) > 0.0)
    assert found.k == pytest.approx([0.0005, 0.001, 0.002], rel=0.01)
    assert "differs by more than 1%" in found.summary()
    assert len(found.plot().axes) == 2
    with pytest.raises(InputError, match="must be positive"):
        damping_over_k(FINNER, first_order_lag(0.3), SPEED, k=[0.0])


@pytest.mark.parametrize("name", ["short period", "phugoid", "Dutch roll", "roll", "spiral"])
def test_the_decay_of_a_nonlinear_flight_is_that_of_the_mode(name: str) -> None:
    steady = trim(boeing_747(), given={"speed": CRUISE}, unknown=())
    linear = linear_flight(steady)
    mode = aircraft_modes(linear)[name]
    far, near = (abs(fitted_eigenvalue(linear, mode, amplitude=size) - mode.eigenvalue) for size in (4e-3, 1e-3))
    size = abs(mode.eigenvalue)
    assert near < 2e-3 * size
    assert near < 0.5 * far or near < 1e-6 * size


def test_named_modes_are_rated_as_their_eigenvalues() -> None:
    steady = trim(boeing_747(), given={"speed": CRUISE}, unknown=())
    modes = aircraft_modes(linear_flight(steady))
    rated = rate_modes("III", "B", modes)
    each = rate_modes(
        "III",
        "B",
        short_period=modes["short period"].eigenvalue,
        phugoid=modes["phugoid"].eigenvalue,
        dutch_roll=modes["Dutch roll"].eigenvalue,
        roll=modes["roll"].damping,
        spiral=modes["spiral"].damping,
    )
    assert rated == each
    assert math.isfinite(rated.level or math.nan)


def test_points_beyond_the_table_are_refused_not_extrapolated() -> None:
    records = [
        Derivative(
            name=name,
            method="measured",
            value=value * mach,
            mach=mach,
            alpha_deg=0.0,
            beta_deg=0.0,
            source="made",
            reference_length_m=FINNER.reference.length,
            reference_area_m2=FINNER.reference.area,
            moment_reference_m=FINNER.reference.moment_reference,
        )
        for name, value in (("CN_alpha", 6.0), ("Cm_alpha", -14.0), ("Cm_q", -150.0))
        for mach in (1.5, 2.0, 3.0)
    ]
    made = DerivativeTable(tuple(records))
    given = {"CA_0": 0.5, "Cl_p": -20.0, "CN_q": 0.0, "CN_alphadot": 0.0, "Cm_alphadot": 0.0}
    model = DerivativeAerodynamics.over_mach(made, **given)
    assert (model.validity.mach_min, model.validity.mach_max) == (1.5, 3.0)
    sweep = missile_mode_sweep(FINNER, model, [1.4, 1.5, 2.5, 3.1])
    assert set(sweep.refused) == {(0.0, 1.4), (0.0, 3.1)}
    assert np.isnan(sweep["fast arm"][0, [0, 3]]).all()
    held = DerivativeAerodynamics(
        reference=FINNER.reference, CN_alpha=15.0, Cm_alpha=-35.0, Cm_q=-375.0, CA_0=0.5, Cl_p=-20.0
    )
    same = missile_mode_sweep(FINNER, held, [2.5])
    # the values' own slope over Mach does not enter: at zero incidence no load but CA depends on it
    assert sweep["fast arm"][0, 2] == pytest.approx(same["fast arm"][0, 0], rel=1e-9)
    for wrong, message in (
        ({"CN_alfa": 1.0}, "unknown derivatives CN_alfa"),
        ({}, "needs two or more records"),
    ):
        with pytest.raises(InputError, match=message):
            DerivativeAerodynamics.over_mach(made, **wrong)
    with pytest.raises(InputError, match="has 6 at 3"):
        DerivativeAerodynamics.over_mach(made + made, **given)


def test_an_aircraft_file_over_the_envelope_is_the_aircraft_at_each_point() -> None:
    file = find_aircraft("boeing_747")
    assert file is not None
    sweep = sweep_of_aircraft(file, [0.6, 0.8], [5000.0, 12000.0])
    one = damping_of_aircraft(file, mach=0.6, altitude=5000.0)
    for name in sweep.names:
        assert sweep[name][0, 0] == pytest.approx(one.all_modes[name].eigenvalue, rel=1e-9), name
    assert one.steady.parameters["CX_alpha"] == pytest.approx(0.2193 * one.steady.parameters["CZ_0"] / -0.654, rel=1e-3)


def test_the_command_writes_a_sweep_whose_points_are_single_flights(tmp_path):
    file = tmp_path / "modes.json"
    words = ["damping", "boeing_747", "--machs", "0.7:0.9:3", "--altitudes", "9000:12000:2", "--json", str(file)]
    done = CliRunner().invoke(app, words)
    assert done.exit_code == 0, done.output
    assert "modes at 2 altitudes from 9000 to 12000 m, 3 Mach numbers from 0.7 to 0.9" in done.output
    assert "derivatives are those of Mach 0.8, held" in done.output
    told = json.loads(file.read_text(encoding="utf-8"))
    single = damping_of_aircraft(find_aircraft("boeing_747"), mach=0.9, altitude=9000.0)
    for one in single.modes:
        swept = told["modes"][one.mode.name]
        assert swept["real_1_s"][0][2] == pytest.approx(one.mode.eigenvalue.real, rel=1e-9)
        assert swept["imaginary_rad_s"][0][2] == pytest.approx(abs(one.mode.eigenvalue.imag), rel=1e-9)
