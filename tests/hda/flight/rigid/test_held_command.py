"""A rigid body between two looks, against closed forms: engine, tank, plane, ground, and what it believes."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from guidance import MOON_GRAVITY, Lander
from guidance.arrays import Array
from guidance.rigid_body import AttitudeLoop, RigidBody, RigidState
from guidance.rigid_body.quaternion import tilt_angle
from guidance.tracking.reference import make_reference
from hda.flight.rigid import believed_attitude
from hda.flight.vehicle import ControlPeriods, FlightErrors, FlightStatus, Segment, Surroundings, fly_over
from hda.navigation.layout import NORMAL_COLUMNS, UNIFORM_COLUMNS
from hda.navigation.navigation_state import begin_navigation
from hda.navigation.sensor_errors import SensorErrors
from hda.navigation.steering import Sensing
from hda.policy import Decision, PlanCommand, ZemZevCommand
from hda.safety.touchdown_stance import Stance, contact_height, make_footing
from tests.hda.navigation.filter_cases import ALONE

GRAVITY = np.array(MOON_GRAVITY)
PULL = 1.62
PLANE = 50.0
SITE = np.array([30.0, 30.0, PLANE])
INTERVAL = ControlPeriods(0.5, 10)
EXHAUST = Lander().exhaust_velocity
CUT_OFF = ZemZevCommand(6.0, 2.0, 0.25)


def standing(height: float, climb: float = 0.0, mass: float = 1200.0, thrust: float = 0.0) -> RigidState:
    """Upright over the site, its engine at a thrust."""
    place = SITE + np.array([0.0, 0.0, height])
    return RigidState(place, np.array([0.0, 0.0, climb]), mass, thrust=np.array([0.0, 0.0, thrust]))


def hold(thrust: float, mass: float, periods: int = 20) -> PlanCommand:
    """Open loop: a constant thrust acceleration upward."""
    acceleration = np.zeros((periods, 3))
    acceleration[:, 2] = thrust / mass
    speed = np.vstack([np.zeros(3), 0.5 * np.cumsum(acceleration + GRAVITY, axis=0)])
    place = SITE + np.vstack([np.zeros(3), np.cumsum(0.25 * (speed[:-1] + speed[1:]), axis=0)])
    return PlanCommand(make_reference(place, speed, 0.5, GRAVITY), (0.0, 0.0))


def fly(
    state: RigidState,
    command: ZemZevCommand | PlanCommand,
    body: RigidBody,
    errors: FlightErrors | None = None,
    surroundings: Surroundings | None = None,
) -> Segment:
    around = surroundings or Surroundings(GRAVITY)
    return fly_over(state, Decision(SITE, command), body, around, INTERVAL, errors or FlightErrors())


@given(height=st.floats(1e-3, 800.0), climb=st.floats(-60.0, 10.0))
def test_cut_off_without_lag_it_falls_as_galileo_says(height, climb):
    segment = fly(standing(height, climb), CUT_OFF, RigidBody(engine_lag=0.0))
    time = (climb + math.sqrt(climb**2 + 2.0 * PULL * height)) / PULL
    assert segment.status is FlightStatus.TOUCHDOWN
    assert segment.time[-1] == pytest.approx(time, rel=1e-7, abs=1e-7)
    assert segment.path[-1, 2] == pytest.approx(PLANE, abs=1e-6)
    assert segment.path[-1, 6] == 1200.0


@given(thrust=st.floats(0.0, 4000.0), lag=st.floats(0.05, 0.5))
def test_a_lagging_engine_gives_the_rest_of_its_impulse_after_the_cut_off(thrust, lag):
    segment = fly(standing(200.0, -5.0, thrust=thrust), CUT_OFF, RigidBody(engine_lag=lag))
    burnt = thrust * lag / EXHAUST
    assert 1200.0 - segment.path[-1, 6] == pytest.approx(burnt, rel=1e-5, abs=1e-9)
    gained = -EXHAUST * math.log1p(-burnt / 1200.0)
    speed = -5.0 - PULL * segment.time[-1] + gained
    assert segment.path[-1, 5] == pytest.approx(speed, abs=1e-4)


@given(thrust=st.floats(500.0, 6000.0), error=st.floats(-0.05, 0.05), lag=st.floats(0.05, 0.5))
def test_upright_it_burns_what_lag_and_error_leave_of_the_command(thrust, error, lag):
    segment = fly(standing(600.0), hold(thrust, 1200.0), RigidBody(engine_lag=lag), FlightErrors(error))
    first = segment.path[1, 6]
    impulse = (1.0 + error) * thrust * (0.5 - lag * -math.expm1(-0.5 / lag))
    assert 1200.0 - first == pytest.approx(impulse / EXHAUST, rel=1e-5)
    assert segment.body_path is not None
    np.testing.assert_array_equal(segment.body_path[:, 13], segment.path[:, 6])


def test_it_knows_its_engines_error_after_a_control_period_in_spite_of_the_lag():
    """From the second period of a held acceleration on the command makes up for the error."""
    segment = fly(standing(600.0), hold(3000.0, 1200.0), RigidBody(engine_lag=0.2), FlightErrors(0.05))
    asked = segment.commanded[:, 2] / segment.path[:-1, 6]
    assert asked[0] == pytest.approx(2.5, rel=1e-12)
    np.testing.assert_allclose(asked[1:], 2.5 / 1.05, rtol=1e-6)


@given(propellant=st.floats(0.5, 3.0), thrust=st.floats(2500.0, 8000.0))
def test_an_empty_tank_ends_the_burn_as_the_rocket_equation_says(propellant, thrust):
    mass = 1150.0 + propellant
    segment = fly(standing(600.0, mass=mass), hold(thrust, mass), RigidBody(engine_lag=0.0))
    assert segment.status is FlightStatus.TANK_EMPTY
    assert segment.path[-1, 6] == 1150.0
    gained = EXHAUST * math.log(mass / 1150.0)
    assert segment.path[-1, 5] == pytest.approx(gained - PULL * segment.time[-1], abs=1e-4)
    assert segment.path[-1, 2] == pytest.approx(PLANE, abs=1e-6)


def test_on_level_ground_it_touches_as_on_a_plane_of_that_height():
    ground = np.full((60, 60), 38.0, dtype=np.float32)
    footing = make_footing(ground, Stance(4.5, 0.5, 0.3), PLANE)
    state = RigidState(np.array([30.0, 30.0, 90.0]), np.array([0.5, 0.2, -4.0]), 1190.0)
    body = RigidBody()
    touched = fly(state, CUT_OFF, body, surroundings=Surroundings(GRAVITY, footing))
    site = np.array([30.0, 30.0, 38.0])
    crossed = fly_over(state, Decision(site, CUT_OFF), body, Surroundings(GRAVITY), INTERVAL, FlightErrors())
    np.testing.assert_allclose(touched.path[-1], crossed.path[-1], atol=1e-6)
    assert touched.time[-1] == pytest.approx(crossed.time[-1], abs=1e-7)


def test_over_rough_ground_it_ends_where_the_upright_lander_first_touches():
    rng = np.random.default_rng(4)
    ground = (40.0 + rng.normal(0.0, 0.4, (60, 60))).astype(np.float32)
    footing = make_footing(ground, Stance(4.5, 0.5, 0.3), PLANE)
    state = RigidState(np.array([25.0, 30.0, 60.0]), np.array([1.5, -0.4, -3.0]), 1190.0)
    final = fly(state, CUT_OFF, RigidBody(), surroundings=Surroundings(GRAVITY, footing)).path[-1]
    assert final[2] == pytest.approx(contact_height(footing, final[0], final[1]), abs=1e-6)


def test_it_is_righted_while_it_falls():
    leaning = RigidState(
        SITE + np.array([0.0, 0.0, 200.0]),
        np.zeros(3),
        1180.0,
        attitude=Rotation.from_rotvec([0.3, 0.1, 0.0]).as_quat(scalar_first=True),
    )
    segment = fly(leaning, CUT_OFF, RigidBody())
    assert segment.body_path is not None
    assert tilt_angle(segment.body_path[0, 6:10]) > 0.3
    assert tilt_angle(segment.body_path[-1, 6:10]) < 1e-3
    assert np.linalg.norm(segment.body_path[-1, 10:13]) < 1e-3


ANGLES = st.tuples(*[st.floats(-3.0, 3.0)] * 3)


@given(turn=ANGLES, tilt=st.tuples(*[st.floats(-2e-3, 2e-3)] * 3))
def test_the_true_attitude_is_the_believed_one_turned_by_the_tilt(turn, tilt):
    true = Rotation.from_rotvec(turn)
    believed = Rotation.from_quat(believed_attitude(true.as_quat(scalar_first=True), tilt), scalar_first=True)
    between = (true * believed.inv()).as_rotvec()
    np.testing.assert_allclose(between, tilt, atol=1e-8)


def leant_unit(state: RigidState, tilt: Array) -> Sensing:
    """A filter that has an inertial unit alone, whose only error is a tilt."""
    errors = SensorErrors(np.zeros(3), 0.0, np.zeros(3), tilt, np.zeros(3), np.zeros(3))
    navigation = begin_navigation(ALONE, state.point, SITE, errors)
    return Sensing(
        navigation.memory(),
        errors.true_errors(),
        np.zeros((INTERVAL.count, NORMAL_COLUMNS)),
        np.zeros((INTERVAL.count, UNIFORM_COLUMNS)),
        ALONE.numbers(INTERVAL.period),
        elevation=np.full((64, 64), PLANE, dtype=np.float32),
        top=PLANE,
        site=SITE,
        instant=0,
    )


def test_a_tilt_that_it_does_not_know_of_tilts_its_thrust():
    lifted = standing(600.0, thrust=3000.0)
    errors = FlightErrors(sensing=leant_unit(lifted, np.array([0.0, 0.02, 0.0])))
    segment = fly(lifted, hold(3000.0, 1200.0), RigidBody(engine_lag=0.0), errors)
    assert segment.body_path is not None
    up = Rotation.from_quat(segment.body_path[-1, 6:10], scalar_first=True).apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(up, [math.sin(0.02), 0.0, math.cos(0.02)], atol=3e-4)


def test_the_loop_must_be_stable_at_its_period():
    with pytest.raises(ValueError, match="stable loop"):
        AttitudeLoop(natural_frequency=15.0, period=0.1)


@pytest.mark.parametrize("period", [0.1, 0.11, 0.3, 0.5])
def test_whatever_the_loops_period_is_a_control_period_burns_its_own_time_of_propellant(period):
    interval = ControlPeriods(0.5, 10, AttitudeLoop(0.5, period=period))
    decision = Decision(SITE, hold(3000.0, 1200.0))
    flown = fly_over(
        standing(600.0), decision, RigidBody(engine_lag=0.2), Surroundings(GRAVITY), interval, FlightErrors()
    )
    impulse = 3000.0 * (0.5 - 0.2 * -math.expm1(-0.5 / 0.2))
    assert 1200.0 - flown.path[1, 6] == pytest.approx(impulse / EXHAUST, rel=1e-5)


@given(depth=st.floats(0.005, 0.035))
def test_a_slow_loop_does_not_miss_a_dip_below_the_plane(depth):
    """Braked from a sink so that it would turn back `depth` below the plane within one period of 0.5 s."""
    upward = 8000.0 / 1200.0 - PULL
    speed = 0.125 * upward  # it turns back after 0.125 s
    height = 0.5 * speed**2 / upward - depth
    interval = ControlPeriods(0.5, 10, AttitudeLoop(0.5, period=0.5))
    decision = Decision(SITE, hold(8000.0, 1200.0))
    state, body = standing(height, -speed), RigidBody(engine_lag=0.0)
    flown = fly_over(state, decision, body, Surroundings(GRAVITY), interval, FlightErrors())
    assert flown.status is FlightStatus.TOUCHDOWN
    first = (speed - math.sqrt(speed**2 - 2.0 * upward * height)) / upward
    assert flown.time[-1] == pytest.approx(first, abs=2e-3)
