"""Inputs: orthogonal multisines, promised errors against those of records, ranking, and a designed control."""

from dataclasses import replace
from functools import cache

import casadi as ca
import numpy as np
import pytest
from scipy.stats import chi2

from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.flightsim import BodyAxisAerodynamics, FlatEarth, InitialState, Signal, Vehicle, build_dynamics
from indicial.identification import (
    Experiment,
    FlightRecord,
    Manoeuvre,
    Parameter,
    fit_manoeuvres,
    improve_input,
    multisines,
    rank_manoeuvres,
    relative_peak_factor,
)

TIME = np.arange(0.0, 10.0, 0.05)
TRUTH = {"CZ_alpha": -5.0, "Cm_alpha": -0.8, "Cm_q": -14.0, "Cm_alphadot": -5.0, "Cm_elevator": -1.2}
NOISE = {"alpha": 0.002, "q": 0.003, "theta": 0.002, "az": 0.1}
FREE = ("alpha", "theta", "q")


@cache
def experiment() -> Experiment:
    """A light aircraft with an elevator, and flaps that lift without a moment."""
    reference = ReferenceQuantities(length=1.5, area=16.0, lateral_length=11.0, moment_reference=(0.0, 0.0, 0.0))
    vehicle = Vehicle("light aircraft", 1000.0, np.diag([1200.0, 1800.0, 2700.0]), reference, (0.0, 0.0, 0.0))
    free = {name: ca.SX.sym(name) for name in TRUTH}
    model = BodyAxisAerodynamics(
        reference=reference,
        CD_0=0.05,
        CZ_0=-0.03 - 1.5 * ca.SX.sym("flap"),
        CZ_alpha=free["CZ_alpha"],
        Cm_alpha=free["Cm_alpha"],
        Cm_q=free["Cm_q"],
        Cm_alphadot=free["Cm_alphadot"],
        Cm_0=0.04 + free["Cm_elevator"] * ca.SX.sym("elevator"),
    )
    return Experiment(
        build_dynamics(vehicle, model), InitialState.from_path(60.0, alpha=0.05), TRUTH, NOISE, TIME, FREE
    )


def test_multisines_are_orthogonal_of_the_size_asked_for_and_flat():
    found = multisines(TIME, {"elevator": 0.03, "flap": 0.05}, (0.2, 2.0), seed=1)
    one, other = (found[name].at(TIME) for name in ("elevator", "flap"))
    assert abs(one @ other) < 1e-10 * np.linalg.norm(one) * np.linalg.norm(other)
    assert np.max(np.abs(one)) == pytest.approx(0.03)
    assert np.max(np.abs(other)) == pytest.approx(0.05)
    assert max(relative_peak_factor(one), relative_peak_factor(other)) < 1.35
    assert relative_peak_factor(np.sin(2.0 * np.pi * TIME)) == pytest.approx(1.0, rel=1e-3)
    lines = np.abs(np.fft.rfft(one))
    assert np.count_nonzero(lines > 1e-9 * lines.max()) == 10


def test_what_a_manoeuvre_promises_is_the_covariance_that_its_record_gives():
    signal = Signal.multistep(0.03, 0.7, 0.5)
    promise = experiment().judge({"elevator": signal})
    record = flown(signal, None)
    fit = fit_manoeuvres([record], [Parameter(n, v) for n, v in TRUTH.items()], estimate_noise=False)
    reported = [fit[name].standard_error for name in promise.names]
    np.testing.assert_allclose(promise.standard_errors, reported, rtol=1e-3)
    assert promise.outputs["alpha"].shape == TIME.shape


def test_instants_far_apart_promise_what_their_few_samples_give():
    """Every 0.5 s, two radians of the fastest motion: as a record of every 0.05 s of which the rest is missing."""
    signal = Signal(TIME, 0.03 * np.sin(2.5 * TIME))
    few = replace(experiment(), time=TIME[::10]).judge({"elevator": signal})
    fine = flown(signal, None)
    measured = np.full(fine.measured.shape, np.nan)
    measured[::10] = fine.measured[::10]
    record = replace(fine, measured=measured, substeps=np.full(TIME.size - 1, 4, dtype=np.int64))
    fit = fit_manoeuvres([record], [Parameter(n, v) for n, v in TRUTH.items()], estimate_noise=False)
    reported = [fit[name].standard_error for name in few.names]
    np.testing.assert_allclose(few.standard_errors, reported, rtol=1e-2)


def flown(signal, seed):
    """The record of a flight with this elevator."""
    promise = experiment().judge({"elevator": signal})
    rng = np.random.default_rng(0 if seed is None else seed)
    noise = {c: (0.0 if seed is None else 1.0) * sd * rng.standard_normal(TIME.size) for c, sd in NOISE.items()}
    channels = {c: promise.outputs[c] + noise[c] for c in NOISE}
    record = FlightRecord(TIME, channels, {}, NOISE)
    return Manoeuvre.of_flight(
        record, experiment().dynamics, experiment().initial, free_start=FREE, known={"elevator": signal, "flap": 0.0}
    )


def test_records_scatter_as_promised():
    signal = Signal.multistep(0.03, 0.7, 0.5)
    promise = experiment().judge({"elevator": signal})
    count, scaled = 20, []
    for seed in range(1, count + 1):
        fit = fit_manoeuvres([flown(signal, seed)], [Parameter(n, v) for n, v in TRUTH.items()], threads=1)
        scaled.append(
            [(fit[n].value - TRUTH[n]) / e for n, e in zip(promise.names, promise.standard_errors, strict=True)]
        )
    size = np.mean(np.square(scaled), axis=0)
    low, high = chi2.ppf([0.0005, 0.9995], count) / count
    assert np.all((size > low) & (size < high))


def test_flaps_beside_the_elevator_tell_cm_q_and_cm_alphadot_twice_as_surely():
    """Lift of its own bends the path, by which alone incidence and attitude part."""
    both = multisines(TIME, {"elevator": 0.03, "flap": 0.3}, (0.2, 1.5), seed=2)
    ranking = rank_manoeuvres(
        experiment(),
        {
            "doublet": {"elevator": Signal.doublet(0.03, 1.0, 0.5)},
            "3-2-1-1": {"elevator": Signal.multistep(0.03, 0.7, 0.5)},
            "elevator and flap": both,
            "still": {},
        },
        ("Cm_q", "Cm_alphadot"),
    )
    assert ranking.best == "elevator and flap"
    assert list(ranking.promises)[-1] == "still"
    alone, together = ranking.promises["3-2-1-1"], ranking.promises["elevator and flap"]
    for name in ranking.wanted:
        assert together.relative_errors[name] < 0.5 * alone.relative_errors[name]
    assert "Cm_elevator will have no effect" in ranking.promises["still"].findings
    assert "elevator and flap" in ranking.summary()


def test_a_body_whose_path_does_not_bend_is_told_not_to_separate_them():
    """Fifty times the mass: incidence and attitude go together whatever the controls do."""
    one = experiment()
    heavy = replace(one.dynamics.vehicle, mass=50_000.0)
    stiff = replace(one, dynamics=build_dynamics(heavy, one.dynamics.aerodynamics, earth=FlatEarth(0.0)))
    promise = stiff.judge({"elevator": Signal.multistep(0.03, 0.7, 0.5)})
    assert promise.correlation("Cm_q", "Cm_alphadot") < -0.99
    assert promise.relative_errors["Cm_q"] > 5.0 * one.judge(promise.inputs).relative_errors["Cm_q"]


def test_a_designed_control_tells_more_than_the_one_it_began_with_and_stays_within_limits():
    start = Signal.multistep(0.02, 0.7, 0.5)
    limits = {"alpha": (-0.08, 0.25)}
    before = experiment().judge({"elevator": start})
    designed = improve_input(experiment(), "elevator", start, 0.03, steps=16, limits=limits)
    assert designed.log_determinant < before.log_determinant
    assert all(designed.relative_errors[n] < before.relative_errors[n] for n in ("Cm_alpha", "Cm_elevator"))
    assert np.min(designed.outputs["alpha"]) >= limits["alpha"][0]
    assert np.max(designed.outputs["alpha"]) <= limits["alpha"][1]
    assert np.max(np.abs(designed.inputs["elevator"].value)) <= 0.03 + 1e-12
    assert "will tell" in designed.summary()
    assert len(designed.plot().axes) == 1 + len(NOISE)


def test_a_designed_control_tells_more_than_the_best_3_2_1_1_of_its_size_and_length():
    units = np.linspace(0.3, 1.2, 10)
    classic = rank_manoeuvres(experiment(), {f"{u:.1f} s": {"elevator": Signal.multistep(0.03, u, 0.5)} for u in units})
    best = classic.promises[classic.best]
    designed = improve_input(experiment(), "elevator", best.inputs["elevator"], 0.03, steps=20)
    assert np.max(np.abs(designed.inputs["elevator"].value)) <= 0.03 + 1e-12
    assert designed.log_determinant < best.log_determinant
    assert np.mean(designed.standard_errors / best.standard_errors) < 1.0


def test_a_start_that_breaks_a_limit_between_the_samples_is_not_what_is_designed():
    # the pulse stands between the middles of the two steps, so the sampled start is no motion at all
    pulse = Signal.pieces(np.array([0.0, 4.5, 5.5, 10.0]), np.array([0.0, -0.3, 0.0]), 0.0, 0.0)
    limits = {"alpha": (-0.08, 0.25)}
    assert np.max(experiment().judge({"elevator": pulse}).outputs["alpha"]) > limits["alpha"][1]
    designed = improve_input(experiment(), "elevator", pulse, 0.002, steps=2, limits=limits)
    assert np.max(designed.outputs["alpha"]) <= limits["alpha"][1]
    assert np.max(np.abs(designed.inputs["elevator"].value)) <= 0.002


def test_what_makes_no_sense_is_refused():
    with pytest.raises(InputError, match="no control 'rudder'"):
        experiment().judge({"rudder": 0.1})
    with pytest.raises(InputError, match="breaks a limit"):
        improve_input(experiment(), "elevator", Signal.step(0.03), 0.03, limits={"alpha": (0.049, 0.051)})
    with pytest.raises(InputError, match="no channel 'beta'"):
        improve_input(experiment(), "elevator", Signal.step(0.0), 0.03, limits={"beta": (0.0, 1.0)})
    with pytest.raises(InputError, match="Cm_q is believed to be 0"):
        replace(experiment(), values=TRUTH | {"Cm_q": 0.0}).judge({})
    with pytest.raises(InputError, match="harmonics"):
        multisines(TIME, {"elevator": 0.1}, (0.2, 0.21))
    with pytest.raises(InputError, match="no parameter 'Cn_r'"):
        rank_manoeuvres(experiment(), {"a": {}}, ("Cn_r",))
