"""Proximal policy optimisation, with and without memory, as Stable-Baselines3 and sb3-contrib learn it.

Schulman et al. (2017, arXiv 1707.06347) with generalised advantages (2016, arXiv 1506.02438). Actions are
drawn from a Gaussian that nothing squashes, and clipped to [-1, 1] in the environment; its deviation
therefore begins small. Observations have fixed physical scales, so no running statistics are kept
(Stable-Baselines3's `VecNormalize` would be read back by pickle).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from rl.learning.box_spaces import check_boxes
from rl.settings import OnPolicySettings, RecurrentOnPolicySettings

if TYPE_CHECKING:
    from stable_baselines3.common.on_policy_algorithm import OnPolicyAlgorithm


def make_on_policy(settings: OnPolicySettings, env: Any, seed: int, device: str = "cpu") -> OnPolicyAlgorithm:
    """Make it untrained.

    Args:
        settings: what is learnt.
        env: Stable-Baselines3's `VecEnv`.
        seed: of the first weights, the exploration and the episodes.
        device: that torch learns on, "cpu" or "cuda".

    Raises:
        ValueError: another algorithm's settings, spaces that are not one-dimensional boxes, finite for
            actions, or a batch that is larger than what is flown between two updates.
    """
    from torch import nn

    recurrent = isinstance(settings, RecurrentOnPolicySettings)
    expected = "recurrent-ppo" if recurrent else "ppo"
    if settings.algorithm != expected:
        raise ValueError(f"algorithm must be {expected} with these settings, got {settings.algorithm!r}")
    check_boxes(env)
    flown = env.num_envs * settings.horizon
    if settings.batch_size > flown:
        raise ValueError(
            f"batch_size must be at most environments times horizon = {flown}, got {settings.batch_size}"
        )
    layers = list(settings.hidden)
    networks: dict[str, Any] = {
        "net_arch": {"pi": layers, "vf": layers},
        "activation_fn": nn.ReLU,
        "log_std_init": settings.log_deviation,
        "optimizer_kwargs": {"fused": True, "eps": 1e-5},
    }
    options: dict[str, Any] = {
        "learning_rate": settings.learning_rate,
        "n_steps": settings.horizon,
        "batch_size": settings.batch_size,
        "n_epochs": settings.epochs,
        "gamma": settings.discount,
        "gae_lambda": settings.trace,
        "clip_range": settings.clip,
        "vf_coef": settings.value_weight,
        "max_grad_norm": settings.greatest_gradient,
        "seed": seed,
        "device": device,
    }
    if isinstance(settings, RecurrentOnPolicySettings):
        from sb3_contrib import RecurrentPPO

        networks["lstm_hidden_size"] = settings.memory
        algorithm: OnPolicyAlgorithm = RecurrentPPO("MlpLstmPolicy", env, policy_kwargs=networks, **options)
    else:
        from stable_baselines3 import PPO

        algorithm = PPO("MlpPolicy", env, policy_kwargs=networks, **options)
    # decays follow the step and not SB3's share of the total, so that a longer run begins as a shorter one
    algorithm.lr_schedule = lambda _: settings.learning_rate_at(algorithm.num_timesteps)
    return algorithm
