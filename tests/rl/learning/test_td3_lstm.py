"""TD3 with LSTM: a task that needs memory, masks, memory in and out, runs that repeat and resume."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces

from examples.memory_task import SETTINGS, Recall
from hda.flight.episode import fly
from hda.task.presets import PRESETS
from hda.task.scenario import sample_scenario
from rl.environment.env import LunarHDAEnv
from rl.inference.artefacts import Artefact, ArtefactError, load_artefact, save_artefact
from rl.learning.algorithms import make_agent_with_memory
from rl.learning.recurrent.agent import AgentMemory
from rl.learning.recurrent.losses import SequenceTensors, actor_loss, critic_loss
from rl.learning.recurrent.replay import Episode
from rl.learning.recurrent.td3_lstm import RecurrentTD3
from rl.policies.recurrent_actor import RecurrentAgentPolicy, load_memory_actor
from rl.recipes import RECURRENT_RECIPES
from rl.training.actor_export import actor_card, actor_tensors, policy_of
from rl.training.run import run_training
from rl.training.run_folder import TrainingPlan, read_rows

VARIANTS = tuple(RECURRENT_RECIPES)
SMALL = {
    name: replace(
        recipe, hidden=(8,), memory=8, batch_size=4, random_steps=60, replay_size=150, update_every=3
    )
    for name, recipe in RECURRENT_RECIPES.items()
}


class WideRecall(Recall):
    """The example's task with actions from -2 to 2: the agent must scale its own.

    An agent without memory acts alike for both cues, so its mean reward over them is exactly 0.
    """

    action_space = spaces.Box(-2.0, 2.0, (1,), np.float32)

    def step(self, action):
        assert self.action_space.contains(action)
        return super().step(0.5 * action)


def mean_recall(agent) -> float:
    """Mean reward over both cues, by SB3's predict signature."""
    env, total = WideRecall(), 0.0
    for cue in (-1.0, 1.0):
        observation, _ = env.reset(options={"cue": cue})
        state, ended, start = None, False, True
        while not ended:
            action, state = agent.predict(observation, state, np.array([start]), deterministic=True)
            observation, reward, ended, _, _ = env.step(action)
            total, start = total + 0.5 * float(reward), False
    return total


@pytest.mark.parametrize("plus", [False, True])
def test_memory_solves_a_task_that_needs_it(plus):
    agent = RecurrentTD3(WideRecall(), replace(SETTINGS, plus=plus), 0, lambda step: 3e-3)
    agent.learn(1400)
    assert mean_recall(agent) > 0.8


def test_an_agent_without_memory_cannot_solve_it():
    from stable_baselines3 import TD3

    policy: Any = {"net_arch": [32, 32]}
    agent = TD3("MlpPolicy", WideRecall(), learning_starts=400, policy_kwargs=policy, seed=0, device="cpu")
    agent.learn(1000)
    assert mean_recall(agent) == pytest.approx(0.0, abs=1e-6)


# Masks


def agent_of(name: str, seed: int = 0) -> RecurrentTD3:
    return make_agent_with_memory(SMALL[name], LunarHDAEnv(), seed)


def random_episode(agent: RecurrentTD3, length: int, rng: np.random.Generator) -> Episode:
    return Episode(
        rng.normal(size=(length + 1, agent.observation_space.shape[0])).astype(np.float32),
        rng.uniform(-1, 1, (length, agent.action_space.shape[0])).astype(np.float32),
        rng.normal(size=length).astype(np.float32),
        True,
    )


def gradients(agent: RecurrentTD3, batch: SequenceTensors, noise: torch.Tensor) -> list[torch.Tensor]:
    agent.critic.zero_grad()
    agent.actor.zero_grad()
    weight = batch.counted.sum()
    (critic_loss(agent.networks, batch, noise, agent.settings) * weight).backward()
    critic = [p.grad.clone() for p in agent.critic.parameters() if p.grad is not None]
    (actor_loss(agent.networks, batch, agent.settings) * weight).backward()
    return critic + [p.grad.clone() for p in agent.actor.parameters() if p.grad is not None]


def together(agent: RecurrentTD3, episodes: list[Episode], rng: np.random.Generator) -> SequenceTensors:
    """Every episode once, padded to the longest."""
    replay = type(agent.replay_buffer)(
        1000, *(s.shape[0] for s in (agent.observation_space, agent.action_space))
    )
    for episode in episodes:
        replay.store(episode)
    every, zero = np.arange(len(episodes)), np.zeros(len(episodes), np.int64)
    return SequenceTensors.of(replay._gather(every, zero, 50, 0), agent.settings.plus)


def test_masked_sequences_give_the_gradient_of_unpadded_ones():
    agent, rng = agent_of("td3-lstm-plus"), np.random.default_rng(0)
    episodes = [random_episode(agent, length, rng) for length in (3, 7, 5)]
    padded = together(agent, episodes, rng)
    assert padded.counted.sum() == 15
    noise = torch.from_numpy(rng.normal(size=(7, 3, 5)).astype(np.float32)) * 0.1
    masked = gradients(agent, padded, noise)
    alone = [
        gradients(agent, together(agent, [episode], rng), noise[: len(episode.actions), k : k + 1])
        for k, episode in enumerate(episodes)
    ]
    assert len(masked) == len(alone[0]) > 20
    for k, gradient in enumerate(masked):
        torch.testing.assert_close(gradient, sum(parts[k] for parts in alone), rtol=1e-4, atol=1e-5)


def test_padding_and_what_follows_it_do_not_matter():
    agent, rng = agent_of("td3-lstm-plus"), np.random.default_rng(1)
    padded = together(agent, [random_episode(agent, length, rng) for length in (2, 6)], rng)
    noise = torch.zeros(6, 2, 5)
    before = gradients(agent, padded, noise)
    for name in ("observations", "history"):
        getattr(padded, name)[3:, 0] = 7.0
    padded.actions[2:, 0], padded.rewards[2:, 0] = 0.5, 100.0
    for one, other in zip(before, gradients(agent, padded, noise), strict=True):
        torch.testing.assert_close(one, other, rtol=1e-5, atol=1e-6)


def test_gradients_reach_the_first_step_through_the_memory():
    agent, rng = agent_of("td3-lstm"), np.random.default_rng(2)
    batch = together(agent, [random_episode(agent, 6, rng)], rng)
    batch.history.requires_grad_(True)
    batch.counted[:-1] = 0.0  # only the last transition counts
    (gradient,) = torch.autograd.grad(
        critic_loss(agent.networks, batch, torch.zeros(6, 1, 5), agent.settings), batch.history
    )
    assert (gradient[:-1].abs().sum(-1) > 0).all()
    assert (gradient[-1] == 0).all()  # the next observation enters the target alone


def test_targets_stop_at_the_end_and_discount_before():
    """One transition by hand: y = r + gamma min(Q') unless terminated."""
    agent, rng = agent_of("td3-lstm"), np.random.default_rng(3)
    batch = together(agent, [random_episode(agent, 1, rng)], rng)
    noise = torch.zeros(1, 1, 5)
    with torch.no_grad():
        values = agent.critic.values(
            agent.critic.remember(batch.history[:1]), batch.observations[:1], batch.actions
        )
        ended = sum((value - batch.rewards).square().item() for value in values)
        assert critic_loss(agent.networks, batch, noise, agent.settings).item() == pytest.approx(
            ended, rel=1e-5
        )
        batch.terminated[:] = 0.0
        action = torch.tanh(agent.actor(batch.observations, batch.history)[0][1:])
        pasts = [past[1:] for past in agent.critic.remember(batch.history)]
        following = torch.minimum(*agent.critic.values(pasts, batch.observations[1:], action))
        target = batch.rewards + 0.99 * following
        cut = sum((value - target).square().item() for value in values)
        assert critic_loss(agent.networks, batch, noise, agent.settings).item() == pytest.approx(
            cut, rel=1e-5
        )


# Memory in and out


@pytest.mark.parametrize("name", VARIANTS)
def test_environments_side_by_side_remember_apart_and_forget_at_their_starts(name):
    agent, rng = agent_of(name), np.random.default_rng(0)
    seen = rng.normal(size=(6, 2, 44)).astype(np.float32)
    rewards = rng.normal(size=(6, 2)).astype(np.float32)
    state, both = None, []
    for t in range(6):
        starts = np.array([t == 0, t in (0, 3)])
        action, state = agent.predict(seen[t], state, starts, deterministic=True, reward=rewards[t])
        both.append(action)
    for n, parts in ((0, [(0, 6)]), (1, [(0, 3), (3, 6)])):
        for begin, end in parts:
            alone = None
            for t in range(begin, end):
                reward = 0.0 if t == begin else rewards[t, n]
                action, alone = agent.predict(seen[t, n], alone, deterministic=True, reward=reward)
                np.testing.assert_allclose(action, both[t][n], atol=1e-6)


def test_predict_changes_no_memory_and_keeps_none():
    agent = agent_of("td3-lstm")
    seen = np.ones(44, np.float32)
    first, state = agent.predict(seen, deterministic=True)
    copy = AgentMemory(*(part.copy() for part in vars(state).values()))
    second, _ = agent.predict(seen, state, deterministic=True)
    again, _ = agent.predict(seen, state, deterministic=True)
    np.testing.assert_array_equal(second, again)
    assert not np.array_equal(first, second)
    for name, part in vars(copy).items():
        np.testing.assert_array_equal(part, getattr(state, name))


@pytest.mark.parametrize("name", VARIANTS)
def test_the_exported_policy_flies_as_the_agent_acts(name):
    settings = SMALL[name]
    env = LunarHDAEnv(layout=settings.layout, action_ranges=settings.action_ranges)
    agent = make_agent_with_memory(settings, env, 3)
    policy = policy_of(actor_tensors(agent), settings)
    for episode in range(3):
        scenario = sample_scenario("paper", 1, episode, "train")
        record = fly(policy, scenario)
        observation, _ = env.reset(options={"scenario": scenario})
        state, reward = None, 0.0
        for terms in record.rewards:
            action, state = agent.predict(observation, state, deterministic=True, reward=reward)
            observation, reward, *_ = env.step(action)
            assert reward == pytest.approx(terms.total, abs=1e-5)


@pytest.mark.parametrize("name", VARIANTS)
def test_weights_on_disk_are_verified_and_fly_the_same(name, tmp_path):
    settings = SMALL[name]
    tensors = actor_tensors(agent_of(name))
    path = tmp_path / name
    save_artefact(path, "actor", tensors, actor_card(settings))
    scenario = sample_scenario("paper", 1, 0, "train")
    one = fly(policy_of(tensors, settings), scenario)
    np.testing.assert_array_equal(one.path, fly(RecurrentAgentPolicy(name, path), scenario).path)
    short = Artefact("actor", {**tensors, "lstm.bias": tensors["lstm.bias"][:-1]}, actor_card(settings))
    from rl.policies.recurrent_actor import memory_actor_from_artefact

    with pytest.raises(ArtefactError, match=r"lstm\.bias"):
        memory_actor_from_artefact(short, path)
    with pytest.raises(ArtefactError, match="cannot read"):
        load_memory_actor(tmp_path / "none")


# Runs


def plan(steps: int, seed: int = 0) -> TrainingPlan:
    return TrainingPlan(
        steps, seed, validate_every=60, validation_episodes=2, checkpoint_every=40, log_every=30
    )


def last_checkpoint(folder) -> Artefact:
    return load_artefact(sorted(folder.glob("checkpoint-*.json"))[-1].with_suffix(""), "checkpoint")


@pytest.mark.parametrize("name", VARIANTS)
def test_a_run_that_is_cut_resumes_to_the_same_weights(name, tmp_path):
    whole, cut, other = tmp_path / "whole", tmp_path / "cut", tmp_path / "other"
    run_training(whole, PRESETS["paper"], SMALL[name], plan(240), resume=False)
    run_training(cut, PRESETS["paper"], SMALL[name], plan(170), resume=False)
    run_training(cut, PRESETS["paper"], SMALL[name], plan(240), resume=True)
    a, b = last_checkpoint(whole), last_checkpoint(cut)
    assert a.card["counters"] == b.card["counters"]
    assert a.card["counters"]["n_updates"] > 20
    assert a.card["generators"] == b.card["generators"]
    assert set(a.tensors) == set(b.tensors)
    for key, tensor in a.tensors.items():
        np.testing.assert_array_equal(tensor, b.tensors[key])
    for log in ("training.csv", "validation.csv"):
        one, two = (
            [{k: v for k, v in row.items() if k != "seconds"} for row in read_rows(folder / log)]
            for folder in (whole, cut)
        )
        assert one == two
    run_training(other, PRESETS["paper"], SMALL[name], plan(60, seed=1), resume=False)
    first = [
        load_artefact(folder / "actors" / "step-000000060", "actor").tensors for folder in (whole, other)
    ]
    assert not np.array_equal(first[0]["lstm.input"], first[1]["lstm.input"])
