"""Stable-Baselines3 learns on the native vector environments, from the transitions that they really flew."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO, TD3
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor

import rl  # noqa: F401 - registers the environments
from rl.environment.env import LunarHDAEnv
from rl.environment.map_env import LunarHDAMapEnv
from rl.learning.td3 import FastTD3
from rl.training.vector_adapter import StableBaselinesVector
from tests.equality import same
from tests.rl.lanes import Lane


def adapted(name: str = "LunarHDA-v0", count: int = 4, **options: Any) -> StableBaselinesVector:
    return StableBaselinesVector(gymnasium.make_vec(name, num_envs=count, **options))


@pytest.mark.parametrize(
    ("name", "kind"), [("LunarHDA-v0", LunarHDAEnv), ("LunarHDA-Map-v0", LunarHDAMapEnv)]
)
def test_it_gives_what_the_vector_of_stable_baselines_gives(name, kind):
    count, limit = 3, {"max_episode_steps": 20}
    ours = adapted(name, count, **limit)
    theirs = DummyVecEnv([lambda k=k: Lane(kind(), k, count, 5) for k in range(count)])
    ours.seed(5)
    seen, expected = ours.reset(), theirs.reset()
    assert same(seen, dict(expected) if isinstance(expected, dict) else expected)
    rng, ends = np.random.default_rng(0), 0
    for _ in range(20):
        action = rng.uniform(-1.0, 1.0, (count, 5)).astype(np.float32)
        seen, rewards, done, infos = ours.step(action)
        expected, other_rewards, other_done, other_infos = theirs.step(action)
        assert same(seen, dict(expected) if isinstance(expected, dict) else expected)
        assert same(rewards, other_rewards)
        assert same(done, other_done)
        assert same(
            [dict(sorted(info.items())) for info in infos],
            [dict(sorted(info.items())) for info in other_infos],
        )
        ends += int(done.sum())
    assert ends >= count
    assert same(ours.reset_infos, theirs.reset_infos)


class CountEnds(BaseCallback):
    """Counts what the learner hears of the episodes' ends."""

    def __init__(self) -> None:
        super().__init__()
        self.ends = 0

    def _on_step(self) -> bool:
        self.ends += int(np.sum(self.locals["dones"]))
        return True


@pytest.mark.parametrize("kind", [TD3, FastTD3])
def test_td3_remembers_the_transitions_that_were_flown(kind):
    count, rows = 3, 24
    model = kind(
        "MlpPolicy", adapted(count=count), learning_starts=30, buffer_size=200, batch_size=16, seed=7
    )
    before = [weights.clone() for weights in model.actor.parameters()]
    model.learn(rows * count)
    assert any(not torch.equal(a, b) for a, b in zip(before, model.actor.parameters(), strict=True))
    buffer: Any = model.replay_buffer
    assert buffer.pos == rows
    for k in range(count):
        lane = Lane(LunarHDAEnv(), k, count, 7)
        seen, _ = lane.reset()
        for row in range(rows):
            assert np.array_equal(buffer.observations[row, k], seen)
            following, reward, terminated, truncated, _ = lane.step(buffer.actions[row, k])
            assert np.array_equal(buffer.next_observations[row, k], following)
            assert buffer.rewards[row, k] == np.float32(reward)
            assert buffer.dones[row, k] == terminated
            seen = lane.reset()[0] if terminated or truncated else following
        assert buffer.dones[:, k].any()


def test_an_episode_that_is_cut_is_no_end_of_the_task():
    vector = adapted(count=2, max_episode_steps=3)
    model = TD3("MlpPolicy", vector, learning_starts=100, buffer_size=50, seed=7)
    model.learn(12)
    buffer: Any = model.replay_buffer
    assert buffer.dones[:6].all(axis=1).tolist() == [False, False, True] * 2
    assert buffer.timeouts[:6].all(axis=1).tolist() == [False, False, True] * 2


@pytest.mark.parametrize(
    ("name", "policy"), [("LunarHDA-v0", "MlpPolicy"), ("LunarHDA-Map-v0", "MultiInputPolicy")]
)
def test_ppo_learns_and_hears_of_every_end(name, policy):
    counted = CountEnds()
    settings: Any = {"n_steps": 16, "batch_size": 32, "n_epochs": 2, "policy_kwargs": {"log_std_init": -1.5}}
    model = PPO(policy, VecMonitor(adapted(name)), seed=1, device="cpu", **settings)
    before = [weights.clone() for weights in model.policy.parameters()]
    model.learn(128, counted)
    after = list(model.policy.parameters())
    assert any(not torch.equal(a, b) for a, b in zip(before, after, strict=True))
    assert counted.ends == len(model.ep_info_buffer or ()) == len(model.ep_success_buffer or ()) > 4
    assert all(info["l"] < 20 for info in model.ep_info_buffer or ())


def test_options_hold_for_every_environment_of_the_next_reset():
    plain, changed, listed = adapted(count=2), adapted(count=2), adapted(count=2)
    changed.set_options({"altitude": 0.0})
    listed.set_options([{"altitude": 0.0}] * 2)
    seen = []
    for vector in (plain, changed, listed):
        vector.seed(3)
        seen.append(vector.reset())
    assert not np.array_equal(seen[0], seen[1])
    assert np.array_equal(seen[1], seen[2])
    assert np.array_equal(np.asarray(plain.reset()), np.asarray(changed.reset()))  # they hold once


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([{"altitude": 0.0}, {}], "alike for all environments"),
        ([{}], "must have 2 entries"),
        ({"reset_mask": np.array([True, True])}, "leave out reset_mask"),
    ],
)
def test_options_of_single_rows_are_refused(options, message):
    vector = adapted(count=2)
    with pytest.raises(ValueError, match=message):
        vector.set_options(options)


def test_what_is_not_of_rows_is_refused():
    vector = adapted()
    assert vector.env_is_wrapped(Monitor) == [False] * 4
    assert vector.get_attr("num_envs", 0) == [4]
    for refused in (lambda: vector.set_attr("x", 1), lambda: vector.env_method("reset")):
        with pytest.raises(AttributeError, match="single environments"):
            refused()
    with pytest.raises(ValueError, match="SameStep"):
        adapted(autoreset_mode="Disabled")
    with pytest.raises(ValueError, match="native vector"):
        StableBaselinesVector(gymnasium.make_vec("LunarHDA-v0", 2, "sync"))
