from __future__ import annotations

import math
import subprocess
import sys
from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env as gymnasium_check
from stable_baselines3.common.env_checker import check_env as sb3_check

import rl  # noqa: F401 - registers the environments
from hda.flight.episode import advance, begin_flight, fly, observe
from hda.flight.outcome import score_step
from hda.flight.record import EpisodeRecord
from hda.sensing.lidar import Lidar
from hda.sensing.ranging import RangingLidar
from hda.task.presets import PRESETS, Preset
from hda.task.scenario import sample_scenario
from rl.environment.action import decide_action
from rl.environment.dispersions import Dispersions
from rl.environment.encoding import CURVED, PRINTED, RELATIVE
from rl.environment.env import LunarHDAEnv
from rl.environment.episode_info import ENDING_CODES
from rl.environment.map_env import LunarHDAMapEnv

IDS = ("LunarHDA-v0", "LunarHDA-Map-v0")


@dataclass(frozen=True)
class ScriptedPolicy:
    """Plays a list of actions: the bridge between an environment and `fly`."""

    actions: np.ndarray
    name: str = "scripted"

    def begin(self, scenario_view, rng):
        return 0

    def decide(self, observation, memory):
        return decide_action(self.actions[memory], observation), memory + 1


def map_lidar(preset: Preset) -> Lidar:
    assert isinstance(preset.lidar, Lidar)
    return preset.lidar


def flatten(observation: Any) -> np.ndarray:
    if isinstance(observation, dict):
        return np.concatenate([observation[key].ravel().astype(float) for key in sorted(observation)])
    return observation


def random_actions(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (20, 5)).astype(np.float32)


@pytest.mark.parametrize("name", IDS)
def test_gymnasium_check_passes_without_a_warning(name):
    gymnasium_check(gymnasium.make(name).unwrapped)


@pytest.mark.parametrize("name", IDS)
def test_sb3_check_passes_without_a_warning(name):
    sb3_check(gymnasium.make(name, render_mode="rgb_array"))


def test_registration_works_in_a_fresh_process_without_torch():
    code = (
        "import sys, gymnasium, rl; env = gymnasium.make('LunarHDA-v0'); env.reset(seed=1);"
        "gymnasium.make('LunarHDA-Map-v0').reset(seed=1); assert 'torch' not in sys.modules; print('ok')"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=300)
    assert done.stdout.strip() == "ok", done.stderr


@pytest.mark.parametrize(
    ("preset", "seed"), [*(("paper", k) for k in range(6)), ("partial", 0), ("partial", 1)]
)
def test_a_rollout_equals_fly_exactly(preset, seed):
    scenario = sample_scenario(preset, 5, seed, "train")
    actions = random_actions(seed)
    record: EpisodeRecord = fly(ScriptedPolicy(actions), scenario)
    env = LunarHDAMapEnv()
    seen, info = env.reset(options={"scenario": scenario})
    for k, observation in enumerate(record.observations):
        np.testing.assert_array_equal(seen["map"][0], np.round(observation.safety_map * 255).astype(np.uint8))
        seen, reward, terminated, truncated, info = env.step(actions[k])
        assert reward == record.rewards[k].total
        assert (terminated or truncated) == (k == len(record.observations) - 1)
        np.testing.assert_array_equal(env.steps[k].segment.path, record.segments[k].path)
    assert env.outcome is not None
    assert env.outcome.ending == record.outcome.ending
    np.testing.assert_array_equal(env.outcome.touchdown, record.outcome.touchdown)
    assert info["ending"] == ENDING_CODES[record.outcome.ending]
    assert info["target_distance"] == record.outcome.miss_distance
    assert info["speed"] == record.outcome.touchdown_speed
    assert info["propellant_fraction"] == record.outcome.propellant_fraction
    assert info["is_success"] == record.outcome.success
    assert info["safe_site"] == record.outcome.safe_site


def test_a_rollout_keeps_the_landers_pointing_limit_as_fly_does():
    upright = replace(PRESETS["paper"].lander, pointing_limit=math.radians(15.0))
    preset = replace(PRESETS["paper"], lander=upright)
    scenario = sample_scenario(preset, 5, 1, "train")
    actions = random_actions(1)
    record = fly(ScriptedPolicy(actions), scenario)
    env = LunarHDAMapEnv(preset)
    env.reset(options={"scenario": scenario})
    for k, segment in enumerate(record.segments):
        env.step(actions[k])
        np.testing.assert_array_equal(env.steps[k].segment.path, segment.path)
    assert sum(step.segment.pointing_limited for step in env.steps) == record.pointing_limited > 0
    assert record.maximum_tilt == pytest.approx(math.radians(15.0), abs=1e-9)


def test_seeded_episodes_are_those_of_sample_scenario():
    env = LunarHDAEnv()
    for episode in range(3):
        _, info = env.reset(seed=11 if episode == 0 else None)
        scenario = sample_scenario("paper", 11, episode, "train")
        assert (info["study_seed"], info["episode_number"], info["tile"]) == (
            11,
            episode,
            scenario.tile.number,
        )
        assert env.scenario is not None
        np.testing.assert_array_equal(
            env.scenario.initial_state.as_array(), scenario.initial_state.as_array()
        )


@pytest.mark.parametrize("name", IDS)
def test_equal_seeds_give_equal_episodes_and_others_do_not(name):
    def play(seed):
        env = gymnasium.make(name)
        seen = [flatten(env.reset(seed=seed)[0])]
        for action in random_actions(3):
            observation, reward, terminated, truncated, _ = env.step(action)
            seen.append(np.append(flatten(observation), float(reward)))
            if terminated or truncated:
                break
        return seen

    first, again, other = play(1), play(1), play(2)
    assert len(first) == len(again)
    for a, b in zip(first, again, strict=True):
        np.testing.assert_array_equal(a, b)
    assert not np.array_equal(first[0], other[0])


def test_unseeded_environments_differ():
    assert LunarHDAEnv().reset()[1]["study_seed"] != LunarHDAEnv().reset()[1]["study_seed"]


@pytest.mark.parametrize("layout", [CURVED, RELATIVE, PRINTED], ids=lambda layout: layout.name)
def test_both_environments_describe_the_flight_alike(layout):
    scenario = sample_scenario("paper", 0, 1, "train")
    options = {"scenario": scenario}
    vector, _ = LunarHDAEnv(layout=layout.name).reset(options=options)
    seen, _ = LunarHDAMapEnv(layout=layout.name).reset(options=options)
    assert np.array_equal(seen["flight"], vector[:12])


@pytest.mark.parametrize("layout", [CURVED, RELATIVE, PRINTED], ids=lambda layout: layout.name)
def test_no_element_is_constant_but_the_listed_ones(layout):
    env = LunarHDAEnv(layout=layout.name)
    rng = np.random.default_rng(0)
    vectors = []
    for episode in range(20):
        vectors.append(env.reset(seed=0 if episode == 0 else None)[0])
        over = False
        while not over:
            vector, _, terminated, truncated, _ = env.step(rng.uniform(-1, 1, 5).astype(np.float32))
            vectors.append(vector)
            over = terminated or truncated
    still = np.ptp(np.array(vectors), axis=0) == 0.0
    names = {layout.elements[k].name for k in np.flatnonzero(still[:12])}
    assert names == set(layout.constant)
    assert not still[12:].any()


@pytest.mark.parametrize("name", IDS)
def test_observations_share_no_memory(name):
    env = gymnasium.make(name)
    first, _ = env.reset(seed=0)
    kept = flatten(first).copy()
    second = env.step(np.zeros(5, dtype=np.float32))[0]
    if isinstance(first, dict):
        assert not any(np.shares_memory(first[key], second[key]) for key in first)
        for value in second.values():
            value[...] = 0
    else:
        assert not np.shares_memory(first, second)
        second[...] = 0
    np.testing.assert_array_equal(flatten(first), kept)
    third = env.step(np.zeros(5, dtype=np.float32))[0]
    assert flatten(third).any()


def test_rewards_are_those_of_score_step():
    env = LunarHDAEnv()
    env.reset(seed=4)
    assert env.scenario is not None
    start = env.scenario.initial_state
    mass, over = start.mass, False
    while not over:
        _, reward, terminated, truncated, info = env.step(np.zeros(5, dtype=np.float32))
        after = env.steps[-1].flight.state.mass
        burnt = (mass - after) / (start.mass - PRESETS["paper"].lander.dry_mass)
        terms = score_step(burnt, env.outcome)
        assert reward == pytest.approx(terms.total, abs=1e-12)
        assert sum(info["reward_terms"].values()) == pytest.approx(reward, abs=1e-12)
        mass, over = after, terminated or truncated


def test_truncation_is_not_termination():
    preset = replace(PRESETS["paper"], rules=replace(PRESETS["paper"].rules, max_decisions=3))
    env = LunarHDAEnv(preset)
    env.reset(seed=0)
    ends = [env.step(np.zeros(5, dtype=np.float32))[2:4] for _ in range(3)]
    assert ends == [(False, False), (False, False), (False, True)]
    env.reset(seed=0)
    full = LunarHDAEnv()
    full.reset(seed=0)
    terminated = truncated = False
    while not (terminated or truncated):
        _, _, terminated, truncated, _ = full.step(np.zeros(5, dtype=np.float32))
    assert (terminated, truncated) == (True, False)


def test_stepping_past_the_end_asks_for_a_reset():
    env = LunarHDAEnv()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(5, dtype=np.float32))
    env.reset(seed=0)
    for _ in range(20):
        if any(env.step(np.zeros(5, dtype=np.float32))[2:4]):
            break
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(5, dtype=np.float32))


def starts(name: str, **options: float) -> np.ndarray:
    env = LunarHDAMapEnv()
    values = []
    for episode in range(6):
        env.reset(seed=0 if episode == 0 else None, options=options)
        assert env.scenario is not None
        state, target = env.scenario.initial_state, env.scenario.nominal_target
        offset = state.position - target
        heading = math.atan2(state.velocity[1], state.velocity[0]) - math.atan2(-offset[1], -offset[0])
        values.append(
            {
                "altitude": state.position[2],
                "distance": math.hypot(offset[0], offset[1]),
                "descent_speed": -state.velocity[2],
                "horizontal_speed": math.hypot(state.velocity[0], state.velocity[1]),
                "approach_spread": math.remainder(heading, 2 * math.pi),
                "map_noise": map_lidar(env.scenario.preset).noise,
                "thrust_error": env.scenario.streams.thrust_error(0, env.scenario.preset.rules.thrust_error),
            }[name]
        )
    return np.array(values)


@pytest.mark.parametrize(
    ("name", "off"),
    [
        ("altitude", 950.0),
        ("distance", 225.0),
        ("descent_speed", 27.5),
        ("horizontal_speed", 7.5),
        ("approach_spread", 0.0),
        ("map_noise", 0.0),
        ("thrust_error", 0.0),
    ],
)
def test_each_dispersion_has_a_switch(name, off):
    np.testing.assert_allclose(starts(name, **{name: 0.0}), off, atol=1e-9)
    assert not np.allclose(starts(name), off, atol=1e-3)


@pytest.mark.parametrize(
    ("name", "error"), [("navigation_position", slice(0, 3)), ("navigation_velocity", slice(3, 6))]
)
def test_errors_of_the_estimated_state_have_switches(name, error):
    env = LunarHDAMapEnv("partial")
    drawn = []
    for factor in (1.0, 2.0, 0.0):
        env.reset(seed=0, options={name: factor})
        assert env.scenario is not None
        drawn.append(env.scenario.navigation_error)
    other = np.delete(np.arange(6), error)
    assert np.all(drawn[0] != 0.0)
    np.testing.assert_allclose(drawn[1][error], 2.0 * drawn[0][error], rtol=1e-12)
    np.testing.assert_array_equal(drawn[2][error], 0.0)
    for errors in drawn:
        np.testing.assert_array_equal(errors[other], drawn[0][other])


def test_dropped_maps_have_a_switch():
    env = LunarHDAMapEnv("partial")

    def maps(factor: float) -> list[bool]:
        first = (env.reset(seed=0 if k == 0 else None, options={"map_dropout": factor})[0] for k in range(12))
        return [bool(look["map"].any()) for look in first]

    assert 0 < sum(maps(1.0)) < 12  # all alike in 12 looks: once in 460 seeds at most
    assert all(maps(0.0))
    assert not any(maps(2.5))
    assert map_lidar(Dispersions(map_dropout=100.0).applied(PRESETS["partial"])).dropout == 1.0


def test_on_measured_looks_the_same_factors_scale_the_ranges():
    preset = replace(PRESETS["lidar"], lidar=RangingLidar(ray_dropout=0.1))
    lidar = Dispersions(map_noise=3.0, map_dropout=2.0).applied(preset).lidar
    assert lidar == RangingLidar(ray_dropout=0.2, range_noise=3.0 * RangingLidar().range_noise)
    full = Dispersions(map_dropout=100.0).applied(preset).lidar
    assert full == RangingLidar(ray_dropout=1.0)


def test_without_dispersions_the_flight_to_the_first_target_is_repeatable_and_clean():
    calm = Dispersions(map_noise=0.0, thrust_error=0.0)
    env = LunarHDAMapEnv(dispersions=calm)
    env.reset(seed=3)
    scenario = env.scenario
    assert scenario is not None
    flight = begin_flight(scenario)
    look = observe(scenario, flight)
    assert set(np.unique(look.safety_map)) <= set(np.unique(scenario.tile.probability)) | {0.0}
    step = advance(scenario, flight, decide_action(np.zeros(5), look))
    assert step.segment.thrust_error == 0.0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"thrust_eror": 0.0}, "thrust_eror"),
        ({"thrust_error": -1.0}, "thrust_error"),
        ({"scenario": 3}, "hda.Scenario"),
    ],
)
def test_bad_options_are_named(options, message):
    with pytest.raises(ValueError, match=message):
        LunarHDAMapEnv().reset(seed=0, options=options)


def test_bad_constructor_arguments_are_named():
    with pytest.raises(ValueError, match="render_mode"):
        LunarHDAEnv(render_mode="human")
    with pytest.raises(ValueError, match="layout"):
        LunarHDAEnv(layout="square")
    with pytest.raises(ValueError, match="preset"):
        LunarHDAEnv("papr")


def test_a_picture_of_measured_looks_shows_the_heights_too():
    env = LunarHDAMapEnv("lidar-coarse", render_mode="rgb_array")
    env.reset(seed=0)
    picture = env.render()
    assert picture is not None
    assert picture.shape == (320, 960, 3)
    heights = picture[:, 640:].reshape(-1, 3).astype(int)
    colourful = np.ptp(heights, axis=1) > 40  # cividis runs from blue to yellow
    assert colourful.mean() > 0.3


def test_a_picture_shows_the_body_close_by_and_its_flame_once_it_burns():
    env = LunarHDAMapEnv("rigid-body", render_mode="rgb_array")
    env.reset(seed=0)
    flame = np.array([184, 122, 0])  # of `hda.flight.portrait.shape.PLUME_COLOR`
    burning = []
    for steps in (4, 0):
        picture = env.render()
        assert picture is not None
        close = picture[202:280, 248:325].astype(int)  # the corner of the left panel
        assert (close > 250).all(axis=2).mean() > 0.3  # on white
        grey = (np.ptp(close, axis=2) < 3) & (close[..., 0] > 30) & (close[..., 0] < 200)
        assert grey.sum() > 100  # the lander
        burning.append(int((np.abs(close - flame).sum(axis=2) < 30).sum()))
        for _ in range(steps):
            env.step(np.zeros(5, dtype=np.float32))
    assert burning[0] == 0
    assert burning[1] > 10


def test_picture_of_the_flight():
    env = LunarHDAMapEnv(render_mode="rgb_array")
    env.reset(seed=0)
    before = env.render()
    env.step(np.zeros(5, dtype=np.float32))
    after = env.render()
    assert before is not None
    assert after is not None
    assert before.shape == after.shape == (320, 640, 3)
    assert before.dtype == np.uint8
    assert not np.array_equal(before, after)
