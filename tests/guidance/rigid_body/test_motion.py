"""True motion of a rigid body against closed forms and DOP853."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from guidance import MOON_GRAVITY, PAPER_LANDER, Lander, propagate
from guidance.rigid_body import DEFAULT_BODY, RigidBody, RigidState, attitude_along, fly_commands
from guidance.rigid_body.motion import fly_into, limit_command_into
from tests.guidance.rigid_body.rigid_cases import ATTITUDES, DIRECTIONS, STATES, vectors
from tests.oracles.rigid_motion import integrate_rigid_motion

GRAVITY = np.array(MOON_GRAVITY)
GIMBALLED = replace(DEFAULT_BODY, gimbal_limit=0.2, engine_arm=1.2)
TRIAXIAL = RigidBody(inertia=(600.0, 900.0, 1100.0), torque_limit=(1e3, 1e3, 1e3))
NOTHING = [0.0, 0.0, 0.0]


@settings(max_examples=25)
@given(
    state=STATES,
    first=vectors(300.0),
    last=vectors(300.0),
    throttle=st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)),
    torques=st.tuples(vectors(66.0), vectors(66.0)),
    body=st.sampled_from((DEFAULT_BODY, GIMBALLED, replace(GIMBALLED, inertia_exponent=0.0))),
)
def test_linear_commands_agree_with_dop853(state, first, last, throttle, torques, body):
    first[2], last[2] = 12000.0 * throttle[0], 12000.0 * throttle[1]
    flown = state.as_array()
    fly_into(flown, np.array([first, last]), np.array(torques), 5.0, body.numbers())
    oracle = integrate_rigid_motion(state.as_array(), (first, last), torques, 5.0, body, GRAVITY)
    np.testing.assert_allclose(flown[:6], oracle[:6], rtol=0.0, atol=1e-4)  # [m], [m/s]
    np.testing.assert_allclose(flown[6:13], oracle[6:13], rtol=0.0, atol=1e-6)
    np.testing.assert_allclose(flown[13:], oracle[13:], rtol=0.0, atol=1e-5)


@given(state=STATES, throttle=st.floats(0.05, 1.0), duration=st.floats(0.1, 10.0), direction=DIRECTIONS)
def test_a_body_that_points_along_its_thrust_flies_as_the_point_mass(state, throttle, duration, direction):
    thrust = 12000.0 * throttle
    aligned = replace(state, attitude=attitude_along(direction), rates=np.zeros(3))
    flown = fly_commands(aligned, thrust, NOTHING, duration, replace(DEFAULT_BODY, engine_lag=0.0))
    vector = thrust * direction / np.linalg.norm(direction)
    exact = propagate(state.point, vector, duration, PAPER_LANDER).as_array()
    np.testing.assert_allclose(flown.point.as_array(), exact, rtol=0.0, atol=1e-7)


@given(attitude=ATTITUDES, rates=vectors(0.5), duration=st.floats(0.5, 20.0))
def test_an_axisymmetric_top_precesses_about_its_angular_momentum(attitude, rates, duration):
    """w = H/J1 + w_z (1 - J3/J1) z: a turn about H, which stands still, after one about the body's axis."""
    state = RigidState(np.zeros(3), np.zeros(3), 1200.0, attitude, rates)
    flown = fly_commands(state, 0.0, NOTHING, duration, DEFAULT_BODY)
    across, along = DEFAULT_BODY.inertia[0], DEFAULT_BODY.inertia[2]
    start = Rotation.from_quat(attitude, scalar_first=True)
    momentum = start.apply(np.array(DEFAULT_BODY.inertia) * rates)
    about_axis = Rotation.from_rotvec([0.0, 0.0, rates[2] * (1.0 - along / across) * duration])
    expected = Rotation.from_rotvec(momentum / across * duration) * start * about_axis
    turned = Rotation.from_quat(flown.attitude, scalar_first=True)
    assert (expected.inv() * turned).magnitude() < 1e-5  # [rad]
    assert flown.rates[2] == pytest.approx(rates[2], abs=1e-12)


@given(attitude=ATTITUDES, rates=vectors(0.5))
def test_without_torque_angular_momentum_energy_and_length_are_kept(attitude, rates):
    state = RigidState(np.zeros(3), np.zeros(3), 1200.0, attitude, rates)
    numbers, still = state.as_array(), np.zeros((2, 3))
    fly_into(numbers, still, still, 30.0, TRIAXIAL.numbers())
    inertia = TRIAXIAL.inertia_at(1200.0)

    def momentum(turn: np.ndarray, spin: np.ndarray) -> np.ndarray:
        return Rotation.from_quat(turn, scalar_first=True).apply(inertia * spin)

    before, after = momentum(attitude, rates), momentum(numbers[6:10], numbers[10:13])
    np.testing.assert_allclose(after, before, rtol=0.0, atol=1e-2 * 1e-3 * inertia.max())
    assert inertia @ numbers[10:13] ** 2 == pytest.approx(inertia @ rates**2, rel=1e-6, abs=1e-9)
    assert np.linalg.norm(numbers[6:10]) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("axis", range(3))
@given(angle=st.floats(0.05, 2.0))
def test_bang_bang_turns_in_twice_the_root_of_angle_over_acceleration(axis, angle):
    acceleration = DEFAULT_BODY.torque_limit[axis] / DEFAULT_BODY.inertia[axis]
    half = math.sqrt(angle / acceleration)
    torque = np.zeros(3)
    torque[axis] = DEFAULT_BODY.torque_limit[axis]
    state = RigidState(np.zeros(3), np.zeros(3), 1200.0)
    middle = fly_commands(state, 0.0, torque, half, DEFAULT_BODY)
    assert middle.rates[axis] == pytest.approx(acceleration * half, rel=1e-12)
    end = fly_commands(middle, 0.0, -torque, half, DEFAULT_BODY)
    turned = Rotation.from_quat(end.attitude, scalar_first=True).as_rotvec()
    assert turned[axis] == pytest.approx(angle, abs=1e-6)
    np.testing.assert_allclose(end.rates, 0.0, atol=1e-12)


@given(lag=st.floats(0.01, 2.0), duration=st.floats(0.01, 5.0), throttle=st.floats(0.1, 1.0))
def test_thrust_follows_a_step_with_its_lag_and_burns_its_integral(lag, duration, throttle):
    body, thrust = replace(DEFAULT_BODY, engine_lag=lag), 12000.0 * throttle
    flown = fly_commands(RigidState(np.zeros(3), np.zeros(3), 1200.0), thrust, NOTHING, duration, body)
    assert flown.thrust[2] == pytest.approx(-thrust * math.expm1(-duration / lag), rel=1e-12)
    impulse = thrust * (duration + lag * math.expm1(-duration / lag))
    assert 1200.0 - flown.mass == pytest.approx(impulse / PAPER_LANDER.exhaust_velocity, rel=2e-4)


def test_an_engine_arm_turns_the_body_against_the_gimbal():
    """arm x F: a force to +x below the mass centre turns the vehicle about -y."""
    state = RigidState(np.zeros(3), np.zeros(3), 1200.0)
    body = replace(GIMBALLED, engine_lag=0.0, inertia_exponent=0.0)
    flown = fly_commands(state, [600.0, 0.0, 6000.0], NOTHING, 0.1, body)
    assert flown.rates[1] == pytest.approx(-1.2 * 600.0 / 880.0 * 0.1, rel=1e-9)
    assert flown.rates[0] == flown.rates[2] == 0.0


@given(thrust=vectors(20000.0), torque=vectors(200.0))
def test_commands_are_brought_within_the_limits(thrust, torque):
    body = replace(GIMBALLED, lander=Lander(min_thrust=3000.0))
    limit_command_into(thrust, torque, body.numbers())
    assert (np.abs(torque) <= 66.0).all()
    size = float(np.linalg.norm(thrust))
    assert size == 0.0 or 3000.0 * (1 - 1e-12) <= size <= 12000.0 * (1 + 1e-12)
    assert math.hypot(thrust[0], thrust[1]) <= math.tan(0.2) * thrust[2] * (1 + 1e-9) + 1e-9


def test_a_zero_thrust_stops_an_engine_with_a_floor():
    body = replace(DEFAULT_BODY, lander=Lander(min_thrust=3000.0), engine_lag=0.0)
    state = RigidState(np.zeros(3), np.zeros(3), 1200.0, thrust=np.array([0.0, 0.0, 5000.0]))
    assert fly_commands(state, 0.0, NOTHING, 1.0, body).mass == 1200.0
    weak = fly_commands(state, 1.0, NOTHING, 1.0, body)
    assert 1200.0 - weak.mass == pytest.approx(3000.0 / PAPER_LANDER.exhaust_velocity)


def test_a_thrust_that_would_burn_the_whole_mass_is_refused():
    with pytest.raises(ValueError, match="burns more than the whole mass"):
        fly_commands(RigidState(np.zeros(3), np.zeros(3), 1200.0), 12000.0, NOTHING, 1000.0, DEFAULT_BODY)
