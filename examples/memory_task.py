"""Train TD3 with LSTM on your own task: a cue is shown once, and three steps later the action must match it.

`RecurrentTD3` runs on any Gymnasium environment with one-dimensional boxes; nothing here is of landers. An
agent without memory earns exactly 0 on the mean here: when it has to act it sees the same for both cues.

    python -m examples.memory_task
"""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from rl.learning.recurrent.hyperparameters import Hyperparameters
from rl.learning.recurrent.td3_lstm import RecurrentTD3


class Recall(gymnasium.Env):
    """The observation is (cue, time); after the first step the cue reads 0."""

    observation_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
    action_space = spaces.Box(-1.0, 1.0, (1,), np.float32)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        """Draw a cue, or take that of the options."""
        super().reset(seed=seed)
        self.time = 0
        self.cue = options["cue"] if options else float(self.np_random.choice([-1.0, 1.0]))
        return self._look(), {}

    def _look(self) -> np.ndarray:
        return np.array([self.cue if self.time == 0 else 0.0, self.time / 4.0], np.float32)

    def step(self, action: np.ndarray):
        """Only the fourth action counts: 1 where it is the cue, -1 where it is the opposite."""
        self.time += 1
        ended = self.time == 4
        return self._look(), self.cue * float(action[0]) if ended else 0.0, ended, False, {}


def mean_reward(agent: RecurrentTD3) -> float:
    """Mean over both cues; memory goes in and comes out, as with Stable-Baselines3's recurrent agents."""
    env, total = Recall(), 0.0
    for cue in (-1.0, 1.0):
        observation, _ = env.reset(options={"cue": cue})
        state, ended = None, False
        while not ended:
            action, state = agent.predict(observation, state, deterministic=True)
            observation, reward, ended, _, _ = env.step(action)
            total += 0.5 * float(reward)
    return total


SETTINGS = Hyperparameters(
    plus=True,
    memory=16,
    hidden=(32,),
    batch_size=32,
    random_steps=400,
    update_every=2,
    discount=0.95,
    target_rate=0.02,
    exploration_noise=0.3,
    saturation_weight=0.1,
)
"""The modern variant, small."""


def main() -> None:
    """Train it for 1400 steps."""
    agent = RecurrentTD3(Recall(), SETTINGS, seed=0, learning_rate=lambda step: 3e-3)
    print(f"mean reward before: {mean_reward(agent):.2f}")  # noqa: T201 - an example talks
    agent.learn(1400)
    print(f"mean reward after {agent.num_timesteps} steps: {mean_reward(agent):.2f}")  # noqa: T201


if __name__ == "__main__":
    main()
