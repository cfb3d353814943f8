"""Aerodynamic models against hand-built linear systems, symmetry, transfer of moments, and rest."""

from dataclasses import replace

import casadi as ca
import control
import numpy as np
import pytest

from flightsim.support import DENSITY, FINNER, SPEED, derivative_model, first_order_lag
from indicial.conventions import ReferenceQuantities
from indicial.derivatives import Derivative, DerivativeTable
from indicial.errors import InputError
from indicial.flightsim import (
    DERIVATIVES,
    AerodynamicLoads,
    Aerodynamics,
    DerivativeAerodynamics,
    FlatEarth,
    FlowState,
    InitialState,
    StateSpaceAerodynamics,
    Validity,
    build_dynamics,
    linearise,
    missile_modes,
    simulate,
)
from indicial.motion import FlightCondition

MASS, PITCH_INERTIA = FINNER.mass, FINNER.inertia[1, 1]
AREA, LENGTH = FINNER.reference.area, FINNER.reference.length
STRAIGHT = InitialState.from_path(SPEED)


def pitch_plane(model: Aerodynamics, *names: str) -> np.ndarray:
    dynamics = build_dynamics(FINNER, model)
    return linearise(dynamics, dynamics.initial_vector(STRAIGHT)).block(names)


def test_alphadot_enters_as_in_the_hand_solved_short_period() -> None:
    """m (wdot - qV) = Z, Iy qdot = M with alphadot loads on the left-hand side, two by two, drag slowing V."""
    d = derivative_model()
    static, damping, lagging = (DENSITY * AREA * f for f in (SPEED / 2.0, SPEED * LENGTH / 4.0, LENGTH / 4.0))
    slowing = -DENSITY * SPEED**2 * AREA * d.CA_0 / (2.0 * MASS)
    left = np.array([[MASS + lagging * d.CN_alphadot, 0.0], [-lagging * LENGTH * d.Cm_alphadot, PITCH_INERTIA]])
    right = np.array(
        [
            [-static * d.CN_alpha + lagging * d.CN_alphadot * slowing / SPEED, MASS * SPEED - damping * d.CN_q],
            [
                LENGTH * (static * d.Cm_alpha - lagging * d.Cm_alphadot * slowing / SPEED),
                LENGTH * damping * d.Cm_q,
            ],
        ]
    )
    assert pitch_plane(d, "w", "q") == pytest.approx(np.linalg.solve(left, right), rel=1e-12)


def test_first_order_lag_equals_the_hand_built_linear_system() -> None:
    pole = 0.4
    model = first_order_lag(pole)
    _, _, c, d = model.matrices
    static, damping = DENSITY * AREA * SPEED / 2.0, DENSITY * AREA * SPEED * LENGTH / 4.0
    reduced = 2.0 * SPEED / LENGTH
    exact = np.array(
        [
            [-static * d[0, 0] / MASS, SPEED - damping * d[0, 1] / MASS, -static * SPEED * c[0, 0] / MASS],
            [
                static * LENGTH * d[1, 0] / PITCH_INERTIA,
                damping * LENGTH * d[1, 1] / PITCH_INERTIA,
                static * SPEED * LENGTH * c[1, 0] / PITCH_INERTIA,
            ],
            [reduced / SPEED, 0.0, -reduced * pole],
        ]
    )
    matrix = pitch_plane(model, "w", "q", "lag_pitch_0")
    assert matrix == pytest.approx(exact, rel=1e-12)
    eigenvalues = [np.sort_complex(np.linalg.eigvals(m)) for m in (matrix, exact)]
    assert eigenvalues[0] == pytest.approx(eigenvalues[1], rel=1e-10)


def test_fast_lag_tends_to_the_derivative_model() -> None:
    exact = missile_modes(build_dynamics(FINNER, derivative_model()), SPEED)["fast arm"].eigenvalue
    errors = [
        abs(missile_modes(build_dynamics(FINNER, first_order_lag(pole)), SPEED)["fast arm"].eigenvalue - exact)
        for pole in (1.0, 10.0, 100.0)
    ]
    assert errors[2] < 1e-4 * abs(exact.real)
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.1)
    assert errors[1] / errors[2] == pytest.approx(10.0, rel=0.1)


def test_quasi_steady_derivatives_of_a_lag_are_those_it_was_built_from() -> None:
    built, given = first_order_lag(0.7).quasi_steady(), derivative_model()
    for name in DERIVATIVES:
        assert getattr(built, name) == pytest.approx(getattr(given, name), rel=1e-12)


def test_flown_lag_tends_to_the_flown_derivative_model_with_spin() -> None:
    """Whatever the axes of the lag, both models are the same in the limit."""
    start = InitialState.from_path(SPEED, alpha=0.02, rate=(2000.0, 0.0, 0.0))
    for axes in ("non_rolling", "body"):
        quasi, fast = (
            simulate(FINNER, model, start, 0.02, step=1e-6, estimate_error=False).rate[-1]
            for model in (derivative_model(lag_axes=axes), first_order_lag(30.0, lag_axes=axes))
        )
        assert fast == pytest.approx(quasi, rel=2e-4, abs=2e-4 * np.abs(quasi[1:]).max())


def test_only_the_damping_sum_counts_if_the_flow_does_not_roll() -> None:
    def damping(axes: str, Cm_q: float, Cm_alphadot: float) -> float:
        model = derivative_model(lag_axes=axes, CN_q=0.0, CN_alphadot=0.0, Cm_q=Cm_q, Cm_alphadot=Cm_alphadot)
        return missile_modes(build_dynamics(FINNER, model), SPEED, roll_rate=5000.0)["slow arm"].damping

    pure = damping("non_rolling", -360.0, 0.0)
    assert damping("non_rolling", -260.0, -100.0) == pytest.approx(pure, rel=1e-3)
    assert abs(damping("body", -260.0, -100.0) / pure - 1.0) > 0.1


@pytest.mark.parametrize("model", [derivative_model(), first_order_lag(0.5)], ids=["derivatives", "lag"])
def test_rotating_the_initial_condition_rotates_the_motion(model: Aerodynamics) -> None:
    """beta and q of one flight are alpha and r of the other: a turn of 90 degrees about the path."""
    rolling = 300.0
    first = InitialState.from_path(SPEED, beta=0.05, rate=(rolling, 4.0, 0.0))
    second = InitialState.from_path(SPEED, alpha=0.05, rate=(rolling, 0.0, 4.0))
    one, other = (
        simulate(FINNER, model, start, 0.05, step=1e-5, earth=FlatEarth(0.0), estimate_error=False)
        for start in (first, second)
    )
    assert other.position[:, 1:] == pytest.approx(one.position[:, 1:] @ np.array([[0.0, 1.0], [-1.0, 0.0]]), abs=1e-10)
    assert other.rate[:, 2] == pytest.approx(one.rate[:, 1], abs=1e-8)
    assert other.velocity[:, 2] == pytest.approx(one.velocity[:, 1], abs=1e-8)
    assert other.total_angle == pytest.approx(one.total_angle, abs=1e-10)


def test_derivatives_about_another_point_fly_the_same_to_first_order() -> None:
    at_centre = derivative_model(CN_alphadot=0.0, Cm_alphadot=0.0)
    elsewhere = at_centre.about((6.1 * LENGTH, 0.0, 0.0))
    assert elsewhere.Cm_q != pytest.approx(at_centre.Cm_q, rel=0.05)
    moved, own = (pitch_plane(model, "w", "q") for model in (elsewhere, at_centre))
    assert moved == pytest.approx(own, rel=1e-12)


class ConstantForce:
    """A force at a point, whatever the motion."""

    def __init__(self, reference: ReferenceQuantities) -> None:
        self.reference, self.validity, self.parameters, self.lag_names = reference, Validity(), (), ()

    def loads(self, flow: FlowState, lag: object) -> AerodynamicLoads:
        return AerodynamicLoads(ca.DM([1.0, 2.0, 3.0]), ca.DM([0.1, 0.2, 0.3]))

    def lag_rate(self, flow: FlowState, lag: object) -> object:
        return ca.SX(0, 1)


def test_moments_are_transferred_to_the_centre_of_gravity() -> None:
    """Centre of gravity 0.02 m behind, 0.03 right of and 0.01 above the reference: M + r x F by hand."""
    vehicle = replace(FINNER, centre_of_gravity=(0.12, 0.03, 0.01))
    model = ConstantForce(FINNER.reference.about((0.10, 0.0, 0.0)))
    dynamics = build_dynamics(vehicle, model)
    _, moment, *_ = dynamics.loads(dynamics.initial_vector(STRAIGHT), [], 0.0)
    arm = np.array([0.02, -0.03, 0.01])  # forward, left, down of the centre of gravity
    assert np.array(moment).ravel() == pytest.approx(np.array([0.1, 0.2, 0.3]) + np.cross(arm, [1.0, 2.0, 3.0]))


@pytest.mark.parametrize("model", [derivative_model(), first_order_lag(0.5)], ids=["derivatives", "lag"])
def test_everything_is_defined_at_rest(model: Aerodynamics) -> None:
    dynamics = build_dynamics(FINNER, model)
    state = dynamics.initial_vector(InitialState.from_attitude((0.0, 0.0, 0.0), pitch=0.5))
    linear = linearise(dynamics, state)
    assert np.all(np.isfinite(linear.matrix))
    assert linear.rate[3:6] == pytest.approx([-9.80665 * np.sin(0.5), 0.0, 9.80665 * np.cos(0.5)])
    dropped = simulate(FINNER, model, InitialState.from_attitude((0.0, 0.0, 0.0), rate=(1.0, 2.0, 3.0)), 0.5, step=1e-3)
    assert np.all(np.isfinite(dropped.coefficients))
    fallen = 0.5 * 9.80665 * 0.5**2
    assert 0.99 * fallen < dropped.position[-1, 2] < fallen  # the air holds it back, by under 1% of its weight


def test_rate_normalisation_c_over_v_is_half_of_c_over_2v() -> None:
    halved = {name: getattr(derivative_model(), name) / 2.0 for name in ("CN_q", "CN_alphadot", "Cm_q", "Cm_alphadot")}
    other = derivative_model(reference=replace(FINNER.reference, rate_normalisation="c/V"), Cl_p=-11.0, **halved)
    assert pitch_plane(other, "u", "v", "w", "p", "q", "r") == pytest.approx(
        pitch_plane(derivative_model(), "u", "v", "w", "p", "q", "r"), rel=1e-12
    )


def table(**values: float) -> DerivativeTable:
    condition = FlightCondition(2.0)
    return DerivativeTable(
        tuple(Derivative.at(condition, FINNER.reference, name, "mrf", v, "test") for name, v in values.items())
    )


def test_model_of_a_table_holds_its_values_and_reference() -> None:
    given = derivative_model()
    values = {name: getattr(given, name) for name in DERIVATIVES}
    assert DerivativeAerodynamics.from_table(table(**values)) == given
    del values["Cl_p"]
    assert DerivativeAerodynamics.from_table(table(**values), Cl_p=-22.0) == given


def test_a_table_that_lacks_a_derivative_is_refused() -> None:
    with pytest.raises(InputError, match="CN_q"):
        DerivativeAerodynamics.from_table(table(CA_0=0.5, CN_alpha=10.0))
    with pytest.raises(InputError, match="Cm_p"):
        DerivativeAerodynamics.from_table(table(CA_0=0.5), Cm_p=1.0)


def test_a_model_in_calibres_is_not_flown_on_a_vehicle_in_metres() -> None:
    model = derivative_model(reference=ReferenceQuantities(1.0, np.pi / 4.0))
    with pytest.raises(InputError, match="length"):
        build_dynamics(FINNER, model)


@pytest.mark.parametrize(
    ("system", "named"),
    [
        (control.ss([[0.1]], [[1.0, 0.0]], [[1.0], [1.0]], np.zeros((2, 2))), "stable"),
        (control.ss([[0.1]], [[1.0, 0.0]], [[1.0], [1.0]], np.zeros((2, 2)), 0.1), "continuous"),
        (control.ss([[-0.1]], [[1.0]], [[1.0], [1.0]], np.zeros((2, 1))), "outputs"),
    ],
)
def test_a_state_space_model_of_another_form_is_refused(system: control.StateSpace, named: str) -> None:
    with pytest.raises(InputError, match=named):
        StateSpaceAerodynamics(reference=FINNER.reference, CA_0=0.5, system=system)


def test_signals_are_taken_by_name() -> None:
    model = first_order_lag(0.5)
    s = model.system
    swapped = control.ss(
        s.A, s.B[:, ::-1], s.C[::-1], s.D[::-1, ::-1], inputs=["q", "alpha"], outputs=["Cm", "CN"], states=1
    )
    for one, other in zip(replace(model, system=swapped).matrices, model.matrices, strict=True):
        assert np.array_equal(one, other)
    renamed = control.ss(s.A, s.B, s.C, s.D, inputs=["beta", "r"], outputs=["CY", "Cn"])
    with pytest.raises(InputError, match="beta"):
        replace(model, system=renamed)
