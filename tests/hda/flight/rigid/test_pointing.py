"""Where a rigid body points: along its thrust, ahead of its plan, and upright in time for the touchdown."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hda
from guidance.rigid_body import DEFAULT_BODY, DEFAULT_LOOP, RigidState, attitude_along
from guidance.rigid_body.attitude_loop import hold_thrust
from guidance.rigid_body.quaternion import tilt_angle
from guidance.zem_zev import ZemZevGains
from hda.flight.rigid.pointing import aim_ahead, aim_along, leaning_time, righting_tilt, steer_across
from hda.flight.rigid.turning import Turning, begin_turning, feel_engine, name_turning
from hda.task.scenario import sample_scenario

MASS = 1180.0
FORCES = st.tuples(st.floats(-4000.0, 4000.0), st.floats(-4000.0, 4000.0), st.floats(-2000.0, 8000.0))


def turning(lead: float = 0.0) -> Turning:
    state = RigidState(np.array([0.0, 0.0, 100.0]), np.array([0.0, 0.0, -5.0]), MASS)
    body, loop = DEFAULT_BODY.numbers(), DEFAULT_LOOP.numbers
    named = name_turning(begin_turning(state, body, loop, np.zeros(3), lead, 12))
    assert named is not None
    return named


@given(remaining=st.floats(0.5, 5.0))
def test_from_the_righting_tilt_two_torques_right_the_body_in_time(remaining):
    """Of two equal and opposite torques the fastest turn takes 2 sqrt(tilt / acceleration)."""
    tilt = righting_tilt(turning(), remaining)
    acceleration = 66.0 / DEFAULT_BODY.inertia_at(MASS)[0]
    assert 2.0 * math.sqrt(tilt / acceleration) == pytest.approx(math.sqrt(0.6) * remaining, rel=1e-9)


def test_the_loop_rights_it_in_that_time_too():
    tilt = righting_tilt(turning(), 4.0)
    leaning = RigidState(
        np.zeros(3), np.zeros(3), MASS, attitude=attitude_along([math.sin(tilt), 0.0, math.cos(tilt)])
    )
    righted = hold_thrust(leaning, [0.0, 0.0, 0.0], 4.0, DEFAULT_BODY)
    assert tilt > math.radians(8.0)
    assert tilt_angle(righted.attitude) < 0.1 * tilt


@given(force=FORCES, remaining=st.floats(0.0, 20.0))
def test_a_thrust_is_straightened_across_the_vertical_alone(force, remaining):
    body, commanded = turning(), np.array(force)
    aim_along(body, commanded, remaining)
    assert commanded[2] == force[2]
    across, asked = math.hypot(*commanded[:2]), math.hypot(*force[:2])
    most = min(righting_tilt(body, remaining), DEFAULT_BODY.tilt_limit)
    assert across <= math.tan(most) * max(force[2], MASS) + 1e-6
    assert across <= asked * (1.0 + 1e-12)
    if across > 1e-3:
        assert commanded[0] * force[1] == pytest.approx(commanded[1] * force[0], abs=1e-6 * asked**2)
    np.testing.assert_array_equal(body.aim, commanded)


def test_it_points_along_what_the_plan_asks_for_later():
    planned = np.column_stack([0.1 * np.arange(40.0), np.zeros(40), np.full(40, 3.0)])
    for lead, later in ((0.0, 0.5), (1.0, 0.7), (0.75, 0.65)):
        body = turning(lead)
        aim_ahead(body, MASS * planned[5], planned, 5, 0.5, 0.0)
        np.testing.assert_allclose(body.aim, MASS * np.array([later, 0.0, 3.0]), rtol=1e-12)


def test_while_its_plan_coasts_it_turns_to_the_burn_that_follows():
    planned = np.zeros((60, 3))
    planned[30:] = [1.0, -0.5, 4.0]
    body = turning(1.0)
    aim_ahead(body, np.zeros(3), planned, 2, 0.5, 0.0)
    np.testing.assert_allclose(body.aim, MASS * planned[30], rtol=1e-12)


def test_a_correction_leans_the_aim_and_none_of_it_is_upward():
    planned = np.tile([0.0, 0.0, 2.0], (60, 1))
    body = turning()
    aim_ahead(body, MASS * np.array([0.2, -0.1, 5.0]), planned, 0, 0.5, 0.0)
    np.testing.assert_allclose(body.aim, MASS * np.array([0.2, -0.1, 2.0]), rtol=1e-12)


def test_what_it_knows_of_its_engine_does_not_turn_its_aim():
    planned = np.column_stack([0.05 * np.arange(40.0), np.full(40, -0.3), np.full(40, 3.0)])
    asked = planned[5] + np.array([0.2, -0.1, 0.4])
    for estimate in (-0.1, 0.0, 0.05):
        body = turning(1.5)
        aim_ahead(body, MASS * asked / (1.0 + estimate), planned, 5, 0.5, estimate)
        np.testing.assert_allclose(body.aim, MASS * np.array([0.6, -0.4, 3.0]), rtol=1e-12)


@given(remaining=st.floats(0.1, 7.0))
def test_near_the_touchdown_its_gains_are_those_of_twice_the_leaning_time(remaining):
    site, seen = np.array([30.0, -20.0, 0.0]), np.array([10.0, 5.0, 300.0, 2.0, -1.0, -20.0, MASS])
    body, out = turning(), np.zeros(3)
    steer_across(body, seen, site, ZemZevGains(6.0, 2.0), remaining, out)
    left = 2.0 * leaning_time(body)
    for axis in range(2):
        away, speed = site[axis] - seen[axis], seen[3 + axis]
        assert out[axis] == pytest.approx(6.0 * away / left**2 - 4.0 * speed / left, rel=1e-12)


def test_an_engine_that_hardly_burns_tells_nothing_of_its_error():
    body = turning()
    body.engine[:] = 0.0, 40.0, 44.0
    assert feel_engine(body, 0.02, 0.5, 41.0) == 0.02
    assert feel_engine(body, 0.02, 0.5, 40.0) == pytest.approx(0.1, rel=1e-12)
    assert feel_engine(None, 0.02, 0.5, 41.0) == 0.5


@given(remaining=st.floats(10.0, 60.0))
def test_across_the_vertical_zem_zev_has_arrived_before_the_touchdown(remaining):
    """The law's own formula with rest at the site and no gravity across, its clock ahead of the other."""
    site, seen = np.array([30.0, -20.0, 0.0]), np.array([10.0, 5.0, 300.0, 2.0, -1.0, -20.0, MASS])
    out, left = np.array([9.0, 9.0, 7.0]), remaining - 0.65 * leaning_time(turning())
    steer_across(turning(), seen, site, ZemZevGains(6.0, 2.0), remaining, out)
    for axis in range(2):
        away, speed = site[axis] - seen[axis], seen[3 + axis]
        assert out[axis] == pytest.approx(6.0 * away / left**2 - 4.0 * speed / left, rel=1e-12)
    assert out[2] == 7.0
    kept = np.array([9.0, 9.0, 7.0])
    steer_across(None, seen, site, ZemZevGains(6.0, 2.0), remaining, kept)
    np.testing.assert_array_equal(kept, [9.0, 9.0, 7.0])


def test_the_time_to_lean_is_that_of_the_loop_or_of_the_torques():
    """By the loop's natural frequency, 4.5 / 1.5; by the torques 2 sqrt(10 deg / acceleration)."""
    assert leaning_time(turning()) == pytest.approx(3.02, abs=0.02)
    weak = replace(DEFAULT_BODY, torque_limit=(11.0, 66.0, 66.0))
    acceleration = 11.0 / weak.inertia_at(MASS)[0]
    slow = turning()._replace(body=weak.numbers())
    assert leaning_time(slow) == pytest.approx(2.0 * math.sqrt(math.radians(10.0) / acceleration), rel=1e-12)
    hasty = turning()._replace(body=replace(weak, torque_limit=(1e9, 1e9, 1e9)).numbers())
    assert leaning_time(hasty) == pytest.approx(3.0, rel=1e-12)


@pytest.mark.parametrize("policy", ["no-divert", "oracle+convex"])
def test_it_touches_down_upright_and_still(policy: str):
    for episode in range(4):
        scenario = sample_scenario("paper", 21, episode, split="tuning")
        flown = replace(scenario, preset=replace(scenario.preset, name="with-a-body", body=DEFAULT_BODY))
        final = hda.fly(hda.make_policy(policy), flown).segments[-1].final_body
        assert final is not None
        assert math.degrees(tilt_angle(final.attitude)) < 3.0
        assert math.degrees(float(np.linalg.norm(final.rates))) < 2.0
        assert math.hypot(*final.velocity[:2]) < 0.5
