"""Gymnasium's wrappers, and training loops in the forms that people write, around the environments here."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import wrappers
from gymnasium.wrappers import vector as vector_wrappers

import rl  # noqa: F401 - registers the environments
from examples.ppo_single_file import Agent
from rl.environment.map_env import LunarHDAMapEnv

IDS = ("LunarHDA-v0", "LunarHDA-Map-v0")
VERSION = tuple(int(part) for part in gymnasium.__version__.split(".")[:2])


def returns_and_lengths(name: str, episodes: int, seed: int) -> list[tuple[float, int]]:
    """Of single environments under actions of zero, episode by episode."""
    env, out = gymnasium.make(name), []
    for episode in range(episodes):
        env.reset(seed=seed if episode == 0 else None)
        total, length, over = 0.0, 0, False
        while not over:
            _, reward, terminated, truncated, _ = env.step(np.zeros(5, np.float32))
            total, length, over = total + float(reward), length + 1, terminated or truncated
        out.append((total, length))
    return out


@pytest.mark.parametrize("name", IDS)
def test_statistics_of_episodes_are_those_of_single_environments(name):
    envs = vector_wrappers.RecordEpisodeStatistics(gymnasium.make_vec(name, num_envs=4))
    envs.reset(seed=9)
    while envs.episode_count < 4:
        envs.step(np.zeros((4, 5), np.float32))
    expected = returns_and_lengths(name, 8, 9)
    for total, length in zip(envs.return_queue, envs.length_queue, strict=True):
        assert any(total == pytest.approx(other) and length == steps for other, steps in expected)


# before 1.3 the wrapper reads the dictionary in `final_obs` as one of infos
@pytest.mark.parametrize("name", IDS if VERSION >= (1, 3) else IDS[:1])
def test_infos_become_lists(name):
    envs = vector_wrappers.DictInfoToList(gymnasium.make_vec(name, num_envs=4))
    _, infos = envs.reset(seed=1)
    keys, ends = set(infos[0]), 0
    for _ in range(12):
        _, _, terminated, truncated, infos = envs.step(np.zeros((4, 5), np.float32))
        for info, ended in zip(infos, terminated | truncated, strict=True):
            assert set(info) - {"final_obs", "final_info"} == keys
            assert ("final_info" in info) == ended
            assert not ended or set(info["final_info"]) == keys
            ends += int(ended)
    assert ends >= 4


def test_wrappers_of_actions_and_rewards_work():
    envs: Any = gymnasium.make_vec("LunarHDA-v0", num_envs=3)
    envs = vector_wrappers.NormalizeReward(
        vector_wrappers.ClipReward(vector_wrappers.ClipAction(envs), -1.0, 1.0)
    )
    plain = gymnasium.make_vec("LunarHDA-v0", num_envs=3)
    assert np.array_equal(envs.reset(seed=0)[0], plain.reset(seed=0)[0])
    wide = np.full((3, 5), 7.0, np.float32)
    seen, rewards, *_ = envs.step(wide)
    assert np.array_equal(seen, plain.step(np.ones((3, 5), np.float32))[0])
    assert np.isfinite(rewards).all()


def test_wrappers_of_a_single_environment_keep_its_numbers():
    plain = gymnasium.make("LunarHDA-Map-v0")

    def flatten(seen: Any) -> np.ndarray:
        flattened = gymnasium.spaces.flatten(plain.observation_space, seen)
        assert isinstance(flattened, np.ndarray)
        return flattened

    flat = wrappers.FlattenObservation(wrappers.ClipAction(gymnasium.make("LunarHDA-Map-v0")))
    stacked = wrappers.FrameStackObservation(gymnasium.make("LunarHDA-v0"), 3)
    seen, _ = plain.reset(seed=0)
    assert np.array_equal(flat.reset(seed=0)[0], flatten(seen))
    seen = plain.step(np.ones(5, np.float32))[0]
    other = flat.step(np.full(5, 3.0, np.float32))[0]
    assert np.array_equal(other, flatten(seen))
    assert stacked.reset(seed=0)[0].shape == (3, 44)


def test_pictures_are_collected_step_by_step():
    env: Any = wrappers.RenderCollection(
        gymnasium.make("LunarHDA-Map-v0", render_mode="rgb_array"), pop_frames=False
    )
    env.reset(seed=0)
    env.step(np.zeros(5, np.float32))
    frames = env.render()
    assert len(frames) == 2
    assert not np.array_equal(*frames)


def test_a_loop_in_the_form_of_single_file_learners_runs_and_updates():
    """Same-step resets, statistics from `infos`, the value of a truncated state from `final_obs`."""
    torch.manual_seed(0)
    envs: Any = gymnasium.make_vec("LunarHDA-v0", num_envs=8, max_episode_steps=6)
    envs = vector_wrappers.RecordEpisodeStatistics(vector_wrappers.ClipAction(envs))
    agent = Agent(44, 5, -1.5)
    optimiser = torch.optim.Adam(agent.parameters(), lr=1e-3)
    before = [weights.detach().clone() for weights in agent.parameters()]
    seen, kept, episodic, cut = torch.from_numpy(envs.reset(seed=1)[0]), [], [], 0
    for _ in range(16):
        with torch.no_grad():
            chance = agent.distribution(seen)
            action = chance.sample()
            likelihood = chance.log_prob(action).sum(-1)
        following, reward, terminated, truncated, infos = envs.step(action.numpy())
        reward = torch.from_numpy(reward).float()
        if "final_info" in infos:
            episodic += infos["episode"]["r"][infos["_episode"]].tolist()
            only = torch.from_numpy(truncated & ~terminated)
            with torch.no_grad():
                reward += 0.99 * agent.value(torch.from_numpy(infos["final_obs"])) * only
            cut += int(only.sum())
        kept.append((seen, action, likelihood, reward))
        seen = torch.from_numpy(following)
    observations, actions, old, rewards = (torch.cat(parts) for parts in zip(*kept, strict=True))
    likelihood = agent.distribution(observations).log_prob(actions).sum(-1)
    ratio, advantage = (likelihood - old).exp(), rewards - agent.value(observations)
    loss = -(ratio * advantage.detach()).mean() + advantage.square().mean()
    optimiser.zero_grad()
    loss.backward()
    optimiser.step()
    assert len(episodic) >= 8
    assert cut > 0
    assert np.isfinite(episodic).all()
    assert ratio.detach().numpy() == pytest.approx(1.0, abs=1e-4)
    assert all(not torch.equal(a, b) for a, b in zip(before, agent.parameters(), strict=True))


def test_a_recorder_of_single_episodes_finds_the_end():
    env = wrappers.RecordEpisodeStatistics(LunarHDAMapEnv())
    env.reset(seed=0)
    info: dict[str, Any] = {}
    while "episode" not in info:
        *_, info = env.step(np.zeros(5, np.float32))
    assert info["episode"]["l"] < 20
