"""The landing is put off while no look has brought a map, and only then."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from guidance.rigid_body import DEFAULT_BODY
from hda.flight.episode import fly
from hda.flight.record import EpisodeRecord
from hda.policies.adjusted_descent import AdjustedDescent
from hda.policies.composition import ComposedPolicy
from hda.policies.hazard_aware import HazardAwareSite
from hda.policies.waiting_descent import WaitingDescent
from hda.policy import PlanCommand
from hda.sensing.lidar import Lidar
from hda.site_selection import NominalSite
from hda.task.presets import find_preset
from hda.task.random_streams import EpisodeStreams
from hda.task.scenario import Scenario, sample_scenario

DROPOUT = 0.6
BLANK = 4
"""Looks without a map at the start of the episodes flown."""


def scenario_of(episode: int, dropout: float) -> Scenario:
    paper = find_preset("paper")
    assert isinstance(paper.lidar, Lidar)
    return sample_scenario(replace(paper, lidar=replace(paper.lidar, dropout=dropout)), 0, episode, "tuning")


def blind_episodes(count: int) -> list[int]:
    """Episodes whose first looks bring no map."""

    def is_blind(episode: int) -> bool:
        streams = EpisodeStreams(0, episode)
        return all(streams.map_is_missing(look, DROPOUT) for look in range(BLANK))

    return [episode for episode in range(40 * count) if is_blind(episode)][:count]


def fly_law(scenario: Scenario, law: AdjustedDescent | WaitingDescent) -> EpisodeRecord:
    return fly(ComposedPolicy("test", HazardAwareSite(), law), scenario)


@pytest.mark.parametrize("dropout", [0.0, DROPOUT])
def test_with_a_map_from_the_first_look_it_flies_as_without_it(dropout: float) -> None:
    episode = next(k for k in range(20) if not EpisodeStreams(0, k).map_is_missing(0, DROPOUT))
    scenario = scenario_of(episode, dropout)
    plain, waiting = fly_law(scenario, AdjustedDescent()), fly_law(scenario, WaitingDescent())
    for one, other in zip(plain.segments, waiting.segments, strict=True):
        np.testing.assert_array_equal(one.path, other.path)


def test_blind_it_keeps_the_time_to_land_until_the_first_map_and_finds_ground_that_haste_misses() -> None:
    hasty = patient = 0
    episodes = blind_episodes(6)
    assert len(episodes) == 6
    for episode in episodes:
        scenario = scenario_of(episode, DROPOUT)
        record = fly_law(scenario, WaitingDescent())
        hasty += fly_law(scenario, AdjustedDescent()).outcome.success
        patient += record.outcome.success
        looks = [observation.has_map for observation in record.observations]
        seen = looks.index(True) if any(looks) else len(looks)
        left = [
            decision.command.reference.duration
            for decision in record.decisions[:seen]
            if isinstance(decision.command, PlanCommand)
        ]
        waited = [later for before, later in pairwise(left) if later == before]
        assert waited, f"episode {episode} never waited"
        assert all(time <= 20.0 + 5.0 for time in waited)
    assert patient >= hasty + 3  # two of the six see nothing within reach of the tank


def test_it_waits_no_longer_than_the_propellant_allows() -> None:
    scenario = scenario_of(blind_episodes(1)[0], DROPOUT)
    record = fly_law(scenario, WaitingDescent(reserve=1.0))
    plain = fly_law(scenario, AdjustedDescent())
    np.testing.assert_array_equal(record.segments[-1].path, plain.segments[-1].path)


@pytest.mark.parametrize("reserve", [0.2, 0.3, 0.4])
def test_a_wait_comes_to_the_gate_with_its_reserve_and_one_more_would_not(reserve: float) -> None:
    paper = find_preset("paper")
    assert isinstance(paper.lidar, Lidar)
    sightless, exact = replace(paper.lidar, dropout=1.0), replace(paper.rules, thrust_error=0.0)
    scenario = sample_scenario(replace(paper, lidar=sightless, rules=exact), 0, 1, "tuning")
    law = WaitingDescent(reserve=reserve)
    record = fly(ComposedPolicy("test", NominalSite(), law), scenario)
    view, options = scenario.view, law.adjusted.planned.options
    left = [
        decision.command.reference.duration
        for decision in record.decisions
        if isinstance(decision.command, PlanCommand)
    ]
    assert len(left) == len(record.decisions)
    last = max(look for look in range(1, len(left)) if left[look] == left[look - 1])
    tank = [observation.state.mass - view.lander.dry_mass for observation in record.observations]
    landed, gravity = record.segments[-1].final_state.mass, float(np.linalg.norm(view.gravity))
    last_burn = options.terminal_periods * view.control_period * (options.terminal_deceleration + gravity)
    at_gate = landed * math.exp(last_burn / view.lander.exhaust_velocity) - view.lander.dry_mass
    assert at_gate >= reserve * tank[last]
    hovering = landed * gravity * view.decision_interval / view.lander.exhaust_velocity
    assert at_gate - hovering < reserve * tank[last + 1]  # to fall as much longer costs as much


def test_a_wait_that_means_nothing_is_named() -> None:
    with pytest.raises(ValueError, match="look_time"):
        WaitingDescent(look_time=-0.1)
    with pytest.raises(ValueError, match="reserve"):
        WaitingDescent(reserve=1.1)


def test_a_body_never_flies_the_later_plan_of_a_point_mass() -> None:
    """Blind, with less than `look_time` to go, it goes on as planned: smoothly, as far as it had to go."""
    scenario = scenario_of(blind_episodes(1)[0], DROPOUT)
    flown = replace(scenario, preset=replace(scenario.preset, name="with-a-body", body=DEFAULT_BODY))
    plain, waiting = fly_law(flown, AdjustedDescent()), fly_law(flown, WaitingDescent())
    for one, other in zip(plain.segments, waiting.segments, strict=True):
        np.testing.assert_array_equal(one.path, other.path)
    assert len(fly_law(scenario, WaitingDescent()).segments) > len(
        fly_law(scenario, AdjustedDescent()).segments
    )
