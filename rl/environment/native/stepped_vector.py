"""Vector environments whose rows are single environments, stepped one after the other in this process.

They serve what the native batch does not: beliefs, guidance laws that plan, measured looks, filters and
bodies. Seeds, ends, masks and `info` are those of the native ones; the speed is that of single environments.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array, Index
from hda.task.presets import find_preset
from hda.task.scenario import Scenario
from rl.environment.action import clip_actions
from rl.environment.env import LunarHDAEnv
from rl.environment.native.batch_settings import check_count
from rl.environment.native.landing_vector import LandingVectorEnv, Parts
from rl.inference.arrays import Array32


class SteppedEpisodes:
    """Single environments as rows: what `FlightBatch` is to a native vector.

    Attributes:
        environments: one for each row.
        scenarios: what is flown.
        seen: shape (n, o), what each sees at present.
        infos: the numbers of each.
        actions: shape (n, k, a), of the episode under way: from its beginning they lead to where it stands;
            0 beyond.
        landed: as of `Batch`.
        timed_out: as of `Batch`.
    """

    def __init__(self, environments: Sequence[LunarHDAEnv]) -> None:
        """Make room; `begin` fills it."""
        first, count = environments[0], len(environments)
        decisions = find_preset(first.source.preset).rules.max_decisions
        self.environments = environments
        self.scenarios: list[Scenario | None] = [None] * count
        self.seen = np.zeros((count, first.sight.bounds[0].size), np.float32)
        self.infos: list[dict[str, Any]] = [{}] * count
        self.actions = np.zeros((count, decisions, first.action_size))
        self.landed, self.timed_out = np.zeros((2, count), np.bool_)
        self._steps = np.zeros(count, np.int64)

    @property
    def steps(self) -> Index:
        """Decisions flown in each episode, shape (n,)."""
        return self._steps

    def begin(self, place: int, scenario: Scenario) -> None:
        """Begin an episode at a place, whatever was flown there."""
        self.scenarios[place] = scenario
        environment = self.environments[place]
        self.seen[place], self.infos[place] = environment.reset(options={"scenario": scenario})
        self._steps[place], self.landed[place], self.timed_out[place] = 0, False, False
        self.actions[place] = 0.0  # what is kept tells nothing of earlier episodes

    def advance(self, actions: NDArray[np.floating]) -> Array:
        """Fly an action of each episode to the next look or the ground: the rewards, shape (n,).

        Raises:
            ValueError: the actions have another shape, or are not finite.
        """
        count, _, size = self.actions.shape
        values = clip_actions(actions, (count, size))
        return np.array([self._step(place, action) for place, action in enumerate(values)])

    def _step(self, place: int, action: Array) -> float:
        """Fly one, and write down what it did."""
        self.actions[place, self._steps[place]] = action
        environment: Any = self.environments[place]  # takes double precision as well
        seen, reward, landed, timed_out, info = environment.step(action)
        self.seen[place], self.infos[place] = seen, info
        self.landed[place], self.timed_out[place] = landed, timed_out
        self._steps[place] += 1
        return reward

    def kept(self) -> dict[str, NDArray[Any]]:
        """The actions that lead from the beginnings to where the flights stand: beliefs and plans follow."""
        return {"actions": self.actions.copy(), "steps": self._steps.copy()}

    def take_up(self, kept: dict[str, NDArray[Any]]) -> None:
        """Fly the actions again, after `begin` of each."""
        for place, steps in enumerate(kept["steps"].tolist()):
            for action in kept["actions"][place, :steps]:
                self._step(place, action)

    def close(self) -> None:
        """Close them."""
        for environment in self.environments:
            environment.close()


class SteppedVectorEnv(LandingVectorEnv[Array32]):
    """Many of `LunarHDAEnv`, of any preset, sight and guidance, stepped one after the other.

    `LunarHDA-Site-v0` and `LunarHDA-Belief-v0` are flown so by `gymnasium.make_vec`. See `LandingVectorEnv`.
    """

    batch: SteppedEpisodes

    def make_single(self, **options: Any) -> LunarHDAEnv:
        """One of them."""
        return LunarHDAEnv(**options)

    def make_batch(self, num_envs: int, threads: int) -> SteppedEpisodes:
        """All of them.

        Raises:
            ValueError: a number is below one, or there are several threads.
        """
        check_count("num_envs", num_envs)
        if threads != 1:
            raise ValueError(f"threads must be 1 where environments are stepped one by one, got {threads!r}")
        return SteppedEpisodes([self.make_single(**self.options) for _ in range(num_envs)])

    def describe(self) -> dict[str, Any]:
        """Numbers of every episode as it stands, arrays of shape (n,)."""
        return stack_infos(self.batch.infos)

    def look(self, places: Index) -> Parts:
        """What some of them see; they have looked as they flew."""
        return {"vector": self.batch.seen[places]}

    def present(self, parts: Parts) -> Array32:
        """The vectors."""
        return parts["vector"]


def stack_infos(infos: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """One array of each number, shape (n,), in dictionaries too; all have the same keys."""
    return {
        key: stack_infos([info[key] for info in infos])
        if isinstance(value, dict)
        else np.array([info[key] for info in infos])
        for key, value in infos[0].items()
    }
