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
8. The first `random_steps` have uniform actions; exploration noise, target smoothing and learning rate may
   decay; values may be clipped to what a return can be; and two penalties (0 switches them off) keep the
   actor off the ends of its range. See `Hyperparameters`.
9. Truncated episodes keep the value of their last observation; d = 1 only where the task itself ended.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from rl.recurrent_networks import NetworkSizes, RecurrentActor, TwinCritic
from rl.replay import Episode, EpisodeReplay, SequenceBatch

Array = NDArray[np.float32]
Schedule = Callable[[int], float]


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
        return_bounds: least and greatest return that an episode can have; target values are clipped to them.
        policy_delay: updates of the critics for one of the actor and the targets.
        random_steps: steps with uniform actions before the first update.
        update_every: environment steps for one update.
        replay_size: rows kept; an episode of T transitions takes T + 1.
        window: longest sequence of the plus variant; longer episodes give windows of that many transitions.
        burn_in: transitions before a window that only fill the memory.
        saturation_weight: of the penalty for inputs of the actor's tanh beyond `saturation_bound`.
        saturation_bound: 1.5 lets actions reach 0.905 without a penalty.
        prior_weight: of the penalty for the squares of those inputs.
    """

    plus: bool = False
    memory: int = 128
    head: tuple[int, ...] = (256,)
    batch_size: int = 100
    discount: float = 0.99
    target_rate: float = 0.005
    return_bounds: tuple[float, float] | None = None
    policy_delay: int = 2
    random_steps: int = 1_000
    update_every: int = 1
    replay_size: int = 200_000
    window: int = 50
    burn_in: int = 0
    saturation_weight: float = 0.0
    saturation_bound: float = 1.5
    prior_weight: float = 0.0


@dataclass(frozen=True, eq=False)
class AgentMemory:
    """What an agent remembers between two steps of n environments.

    Attributes:
        hidden: shape (n, memory), output of the LSTM.
        cell: shape (n, memory).
        action: shape (n, a), last action in [-1, 1].
    """

    hidden: Array
    cell: Array
    action: Array


class RecurrentTD3:
    """TD3 with LSTM. `learn`, `predict`, and what a checkpoint needs have the names of Stable-Baselines3.

    Attributes:
        env: what it learns from.
        settings: its hyperparameters.
        learning_rate: of Adam, at an environment step.
        exploration_noise: standard deviation of the noise on actions, at an environment step.
        smoothing_noise: standard deviation of the noise on the target actor's actions, at one.
        num_timesteps: environment steps so far.
        logger: with `record(name, value)`; None for none.
    """

    def __init__(
        self,
        env: Any,
        settings: Hyperparameters,
        seed: int,
        learning_rate: Schedule = lambda step: 1e-3,
        exploration_noise: Schedule = lambda step: 0.1,
        smoothing_noise: Schedule = lambda step: 0.2,
    ) -> None:
        """Make it untrained.

        Args:
            env: Gymnasium environment with one-dimensional boxes for observations and actions.
            settings: hyperparameters.
            seed: of weights, exploration, sampling and the environment's first reset.
            learning_rate: of Adam, by environment step.
            exploration_noise: standard deviation on actions in [-1, 1], by environment step.
            smoothing_noise: standard deviation on the target actor's actions, clipped at 2.5 of it, by
                environment step.

        Raises:
            ValueError: the spaces are not boxes of one dimension.
        """
        for name in ("observation_space", "action_space"):
            if len(getattr(getattr(env, name), "shape", None) or ()) != 1:
                raise ValueError(f"env must have a one-dimensional Box as {name}, got {getattr(env, name)}")
        self.env, self.settings, self.seed = env, settings, seed
        self.observation_space, self.action_space = env.observation_space, env.action_space
        self.learning_rate, self.exploration_noise = learning_rate, exploration_noise
        self.smoothing_noise = smoothing_noise
        size = NetworkSizes(
            env.observation_space.shape[0],
            env.action_space.shape[0],
            settings.memory,
            settings.head,
            previous_reward=settings.plus,
        )
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            self.actor = RecurrentActor(size)
            self.critic = TwinCritic(size, shared=settings.plus)
        self.actor_target, self.critic_target = deepcopy(self.actor), deepcopy(self.critic)
        self.actor_target.requires_grad_(False)
        self.critic_target.requires_grad_(False)
        rate = learning_rate(0)
        self.actor_optimizer = torch.optim.Adam(self.actor.parameters(), lr=rate, fused=True)
        self.critic_optimizer = torch.optim.Adam(self.critic.parameters(), lr=rate, fused=True)
        self.replay_buffer = EpisodeReplay(settings.replay_size, size.observation, size.action)
        self.rng = np.random.default_rng(seed)
        self.action_space.seed(seed)
        self.num_timesteps = self._n_updates = self._episode_num = 0
        self.logger: Any = None
        # the episode under way
        self._seen: list[Array] = []
        self._actions: list[Array] = []
        self._rewards: list[float] = []
        self._memory: AgentMemory | None = None

    # Acting

    def predict(
        self,
        observation: Array,
        state: AgentMemory | None = None,
        episode_start: NDArray[np.bool_] | bool | None = None,
        deterministic: bool = False,
        reward: NDArray[np.floating] | float | None = None,
    ) -> tuple[Array, AgentMemory]:
        """Action and memory after one observation, or after one observation of each of n environments.

        Args:
            observation: shape (o,) or (n, o).
            state: memory that the last call gave; None at the start.
            episode_start: shape (n,), where the memory is to be forgotten.
            deterministic: without exploration noise.
            reward: shape (n,), the reward that came with the observation; the plus variant reads it, and
                takes 0 if it is not given.

        Returns:
            Action in the environment's own units, and the memory for the next call.
        """
        seen = np.atleast_2d(np.asarray(observation, np.float32))
        n = seen.shape[0]
        memory = state if state is not None else self._empty_memory(n)
        last_reward = np.zeros(n, np.float32)
        if reward is not None:
            last_reward[:] = reward
        if episode_start is not None:
            keep = np.float32(1.0) - np.broadcast_to(np.asarray(episode_start, np.float32), (n,))
            memory = AgentMemory(*(part * keep[:, None] for part in vars(memory).values()))
            last_reward *= keep
        history = [seen, memory.action]
        if self.settings.plus:
            history.append(last_reward[:, None])
        with torch.no_grad():
            past = tuple(torch.from_numpy(np.float32(part))[None] for part in (memory.hidden, memory.cell))
            inputs, (hidden, cell) = self.actor(
                torch.from_numpy(seen)[None],
                torch.from_numpy(np.concatenate(history, 1))[None],
                past,
            )
        action = np.tanh(inputs[0].numpy())
        if not deterministic:
            noise = self.rng.normal(0.0, self.exploration_noise(self.num_timesteps), action.shape)
            action = np.clip(action + noise, -1.0, 1.0).astype(np.float32)
        after = AgentMemory(hidden[0].numpy(), cell[0].numpy(), action)
        own = self._unscaled(action)
        return (own[0] if np.ndim(observation) == 1 else own), after

    def _empty_memory(self, n: int) -> AgentMemory:
        size = self.settings.memory
        shapes = ((n, size), (n, size), (n, self.action_space.shape[0]))
        return AgentMemory(*(np.zeros(shape, np.float32) for shape in shapes))

    def _unscaled(self, action: Array) -> Array:
        """From [-1, 1] to the bounds of the action space."""
        low, high = self.action_space.low, self.action_space.high
        return (low + 0.5 * (action + 1.0) * (high - low)).astype(np.float32)

    # Learning

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
            callback: of Stable-Baselines3's kind (`init_callback`, `on_rollout_start`, `update_locals`,
                `on_step`), or None. A step that returns False ends the learning.
            log_interval: not used; the callback logs.
            reset_num_timesteps: count the steps from 0.
        """
        if reset_num_timesteps:
            self.num_timesteps = 0
        if callback is not None:
            callback.init_callback(self)
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
            tensors = SequenceTensors.of(batch, self.settings.plus)
            critic_loss = self._update_critics(tensors)
            self._record("train/critic_loss", critic_loss)
            if self._n_updates % self.settings.policy_delay == 0:
                self._record("train/actor_loss", self._update_actor(tensors))

    def _record(self, name: str, value: float) -> None:
        if self.logger is not None:
            self.logger.record(name, value)

    def _update_critics(self, batch: SequenceTensors) -> float:
        loss = self.critic_loss(batch, self._smoothing_noise(batch.actions.shape))
        self.critic_optimizer.zero_grad()
        loss.backward()
        self.critic_optimizer.step()
        return loss.item()

    def _smoothing_noise(self, shape: torch.Size) -> Tensor:
        noise = self.rng.standard_normal(tuple(shape), dtype=np.float32).clip(-2.5, 2.5)
        return torch.from_numpy(noise * np.float32(self.smoothing_noise(self.num_timesteps)))

    def critic_loss(self, batch: SequenceTensors, noise: Tensor) -> Tensor:
        """Mean square temporal-difference error of both values over the transitions that count.

        Args:
            batch: T transitions of N sequences.
            noise: of target smoothing, shape (T, N, a).
        """
        with torch.no_grad():
            inputs, _ = self.actor_target(batch.observations, batch.history)
            actions = (torch.tanh(inputs[1:]) + noise).clamp_(-1.0, 1.0)
            pasts = [past[1:] for past in self.critic_target.remember(batch.history)]
            value = torch.minimum(*self.critic_target.values(pasts, batch.observations[1:], actions))
            if self.settings.return_bounds is not None:
                value.clamp_(*self.settings.return_bounds)
            target = batch.rewards + (1.0 - batch.terminated) * self.settings.discount * value
        pasts = self.critic.remember(batch.history[:-1])
        loss = torch.zeros(())
        for value in self.critic.values(pasts, batch.observations[:-1], batch.actions):
            loss = loss + batch.mean((value - target).square())
        return loss

    def actor_loss(self, batch: SequenceTensors) -> Tensor:
        """Mean of -Q_1(h_t, mu(h_t)) and the penalties over the transitions that count."""
        s = self.settings
        inputs, _ = self.actor(batch.observations[:-1], batch.history[:-1])
        with torch.no_grad():  # the past holds no action of this actor
            pasts = self.critic.remember(batch.history[:-1], count=1)
        (value,) = self.critic.values(pasts, batch.observations[:-1], torch.tanh(inputs))
        loss = batch.mean(-value)
        if s.saturation_weight > 0.0:
            excess = (inputs.abs() - s.saturation_bound).clamp_min(0.0)
            loss = loss + s.saturation_weight * batch.mean(excess.square().sum(-1))
        if s.prior_weight > 0.0:
            loss = loss + s.prior_weight * batch.mean(inputs.square().sum(-1))
        return loss

    def _update_actor(self, batch: SequenceTensors) -> float:
        self.critic.requires_grad_(False)
        loss = self.actor_loss(batch)
        self.actor_optimizer.zero_grad()
        loss.backward()
        self.actor_optimizer.step()
        self.critic.requires_grad_(True)
        follow = vars(torch)["_foreach_lerp_"]  # the one call that optimisers use; not in the type stubs
        with torch.no_grad():
            for network, target in ((self.critic, self.critic_target), (self.actor, self.actor_target)):
                follow(list(target.parameters()), list(network.parameters()), self.settings.target_rate)
        return loss.item()

    def _get_torch_save_params(self) -> tuple[list[str], list[str]]:
        """What a checkpoint keeps of torch: modules and optimisers, no single tensors."""
        networks = ["actor", "critic", "actor_target", "critic_target"]
        return [*networks, "actor_optimizer", "critic_optimizer"], []


@dataclass(frozen=True, eq=False)
class SequenceTensors:
    """A batch of sequences in torch; shapes as in `rl.replay.SequenceBatch`.

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
    def of(cls, batch: SequenceBatch, previous_reward: bool) -> SequenceTensors:
        """From arrays."""
        parts = [batch.observations, batch.previous_actions]
        if previous_reward:
            parts.append(batch.previous_rewards[..., None])
        arrays = (batch.actions, batch.rewards, batch.terminated, batch.counted)
        return cls(
            torch.from_numpy(batch.observations),
            torch.from_numpy(np.concatenate(parts, -1)),
            *(torch.from_numpy(array) for array in arrays),
        )

    def mean(self, values: Tensor) -> Tensor:
        """Mean over the transitions that count; values (T, N)."""
        return (values * self.counted).sum() / self.counted.sum()
