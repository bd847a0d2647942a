"""How a lander stands: as its body does, or upright as a point mass; and where its thrust points."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import hda
from guidance.rigid_body import rotate
from guidance.rigid_body.state import SIZE
from hda.flight.episode import fly
from hda.flight.portrait.pose import LanderPose, end_pose, engine_attitudes, find_pose
from hda.flight.record import EpisodeRecord
from hda.flight.vehicle import Segment

VECTORS = st.tuples(*[st.floats(-1.0, 1.0)] * 3)


@pytest.fixture(scope="module")
def record() -> EpisodeRecord:
    return fly(hda.make_policy("nearest-safe"), hda.sample_scenario("paper", 0, 3))


def leaning(segment: Segment, start: float) -> Segment:
    """The same path, of a body that turns about two axes meanwhile, its quaternions now and then negated."""
    states = np.zeros((len(segment.time), SIZE))
    states[:, :6], states[:, 13] = segment.path[:, :6], segment.path[:, 6]
    time = start + segment.time
    turns = Rotation.from_rotvec(0.3 * np.column_stack([np.sin(time), np.cos(0.7 * time), 0.1 * time]))
    states[:, 6:10] = turns.as_quat(scalar_first=True) * np.where(time[:, None] % 2.0 < 1.0, 1.0, -1.0)
    states[:, 16] = 2000.0 + 100.0 * time
    return replace(segment, body_path=states)


@pytest.fixture(scope="module")
def of_body(record: EpisodeRecord) -> EpisodeRecord:
    starts = [observation.time for observation in record.observations]
    parts = [leaning(each, start) for each, start in zip(record.segments, starts, strict=False)]
    return replace(record, segments=tuple(parts))


@given(turn=VECTORS, points=st.lists(VECTORS, min_size=1, max_size=5))
def test_points_of_the_body_are_turned_as_its_attitude_says(turn, points):
    rotation = Rotation.from_rotvec(turn)
    pose = LanderPose(np.zeros(3), rotation.as_quat(scalar_first=True), np.zeros(3))
    np.testing.assert_allclose(pose.to_site(np.array(points)), rotation.apply(points), atol=1e-12)
    up = rotation.apply([0.0, 0.0, 1.0])
    assert np.cos(pose.tilt) == pytest.approx(up[2], abs=1e-9)


def test_a_point_mass_stands_upright_and_its_engine_along_the_held_thrust(record: EpisodeRecord):
    greatest, engines = record.scenario.preset.lander.max_thrust, engine_attitudes(record)
    for k, middle in enumerate((record.time[1:] + record.time[:-1]) / 2.0):
        pose, thrust = find_pose(record, float(middle)), record.thrust[k]
        np.testing.assert_allclose(pose.thrust * greatest, thrust, atol=1e-9)
        assert pose.throttle == pytest.approx(float(np.linalg.norm(thrust)) / greatest)
        assert pose.tilt == 0.0
        axis = rotate(engines[k], [0.0, 0.0, 1.0])
        np.testing.assert_allclose(axis * np.linalg.norm(thrust), thrust, atol=1e-6)
    np.testing.assert_array_equal(engines[-1], [1.0, 0.0, 0.0, 0.0])
    assert find_pose(record, 1e9).throttle == 0.0


@given(turn=VECTORS, thrust=VECTORS, length=st.floats(0.1, 3.0))
def test_a_flame_hangs_from_the_nozzle_against_the_thrust(turn, thrust, length):
    attitude, nozzle = Rotation.from_rotvec(turn).as_quat(scalar_first=True), np.array([0.0, 0.0, 0.04])
    pose = LanderPose(np.zeros(3), attitude, np.array(thrust))
    top, tip = pose.flame_to_site(np.array([nozzle, nozzle - [0.0, 0.0, length]]), nozzle)
    np.testing.assert_allclose(top, rotate(attitude, nozzle), atol=1e-12)
    if pose.throttle > 1e-6:
        np.testing.assert_allclose(tip - top, -length * pose.thrust / pose.throttle, atol=1e-9)


def test_a_body_stands_as_its_states_say_at_the_nodes_and_between_two(of_body: EpisodeRecord):
    states, times = of_body.body_path, of_body.time
    assert states is not None
    for k in range(0, len(times), 7):
        pose = find_pose(of_body, float(times[k]))
        for axis in np.eye(3):
            np.testing.assert_allclose(rotate(pose.attitude, axis), rotate(states[k, 6:10], axis), atol=1e-9)
        given = rotate(states[k, 6:10], states[k, 14:17])
        np.testing.assert_allclose(pose.thrust * of_body.scenario.preset.lander.max_thrust, given, atol=1e-6)
    for k in range(0, len(times) - 1, 5):
        pose = find_pose(of_body, float(times[k] + times[k + 1]) / 2.0)
        assert np.linalg.norm(pose.attitude) == pytest.approx(1.0)
        ends = [Rotation.from_quat(states[n, 6:10], scalar_first=True) for n in (k, k + 1)]
        half = ends[0] * Rotation.from_rotvec(0.5 * (ends[0].inv() * ends[1]).as_rotvec())
        found = Rotation.from_quat(pose.attitude, scalar_first=True)
        assert (half.inv() * found).magnitude() < 1e-6


def test_no_scalar_part_is_negative(record: EpisodeRecord, of_body: EpisodeRecord):
    for flown in (record, of_body):
        attitudes = engine_attitudes(flown)
        assert attitudes.shape == (len(flown.time), 4)
        assert (attitudes[:, 0] >= 0.0).all()
        np.testing.assert_allclose(np.linalg.norm(attitudes, axis=1), 1.0)


def test_a_lander_in_an_environment_stands_as_it_was_left(record: EpisodeRecord):
    from hda.flight.episode import advance, begin_flight

    scenario = record.scenario
    before = end_pose(scenario, [])
    np.testing.assert_array_equal(before.position, scenario.initial_state.position)
    assert (before.tilt, before.throttle) == (0.0, 0.0)
    step = advance(scenario, begin_flight(scenario), record.decisions[0])
    pose = end_pose(scenario, [step])
    number = len(step.segment.time) - 1
    np.testing.assert_array_equal(pose.position, record.position[number])
    thrust = pose.thrust * scenario.preset.lander.max_thrust
    np.testing.assert_allclose(thrust, record.thrust[number - 1], atol=1e-6)
    body = replace(step, segment=leaning(step.segment, 0.0))
    states = body.segment.body_path
    assert states is not None
    left = end_pose(scenario, [step, body])
    np.testing.assert_allclose(np.abs(left.attitude), np.abs(states[-1, 6:10]), atol=1e-12)
    assert left.throttle == pytest.approx(states[-1, 16] / scenario.preset.lander.max_thrust)
