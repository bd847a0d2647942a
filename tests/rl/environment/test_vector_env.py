"""The native vector environments: each row to the bit a single environment, and `hda.fly`."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import rl  # noqa: F401 - registers the environments
from hda.flight.episode import fly
from hda.sensing.lidar import Lidar
from hda.task.observation import Observation
from hda.task.presets import PRESETS, Preset
from hda.task.scenario import sample_scenario
from rl.environment.action import decide_action
from rl.environment.dispersions import Dispersions
from rl.environment.encoding import encode_map
from rl.environment.env import LunarHDAEnv
from rl.environment.episode_info import ENDING_CODES
from rl.environment.map_env import LunarHDAMapEnv
from rl.environment.native.vector_env import LunarHDAMapVectorEnv, LunarHDAVectorEnv
from tests.equality import same
from tests.rl.lanes import Lane

PAIRS = ((LunarHDAVectorEnv, LunarHDAEnv), (LunarHDAMapVectorEnv, LunarHDAMapEnv))
UPRIGHT = replace(
    PRESETS["paper"], lander=replace(PRESETS["paper"].lander, pointing_limit=math.radians(15.0))
)
HASTY = replace(PRESETS["paper"], rules=replace(PRESETS["paper"].rules, max_decisions=6))
EMPTY = replace(PRESETS["paper"], lander=replace(PRESETS["paper"].lander, dry_mass=1165.0))


def lanes(kind: type[Any], count: int, **options: Any) -> SyncVectorEnv:
    """Gymnasium's own vector of single environments that fly the episodes of a native one."""
    makers = [lambda k=k: Lane(kind(**options), k, count) for k in range(count)]
    return SyncVectorEnv(makers, autoreset_mode=AutoresetMode.SAME_STEP)


def actions(count: int, steps: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1.2, 1.2, (steps, count, 5)).astype(np.float32)


def dense(info: dict[str, Any], observation: Any) -> dict[str, Any]:
    """Gymnasium's `info` with the last observations as one array."""
    if "final_obs" not in info:
        return info
    rows, out = info["final_obs"], {}
    for key, part in observation.items() if isinstance(observation, dict) else [("", observation)]:
        out[key] = np.zeros_like(part)
        for k in np.flatnonzero(info["_final_obs"]):
            out[key][k] = rows[k][key] if key else rows[k]
    return {**info, "final_obs": out if isinstance(observation, dict) else out[""]}


def sorted_parts(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: sorted_parts(value[key]) for key in sorted(value)}
    return value


# Equal to the single environment


@pytest.mark.parametrize(("native", "single"), PAIRS)
@pytest.mark.parametrize(
    ("preset", "count", "steps"),
    [
        ("paper", 5, 40),
        ("paper", 1, 20),
        ("partial", 4, 25),
        ("hard", 3, 20),
        (UPRIGHT, 3, 20),
        (HASTY, 3, 20),
        (EMPTY, 3, 20),
    ],
    ids=["paper", "one", "partial", "hard", "upright", "hasty", "empty"],
)
def test_each_row_is_a_single_environment_to_the_bit(native, single, preset, count, steps):
    vector, rows = native(count, preset=preset), lanes(single, count, preset=preset)
    seen, info = vector.reset(seed=7)
    other, other_info = rows.reset(seed=7)
    assert same(sorted_parts(seen), sorted_parts(other))
    assert same(sorted_parts(info), sorted_parts(other_info))
    ends = 0
    for action in actions(count, steps):
        *flown, info = vector.step(action)
        *expected, other_info = rows.step(action)
        assert same(sorted_parts(flown), sorted_parts(expected))
        assert same(sorted_parts(info), sorted_parts(dense(other_info, expected[0])))
        ends += int(np.sum(flown[2] | flown[3]))
    assert ends >= count
    vector.close()
    rows.close()


@dataclass(frozen=True)
class Replay:
    """Plays the actions of one row: the bridge between a vector and `fly`."""

    actions: np.ndarray
    name: str = "replay"

    def begin(self, scenario_view, rng):
        return 0

    def decide(self, observation, memory):
        return decide_action(self.actions[memory], observation), memory + 1


@pytest.mark.parametrize("preset", ["paper", "partial"])
def test_each_row_is_flown_as_fly_flies_it(preset):
    count, steps = 3, 25
    chosen, begun = actions(count, steps, 2), np.zeros(count, int)
    vector = LunarHDAMapVectorEnv(count, preset=preset)
    seen, info = vector.reset(seed=4)
    maps, rewards, flown = [[] for _ in range(count)], [[] for _ in range(count)], 0
    for number, action in enumerate(chosen):
        for k in range(count):
            maps[k].append(seen["map"][k, 0].copy())
        episodes = info["episode_number"].copy()
        seen, reward, terminated, truncated, info = vector.step(action)
        for k in range(count):
            rewards[k].append(reward[k])
        for k in np.flatnonzero(terminated | truncated):
            scenario = sample_scenario(preset, 4, int(episodes[k]), "train")
            record = fly(Replay(chosen[begun[k] :, k]), scenario)
            assert rewards[k] == [terms.total for terms in record.rewards]
            expected = [encode_map(look.safety_map) for look in record.observations]
            assert len(maps[k]) == len(expected)
            assert all(np.array_equal(a, b) for a, b in zip(maps[k], expected, strict=True))
            final = {key: part[k] for key, part in info["final_info"].items() if key != "reward_terms"}
            assert final["ending"] == ENDING_CODES[record.outcome.ending]
            assert final["target_distance"] == record.outcome.miss_distance
            assert final["speed"] == record.outcome.touchdown_speed
            assert final["propellant_fraction"] == record.outcome.propellant_fraction
            begun[k], maps[k], rewards[k], flown = number + 1, [], [], flown + 1
    assert flown >= count


@pytest.mark.parametrize("native", [LunarHDAVectorEnv, LunarHDAMapVectorEnv])
def test_threads_change_no_number(native):
    alone, spread = native(5), native(5, threads=3)
    assert same(alone.reset(seed=1), spread.reset(seed=1))
    for action in actions(5, 12):
        assert same(alone.step(action), spread.step(action))
    spread.close()


@pytest.mark.parametrize("seed", [0, 2**32, 2**64 + 7])
def test_a_row_does_not_depend_on_how_many_fly_beside_it(seed):
    few, many = LunarHDAVectorEnv(2), LunarHDAVectorEnv(4)
    first, second = few.reset(seed=seed)[0], many.reset(seed=seed)[0]
    assert np.array_equal(first, second[:2])
    for action in actions(4, 4):
        assert np.array_equal(few.step(action[:2])[0], many.step(action)[0][:2])


# Which episodes


def test_environment_i_of_n_flies_every_nth_episode_of_one_study():
    vector = LunarHDAMapVectorEnv(3)
    numbers = [vector.reset(seed=5 if k == 0 else None)[1] for k in range(3)]
    assert [info["episode_number"].tolist() for info in numbers] == [[0, 1, 2], [3, 4, 5], [6, 7, 8]]
    assert all((info["study_seed"] == 5).all() for info in numbers)
    assert vector.reset(seed=6)[1]["episode_number"].tolist() == [0, 1, 2]


@pytest.mark.parametrize("part", ["flight", "map"])
def test_seeds_share_no_first_look(part):
    looks = [LunarHDAMapVectorEnv(4).reset(seed=seed)[0][part] for seed in (5, 6)]
    assert len(np.unique(np.concatenate(looks).reshape(8, -1), axis=0)) == 8


def test_unseeded_vectors_differ():
    seeds = [LunarHDAMapVectorEnv(1).reset()[1]["study_seed"][0] for _ in range(2)]
    assert seeds[0] != seeds[1]


@pytest.mark.parametrize(
    ("name", "factor"), [("thrust_error", 0.0), ("map_noise", 3.0), ("altitude", 0.0), ("map_dropout", 2.5)]
)
def test_an_option_changes_the_episodes_that_the_reset_begins(name, factor):
    preset = "partial" if name == "map_dropout" else "paper"
    vector, alone = LunarHDAMapVectorEnv(2, preset=preset), LunarHDAMapEnv(preset)
    alone.continue_study(3, 1)
    plain = vector.reset(seed=3)[0]
    changed = vector.reset(seed=3, options={name: factor})[0]
    expected = alone.reset(options={name: factor})[0]
    for _ in range(2):
        assert all(np.array_equal(changed[key][1], expected[key]) for key in expected)
        changed, expected = (
            vector.step(np.zeros((2, 5), np.float32))[0],
            alone.step(np.zeros(5, np.float32))[0],
        )
    given = LunarHDAMapVectorEnv(2, preset=preset, dispersions=Dispersions(**{name: factor}))
    first = given.reset(seed=3)[0]
    assert same(first, vector.reset(seed=3, options={name: factor})[0])
    assert name == "thrust_error" or not same(first, plain)


# What the kernels that many rows share must give


def test_every_look_in_the_batch_is_that_of_observe():
    from hda.flight.episode import begin_flight, observe

    vector, shown = LunarHDAMapVectorEnv(3, preset="partial"), []
    vector.reset(seed=0)
    vector.batch.look(np.arange(3), lambda k, safety_map: shown.append(safety_map.copy()))
    for scenario, safety_map in zip(vector.batch.scenarios, shown, strict=True):
        assert scenario is not None
        look: Observation = observe(scenario, begin_flight(scenario))
        assert np.array_equal(look.safety_map, safety_map)


def test_a_preset_of_ones_own_is_flown():
    own: Preset = replace(PRESETS["paper"], lidar=Lidar(pixels=32))
    vector = LunarHDAMapVectorEnv(2, preset=own)
    assert vector.reset(seed=0)[0]["map"].shape == (2, 1, 32, 32)
