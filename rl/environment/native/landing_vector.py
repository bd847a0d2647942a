"""What every vector environment of this package owes to its callers, whatever flies its episodes."""

from __future__ import annotations

from abc import abstractmethod
from typing import Any, Generic, Protocol, TypeVar

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from guidance.arrays import Array, Index
from hda.task.scenario import Scenario
from rl.environment.dispersions import DISPERSION_NAMES, refuse_unknown_options
from rl.environment.env import LandingEnv
from rl.environment.episode_source import EpisodeSource
from rl.environment.native.batch_settings import check_count
from rl.environment.native.vector_info import Mask, blank_others, with_masks
from rl.inference.arrays import Array32

Seen = TypeVar("Seen")
Parts = dict[str, NDArray[Any]]
_MODES = (AutoresetMode.SAME_STEP, AutoresetMode.DISABLED)


class Batch(Protocol):
    """Episodes under way at once, one row for each.

    Attributes:
        scenarios: what is flown; None before the first.
        landed: shape (n,), over after the last step, by touchdown, crash or an empty tank.
        timed_out: shape (n,), in flight after the last decision that the rules allow.
    """

    scenarios: list[Scenario | None]
    landed: Mask
    timed_out: Mask

    @property
    def steps(self) -> Index:
        """Steps flown in each episode, shape (n,)."""
        ...

    def begin(self, place: int, scenario: Scenario) -> None:
        """Begin an episode at a place, whatever was flown there."""
        ...

    def advance(self, actions: NDArray[np.floating]) -> Array:
        """Fly an action of each episode: the rewards, shape (n,).

        Raises:
            ValueError: the actions have another shape, or are not finite; nothing has flown then.
        """
        ...

    def kept(self) -> dict[str, NDArray[Any]]:
        """What the flights have become, each array with one row for each."""
        ...

    def take_up(self, kept: dict[str, NDArray[Any]]) -> None:
        """Let the flights be what they had become, after `begin` of each."""
        ...

    def close(self) -> None:
        """Let go of what is held beside memory."""
        ...


class LandingVectorEnv(VectorEnv[Seen, Array32, Any], Generic[Seen]):
    """What the vector environments share; each row is a `LandingEnv`, to the bit.

    Observations, actions, rewards, ends and `info` are those of `LandingEnv`, one row for each environment.

    **Episodes**: `reset(seed=s)` begins the study s: environment i of n flies its episodes i, i + n, i + 2 n
    and so on, so that two seeds never share an episode. Each later `reset()` goes on in the study.

    **At an end**, with `autoreset_mode` `AutoresetMode.SAME_STEP`, the same step begins the next episode: the
    observation is the new episode's first, `info` is of the new episode, `info["final_info"]` of the old one,
    and `info["final_obs"]` its last observation, an array of the shape of the observations with zeros in the
    rows that did not end (`info["_final_obs"]` says which did). With `AutoresetMode.DISABLED` nothing begins
    by itself: `reset(options={"reset_mask": ended})` begins those of a mask, shape (n,).

    **Options** of `reset`: `reset_mask`, and every field of `Dispersions` by name, for the episodes that it
    begins.

    A subclass says what flies: a native batch, or single environments one after the other. There is no
    picture: `vectorization_mode="sync"` draws.
    """

    batch: Any
    """What flies them: a `Batch`."""
    KEPT: tuple[str, ...] = ()
    """Arrays of its own that a snapshot keeps."""

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        threads: int = 1,
        max_episode_steps: int | None = None,
        **options: Any,
    ) -> None:
        """Make the environments.

        Args:
            num_envs: how many.
            autoreset_mode: what happens at the end of an episode, as `AutoresetMode` or its value.
            threads: over which flights and looks are spread; the numbers do not depend on it.
            max_episode_steps: longer episodes are truncated, as by `gymnasium.wrappers.TimeLimit`.
            options: as of the single environment.

        Raises:
            ValueError: a wrong number or mode, a preset that is not served, a render mode, or as of the
                single environment.
        """
        self.closed = True  # until there is something to close
        if options.pop("render_mode", None) is not None:
            raise ValueError("render_mode must be None here: vectorization_mode='sync' draws pictures")
        known = {name: mode for mode in _MODES for name in (mode, mode.value)}
        if autoreset_mode not in known:
            raise ValueError(f"autoreset_mode must be 'SameStep' or 'Disabled', got {autoreset_mode!r}")
        mode = known[autoreset_mode]
        self.options = options
        self.single = self.make_single(**options)
        self.batch = self.make_batch(num_envs, threads)
        if max_episode_steps is not None:
            check_count("max_episode_steps", max_episode_steps)
        self.num_envs, self.max_episode_steps = int(num_envs), max_episode_steps
        self.single_observation_space = self.single.observation_space
        self.single_action_space = self.single.action_space
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.autoreset_mode = mode
        self.metadata = {**self.single.metadata, "render_modes": [], "autoreset_mode": mode}
        self.study_seed: int | None = None
        self.next_episode = np.arange(self.num_envs)
        self.ended = np.zeros(self.num_envs, np.bool_)  # rows that wait for a reset
        self._seen: Parts = {}
        self.closed = False

    @abstractmethod
    def make_batch(self, num_envs: int, threads: int) -> Batch:
        """What flies them.

        Raises:
            ValueError: it cannot fly so many, or with so many threads, or not this preset.
        """

    @abstractmethod
    def make_single(self, **options: Any) -> LandingEnv[Any]:
        """The single environment, which says what is flown, what is seen, and what an action means."""

    @abstractmethod
    def describe(self) -> dict[str, Any]:
        """Numbers of every episode as it stands: the keys of `describe_episode`, arrays of shape (n,)."""

    @abstractmethod
    def look(self, places: Index) -> Parts:
        """What some of the environments see at this instant, one row for each."""

    @abstractmethod
    def present(self, parts: Parts) -> Seen:
        """The element of the observation space that has these parts."""

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Seen, dict[str, Any]]:
        """Begin an episode in every environment, or in those of `options["reset_mask"]`.

        Where it fails, everything stays as it was: the study, its next episodes, and the flights.

        Raises:
            ValueError: an unknown option, a wrong mask, or a mask that leaves some out where a study begins.
        """
        changes = dict(options or {})
        refuse_unknown_options(changes, ("reset_mask", *DISPERSION_NAMES))
        mask = _check_mask(changes.pop("reset_mask", None), self.num_envs)
        anew = seed is not None or self.study_seed is None
        if (anew or not self._seen) and not mask.all():
            raise ValueError(
                "options['reset_mask'] must name every environment where a study begins, got"
                f" {np.flatnonzero(mask).tolist()} of {self.num_envs}"
            )
        study = self.study_seed if seed is None else seed
        if study is None:
            study = int(self.np_random.integers(2**31))
        episodes = np.arange(self.num_envs) if anew else self.next_episode
        scenarios = self._draw(study, episodes, mask, changes)
        super().reset(seed=seed)
        self.study_seed, self.next_episode = study, episodes
        self._begin(mask, scenarios)
        return self._observation(), with_masks(self.describe(), mask)

    def step(self, actions: Array32) -> tuple[Seen, Any, Mask, Mask, dict[str, Any]]:
        """Fly one decision, or of thrusts one control period, in every environment.

        Raises:
            ValueError: the actions are not five finite numbers for each environment.
            gymnasium.error.ResetNeeded: an episode is over or has not begun.
        """
        if not self._seen:
            raise gymnasium.error.ResetNeeded("no episode has begun: call reset()")
        if self.ended.any():
            waiting = np.flatnonzero(self.ended).tolist()
            raise gymnasium.error.ResetNeeded(
                f"no episode is under way in environments {waiting}: call reset()"
            )
        batch, everyone = self.batch, np.ones(self.num_envs, np.bool_)
        rewards = batch.advance(actions)
        terminated, truncated = batch.landed.copy(), batch.timed_out.copy()
        if self.max_episode_steps is not None:
            truncated |= batch.steps >= self.max_episode_steps
        self._look(everyone)
        self.ended = terminated | truncated
        info: dict[str, Any] = {}
        if self.ended.any() and self.autoreset_mode is AutoresetMode.SAME_STEP:
            ended = self.ended.copy()
            last = {key: blank_others(part, ended) for key, part in self._seen.items()}
            final = with_masks(self.describe(), ended)
            info = {"final_obs": self.present(last), "_final_obs": ended}
            info |= {"final_info": final, "_final_info": ended.copy()}
            assert self.study_seed is not None
            self._begin(ended, self._draw(self.study_seed, self.next_episode, ended, {}))
        info |= with_masks(self.describe(), everyone)
        return self._observation(), rewards, terminated, truncated, info

    def look_again(self) -> Seen:
        """Take the look of this instant anew in every environment, for whoever has set its flights."""
        self._look(np.ones(self.num_envs, np.bool_))
        return self._observation()

    @property
    def source(self) -> EpisodeSource:
        """Which episodes are flown."""
        return self.single.source

    def render(self) -> None:
        """None: a batch draws no pictures."""

    def close_extras(self, **options: Any) -> None:
        """Let the threads go."""
        self.batch.close()

    def _draw(self, study: int, episodes: Index, mask: Mask, changes: dict[str, float]) -> list[Scenario]:
        """The next episode of each environment of a mask, with changed dispersions."""
        self.source.prepare()
        return [self.source.scenario(study, episode, changes) for episode in episodes[mask].tolist()]

    def _begin(self, mask: Mask, scenarios: list[Scenario]) -> None:
        """Begin an episode in each environment of a mask."""
        for place, scenario in zip(np.flatnonzero(mask).tolist(), scenarios, strict=True):
            self.batch.begin(place, scenario)
        self.next_episode[mask] += self.num_envs
        self.ended &= ~mask
        self._look(mask)

    def _look(self, mask: Mask) -> None:
        """Take the looks of a mask, and keep what they show."""
        places = np.flatnonzero(mask)
        parts = self.look(places)
        if len(places) == self.num_envs:
            self._seen = parts
        else:
            for key, part in parts.items():
                self._seen[key][places] = part

    def _observation(self) -> Seen:
        """What is seen at present, in arrays of its own."""
        return self.present({key: part.copy() for key, part in self._seen.items()})


def _check_mask(mask: Any, count: int) -> Mask:
    """The environments that a reset begins; all without a mask."""
    if mask is None:
        return np.ones(count, np.bool_)
    if not isinstance(mask, np.ndarray) or mask.shape != (count,) or mask.dtype != np.bool_:
        raise ValueError(f"reset_mask must be an array of {count} truth values, got {mask!r}")
    if not mask.any():
        raise ValueError("reset_mask must name at least one environment, got none")
    return mask.copy()
