"""How well a policy flies a split: the mean measures that training and the choice of weights look at."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from hda.flight.episode import fly
from hda.flight.episode_row import summarize_episode
from hda.policy import Policy
from hda.task.presets import Preset
from hda.task.scenario import sample_scenario


@dataclass(frozen=True)
class Score:
    """Means over episodes.

    Attributes:
        episodes: how many were flown.
        safe_site_percent: landed on safe ground, the paper's ratio.
        success_percent: safe ground, soft, propellant left.
        reward: undiscounted sum.
        touchdown_speed_mps: at the plane.
        miss_distance_m: to the last target.
        propellant_percent: of what was aboard.
        decisions: looks in an episode.
    """

    episodes: int
    safe_site_percent: float
    success_percent: float
    reward: float
    touchdown_speed_mps: float
    miss_distance_m: float
    propellant_percent: float
    decisions: float

    @property
    def rank(self) -> tuple[float, float]:
        """What a choice between weights goes by: successes first, then the reward."""
        return self.success_percent, self.reward

    def as_dict(self) -> dict[str, float]:
        """Rounded values by name."""
        return {name: round(float(value), 5) for name, value in asdict(self).items()}


def score_policy(policy: Policy[Any], preset: Preset, split: str, study_seed: int, episodes: int) -> Score:
    """Fly episodes 0 to episodes - 1 of a study.

    Args:
        policy: what flies.
        preset: the setting.
        split: tile split.
        study_seed: seed of the study.
        episodes: how many.
    """
    flights = (
        summarize_episode(fly(policy, sample_scenario(preset, study_seed, episode, split)))
        for episode in range(episodes)
    )
    rows = [
        (
            100.0 * row.safe_site,
            100.0 * row.success,
            row.reward,
            row.touchdown_speed_mps,
            row.miss_distance_m,
            row.propellant_percent,
            row.decisions,
        )
        for row in flights
    ]
    return Score(episodes, *(float(mean) for mean in np.mean(rows, axis=0)))
