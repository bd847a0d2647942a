"""Steps a second of the Gymnasium environments, alone and many together, by every way that `make_vec` knows.

The ways take turns, round by round, so that what else the machine does meets all alike. Each begins the next
episode in the step that ends one, so that every step counted is a decision flown.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from guidance.validation import finite_number
from studies.columns import Column

BATCHED = ("rl:LunarHDA-v0", "rl:LunarHDA-Map-v0")
"""Ids whose vector of their own flies all episodes in one batch."""
STEPPED = ("rl:LunarHDA-Site-v0", "rl:LunarHDA-Belief-v0")
"""Ids whose vector of their own steps single environments in turn."""
_MANY, _FEW, _PROCESSES = 64, 8, 4  # environments of a native vector, and of the others
_STEPS: dict[str, int] = {**dict.fromkeys(BATCHED, 1024), **dict.fromkeys(STEPPED, 128)}
"""Of one round, all environments together; fewer where each plans or believes."""
SINGLE, NATIVE, IN_TURN = "one", f"native, {_MANY}", f"stepped, {_FEW}"


@dataclass(frozen=True)
class StepRate:
    """Steps of one way to fly an environment, in the median of the rounds.

    Attributes:
        environment: its id.
        way: how, and how many at a time.
        wall_seconds: [s] a step by the clock.
        processor_seconds: [s] processor time of a step in this process; nan where others work too.
    """

    environment: str
    way: str
    wall_seconds: float
    processor_seconds: float


COLUMNS: tuple[Column[StepRate], ...] = (
    Column("environment", "environment", lambda rate: rate.environment, words=True),
    Column("way", "way", lambda rate: rate.way, words=True),
    Column("steps_per_second", "steps", lambda rate: 1.0 / rate.wall_seconds, digits=0, unit="/s"),
    Column(
        "processor_us", "processor", lambda rate: 1e6 * rate.processor_seconds, digits=0, unit="us a step"
    ),
)
"""The rates: the bench's file and console read this list."""


def measure_environments(rounds: int = 5) -> list[StepRate]:
    """Measure every way on `paper`, under actions drawn at random.

    Args:
        rounds: that each way flies, after one that warms up.

    Raises:
        ValueError: `rounds` is less than one.
    """
    finite_number("rounds", rounds, at_least=1)
    return [rate for name in (*BATCHED, *STEPPED) for rate in _measure(name, rounds)]


def _vectors(name: str) -> dict[str, tuple[int, dict[str, Any]]]:
    """How many environments, and arguments of `make_vec`, of every way to fly many of an id."""
    cores = os.cpu_count() or 1
    same = {"autoreset_mode": AutoresetMode.SAME_STEP}
    fresh = {"vectorization_mode": "async", "vector_kwargs": {"context": "spawn", **same}}
    ways: dict[str, tuple[int, dict[str, Any]]] = {
        f"sync, {_FEW}": (_FEW, {"vectorization_mode": "sync", "vector_kwargs": same}),
        f"async, {_PROCESSES} processes": (_PROCESSES, fresh),
    }
    if name in STEPPED:
        return ways | {IN_TURN: (_FEW, {})}
    ways[NATIVE] = _MANY, {}
    if cores > 1:
        ways[f"{NATIVE}, {cores} threads"] = (_MANY, {"threads": cores})
    return ways


def _measure(name: str, rounds: int) -> list[StepRate]:
    times: dict[str, list[tuple[float, float]]] = {}
    with ExitStack() as opened:
        single = gymnasium.make(name)
        opened.callback(single.close)
        ways = {SINGLE: _fly_single(single, _STEPS[name])}
        for way, (count, options) in _vectors(name).items():
            vector = gymnasium.make_vec(name, count, **options)
            opened.callback(vector.close)
            ways[way] = _fly_vector(vector, _STEPS[name])
        for way in list(ways) * (rounds + 1):
            started = time.perf_counter(), time.process_time()
            ways[way]()
            spent = time.perf_counter() - started[0], time.process_time() - started[1]
            times.setdefault(way, []).append(spent)
    return [_rate(name, way, times) for way in times]


def _rate(name: str, way: str, times: Mapping[str, list[tuple[float, float]]]) -> StepRate:
    wall, processor = np.median(times[way][1:], axis=0) / _STEPS[name]
    elsewhere = way.startswith("async")
    return StepRate(name.removeprefix("rl:"), way, float(wall), np.nan if elsewhere else float(processor))


def _fly_single(env: gymnasium.Env[Any, Any], steps: int) -> Callable[[], None]:
    rng, size = np.random.default_rng(0), env.action_space.shape or ()
    env.reset(seed=0)

    def fly() -> None:
        for action in rng.uniform(-1.0, 1.0, (steps, *size)).astype(np.float32):
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    return fly


def _fly_vector(vector: gymnasium.vector.VectorEnv[Any, Any, Any], steps: int) -> Callable[[], None]:
    rng, shape = np.random.default_rng(0), vector.action_space.shape or ()
    vector.reset(seed=0)

    def fly() -> None:
        for action in rng.uniform(-1.0, 1.0, (steps // vector.num_envs, *shape)).astype(np.float32):
            vector.step(action)

    return fly
