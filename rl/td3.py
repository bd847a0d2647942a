"""Stable-Baselines3's TD3 with a faster update; the same mathematics.

Against the original: no gradients of the critic's weights while the actor learns, one Adam kernel per
optimiser (`fused`, set where the algorithm is made), and one call per list of weights in the slow following
of the targets.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import TD3
from stable_baselines3.common.noise import ActionNoise
from torch.nn.functional import mse_loss

from rl.action import CONTROLS


class ScheduledNoise(ActionNoise):
    """Gaussian noise on the five elements of an action, from NumPy's global generator as all of SB3."""

    def __init__(self, deviation: Callable[[], float]) -> None:
        """Ask `deviation` for the standard deviation at each draw."""
        super().__init__()
        self._deviation = deviation

    def __call__(self) -> NDArray[np.float32]:
        """One draw, shape (5,)."""
        return np.random.normal(0.0, self._deviation(), 5).astype(np.float32)  # noqa: NPY002 - as SB3


class FastTD3(TD3):
    """TD3 (Fujimoto, van Hoof, Meger 2018): clipped double Q-learning, target smoothing, delayed actor.

    Attributes:
        saturation_weight: weight of the actor's penalty for inputs of its last tanh beyond
            `saturation_bound`, where its gradient dies and an action once at its end stays there; 0 is TD3
            as published.
        saturation_bound: 1.5 lets actions reach 0.905 without a penalty.
        prior_weight: weight of the actor's penalty for the squares of those inputs. Where the critic sees no
            difference it draws actions to 0, which keeps the target, the gains 6/2 and the clock.
        control_prior: asked at each update for the weight of one more such penalty, on all elements but the
            shift of the target. A critic of landings that end in +1, -1 or -10 errs by more than the gains
            are worth, and an actor that follows its errors lands hard.
        smoothing_noise: asked at each update for the standard deviation of the noise on the target actor's
            actions, clipped at 2.5 of it; None is TD3 as published, 0.2 throughout. Smoothing far wider than
            the exploration asks the critic about actions that nobody took: as the exploration fell to 0.1
            its values sank to -30, below any return, and the critic's loss rose from 0.7 to 2.2.
        return_bounds: least and greatest return that an episode can have; target values are clipped to them.
    """

    saturation_weight: float = 0.0
    saturation_bound: float = 1.5
    prior_weight: float = 0.0
    control_prior: Callable[[], float] | None = None
    smoothing_noise: Callable[[], float] | None = None
    return_bounds: tuple[float, float] | None = None

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
            deviation, limit = self.target_policy_noise, self.target_noise_clip
            if self.smoothing_noise is not None:
                deviation = self.smoothing_noise()
                limit = 2.5 * deviation
            noise = (torch.randn_like(batch.actions) * deviation).clamp_(-limit, limit)
            actions = (self.actor_target(batch.next_observations) + noise).clamp_(-1.0, 1.0)
            value = torch.minimum(*self.critic_target(batch.next_observations, actions))
            if self.return_bounds is not None:
                value.clamp_(*self.return_bounds)
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
        if self.saturation_weight > 0.0:
            excess = (inputs.abs() - self.saturation_bound).clamp_min(0.0)
            loss = loss + self.saturation_weight * excess.square().sum(1).mean()
        if self.prior_weight > 0.0:
            loss = loss + self.prior_weight * inputs.square().sum(1).mean()
        if self.control_prior is not None and (weight := self.control_prior()) > 0.0:
            loss = loss + weight * inputs[:, :CONTROLS].square().sum(1).mean()
        self.actor.optimizer.zero_grad()
        loss.backward()
        self.actor.optimizer.step()
        self.critic.requires_grad_(True)
        follow = vars(torch)["_foreach_lerp_"]  # the one call that optimisers use; not in the type stubs
        with torch.no_grad():
            for network, target in ((self.critic, self.critic_target), (self.actor, self.actor_target)):
                follow(list(target.parameters()), list(network.parameters()), self.tau)
        return loss.item()
