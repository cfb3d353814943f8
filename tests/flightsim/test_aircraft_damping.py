"""The damping of an aircraft's modes: gradients, parts, approximations, levels, and the file and command behind it."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from typer.testing import CliRunner

from flightsim.test_aircraft import DENSITY, GRAVITY, SPEED, boeing_747
from indicial.case import read_aircraft
from indicial.cli.commands import app
from indicial.errors import InputError
from indicial.flightsim import (
    AircraftDamping,
    BodyAxisAerodynamics,
    ConstantAtmosphere,
    FlatEarth,
    Mode,
    Modes,
    aircraft_damping,
    build_dynamics,
    classical_modes,
    linear_flight,
    rate_modes,
    trim,
)
from indicial.pipeline.damping import damping_of_aircraft
from indicial.reference_data import find_aircraft

SOUND = math.sqrt(1.4 * 8314.32 / 28.9644 * 216.65)
AIR = ConstantAtmosphere(216.65, DENSITY * 8314.32 / 28.9644 * 216.65)
PUBLISHED = {
    "phugoid": -0.003289 + 0.06723j,
    "short period": -0.3719 + 0.8875j,
    "spiral": -0.0072973,
    "roll": -0.56248,
    "Dutch roll": -0.033011 + 0.94655j,
}


@pytest.fixture(scope="module")
def boeing() -> AircraftDamping:
    file = find_aircraft("boeing_747")
    assert file is not None
    return damping_of_aircraft(file)


def test_the_file_holds_the_747_of_the_book(boeing: AircraftDamping) -> None:
    """Within the half per cent that the rounded derivatives allow; every way of finding the damping agrees."""
    for name, eigenvalue in PUBLISHED.items():
        found = boeing[name].mode.eigenvalue
        assert found.real == pytest.approx(np.real(eigenvalue), rel=5e-3), name
        assert found.imag == pytest.approx(np.imag(eigenvalue), rel=5e-3, abs=1e-12), name
        fitted = boeing[name].fitted
        assert fitted is not None
        assert abs(fitted - found) < 2e-3 * abs(found), name
    mass = boeing_747().vehicle.mass
    assert boeing.steady.dynamics.vehicle.mass == pytest.approx(mass, rel=1e-6)


def test_gradients_are_those_of_differences(boeing: AircraftDamping) -> None:
    vehicle = boeing.steady.dynamics.vehicle
    model = read_aircraft(str(find_aircraft("boeing_747"))).aerodynamics()
    options = {"atmosphere": AIR, "aircraft_class": "III", "category": "B", "gravity": GRAVITY}
    for derivative in ("Cm_q", "CZ_alphadot", "Cl_beta"):
        value = getattr(model, derivative)
        near = [
            aircraft_damping(
                vehicle,
                replace(model, **{derivative: value * (1.0 + sign * 1e-4)}),
                boeing.steady.variables["speed"],
                **options,  # type: ignore[arg-type]
            )
            for sign in (1.0, -1.0)
        ]
        for name in PUBLISHED:
            one, other = (x[name].mode for x in near)
            slope = (one.eigenvalue - other.eigenvalue) / (2e-4 * value)
            assert boeing[name].gradient[derivative] == pytest.approx(slope, rel=1e-4, abs=1e-9)
            ratio = (one.damping_ratio - other.damping_ratio) / (2e-4 * value)
            assert boeing[name].ratio_gradient[derivative] == pytest.approx(ratio, rel=1e-4, abs=1e-8)


def test_what_the_short_period_s_damping_is_made_of(boeing: AircraftDamping) -> None:
    """Cm_q, lift and Cm_alphadot, as the textbook's two-state formula has it, and together the whole."""
    parts = boeing["short period"].parts
    assert set(list(parts)[:3]) == {"Cm_q", "CZ_alpha", "Cm_alphadot"}
    assert sum(parts.values()) == pytest.approx(boeing["short period"].mode.damping, rel=0.02)
    closed = boeing["short period"].closed_form
    assert closed is not None
    assert closed == pytest.approx(boeing["short period"].mode.eigenvalue, rel=0.01)


def test_uncertainty_is_carried_through(boeing: AircraftDamping) -> None:
    made = replace(boeing["short period"], uncertainties={"Cm_q": 1.0, "CZ_alpha": 0.1})
    slopes = made.gradient
    assert made.standard_error == pytest.approx(math.hypot(slopes["Cm_q"].real, 0.1 * slopes["CZ_alpha"].real))
    assert made.ratio_standard_error > 0.0


def test_level_and_record(boeing: AircraftDamping) -> None:
    assert boeing.qualities["Dutch roll"].level == 3
    assert boeing.qualities["roll"].level == 2
    record = json.loads(json.dumps(boeing.to_dict()))
    assert record["schema_version"] == 1
    assert record["handling_qualities"]["level"] == 3
    assert {m["name"] for m in record["modes"]} == set(PUBLISHED)
    assert "MIL-F-8785C" in boeing.summary()
    assert set(boeing.plot()) == {"modes", "damping_parts"}


def test_another_altitude_and_speed_are_balanced_anew() -> None:
    file = find_aircraft("data/aircraft/boeing_747.toml")
    assert file is not None
    low = damping_of_aircraft(file, mach=0.5, altitude=3000.0)
    assert low.steady.outputs["mach"] == pytest.approx(0.5)
    for one in low.modes:  # the flight sees the air that the linear model does
        assert one.fitted is not None
        assert abs(one.fitted - one.mode.eigenvalue) < 2e-3 * abs(one.mode.eigenvalue), one.mode.name
    same = damping_of_aircraft(file, altitude=3000.0)
    assert same.steady.outputs["mach"] == pytest.approx(SPEED / SOUND, rel=1e-6)
    assert low.steady.outputs["load_factor"] == pytest.approx(GRAVITY / 9.80665, rel=1e-6)


def test_classical_approximations_are_exact_where_they_leave_nothing_out(boeing: AircraftDamping) -> None:
    """Without gravity, cross derivatives and CZ_q, pitching, yawing and rolling are each other's strangers."""
    vehicle = boeing.steady.dynamics.vehicle
    vehicle = replace(vehicle, inertia=np.diag(np.diag(vehicle.inertia)))
    kept = {"CZ_alpha": -4.9, "Cm_alpha": -1.0, "Cm_q": -20.0, "Cm_alphadot": -6.0}
    kept |= {"CY_beta": -0.9, "Cn_beta": 0.2, "Cn_r": -0.3, "Cl_p": -0.4}
    loads = BodyAxisAerodynamics(reference=vehicle.reference, speed=SPEED, **kept)
    dynamics = build_dynamics(vehicle, loads, AIR, FlatEarth(0.0))
    values = np.linalg.eigvals(linear_flight(trim(dynamics, given={"speed": SPEED}, unknown=())).a)
    found = classical_modes(vehicle, loads, DENSITY, SPEED, 0.0)
    for name in ("short period", "Dutch roll", "roll"):
        assert np.min(np.abs(values - found[name])) < 1e-9 * abs(found[name]), name


def test_the_classical_spiral_is_the_last_two_coefficients_of_the_quartic(boeing: AircraftDamping) -> None:
    """``-E/D`` of the lateral characteristic polynomial, but for what side force adds to D: a few per cent."""
    at = [boeing.linear.states.index(name) for name in ("beta", "p", "r", "phi")]
    *_, d, e = np.poly(boeing.linear.a[np.ix_(at, at)])
    closed = boeing["spiral"].closed_form
    assert closed is not None
    assert closed.real == pytest.approx(-e / d, rel=0.03)


@pytest.mark.parametrize("lag", [5.896, 0.0, -20.0])
def test_n_alpha_is_that_of_a_steady_pull_up(boeing: AircraftDamping, lag: float) -> None:
    """Its path turns at q = g n/V, and lift of incidence and of pitching make the load factor; alphadot has no part."""
    vehicle = boeing.steady.dynamics.vehicle
    model = replace(read_aircraft(str(find_aircraft("boeing_747"))).aerodynamics(), CZ_alphadot=lag)
    found = aircraft_damping(
        vehicle, model, SPEED, atmosphere=AIR, aircraft_class="III", category="B", gravity=GRAVITY
    ).qualities["short-period frequency"]
    n_alpha = float(found.value.partition("n/alpha ")[2].split()[0])
    lift = vehicle.mass * GRAVITY / (0.5 * DENSITY * SPEED**2 * vehicle.reference.area)
    by_pitching = 5.921 * vehicle.reference.length * GRAVITY / (2.0 * SPEED**2)  # CL for one g of pull-up
    assert n_alpha == pytest.approx(4.92 / (lift - by_pitching), rel=2e-4)


def test_modes_that_no_requirement_is_of_are_told() -> None:
    modes = [Mode("short period", -1 + 2j, 50.0), Mode("roll-spiral", -1 + 1j, 50.0), Mode("lag 1", -9, 50.0)]
    rated = rate_modes("I", "B", Modes(tuple(modes), 50.0, 0.0), n_alpha=10.0)
    assert [r.what for r in rated.ratings] == ["short-period damping", "short-period frequency"]
    assert rated.unrated == ("roll-spiral",)
    assert "roll-spiral" in rated.summary()


def test_the_command_writes_numbers_and_figures(tmp_path) -> None:
    done = CliRunner().invoke(
        app, ["damping", "boeing_747", "--json", str(tmp_path / "x.json"), "--figures", str(tmp_path / "f")]
    )
    assert done.exit_code == 0, done.output
    assert "short period" in done.stdout
    assert (tmp_path / "x.json").is_file()
    assert (tmp_path / "f" / "modes.png").is_file()


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (("CZ_alpha =", "CZ_alhpa ="), "derivatives.CZ_alhpa: no such derivative"),
        (('category = "B"', 'category = "D"'), "category: is 'D'; allowed: 'A' or 'B' or 'C'"),
        (("mass_kg =", "mass_t ="), "mass.mass_t: unknown key; did you mean 'mass_kg'?"),
        (("schema_version = 1", "schema_version = 2"), "schema_version: is 2; allowed: 1"),
        (("Cm_q = -23.92", ""), "derivatives.Cm_q: missing"),
    ],
)
def test_a_wrong_file_is_refused_in_one_line(tmp_path, wrong: tuple[str, str], words: str) -> None:
    text = find_aircraft("boeing_747").read_text(encoding="utf-8")  # type: ignore[union-attr]
    path = tmp_path / "wrong.toml"
    path.write_text(text.replace(*wrong), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_aircraft(path)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_note_is_told_and_written_and_long_names_keep_their_columns():
    file = find_aircraft("boeing_747")
    own, slow = damping_of_aircraft(file, mach=0.8), damping_of_aircraft(file, mach=0.5)
    assert own.notes == ()
    assert slow.notes == ("derivatives are those of Mach 0.8, held at Mach 0.5",)
    assert slow.notes[0] in slow.summary()
    assert slow.to_dict()["notes"] == list(slow.notes)
    # in the table of modes no number touches its neighbour, however long a mode's name is
    rows = slow.summary().splitlines()[3 : 3 + len(slow.modes)]
    for row, one in zip(rows, slow.modes, strict=True):
        numbers = row.removeprefix(f"  {one.mode.name}").split()[:7]
        assert float(numbers[0]) == pytest.approx(one.mode.damping, rel=1e-4)
        assert float(numbers[4]) == pytest.approx(one.mode.damping_ratio, rel=1e-3)
