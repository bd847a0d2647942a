"""What every registered policy owes: the seam's promises, tested on whatever the registry holds."""

import copy
import importlib
import math
import pickle
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import hda
from hda.flight.episode import Flight, Step, advance, begin_flight, fly, observe
from hda.flight.record import EpisodeRecord
from hda.policy import Decision, DecisionStatus, PlanCommand, Policy, PrivilegedPolicy, ZemZevCommand
from hda.registry import policy_entry
from hda.safety.touchdown_stance import contact_height
from hda.task.observation import Observation
from hda.task.scenario import Scenario, ground_point
from tests.equality import parts, same

importlib.import_module("rl")  # adds the agents

PLANE = 50.0


def names() -> list[Any]:
    """Every registered policy; those that take long only in the slow suite."""
    return [
        pytest.param(name, marks=pytest.mark.slow) if policy_entry(name).slow else name
        for name in hda.policy_names()
    ]


pytestmark = pytest.mark.parametrize("name", names())


@pytest.fixture(scope="module")
def scenarios() -> list[Scenario]:
    """Twenty starts: by map, by measured looks, on hard ground, with few rays, by a filter, a rigid body."""
    presets = ("paper", "lidar", "hard", "lidar-coarse", "navigated", "rigid-body")
    return [hda.sample_scenario(presets[k % 6], 17, k) for k in range(20)]


def pilot(name: str, scenario: Scenario) -> Policy[Any]:
    """The policy as `fly` calls it."""
    policy = hda.make_policy(name)
    return policy.informed(scenario) if isinstance(policy, PrivilegedPolicy) else policy


class Journey:
    """One episode flown step by step."""

    def __init__(self, policy: Policy[Any], scenario: Scenario) -> None:
        self.policy, self.scenario = policy, scenario
        self.memory: Any = policy.begin(scenario.view, scenario.streams.policy())
        self.flight: Flight = begin_flight(scenario)
        self.steps: list[Step] = []
        self.decisions: list[Decision] = []

    @property
    def over(self) -> bool:
        return bool(self.steps) and self.steps[-1].outcome is not None

    def look(self) -> Observation:
        return observe(self.scenario, self.flight)

    def go(self) -> None:
        decision, self.memory = self.policy.decide(self.look(), self.memory)
        self.decisions.append(decision)
        self.steps.append(advance(self.scenario, self.flight, decision))
        self.flight = self.steps[-1].flight


def assert_same_flight(journey: Journey, record: EpisodeRecord) -> None:
    assert same(tuple(journey.decisions), record.decisions)
    assert same(tuple(step.segment for step in journey.steps), record.segments)
    assert same(journey.steps[-1].outcome, record.outcome)


def test_it_satisfies_the_protocol_under_its_own_name(name):
    policy = hda.make_policy(name)
    entry = policy_entry(name)
    assert policy.name == name == entry.name
    assert isinstance(policy, PrivilegedPolicy) == entry.privileged
    if isinstance(policy, PrivilegedPolicy):
        assert policy.privileged is True
        assert not isinstance(policy, Policy)  # without the truth it cannot fly
    else:
        assert isinstance(policy, Policy)
    assert entry.summary
    assert name == name.lower()


def test_the_informed_policy_keeps_the_name(name, scenarios):
    informed = pilot(name, scenarios[0])
    assert isinstance(informed, Policy)
    assert informed.name == name


def test_a_decision_is_a_pure_function_of_observation_and_memory(name, scenarios):
    for scenario in scenarios[:2]:
        journey = Journey(pilot(name, scenario), scenario)
        while not journey.over:
            observation, memory = journey.look(), journey.memory
            seen, remembered = copy.deepcopy(observation), copy.deepcopy(memory)
            first = journey.policy.decide(observation, memory)
            assert same(observation, seen), "it changed the observation"
            assert same(memory, remembered), "it changed the memory"
            second = journey.policy.decide(seen, remembered)
            other_object = pilot(name, scenario).decide(observation, memory)
            assert same(first, second)
            assert same(first, other_object), "the object remembers something"
            journey.go()
            assert same(journey.decisions[-1], first[0])


def test_it_starts_the_same_however_often_it_begins(name, scenarios):
    policy = pilot(name, scenarios[0])
    view = scenarios[0].view
    first = policy.begin(view, scenarios[0].streams.policy())
    assert same(policy.begin(view, scenarios[0].streams.policy()), first)
    assert same(view, scenarios[0].view), "it changed the view"


def arrays_in(value: Any, seen: set[int] | None = None) -> Iterator[np.ndarray]:
    """Every array that can be reached from a value."""
    seen = set() if seen is None else seen
    if id(value) in seen or isinstance(value, str | bytes | int | float | type(None)):
        return
    seen.add(id(value))
    if isinstance(value, np.ndarray):
        yield value
        if value.base is not None:
            yield from arrays_in(value.base, seen)
        return
    for part in parts(value):
        assert not isinstance(part, hda.Tile), "the tile itself"
        yield from arrays_in(part, seen)


def test_it_never_sees_the_tile_unless_it_is_privileged(name, scenarios):
    """What it is given, and what it keeps: no array of the tile's shape or memory."""
    scenario = scenarios[1]
    tile = scenario.tile
    truth = [tile.elevation, tile.probability, tile.deterministic]
    journey = Journey(pilot(name, scenario), scenario)
    given: list[Any] = [scenario.view]
    kept: list[Any] = []
    while not journey.over:
        given.append(journey.look())
        kept += [journey.memory]
        journey.go()
    reached = list(arrays_in(given if policy_entry(name).privileged else [*given, *kept, journey.policy]))
    assert len(reached) > 10
    for array in reached:
        assert array.shape != tile.elevation.shape
        assert not any(np.may_share_memory(array, layer) for layer in truth)


def test_two_episodes_in_turns_are_the_same_as_one_after_the_other(name, scenarios):
    policy = hda.make_policy(name)
    pair = scenarios[2:4]
    records = [fly(policy, scenario) for scenario in pair]
    if isinstance(policy, PrivilegedPolicy):
        journeys = [Journey(policy.informed(scenario), scenario) for scenario in pair]
    else:
        journeys = [Journey(policy, scenario) for scenario in pair]
    while not all(journey.over for journey in journeys):
        for journey in journeys:
            if not journey.over:
                journey.go()
    for journey, record in zip(journeys, records, strict=True):
        assert_same_flight(journey, record)


def test_it_can_be_sent_to_a_worker_by_name_and_as_itself(name, scenarios):
    make = pickle.loads(pickle.dumps(partial(hda.make_policy, name)))
    sent = pickle.loads(pickle.dumps(hda.make_policy(name)))
    home = fly(hda.make_policy(name), scenarios[4])
    for policy in (make(), sent):
        away = fly(policy, scenarios[4])
        assert same(away.decisions, home.decisions)
        assert same(away.segments, home.segments)


def test_it_decides_legally_from_any_start(name, scenarios):
    policy = hda.make_policy(name)
    for scenario in scenarios:
        record = fly(policy, scenario)
        assert record.policy == name
        assert 1 <= len(record.decisions) <= scenario.preset.rules.max_decisions
        for observation, decision in zip(record.observations, record.decisions, strict=True):
            assert decision.site.shape == (3,)
            assert np.isfinite(decision.site).all()
            assert scenario.preset.stance is not None or decision.site[2] == pytest.approx(PLANE, abs=1e-6)
            assert isinstance(decision.command, ZemZevCommand | PlanCommand)
            assert isinstance(decision.status, DecisionStatus)
            assert math.isfinite(observation.time_to_go)
            assert observation.time_to_go > 0.0
        assert np.isfinite(record.path).all()
        assert np.isfinite(record.thrust).all()
        assert record.fallbacks == sum(d.status is not DecisionStatus.NOMINAL for d in record.decisions)


def test_it_decides_legally_where_nothing_and_where_everything_looks_safe(name, scenarios):
    scenario = scenarios[5]
    policy = pilot(name, scenario)
    for level in (0.0, 1.0):
        observation = observe(scenario, begin_flight(scenario))
        flat = replace(observation, safety_map=np.full_like(observation.safety_map, level))
        memory = policy.begin(scenario.view, scenario.streams.policy())
        decision, _ = policy.decide(flat, memory)
        assert np.isfinite(decision.site).all()
        lowest, highest = scenario.tile.elevation.min() - 1.0, scenario.tile.elevation.max() + 1.0
        assert lowest < decision.site[2] < highest


def count_measured_pads(observation: Observation, decision: Decision) -> int:
    """Pads of the lander on its site whose ground this look measured."""
    if observation.ground is None or observation.stance is None:
        return 0
    return observation.ground.site_height(observation.stance, *map(float, decision.site[:2]))[1]


def test_on_real_ground_it_flies_to_the_ground_that_was_measured(name, scenarios):
    """Within two metres of where the lander would touch at its last site, and never the plane by default.

    A policy that keeps its sites out of the sensor's reach from the second look on has no height to fly to.
    """
    for scenario in (scenarios[1], *scenarios[3:6]):
        record = fly(hda.make_policy(name), scenario)
        if not any(map(count_measured_pads, record.observations[1:], record.decisions[1:])):
            assert name == "td3-belief-partial"  # which learnt without a sensor's reach
            continue
        site = ground_point(scenario, record.decisions[-1].site)
        assert scenario.footing is not None
        contact = contact_height(scenario.footing, float(site[0]), float(site[1]))
        assert abs(site[2] - contact) < 2.0
        assert record.outcome.report is not None
        touchdown = record.outcome.touchdown
        height = contact_height(scenario.footing, float(touchdown[0]), float(touchdown[1]))
        assert touchdown[2] == pytest.approx(height, abs=1e-5)


def test_thrust_errors_and_noise_of_an_episode_are_its_own_not_the_policys(name, scenarios):
    record = fly(hda.make_policy(name), scenarios[6])
    reference = fly(hda.make_policy("no-divert"), scenarios[6])
    for mine, theirs in zip(record.segments, reference.segments, strict=False):
        assert mine.thrust_error == theirs.thrust_error
    assert same(record.observations[0], reference.observations[0])


def test_it_never_leans_beyond_the_landers_pointing_limit(name, scenarios):
    policy, limit = hda.make_policy(name), math.radians(20.0)
    for scenario in scenarios[7:9]:
        lander = replace(scenario.preset.lander, pointing_limit=limit)
        record = fly(policy, replace(scenario, preset=replace(scenario.preset, lander=lander)))
        assert record.maximum_tilt <= limit + 1e-9
