from __future__ import annotations

import numpy as np
import pytest
import torch

from rl.algorithms import RECIPES, AgentSettings, make_algorithm
from rl.env import LunarHDAEnv
from rl.td3 import FastTD3


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


def test_the_guard_brings_a_saturated_actor_to_its_bound_and_no_further():
    model = flat_critic(5.0)
    model.saturation_weight = 0.1
    assert float(inputs_of_tanh(model, 600).abs().max()) == pytest.approx(1.5, abs=0.02)


def test_the_prior_brings_a_free_actor_to_the_nominal_action():
    model = flat_critic(1.0)
    model.prior_weight = 0.01
    assert float(inputs_of_tanh(model, 600).abs().max()) < 0.05


def test_the_critic_learns_while_the_actor_does_not_touch_it():
    model = flat_critic(0.0)
    model.prior_weight = 1.0
    before = [parameter.clone() for parameter in model.critic.parameters()]
    inputs_of_tanh(model, 3)
    for old, new in zip(before, model.critic.parameters(), strict=True):
        torch.testing.assert_close(old, new, rtol=0.0, atol=0.0)
        assert new.requires_grad


def test_decays_are_linear_between_their_ends():
    settings = AgentSettings(
        exploration_noise=0.5,
        final_noise=0.1,
        noise_decay=(100, 300),
        learning_rate=1.0,
        final_learning_rate=0.0,
    )
    assert [settings.noise_at(step) for step in (0, 100, 200, 300, 9999)] == pytest.approx(
        [0.5, 0.5, 0.3, 0.1, 0.1]
    )
    begin, end = settings.learning_rate_decay
    assert settings.learning_rate_at((begin + end) // 2) == pytest.approx(0.5)


def test_noise_and_learning_rate_follow_the_step():
    env = LunarHDAEnv()
    model = make_algorithm(RECIPES["td3"], env, seed=0)
    assert isinstance(model, FastTD3)
    for step, deviation in ((0, 0.5), (10**6, 0.1)):
        model.num_timesteps = step
        assert model.action_noise is not None
        draws = np.array([model.action_noise() for _ in range(4000)])
        assert draws.std() == pytest.approx(deviation, rel=0.05)
        assert model.lr_schedule(0.5) == pytest.approx(1e-3 if step == 0 else 1e-4)


def test_the_papers_recipe_is_td3_as_published():
    recipe = RECIPES["td3-paper"]
    assert (recipe.layout, recipe.saturation_weight, recipe.prior_weight) == ("printed", 0.0, 0.0)
    for step in (0, 100_000, 10**6):
        assert recipe.noise_at(step) == 0.1
        assert recipe.learning_rate_at(step) == 3e-4
