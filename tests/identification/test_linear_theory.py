import math

import numpy as np
import pytest

from flightsim.support import DENSITY, FINNER, derivative_model
from identification.support import MODEL, TRUTH, flight, fly_range
from indicial.errors import InputError
from indicial.flightsim import DerivativeAerodynamics, epicyclic_roots
from indicial.identification import RangeRecord, linear_theory, measure, reduce_linearly

SOUND = math.sqrt(1.4 * 8314.32 / 28.9644 * 293.15)


def exact_record(arms, roll_rate=0.0, stations=40):
    """The closed form of linear theory itself: drag, epicycle, swerve and (undamped) roll, without gravity."""
    model = derivative_model(CN_q=0.0, CN_alphadot=0.0, Cm_q=-360.0, Cm_alphadot=0.0)
    speed = 687.0
    s = np.linspace(0.0, 230.0, stations)
    area, mass = FINNER.reference.area, FINNER.mass
    b = DENSITY * area * model.CA_0 / (2.0 * mass)
    lift = DENSITY * area * (model.CN_alpha - model.CA_0) / (2.0 * mass)
    roots = np.array(epicyclic_roots(FINNER, model, DENSITY, speed, roll_rate))
    waves = np.exp(np.outer(s, roots)) * np.array(arms)
    attitude = (waves * (1.0 + lift / roots)).sum(axis=1) + 0.001 - 0.002j
    swerve = -lift * (waves / roots**2).sum(axis=1) + (0.01 + 0.02j) + (1e-4 - 2e-4j) * s
    return RangeRecord(
        time=np.expm1(b * s) / (b * speed),
        x=s,
        y=swerve.real,
        z=swerve.imag,
        yaw=-attitude.real,
        pitch=attitude.imag,
        roll=None if roll_rate == 0.0 else roll_rate / speed * s,
    )


@pytest.mark.parametrize("arms", [(0.02 + 0.01j, 0.015 - 0.01j), (0.02j, 0.02j), (0.03, 0.0)])
def test_exact_epicycles_give_their_derivatives_exactly(arms):
    """Elliptic, planar and circular motion (one arm only)."""
    theory = linear_theory(exact_record(arms), FINNER, DENSITY, SOUND, 0.0)
    wanted = {"CN_alpha": 12.0, "Cm_alpha": -28.0, "Cm_q+Cm_alphadot": -360.0}
    for name, value in wanted.items():
        assert theory.value(name) == pytest.approx(value, rel=2e-5), name
    # CA_0 is the drag less CN_alpha times the mean square yaw, which this record's drag has not got
    drag = theory.value("CA_0") + theory.value("CN_alpha") * theory.mean_square_yaw
    assert drag == pytest.approx(0.55, rel=1e-8)


def test_arms_of_an_exact_epicycle_have_their_amplitude_and_eigenvalue():
    arms = (0.02 + 0.01j, 0.015 - 0.01j)
    model = derivative_model(CN_q=0.0, CN_alphadot=0.0)
    fast, slow = epicyclic_roots(FINNER, model, DENSITY, 687.0)
    epicycle = linear_theory(exact_record(arms), FINNER, DENSITY, SOUND, 0.0).epicycle
    assert epicycle.fast.eigenvalue == pytest.approx(fast, rel=1e-6)
    assert epicycle.slow.eigenvalue == pytest.approx(slow, rel=1e-6)
    assert epicycle.trim == pytest.approx(0.001 - 0.002j, rel=1e-5)


def test_the_turning_of_the_arms_by_roll_is_taken_out():
    """Roll makes the arms turn at different rates; what is left out is the small term P T of the theory."""
    arms = (0.02 + 0.01j, 0.015 - 0.01j)
    theory = linear_theory(exact_record(arms, roll_rate=80.0), FINNER, DENSITY, SOUND, 0.0)
    epicycle = theory.epicycle
    gyration = FINNER.inertia[0, 0] / FINNER.inertia[1, 1] * 80.0 / 687.0
    assert (epicycle.fast.eigenvalue + epicycle.slow.eigenvalue).imag == pytest.approx(gyration, rel=1e-6)
    assert theory.value("Cm_alpha") == pytest.approx(-28.0, rel=1e-3)
    assert theory.value("Cm_q+Cm_alphadot") == pytest.approx(-360.0, rel=1e-2)


def test_a_flight_is_reduced_to_its_derivatives_within_the_accuracy_of_the_theory():
    """A nonlinear flight with gravity and all derivatives; the theory neglects CN_q, CN_alphadot, waves of yaw drag."""
    theory = reduce_linearly(measure(flight(), seed=None), FINNER)
    for name, within in {"CA_0": 2e-3, "CN_alpha": 1e-2, "Cm_alpha": 1e-3, "Cm_q+Cm_alphadot": 5e-3}.items():
        assert theory.value(name) == pytest.approx(TRUTH[name], rel=within), name
    assert theory.mach == pytest.approx(np.mean(flight().mach), rel=2e-3)


def test_the_state_at_the_first_station_is_that_of_the_flight():
    """As well as a theory can that takes the roll rate as constant, while it falls to a hundredth."""
    spun = fly_range(roll_rate=60.0)
    initial = reduce_linearly(measure(spun, seed=None, roll=True), FINNER).initial
    assert initial["Vx"] == pytest.approx(spun.earth_velocity[0, 0], rel=2e-4)
    np.testing.assert_allclose([initial["yaw"], initial["pitch"]], spun.euler[0, :2], atol=1e-3)
    np.testing.assert_allclose([initial["q"], initial["r"]], spun.rate[0, 1:], atol=0.05)
    assert initial["p"] == pytest.approx(60.0, rel=1e-2)


def test_roll_damping_is_that_of_the_flight():
    theory = reduce_linearly(measure(fly_range(roll_rate=60.0), seed=None, roll=True), FINNER)
    assert theory.value("Cl_p") == pytest.approx(TRUTH["Cl_p"], rel=1e-2)


def test_errors_scatter_as_stated():
    errors = []
    for seed in range(80):
        theory = reduce_linearly(measure(flight(), seed=seed), FINNER)
        errors.append([(e.value - TRUTH[e.name]) / e.standard_error for e in theory.derivatives])
    # the scatter of 80 normal numbers is known to 8%; CA_0, whose residuals hold the wave of yaw drag, to less
    np.testing.assert_allclose(np.std(errors, axis=0), 1.0, atol=0.3)


def test_a_record_without_oscillation_is_refused():
    rng = np.random.default_rng(0)
    s = np.linspace(0.0, 230.0, 54)
    noise = 1e-3 * rng.standard_normal((4, 54))
    record = RangeRecord(s / 687.0, s, *noise)
    with pytest.raises(InputError, match="do not oscillate"):
        linear_theory(record, FINNER, DENSITY, SOUND, 0.0)


@pytest.mark.parametrize(("slope", "message"), [(0.3, "do not oscillate"), (1.0, "tumbles")])
def test_an_unstable_missile_is_refused(slope, message):
    unstable = DerivativeAerodynamics(reference=FINNER.reference, CA_0=0.5, CN_alpha=5.0, Cm_alpha=slope, Cm_q=-300.0)
    with pytest.raises(InputError, match=message):
        reduce_linearly(measure(fly_range(unstable, alpha_deg=0.5), seed=1), FINNER)


def test_the_table_names_its_method_reference_and_condition():
    theory = reduce_linearly(measure(flight(), seed=1), FINNER)
    record = theory.table().one("Cm_q+Cm_alphadot")
    assert record.method == "identified"
    assert record.uncertainty == theory.derivatives[3].standard_error
    assert record.moment_reference_m == FINNER.centre_of_gravity
    assert record.mach == theory.mach
    with pytest.raises(InputError, match="linear theory gives"):
        theory.value("CN_q")
    assert MODEL.reference == theory.reference
