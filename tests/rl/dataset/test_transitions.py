"""Episodes as arrays: plain transitions and sums by closed forms, and nothing that is no episode."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rl.dataset.transitions import Transitions, join_transitions
from tests.rl.dataset.made import LENGTHS, make_transitions


@given(lengths=LENGTHS, seed=st.integers(0, 99))
def test_transitions_and_returns_are_those_of_the_episodes(lengths: list[int], seed: int) -> None:
    data = make_transitions(lengths, seed)
    episodes = [data.one(k) for k in range(len(lengths))]
    assert [len(episode.actions) for episode in episodes] == lengths
    assert np.array_equal(data.before, np.concatenate([each.observations[:-1] for each in episodes]))
    assert np.array_equal(data.after, np.concatenate([each.observations[1:] for each in episodes]))
    assert np.allclose(data.returns, [each.rewards.sum() for each in episodes], rtol=1e-12, atol=1e-12)
    for each in episodes:
        over = each.terminated | each.truncated
        assert over[-1]
        assert not over[:-1].any()


@given(first=LENGTHS, second=LENGTHS)
def test_joined_parts_are_their_episodes_in_order(first: list[int], second: list[int]) -> None:
    parts = [make_transitions(first, 1), make_transitions(second, 2)]
    whole = join_transitions(parts)
    apart = [part.one(k) for part in parts for k in range(part.length.size)]
    for k, episode in enumerate(apart):
        for mine, its in zip(whole.one(k), episode, strict=True):
            assert np.array_equal(mine, its)


def test_nothing_and_too_much_are_refused() -> None:
    with pytest.raises(ValueError, match="parts must hold at least one"):
        join_transitions([])
    with pytest.raises(IndexError, match="number must be below 2, got 2"):
        make_transitions([1, 2], 0).one(2)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("length", [2, 2], "length must"),
        ("length", [0, 3], "length must"),
        ("observations", np.zeros((6, 3), np.float32), "length must"),
        ("rewards", [0.0, 1.0], "rewards must have 3 rows, got 2"),
        ("tile", [1], "tile must have 2 rows, got 1"),
        ("rewards", [0.0, np.nan, 0.0], "rewards must be finite"),
        ("actions", np.full((3, 5), 1.5, np.float32), "actions must lie"),
        ("actions", np.zeros((3, 5)), "actions must have 2 axes"),
        ("terminated", [True, True, True], "terminated or truncated must be set"),
        ("terminated", [False, False, False], "terminated or truncated must be set"),
    ],
)
def test_what_is_no_episode_is_refused(name: str, value: Any, message: str) -> None:
    data = make_transitions([1, 2], 0)
    array = np.asarray(value)
    with pytest.raises(ValueError, match=message):
        replace(data, **{name: array if array.dtype != int else array.astype(np.int64)})


def test_every_array_has_a_type() -> None:
    from rl.dataset.transitions import KINDS

    assert list(KINDS) == [field.name for field in fields(Transitions)]
