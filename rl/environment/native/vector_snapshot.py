"""Flights of a vector environment as numbers: kept, and taken up again to the same bit.

Ground, starts, noise and thrust errors are drawn anew from the study and the number of each episode, so only
what the flights have become is kept.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from rl.environment.native.landing_vector import LandingVectorEnv


def take_snapshot(environments: LandingVectorEnv[Any]) -> dict[str, NDArray[Any]]:
    """What a vector's flights have become, each array with one row for each environment.

    Its episodes have begun, none waits for a reset, and none has other dispersions than the vector's own.

    Raises:
        ValueError: no episode has begun, or one is over.
    """
    batch = environments.batch
    if any(scenario is None for scenario in batch.scenarios) or environments.ended.any():
        raise ValueError("environments must have an episode under way in every row: call reset()")
    numbers = [scenario.streams.episode for scenario in batch.scenarios if scenario is not None]
    kept = batch.kept() | {name: getattr(environments, name).copy() for name in environments.KEPT}
    return {**kept, "episode": np.array(numbers), "next_episode": environments.next_episode.copy()}


def restore_snapshot(
    environments: LandingVectorEnv[Any], study_seed: int, kept: dict[str, NDArray[Any]]
) -> Any:
    """Take the flights up again: what is seen in each, as `reset` gives it.

    Args:
        environments: as many as were kept, with the same options.
        study_seed: that they flew.
        kept: by `take_snapshot`.

    Raises:
        ValueError: they were more environments, or fewer.
    """
    batch, count = environments.batch, environments.num_envs
    if len(kept["episode"]) != count:
        raise ValueError(f"environments must be the {len(kept['episode'])} that were kept, got {count}")
    environments.reset(seed=study_seed)
    scenarios = [environments.source.scenario(study_seed, int(number), {}) for number in kept["episode"]]
    for place, scenario in enumerate(scenarios):
        batch.begin(place, scenario)
    batch.take_up(kept)
    for name in environments.KEPT:
        getattr(environments, name)[:] = kept[name]
    environments.next_episode = kept["next_episode"].astype(environments.next_episode.dtype)
    return environments.look_again()
