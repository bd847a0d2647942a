"""Hyperparameters of TD3 with LSTM."""

from __future__ import annotations

from dataclasses import dataclass

from rl.settings import SequenceSettings


@dataclass(frozen=True)
class Hyperparameters(SequenceSettings):
    """What is learnt and how, on any environment.

    Attributes:
        plus: the modern variant; else Algorithm 3 as printed.
        policy_delay: updates of the critics for one of the actor and the targets.
        saturation_weight: of the penalty for inputs of the actor's tanh beyond `saturation_bound`.
        saturation_bound: 1.5 lets actions come to 0.905 without a penalty.
    """

    plus: bool = False
    policy_delay: int = 2
    saturation_weight: float = 0.0
    saturation_bound: float = 1.5
