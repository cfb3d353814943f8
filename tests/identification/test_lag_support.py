"""Lag states from flight: found where they are, not found where they are not, undetermined where they are too quick."""

from functools import cache

import casadi as ca
import numpy as np
import pytest
from scipy.stats import binom

from indicial.conventions import ReferenceQuantities
from indicial.errors import InputError
from indicial.flightsim import (
    BodyAxisAerodynamics,
    DeficiencyAerodynamics,
    DeficiencyTerm,
    InitialState,
    Signal,
    Vehicle,
    build_dynamics,
)
from indicial.identification import FlightRecord, Manoeuvre, Parameter, SensitivityModel, lag_support

TRUTH = {"CZ_alpha": -5.0, "Cm_alpha": -0.8, "Cm_q": -14.0, "Cm_elevator": -1.2}
NOISE = {"alpha": 0.002, "q": 0.003, "theta": 0.002, "az": 0.1}
TIME = np.linspace(0.0, 10.0, 250)
ELEVATOR = Signal.multistep(0.03, 0.7, 0.5).at(TIME)
START = InitialState.from_path(60.0, alpha=0.05, lag=np.array([np.sin(0.05)]))
RATES = np.geomspace(0.003, 1.0, 8)
FREE = ("alpha", "theta", "q")


@cache
def compiled() -> SensitivityModel:
    reference = ReferenceQuantities(length=1.5, area=16.0, lateral_length=11.0, moment_reference=(0.0, 0.0, 0.0))
    vehicle = Vehicle(
        name="light aircraft",
        reference=reference,
        mass=1000.0,
        inertia=np.diag([1200.0, 1800.0, 2700.0]),
        centre_of_gravity=(0.0, 0.0, 0.0),
    )
    free = {name: ca.SX.sym(name) for name in TRUTH}
    base = BodyAxisAerodynamics(
        reference=reference,
        CD_0=0.05,
        CZ_0=-0.03,
        CZ_alpha=free["CZ_alpha"],
        Cm_alpha=free["Cm_alpha"],
        Cm_q=free["Cm_q"],
        Cm_0=0.04 + free["Cm_elevator"] * ca.SX.sym("elevator"),
    )
    term = DeficiencyTerm(rate=ca.SX.sym("b"), CN=ca.SX.sym("a_N"), Cm=ca.SX.sym("a_m"))
    return SensitivityModel.of(build_dynamics(vehicle, DeficiencyAerodynamics(base=base, terms=(term,))), tuple(NOISE))


def manoeuvre(seen, **options):
    record = FlightRecord(TIME, dict(zip(NOISE, seen.T, strict=True)), {"elevator": ELEVATOR}, NOISE)
    return Manoeuvre.of_flight(record, compiled().dynamics, START, model=compiled(), steps_per_interval=2, **options)


@cache
def exact(a_N, a_m, b):
    blank = manoeuvre(np.zeros((TIME.size, len(NOISE))), known={**TRUTH, "a_N": a_N, "a_m": a_m, "b": b})
    values, drive = blank.schedule([])
    return blank.fly(values, drive, np.full(values.size, -1, dtype=np.int64), np.zeros(0)).outputs


def judge(lag, seed, free=FREE, **changed):
    noise = np.random.default_rng(seed).standard_normal((TIME.size, len(NOISE))) * np.array(list(NOISE.values()))
    options = {"rate": "b", "amplitudes": ("a_N", "a_m"), "rates": RATES, "draws": 4000, "threads": 1} | changed
    shot = manoeuvre(exact(*lag) + noise, free_start=free)
    return lag_support([shot], [Parameter(n, v) for n, v in TRUTH.items()], **options)


def test_a_lag_that_matters_is_found_with_its_amplitudes_and_rate():
    found = judge((1.0, -0.3, 0.05), seed=1, free=(*FREE, "deficiency_pitch_0"))
    assert found.supported
    for name, value in {"b": 0.05, "a_N": 1.0, "a_m": -0.3, **TRUTH}.items():
        estimate = found.with_lag[name]
        assert abs(estimate.value - value) < 4.0 * estimate.standard_error, name
    assert found.rates[np.argmax(found.statistic)] == pytest.approx(0.05, rel=0.5)
    assert "a lag is there" in found.summary()
    assert found.plot().axes[0].get_ylabel().startswith("score")


def chance_of_more(count, found, share):
    return binom.sf(found - 1, count, share), binom.cdf(found, count, share)


def test_without_a_lag_it_is_found_as_often_as_stated():
    """Level 20% of 40 records: too many or too few would come by chance once in a thousand."""
    found = sum(judge((0.0, 0.0, 0.05), seed, level=0.2).supported for seed in range(40))
    assert min(chance_of_more(40, found, 0.2)) > 5e-4


@pytest.mark.slow
def test_probabilities_of_records_without_a_lag_are_even():
    from scipy.stats import kstest

    probabilities = [judge((0.0, 0.0, 0.05), seed).probability for seed in range(1000, 1300)]
    assert kstest(probabilities, "uniform").pvalue > 0.001


def test_a_small_lag_is_found_in_most_records():
    """A tenth of the one above stands three to four deviations out of the noise."""
    found = sum(judge((0.1, -0.03, 0.05), seed).supported for seed in range(20))
    assert found >= 8


def test_a_lag_too_quick_for_the_motion_is_a_derivative_and_its_rate_is_not_determined():
    found = judge((1.7, 1.0, 0.8), seed=2)
    assert found.supported
    assert "not determined" in found.verdict or "does not converge" in found.verdict


def test_what_makes_no_sense_is_refused():
    with pytest.raises(InputError, match="b belongs to the lag"):
        lag_support(
            [manoeuvre(exact(0.0, 0.0, 0.05), free_start=FREE)],
            [Parameter("b", 1.0)],
            rate="b",
            amplitudes=["a_N"],
            rates=[0.1],
        )
    with pytest.raises(InputError, match="a_x is in no record's model"):
        judge((0.0, 0.0, 0.05), 1, amplitudes=("a_x",))
    with pytest.raises(InputError, match="rates to look at"):
        judge((0.0, 0.0, 0.05), 1, rates=[0.0])
    with pytest.raises(InputError, match=r"b = 3 is too quick .* at least 4 steps an interval"):
        judge((0.0, 0.0, 0.05), 1, rates=[0.1, 3.0])
