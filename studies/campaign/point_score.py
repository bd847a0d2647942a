"""The score of one policy at one point of a sweep: ratios and propellant, each with its intervals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from studies.campaign.rows import EpisodeRow
from studies.statistics.ratios import Interval, bootstrap_mean, clustered_interval, wilson_interval

RATIO_ENDS = ("percent", "low", "high", "tile_low", "tile_high")
"""Columns of a ratio: itself, Wilson's interval, the interval clustered by tile."""


@dataclass(frozen=True)
class PointScore:
    """What a policy did at one point.

    Attributes:
        episodes: number of episodes.
        safe_site: ratio of safe touchdown cells with Wilson's interval.
        safe_site_by_tile: the same ratio with the interval clustered by tile.
        success: ratio of successes with Wilson's interval.
        success_by_tile: the same ratio with the interval clustered by tile.
        propellant: [%] mean with its bootstrap interval.
    """

    episodes: int
    safe_site: Interval
    safe_site_by_tile: Interval
    success: Interval
    success_by_tile: Interval
    propellant: Interval

    def cells(self) -> list[str]:
        """For a CSV file: RATIO_ENDS of safe_site and of success, then propellant, low, high; in percent."""
        pairs = ((self.safe_site, self.safe_site_by_tile), (self.success, self.success_by_tile))
        values = []
        for plain, tiled in pairs:
            ends = (plain.estimate, plain.low, plain.high, tiled.low, tiled.high)
            values += [100.0 * value for value in ends]
        values += [self.propellant.estimate, self.propellant.low, self.propellant.high]
        return [f"{value:.9g}" for value in values]


SCORE_COLUMNS = (
    *(f"{ratio}_{end}" for ratio in ("safe_site", "success") for end in RATIO_ENDS),
    *(f"propellant_percent{end}" for end in ("", "_low", "_high")),
)
"""Names of `PointScore.cells`."""


def score_rows(rows: Sequence[EpisodeRow], study_seed: int) -> PointScore:
    """Score the rows of one policy; the seed draws the bootstrap."""
    tiles = np.array([row.tile for row in rows])
    safe = np.array([row.safe_site for row in rows])
    success = np.array([row.success for row in rows])
    burnt = np.array([row.propellant_percent for row in rows])
    return PointScore(
        episodes=len(rows),
        safe_site=wilson_interval(int(safe.sum()), safe.size),
        safe_site_by_tile=clustered_interval(safe, tiles),
        success=wilson_interval(int(success.sum()), success.size),
        success_by_tile=clustered_interval(success, tiles),
        propellant=bootstrap_mean(burnt, np.random.default_rng([study_seed, 0])),
    )
