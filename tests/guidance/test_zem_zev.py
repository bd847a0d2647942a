"""ZEM/ZEV guidance as flown: closed-form paths, landing at rest, arguments, thrust saturation."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from guidance import (
    MOON_GRAVITY,
    PAPER_LANDER,
    Lander,
    State,
    propagate,
    saturate_thrust,
    time_to_go,
    zem_zev_acceleration,
)

GRAVITY = np.array(MOON_GRAVITY)
START = State(np.array([210.0, 60.0, 950.0]), np.array([-7.0, -2.0, -28.0]), 1200.0)
TARGET = np.array([0.0, 0.0, 50.0])
COMPONENTS = st.floats(-1.0, 1.0)


def vectors(scale: float):
    return st.tuples(COMPONENTS, COMPONENTS, COMPONENTS).map(lambda numbers: scale * np.array(numbers))


def fly_law(state: State, duration: float, gains: tuple[float, float], gravity: np.ndarray, stop: float):
    """The law flown without interruption until `stop` before the end: position and velocity."""

    def rate(time, y):
        now = State(y[:3], y[3:6], 1.0)
        acceleration = zem_zev_acceleration(now, TARGET, duration - time, gains, gravity)
        return np.concatenate([y[3:6], acceleration + gravity])

    start = np.concatenate([state.position, state.velocity])
    path = solve_ivp(rate, (0.0, duration - stop), start, method="DOP853", rtol=1e-12, atol=1e-10)
    assert path.success
    return path.y[:3, -1], path.y[3:6, -1]


def cubic(state: State, duration: float, remaining: float) -> tuple[np.ndarray, np.ndarray]:
    """The cubic in time that joins the state to rest at the target, `remaining` before its end."""
    miss = state.position - TARGET
    third = -(2.0 * miss / duration + state.velocity) / duration**2
    second = miss / duration**2 - third * duration
    position = TARGET + second * remaining**2 + third * remaining**3
    return position, -2.0 * second * remaining - 3.0 * third * remaining**2


def test_cubic_starts_at_the_state_and_ends_at_rest_on_the_target():
    position, velocity = cubic(START, 40.0, 40.0)
    np.testing.assert_allclose(position, START.position, rtol=1e-12)
    np.testing.assert_allclose(velocity, START.velocity, rtol=1e-12)
    assert cubic(START, 40.0, 0.0)[0].tolist() == TARGET.tolist()
    assert np.abs(cubic(START, 40.0, 0.0)[1]).max() == 0.0


@settings(max_examples=25)
@given(
    position=vectors(1000.0),
    velocity=vectors(60.0),
    gravity=vectors(4.0),
    duration=st.floats(5.0, 100.0),
    left=st.floats(0.01, 0.9),
)
def test_undisturbed_flight_is_the_cubic(position, velocity, gravity, duration, left):
    state = State(TARGET + position, velocity, 1000.0)
    flown = fly_law(state, duration, (6.0, 2.0), gravity, stop=left * duration)
    expected = cubic(state, duration, left * duration)
    np.testing.assert_allclose(flown[0], expected[0], rtol=1e-8, atol=1e-6)
    np.testing.assert_allclose(flown[1], expected[1], rtol=1e-8, atol=1e-6)


def test_undisturbed_flight_lands_at_rest():
    duration = time_to_go(START, TARGET)
    position, velocity = fly_law(START, duration, (6.0, 2.0), GRAVITY, stop=1e-3)
    assert np.linalg.norm(position - TARGET) < 1e-5
    assert (
        np.linalg.norm(velocity) < 0.01
    )  # the cubic's own speed one millisecond before the end is 0.005 m/s
    np.testing.assert_allclose(velocity, cubic(START, duration, 1e-3)[1], atol=1e-6)


@settings(max_examples=25)
@given(position_gain=st.floats(5.0, 7.0), velocity_gain=st.floats(1.0, 3.0), left=st.floats(0.05, 0.9))
def test_other_gains_fly_their_power_law(position_gain, velocity_gain, left):
    """Without gravity the miss sums powers s^n of the time to go: n^2 - (1 + K_R - K_V) n + K_R = 0."""
    middle = 1.0 + position_gain - velocity_gain
    split = np.sqrt(complex(middle**2 - 4.0 * position_gain))
    assume(abs(split) > 0.1)
    powers = np.array([(middle + split) / 2.0, (middle - split) / 2.0])
    duration = 30.0
    system = np.array([[1.0, 1.0], -powers / duration])
    amounts = np.linalg.solve(system, np.array([START.position - TARGET, START.velocity], dtype=complex))
    flown, _ = fly_law(START, duration, (position_gain, velocity_gain), np.zeros(3), stop=left * duration)
    expected = TARGET + ((left**powers) @ amounts).real
    np.testing.assert_allclose(flown, expected, rtol=1e-8, atol=1e-6)


def land_with_held_thrust(steps: int) -> tuple[float, float]:
    """Distance and speed at the end, thrust of the variable-mass vehicle held over `steps` equal steps."""
    duration = time_to_go(START, TARGET)
    period = duration / steps
    state = START
    for k in range(steps):
        thrust = state.mass * zem_zev_acceleration(state, TARGET, duration - k * period)
        state = propagate(state, saturate_thrust(thrust, PAPER_LANDER), period, PAPER_LANDER)
    assert PAPER_LANDER.dry_mass < state.mass < START.mass
    return float(np.linalg.norm(state.position - TARGET)), float(np.linalg.norm(state.velocity))


def test_held_thrust_lands_better_with_smaller_steps():
    coarse, medium, fine = (land_with_held_thrust(steps) for steps in (100, 400, 1600))
    for quantity in (0, 1):
        assert fine[quantity] < medium[quantity] / 3.0 < coarse[quantity] / 9.0
    assert fine[0] < 0.01
    assert fine[1] < 0.2


@pytest.mark.parametrize("amount", [-1.0, -0.01, 0.01, 1.0])
def test_six_and_two_spend_the_least_energy(amount):
    """Any other path with the same ends and end velocities has a greater integral of |a|^2."""
    duration = 40.0
    time = np.linspace(0.0, duration, 20001)
    miss = START.position - TARGET
    third = -(2.0 * miss / duration + START.velocity) / duration**2
    second = miss / duration**2 - third * duration
    acceleration = 2.0 * second + 6.0 * np.outer(duration - time, third) - GRAVITY
    # second derivative of a bump t^2 (T - t)^2 that leaves both ends untouched
    bump = 2.0 * duration**2 - 12.0 * duration * time + 12.0 * time**2
    other = acceleration + amount / duration**2 * np.outer(bump, [1.0, -0.5, 2.0])
    assert np.trapezoid((other**2).sum(axis=1), time) > np.trapezoid((acceleration**2).sum(axis=1), time)


def test_hover_over_the_target_takes_the_weight():
    """At rest on the target ZEM and ZEV are gravity's alone: 6 (-g/2) + 2 g = -g."""
    state = State(TARGET, np.zeros(3), 1200.0)
    np.testing.assert_allclose(zem_zev_acceleration(state, TARGET, 7.0), -GRAVITY, atol=1e-14)


@given(
    position=vectors(1000.0),
    velocity=vectors(60.0),
    arrival=vectors(60.0),
    gains=st.tuples(st.floats(1.0, 9.0), st.floats(1.0, 9.0)),
    duration=st.floats(0.1, 100.0),
)
def test_a_velocity_at_the_target_is_rest_in_the_frame_that_moves_with_it(
    position, velocity, arrival, gains, duration
):
    """There the target is where that frame will have carried it, and ZEM and ZEV are the same."""
    here = State(TARGET + position, velocity, 1000.0)
    moving = State(here.position + arrival * duration, velocity - arrival, 1000.0)
    found = zem_zev_acceleration(here, TARGET, duration, gains, target_velocity=arrival)
    expected = zem_zev_acceleration(moving, TARGET, duration, gains)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-9 * (1.0 + 1e3 / duration**2))


@pytest.mark.parametrize("arrival", [[0.0, 0.0, -12.0], [8.0, -5.0, 3.0]])
def test_undisturbed_flight_arrives_with_the_velocity_after_the_time_to_go(arrival):
    duration = time_to_go(START, TARGET, target_velocity=arrival)

    def rate(time, y):
        now, left = State(y[:3], y[3:6], 1.0), duration - time
        return np.concatenate(
            [y[3:6], zem_zev_acceleration(now, TARGET, left, target_velocity=arrival) + GRAVITY]
        )

    start, stop = np.concatenate([START.position, START.velocity]), 1e-3
    path = solve_ivp(rate, (0.0, duration - stop), start, method="DOP853", rtol=1e-12, atol=1e-10)
    np.testing.assert_allclose(path.y[:3, -1] + stop * np.array(arrival), TARGET, atol=1e-4)
    np.testing.assert_allclose(path.y[3:6, -1], arrival, atol=0.02)
    halfway = solve_ivp(rate, (0.0, 0.5 * duration), start, method="DOP853", rtol=1e-12, atol=1e-10).y[:, -1]
    left = time_to_go(State(halfway[:3], halfway[3:], 1.0), TARGET, target_velocity=arrival)
    assert left == pytest.approx(0.5 * duration, rel=1e-6)


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("target", [0.0, 0.0]),
        ("target", [0.0, math.nan, 0.0]),
        ("target", None),
        ("time_to_go", 0.0),
        ("time_to_go", -1.0),
        ("time_to_go", math.nan),
        ("time_to_go", math.inf),
        ("gravity", [0.0, 0.0, math.inf]),
        ("gravity", -1.62),
        ("gains", (math.nan, 2.0)),
        ("gains", (6.0, math.inf)),
        ("gains", (6.0,)),
        ("gains", (6.0, 2.0, 1.0)),
        ("gains", None),
        ("target_velocity", [0.0, 0.0]),
        ("target_velocity", [0.0, 0.0, math.nan]),
    ],
)
def test_wrong_argument_of_the_law_is_named(argument, value):
    arguments = {"target": TARGET, "time_to_go": 10.0, "gains": (6.0, 2.0), "gravity": MOON_GRAVITY}
    with pytest.raises(ValueError, match=rf"^{argument} must"):
        zem_zev_acceleration(START, **{**arguments, argument: value})


@given(
    thrust=vectors(30000.0),
    bounds=st.tuples(st.floats(0.0, 20000.0), st.floats(1.0, 20000.0)).map(sorted),
)
def test_saturated_thrust_is_in_bounds_and_keeps_its_direction(thrust, bounds):
    lander = Lander(min_thrust=bounds[0], max_thrust=max(bounds[1], 1.0))
    given_thrust = saturate_thrust(thrust, lander)
    commanded, magnitude = math.hypot(*thrust), math.hypot(*given_thrust)  # hypot does not underflow
    assert lander.min_thrust * (1 - 1e-14) <= magnitude <= lander.max_thrust * (1 + 1e-14)
    if commanded > 1e-100:
        np.testing.assert_allclose(
            given_thrust / magnitude if magnitude else 0.0, thrust / commanded, atol=1e-14
        )
    if lander.min_thrust <= commanded <= lander.max_thrust:
        assert given_thrust.tolist() == thrust.tolist()
    twice = saturate_thrust(given_thrust, lander)
    np.testing.assert_allclose(twice, given_thrust, rtol=1e-14)


def test_no_command_to_an_engine_that_cannot_stop_points_up():
    assert saturate_thrust([0.0, 0.0, 0.0], Lander(min_thrust=2000.0)).tolist() == [0.0, 0.0, 2000.0]
    assert saturate_thrust([0.0, 0.0, 0.0], PAPER_LANDER).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("direction", [[1.0, 0.0, 0.0], [0.6, 0.0, -0.8], [-1.0, 2.0, 2.0]])
@pytest.mark.parametrize("magnitude", [1e-300, 1e-200, 1e-6, 1e6, 1e160, 1e300])
def test_commands_of_any_size_saturate(direction, magnitude):
    unit = np.array(direction) / np.linalg.norm(direction)
    lander = Lander(min_thrust=1000.0, max_thrust=5000.0)
    expected = (1000.0 if magnitude < 1000.0 else 5000.0) * unit
    np.testing.assert_allclose(saturate_thrust(magnitude * unit, lander), expected, rtol=1e-12)


def test_saturation_does_not_change_its_argument():
    thrust = np.array([0.0, 0.0, 1e6])
    saturate_thrust(thrust, PAPER_LANDER)
    assert thrust.tolist() == [0.0, 0.0, 1e6]


@pytest.mark.parametrize("thrust", [[0.0, 0.0], [0.0, 0.0, math.nan], [math.inf, 0.0, 0.0], None, 5.0])
def test_wrong_thrust_is_named(thrust):
    with pytest.raises(ValueError, match=r"^thrust must"):
        saturate_thrust(thrust, PAPER_LANDER)
