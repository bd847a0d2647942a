"""What a policy of a user's own owes, checked by flying it: the promises that make a comparison fair."""

from __future__ import annotations

import copy
import traceback
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from hda.flight.episode import fly, fly_legs, inform_pilot
from hda.flight.episode_row import summarize_episode
from hda.policies.entry import AnyPolicy
from hda.policy import Decision
from hda.task.observation import Observation
from hda.task.presets import Preset
from hda.task.scenario import Scenario, sample_scenario

_CHECK_SEED = 4_000_000_000  # no study is flown at it


class ContractError(ValueError):
    """A policy breaks the contract; the message says which promise, and where."""


def check_contract(make: Callable[[], AnyPolicy], preset: Preset, episodes: int = 2) -> None:
    """Fly a policy over a few episodes of the tuning tiles and check what it owes.

    A decision is a function of the observation and the memory: asking twice, or asking a new object, gives
    the same; the observation is left as it was; and an episode ends the same after another was flown.
    Random draws from the policy's own stream are fine: the stream is part of the memory.

    Args:
        make: gives a new policy.
        preset: the setting.
        episodes: how many are flown.

    Raises:
        ContractError: a promise is broken, or the policy raised something.
    """
    name = make().name
    scenarios = [sample_scenario(preset, _CHECK_SEED, k, "tuning") for k in range(episodes)]
    for scenario in scenarios:
        _check_decisions(name, make, scenario)
    policy = make()
    rows = [summarize_episode(fly(policy, scenario)) for scenario in (*scenarios, scenarios[0])]
    if rows[0] != rows[-1]:
        raise ContractError(f"policy {name!r} flies an episode otherwise after another: it keeps state")


def _check_decisions(name: str, make: Callable[[], AnyPolicy], scenario: Scenario) -> None:
    where = f"policy {name!r}, look 0 of a trial episode"

    def decide(observation: Observation, memory: Any) -> tuple[Decision, Any]:
        nonlocal where
        where = f"policy {name!r}, look {observation.index} of a trial episode"
        before = copy.deepcopy(observation)
        answers = [
            _checked(asked.decide(observation, copy.deepcopy(memory)), where)
            for asked in (pilot, pilot, other)
        ]
        if not equal_values(observation, before):
            raise ContractError(f"{where}: it changed the observation")
        for answer, cause in zip(answers[1:], ("asked again", "asked of a new object"), strict=True):
            if not equal_values(answer[0], answers[0][0]):
                raise ContractError(f"{where}: {cause}, it decides otherwise: it keeps state on itself")
        return answers[0]

    try:
        pilot, other = (inform_pilot(make(), scenario) for _ in range(2))
        memory: Any = pilot.begin(scenario.view, scenario.streams.policy())
        for _ in fly_legs(scenario, decide, memory):
            pass
    except ContractError:
        raise
    except Exception as error:
        last = traceback.extract_tb(error.__traceback__)[-1]
        raise ContractError(
            f"{where}: {type(error).__name__}: {error} ({last.filename}, line {last.lineno})"
        ) from error


def _checked(answer: object, where: str) -> tuple[Decision, Any]:
    if not isinstance(answer, tuple) or len(answer) != 2 or not isinstance(answer[0], Decision):
        raise ContractError(f"{where}: decide must return (Decision, memory), got {type(answer).__name__}")
    return answer[0], answer[1]


def equal_values(first: Decision | Observation | Any, second: Any) -> bool:
    """Whether two values made of dataclasses, tuples, arrays and plain numbers hold the same bits."""
    if type(first) is not type(second):
        return False
    if isinstance(first, np.ndarray):
        return (
            first.shape == second.shape
            and first.dtype == second.dtype
            and first.tobytes() == second.tobytes()
        )
    if is_dataclass(first) and not isinstance(first, type):
        return all(equal_values(getattr(first, f.name), getattr(second, f.name)) for f in fields(first))
    if isinstance(first, tuple | list):
        return len(first) == len(second) and all(map(equal_values, first, second))
    return bool(first == second)
