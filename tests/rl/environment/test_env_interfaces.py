"""What the environments owe to the tools around them: infos, seeds, recorders, vectors, worker processes."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv
from gymnasium.wrappers import RecordEpisodeStatistics
from stable_baselines3.common.monitor import Monitor

import rl  # noqa: F401 - registers the environments
from hda.flight.outcome import Ending
from hda.task.presets import PRESETS
from hda.task.scenario import sample_scenario
from rl.environment.env import LunarHDAEnv
from rl.environment.episode_info import ENDING_CODES
from rl.environment.map_env import LunarHDAMapEnv

IDS = ("LunarHDA-v0", "LunarHDA-Map-v0")
KINDS = (LunarHDAEnv, LunarHDAMapEnv)
STILL = np.zeros(5, np.float32)


def play(env: gymnasium.Env[Any, Any], seed: int = 0) -> list[dict[str, Any]]:
    """Infos of an episode, that of the reset first."""
    infos, over = [env.reset(seed=seed)[1]], False
    while not over:
        _, _, terminated, truncated, info = env.step(STILL)
        infos.append(info)
        over = terminated or truncated
    return infos


def types_of(info: dict[str, Any]) -> dict[str, Any]:
    return {key: types_of(value) if isinstance(value, dict) else type(value) for key, value in info.items()}


# Infos


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("decisions", [3, 20])
@pytest.mark.parametrize("preset", ["paper", "partial"])
def test_infos_have_the_same_keys_and_types_at_all_times(kind, decisions, preset):
    setting = PRESETS[preset]
    env = kind(replace(setting, rules=replace(setting.rules, max_decisions=decisions)))
    infos = play(env)
    expected = types_of(infos[0])
    assert all(types_of(info) == expected for info in infos)
    assert {value for value in expected.values() if isinstance(value, type)} == {int, float, bool}
    assert set(expected["reward_terms"].values()) == {float}
    assert list(infos[0]) == list(infos[-1])


def test_infos_say_what_happened():
    env = LunarHDAMapEnv()
    assert env.outcome is None
    infos = play(env, 4)
    assert env.scenario is not None
    assert env.outcome is not None
    assert [info["ending"] for info in infos[:-1]] == [0] * (len(infos) - 1)
    assert list(Ending)[infos[-1]["ending"] - 1] is env.outcome.ending
    assert not any(info["is_success"] or info["safe_site"] for info in infos[:-1])
    start = env.scenario.initial_state
    distance = np.linalg.norm(start.position - env.scenario.nominal_target)
    assert infos[0]["target_distance"] == pytest.approx(distance)
    assert infos[0]["speed"] == pytest.approx(np.linalg.norm(start.velocity))
    assert infos[0]["propellant_fraction"] == 0.0
    burnt = [info["propellant_fraction"] for info in infos]
    assert all(after > before for before, after in pairwise(burnt))
    assert sum(infos[0]["reward_terms"].values()) == 0.0
    env.reset()
    assert env.outcome is None


def test_every_ending_has_a_code_of_its_own_above_that_of_flight():
    assert list(ENDING_CODES) == list(Ending)
    assert sorted(ENDING_CODES.values()) == list(range(1, len(Ending) + 1))
    assert ENDING_CODES[Ending.SUCCESS] == 1


@pytest.mark.parametrize("name", IDS)
def test_infos_of_a_vector_are_arrays_of_numbers(name):
    vector = SyncVectorEnv([lambda: gymnasium.make(name)] * 2)
    _, infos = vector.reset(seed=2**70)
    for _ in range(10):
        for key, value in infos.items():
            if key != "reward_terms" and not key.startswith("_"):
                assert value.dtype in (np.int64, np.float64, np.bool_), key
        *_, infos = vector.step(np.zeros((2, 5), np.float32))
    vector.close()


def test_recorders_of_statistics_find_no_key_of_theirs():
    info = play(RecordEpisodeStatistics(LunarHDAMapEnv()))[-1]
    assert set(info["episode"]) == {"r", "l", "t"}
    monitored = play(Monitor(LunarHDAMapEnv(), info_keywords=("is_success", "ending")))[-1]
    assert monitored["episode"]["ending"] == monitored["ending"]
    assert monitored["episode"]["is_success"] == monitored["is_success"]


def test_sb3_counts_success_once_for_an_episode():
    from stable_baselines3 import TD3

    env = LunarHDAEnv()
    model = TD3("MlpPolicy", env, learning_starts=10**6, buffer_size=64, device="cpu")
    model.learn(30)
    episodes = env.next_episode - 1  # the last is under way
    assert 0 < len(model.ep_success_buffer or ()) == episodes < 10


# Seeds


@pytest.mark.parametrize("seed", [0, 2**31, 2**32 - 1, 2**32, 2**40, 2**64 + 7, 2**128])
def test_every_seed_that_gymnasium_takes_flies_its_own_study(seed):
    env = LunarHDAMapEnv()
    for episode in range(2):
        _, info = env.reset(seed=seed if episode == 0 else None)
        scenario = sample_scenario("paper", seed, episode, "train")
        assert env.scenario is not None
        np.testing.assert_array_equal(
            env.scenario.initial_state.as_array(), scenario.initial_state.as_array()
        )
        assert env.scenario.streams == scenario.streams
        assert info["study_seed"] == (seed if seed < 2**63 else -1)
        assert info["episode_number"] == episode


def test_large_seeds_differ_from_those_that_they_end_in():
    env = LunarHDAMapEnv()
    starts = []
    for seed in (0, 2**32, 2**40, 2**64):
        env.reset(seed=seed)
        assert env.scenario is not None
        starts.append(env.scenario.initial_state.as_array().tobytes())
    assert len(set(starts)) == 4


# Splits


@pytest.mark.parametrize("name", IDS)
@pytest.mark.parametrize("split", ["trian", "", "own", None])
def test_a_wrong_split_is_noticed_when_the_environment_is_made(name, split):
    with pytest.raises(ValueError, match="split"):
        gymnasium.make(name, split=split)


# Names and workers

_WORKERS = """
import sys
import numpy as np
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import SubprocVecEnv
vector = make_vec_env(
    "rl:LunarHDA-Map-v0", 2, seed=3, vec_env_cls=SubprocVecEnv, vec_env_kwargs={"start_method": sys.argv[1]}
)
seen = vector.reset()
print(seen["flight"].shape, vector.step(np.zeros((2, 5), np.float32))[1].shape)
vector.close()
"""


def run(*arguments: str) -> str:
    done = subprocess.run(
        [sys.executable, *arguments], capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


@pytest.mark.parametrize("name", IDS)
def test_the_name_with_its_module_needs_no_import(name):
    code = f"import gymnasium; env = gymnasium.make('rl:{name}'); env.reset(seed=0); print(env.spec.id)"
    assert run("-W", "error", "-c", code) == name


@pytest.mark.slow
@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_workers_that_import_nothing_make_environments_by_the_name_with_its_module(method):
    assert run("-c", _WORKERS, method) == "(2, 12) (2,)"


def test_an_asynchronous_vector_works_under_spawn():
    code = (
        "import gymnasium, rl\n"
        "vector = gymnasium.make_vec('LunarHDA-Map-v0', 2, 'async', vector_kwargs={'context': 'spawn'})\n"
        "print(vector.reset(seed=1)[0]['flight'].shape)\n"
        "vector.close()"
    )
    assert run("-c", code) == "(2, 12)"
