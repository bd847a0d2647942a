"""Flights of a native vector that are kept as numbers go on to the same bit."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rl.environment.native.vector_env import LunarHDAMapVectorEnv, LunarHDAVectorEnv
from rl.environment.native.vector_snapshot import restore_snapshot, take_snapshot
from tests.equality import same


@settings(max_examples=6)
@given(
    kind=st.sampled_from([LunarHDAVectorEnv, LunarHDAMapVectorEnv]),
    preset=st.sampled_from(["paper", "partial"]),
    study=st.sampled_from([5, 2**70 + 3]),
    before=st.integers(0, 12),
)
def test_restored_flights_equal_those_that_were_never_kept(kind, preset, study, before):
    count, rng = 3, np.random.default_rng(before)
    actions = rng.uniform(-1.0, 1.0, (before + 10, count, 5)).astype(np.float32)
    first, second = kind(count, preset=preset), kind(count, preset=preset)
    seen, _ = first.reset(seed=study)
    for action in actions[:before]:
        seen = first.step(action)[0]
    assert same(restore_snapshot(second, study, take_snapshot(first)), seen)
    ends = 0
    for action in actions[before:]:
        one, other = first.step(action), second.step(action)
        assert same(one, other)
        ends += int((one[2] | one[3]).sum())
    assert ends >= count


def test_an_episode_that_a_limit_of_steps_cut_is_not_kept():
    """It is in flight yet, and waits for a reset."""
    environments = LunarHDAVectorEnv(2, autoreset_mode="Disabled", max_episode_steps=1)
    environments.reset(seed=0)
    take_snapshot(environments)
    _, _, terminated, truncated, _ = environments.step(np.zeros((2, 5), np.float32))
    assert truncated.all()
    assert not terminated.any()
    with pytest.raises(ValueError, match="under way in every row"):
        take_snapshot(environments)
    environments.reset(options={"reset_mask": np.array([True, False])})
    with pytest.raises(ValueError, match="under way in every row"):
        take_snapshot(environments)
    environments.reset()
    take_snapshot(environments)


def test_what_is_not_under_way_is_not_kept():
    environments = LunarHDAVectorEnv(2, autoreset_mode="Disabled")
    with pytest.raises(ValueError, match="under way in every row"):
        take_snapshot(environments)
    environments.reset(seed=0)
    kept = take_snapshot(environments)
    with pytest.raises(ValueError, match="must be the 2 that were kept, got 3"):
        restore_snapshot(LunarHDAVectorEnv(3), 0, kept)
    ended = np.zeros(2, np.bool_)
    while not ended.any():
        _, _, terminated, truncated, _ = environments.step(np.zeros((2, 5), np.float32))
        ended = terminated | truncated
    with pytest.raises(ValueError, match="under way in every row"):
        take_snapshot(environments)
