"""A vector environment of this package as Stable-Baselines3 wants it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn

from rl.environment.native.landing_vector import LandingVectorEnv


class StableBaselinesVector(VecEnv):
    """`LandingVectorEnv` for the learners of Stable-Baselines3 and sb3-contrib.

    An `info` is that of the step, also where the episode ended in it; there `terminal_observation` holds its
    last observation, and `TimeLimit.truncated` says whether it was cut in flight. `seed(s)` lets the next
    `reset()` begin the study s, whose episodes go round the environments; `reset_infos` holds the `info` of
    the newest beginnings. `VecMonitor` around it gives the learners returns and lengths.
    """

    def __init__(self, vector: gymnasium.vector.VectorEnv[Any, Any, Any]) -> None:
        """Take a vector, as `gymnasium.make_vec` makes it.

        Raises:
            ValueError: it is no native vector environment, or does not begin episodes by itself.
        """
        landing = vector.unwrapped
        if landing is not vector or not isinstance(landing, LandingVectorEnv):
            raise ValueError(f"vector must be a native vector environment without wrappers, got {vector}")
        if landing.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise ValueError(f"vector must have autoreset_mode='SameStep', got {landing.autoreset_mode}")
        self.vector = landing
        self._actions = np.zeros(landing.action_space.shape or (), np.float32)
        super().__init__(landing.num_envs, landing.single_observation_space, landing.single_action_space)

    def reset(self) -> VecEnvObs:
        """Begin an episode in every environment: of the study that `seed` named, or the next ones."""
        seen, info = self.vector.reset(seed=self._seeds[0], options=self._options[0] or None)
        self.reset_infos = rows_of(info)
        self._reset_seeds()
        self._reset_options()
        return seen

    def set_options(self, options: list[dict[str, Any]] | dict[str, Any] | None = None) -> None:
        """Let the next `reset()` have these options, alike in every environment.

        Raises:
            ValueError: a list has other than one entry for each environment, its entries differ, or
                `reset_mask` is among them: a reset here begins all.
        """
        each = options if isinstance(options, list) else [options or {}] * self.num_envs
        if len(each) != self.num_envs:
            raise ValueError(
                f"options must have {self.num_envs} entries, one an environment, got {len(each)}"
            )
        if any("reset_mask" in entry for entry in each):
            raise ValueError("options must leave out reset_mask here: reset() begins every environment")
        if any(entry != each[0] for entry in each):
            raise ValueError(f"options must be alike for all environments of a native vector, got {each}")
        super().set_options(options)

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions, shape (n, a)."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Fly them: observations, rewards, ends, and an `info` for each environment."""
        seen, rewards, terminated, truncated, info = self.vector.step(self._actions)
        done, final = terminated | truncated, info.pop("final_info", {})
        last = info.pop("final_obs", None)
        for key in ("_final_obs", "_final_info"):
            info.pop(key, None)
        infos = rows_of(info)
        ended = rows_of(final) if done.any() else []
        for k in np.flatnonzero(done).tolist():
            self.reset_infos[k] = infos[k]
            infos[k] = {**ended[k], "terminal_observation": _row(last, k)}
        for row, cut in zip(infos, (truncated & ~terminated).tolist(), strict=True):
            row["TimeLimit.truncated"] = cut
        return seen, rewards.astype(np.float32), done, infos

    def close(self) -> None:
        """Close the vector."""
        self.vector.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """None for each: a native vector draws no pictures."""
        return [None] * self.num_envs

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute of the vector, which all environments share."""
        return [getattr(self.vector, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Refused: the environments share all attributes."""
        raise AttributeError(f"{attr_name} cannot be set for single environments of a native vector")

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Refused: the environments are rows, and have no methods."""
        raise AttributeError(f"{method_name} cannot be called for single environments of a native vector")

    def env_is_wrapped(
        self, wrapper_class: type[gymnasium.Wrapper], indices: VecEnvIndices = None
    ) -> list[bool]:
        """None is."""
        return [False for _ in self._get_indices(indices)]


def rows_of(info: dict[str, Any]) -> list[dict[str, Any]]:
    """The `info` of each environment, of a vector's: plain numbers, and dictionaries of such."""
    keys = [key for key in info if not key.startswith("_")]
    columns = [rows_of(info[key]) if isinstance(info[key], dict) else info[key].tolist() for key in keys]
    return [dict(zip(keys, values, strict=True)) for values in zip(*columns, strict=True)]


def _row(observation: Any, k: int) -> Any:
    """What one environment sees, in arrays of its own."""
    if isinstance(observation, dict):
        return {key: part[k].copy() for key, part in observation.items()}
    return observation[k].copy()
