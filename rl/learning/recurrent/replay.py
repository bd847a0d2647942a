"""Replay memory of whole episodes, for agents with memory.

Rows of all episodes lie one behind the other in a ring; the oldest episodes make room for new ones. An
episode of T transitions has T + 1 rows: row t holds o_t, and a_t, r_t and whether the episode terminated
there, of which the last row has none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guidance.arrays import Array
from rl.inference.arrays import Array32

_ROWS = ("observations", "actions", "rewards", "terminated")


@dataclass(frozen=True, eq=False)
class Episode:
    """One finished episode of T transitions.

    Attributes:
        observations: shape (T + 1, o), the last one after the last action.
        actions: shape (T, a), in [-1, 1].
        rewards: shape (T,).
        terminated: whether it ended in a terminal state; false for one that was cut (truncated), whose last
            observation still has a value.
    """

    observations: Array32
    actions: Array32
    rewards: Array32
    terminated: bool


@dataclass(frozen=True, eq=False)
class SequenceBatch:
    """N sequences side by side, time first; T transitions, shorter ones padded.

    Attributes:
        observations: shape (T + 1, N, o).
        actions: shape (T, N, a).
        rewards: shape (T, N).
        terminated: shape (T, N), 1 where no value follows.
        counted: shape (T, N), 1 where a transition counts, 0 for padding and burn-in.
        previous_actions: shape (T + 1, N, a), the action before each observation; 0 before the first.
        previous_rewards: shape (T + 1, N), the reward that came with it; 0 before the first.
    """

    observations: Array32
    actions: Array32
    rewards: Array32
    terminated: Array32
    counted: Array32
    previous_actions: Array32
    previous_rewards: Array32


class EpisodeReplay:
    """Ring of whole episodes.

    Attributes:
        capacity: rows kept; an episode of T transitions takes T + 1.
    """

    def __init__(self, capacity: int, observation_size: int, action_size: int) -> None:
        """Make it empty.

        Raises:
            ValueError: there is no room for one transition.
        """
        if capacity < 2:
            raise ValueError(f"capacity must be at least 2 rows, got {capacity}")
        self.capacity = capacity
        self.observations = np.zeros((capacity, observation_size), np.float32)
        self.actions = np.zeros((capacity, action_size), np.float32)
        self.rewards = np.zeros(capacity, np.float32)
        self.terminated = np.zeros(capacity, np.float32)
        # episodes are a ring of their own, oldest first: start row and number of transitions of each
        self._starts = np.zeros(capacity // 2, np.int64)
        self._lengths = np.zeros(capacity // 2, np.int64)
        self._oldest = self._episodes = self._next_row = self._used = 0

    @property
    def episodes(self) -> int:
        """Episodes kept."""
        return self._episodes

    @property
    def transitions(self) -> int:
        """Transitions kept."""
        return self._used - self._episodes

    def _alive(self) -> NDArray[np.int64]:
        """Places in the ring of episodes, oldest first."""
        return (self._oldest + np.arange(self._episodes)) % self._starts.size

    @property
    def lengths(self) -> NDArray[np.int64]:
        """Transitions of each kept episode, oldest first."""
        return self._lengths[self._alive()]

    def store(self, episode: Episode) -> None:
        """Keep an episode; the oldest go if there is no room.

        Raises:
            ValueError: it is empty or longer than the whole memory.
        """
        length = len(episode.actions)
        if not 1 <= length < self.capacity:
            raise ValueError(f"episode must have 1 to {self.capacity - 1} transitions, got {length}")
        while self._used + length + 1 > self.capacity:
            self._used -= int(self._lengths[self._oldest]) + 1
            self._oldest = (self._oldest + 1) % self._starts.size
            self._episodes -= 1
        rows = (self._next_row + np.arange(length + 1)) % self.capacity
        self.observations[rows] = episode.observations
        self.actions[rows[:-1]] = episode.actions
        self.rewards[rows[:-1]] = episode.rewards
        self.terminated[rows] = 0.0
        self.terminated[rows[-2]] = float(episode.terminated)
        place = (self._oldest + self._episodes) % self._starts.size
        self._starts[place], self._lengths[place] = self._next_row, length
        self._episodes += 1
        self._used += length + 1
        self._next_row = (self._next_row + length + 1) % self.capacity

    def lengths_to_draw(self, batch_size: int) -> tuple[NDArray[np.int64], Array]:
        """Lengths of which there are at least `batch_size` episodes, and their shares of the transitions."""
        lengths, counts = np.unique(self.lengths, return_counts=True)
        enough = counts >= batch_size
        transitions = (lengths * counts)[enough].astype(np.float64)
        return lengths[enough], transitions / max(transitions.sum(), 1.0)

    def sample_equal_lengths(self, batch_size: int, rng: np.random.Generator) -> SequenceBatch | None:
        """Whole episodes of one length (Algorithm 3), or None while no length has enough episodes.

        The length is drawn among those with at least `batch_size` episodes, in proportion to their
        transitions, so that every transition within them is as likely to be learnt from.
        """
        lengths, shares = self.lengths_to_draw(batch_size)
        if lengths.size == 0:
            return None
        length = int(rng.choice(lengths, p=shares))
        alive = self._alive()
        of_length = alive[self._lengths[alive] == length]
        chosen = of_length[rng.integers(of_length.size, size=batch_size)]
        return self._gather(chosen, np.zeros(batch_size, np.int64), length, 0)

    def sample_mixed_lengths(
        self, batch_size: int, window: int, burn_in: int, rng: np.random.Generator
    ) -> SequenceBatch | None:
        """Sequences of up to `window` counted transitions from episodes of any length, padded and masked.

        Episodes are drawn in proportion to their transitions. A longer one gives a window whose first
        transition is uniform over those that leave it whole; up to `burn_in` transitions before it are given
        to fill the memory and do not count.
        """
        if self._episodes == 0:
            return None
        alive = self._alive()
        edges = np.cumsum(self._lengths[alive])
        chosen = alive[np.searchsorted(edges, rng.integers(edges[-1], size=batch_size), side="right")]
        spare = np.maximum(self._lengths[chosen] - window, 0)
        first = rng.integers(spare + 1)
        return self._gather(chosen, first, window, burn_in)

    def _gather(
        self, chosen: NDArray[np.int64], first: NDArray[np.int64], window: int, burn_in: int
    ) -> SequenceBatch:
        """Rows of the windows from transition `first` of each chosen episode, with the burn-in before."""
        begin = np.maximum(first - burn_in, 0)
        end = np.minimum(first + window, self._lengths[chosen])  # one past the last transition
        size = int((end - begin).max())
        # offsets within the episode, padding repeats the last observation
        offset = begin + np.arange(size + 1)[:, None]
        inside = (offset[:-1] >= first) & (offset[:-1] < end)
        rows = (self._starts[chosen] + np.minimum(offset, end)) % self.capacity
        before = (self._starts[chosen] + np.clip(offset - 1, 0, end - 1)) % self.capacity
        past = offset > 0
        return SequenceBatch(
            self.observations[rows],
            self.actions[rows[:-1]],
            self.rewards[rows[:-1]],
            self.terminated[rows[:-1]],
            inside.astype(np.float32),
            self.actions[before] * past[..., None],
            self.rewards[before] * past,
        )

    def tensors(self) -> dict[str, NDArray[np.generic]]:
        """All that it holds, by name."""
        state = np.array([self._oldest, self._episodes, self._next_row, self._used])
        kept = {name: getattr(self, name) for name in _ROWS}
        return {**kept, "starts": self._starts, "lengths": self._lengths, "state": state}

    def restore(self, tensors: dict[str, NDArray[np.generic]]) -> None:
        """Take over what `tensors` gave.

        Raises:
            ValueError: they are those of a memory of another size.
        """
        for name, array in self.tensors().items():
            if name != "state" and tensors[name].shape != array.shape:
                raise ValueError(f"{name}: shape {tensors[name].shape}, this memory has {array.shape}")
            array[...] = tensors[name]  # type: ignore[index]
        self._oldest, self._episodes, self._next_row, self._used = (int(k) for k in tensors["state"])
