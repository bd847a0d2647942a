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

IDS = ("rl:LunarHDA-v0", "rl:LunarHDA-Map-v0")
_MANY, _FEW, _PROCESSES = 64, 8, 4  # environments of a native vector, and of Gymnasium's own
_STEPS = 1024  # of one round, all environments together
SINGLE, NATIVE = "one", f"native, {_MANY}"


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
    return [rate for name in IDS for rate in _measure(name, rounds)]


def _vectors() -> dict[str, tuple[int, dict[str, Any]]]:
    """How many environments, and arguments of `make_vec`, of every way to fly many."""
    cores = os.cpu_count() or 1
    same = {"autoreset_mode": AutoresetMode.SAME_STEP}
    fresh = {"vectorization_mode": "async", "vector_kwargs": {"context": "spawn", **same}}
    ways: dict[str, tuple[int, dict[str, Any]]] = {
        f"sync, {_FEW}": (_FEW, {"vectorization_mode": "sync", "vector_kwargs": same}),
        f"async, {_PROCESSES} processes": (_PROCESSES, fresh),
        NATIVE: (_MANY, {}),
    }
    if cores > 1:
        ways[f"{NATIVE}, {cores} threads"] = (_MANY, {"threads": cores})
    return ways


def _measure(name: str, rounds: int) -> list[StepRate]:
    times: dict[str, list[tuple[float, float]]] = {}
    with ExitStack() as opened:
        single = gymnasium.make(name)
        opened.callback(single.close)
        ways = {SINGLE: _fly_single(single)}
        for way, (count, options) in _vectors().items():
            vector = gymnasium.make_vec(name, count, **options)
            opened.callback(vector.close)
            ways[way] = _fly_vector(vector)
        for way in list(ways) * (rounds + 1):
            started = time.perf_counter(), time.process_time()
            ways[way]()
            spent = time.perf_counter() - started[0], time.process_time() - started[1]
            times.setdefault(way, []).append(spent)
    return [_rate(name, way, times) for way in times]


def _rate(name: str, way: str, times: Mapping[str, list[tuple[float, float]]]) -> StepRate:
    wall, processor = np.median(times[way][1:], axis=0) / _STEPS
    elsewhere = way.startswith("async")
    return StepRate(name.removeprefix("rl:"), way, float(wall), np.nan if elsewhere else float(processor))


def _fly_single(env: gymnasium.Env[Any, Any]) -> Callable[[], None]:
    rng = np.random.default_rng(0)
    env.reset(seed=0)

    def fly() -> None:
        for action in rng.uniform(-1.0, 1.0, (_STEPS, 5)).astype(np.float32):
            _, _, terminated, truncated, _ = env.step(action)
            if terminated or truncated:
                env.reset()

    return fly


def _fly_vector(vector: gymnasium.vector.VectorEnv[Any, Any, Any]) -> Callable[[], None]:
    rng, count = np.random.default_rng(0), vector.num_envs
    vector.reset(seed=0)

    def fly() -> None:
        for action in rng.uniform(-1.0, 1.0, (_STEPS // count, count, 5)).astype(np.float32):
            vector.step(action)

    return fly
