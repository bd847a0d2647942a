"""The exact step against textbook closed forms, an independent integration, and itself."""

import math
from decimal import Decimal, localcontext

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from guidance import MOON_GRAVITY, PAPER_LANDER, Lander, State, propagate
from guidance.dynamics import integrate, position_factor, velocity_factor

START = State(np.array([200.0, -50.0, 950.0]), np.array([-8.0, 3.0, -30.0]), 1200.0)
THRUST = np.array([500.0, -800.0, 4500.0])
UNITS = st.floats(-1.0, 1.0)


def vectors(scale: float):
    return st.tuples(UNITS, UNITS, UNITS).map(lambda numbers: scale * np.array(numbers))


STATES = st.builds(State, vectors(1000.0), vectors(100.0), st.floats(500.0, 5000.0))


def burnt_mass(thrust: np.ndarray, duration: float, lander: Lander = PAPER_LANDER) -> float:
    return float(np.linalg.norm(thrust)) / (9.80665 * lander.specific_impulse) * duration


def integrate_motion(state: State, thrust: np.ndarray, duration: float, gravity: np.ndarray) -> np.ndarray:
    """The equations of motion as the paper prints them, integrated by scipy."""

    def rate(_, y):
        return [*y[3:6], *(thrust / y[6] + gravity), -np.linalg.norm(thrust) / (9.80665 * 325.0)]

    path = solve_ivp(rate, (0.0, duration), state.as_array(), method="DOP853", rtol=1e-13, atol=1e-12)
    assert path.success
    return path.y[:, -1]


@settings(max_examples=40)
@given(state=STATES, thrust=vectors(7000.0), duration=st.floats(0.01, 60.0), gravity=vectors(4.0))
def test_held_thrust_agrees_with_dop853(state, thrust, duration, gravity):
    flown = propagate(state, thrust, duration, PAPER_LANDER, gravity).as_array()
    oracle = integrate_motion(state, thrust, duration, gravity)
    np.testing.assert_allclose(flown, oracle, rtol=1e-11, atol=1e-8)


def test_burn_of_nine_tenths_of_the_mass_agrees_with_dop853():
    duration = 0.9 * START.mass / burnt_mass(THRUST, 1.0)
    flown = propagate(START, THRUST, duration, PAPER_LANDER).as_array()
    oracle = integrate_motion(START, THRUST, duration, np.array(MOON_GRAVITY))
    np.testing.assert_allclose(flown, oracle, rtol=1e-10)


@given(mass_ratio=st.floats(1.0001, 50.0), thrust=st.floats(10.0, 1e5), mass=st.floats(10.0, 1e5))
def test_velocity_gain_is_tsiolkovskys(mass_ratio, thrust, mass):
    exhaust_velocity = PAPER_LANDER.exhaust_velocity
    duration = mass * (1.0 - 1.0 / mass_ratio) * exhaust_velocity / thrust
    end = propagate(State(np.zeros(3), np.zeros(3), mass), [0, 0, thrust], duration, PAPER_LANDER, [0, 0, 0])
    assert end.mass == pytest.approx(mass / mass_ratio, rel=1e-13)
    assert end.velocity[2] == pytest.approx(exhaust_velocity * math.log(mass_ratio), rel=1e-11)
    # distance of a burn from rest: u t (1 - ln(R)/(R - 1))
    distance = exhaust_velocity * duration * (1.0 - math.log(mass_ratio) / (mass_ratio - 1.0))
    assert end.position[2] == pytest.approx(distance, rel=1e-9)
    assert end.position[:2].tolist() == [0.0, 0.0]


@given(state=STATES, thrust=vectors(7000.0), first=st.floats(0.0, 30.0), second=st.floats(0.0, 30.0))
def test_two_legs_equal_one(state, thrust, first, second):
    middle = propagate(state, thrust, first, PAPER_LANDER)
    in_two = propagate(middle, thrust, second, PAPER_LANDER).as_array()
    in_one = propagate(state, thrust, first + second, PAPER_LANDER).as_array()
    np.testing.assert_allclose(in_two, in_one, rtol=1e-12, atol=1e-9)


@given(state=STATES, thrust=vectors(7000.0), duration=st.floats(0.0, 60.0), gravity=vectors(4.0))
def test_momentum_balance(state, thrust, duration, gravity):
    """m v gains the impulse of thrust and weight, less the momentum that the propellant carries away."""
    end = propagate(state, thrust, duration, PAPER_LANDER, gravity)
    gained = end.mass * end.velocity - state.mass * state.velocity
    weight_impulse = gravity * duration * 0.5 * (state.mass + end.mass)
    carried_away = burnt_mass(thrust, 1.0) * (end.position - state.position)
    np.testing.assert_allclose(
        gained, thrust * duration + weight_impulse - carried_away, rtol=1e-9, atol=1e-6
    )


@given(state=STATES, duration=st.floats(0.0, 100.0), gravity=vectors(4.0))
def test_engine_off_is_a_parabola(state, duration, gravity):
    end = propagate(state, [0.0, 0.0, 0.0], duration, PAPER_LANDER, gravity)
    fallen = state.position + state.velocity * duration + 0.5 * gravity * duration**2
    np.testing.assert_allclose(end.position, fallen, rtol=1e-13, atol=1e-10)
    np.testing.assert_allclose(end.velocity, state.velocity + gravity * duration, rtol=1e-13, atol=1e-11)
    assert end.mass == state.mass


@given(state=STATES, thrust=vectors(7000.0))
def test_no_time_changes_nothing(state, thrust):
    assert propagate(state, thrust, 0.0, PAPER_LANDER).as_array().tolist() == state.as_array().tolist()


@given(state=STATES, thrust=vectors(7000.0), duration=st.floats(0.0, 60.0), wind=vectors(50.0))
def test_motion_is_the_same_in_a_moving_frame(state, thrust, duration, wind):
    moving = State(state.position, state.velocity + wind, state.mass)
    at_rest = propagate(state, thrust, duration, PAPER_LANDER)
    in_motion = propagate(moving, thrust, duration, PAPER_LANDER)
    np.testing.assert_allclose(in_motion.position, at_rest.position + wind * duration, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(in_motion.velocity, at_rest.velocity + wind, rtol=1e-12, atol=1e-11)


def exact_factors(burnt: float) -> tuple[float, float]:
    with localcontext() as context:
        context.prec = 80
        x = Decimal(burnt)
        log = (1 - x).ln()
        return float(-log / x), float(((1 - x) * log + x) / (x * x))


@given(burnt=st.floats(1e-15, 0.999))
def test_factors_agree_with_eighty_digits(burnt):
    velocity, position = exact_factors(burnt)
    assert velocity_factor(burnt) == pytest.approx(velocity, rel=1e-14)
    assert position_factor(burnt) == pytest.approx(position, rel=3e-14)


def test_series_meets_the_logarithm():
    switch = 0.02
    below, above = position_factor(math.nextafter(switch, 0.0)), position_factor(switch)
    assert below == pytest.approx(above, rel=3e-14)
    grid = np.linspace(0.0, 0.04, 4001)
    factors = np.array([position_factor(float(x)) for x in grid])
    assert (np.diff(factors) > 0.0).all()
    assert factors[0] == 0.5
    assert velocity_factor(0.0) == 1.0


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("thrust", [0.0, 0.0]),
        ("thrust", [0.0, 0.0, math.nan]),
        ("thrust", [math.inf, 0.0, 0.0]),
        ("thrust", "up"),
        ("duration", -1e-9),
        ("duration", math.nan),
        ("duration", math.inf),
        ("duration", None),
        ("gravity", -1.62),
        ("gravity", [0.0, math.nan, 0.0]),
        ("gravity", [[0.0, 0.0, -1.62]]),
    ],
)
def test_wrong_argument_is_named(argument, value):
    arguments = {"thrust": THRUST, "duration": 1.0, "gravity": MOON_GRAVITY, argument: value}
    with pytest.raises(ValueError, match=rf"^{argument} must"):
        propagate(START, arguments["thrust"], arguments["duration"], PAPER_LANDER, arguments["gravity"])


def test_burning_all_mass_is_refused():
    all_mass = START.mass / burnt_mass(THRUST, 1.0)
    assert propagate(START, THRUST, 0.999 * all_mass, PAPER_LANDER).mass == pytest.approx(1.2, rel=1e-6)
    with pytest.raises(ValueError, match=r"^duration .* burns more than the whole mass 1200 kg"):
        propagate(START, THRUST, 1.001 * all_mass, PAPER_LANDER)


def test_integrate_agrees_with_the_exact_step_over_switched_thrusts():
    times = np.array([0.0, 4.0, 5.5, 20.0])
    thrusts = [THRUST, np.zeros(3), np.array([0.0, 300.0, 6000.0])]

    def thrust_at(time: float) -> np.ndarray:
        return thrusts[min(int(np.searchsorted(times, time, side="right")) - 1, 2)]

    path = integrate(START, thrust_at, times, PAPER_LANDER)
    state = START
    np.testing.assert_array_equal(path[0], state.as_array())
    for k, thrust in enumerate(thrusts):
        state = propagate(state, thrust, float(times[k + 1] - times[k]), PAPER_LANDER)
        np.testing.assert_allclose(path[k + 1], state.as_array(), rtol=1e-9, atol=1e-7)


def test_integrate_constant_thrust_acceleration():
    """|T|/m held at a: the mass falls exponentially and the path is a parabola."""
    acceleration, exhaust_velocity = np.array([1.0, 0.0, 2.5]), PAPER_LANDER.exhaust_velocity
    rate = float(np.linalg.norm(acceleration)) / exhaust_velocity
    times = np.linspace(0.0, 40.0, 5)
    path = integrate(
        START, lambda time: acceleration * START.mass * math.exp(-rate * time), times, PAPER_LANDER
    )
    total = acceleration + np.array(MOON_GRAVITY)
    position = START.position + np.outer(times, START.velocity) + 0.5 * np.outer(times**2, total)
    np.testing.assert_allclose(path[:, :3], position, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(path[:, 3:6], START.velocity + np.outer(times, total), rtol=1e-9, atol=1e-8)
    np.testing.assert_allclose(path[:, 6], START.mass * np.exp(-rate * times), rtol=1e-10)


@pytest.mark.parametrize(
    "times", [[0.0], [0.0, 0.0], [1.0, 0.0], [[0.0, 1.0]], [0.0, math.nan], [0.0, math.inf]]
)
def test_integrate_names_wrong_times(times):
    with pytest.raises(ValueError, match=r"^times must be"):
        integrate(START, lambda _: THRUST, np.array(times), PAPER_LANDER)


def test_integrate_does_not_pass_over_a_failure():
    """Past the instant at which all mass is burnt no motion exists, and none may be returned."""
    end = 2.0 * START.mass / burnt_mass(THRUST, 1.0)
    with np.errstate(all="ignore"), pytest.raises(RuntimeError, match=r"integration stopped"):
        integrate(START, lambda _: THRUST, np.array([0.0, end]), PAPER_LANDER)
