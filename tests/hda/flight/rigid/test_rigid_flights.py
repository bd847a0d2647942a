"""Whole flights of a rigid body: in the limit the point mass's, and what the seam shows of it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hda
from guidance import Lander
from guidance.rigid_body import DEFAULT_BODY, AttitudeLoop, RigidBody, rotate
from hda.flight.episode import begin_flight, fly_legs, observe
from hda.flight.outcome import Outcome
from hda.flight.picture import save_flight
from hda.navigation import Gyroscope, NavigationSystem
from hda.policy import Policy
from hda.task.presets import PRESETS, Preset
from hda.task.scenario import Scenario, sample_scenario

AGILE = RigidBody(torque_limit=(1e9, 1e9, 1e9), rate_limit=1e4, tilt_limit=math.pi, engine_lag=0.0)
"""A body that hardly takes time to turn."""


def with_body(preset: Preset, body: RigidBody, frequency: float = 1.5) -> Preset:
    loop = AttitudeLoop(frequency, period=min(0.1, 0.75 / frequency))
    return replace(preset, name="with-a-body", body=body, attitude_loop=loop)


def fly_unknowing(policy: str, scenario: Scenario) -> tuple[Outcome, np.ndarray]:
    """Outcome and path [m] of a policy that takes what it flies for a point mass."""
    pilot, view = hda.make_policy(policy), replace(scenario.view, body=None)
    assert isinstance(pilot, Policy)
    legs = list(fly_legs(scenario, pilot.decide, pilot.begin(view, scenario.streams.policy())))
    outcome = legs[-1].step.outcome
    assert outcome is not None
    return outcome, np.concatenate([leg.step.segment.path[:-1, :3] for leg in legs])


@pytest.mark.parametrize("policy", ["single-divert", "nearest-safe", "nearest-safe+convex"])
def test_in_the_limit_its_flights_are_the_point_masss(policy: str):
    """Within 1.5 m where the loop takes 0.03 s; by ZEM/ZEV at least three times nearer with a tenth of it.

    A plan is followed along its own direction, so that small corrections differ however fast a body turns.
    """
    scenario = sample_scenario("paper", 21, 1, split="tuning")
    point, path = fly_unknowing(policy, scenario)
    gaps = []
    for frequency in (150.0, 1500.0):
        flown = replace(scenario, preset=with_body(scenario.preset, AGILE, frequency))
        outcome, other = fly_unknowing(policy, flown)
        nodes = min(len(path), len(other))
        gaps.append(float(np.linalg.norm(path[:nodes] - other[:nodes], axis=1).max()))
        assert outcome.ending is point.ending
        assert outcome.touchdown_speed == pytest.approx(point.touchdown_speed, abs=0.05)
    assert max(gaps) < 1.5
    if "convex" not in policy:
        assert gaps[1] < gaps[0] / 3.0


def test_an_observation_shows_the_attitude_that_the_lander_believes_to_have():
    scenario = sample_scenario("rigid-body", 21, 0, split="tuning")
    flight = begin_flight(scenario)
    seen = observe(scenario, flight)
    assert seen.attitude is not None
    assert seen.rates is not None
    assert scenario.sensor_errors is not None
    assert 0.0 < np.abs(seen.rates).max() < math.radians(0.02)  # a bias of 1 deg/h, and noise
    assert seen.attitude_covariance is not None
    np.testing.assert_allclose(seen.attitude_covariance, 1e-6 * np.eye(3), rtol=1e-9)
    tilt = scenario.sensor_errors.tilt
    up = np.array([0.0, 0.0, 1.0])
    np.testing.assert_allclose(rotate(seen.attitude, up), up - np.cross(tilt, up), atol=1e-5)
    point = sample_scenario("navigated", 21, 0, split="tuning")
    plain = observe(point, begin_flight(point))
    assert plain.attitude is plain.rates is plain.attitude_covariance is None


def test_a_record_holds_the_bodys_states_at_the_control_instants():
    scenario = sample_scenario("paper", 21, 0, split="tuning")
    flown = replace(scenario, preset=with_body(scenario.preset, DEFAULT_BODY))
    record = hda.fly(hda.make_policy("single-divert"), flown)
    for segment in record.segments:
        assert segment.body_path is not None
        assert segment.body_path.shape == (len(segment.time), 17)
        np.testing.assert_array_equal(segment.body_path[:, [0, 1, 2, 3, 4, 5, 13]], segment.path)
        np.testing.assert_allclose(np.linalg.norm(segment.body_path[:, 6:10], axis=1), 1.0, atol=1e-12)
    for before, after in zip(record.segments[:-1], record.segments[1:], strict=True):
        assert before.body_path is not None
        assert after.body_path is not None
        np.testing.assert_allclose(before.body_path[-1], after.body_path[0], rtol=1e-15)
    assert record.body_path is not None
    np.testing.assert_array_equal(record.body_path[:, [0, 1, 2, 3, 4, 5, 13]], record.path)
    point = hda.fly(hda.make_policy("single-divert"), scenario)
    assert point.body_path is point.segments[0].body_path is None


def test_a_records_thrust_is_what_engine_and_attitude_gave():
    """Its size is told by the burnt mass; between two nodes it lies near the mean of theirs.

    The command does neither: it is asked for before the lag, and along another axis.
    """
    scenario = sample_scenario("rigid-body", 21, 0, split="tuning")
    record = hda.fly(hda.make_policy("nearest-safe+convex"), scenario)
    states, time = record.body_path, np.diff(record.time)
    assert states is not None
    nodes = np.array([rotate(state[6:10], state[14:17]) for state in states])
    between = 0.5 * (nodes[1:] + nodes[:-1])
    told = np.median(np.linalg.norm(record.thrust - between, axis=1))
    asked = np.median(np.linalg.norm(record.commanded_thrust - between, axis=1))
    assert told < 0.5 * asked
    impulse = float(np.linalg.norm(record.thrust, axis=1) @ time)
    burnt = (record.mass[0] - record.mass[-1]) * scenario.preset.lander.exhaust_velocity
    assert impulse == pytest.approx(burnt, rel=1e-9)
    sizes = np.linalg.norm(nodes, axis=1)
    assert record.maximum_thrust == pytest.approx(sizes.max(), rel=1e-12)
    up = np.array([0.0, 0.0, 1.0])
    leans = [float(rotate(state[6:10], up) @ up) for state in states]
    assert math.cos(record.maximum_tilt) == pytest.approx(min(leans), abs=1e-12)


def test_a_kept_flight_has_the_bodys_states(tmp_path: Path):
    for preset in ("rigid-body", "navigated"):
        record = hda.fly(hda.make_policy("no-divert"), sample_scenario(preset, 21, 0, split="tuning"))
        save_flight(tmp_path / f"{preset}.npz", record)
    with np.load(tmp_path / "rigid-body.npz") as kept:
        assert kept["body_path"].shape == (len(kept["time"]), 17)
        np.testing.assert_array_equal(kept["body_path"][:, 13], kept["path"][:, 6])
    with np.load(tmp_path / "navigated.npz") as kept:
        assert "body_path" not in kept


@pytest.mark.parametrize("torque", [(0.0, 66.0, 66.0), (66.0, 0.0, 66.0), (0.0, 0.0, 0.0)])
def test_a_body_that_nothing_leans_is_refused_where_it_would_fly(torque: tuple[float, float, float]):
    with pytest.raises(ValueError, match="needs torque about x and y"):
        replace(PRESETS["rigid-body"], body=replace(DEFAULT_BODY, torque_limit=torque))
    assert replace(PRESETS["paper"], body=replace(DEFAULT_BODY, torque_limit=(1.0, 1.0, 0.0))).vehicle


def test_equal_episodes_are_equal_to_the_byte():
    scenario = sample_scenario("paper", 21, 0, split="tuning")
    flown = replace(scenario, preset=with_body(scenario.preset, DEFAULT_BODY))
    first, again = (hda.fly(hda.make_policy("nearest-safe"), flown).path.tobytes() for _ in range(2))
    assert first == again


def test_engine_and_tank_of_the_body_are_those_of_the_presets_lander():
    weak = Lander(dry_mass=1160.0, max_thrust=6000.0, pointing_limit=math.radians(20.0))
    preset = replace(PRESETS["rigid-body"], lander=weak)
    vehicle = preset.vehicle
    assert isinstance(vehicle, RigidBody)
    assert vehicle.lander == weak
    assert vehicle.tilt_limit == weak.pointing_limit
    assert preset.guided_lander == weak
    assert PRESETS["rigid-body"].guided_lander == replace(Lander(), pointing_limit=DEFAULT_BODY.tilt_limit)
    assert PRESETS["navigated"].vehicle == PRESETS["navigated"].guided_lander == Lander()


def test_the_preset_is_navigated_with_a_body():
    preset, plain = PRESETS["rigid-body"], PRESETS["navigated"]
    assert replace(preset, name="navigated", body=None, navigation=plain.navigation) == plain
    assert preset.navigation == NavigationSystem(gyroscope=Gyroscope())
    with pytest.raises(ValueError, match="a gyroscope needs a body"):
        replace(preset, body=None)
    body = preset.body
    assert body is not None
    assert (body.inertia, body.torque_limit) == ((880.0, 880.0, 1040.0), (66.0, 66.0, 66.0))
    assert math.degrees(body.rate_limit) == pytest.approx(10.0)
    assert math.degrees(body.tilt_limit) == pytest.approx(45.0)
    assert body.engine_lag == 0.2
