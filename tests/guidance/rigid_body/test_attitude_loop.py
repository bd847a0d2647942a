"""The attitude loop: it points the thrust, keeps its limits, and is as fast as its torque allows."""

import math
from dataclasses import replace

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from guidance import PAPER_LANDER, Lander, State, propagate
from guidance.rigid_body import DEFAULT_BODY, DEFAULT_LOOP, AttitudeLoop, RigidState, hold_thrust, rotate
from guidance.rigid_body.attitude_loop import hold_into
from guidance.rigid_body.loop_response import fly_turn, loop_margins
from guidance.rigid_body.quaternion import heading_angle, tilt_angle
from tests.guidance.rigid_body.rigid_cases import DIRECTIONS, STATES, vectors

ACCELERATION = 66.0 / 880.0
TILTS = vectors(1.0).map(lambda vector: np.array([vector[0], vector[1], 1.5]))


@settings(max_examples=30)
@given(state=STATES, direction=TILTS, throttle=st.floats(0.1, 0.9), heading=st.floats(-3.0, 3.0))
def test_the_thrust_ends_where_it_was_asked_and_the_heading_stays(state, direction, throttle, heading):
    turned = np.array([math.cos(heading / 2), 0.0, 0.0, math.sin(heading / 2)])
    start = replace(state, attitude=turned, rates=np.zeros(3))
    wanted = 6000.0 * throttle * direction / np.linalg.norm(direction)
    flown = hold_thrust(start, wanted, 20.0, DEFAULT_BODY)
    np.testing.assert_allclose(rotate(flown.attitude, flown.thrust), wanted, atol=1.0)
    assert math.remainder(heading_angle(flown.attitude) - heading, 2 * math.pi) == pytest.approx(
        0.0, abs=1e-3
    )


@settings(max_examples=30)
@given(state=STATES, wanted=vectors(15000.0))
def test_no_command_leaves_its_limit(state, wanted):
    body = replace(DEFAULT_BODY, lander=Lander(min_thrust=1500.0))
    numbers, commands = state.as_array(), np.empty((100, 6))
    hold_into(numbers, wanted, 10.0, body.numbers(), DEFAULT_LOOP.numbers, commands)
    assert (np.abs(commands[:, 3:]) <= 66.0 * (1 + 1e-12)).all()
    assert ((commands[:, 2] >= 1500.0) & (commands[:, 2] <= 12000.0)).all()
    assert not commands[:, :2].any()


@settings(max_examples=30)
@given(direction=DIRECTIONS, thrust=st.floats(0.0, 12000.0))
def test_rate_and_tilt_stay_within_their_limits(direction, thrust):
    numbers = RigidState(np.zeros(3), np.zeros(3), 1200.0).as_array()
    body, commands = DEFAULT_BODY.numbers(), np.empty((1, 6))
    for _ in range(150):
        hold_into(numbers, thrust * direction, 0.1, body, DEFAULT_LOOP.numbers, commands)
        assert np.linalg.norm(numbers[10:13]) <= DEFAULT_BODY.rate_limit * 1.001
        assert tilt_angle(numbers[6:10]) <= DEFAULT_BODY.tilt_limit + 1e-3


@given(angle=st.floats(math.radians(5.0), math.radians(30.0)), around=st.floats(0.0, 6.3))
def test_a_turn_takes_little_more_than_bang_bang(angle, around):
    """Along any transverse axis, where the torque's box reaches its limit at least."""
    axis = np.array([math.cos(around), math.sin(around), 0.0])
    response = fly_turn(angle * axis, 1200.0, 25.0, DEFAULT_BODY, DEFAULT_LOOP)
    reach = ACCELERATION / np.abs(axis).max()
    least = 2.0 * math.sqrt(angle / reach)
    settled = response.settling_time(0.02 * angle)
    assert 0.85 * least <= settled <= least + 2.5  # 2 % of the angle from the end, bang-bang has 10 % to go
    assert response.angle[-1] < 1e-6


@given(frequency=st.floats(0.3, 3.0), angle=st.floats(1e-4, 1e-3))
def test_a_small_step_follows_the_critically_damped_form(frequency, angle):
    loop = AttitudeLoop(frequency, 1.0, 0.002)
    response = fly_turn(np.array([0.0, angle, 0.0]), 1200.0, 2.0 / frequency, DEFAULT_BODY, loop)
    phase = frequency * response.time
    np.testing.assert_allclose(response.angle, angle * np.exp(-phase) * (1.0 + phase), atol=0.005 * angle)


def open_loop(loop: AttitudeLoop) -> control.TransferFunction:
    """By python-control: a double integrator under a zero-order hold, its two states fed back."""
    plant = control.c2d(control.ss([[0, 1], [0, 0]], [[0], [1]], np.eye(2), np.zeros((2, 1))), loop.period)
    wn = loop.natural_frequency
    return control.ss(plant.A, plant.B, [[wn**2, 2.0 * loop.damping * wn]], [[0.0]], loop.period)


@given(frequency=st.floats(0.2, 4.0), damping=st.floats(0.5, 1.5), period=st.floats(0.01, 0.1))
def test_the_sampled_loop_has_the_margins_that_are_said(frequency, damping, period):
    loop = AttitudeLoop(frequency, damping, period)
    margins, opened = loop_margins(loop), open_loop(loop)
    there = complex(opened(np.exp(1j * margins.crossover * period)))
    assert abs(there) == pytest.approx(1.0, rel=1e-6)
    assert math.remainder(np.angle(there) - margins.phase + math.pi, 2 * math.pi) == pytest.approx(
        0.0, abs=1e-6
    )
    poles = np.abs(np.linalg.eigvals(opened.A - margins.gain * opened.B @ opened.C))
    assert poles.max() == pytest.approx(1.0, abs=1e-9)  # on the edge of stability
    inside = np.abs(np.linalg.eigvals(opened.A - 0.99 * margins.gain * opened.B @ opened.C))
    assert inside.max() < 1.0


@given(frequency=st.floats(0.2, 4.0), damping=st.floats(0.5, 1.5))
def test_a_fast_loop_has_the_margins_of_the_continuous_one(frequency, damping):
    margins = loop_margins(AttitudeLoop(frequency, damping, 1e-3 / frequency))
    crossover = frequency * math.sqrt(2.0 * damping**2 + math.sqrt(4.0 * damping**4 + 1.0))
    assert margins.crossover == pytest.approx(crossover, rel=1e-3)
    assert margins.phase == pytest.approx(math.atan(2.0 * damping * crossover / frequency), abs=5e-3)
    assert margins.delay == pytest.approx(margins.phase / crossover, rel=1e-3)


def test_with_more_torque_and_no_lag_the_flight_becomes_that_of_the_point_mass():
    start, wanted = (
        State(np.zeros(3), np.array([8.0, 4.0, -30.0]), 1200.0),
        np.array([-2000.0, 900.0, 3500.0]),
    )
    exact = propagate(start, wanted, 5.0, PAPER_LANDER)
    apart = []
    for gain in (1.0, 10.0, 100.0):
        torque = (66.0 * gain**2,) * 3
        body = replace(DEFAULT_BODY, torque_limit=torque, rate_limit=100.0, engine_lag=0.0)
        loop = AttitudeLoop(1.5 * gain, 1.0, 0.1 / gain)
        flown = hold_thrust(RigidState.parse(start), wanted, 5.0, body, loop)
        apart.append(float(np.linalg.norm(flown.velocity - exact.velocity)))
    assert apart[1] < 0.15 * apart[0]
    assert apart[2] < 0.15 * apart[1]


@pytest.mark.parametrize(
    "fields",
    [{"period": 0.7}, {"damping": 0.0}, {"natural_frequency": -1.0}, {"damping": 0.01, "period": 0.1}],
)
def test_a_loop_that_cannot_work_is_refused(fields):
    with pytest.raises(ValueError, match="must be"):
        AttitudeLoop(**fields)
