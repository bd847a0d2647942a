"""Episodes of an environment one behind the other, as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array, Index
from rl.inference.arrays import Array32

KINDS: dict[str, str] = {
    "observations": "<f4",
    "actions": "<f4",
    "rewards": "<f8",
    "terminated": "|b1",
    "truncated": "|b1",
    "length": "<i8",
    "policy": "<i8",
    "episode": "<i8",
    "tile": "<i8",
    "ending": "<i8",
    "safe_site": "|b1",
}
"""The arrays by name, and their types."""
_OF_STEPS = ("actions", "rewards", "terminated", "truncated")
_OF_EPISODES = ("length", "policy", "episode", "tile", "ending", "safe_site")


class EpisodeData(NamedTuple):
    """One episode.

    Attributes:
        observations: shape (steps + 1, o), the last one at the end.
        actions: shape (steps, a).
        rewards: shape (steps,).
        terminated: shape (steps,).
        truncated: shape (steps,).
    """

    observations: Array32
    actions: Array32
    rewards: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Transitions:
    """Episodes one behind the other: n of them with m steps in all.

    Attributes:
        observations: shape (m + n, o): of each episode one more than its steps, the last one at its end.
        actions: shape (m, a), in [-1, 1].
        rewards: shape (m,).
        terminated: shape (m,), whether the task ended with this step.
        truncated: shape (m,), whether the episode was cut in flight after this step.
        length: shape (n,), steps of each episode.
        policy: shape (n,), which policy flew it, by its place in the card's list.
        episode: shape (n,), its number within the study.
        tile: shape (n,), of the split.
        ending: shape (n,), `rl.environment.episode_info.ENDING_CODES`; 1 is a success.
        safe_site: shape (n,), whether it touched down on safe ground.

    Raises:
        ValueError: arrays of other types, or whose lengths do not go together; a number that is not finite;
            an action outside [-1, 1]; or an episode that does not end with its last step alone.
    """

    observations: Array32
    actions: Array32
    rewards: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    length: Index
    policy: Index
    episode: Index
    tile: Index
    ending: Index
    safe_site: NDArray[np.bool_]

    def __post_init__(self) -> None:
        """Refuse arrays that are not episodes."""
        for name, kind in KINDS.items():
            array, wide = getattr(self, name), 2 if name in ("observations", "actions") else 1
            if array.dtype != np.dtype(kind) or array.ndim != wide:
                raise ValueError(f"{name} must have {wide} axes of {kind}, got {array.ndim} of {array.dtype}")
        episodes, steps = self.length.size, len(self.actions)
        if (
            (self.length < 1).any()
            or self.length.sum() != steps
            or len(self.observations) != steps + episodes
        ):
            raise ValueError("length must have one entry an episode, and say how many steps each has")
        for names, count in ((_OF_STEPS, steps), (_OF_EPISODES, episodes)):
            for name in names:
                if len(getattr(self, name)) != count:
                    raise ValueError(f"{name} must have {count} rows, got {len(getattr(self, name))}")
        for name in ("observations", "actions", "rewards"):
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"{name} must be finite")
        if steps and np.abs(self.actions).max() > 1.0:
            raise ValueError("actions must lie in [-1, 1]")
        over = self.terminated | self.truncated
        if (self.terminated & self.truncated).any() or not np.array_equal(
            np.flatnonzero(over), np.cumsum(self.length) - 1
        ):
            raise ValueError(
                "terminated or truncated must be set at the last step of each episode, and there alone"
            )

    @property
    def before(self) -> Array32:
        """What was seen before each step, shape (m, o): observations of plain transitions."""
        return np.delete(self.observations, np.cumsum(self.length + 1) - 1, axis=0)

    @property
    def after(self) -> Array32:
        """What was seen after each step, shape (m, o): next observations of plain transitions."""
        return np.delete(self.observations, np.cumsum(self.length + 1) - self.length - 1, axis=0)

    @property
    def returns(self) -> Array:
        """Undiscounted sum of the rewards of each episode, shape (n,)."""
        if self.length.size == 0:
            return np.zeros(0)
        return np.add.reduceat(self.rewards, np.cumsum(self.length) - self.length)

    def one(self, number: int) -> EpisodeData:
        """The episode that stands at a place, counted from 0.

        Raises:
            IndexError: there are fewer.
        """
        if not 0 <= number < self.length.size:
            raise IndexError(f"number must be below {self.length.size}, got {number}")
        first, steps = int(self.length[:number].sum()), int(self.length[number])
        flown = slice(first, first + steps)
        seen = self.observations[first + number : first + number + steps + 1]
        return EpisodeData(seen, *(getattr(self, name)[flown] for name in _OF_STEPS))


def join_transitions(parts: Sequence[Transitions]) -> Transitions:
    """All episodes of several, in order.

    Raises:
        ValueError: no part, or parts of different environments.
    """
    if not parts:
        raise ValueError("parts must hold at least one")
    columns: dict[str, Any] = {
        field.name: np.concatenate([getattr(part, field.name) for part in parts])
        for field in fields(Transitions)
    }
    return Transitions(**columns)
