from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from rl.environment.action import CONTROLS
from rl.environment.env import LunarHDAEnv
from rl.learning.algorithms import make_algorithm
from rl.learning.td3 import FastTD3
from rl.recipes import OFF_POLICY_RECIPES
from rl.settings import OffPolicyAgentSettings


def flat_critic(actor_bias: float) -> FastTD3:
    """TD3 whose critic is 0 everywhere, so that only the penalties move the actor."""
    model = FastTD3(
        "MlpPolicy", LunarHDAEnv(), seed=0, buffer_size=32, policy_kwargs={"net_arch": [8]}, device="cpu"
    )
    with torch.no_grad():
        for parameter in model.critic.parameters():
            parameter.zero_()
        list(model.actor.mu.parameters())[-1].fill_(actor_bias)
    model.actor.optimizer.param_groups[0]["lr"] = 0.01
    return model


def inputs_of_tanh(model: FastTD3, updates: int) -> torch.Tensor:
    observations = torch.rand(16, 44)
    for _ in range(updates):
        model._update_actor(observations)
    with torch.no_grad():
        return model.actor.mu[:-1](observations)


def test_published_td3_leaves_a_saturated_actor_where_the_critic_is_flat():
    assert float(inputs_of_tanh(flat_critic(5.0), 20).min()) > 4.0


def test_the_prior_brings_gains_and_clock_to_nominal_and_leaves_the_target():
    model = flat_critic(1.0)
    model.control_prior = lambda: 0.01
    inputs = inputs_of_tanh(model, 600).abs()
    assert float(inputs[:, :CONTROLS].max()) < 0.05
    assert float(inputs[:, CONTROLS:].min()) > 0.5


def test_the_shift_prior_brings_the_shift_to_nothing_and_leaves_the_rest():
    model = flat_critic(1.0)
    model.shift_prior = lambda: 0.01
    inputs = inputs_of_tanh(model, 600).abs()
    assert float(inputs[:, CONTROLS:].max()) < 0.05
    assert float(inputs[:, :CONTROLS].min()) > 0.5


def test_the_critic_learns_while_the_actor_does_not_touch_it():
    model = flat_critic(0.0)
    model.control_prior = lambda: 1.0
    before = [parameter.clone() for parameter in model.critic.parameters()]
    inputs_of_tanh(model, 3)
    for old, new in zip(before, model.critic.parameters(), strict=True):
        torch.testing.assert_close(old, new, rtol=0.0, atol=0.0)
        assert new.requires_grad


def test_the_learning_rate_decays_linearly_between_its_ends_and_the_prior_sets_in():
    settings = OffPolicyAgentSettings(
        learning_rate=1.0, final_learning_rate=0.0, learning_rate_decay=(100, 300)
    )
    assert [settings.learning_rate_at(step) for step in (0, 100, 200, 300, 9999)] == pytest.approx(
        [1.0, 1.0, 0.5, 0.0, 0.0]
    )
    step = settings.control_prior_step
    assert [settings.control_prior_at(k) for k in (0, step - 1, step)] == [
        0,
        0,
        settings.control_prior_weight,
    ]
    drawn = replace(settings, shift_prior_weight=0.05)
    assert [drawn.shift_prior_at(k) for k in (0, step - 1, step)] == [0.0, 0.0, 0.05]


def test_the_algorithm_follows_its_settings():
    model = make_algorithm(OFF_POLICY_RECIPES["td3"], LunarHDAEnv(), seed=0)
    assert isinstance(model, FastTD3)
    assert model.action_noise is not None
    draws = np.array([model.action_noise() for _ in range(4000)])
    assert draws.std() == pytest.approx(OFF_POLICY_RECIPES["td3"].exploration_noise, rel=0.05)
    assert model.target_policy_noise == OFF_POLICY_RECIPES["td3"].smoothing_noise
    for step, rate in ((0, 3e-4), (10**6, 3e-5)):
        model.num_timesteps = step
        assert model.lr_schedule(0.5) == pytest.approx(rate)


def test_the_papers_recipe_is_td3_as_published():
    recipe = OFF_POLICY_RECIPES["td3-paper"]
    assert recipe.layout == "printed"
    assert (recipe.exploration_noise, recipe.smoothing_noise, recipe.discount) == (0.1, 0.2, 0.99)
    for step in (0, 100_000, 10**6):
        assert recipe.control_prior_at(step) == 0.0
        assert recipe.learning_rate_at(step) == 3e-4
