"""What an action becomes where the site alone is the action, and convex guidance flies to it."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as gymnasium_check
from hypothesis import given, settings
from hypothesis import strategies as st
from stable_baselines3.common.env_checker import check_env as sb3_check

import hda
import rl  # noqa: F401 - registers the environments
from hda.flight.episode import begin_flight, fly, observe
from hda.policies.adjusted_descent import AdjustedDescent
from hda.policies.composition import ComposedPolicy
from hda.policy import PlanCommand
from hda.task.scenario import sample_scenario
from rl.environment.action import ActionRanges
from rl.environment.env import LunarHDAEnv
from rl.environment.native.vector_env import LunarHDAVectorEnv
from rl.environment.steering import SiteSteering, make_steering


class KeepSite:
    """Never moves the target."""

    def begin(self, view: Any) -> None:
        return None

    def select(self, observation: Any, memory: None) -> tuple[np.ndarray, None]:
        return observation.target, None


class ListedSites:
    """Goes to listed sites, one a look."""

    def __init__(self, sites: list[np.ndarray]) -> None:
        self.sites = sites

    def begin(self, view: Any) -> int:
        return 0

    def select(self, observation: Any, memory: int) -> tuple[np.ndarray, int]:
        return self.sites[memory], memory + 1


def rollout(env: LunarHDAEnv, scenario: Any, actions: np.ndarray) -> tuple[list[float], list[Any]]:
    env.reset(options={"scenario": scenario})
    rewards, over, k = [], False, 0
    while not over:
        _, reward, terminated, truncated, _ = env.step(actions[k])
        rewards.append(reward)
        over, k = terminated or truncated, k + 1
    return rewards, env.steps


@pytest.mark.parametrize("preset", ["paper", "partial", "lidar"])
def test_a_still_agent_flies_the_plan_to_the_first_target(preset):
    """The environment holds the law's plan between decisions, as a policy's memory does."""
    scenario = sample_scenario(preset, 6, 1, "train")
    record = fly(ComposedPolicy("still", KeepSite(), AdjustedDescent()), scenario)
    env = LunarHDAEnv(preset, guidance="convex")
    assert env.action_space.shape == (2,)
    rewards, steps = rollout(env, scenario, np.zeros((20, 2), np.float32))
    assert rewards == [reward.total for reward in record.rewards]
    for step, segment in zip(steps, record.segments, strict=True):
        np.testing.assert_array_equal(step.segment.final_state.as_array(), segment.final_state.as_array())
    assert all(isinstance(decision.command, PlanCommand) for decision in record.decisions)


@settings(max_examples=8)
@given(study=st.integers(0, 50), seed=st.integers(0, 1000))
def test_any_actions_fly_as_a_policy_that_goes_to_their_sites(study, seed):
    scenario = sample_scenario("paper", study, 0, "train")
    actions = np.random.default_rng(seed).uniform(-1.0, 1.0, (20, 2)).astype(np.float32)
    rewards, steps = rollout(LunarHDAEnv(guidance="convex"), scenario, actions)
    sites = [step.flight.target for step in steps]
    record = fly(ComposedPolicy("listed", ListedSites(sites), AdjustedDescent()), scenario)
    assert rewards == [reward.total for reward in record.rewards]


@given(
    east=st.floats(-3.0, 3.0),
    north=st.floats(-3.0, 3.0),
    shift=st.floats(0.05, 0.5),
)
def test_the_site_moves_by_a_share_of_the_width_or_not_at_all(east, north, shift):
    """Less than half of a pixel, one of 64 along each side, is no move."""
    scenario = sample_scenario("paper", 3, 0, "train")
    look = observe(scenario, begin_flight(scenario))
    steering = SiteSteering(ActionRanges(shift=shift), law=Unmoved())
    site = steering.decide(np.array([east, north]), look, None)[0].site
    moved = np.clip([east, north], -1.0, 1.0) * shift * look.width
    if np.abs(moved).max() < look.width / 128.0:
        moved[:] = 0.0
    np.testing.assert_allclose(site - look.target, [*moved, 0.0], atol=1e-9)


class Unmoved:
    """A law whose command does not depend on the site."""

    def begin(self, view: Any) -> None:
        return None

    def command(self, observation: Any, site: np.ndarray, memory: None) -> Any:
        return hda.ZemZevCommand(6.0, 2.0, 10.0), hda.DecisionStatus.NOMINAL, None


def test_a_still_agent_burns_less_than_by_zem_zev():
    """In each of ten starts. To the same place least propellant is what convex guidance asks for."""
    burnt = {"convex": [], "zem-zev": []}
    for guidance, values in burnt.items():
        env = LunarHDAEnv(guidance=guidance)
        for episode in range(10):
            scenario = sample_scenario("paper", 1, episode, "train")
            still = np.zeros((20, env.steering.size), np.float32)
            _, steps = rollout(env, scenario, still)
            values.append(scenario.initial_state.mass - steps[-1].flight.state.mass)
    assert np.all(np.array(burnt["convex"]) < np.array(burnt["zem-zev"]))


@pytest.mark.parametrize("name", ["LunarHDA-Site-v0", "LunarHDA-Belief-v0"])
def test_checkers_are_content(name):
    gymnasium_check(gymnasium.make(name).unwrapped, skip_render_check=True)
    sb3_check(gymnasium.make(name))


@pytest.mark.parametrize("name", ["LunarHDA-Site-v0", "LunarHDA-Belief-v0"])
def test_gymnasium_makes_vectors_of_them(name):
    vector = gymnasium.make_vec(name, num_envs=2, vectorization_mode="sync")
    alone = gymnasium.make(name)
    seen, _ = vector.reset(seed=4)
    np.testing.assert_array_equal(seen[0], alone.reset(seed=4)[0])
    action = np.full_like(alone.action_space.sample(), 0.3)
    np.testing.assert_array_equal(vector.step(np.stack([action] * 2))[0][0], alone.step(action)[0])
    vector.close()


@pytest.mark.parametrize("options", [{"guidance": "convex"}, {"sight": "belief"}])
def test_the_native_batch_refuses_what_it_does_not_serve(options):
    with pytest.raises(ValueError, match="LunarHDA-Belief-v0 and LunarHDA-Site-v0 have vectors"):
        LunarHDAVectorEnv(2, **options)


def test_unknown_names_are_refused():
    with pytest.raises(ValueError, match="unknown guidance 'convx'; did you mean convex"):
        make_steering("convx")
    with pytest.raises(ValueError, match="unknown sight 'beleif'; did you mean belief"):
        LunarHDAEnv(sight="beleif")


@pytest.mark.parametrize("action", [np.zeros(5), np.array([np.nan, 0.0]), np.zeros((1, 2))])
def test_actions_of_another_shape_are_refused(action):
    env = LunarHDAEnv(guidance="convex")
    env.reset(seed=0)
    with pytest.raises(ValueError, match="action must"):
        env.step(action)
