"""The penalties of agents with memory: towards 0 by element of the action, and off the ends of its range."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from rl.environment.action import CONTROLS
from rl.environment.env import LunarHDAEnv
from rl.learning.algorithms import make_agent_with_memory
from rl.learning.recurrent.losses import SequenceTensors, actor_loss
from rl.learning.recurrent.replay import Episode
from rl.recipes import RECURRENT_RECIPES

RECIPE = replace(RECURRENT_RECIPES["td3-lstm-plus"], memory=8, hidden=(16,), batch_size=4, learning_rate=1e-3)


@pytest.fixture
def agent():
    agent = make_agent_with_memory(RECIPE, LunarHDAEnv(), 0)
    rng = np.random.default_rng(1)
    for length in (3, 6, 4, 5):
        observations = rng.normal(size=(length + 1, agent.sizes.observation)).astype(np.float32)
        actions = rng.uniform(-1.0, 1.0, (length, agent.sizes.action)).astype(np.float32)
        agent.replay_buffer.store(Episode(observations, actions, np.zeros(length, np.float32), True))
    return agent


def test_the_recipe_draws_gains_and_clock_and_not_the_target(agent):
    before = agent.action_prior(RECIPE.control_prior_step - 1)
    after = agent.action_prior(RECIPE.control_prior_step)
    assert not before.any()
    assert (after[:CONTROLS] == np.float32(RECIPE.control_prior_weight)).all()
    assert not after[CONTROLS:].any()


def test_a_weight_draws_the_shift_too():
    recipe = replace(RECIPE, shift_prior_weight=0.05)
    prior = make_agent_with_memory(recipe, LunarHDAEnv(), 0).action_prior
    assert prior is not None
    assert (prior(recipe.control_prior_step)[CONTROLS:] == np.float32(0.05)).all()
    assert not prior(recipe.control_prior_step - 1).any()


def test_the_penalty_is_the_weighted_mean_square_over_what_counts(agent):
    batch = SequenceTensors.of(agent.sample(), True)
    prior = torch.tensor([0.5, 0.0, 2.0, 0.0, 0.0])
    more = actor_loss(agent.networks, batch, agent.settings, prior)
    less = actor_loss(agent.networks, batch, agent.settings)
    inputs, _ = agent.actor(batch.observations[:-1], batch.history[:-1])
    rows = inputs[batch.counted.bool()].double()
    expected = (0.5 * rows[:, 0].square() + 2.0 * rows[:, 2].square()).mean()
    assert (more - less).item() == pytest.approx(expected.item(), rel=1e-3)


def test_the_guard_against_saturation_counts_only_what_lies_beyond_its_bound(agent):
    batch = SequenceTensors.of(agent.sample(), True)
    inputs, _ = agent.actor(batch.observations[:-1], batch.history[:-1])
    rows = inputs[batch.counted.bool()].detach().double().abs()
    bound = float(rows.median())
    guarded = replace(agent.settings, saturation_weight=2.0, saturation_bound=bound)
    more = actor_loss(agent.networks, batch, guarded)
    less = actor_loss(agent.networks, batch, agent.settings)
    expected = 2.0 * (rows - bound).clamp_min(0.0).square().sum(-1).mean()
    assert expected.item() > 0.0
    assert (more - less).item() == pytest.approx(expected.item(), rel=1e-2)


def test_a_heavy_prior_brings_the_gains_to_nominal_and_leaves_the_target_free(agent):
    agent.action_prior = lambda step: np.array([50.0, 50.0, 50.0, 0.0, 0.0], np.float32)
    agent.num_timesteps = RECIPE.random_steps
    agent.train(300)
    batch = SequenceTensors.of(agent.sample(), True)
    inputs, _ = agent.actor(batch.observations[:-1], batch.history[:-1])
    actions = torch.tanh(inputs)[batch.counted.bool()].abs().mean(0)
    assert actions[:CONTROLS].max() < 0.02
    assert actions[CONTROLS:].min() > 0.04
