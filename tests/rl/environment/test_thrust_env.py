"""The environment whose action is the thrust: against other flights, its native vector, and its policy."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as gymnasium_check
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.axes import Axes
from stable_baselines3.common.env_checker import check_env as sb3_check

import rl  # noqa: F401 - registers the environments
from guidance.zem_zev import zem_zev_acceleration
from hda.flight.episode import begin_flight, fly, observe
from hda.registry import make_policy
from hda.task.presets import PRESETS
from hda.task.scenario import sample_scenario
from rl.environment.dispersions import Dispersions
from rl.environment.native.vector_snapshot import restore_snapshot, take_snapshot
from rl.environment.thrust.thrust_action import REACH, thrust_acceleration
from rl.environment.thrust.thrust_env import LunarHDAThrustEnv
from rl.environment.thrust.thrust_vector_env import LunarHDAThrustVectorEnv
from rl.inference.artefacts import Artefact
from rl.inference.networks import Perceptron
from rl.policies.actor import actor_from_artefact
from rl.policies.thrust_actor import ThrustActor
from rl.recipes import RECIPES
from rl.training.actor_export import actor_card
from tests.equality import same
from tests.rl.lanes import Lane

STILL = Dispersions(thrust_error=0.0).applied(PRESETS["paper"])


def draw(rng: np.random.Generator, count: int) -> np.ndarray:
    return (0.3 * rng.normal(size=(count, 5))).clip(-1.0, 1.0).astype(np.float32)


@pytest.mark.parametrize("preset", ["paper", "partial"])
def test_rows_of_the_native_vector_equal_single_environments(preset):
    count, rng, ends = 3, np.random.default_rng(1), 0
    vector = LunarHDAThrustVectorEnv(count, preset=preset)
    lanes = [Lane(LunarHDAThrustEnv(preset), k, count, 5) for k in range(count)]
    seen, _ = vector.reset(seed=5)
    assert same(seen, np.stack([lane.reset()[0] for lane in lanes]))
    for _ in range(160):
        actions = draw(rng, count)
        seen, rewards, terminated, truncated, info = vector.step(actions)
        for k, lane in enumerate(lanes):
            own, reward, over, cut, told = lane.step(actions[k])
            assert (reward, over, cut) == (rewards[k], terminated[k], truncated[k])
            if over or cut:
                ends += 1
                assert same(info["final_obs"][k], own)
                assert info["final_info"]["ending"][k] == told["ending"]
                own, told = lane.reset()
            assert same(seen[k], own)
            assert info["speed"][k] == told["speed"]
            assert info["pointing_limited"][k] == told["pointing_limited"]
    assert ends >= count


@pytest.mark.parametrize("episode", range(4))
def test_thrusts_of_zem_zev_land_as_its_command_does(episode):
    """`no-divert` is flown by another kernel, which evaluates the law itself. Actions are float32."""
    scenario = sample_scenario("paper", 9, episode, "train")
    record = fly(make_policy("no-divert"), scenario)
    env, over, k = LunarHDAThrustEnv(), False, 0
    env.reset(options={"scenario": scenario})
    gravity, period = np.array(scenario.preset.gravity), scenario.preset.rules.control_period
    clock, target = 0.0, scenario.nominal_target
    while not over:
        state = scenario.initial_state if not env.steps else env.steps[-1].flight.state
        if k % 10 == 0:  # a vehicle that falls freely takes no look here
            looks = record.observations
            clock = looks[k // 10].time_to_go if k // 10 < len(looks) else 0.0
        left = clock - period * (k % 10)
        action = np.zeros(5, np.float32)
        asked = np.zeros(3)
        if left > 0.5 * period:
            asked = zem_zev_acceleration(state, target, left, (6.0, 2.0), gravity=gravity)
        action[:3] = (asked + gravity) / REACH
        assert np.abs(action).max() <= 1.0
        _, _, terminated, truncated, _ = env.step(action)
        over, k = terminated or truncated, k + 1
    assert env.outcome is not None
    np.testing.assert_allclose(env.outcome.touchdown, record.outcome.touchdown, atol=0.01)
    assert env.outcome.ending is record.outcome.ending
    total = sum(step.reward.total for step in env.steps)
    assert total == pytest.approx(record.total_reward, abs=1e-3)


def test_no_action_holds_the_velocity():
    env = LunarHDAThrustEnv(STILL)
    env.reset(seed=2)
    for _ in range(5):
        assert env.scenario is not None
        before = env.steps[-1].flight.state if env.steps else env.scenario.initial_state
        env.step(np.zeros(5, np.float32))
        after = env.steps[-1].flight.state
        np.testing.assert_allclose(after.velocity, before.velocity, atol=2e-4)


@given(seed=st.integers(0, 1000))
def test_the_acceleration_asked_for_is_linear_in_the_action(seed):
    gravity = np.array([0.0, 0.0, -1.62])
    actions = np.random.default_rng(seed).uniform(-1.0, 1.0, (4, 5))
    asked = thrust_acceleration(actions, gravity)
    np.testing.assert_allclose(asked + gravity, REACH * actions[:, :3], atol=1e-12)


def test_looks_are_taken_every_ten_periods_and_the_target_moves_at_them_alone():
    env = LunarHDAThrustEnv()
    seen, _ = env.reset(seed=3)
    assert env.scenario is not None
    latent, target = seen[12:44], env.scenario.nominal_target
    for k in range(1, 25):
        seen, *_ = env.step(np.array([0.0, 0.0, 0.1, 0.5, -0.25], np.float32))
        assert seen[44] == np.float32(k % 10 / 10)
        moved = env.steps[-1].flight.target - target
        if k % 10 == 1:  # the action was taken at a look
            assert moved[0] > 0.0 > moved[1]
            assert seen[45:] == pytest.approx([-0.125, 0.0625], abs=1e-6)
        else:
            assert not moved.any()
        assert np.array_equal(seen[12:44], latent) == (k % 10 != 0)
        latent, target = seen[12:44], env.steps[-1].flight.target


@settings(max_examples=6)
@given(before=st.integers(0, 40), study=st.sampled_from([5, 2**70 + 3]))
def test_flights_that_were_kept_between_two_looks_go_on_to_the_same_bit(before, study):
    count, rng = 2, np.random.default_rng(before)
    first, second = (LunarHDAThrustVectorEnv(count, preset="partial") for _ in range(2))
    seen, _ = first.reset(seed=study)
    for _ in range(before):
        seen = first.step(draw(rng, count))[0]
    assert same(restore_snapshot(second, study, take_snapshot(first)), seen)
    for _ in range(25):
        actions = draw(rng, count)
        assert same(first.step(actions), second.step(actions))


def small_actor(scale: float) -> tuple[ThrustActor, Perceptron]:
    rng = np.random.default_rng(4)
    tensors = {
        "layer.0.weight": rng.normal(0.0, scale, (47, 8)).astype(np.float32),
        "layer.0.bias": np.zeros(8, np.float32),
        "layer.1.weight": rng.normal(0.0, scale, (8, 5)).astype(np.float32),
        "layer.1.bias": np.array([0.0, 0.0, 0.05, 0.3, -0.2], np.float32),
    }
    recipe = replace(RECIPES["ppo-thrust"], hidden=(8,))
    actor = actor_from_artefact(Artefact("actor", tensors, actor_card(recipe)), Path("small"))
    assert isinstance(actor, ThrustActor)
    return actor, actor.network


def test_the_foretold_period_after_the_next_look_repeats_the_action_before_it():
    """The actor pushes harder as its look grows old; a look that it has not seen does not make it young."""
    actor, network = small_actor(0.0)
    weights = [np.zeros_like(weight) for weight, _ in network.layers]
    weights[0][44, 0], weights[1][0, 2] = 1.0, 0.1  # of the age; of the push upwards
    layers = tuple((weight, bias) for weight, (_, bias) in zip(weights, network.layers, strict=True))
    actor = replace(actor, network=Perceptron(layers))
    scenario = sample_scenario(STILL, 3, 0, "train")
    look = observe(scenario, begin_flight(scenario))
    states, _ = actor.foretell(look, scenario.view, look.time_to_go)
    assert len(states) == scenario.view.control_periods + 2
    climbs = np.diff(states[:, 5])
    assert np.all(np.diff(climbs[:-1]) > 0.01)
    assert climbs[-1] == pytest.approx(climbs[-2], abs=1e-3)


class Flown:
    """The actor as a policy."""

    name = "flown"

    def __init__(self, actor: ThrustActor) -> None:
        self.actor = actor

    def begin(self, scenario_view: Any, rng: Any) -> Any:
        return self.actor.begin(scenario_view)

    def decide(self, observation: Any, memory: Any) -> Any:
        return self.actor.decide(observation, memory)


@pytest.mark.parametrize("scale", [0.0, 0.1])
@pytest.mark.parametrize("episode", range(2))
def test_with_an_engine_that_does_not_err_the_policy_flies_what_the_agent_does(scale, episode):
    """States agree at every look: what the policy foretells is what happens in the environment."""
    scenario = sample_scenario(STILL, 3, episode, "train")
    actor, network = small_actor(scale)
    record = fly(Flown(actor), scenario)
    env, over = LunarHDAThrustEnv(STILL), False
    seen, _ = env.reset(options={"scenario": scenario})
    looks = []
    while not over:
        if seen[44] == 0.0:
            looks.append(env.steps[-1].flight.state if env.steps else scenario.initial_state)
        seen, _, terminated, truncated, _ = env.step(np.clip(network.evaluate(seen), -1.0, 1.0))
        over = terminated or truncated
    assert len(looks) == len(record.observations) > 2
    for state, look in zip(looks, record.observations, strict=True):
        np.testing.assert_allclose(look.state.as_array(), state.as_array(), atol=0.02)
    assert env.outcome is not None
    np.testing.assert_allclose(env.outcome.touchdown, record.outcome.touchdown, atol=0.1)
    assert env.outcome.ending is record.outcome.ending


def test_a_picture_between_looks_shows_this_instant(monkeypatch):
    titles, crosses = [], []

    def set_title(axes: Axes, text: str) -> None:
        titles.append(text)

    def plot(axes: Axes, *arguments: Any, **options: Any) -> None:
        if str(arguments[-1]) == "+":
            crosses.append(arguments[:2])

    monkeypatch.setattr(Axes, "set_title", set_title)
    monkeypatch.setattr(Axes, "plot", plot)
    env = LunarHDAThrustEnv(render_mode="rgb_array")
    scenario = sample_scenario("paper", 3, 0, "train")
    env.reset(options={"scenario": scenario})
    for k in range(12):
        titles.clear()
        crosses.clear()
        env.render()
        flight = env.steps[-1].flight if env.steps else None
        state = flight.state if flight else scenario.initial_state
        target = flight.target if flight else scenario.nominal_target
        height = state.position[2] - target[2]
        assert titles[0] == f"true safety; t = {0.5 * k:g} s, {height:.0f} m above the target"
        np.testing.assert_allclose(crosses[0], target[:2])
        assert (np.array(crosses[1]) == 0.0).all() == (k % 10 == 0)  # the look lies where it was taken
        env.step(np.array([0.0, 0.0, 0.1, 0.5, -0.25], np.float32))


def test_checkers_are_content_and_vectors_are_native():
    gymnasium_check(gymnasium.make("LunarHDA-Thrust-v0").unwrapped, skip_render_check=True)
    sb3_check(gymnasium.make("LunarHDA-Thrust-v0"))
    vector = gymnasium.make_vec("LunarHDA-Thrust-v0", num_envs=2, max_episode_steps=12)
    assert isinstance(vector, LunarHDAThrustVectorEnv)
    vector.reset(seed=0)
    cut = [vector.step(np.zeros((2, 5), np.float32))[3].all() for _ in range(12)]
    assert cut == [False] * 11 + [True]


@pytest.mark.parametrize("preset", ["lidar", "navigated"])
def test_other_presets_are_refused(preset):
    with pytest.raises(ValueError, match="preset must have looks by Algorithm 2"):
        LunarHDAThrustEnv(preset)


def test_bad_actions_and_steps_out_of_turn_are_refused():
    env = LunarHDAThrustEnv()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(5, np.float32))
    env.reset(seed=0)
    for action in (np.zeros(3, np.float32), np.full(5, np.nan, np.float32)):
        with pytest.raises(ValueError, match="action must"):
            env.step(action)
