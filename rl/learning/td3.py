"""Stable-Baselines3's TD3 with a faster update; the same mathematics.

Against the original: no gradients of the critic's weights while the actor learns, one Adam kernel per
optimiser (`fused`, set where the algorithm is made), and one call per list of weights in the slow following
of the targets.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from stable_baselines3 import TD3
from torch.nn.functional import mse_loss

from rl.environment.action import CONTROLS
from rl.learning.box_spaces import check_action_space


class FastTD3(TD3):
    """TD3 (Fujimoto, van Hoof, Meger 2018): clipped double Q-learning, target smoothing, delayed actor.

    Attributes:
        control_prior: asked at each update for the weight of the actor's penalty for the squares of the
            inputs of its last tanh, of all elements but the shift of the target; it draws the gains to 6/2
            and the rate of the clock to 1. A critic of landings that end in +1, -1 or -10 errs by more than
            the gains are worth, and an actor that follows its errors lands hard.
        shift_prior: as `control_prior`, for the shift of the target: what gains less is not moved.
        controls: so many elements of the action, the first ones, are not a shift of the target.
    """

    control_prior: Callable[[], float] | None = None
    shift_prior: Callable[[], float] | None = None
    controls: int = CONTROLS

    def __init__(self, policy: Any, env: Any, *args: Any, **kwargs: Any) -> None:
        """Make it as Stable-Baselines3 does.

        Raises:
            ValueError: the actions are not a one-dimensional Box with finite bounds.
        """
        if hasattr(env, "action_space"):  # not None, as while loading, nor the name of an environment
            check_action_space(env.action_space)
        super().__init__(policy, env, *args, **kwargs)

    def train(self, gradient_steps: int, batch_size: int = 100) -> None:
        """Update critics, and every `policy_delay` updates the actor and the targets."""
        self.policy.set_training_mode(True)
        self._update_learning_rate([self.actor.optimizer, self.critic.optimizer])
        critic_losses, actor_losses = [], []
        for _ in range(gradient_steps):
            self._n_updates += 1
            assert self.replay_buffer is not None
            batch = self.replay_buffer.sample(batch_size)
            critic_losses.append(self._update_critics(batch))
            if self._n_updates % self.policy_delay == 0:
                actor_losses.append(self._update_actor(batch.observations))
        self.logger.record("train/n_updates", self._n_updates, exclude="tensorboard")
        self.logger.record("train/critic_loss", sum(critic_losses) / len(critic_losses))
        if actor_losses:
            self.logger.record("train/actor_loss", sum(actor_losses) / len(actor_losses))

    def _update_critics(self, batch) -> float:
        with torch.no_grad():
            noise = torch.randn_like(batch.actions) * self.target_policy_noise
            noise.clamp_(-self.target_noise_clip, self.target_noise_clip)
            actions = (self.actor_target(batch.next_observations) + noise).clamp_(-1.0, 1.0)
            value = torch.minimum(*self.critic_target(batch.next_observations, actions))
            target = batch.rewards + (1.0 - batch.dones) * self.gamma * value
        first, second = self.critic(batch.observations, batch.actions)
        loss = mse_loss(first, target) + mse_loss(second, target)
        self.critic.optimizer.zero_grad()
        loss.backward()
        self.critic.optimizer.step()
        return loss.item()

    def _update_actor(self, observations: torch.Tensor) -> float:
        self.critic.requires_grad_(False)
        inputs = self.actor.mu[:-1](observations)
        loss = -self.critic.q1_forward(observations, torch.tanh(inputs)).mean()
        if self.control_prior is not None and (weight := self.control_prior()) > 0.0:
            loss = loss + weight * inputs[:, : self.controls].square().sum(1).mean()
        if self.shift_prior is not None and (weight := self.shift_prior()) > 0.0:
            loss = loss + weight * inputs[:, self.controls :].square().sum(1).mean()
        self.actor.optimizer.zero_grad()
        loss.backward()
        self.actor.optimizer.step()
        self.critic.requires_grad_(True)
        follow = vars(torch)["_foreach_lerp_"]  # the one call that optimisers use; not in the type stubs
        with torch.no_grad():
            for network, target in ((self.critic, self.critic_target), (self.actor, self.actor_target)):
                follow(list(target.parameters()), list(network.parameters()), self.tau)
        return loss.item()
