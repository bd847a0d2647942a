"""Hyperparameters of TD3 with LSTM."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Hyperparameters:
    """What is learnt and how.

    Attributes:
        plus: the modern variant; else Algorithm 3 as printed.
        memory: hidden size of each LSTM.
        head: hidden layers after the branches join.
        batch_size: sequences per update.
        discount: gamma.
        target_rate: tau.
        exploration_noise: standard deviation of the noise on actions in [-1, 1].
        smoothing_noise: standard deviation of the noise on the target actor's actions, clipped at 2.5 of it.
        policy_delay: updates of the critics for one of the actor and the targets.
        random_steps: steps with uniform actions before the first update.
        update_every: environment steps for one update.
        replay_size: rows kept; an episode of T transitions takes T + 1.
        window: longest sequence of the plus variant; longer episodes give windows of that many transitions.
        burn_in: transitions before a window that only fill the memory.
        saturation_weight: of the penalty for inputs of the actor's tanh beyond `saturation_bound`.
        saturation_bound: 1.5 lets actions reach 0.905 without a penalty.
    """

    plus: bool = False
    memory: int = 128
    head: tuple[int, ...] = (256,)
    batch_size: int = 100
    discount: float = 0.99
    target_rate: float = 0.005
    exploration_noise: float = 0.1
    smoothing_noise: float = 0.2
    policy_delay: int = 2
    random_steps: int = 1_000
    update_every: int = 1
    replay_size: int = 200_000
    window: int = 50
    burn_in: int = 0
    saturation_weight: float = 0.0
    saturation_bound: float = 1.5
