"""TD3 with LSTM: deterministic policies of the whole history, for any Gymnasium environment with boxes.

`RecurrentTD3` learns with clipped double Q-learning, target smoothing and delayed updates (Fujimoto,
van Hoof, Meger 2018) on sequences, in two variants:

- **printed** (`td3-lstm`): the paper's Algorithm 3. Two critics with an LSTM each; the history is the past
  observations and actions; every mini-batch holds whole episodes of one length.
- **plus** (`td3-lstm-plus`): what Ni et al. (2022, arXiv 2110.05038) found to decide whether memory helps:
  an encoder for the actor and another one for both values, the previous reward in the history, and one masked
  memory from which episodes of all lengths are drawn.

Deviations of the printed variant from Algorithm 3 as printed:

1. It draws the length T uniformly up to t_max. Here T is drawn among the lengths of which there are at least
   N episodes, in proportion to their transitions: else the few episodes of a rare length count as much as
   all others together, and an empty buffer cannot be sampled.
2. One ring keeps all episodes and B[T] is those of length T, so that the oldest go first, of any length.
3. It never updates the target networks (the paper's text does, in its section on DDPG). Here they follow with
   rate tau at each update of the actor, as in TD3.
4. It updates the actor as often as the critics. Here it waits `policy_delay` updates, as the paper's text.
5. It updates once after each episode. Here there is one update every `update_every` steps.
6. The critics' targets use each critic's own history network; the action in front of the first observation is
   zero and not random, since there is none.
7. The loss as printed trains both critics through one Q; here each has its own error.
8. The first `random_steps` have uniform actions; the learning rate may decay; and penalties (0 switches
   them off) keep the actor off the ends of its range and near 0. See `Hyperparameters` and
   `RecurrentTD3.action_prior`.
9. The mini-batch's history is printed with rewards and ends in it, the acting one without. Here both are the
   observations and the actions before them, so that what learns sees what acts.
10. Truncated episodes keep the value of their last observation; d = 1 only where the task itself ended.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch
from torch import Tensor

from rl.inference.arrays import Array32
from rl.learning.recurrent.agent import AgentMemory, RecurrentAgent
from rl.learning.recurrent.hyperparameters import Hyperparameters
from rl.learning.recurrent.losses import SequenceTensors, actor_loss, critic_loss
from rl.learning.recurrent.replay import Episode, EpisodeReplay, SequenceBatch

Schedule = Callable[[int], float]


class RecurrentTD3(RecurrentAgent):
    """TD3 with LSTM. `learn`, `predict`, and what a checkpoint needs have the names of Stable-Baselines3.

    Attributes:
        env: what it learns from.
        learning_rate: of Adam, at an environment step.
        action_prior: weights, shape (a,), of a penalty that draws each element of the actor's action to 0, at
            one; None for none.
        logger: with `record(name, value)`; None for none.
    """

    def __init__(
        self,
        env: Any,
        settings: Hyperparameters,
        seed: int,
        learning_rate: Schedule = lambda step: 1e-3,
        device: str = "cpu",
    ) -> None:
        """Make it untrained.

        Args:
            env: Gymnasium environment with one-dimensional boxes for observations and actions; those of
                actions are finite.
            settings: hyperparameters.
            seed: of weights, exploration, sampling and the environment's first reset.
            learning_rate: of Adam, by environment step.
            device: of torch, where it learns.

        Raises:
            ValueError: the spaces are not such boxes.
        """
        super().__init__(env, settings, seed, device)
        self.env, self.seed = env, seed
        self.learning_rate = learning_rate
        self.action_prior: Callable[[int], Array32] | None = None
        rate = learning_rate(0)
        self.actor_optimizer = torch.optim.Adam(self.actor.parameters(), lr=rate, fused=True)
        self.critic_optimizer = torch.optim.Adam(self.critic.parameters(), lr=rate, fused=True)
        self.replay_buffer = EpisodeReplay(settings.replay_size, self.sizes.observation, self.sizes.action)
        self._n_updates = self._episode_num = 0
        self.logger: Any = None
        # the episode under way
        self._seen: list[Array32] = []
        self._actions: list[Array32] = []
        self._rewards: list[float] = []
        self._memory: AgentMemory | None = None

    def set_logger(self, logger: Any) -> None:
        """Where losses go."""
        self.logger = logger

    def restart_episode(self) -> None:
        """Begin the next episode of the environment; the first is seeded."""
        first = not self._seen and self.num_timesteps == 0
        self._seen = [self.env.reset(seed=self.seed)[0] if first else self.env.reset()[0]]
        self._actions, self._rewards, self._memory = [], [], None

    def learn(
        self,
        total_timesteps: int,
        callback: Any = None,
        log_interval: int | None = None,
        reset_num_timesteps: bool = True,
    ) -> RecurrentTD3:
        """Learn for so many environment steps.

        Args:
            total_timesteps: steps.
            callback: of Stable-Baselines3's kind (`init_callback`, `on_training_start`, `on_rollout_start`,
                `update_locals`, `on_step`), or None. A step that returns False ends the learning.
            log_interval: not used; the callback logs.
            reset_num_timesteps: count the steps from 0.
        """
        if reset_num_timesteps:
            self.num_timesteps = 0
        if callback is not None:
            callback.init_callback(self)
            callback.on_training_start(locals(), globals())
        if not self._seen:
            self.restart_episode()
        last = self.num_timesteps + total_timesteps
        while self.num_timesteps < last:
            if callback is not None:
                callback.on_rollout_start()
            reward, done, info = self._step()
            if callback is not None:
                callback.update_locals({"rewards": [reward], "dones": [done], "infos": [info]})
                if not callback.on_step():
                    break
            beyond = self.num_timesteps - self.settings.random_steps
            if beyond > 0 and beyond % self.settings.update_every == 0:
                self.train(1)
        return self

    def _step(self) -> tuple[float, bool, dict[str, Any]]:
        reward = self._rewards[-1] if self._rewards else 0.0
        if self.num_timesteps < self.settings.random_steps:
            # a random step needs no memory: updates see whole episodes and fill it anew
            action = self.rng.uniform(-1.0, 1.0, self.action_space.shape[0]).astype(np.float32)
            taken = self._unscaled(action)
        else:
            if self._memory is None and len(self._seen) > 1:
                self._memory = self._remembered()
            taken, self._memory = self.predict(self._seen[-1], self._memory, reward=reward)
            action = self._memory.action[0]
        observation, reward, terminated, truncated, info = self.env.step(taken)
        self.num_timesteps += 1
        self._seen.append(observation)
        self._actions.append(action)
        self._rewards.append(float(reward))
        if terminated or truncated:
            self._episode_num += 1
            parts = (np.array(part, np.float32) for part in (self._seen, self._actions, self._rewards))
            self.replay_buffer.store(Episode(*parts, terminated=bool(terminated)))
            self.restart_episode()
        return float(reward), bool(terminated or truncated), info

    def _remembered(self) -> AgentMemory:
        """Memory of an episode that began with random steps."""
        memory = None
        for k, seen in enumerate(self._seen[:-1]):
            before = self._rewards[k - 1] if k else 0.0
            _, memory = self.predict(seen, memory, deterministic=True, reward=before)
            memory = AgentMemory(memory.hidden, memory.cell, self._actions[k][None])
        assert memory is not None
        return memory

    def sample(self) -> SequenceBatch | None:
        """A mini-batch of sequences, or None while there are too few episodes."""
        s = self.settings
        if s.plus:
            return self.replay_buffer.sample_mixed_lengths(s.batch_size, s.window, s.burn_in, self.rng)
        return self.replay_buffer.sample_equal_lengths(s.batch_size, self.rng)

    def train(self, gradient_steps: int) -> None:
        """Update the critics, and every `policy_delay` updates the actor and the targets."""
        rate = self.learning_rate(self.num_timesteps)
        for optimizer in (self.actor_optimizer, self.critic_optimizer):
            optimizer.param_groups[0]["lr"] = rate
        for _ in range(gradient_steps):
            batch = self.sample()
            if batch is None:
                return
            self._n_updates += 1
            tensors = SequenceTensors.of(batch, self.settings.plus, self.device)
            self._record("train/critic_loss", self._update_critics(tensors))
            if self._n_updates % self.settings.policy_delay == 0:
                self._record("train/actor_loss", self._update_actor(tensors))

    def _record(self, name: str, value: float) -> None:
        if self.logger is not None:
            self.logger.record(name, value)

    def _update_critics(self, batch: SequenceTensors) -> float:
        noise = self._smoothing_noise(batch.actions.shape)
        loss = critic_loss(self.networks, batch, noise, self.settings)
        self.critic_optimizer.zero_grad()
        loss.backward()
        self.critic_optimizer.step()
        return loss.item()

    def _smoothing_noise(self, shape: torch.Size) -> Tensor:
        noise = self.rng.standard_normal(tuple(shape), dtype=np.float32).clip(-2.5, 2.5)
        return self._tensor(noise * np.float32(self.settings.smoothing_noise))

    def _update_actor(self, batch: SequenceTensors) -> float:
        self.critic.requires_grad_(False)
        prior = None if self.action_prior is None else self.action_prior(self.num_timesteps)
        weights = None if prior is None or not prior.any() else self._tensor(prior)
        loss = actor_loss(self.networks, batch, self.settings, weights)
        self.actor_optimizer.zero_grad()
        loss.backward()
        self.actor_optimizer.step()
        self.critic.requires_grad_(True)
        self.networks.follow(self.settings.target_rate)
        return loss.item()

    def _get_torch_save_params(self) -> tuple[list[str], list[str]]:
        """What a checkpoint keeps of torch: modules and optimisers, no single tensors."""
        networks = ["actor", "critic", "actor_target", "critic_target"]
        return [*networks, "actor_optimizer", "critic_optimizer"], []
