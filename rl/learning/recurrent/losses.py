"""Losses of TD3 on sequences, and the four networks that they are of."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from rl.learning.recurrent.hyperparameters import Hyperparameters
from rl.learning.recurrent.networks import NetworkSizes, RecurrentActor, TwinCritic
from rl.learning.recurrent.replay import SequenceBatch


@dataclass(frozen=True, eq=False)
class SequenceTensors:
    """A batch of sequences in torch; shapes as in `rl.learning.recurrent.replay.SequenceBatch`.

    Attributes:
        observations: (T + 1, N, o).
        history: (T + 1, N, h): observation, previous action, and the previous reward if it is read.
        actions: (T, N, a).
        rewards: (T, N).
        terminated: (T, N).
        counted: (T, N).
    """

    observations: Tensor
    history: Tensor
    actions: Tensor
    rewards: Tensor
    terminated: Tensor
    counted: Tensor

    @classmethod
    def of(
        cls, batch: SequenceBatch, previous_reward: bool, device: torch.device | str = "cpu"
    ) -> SequenceTensors:
        """From arrays, for networks on that device."""
        parts = [batch.observations, batch.previous_actions]
        if previous_reward:
            parts.append(batch.previous_rewards[..., None])
        arrays = (batch.actions, batch.rewards, batch.terminated, batch.counted)
        every = (batch.observations, np.concatenate(parts, -1), *arrays)
        return cls(*(torch.from_numpy(array).to(device) for array in every))

    def mean(self, values: Tensor) -> Tensor:
        """Mean over the transitions that count; values (T, N)."""
        return (values * self.counted).sum() / self.counted.sum()


@dataclass(frozen=True, eq=False)
class ActorCritic:
    """The networks that learn, and the targets that follow them.

    Attributes:
        actor: mu.
        critic: Q_1 and Q_2.
        actor_target: follows the actor.
        critic_target: follows the critic.
    """

    actor: RecurrentActor
    critic: TwinCritic
    actor_target: RecurrentActor
    critic_target: TwinCritic

    @classmethod
    def untrained(cls, sizes: NetworkSizes, shared: bool, seed: int) -> ActorCritic:
        """Networks with torch's own first weights, the targets equal to them.

        Args:
            sizes: of the networks.
            shared: both values rest on one encoder of the history.
            seed: of the weights.
        """
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            actor, critic = RecurrentActor(sizes), TwinCritic(sizes, shared)
        targets = deepcopy(actor), deepcopy(critic)
        for target in targets:
            target.requires_grad_(False)
        return cls(actor, critic, *targets)

    def to(self, device: torch.device) -> ActorCritic:
        """The same networks, moved there."""
        for network in (self.actor, self.critic, self.actor_target, self.critic_target):
            network.to(device)
        return self

    def follow(self, rate: float) -> None:
        """Move the targets towards the networks by this share of the way."""
        lerp = vars(torch)["_foreach_lerp_"]  # the one call that optimisers use; not in the type stubs
        with torch.no_grad():
            for network, target in ((self.critic, self.critic_target), (self.actor, self.actor_target)):
                lerp(list(target.parameters()), list(network.parameters()), rate)


def target_values(
    networks: ActorCritic, batch: SequenceTensors, noise: Tensor, settings: Hyperparameters
) -> Tensor:
    """What the values should be: r + gamma min(Q_1', Q_2') at the smoothed target action, shape (T, N)."""
    with torch.no_grad():
        inputs, _ = networks.actor_target(batch.observations, batch.history)
        actions = (torch.tanh(inputs[1:]) + noise).clamp_(-1.0, 1.0)
        pasts = [past[1:] for past in networks.critic_target.remember(batch.history)]
        value = torch.minimum(*networks.critic_target.values(pasts, batch.observations[1:], actions))
        return batch.rewards + (1.0 - batch.terminated) * settings.discount * value


def critic_loss(
    networks: ActorCritic, batch: SequenceTensors, noise: Tensor, settings: Hyperparameters
) -> Tensor:
    """Mean square temporal-difference error of both values over the transitions that count.

    Args:
        networks: learning and target networks.
        batch: T transitions of N sequences.
        noise: of target smoothing, shape (T, N, a).
        settings: discount.
    """
    target = target_values(networks, batch, noise, settings)
    pasts = networks.critic.remember(batch.history[:-1])
    loss = torch.zeros((), device=target.device)
    for value in networks.critic.values(pasts, batch.observations[:-1], batch.actions):
        loss = loss + batch.mean((value - target).square())
    return loss


def actor_loss(
    networks: ActorCritic, batch: SequenceTensors, settings: Hyperparameters, prior: Tensor | None = None
) -> Tensor:
    """Mean of -Q_1(h_t, mu(h_t)) and the penalties over the transitions that count.

    Args:
        networks: learning and target networks.
        batch: T transitions of N sequences.
        settings: of the penalty for saturation.
        prior: (a,), weights of a penalty for the squares of the inputs of the actor's tanh, by
            element; None for none.
    """
    inputs, _ = networks.actor(batch.observations[:-1], batch.history[:-1])
    with torch.no_grad():  # the past holds no action of this actor
        pasts = networks.critic.remember(batch.history[:-1], count=1)
    (value,) = networks.critic.values(pasts, batch.observations[:-1], torch.tanh(inputs))
    loss = batch.mean(-value)
    if settings.saturation_weight > 0.0:
        excess = (inputs.abs() - settings.saturation_bound).clamp_min(0.0)
        loss = loss + settings.saturation_weight * batch.mean(excess.square().sum(-1))
    if prior is not None:
        loss = loss + batch.mean((prior * inputs.square()).sum(-1))
    return loss
