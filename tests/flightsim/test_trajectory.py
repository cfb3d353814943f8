"""Trajectories: files, interpolation, comparison."""

import json
import math
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from flightsim.support import FINNER, SPEED, derivative_model, first_order_lag
from indicial.cli import app
from indicial.errors import InputError
from indicial.files import read_csv
from indicial.flightsim import (
    End,
    FlatEarth,
    InitialState,
    Trajectory,
    build_dynamics,
    compare,
    missile_modes,
    simulate,
    swerve,
)

START = InitialState.from_path(SPEED, alpha=0.03, beta=0.01, rate=(200.0, 1.0, -2.0), position=(0.0, 0.0, -2.0))


@pytest.fixture(scope="module")
def flight() -> Trajectory:
    return simulate(FINNER, first_order_lag(0.3), START, 0.02, step=1e-5)


@pytest.mark.parametrize("suffix", ["nc", "csv", "parquet"])
def test_a_file_brings_every_digit_back(flight: Trajectory, tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"flight.{suffix}"
    flight.save(path)
    back = Trajectory.load(path)
    for item in fields(Trajectory):
        one, other = getattr(flight, item.name), getattr(back, item.name)
        assert np.array_equal(one, other) if isinstance(one, np.ndarray) else one == other


def test_a_file_of_another_kind_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "other.csv"
    path.write_text("# format: something\ntime\n0\n")
    with pytest.raises(InputError, match="trajectory"):
        Trajectory.load(path)
    with pytest.raises(InputError, match="no such"):
        Trajectory.load(tmp_path / "missing.nc")
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    parquet.write_table(pyarrow.table({"time_s": [0.0]}), tmp_path / "other.parquet")
    for name in ("other", "missing"):
        with pytest.raises(InputError, match=f"{name}.parquet"):
            Trajectory.load(tmp_path / f"{name}.parquet")
    with pytest.raises(InputError, match="ends in"):
        Trajectory.load(tmp_path / "flight.txt")


def test_a_file_that_lacks_a_column_is_refused(flight: Trajectory, tmp_path: Path) -> None:
    path = tmp_path / "flight.csv"
    flight.save(path)
    path.write_text(path.read_text().replace("q_rad_s", "q_deg_s"))
    with pytest.raises(InputError, match="q_rad_s"):
        Trajectory.load(path)


def test_interpolation_is_of_fourth_order_between_instants() -> None:
    model, duration = derivative_model(), 0.04
    exact = simulate(FINNER, model, START, duration, step=1e-4)
    errors = []
    for step in (2e-3, 1e-3):
        coarse = exact.at_times(np.arange(0.0, duration + step / 2.0, step).clip(max=duration))
        middle = coarse.time[5:-6] + step / 2.0
        errors.append(np.max(np.abs(coarse.at_times(middle).velocity - exact.at_times(middle).velocity)))
    assert np.log2(errors[0] / errors[1]) > 3.3


def test_stations_are_met_and_bounds_are_kept(flight: Trajectory) -> None:
    stations = np.array([0.5, 3.3, 12.0])
    assert flight.at_stations(stations).position[:, 0] == pytest.approx(stations, abs=1e-11)
    with pytest.raises(InputError, match="stations"):
        flight.at_stations([1e3])
    with pytest.raises(InputError, match="times"):
        flight.at_times([-1.0])


def test_coefficients_are_those_of_the_model() -> None:
    model = derivative_model(CN_q=0.0, CN_alphadot=0.0, Cm_q=0.0, Cm_alphadot=0.0)
    flown = simulate(FINNER, model, START, 0.01, step=1e-4)
    side, normal = (flown.velocity[:, i] / flown.speed for i in (1, 2))
    expected = np.stack(
        [
            np.full(len(flown), model.CA_0),
            -model.CN_alpha * side,
            model.CN_alpha * normal,
            model.Cl_p * flown.rate[:, 0] * 0.03 / (2.0 * flown.speed),
            model.Cm_alpha * normal,
            -model.Cm_alpha * side,
        ],
        axis=1,
    )
    assert flown.coefficients == pytest.approx(expected, abs=1e-12)


def test_non_rolling_incidence_does_not_see_the_roll() -> None:
    """A missile without damping or spin inertia swings in a plane, whatever it rolls."""
    model = derivative_model(Cl_p=0.0)
    start = InitialState.from_path(SPEED, alpha=0.02, rate=(300.0, 0.0, 0.0))
    vehicle = FINNER.__class__("thin", 1.6, np.diag([1e-9, 0.0098, 0.0098]), FINNER.reference, FINNER.centre_of_gravity)
    xi = simulate(vehicle, model, start, 0.1, step=1e-4, earth=FlatEarth(0.0)).non_rolling_incidence
    assert np.max(np.abs(xi.real)) < 1e-6
    assert np.max(np.abs(xi.imag)) == pytest.approx(math.sin(0.02), rel=1e-6)


def test_flight_compared_with_itself_shows_no_difference() -> None:
    flown = simulate(FINNER, derivative_model(), START, 0.2, step=1e-4)
    for aligned in ("time", "station"):
        same = compare(flown, flown, aligned=aligned)
        assert np.all(same.rms_position < 1e-12)
        assert same.rms_incidence < 1e-14
        assert all(abs(arm.damping) < 1e-9 and abs(arm.phase) < 1e-9 for arm in same.arms)


def test_compared_flights_show_the_modes_difference_of_damping_and_phase() -> None:
    models = (derivative_model(), derivative_model(Cm_q=-200.0, Cm_alpha=-27.5))
    start = InitialState.from_path(SPEED, alpha=0.01)
    one, other = (simulate(FINNER, m, start, 1.0, step=1e-4, end=End(x=180.0), earth=FlatEarth(0.0)) for m in models)
    found = compare(one, other, aligned="station")
    modes = [missile_modes(build_dynamics(FINNER, m), SPEED)["fast arm"].per_metre for m in models]
    change = modes[1] - modes[0]
    fast = found.arms[0]
    speed = float(np.mean(found.first.speed))
    assert fast.damping / speed == pytest.approx(change.real, rel=1e-3)
    assert fast.frequency / speed == pytest.approx(change.imag, rel=1e-3)
    assert fast.phase == pytest.approx(change.imag * 180.0, abs=0.02)
    assert "damping" in found.summary()
    for k, sign in ((0, 1.0), (1, -1.0)):
        along = sign * change.imag * found.first.distance
        np.testing.assert_allclose(found.phase_difference[:, k], along, atol=0.03)


def test_swerve_is_what_winds_about_the_path(tmp_path: Path) -> None:
    """A helix of known radius about a parabola: the helix is left, and the difference of two is their radii's."""
    x = np.linspace(0.0, 200.0, 801)

    def helix(radius: float) -> Trajectory:
        start = simulate(FINNER, derivative_model(), START, 0.01, step=1e-3, estimate_error=False)
        n, turn = x.size, 0.6 * x
        position = np.stack([x, radius * np.cos(turn) + 1e-3 * x, radius * np.sin(turn) + 2e-4 * x**2], axis=1)
        values = {name: np.repeat(getattr(start, name)[:1], n, axis=0) for name in ("velocity", "quaternion", "rate")}
        values |= {name: np.repeat(getattr(start, name)[:1], n, axis=0) for name in ("force", "moment", "lag")}
        air = {name: np.full(n, getattr(start, name)[0]) for name in ("density", "speed_of_sound")}
        return Trajectory(
            time=x / 600.0, position=position, **values, **air, outside_range=np.zeros(n), reference=start.reference
        )

    winding = swerve(helix(0.01))
    assert np.sqrt(np.mean(np.sum(winding**2, axis=1))) == pytest.approx(0.01, rel=0.02)
    np.testing.assert_allclose(np.linalg.norm(winding[80:-80], axis=1), 0.01, rtol=0.05)
    found = compare(helix(0.01), helix(0.03), aligned="station", arms=False)
    np.testing.assert_allclose(found.swerve_difference, 2.0 * winding, atol=1e-12)
    assert np.all(np.isnan(found.phase_difference))
    found.to_csv(tmp_path / "differences.csv")
    header, columns = read_csv(tmp_path / "differences.csv")
    assert header["schema_version"] == "1"
    np.testing.assert_allclose(columns["dy_m"], found.position_difference[:, 1])
    assert found.to_dict()["rms_swerve_m"] == pytest.approx(0.02, rel=0.1)


def test_the_command_compares_two_files(flight: Trajectory, tmp_path: Path) -> None:
    flight.save(tmp_path / "one.nc")
    flight.save(tmp_path / "other.csv")
    arguments = ["flights", str(tmp_path / "one.nc"), str(tmp_path / "other.csv"), "--align", "station"]
    done = CliRunner().invoke(
        app,
        [*arguments, "--json", str(tmp_path / "f.json"), "--csv", str(tmp_path / "f.csv"), "--figures", str(tmp_path)],
    )
    assert done.exit_code == 0, done.output
    assert json.loads((tmp_path / "f.json").read_text())["rms_position_m"] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    assert (tmp_path / "path_first.png").is_file()


def test_pictures_are_drawn(flight: Trajectory) -> None:
    import matplotlib.pyplot as plt

    assert len(flight.plot().axes) == 4
    assert len(compare(flight, flight, arms=False).plot().axes) == 5
    assert len(flight.plot_path().axes) == 1
    plt.close("all")
