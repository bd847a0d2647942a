"""Replay of whole episodes: what is kept, which lengths are drawn, and what counts in a window."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rl.learning.recurrent.replay import Episode, EpisodeReplay


def numbered(episode: int, length: int, terminated: bool = True) -> Episode:
    """An episode whose every number says where it is from: episode + step / 1000."""
    steps = (episode + np.arange(length + 1) / 1000.0).astype(np.float32)
    return Episode(steps[:, None], steps[:-1, None], steps[:-1], terminated)


@settings(max_examples=30, deadline=None)
@given(lengths=st.lists(st.integers(1, 7), min_size=1, max_size=60), capacity=st.integers(8, 50))
def test_the_newest_episodes_that_fit_are_kept_whole(lengths, capacity):
    replay = EpisodeReplay(capacity, 1, 1)
    for k, length in enumerate(lengths):
        replay.store(numbered(k, length))
    kept, rows = [], 0
    for length in reversed(lengths):
        if rows + length + 1 > capacity:
            break
        rows += length + 1
        kept.insert(0, length)
    assert replay.lengths.tolist() == kept
    assert (replay.episodes, replay.transitions) == (len(kept), sum(kept))
    batch = replay.sample_mixed_lengths(64, 10, 0, np.random.default_rng(0))
    assert batch is not None
    for n in range(64):
        counted = batch.counted[:, n] == 1
        seen = batch.observations[: counted.sum() + 1, n, 0]
        number = round(float(seen[0]))
        assert number >= len(lengths) - len(kept)
        np.testing.assert_allclose(seen, numbered(number, lengths[number]).observations[:, 0], atol=2e-5)
        np.testing.assert_array_equal(batch.actions[counted, n, 0], seen[:-1])
        np.testing.assert_array_equal(batch.previous_actions[1 : counted.sum() + 1, n, 0], seen[:-1])
        np.testing.assert_array_equal(batch.previous_rewards[1 : counted.sum() + 1, n], seen[:-1])
        assert batch.previous_actions[0, n, 0] == batch.previous_rewards[0, n] == 0.0
        assert batch.terminated[counted, n].tolist() == [0.0] * (counted.sum() - 1) + [1.0]


def test_lengths_are_drawn_by_their_transitions_among_those_with_enough_episodes():
    replay = EpisodeReplay(1000, 1, 1)
    for length, count in ((3, 20), (5, 30), (7, 4)):
        for _ in range(count):
            replay.store(numbered(length, length))
    lengths, shares = replay.lengths_to_draw(20)
    assert lengths.tolist() == [3, 5]
    np.testing.assert_allclose(shares, [60 / 210, 150 / 210])
    rng = np.random.default_rng(0)
    drawn = [len(b.actions) for b in (replay.sample_equal_lengths(20, rng) for _ in range(2000)) if b]
    # 5 standard errors of a share over 2000 draws
    assert np.mean([d == 5 for d in drawn]) == pytest.approx(150 / 210, abs=5 * 0.0101)
    assert set(drawn) == {3, 5}


def test_whole_episodes_of_one_length_need_no_padding():
    replay = EpisodeReplay(1000, 1, 1)
    for k in range(40):
        replay.store(numbered(k, 4 + k % 2))
    batch = replay.sample_equal_lengths(16, np.random.default_rng(1))
    assert batch is not None
    assert batch.counted.all()
    assert (batch.terminated[-1] == 1).all()
    assert not batch.terminated[:-1].any()
    assert EpisodeReplay(10, 1, 1).sample_equal_lengths(1, np.random.default_rng(0)) is None


@pytest.mark.parametrize(("window", "burn_in"), [(4, 0), (4, 3), (6, 2), (1, 0)])
def test_a_window_counts_its_own_transitions_and_its_burn_in_does_not(window, burn_in):
    length = 12
    replay = EpisodeReplay(100, 1, 1)
    replay.store(numbered(0, length))
    firsts = set()
    rng = np.random.default_rng(2)
    for _ in range(60):
        batch = replay.sample_mixed_lengths(8, window, burn_in, rng)
        assert batch is not None
        np.testing.assert_array_equal(batch.counted.sum(0), window)
        for n in range(8):
            steps = np.round(batch.actions[batch.counted[:, n] == 1, n, 0] * 1000).astype(int)
            assert (np.diff(steps) == 1).all()
            before = int(np.argmax(batch.counted[:, n]))
            assert before == min(burn_in, steps[0])
            begin = steps[0] - before
            assert round(batch.observations[0, n, 0] * 1000) == begin
            if begin > 0:  # a window knows the action before it
                assert round(batch.previous_actions[0, n, 0] * 1000) == begin - 1
            firsts.add(int(steps[0]))
            ends = batch.terminated[batch.counted[:, n] == 1, n]
            assert ends.tolist() == [0.0] * (window - 1) + [float(steps[-1] == length - 1)]
    assert firsts == set(range(length - window + 1))


def test_a_truncated_episode_keeps_the_value_of_its_end():
    replay = EpisodeReplay(100, 1, 1)
    replay.store(numbered(0, 5, terminated=False))
    batch = replay.sample_mixed_lengths(4, 10, 0, np.random.default_rng(0))
    assert batch is not None
    assert not batch.terminated.any()
    assert batch.counted.sum() == 20


def test_what_cannot_be_kept_is_refused():
    with pytest.raises(ValueError, match="capacity"):
        EpisodeReplay(1, 1, 1)
    with pytest.raises(ValueError, match="episode must have 1 to 4"):
        EpisodeReplay(5, 1, 1).store(numbered(0, 5))


def test_restored_memory_draws_the_same():
    replay, other = EpisodeReplay(40, 1, 1), EpisodeReplay(40, 1, 1)
    for k in range(30):
        replay.store(numbered(k, 1 + k % 5))
    other.restore({name: array.copy() for name, array in replay.tensors().items()})
    for _ in range(3):
        replay.store(numbered(99, 3))
        other.store(numbered(99, 3))
    one = replay.sample_mixed_lengths(20, 3, 1, np.random.default_rng(0))
    two = other.sample_mixed_lengths(20, 3, 1, np.random.default_rng(0))
    for name, array in vars(one).items():
        np.testing.assert_array_equal(array, getattr(two, name))
    with pytest.raises(ValueError, match="observations: shape"):
        EpisodeReplay(30, 1, 1).restore(replay.tensors())
