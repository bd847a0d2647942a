"""The lander's pointing limit in flight: enforced by the vehicle, counted, and respected by the policies."""

import importlib
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hda
from guidance import MOON_GRAVITY, Lander, State, time_to_go, zem_zev_acceleration
from hda.flight.record import EpisodeRecord
from hda.flight.vehicle import ControlPeriods, FlightErrors, Segment, Surroundings, fly_over
from hda.policy import Decision, DecisionStatus, PlanCommand, ZemZevCommand
from hda.task.presets import PRESETS, Preset
from tests.equality import same

importlib.import_module("rl")  # adds the agents

GRAVITY = np.array(MOON_GRAVITY)
SITE = np.array([500.0, 400.0, 50.0])
SAME_ANGLE = 1e-9  # [rad]


def limited(degrees: float | None, **lander: float) -> Preset:
    limit = None if degrees is None else math.radians(degrees)
    return replace(PRESETS["paper"], lander=Lander(pointing_limit=limit, **lander))


def fly(name: str, preset: Preset, episode: int) -> EpisodeRecord:
    return hda.fly(hda.make_policy(name), hda.sample_scenario(preset, 0, episode, "tuning"))


def tilts(thrust: np.ndarray) -> np.ndarray:
    burning = thrust[np.linalg.norm(thrust, axis=1) > 0.0]
    return np.arccos(np.clip(burning[:, 2] / np.linalg.norm(burning, axis=1), -1.0, 1.0))


def random_interval(seed: int, lander: Lander) -> tuple[Segment, ZemZevCommand]:
    rng = np.random.default_rng(seed)
    height = rng.uniform(20.0, 900.0)
    offset = np.array([*rng.uniform(-0.5, 0.5, 2), 1.0]) * height
    sink = rng.uniform(0.3, 1.2) * height**0.5
    state = State(SITE + offset, np.array([*rng.uniform(-10, 10, 2), -sink]), 1200.0)
    command = ZemZevCommand(6.0, 2.0, time_to_go(state, SITE) * rng.uniform(0.8, 1.2))
    errors = FlightErrors(rng.uniform(-0.05, 0.05))
    return fly_over(
        state, Decision(SITE, command), lander, Surroundings(GRAVITY), ControlPeriods(0.5, 10), errors
    ), command


def nearest(law: np.ndarray, lander: Lander) -> np.ndarray:
    """Nearest admissible thrust for limits up to a right angle, by projecting on the cone's edge."""
    across, limit = math.hypot(law[0], law[1]), lander.pointing_limit
    assert limit is not None
    if math.atan2(across, law[2]) > limit:
        edge = np.array([*(math.sin(limit) * law[:2] / across), math.cos(limit)])
        law = max(float(law @ edge), lander.min_thrust) * edge
    size = float(np.linalg.norm(law))
    return law * (min(max(size, lander.min_thrust), lander.max_thrust) / size) if size else law


@settings(max_examples=60)
@given(seed=st.integers(0, 2**32 - 1), degrees=st.floats(2.0, 89.0), least=st.sampled_from([0.0, 1500.0]))
def test_every_period_holds_the_nearest_admissible_thrust_and_counts_where_the_limit_acted(
    seed, degrees, least
):
    lander = Lander(pointing_limit=math.radians(degrees), min_thrust=least)
    segment, command = random_interval(seed, lander)
    acted = 0
    for k, thrust in enumerate(segment.commanded):
        remaining = command.time_to_go - 0.5 * k
        if remaining <= 0.25:
            assert not thrust.any()
            continue
        now = State(segment.path[k, :3], segment.path[k, 3:6], float(segment.path[k, 6]))
        law = now.mass * zem_zev_acceleration(now, SITE, remaining)
        np.testing.assert_allclose(thrust, nearest(law, lander), rtol=1e-9, atol=1e-6)
        acted += math.atan2(math.hypot(law[0], law[1]), law[2]) > math.radians(degrees)
    assert segment.pointing_limited == acted
    assert tilts(segment.commanded).max(initial=0.0) <= math.radians(degrees) + SAME_ANGLE


@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=30)
def test_a_limit_that_nothing_exceeds_changes_no_bit(seed):
    free, _ = random_interval(seed, Lander())
    bound, _ = random_interval(seed, Lander(pointing_limit=math.pi))
    assert same(free, bound)
    assert free.pointing_limited == 0


@pytest.mark.parametrize("name", ["nearest-safe", "hazard-aware", "nearest-safe+convex", "td3"])
def test_ten_degrees_are_ten_degrees_and_can_be_landed_with(name):
    """These leant by 47, 179, 178 and 164 degrees, and were successes."""
    free = [fly(name, limited(None), episode) for episode in range(6)]
    assert max(record.maximum_tilt for record in free) > math.radians(30.0)
    assert sum(record.pointing_limited for record in free) == 0
    records = [fly(name, limited(10.0), episode) for episode in range(6)]
    for record in records:
        assert tilts(record.thrust).max() <= math.radians(10.0) + 1e-7
        assert record.maximum_tilt <= math.radians(10.0) + SAME_ANGLE
        assert record.pointing_limited == sum(segment.pointing_limited for segment in record.segments)
    assert sum(record.outcome.success for record in records) >= 5


@pytest.mark.parametrize("name", ["nearest-safe+convex", "td3"])
def test_the_limit_is_counted_when_it_acts(name):
    counts = [fly(name, limited(degrees), 3).pointing_limited for degrees in (None, 5.0)]
    assert counts[0] == 0
    assert counts[1] > 0


@pytest.mark.parametrize("degrees", [10.0, 30.0, 120.0])
def test_plans_leave_the_feedback_a_tenth_of_the_limit(degrees):
    record = fly("nearest-safe+convex", limited(degrees), 1)
    checked = 0
    for decision in record.decisions:
        if decision.status is DecisionStatus.NOMINAL:
            assert isinstance(decision.command, PlanCommand)
            push = decision.command.reference.thrust_acceleration
            felt = push[np.linalg.norm(push, axis=1) > 0.05]
            assert tilts(felt).max() <= math.radians(0.9 * degrees) + 2e-3
            checked += 1
    assert checked >= 5


def test_an_engine_that_cannot_stop_keeps_its_limit_too():
    for name in ("nearest-safe", "nearest-safe+convex"):
        record = fly(name, limited(20.0, min_thrust=1000.0), 0)
        burning = record.commanded_thrust[record.commanded_thrust.any(axis=1)]
        assert np.linalg.norm(burning, axis=1).min() >= 1000.0 * (1.0 - 1e-12)
        assert record.maximum_tilt <= math.radians(20.0) + SAME_ANGLE


def test_an_engine_that_never_burnt_leant_nowhere():
    record = fly("no-divert", limited(None), 0)
    still = replace(record.segments[0], commanded=np.full_like(record.segments[0].commanded, -0.0))
    assert replace(record, segments=(still,)).maximum_tilt == 0.0
