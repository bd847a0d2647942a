"""What learners take as spaces, and what they say of others."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from examples.memory_task import SETTINGS
from rl.learning.algorithms import make_algorithm
from rl.learning.box_spaces import check_environment
from rl.learning.recurrent.td3_lstm import RecurrentTD3
from rl.learning.td3 import FastTD3
from rl.recipes import OFF_POLICY_RECIPES

UNIT = spaces.Box(-1.0, 1.0, (2,), np.float32)


class Task(gymnasium.Env):
    """Episodes of three steps in any spaces; an action outside its space is refused."""

    def __init__(self, observation: spaces.Space[Any] = UNIT, action: spaces.Space[Any] = UNIT) -> None:
        self.observation_space, self.action_space = observation, action

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None):
        super().reset(seed=seed)
        self.time = 0
        return np.zeros(2, np.float32), {}

    def step(self, action):
        assert self.action_space.contains(action), action
        self.time += 1
        return np.zeros(2, np.float32), 0.0, self.time == 3, False, {}


def box(low: Any, high: Any, dtype: Any = np.float32) -> spaces.Box:
    return spaces.Box(np.array(low, dtype), np.array(high, dtype), dtype=dtype)


def with_nan() -> spaces.Box:
    space = box([-1.0, -1.0], [1.0, 1.0])
    space.high[1] = np.nan
    return space


REFUSED = {
    "infinite": (spaces.Box(-np.inf, np.inf, (2,)), "finite bounds.*TransformAction.*ClipAction"),
    "infinite below": (box([-np.inf, -1.0], [1.0, 1.0]), "finite bounds"),
    "infinite above": (box([-1.0, 0.0], [1.0, np.inf]), "finite bounds"),
    "as good as infinite": (box([-3.4e38, -1.0], [3.4e38, 1.0]), "finite bounds"),
    "not a number": (with_nan(), "finite bounds"),
    "fixed": (box([-1.0, 2.0], [1.0, 2.0]), r"low is not below high at \[1\]"),
    "integers": (box([0, 0], [5, 5], np.int64), "real numbers.*int64"),
    "bytes": (box([0, 0], [255, 255], np.uint8), "real numbers.*uint8"),
    "discrete": (spaces.Discrete(3), "one-dimensional Box as action_space"),
    "several discrete": (spaces.MultiDiscrete([3, 2]), "one-dimensional Box as action_space"),
    "several binary": (spaces.MultiBinary(2), "one-dimensional Box as action_space"),
    "a dictionary": (spaces.Dict(a=UNIT), "one-dimensional Box as action_space"),
    "a tuple": (spaces.Tuple((UNIT, UNIT)), "one-dimensional Box as action_space"),
    "a matrix": (spaces.Box(-1.0, 1.0, (2, 2)), "one-dimensional Box as action_space"),
    "nothing": (spaces.Box(-1.0, 1.0, (0,)), "one-dimensional Box as action_space"),
}


def make_recurrent(env: Any) -> RecurrentTD3:
    return RecurrentTD3(env, replace(SETTINGS, random_steps=4, batch_size=2, memory=4, hidden=(4,)), 0)


def make_recipe(env: Any, name: str) -> Any:
    return make_algorithm(
        replace(OFF_POLICY_RECIPES[name], replay_size=64, hidden=(4,), random_steps=4), env, 0
    )


@pytest.mark.parametrize("case", REFUSED)
def test_actions_that_cannot_be_scaled_are_refused_with_the_space_and_the_way_out(case):
    space, words = REFUSED[case]
    env = Task(action=space)
    for make in (make_recurrent, lambda env: FastTD3("MlpPolicy", env, device="cpu")):
        with pytest.raises(ValueError, match=words):
            make(env)
    for name in OFF_POLICY_RECIPES:
        with pytest.raises(ValueError, match=words):
            make_recipe(env, name)


@pytest.mark.parametrize(
    "space",
    [
        spaces.Discrete(3),
        spaces.MultiDiscrete([3, 2]),
        spaces.MultiBinary(2),
        spaces.Dict(a=UNIT),
        spaces.Tuple((UNIT,)),
        spaces.Box(0, 255, (4, 4), np.uint8),
        spaces.Text(5),
    ],
    ids=lambda space: type(space).__name__,
)
def test_observations_of_other_spaces_are_refused_with_the_way_out(space):
    for make in (make_recurrent, lambda env: make_recipe(env, "sac")):
        with pytest.raises(ValueError, match=r"one-dimensional Box as observation_space.*FlattenObservation"):
            make(Task(observation=space))


@pytest.mark.parametrize("env", ["Pendulum-v1", None, Task])
def test_what_is_no_environment_is_refused(env):
    with pytest.raises(ValueError, match="Gymnasium environment"):
        check_environment(env)


def test_a_vector_of_environments_is_refused():
    with pytest.raises(ValueError, match="one environment, got a vector of 2"):
        make_recurrent(gymnasium.vector.SyncVectorEnv([Task, Task]))


@pytest.mark.parametrize(
    "space",
    [
        UNIT,
        box([-2.0, 0.0], [0.5, 1e-3]),
        box([-0.1, 0.1], [0.1, 0.3], np.float64),  # 0.1 rounded to float32 lies outside
        box([0.0, 0.0], [1.0, 6e4], np.float16),
    ],
    ids=str,
)
def test_actions_never_leave_a_finite_box_of_any_real_type(space):
    agent = make_recurrent(Task(action=space))
    agent.learn(30)
    for ends in (-1.0, 1.0):
        assert space.contains(agent._unscaled(np.full(2, ends, np.float32)))


def test_infinite_actions_are_learnt_with_the_advice_that_the_message_gives():
    env = Task(action=spaces.Box(-np.inf, np.inf, (2,)))
    bounded = gymnasium.wrappers.TransformAction(
        env, lambda action: 10.0 * action, spaces.Box(-1.0, 1.0, env.action_space.shape)
    )
    agent = make_recurrent(bounded)
    agent.learn(30)
    assert agent.num_timesteps == 30
    assert np.isfinite(agent.predict(np.zeros(2, np.float32))[0]).all()


def test_infinite_and_integer_observations_are_no_fault():
    for space in (spaces.Box(-np.inf, np.inf, (2,)), spaces.Box(0, 255, (2,), np.uint8)):
        make_recurrent(Task(observation=space)).learn(10)


def test_a_recipe_learns_with_actions_of_another_size():
    env = Task(action=spaces.Box(-1.0, 1.0, (3,)))
    for name in ("td3", "td3-lstm"):
        make_recipe(env, name).learn(12)
