"""The march: order, cross-check, ends, sensitivities, and the same flight over distance."""

from dataclasses import replace

import numpy as np
import pytest

from flightsim.support import FINNER, SPEED, derivative_model, first_order_lag
from indicial.errors import DivergenceError, InputError
from indicial.flightsim import End, InitialState, StandardAtmosphere, Validity, build_dynamics, fly, simulate

START = InitialState.from_path(SPEED, alpha=0.03, beta=0.01, rate=(200.0, 1.0, -2.0), position=(0.0, 0.0, -2.0))


def test_fixed_step_march_is_of_fourth_order_and_knows_its_error() -> None:
    dynamics = build_dynamics(FINNER, derivative_model())
    exact = fly(dynamics, START, 0.08, step=0.08, method="dop853").rate[-1]
    flights = [fly(dynamics, START, 0.08, step=step) for step in (2e-3, 1e-3, 5e-4)]
    errors = [np.linalg.norm(flight.rate[-1] - exact) for flight in flights]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.4)
    assert np.log2(errors[1] / errors[2]) == pytest.approx(4.0, abs=0.2)
    truth = fly(dynamics, START, 0.08, step=1e-3, method="dop853")
    position = np.max(np.linalg.norm(flights[1].position - truth.position, axis=1))
    assert flights[1].provenance["position_error_m"] == pytest.approx(position, rel=0.2)


def test_adaptive_flight_equals_the_march_with_lag_states() -> None:
    model = first_order_lag(0.3)
    one, other = (simulate(FINNER, model, START, 0.03, step=1e-5, method=m) for m in ("rk4", "dop853"))
    assert other.time == pytest.approx(one.time, abs=1e-15)
    assert other.position == pytest.approx(one.position, abs=1e-9)
    assert other.rate == pytest.approx(one.rate, abs=1e-6)
    assert other.lag == pytest.approx(one.lag, abs=1e-8)


def test_stiff_flight_tends_to_the_march_with_tiny_steps_as_its_error_says() -> None:
    """A lag three hundred times faster than the motion, over several blocks of instants, loads settling at first."""
    dynamics = build_dynamics(FINNER, first_order_lag(3.0))
    duration, step = 0.04, 2e-7
    exact = fly(dynamics, START, duration, step=step, every=500, method="rk4", estimate_error=False)
    flight = fly(dynamics, START, duration, step=step, every=500, method="cvodes")
    assert len(flight) == 401
    assert flight.time == pytest.approx(exact.time, abs=1e-15)
    assert flight.velocity == pytest.approx(exact.velocity, abs=2e-7)
    assert flight.rate == pytest.approx(exact.rate, abs=2e-8)
    assert flight.quaternion == pytest.approx(exact.quaternion, abs=1e-10)
    assert flight.lag == pytest.approx(exact.lag, abs=1e-10)
    position = np.max(np.linalg.norm(flight.position - exact.position, axis=1))
    assert 0.3 * position < flight.provenance["position_error_m"] < 3.0 * position < 1e-8
    assert "tolerance" in flight.summary()


def test_error_of_a_stiff_flight_falls_with_the_tolerance() -> None:
    dynamics = build_dynamics(FINNER, first_order_lag(3.0))
    start, spacing = dynamics.initial_vector(START), 1e-4
    truth, *found = (
        np.array(dynamics.stiff_march(100, tolerance)(start, [], spacing)) for tolerance in (1e-13, 1e-6, 1e-8, 1e-10)
    )
    errors = [np.max(np.abs(states - truth)[10:13]) for states in found]
    assert errors[0] > 5.0 * errors[1] > 25.0 * errors[2]


def test_only_lags_much_faster_than_the_motion_are_flown_as_stiff() -> None:
    stiff, quasi = (simulate(FINNER, model, START, 0.05) for model in (first_order_lag(3.0), derivative_model()))
    assert stiff.provenance["method"] == "cvodes"
    assert quasi.provenance["method"] == "rk4"
    # Runge-Kutta would need more steps than it may take.
    fastest = simulate(FINNER, first_order_lag(1e5), START, 0.005, estimate_error=False)
    assert fastest.provenance["method"] == "cvodes"
    asked = simulate(FINNER, first_order_lag(3.0), START, 0.001, step=1e-6)
    assert asked.provenance["method"] == "rk4"


def test_a_stiff_flight_that_blows_up_is_an_error() -> None:
    with pytest.raises(DivergenceError, match="CVODES"):
        simulate(FINNER, derivative_model(Cl_p=3e4), START, 2.0, step=1e-3, method="cvodes")


@pytest.mark.parametrize("method", ["rk4", "cvodes", "dop853"])
def test_flight_ends_exactly_at_a_station(method: str) -> None:
    flight = simulate(FINNER, derivative_model(), START, 1.0, step=1e-3, end=End(x=50.0), method=method)
    assert flight.position[-1, 0] == pytest.approx(50.0, abs=1e-9)
    assert np.all(flight.position[:-1, 0] < 50.0)


def test_flight_ends_on_the_ground() -> None:
    flight = simulate(FINNER, derivative_model(), START, 5.0, step=1e-3, end=End(x=1e4, altitude=0.0))
    assert flight.position[-1, 2] == pytest.approx(0.0, abs=1e-9)


def test_the_compiled_march_is_that_of_casadi_to_round_off() -> None:
    dynamics = build_dynamics(FINNER, derivative_model())
    whole = fly(dynamics, START, 0.0505, step=1e-5, estimate_error=False)
    assert len(whole) == 5051
    states = np.array(dynamics.march(5050)(dynamics.initial_vector(START), [], np.full((1, 5050), 1e-5)))
    assert whole.position[1:] == pytest.approx(states[:3].T, rel=1e-12, abs=1e-13)
    assert whole.rate[1:] == pytest.approx(states[10:13].T, rel=1e-9, abs=1e-10)
    assert whole.time[-1] == 0.0505


def test_keeping_every_tenth_step_changes_no_number() -> None:
    every, tenth = (
        simulate(FINNER, derivative_model(), START, 1.0, step=1e-4, every=n, end=End(x=20.00123)) for n in (1, 10)
    )
    assert np.array_equal(tenth.position[:-1], every.position[:-1:10])
    assert tenth.position[-1] == pytest.approx(every.position[-1], abs=1e-14)
    assert tenth.provenance["position_error_m"] == pytest.approx(every.provenance["position_error_m"], rel=0.1)


def test_fast_lags_take_short_steps_but_keep_few_instants() -> None:
    models = (first_order_lag(0.5), derivative_model())
    lagged, quasi = (simulate(FINNER, model, START, 0.05, method="rk4") for model in models)
    assert lagged.provenance["step_s"] < 0.1 * quasi.provenance["step_s"]
    assert len(lagged) < 2 * len(quasi)


def test_last_step_is_shortened_to_the_duration() -> None:
    flight = simulate(FINNER, derivative_model(), START, 0.0105, step=2e-4)
    truth = simulate(FINNER, derivative_model(), START, 0.0105, step=2e-4, method="dop853")
    assert flight.time == pytest.approx([*np.arange(0.0, 0.0105, 2e-4), 0.0105])
    assert flight.position[-1] == pytest.approx(truth.position[-1], abs=1e-7)


def test_march_over_distance_equals_the_march_over_time() -> None:
    dynamics = build_dynamics(FINNER, derivative_model())
    stations = np.linspace(0.0, 40.0, 801)
    start = np.append(dynamics.initial_vector(START), 0.0)
    states = np.array(dynamics.march_in_distance(800)(start, [], np.diff(stations)[None, :]))
    flight = fly(dynamics, START, 1.0, step=5e-5, end=End(x=40.0)).at_stations(stations[1:])
    assert states[0] == pytest.approx(stations[1:])
    assert states[-1] == pytest.approx(flight.time, abs=1e-11)
    assert states[1:3] == pytest.approx(flight.position[:, 1:].T, abs=1e-8)
    assert states[3:6] == pytest.approx(flight.velocity.T, abs=1e-5)


def test_symbolic_parameters_fly_as_their_values_do() -> None:
    model = derivative_model()
    names = ("Cm_q", "CN_alpha", "CA_0")
    dynamics = build_dynamics(FINNER, model.with_symbols(names))
    assert set(dynamics.parameter_names) == set(names)
    values = {name: getattr(model, name) for name in names}
    one = fly(dynamics, START, 0.02, step=1e-4, parameters=values)
    assert one.rate == pytest.approx(simulate(FINNER, model, START, 0.02, step=1e-4).rate, rel=1e-11)
    with pytest.raises(InputError, match="Cm_q"):
        fly(dynamics, START, 0.02, parameters={"CA_0": 0.5})


def test_sensitivities_of_the_march_equal_finite_differences() -> None:
    model = derivative_model()
    dynamics = build_dynamics(FINNER, model.with_symbols(["Cm_alpha", "Cm_q"]))
    march = dynamics.march(200)
    state, values = dynamics.initial_vector(START, [-28.0, -300.0]), np.array([-28.0, -300.0])
    steps = np.full((1, 200), 1e-4)
    exact = np.array(march.jacobian()(state, values, steps, 0)[1]).reshape(200, 13, 2)
    for i, change in enumerate((1e-3, 1e-2)):
        up, down = (np.array(march(state, values + sign * change * np.eye(2)[i], steps)).T for sign in (1, -1))
        assert exact[:, :, i] == pytest.approx((up - down) / (2.0 * change), rel=1e-4, abs=1e-8)


def test_leaving_the_models_range_is_flagged() -> None:
    model = derivative_model(validity=Validity(alpha_max=0.02))
    flight = simulate(FINNER, model, START, 0.3, step=1e-4)
    assert np.array_equal(flight.outside_range, flight.total_angle > 0.02)
    assert "OUTSIDE" in flight.summary()
    high = replace(START, position=(0.0, 0.0, -86.5e3))
    assert simulate(FINNER, derivative_model(), high, 0.01, atmosphere=StandardAtmosphere()).outside_range.all()


def test_an_unstable_step_is_an_error_that_says_when() -> None:
    with pytest.raises(DivergenceError, match="step below"):
        simulate(FINNER, first_order_lag(0.5), START, 0.3, step=3e-4)


def test_lag_states_start_settled_or_as_given() -> None:
    model = first_order_lag(0.5)
    dynamics = build_dynamics(FINNER, model)
    steady = InitialState.from_path(SPEED, alpha=0.02)
    settled = dynamics.initial_vector(steady)[13:]
    assert settled == pytest.approx([np.sin(0.02) / 0.5, 0.0], rel=1e-9)
    given = dynamics.initial_vector(replace(steady, lag=np.array([0.1, 0.2])))[13:]
    assert given == pytest.approx([0.1, 0.2])
    with pytest.raises(InputError, match="lag"):
        dynamics.initial_vector(replace(steady, lag=np.zeros(3)))


@pytest.mark.parametrize(
    "wrong", [{"duration": -1.0}, {"step": 0.0}, {"step": 1.0}, {"end": End(x=-1.0)}, {"method": "euler"}]
)
def test_senseless_flights_are_refused(wrong: dict) -> None:
    with pytest.raises(InputError):
        simulate(FINNER, derivative_model(), START, **({"duration": 0.01} | wrong))
