"""Vectors whose rows are single environments: the contract of the native ones, for what no batch serves."""

from __future__ import annotations

from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import rl  # noqa: F401 - registers the environments
from rl.environment.env import LunarHDAEnv
from rl.environment.native.landing_vector import LandingVectorEnv
from rl.environment.native.stepped_vector import SteppedVectorEnv, stack_infos
from rl.environment.native.vector_env import LunarHDAVectorEnv
from rl.environment.native.vector_snapshot import restore_snapshot, take_snapshot
from tests.equality import same
from tests.rl.lanes import Lane

BOTH: dict[str, Any] = {"sight": "belief", "guidance": "convex"}


def actions(vector: LandingVectorEnv[Any], steps: int, seed: int = 0) -> np.ndarray:
    shape = vector.action_space.shape or ()
    return np.random.default_rng(seed).uniform(-1.1, 1.1, (steps, *shape)).astype(np.float32)


@pytest.mark.parametrize(
    ("options", "steps"),
    [({}, 14), (BOTH, 14), ({"preset": "lidar"}, 12)],
    ids=["look", "belief and convex", "lidar"],
)
def test_each_row_is_a_single_environment_to_the_bit(options: dict[str, Any], steps: int) -> None:
    vector, count = SteppedVectorEnv(2, **options), 2
    makers = [partial(Lane, LunarHDAEnv(**options), k, count) for k in range(count)]
    rows: Any = SyncVectorEnv(makers, autoreset_mode=AutoresetMode.SAME_STEP)
    assert same(vector.reset(seed=7)[0], rows.reset(seed=7)[0])
    ends = 0
    for action in actions(vector, steps):
        flown, expected = vector.step(action), rows.step(action)
        assert same(flown[:4], expected[:4])
        info, other = flown[4], expected[4]
        assert all(same(info[key], other[key]) for key in ("ending", "tile", "speed", "reward_terms"))
        for k in np.flatnonzero(flown[2] | flown[3]):
            assert np.array_equal(info["final_obs"][k], other["final_obs"][k])
            assert info["final_info"]["ending"][k] == other["final_info"]["ending"][k] > 0
            ends += 1
    assert ends >= count
    vector.close()
    rows.close()


def test_it_is_the_native_vector_where_that_serves() -> None:
    stepped, native = SteppedVectorEnv(3, preset="partial"), LunarHDAVectorEnv(3, preset="partial")
    assert same(stepped.reset(seed=2), native.reset(seed=2))
    assert stepped.observation_space == native.observation_space
    for action in actions(native, 12):
        assert same(stepped.step(action), native.step(action))


@pytest.mark.parametrize(
    "name", ["LunarHDA", "LunarHDA-Map", "LunarHDA-Thrust", "LunarHDA-Site", "LunarHDA-Belief"]
)
def test_every_id_has_a_vector_of_the_package(name: str) -> None:
    vector = gymnasium.make_vec(f"rl:{name}-v0", 2)
    assert isinstance(vector.unwrapped, LandingVectorEnv)
    seen, _ = vector.reset(seed=0)
    assert vector.observation_space.contains(seen)
    assert len(vector.step(np.zeros(vector.action_space.shape or (), np.float32))) == 5
    vector.close()


def test_what_has_ended_waits_where_nothing_begins_by_itself() -> None:
    vector = SteppedVectorEnv(2, autoreset_mode="Disabled", max_episode_steps=2, guidance="convex")
    vector.reset(seed=0)
    vector.step(np.zeros((2, 2), np.float32))
    seen, _, _, truncated, _ = vector.step(np.zeros((2, 2), np.float32))
    assert truncated.all()
    with pytest.raises(gymnasium.error.ResetNeeded, match=r"environments \[0, 1\]"):
        vector.step(np.zeros((2, 2), np.float32))
    again, info = vector.reset(options={"reset_mask": np.array([False, True])})
    assert np.array_equal(again[0], seen[0])
    assert not np.array_equal(again[1], seen[1])
    assert info["episode_number"].tolist() == [0, 3]


def test_flights_with_beliefs_and_plans_go_on_to_the_same_bit() -> None:
    first, second = SteppedVectorEnv(2, **BOTH), SteppedVectorEnv(2, **BOTH)
    chosen = actions(first, 14, 3)
    seen, _ = first.reset(seed=5)
    for action in chosen[:10]:
        seen = first.step(action)[0]
    kept = take_snapshot(first)
    assert same(restore_snapshot(second, 5, kept), seen)
    assert same(take_snapshot(second), kept)  # nothing of the episodes before
    for action in chosen[10:]:
        assert same(first.step(action), second.step(action))


@pytest.mark.parametrize(
    ("options", "message"),
    [({"threads": 2}, "threads must be 1"), ({"num_envs": 0}, "num_envs must be a whole number")],
)
def test_wrong_numbers_are_named(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        gymnasium.make_vec("LunarHDA-Site-v0", **{"num_envs": 2, **options})


def test_wrong_actions_fly_nothing() -> None:
    vector = SteppedVectorEnv(2, guidance="convex")
    vector.reset(seed=0)
    for wrong in (np.zeros((2, 5)), np.array([[0.0, 0.0], [0.0, np.nan]])):
        with pytest.raises(ValueError, match="action must"):
            vector.step(wrong)  # type: ignore[arg-type] - that is the point
    assert vector.batch.steps.tolist() == [0, 0]


def test_infos_become_arrays() -> None:
    stacked = stack_infos([{"a": 1, "b": {"c": 0.5}}, {"a": 2, "b": {"c": 1.5}}])
    assert same(stacked, {"a": np.array([1, 2]), "b": {"c": np.array([0.5, 1.5])}})
