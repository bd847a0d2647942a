"""What the native vector environments owe to their callers: specifications, ends, masks, messages."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import rl  # noqa: F401 - registers the environments
from rl.environment.map_env import LunarHDAMapEnv
from rl.environment.native.landing_vector import LandingVectorEnv
from rl.environment.native.vector_env import LunarHDAMapVectorEnv, LunarHDAVectorEnv
from rl.inference.artefacts import WEIGHTS_FOLDER, read_card
from tests.equality import same

IDS = ("LunarHDA-v0", "LunarHDA-Map-v0")
KINDS = (LunarHDAVectorEnv, LunarHDAMapVectorEnv)


def still(count: int) -> np.ndarray:
    return np.zeros((count, 5), np.float32)


def arrays(seen: Any) -> list[np.ndarray]:
    """The arrays of an observation."""
    return list(seen.values()) if isinstance(seen, dict) else [seen]


def fly_to_an_end(vector: Any) -> tuple[Any, ...]:
    """Step until an episode ends; what that step gave."""
    for _ in range(20):
        given = vector.step(still(vector.num_envs))
        if (given[2] | given[3]).any():
            return given
    raise AssertionError("no episode ended")


# Specifications


@pytest.mark.parametrize("name", IDS)
def test_make_vec_gives_the_native_vector(name):
    vector = gymnasium.make_vec(name, num_envs=3)
    assert isinstance(vector, LandingVectorEnv)
    assert vector.num_envs == 3
    assert vector.max_episode_steps == 20
    assert vector.metadata["autoreset_mode"] is vector.autoreset_mode is AutoresetMode.SAME_STEP
    seen, _ = vector.reset(seed=0)
    assert vector.observation_space.contains(seen)
    assert vector.metadata["render_modes"] == []
    assert vector.render() is None
    assert vector.spec is not None
    again = gymnasium.make_vec(EnvSpec.from_json(vector.spec.to_json()))
    assert again.num_envs == 3
    assert same(again.reset(seed=0)[0], seen)


@pytest.mark.parametrize("name", IDS)
def test_specifications_are_those_that_tools_expect(name):
    spec = gymnasium.spec(name)
    assert spec.max_episode_steps == 20
    assert spec.reward_threshold == 0.25
    assert not spec.nondeterministic
    assert isinstance(gymnasium.make_vec(name, 2, "sync"), SyncVectorEnv)


def test_the_limit_of_the_specification_cuts_no_episode_of_the_presets():
    vector = gymnasium.make_vec("LunarHDA-Map-v0", num_envs=16)
    vector.reset(seed=0)
    slow = np.tile(np.array([0.0, 0.0, -1.0, 0.0, 0.0], np.float32), (16, 1))  # the clock falls slowest
    ends, lengths, running = 0, [], np.zeros(16, int)
    while ends < 48:
        *_, terminated, truncated, _ = vector.step(slow)
        running += 1
        assert not truncated.any()
        lengths += running[terminated].tolist()
        running[terminated] = 0
        ends = len(lengths)
    assert max(lengths) < 15


@pytest.mark.parametrize(("limit", "decisions"), [(3, 3), (20, 20)])
def test_a_limit_truncates_as_gymnasiums_does(limit, decisions):
    vector = gymnasium.make_vec("LunarHDA-Map-v0", num_envs=1, max_episode_steps=limit)
    alone = gymnasium.make("LunarHDA-Map-v0", max_episode_steps=limit)
    vector.reset(seed=2)
    alone.reset(seed=2)
    for _ in range(decisions):
        seen, reward, terminated, truncated, info = vector.step(still(1))
        expected, other_reward, other_terminated, other_truncated, other_info = alone.step(still(1)[0])
        ended = other_terminated or other_truncated
        last = info["final_obs"] if ended else seen
        assert all(np.array_equal(last[key][0], expected[key]) for key in expected)
        assert reward[0] == other_reward
        assert (terminated[0], truncated[0]) == (other_terminated, other_truncated)
        assert (info["final_info"] if ended else info)["ending"][0] == other_info["ending"]
        if ended:
            break
    else:
        raise AssertionError("no episode ended")


# Ends of episodes


@pytest.mark.parametrize("kind", KINDS)
def test_same_step_gives_the_last_observation_as_one_array_of_numbers(kind):
    vector = kind(6)
    vector.reset(seed=1)
    seen, _, terminated, truncated, info = fly_to_an_end(vector)
    ended = terminated | truncated
    assert np.array_equal(info["_final_obs"], ended)
    for last, now in zip(arrays(info["final_obs"]), arrays(seen), strict=True):
        assert (last.dtype, last.shape) == (now.dtype, now.shape)
        assert not last[~ended].any()
    flights = arrays(info["final_obs"])[0][ended]
    assert (np.abs(flights).sum(axis=1) > 0.0).all()
    assert np.array_equal(info["final_info"]["ending"] > 0, ended)
    assert (info["ending"] == 0).all()
    assert not info["reward_terms"]["propellant"][ended].any()


@pytest.mark.parametrize("kind", KINDS)
def test_disabled_begins_what_the_mask_names_and_nothing_else(kind):
    same_step, disabled = kind(5), kind(5, autoreset_mode="Disabled")
    assert disabled.metadata["autoreset_mode"] is disabled.autoreset_mode is AutoresetMode.DISABLED
    assert same(same_step.reset(seed=1), disabled.reset(seed=1))
    for _ in range(16):
        expected = same_step.step(still(5))
        given = disabled.step(still(5))
        assert same(given[1:4], expected[1:4])
        ended = given[2] | given[3]
        seen = given[0]
        if ended.any():
            for last, final in zip(arrays(seen), arrays(expected[4]["final_obs"]), strict=True):
                assert np.array_equal(last[ended], final[ended])
            with pytest.raises(gymnasium.error.ResetNeeded, match=str(np.flatnonzero(ended).tolist()[0])):
                disabled.step(still(5))
            options = {"reset_mask": ended}
            seen, info = disabled.reset(options=options)
            assert options == {"reset_mask": ended}
            assert np.array_equal(info["_speed"], ended)
            assert not info["speed"][~ended].any()
        assert same(seen, expected[0])


def test_stepping_before_the_first_reset_asks_for_one():
    with pytest.raises(gymnasium.error.ResetNeeded, match="no episode has begun"):
        LunarHDAMapVectorEnv(2).step(still(2))


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_seen_shares_no_memory_with_what_is_kept(kind):
    vector, other = kind(3, autoreset_mode="Disabled"), kind(3, autoreset_mode="Disabled")
    for _ in range(2):
        seen, expected = vector.reset(seed=0)[0], other.reset(seed=0)[0]
        for part in arrays(seen):
            part[...] = 0
        mask = np.array([True, False, False])
        assert same(
            vector.reset(options={"reset_mask": mask})[0], other.reset(options={"reset_mask": mask})[0]
        )
        assert not same(seen, expected)


# Wrong arguments


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"preset": "lidar"}, "vectorization_mode='sync'"),
        ({"preset": "navigated"}, "vectorization_mode='sync'"),
        ({"preset": "rigid-body"}, "no filter and no body"),
        ({"preset": "papr"}, "preset"),
        ({"num_envs": 0}, "num_envs"),
        ({"threads": 0}, "threads"),
        ({"max_episode_steps": 0}, "max_episode_steps must be a whole number"),
        ({"max_episode_steps": 2.5}, "max_episode_steps must be a whole number"),
        ({"autoreset_mode": "NextStep"}, "autoreset_mode must be"),
        ({"autoreset_mode": "same_step"}, "autoreset_mode must be"),
        ({"render_mode": "rgb_array"}, "render_mode"),
        ({"split": "trian"}, "split"),
        ({"layout": "square"}, "layout"),
    ],
)
def test_bad_constructor_arguments_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        gymnasium.make_vec("LunarHDA-v0", **{"num_envs": 2, **options})


@pytest.mark.parametrize(
    ("mask", "message"),
    [
        (np.array([True]), "reset_mask must be"),
        (np.array([1, 0]), "reset_mask must be"),
        ([True, False], "reset_mask must be"),
        (np.array([False, False]), "reset_mask must name"),
    ],
)
def test_bad_masks_are_named(mask, message):
    vector = LunarHDAMapVectorEnv(2)
    vector.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        vector.reset(options={"reset_mask": mask})


def test_a_study_begins_everywhere_and_unknown_options_are_named():
    vector, part = LunarHDAMapVectorEnv(2), {"reset_mask": np.array([True, False])}
    for seed in (None, 0):
        with pytest.raises(ValueError, match=r"reset_mask'\] must name every .*, got \[0\] of 2"):
            vector.reset(seed=seed, options=part)
    with pytest.raises(ValueError, match="thrust_eror"):
        vector.reset(options={"thrust_eror": 0.0})
    vector.reset(seed=0)
    broken = still(2)
    broken[1, 3] = np.nan
    for bad, words in ((still(3), "shape"), (broken, r"got \[0.0, 0.0, 0.0, nan, 0.0\] in row 1")):
        with pytest.raises(ValueError, match=f"action must .*{words}"):
            vector.step(bad)


BAD_RESETS = [{"altitude": -1.0}, {"thrust_eror": 0.0}]


@pytest.mark.parametrize("kind", [LunarHDAMapVectorEnv, lambda count: LunarHDAMapEnv()])
@pytest.mark.parametrize("bad", BAD_RESETS)
@pytest.mark.parametrize("seed", [None, 4])
def test_a_reset_that_fails_changes_nothing(kind, bad, seed):
    """Before the first study and in the midst of one; the next reset and step are as if it had not been."""
    failed, other = kind(2), kind(2)
    with pytest.raises(ValueError, match=next(iter(bad))):
        failed.reset(seed=seed, options=bad)
    assert failed.study_seed is None
    with pytest.raises(gymnasium.error.ResetNeeded):
        failed.step(still(2))
    assert same(failed.reset(seed=9), other.reset(seed=9))
    with pytest.raises(ValueError, match=next(iter(bad))):
        failed.reset(seed=seed, options=bad)
    action = still(2) if isinstance(failed, LandingVectorEnv) else still(1)[0]
    assert same(failed.step(action), other.step(action))
    assert same(failed.reset(), other.reset())


def test_a_mask_after_a_failed_first_reset_is_refused():
    vector, part = LunarHDAMapVectorEnv(2), {"reset_mask": np.array([True, False])}
    with pytest.raises(ValueError, match="altitude"):
        vector.reset(seed=0, options={"altitude": -1.0})
    with pytest.raises(ValueError, match="reset_mask"):
        vector.reset(options=part)
    vector.reset()
    vector.reset(options=part)


def test_the_threshold_is_what_every_run_of_the_recipe_earned():
    """Of three trainings, on 1000 validation episodes each: `rl/weights/td3.json`."""
    runs = read_card(WEIGHTS_FOLDER / "td3.json", "actor")["training"]["seeds"]
    earned = [run["validation"]["reward"] for run in runs]
    assert len(earned) == 3
    for name in IDS:
        threshold = gymnasium.spec(name).reward_threshold
        assert threshold == np.floor(100.0 * min(earned)) / 100.0
