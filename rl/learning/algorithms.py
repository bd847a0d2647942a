"""The learning algorithms by name, and the settings that they are trained with here."""

from __future__ import annotations

from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from rl.environment.action import CONTROLS
from rl.inference.arrays import Array32
from rl.settings import (
    AgentSettings,
    OffPolicyAgentSettings,
    OnPolicySettings,
    RecurrentSettings,
    SequenceSettings,
)

if TYPE_CHECKING:
    from stable_baselines3.common.off_policy_algorithm import OffPolicyAlgorithm
    from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm

    from rl.learning.recurrent.td3_lstm import RecurrentTD3


def make_agent_with_memory(
    settings: RecurrentSettings, env: Any, seed: int, device: str = "cpu"
) -> RecurrentTD3:
    """Make an untrained agent with memory; as `make_algorithm`."""
    from rl.learning.recurrent.hyperparameters import Hyperparameters
    from rl.learning.recurrent.td3_lstm import RecurrentTD3

    chosen = {field.name: getattr(settings, field.name) for field in fields(SequenceSettings)}
    hyperparameters = Hyperparameters(plus=settings.algorithm == "td3-lstm-plus", **chosen)
    agent = RecurrentTD3(env, hyperparameters, seed, settings.learning_rate_at, device)

    def prior_at(step: int) -> Array32:
        weights = np.full(agent.sizes.action, settings.shift_prior_at(step), np.float32)
        weights[: count_controls(settings)] = settings.control_prior_at(step)
        return weights

    agent.action_prior = prior_at
    return agent


def count_controls(settings: AgentSettings) -> int:
    """So many elements of the action, the first ones, move gains and clock: none under convex guidance."""
    return CONTROLS if settings.guidance == "zem-zev" else 0


def make_algorithm(
    settings: AgentSettings, env: Any, seed: int, device: str = "cpu"
) -> OffPolicyAlgorithm | OnPolicyAlgorithm | RecurrentTD3:
    """Make an untrained algorithm.

    Args:
        settings: what is learnt.
        env: Gymnasium environment; for what learns from many at a time Stable-Baselines3's `VecEnv`.
        seed: of the first weights, the exploration and the episodes.
        device: that torch learns on, "cpu" or "cuda".

    Raises:
        ValueError: unknown algorithm, or spaces that are not one-dimensional boxes, finite for actions.
        ImportError: `tqc` or `recurrent-ppo` without sb3-contrib.
    """
    from rl.learning.box_spaces import check_environment
    from rl.learning.ppo import make_on_policy

    if isinstance(settings, OnPolicySettings):
        return make_on_policy(settings, env, seed, device)
    check_environment(env)
    if isinstance(settings, RecurrentSettings):
        return make_agent_with_memory(settings, env, seed, device)
    assert isinstance(settings, OffPolicyAgentSettings)
    return make_off_policy(settings, env, seed, device)


def make_off_policy(
    settings: OffPolicyAgentSettings, env: Any, seed: int, device: str = "cpu"
) -> OffPolicyAlgorithm:
    """Make an untrained agent without memory that learns from a replay memory; as `make_algorithm`."""
    from stable_baselines3 import DDPG, SAC
    from stable_baselines3.common.noise import NormalActionNoise

    from rl.learning.td3 import FastTD3

    classes: dict[str, Any] = {"td3": FastTD3, "ddpg": DDPG, "sac": SAC}
    if settings.algorithm == "tqc":
        from sb3_contrib import TQC

        classes["tqc"] = TQC
    if settings.algorithm not in classes:
        raise ValueError(f"algorithm must be td3, sac, ddpg or tqc, got {settings.algorithm!r}")
    algorithm: OffPolicyAlgorithm = classes[settings.algorithm](
        "MlpPolicy",
        env,
        learning_rate=settings.learning_rate,
        buffer_size=settings.replay_size,
        learning_starts=settings.random_steps,
        batch_size=settings.batch_size,
        tau=settings.target_rate,
        gamma=settings.discount,
        train_freq=settings.update_every,
        gradient_steps=1,
        policy_kwargs={"net_arch": list(settings.hidden), "optimizer_kwargs": {"fused": True}},
        seed=seed,
        device=device,
    )
    # decays follow the step and not SB3's share of the total, so that a longer run begins as a shorter one
    algorithm.lr_schedule = lambda _: settings.learning_rate_at(algorithm.num_timesteps)
    if isinstance(algorithm, FastTD3):
        algorithm.controls = count_controls(settings)
        algorithm.control_prior = lambda: settings.control_prior_at(algorithm.num_timesteps)
        algorithm.shift_prior = lambda: settings.shift_prior_at(algorithm.num_timesteps)
        algorithm.target_policy_noise = settings.smoothing_noise
        algorithm.target_noise_clip = 2.5 * settings.smoothing_noise
    if settings.algorithm in ("td3", "ddpg"):
        still = np.zeros(env.action_space.shape)
        algorithm.action_noise = NormalActionNoise(still, still + settings.exploration_noise)
    return algorithm
