"""An agent with memory acts: an observation and a memory go in, an action and a memory come out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from rl.inference.arrays import Array32
from rl.learning.box_spaces import check_environment
from rl.learning.recurrent.hyperparameters import Hyperparameters
from rl.learning.recurrent.losses import ActorCritic
from rl.learning.recurrent.networks import NetworkSizes


@dataclass(frozen=True, eq=False)
class AgentMemory:
    """What an agent remembers between two steps of n environments.

    Attributes:
        hidden: shape (n, memory), output of the LSTM.
        cell: shape (n, memory).
        action: shape (n, a), last action in [-1, 1].
    """

    hidden: Array32
    cell: Array32
    action: Array32

    @classmethod
    def empty(cls, environments: int, memory: int, action: int) -> AgentMemory:
        """Nothing remembered: zeros."""
        return cls(*(np.zeros((environments, size), np.float32) for size in (memory, memory, action)))

    def kept(self, keep: Array32) -> AgentMemory:
        """The memory where `keep`, shape (n,), is 1, and nothing where it is 0."""
        return AgentMemory(*(part * keep[:, None] for part in vars(self).values()))


class RecurrentAgent:
    """Networks with memory for the spaces of an environment, and Stable-Baselines3's `predict` with them.

    Attributes:
        observation_space: of the environment.
        action_space: of the environment.
        settings: hyperparameters.
        sizes: of the networks.
        networks: all four; also by name, as a checkpoint keeps them.
        device: where the networks are.
        rng: draws the exploration, and whatever a learner draws.
        num_timesteps: environment steps so far.
    """

    def __init__(self, env: Any, settings: Hyperparameters, seed: int, device: str = "cpu") -> None:
        """Make it untrained.

        Args:
            env: Gymnasium environment with one-dimensional boxes for observations and actions; those of
                actions are finite.
            settings: hyperparameters.
            seed: of weights and exploration.
            device: of torch, where the networks are.

        Raises:
            ValueError: the spaces are not such boxes.
        """
        check_environment(env)
        self.settings = settings
        self.observation_space, self.action_space = env.observation_space, env.action_space
        self.sizes = NetworkSizes(
            env.observation_space.shape[0],
            env.action_space.shape[0],
            settings.memory,
            settings.hidden,
            previous_reward=settings.plus,
        )
        self.device = torch.device(device)
        self.networks = ActorCritic.untrained(self.sizes, settings.plus, seed).to(self.device)
        self.actor, self.critic = self.networks.actor, self.networks.critic
        self.actor_target, self.critic_target = self.networks.actor_target, self.networks.critic_target
        self.rng = np.random.default_rng(seed)
        self.action_space.seed(seed)
        self.num_timesteps = 0

    def predict(
        self,
        observation: Array32,
        state: AgentMemory | None = None,
        episode_start: NDArray[np.bool_] | bool | None = None,
        deterministic: bool = False,
        reward: NDArray[np.floating] | float | None = None,
    ) -> tuple[Array32, AgentMemory]:
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
            memory = memory.kept(keep)
            last_reward *= keep
        action, hidden, cell = self._act(seen, memory, last_reward)
        if not deterministic:
            noise = self.rng.normal(0.0, self.settings.exploration_noise, action.shape)
            action = np.clip(action + noise, -1.0, 1.0).astype(np.float32)
        after = AgentMemory(hidden, cell, action)
        own = self._unscaled(action)
        return (own[0] if np.ndim(observation) == 1 else own), after

    def _act(self, seen: Array32, memory: AgentMemory, reward: Array32) -> tuple[Array32, Array32, Array32]:
        """Action without noise, and what the LSTM keeps: hidden and cell."""
        history = [seen, memory.action]
        if self.settings.plus:
            history.append(reward[:, None])
        with torch.no_grad():
            past = (self._tensor(memory.hidden)[None], self._tensor(memory.cell)[None])
            entered = self._tensor(np.concatenate(history, 1))[None]
            inputs, (hidden, cell) = self.actor(self._tensor(seen)[None], entered, past)
        return np.tanh(inputs[0].cpu().numpy()), hidden[0].cpu().numpy(), cell[0].cpu().numpy()

    def _tensor(self, values: Array32) -> torch.Tensor:
        return torch.from_numpy(values).to(self.device)

    def _empty_memory(self, n: int) -> AgentMemory:
        return AgentMemory.empty(n, self.settings.memory, self.action_space.shape[0])

    def _unscaled(self, action: Array32) -> Array32:
        """From [-1, 1] to the bounds of the action space, in its own type: rounding never leaves it."""
        low, high = self.action_space.low, self.action_space.high
        own = (low + 0.5 * (action + 1.0) * (high - low)).astype(self.action_space.dtype)
        return np.clip(own, low, high)
