"""Proximal policy optimisation in one file, on the native vector environment, by torch and Gymnasium alone.

Schulman et al. (2017), with generalised advantages (Schulman et al., 2016). It is written to be read and
changed. What is particular to landing stands where it is used.

    python -m examples.ppo_single_file --steps 400000
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import deque
from dataclasses import dataclass

import gymnasium
import numpy as np
import torch
from torch import nn
from torch.distributions import Normal


@dataclass(frozen=True)
class Settings:
    """What decides how it learns.

    Attributes:
        steps: decisions flown in all, rounded down to whole updates; one update at least.
        environments: that fly together.
        horizon: decisions of each environment between two updates.
        epochs: passes over what was flown.
        minibatch: decisions of one gradient step.
        learning_rate: of Adam at the start; it falls to zero along a line.
        discount: gamma.
        trace: lambda, of the generalised advantages.
        clip: how far the ratio of likelihoods may leave 1.
        value_weight: of the critic's loss.
        greatest_gradient: norm at which gradients are cut.
        log_deviation: of the actions at the start. Their range is [-1, 1]: with a deviation of 1 about two in
            three of the first flights crash, with this one about one in a hundred.
        seed: of the weights, the actions and the episodes.
    """

    steps: int = 400_000
    environments: int = 64
    horizon: int = 32
    epochs: int = 10
    minibatch: int = 512
    learning_rate: float = 1e-3
    discount: float = 0.99
    trace: float = 0.95
    clip: float = 0.2
    value_weight: float = 0.5
    greatest_gradient: float = 0.5
    log_deviation: float = -1.5
    seed: int = 0


def make_network(inputs: int, outputs: int, last_gain: float) -> nn.Sequential:
    """Two hidden layers; a small last gain begins near zero, which is the middle of every action's range."""
    layers: list[nn.Module] = []
    for size in (256, 256):
        layers += [nn.Linear(inputs, size), nn.Tanh()]
        inputs = size
    network = nn.Sequential(*layers, nn.Linear(inputs, outputs))
    linear = [layer for layer in network if isinstance(layer, nn.Linear)]
    for layer in linear:
        nn.init.orthogonal_(layer.weight, last_gain if layer is linear[-1] else 2.0**0.5)
        nn.init.zeros_(layer.bias)
    return network


class Agent(nn.Module):
    """A Gaussian actor and a critic."""

    def __init__(self, observation: int, action: int, log_deviation: float) -> None:
        """Make both from the sizes of an observation and an action."""
        super().__init__()
        self.actor = make_network(observation, action, 0.01)
        self.critic = make_network(observation, 1, 1.0)
        self.log_deviation = nn.Parameter(torch.full((action,), log_deviation))

    def distribution(self, seen: torch.Tensor) -> Normal:
        """Of the actions; the environment clips what lies outside of [-1, 1]."""
        return Normal(self.actor(seen), self.log_deviation.exp())

    def value(self, seen: torch.Tensor) -> torch.Tensor:
        """Expected return."""
        return self.critic(seen).squeeze(-1)


@dataclass(frozen=True)
class Rollout:
    """Flown between two updates: shapes (horizon, environments, ...), `next_value` (environments,)."""

    seen: torch.Tensor
    action: torch.Tensor
    likelihood: torch.Tensor
    value: torch.Tensor
    reward: torch.Tensor
    ended: torch.Tensor
    next_value: torch.Tensor


class Pilot:
    """Flies the agent on, and counts returns."""

    def __init__(self, envs: gymnasium.vector.VectorEnv, agent: Agent, settings: Settings) -> None:
        """Begin the episodes of the seed."""
        self.envs, self.agent, self.settings = envs, agent, settings
        self.seen = torch.from_numpy(envs.reset(seed=settings.seed)[0])
        self.running = np.zeros(envs.num_envs)
        self.returns: deque[float] = deque(maxlen=500)
        self.landed: deque[bool] = deque(maxlen=500)

    @torch.no_grad()
    def fly(self) -> Rollout:
        """Fly one horizon."""
        kept: list[tuple[torch.Tensor, ...]] = []
        for _ in range(self.settings.horizon):
            chance, value = self.agent.distribution(self.seen), self.agent.value(self.seen)
            action = chance.sample()
            following, reward, terminated, truncated, info = self.envs.step(action.numpy())
            gain, ended = torch.from_numpy(reward).float(), torch.from_numpy(terminated | truncated)
            if "final_obs" in info:  # an episode that was cut in flight had more to come
                last = self.agent.value(torch.from_numpy(info["final_obs"]))
                gain += self.settings.discount * last * torch.from_numpy(truncated & ~terminated)
            self._count(reward, ended.numpy(), info)
            kept.append((self.seen, action, chance.log_prob(action).sum(-1), value, gain, ended))
            self.seen = torch.from_numpy(following)
        parts = [torch.stack(part) for part in zip(*kept, strict=True)]
        return Rollout(*parts, next_value=self.agent.value(self.seen))

    def _count(self, reward: np.ndarray, ended: np.ndarray, info: dict) -> None:
        self.running += reward
        if ended.any():
            self.returns.extend(self.running[ended].tolist())
            self.landed.extend(info["final_info"]["is_success"][ended].tolist())
            self.running[ended] = 0.0


def estimate_advantages(rollout: Rollout, discount: float, trace: float) -> torch.Tensor:
    """Generalised advantages, shape (horizon, environments)."""
    advantages, carried, following = torch.zeros_like(rollout.reward), 0.0, rollout.next_value
    for k in reversed(range(len(rollout.reward))):
        goes_on = (~rollout.ended[k]).float()
        surprise = rollout.reward[k] + discount * following * goes_on - rollout.value[k]
        carried = surprise + discount * trace * goes_on * carried
        advantages[k], following = carried, rollout.value[k]
    return advantages


def update(agent: Agent, optimiser: torch.optim.Optimizer, rollout: Rollout, settings: Settings) -> None:
    """Climb the clipped objective for some epochs."""
    advantages = estimate_advantages(rollout, settings.discount, settings.trace)
    returns = (advantages + rollout.value).flatten()
    seen, action = rollout.seen.flatten(0, 1), rollout.action.flatten(0, 1)
    before, weight = rollout.likelihood.flatten(), advantages.flatten()
    for _ in range(settings.epochs):
        for chosen in torch.randperm(len(seen)).split(settings.minibatch):
            gain = (weight[chosen] - weight[chosen].mean()) / (weight[chosen].std() + 1e-8)
            chance = agent.distribution(seen[chosen])
            ratio = (chance.log_prob(action[chosen]).sum(-1) - before[chosen]).exp()
            clipped = ratio.clamp(1.0 - settings.clip, 1.0 + settings.clip)
            actor_loss = -torch.minimum(ratio * gain, clipped * gain).mean()
            critic_loss = (agent.value(seen[chosen]) - returns[chosen]).square().mean()
            optimiser.zero_grad()
            (actor_loss + settings.value_weight * critic_loss).backward()
            nn.utils.clip_grad_norm_(agent.parameters(), settings.greatest_gradient)
            optimiser.step()


def train(settings: Settings) -> tuple[Agent, list[tuple[int, float, float]]]:
    """Learn, and print on the way.

    Returns:
        The agent; and for each update the steps flown by then, with the mean return and the share of
        successes of the newest 500 episodes.
    """
    torch.manual_seed(settings.seed)
    torch.set_num_threads(1)
    envs = gymnasium.make_vec("rl:LunarHDA-v0", num_envs=settings.environments)
    agent = Agent(44, 5, settings.log_deviation)
    optimiser = torch.optim.Adam(agent.parameters(), lr=settings.learning_rate, eps=1e-5)
    pilot, rows, started = Pilot(envs, agent, settings), [], time.perf_counter()
    batch = settings.environments * settings.horizon
    updates = max(1, settings.steps // batch)
    for number in range(1, updates + 1):
        optimiser.param_groups[0]["lr"] = settings.learning_rate * (1.0 - (number - 1) / updates)
        update(agent, optimiser, pilot.fly(), settings)
        rows.append((number * batch, float(np.mean(pilot.returns)), float(np.mean(pilot.landed))))
        if number % 10 == 0 or number == updates:
            rate = rows[-1][0] / (time.perf_counter() - started)
            step, gained, landed = rows[-1]
            sys.stdout.write(
                f"step {step}: return {gained:.3f}, success {100 * landed:.1f} %, {rate:.0f} steps/s\n"
            )
    envs.close()
    return agent, rows


@torch.no_grad()
def evaluate(agent: Agent, episodes: int = 500, split: str = "tuning") -> tuple[float, float]:
    """Mean return and share of successes of the actor's means over the first episodes of a study."""
    envs = gymnasium.make_vec("rl:LunarHDA-v0", num_envs=50, split=split)
    seen, running = envs.reset(seed=1)[0], np.zeros(50)
    results: dict[int, tuple[float, bool]] = {}
    while len(results) < episodes:
        action = agent.actor(torch.from_numpy(seen)).numpy()
        seen, reward, terminated, truncated, info = envs.step(action)
        running += reward
        for k in np.flatnonzero(terminated | truncated):
            number = int(info["final_info"]["episode_number"][k])
            if number < episodes:
                results[number] = running[k], info["final_info"]["is_success"][k]
            running[k] = 0.0
    envs.close()
    gained, landed = np.mean(list(results.values()), axis=0)
    return float(gained), float(landed)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name in ("steps", "environments", "seed"):
        parser.add_argument(f"--{name}", type=int, default=getattr(Settings, name))
    agent, _ = train(Settings(**vars(parser.parse_args())))
    gained, landed = evaluate(agent)
    sys.stdout.write(f"without noise, on tuning tiles: return {gained:.3f}, success {100 * landed:.1f} %\n")


if __name__ == "__main__":
    main()
