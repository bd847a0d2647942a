"""Errors of the estimated state and looks without a map: off by default, and physics where they are on."""

from __future__ import annotations

from dataclasses import fields, replace
from functools import cached_property

import numpy as np
import pytest

import hda
from hda.flight.episode import fly
from hda.sensing.lidar import Lidar
from hda.task.random_streams import EpisodeStreams
from hda.task.rules import Rules
from hda.task.scenario import Scenario


def with_errors(scenario: Scenario, position: float, velocity: float, dropout: float = 0.0) -> Scenario:
    preset = scenario.preset
    rules = replace(
        preset.rules,
        thrust_error=0.0,
        control_period=0.1,
        navigation_position_error=position,
        navigation_velocity_error=velocity,
    )
    return replace(
        scenario, preset=replace(preset, rules=rules, lidar=replace(preset.lidar, dropout=dropout))
    )


class WithError(Scenario):
    """A scenario whose navigation error is chosen."""

    error: np.ndarray

    @cached_property
    def navigation_error(self) -> np.ndarray:
        return self.error


def chosen_error(scenario: Scenario, error: np.ndarray) -> WithError:
    flown = WithError(**{field.name: getattr(scenario, field.name) for field in fields(scenario)})
    object.__setattr__(flown, "error", error)
    return flown


@pytest.fixture(scope="module")
def scenarios() -> list[Scenario]:
    return [hda.sample_scenario("paper", 4, episode) for episode in range(4)]


def test_draws_have_the_stated_size_and_are_one_for_the_episode():
    draws = np.array([EpisodeStreams(0, k).navigation_error(3.0, 0.2) for k in range(4000)])
    # 4 standard errors of a standard deviation over 12 000 draws: 1 / sqrt(24 000) = 0.65 % each
    np.testing.assert_allclose(draws.std(axis=0), [3.0] * 3 + [0.2] * 3, rtol=4 * 0.0112)
    assert np.abs(draws.mean(axis=0) / draws.std(axis=0)).max() < 5 / np.sqrt(4000)
    np.testing.assert_array_equal(draws[7], EpisodeStreams(0, 7).navigation_error(3.0, 0.2))


def test_the_new_draws_leave_the_looks_alone(scenarios):
    plain, noisy = scenarios[0].streams, scenarios[0].streams
    noisy.navigation_error(1.0, 1.0)
    noisy.map_is_missing(0, 0.5)
    np.testing.assert_array_equal(plain.look(0, 64), noisy.look(0, 64))


def test_a_policy_sees_the_estimate_and_the_record_keeps_the_truth(scenarios):
    scenario = with_errors(scenarios[0], 2.0, 0.1)
    record = fly(hda.make_policy("single-divert"), scenario)
    error = scenario.navigation_error
    assert np.abs(error).min() > 0.0
    for observation, segment in zip(record.observations, record.segments, strict=True):
        seen = np.concatenate([observation.state.position, observation.state.velocity])
        np.testing.assert_allclose(seen - segment.path[0, :6], error, atol=1e-9)


def test_an_error_of_the_velocity_shows_at_touchdown(scenarios):
    """A closed form: with v estimated as v + b, the law holds still at v = (K_R - K_V) / K_V b, here 2 b.

    With r - r_f = c t_go, so v = -c, no thrust is asked for where K_R c = (K_R - K_V) (c - b).
    """
    policy = hda.make_policy("no-divert")
    for scenario in scenarios:
        error = np.array([0, 0, 0, 1, 1, 0]) * with_errors(scenario, 0.0, 0.05).navigation_error
        velocity = fly(policy, chosen_error(with_errors(scenario, 0.0, 0.0), error)).velocity[-1, :2]
        without = fly(policy, with_errors(scenario, 0.0, 0.0)).velocity[-1, :2]
        np.testing.assert_allclose(velocity - without, 2.0 * error[3:5], atol=0.01)


def test_a_horizontal_error_of_position_only_moves_the_first_target(scenarios):
    """Looks are relative to the lander, so the flight is that to the moved target."""
    for scenario in scenarios:
        flown = with_errors(scenario, 3.0, 0.0)
        error = flown.navigation_error * np.array([1, 1, 0, 0, 0, 0])
        flown = chosen_error(flown, error)
        moved = with_errors(replace(scenario, nominal_target=scenario.nominal_target - error[:3]), 0.0, 0.0)
        policy = hda.make_policy("nearest-safe")
        one, other = fly(policy, flown), fly(policy, moved)
        np.testing.assert_allclose(one.path, other.path, atol=1e-6)
        assert one.outcome.miss_distance == pytest.approx(other.outcome.miss_distance, abs=1e-6)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_looks_come_without_a_map_as_often_as_asked(scenarios, share):
    missing = [EpisodeStreams(1, k).map_is_missing(j, share) for k in range(500) for j in range(8)]
    assert np.mean(missing) == pytest.approx(share, abs=5 * 0.5 / np.sqrt(4000))
    record = fly(hda.make_policy("no-divert"), with_errors(scenarios[1], 0.0, 0.0, share))
    empty = [not observation.safety_map.any() for observation in record.observations]
    streams = scenarios[1].streams
    assert empty == [streams.map_is_missing(k, share) for k in range(len(empty))]


@pytest.mark.parametrize("name", ["navigation_position_error", "navigation_velocity_error"])
def test_a_negative_error_is_refused(name):
    with pytest.raises(ValueError, match=name):
        replace(Rules(), **{name: -1.0})


@pytest.mark.parametrize("bad", [-0.1, 1.1, float("nan")])
def test_a_share_outside_its_bounds_is_refused(bad):
    with pytest.raises(ValueError, match="dropout"):
        Lidar(dropout=bad)
