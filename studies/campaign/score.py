"""What the episodes of one policy gave: every ratio and mean with its intervals, from a stream of rows.

Every study scores through here. Nothing is kept for each episode: ratios are counts for each tile, means are
moments (`studies.statistics.moments`). Rows must come in the order of their episodes to give equal last bits.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from hda.flight.episode_row import MEASURES, RATIOS, EpisodeRow
from studies.columns import Column, Output, percent_interval
from studies.statistics.moments import TileMoments, collect_moments, mean_intervals
from studies.statistics.paired import paired_ratio_interval
from studies.statistics.ratios import (
    NO_INTERVAL,
    Interval,
    clustered_count_interval,
    scaled,
    wilson_interval,
)
from studies.statistics.reliability import exact_lower_bound

AT_LEAST_CONFIDENCE = 0.95
"""Confidence of "success in at least x %", as requirements of guidance are verified."""


@dataclass(frozen=True, kw_only=True)
class Score:
    """Every figure of a policy over some episodes.

    Attributes:
        episodes: number of episodes.
        safe_site: ratio of safe touchdown cells with Wilson's interval.
        safe_site_by_tile: the same ratio with the interval clustered by tile.
        success: ratio of successes with Wilson's interval.
        success_by_tile: the same ratio with the interval clustered by tile.
        success_at_least: exact one-sided lower bound of `success` at AT_LEAST_CONFIDENCE, were all episodes
            independent.
        success_at_least_by_tile: the same bound of the share of tiles on which every episode succeeds. Tiles
            are independent, and an episode succeeds at least as often as all those of its tile do.
        means: measure -> mean with Student's interval.
        means_by_tile: measure -> the same mean with the interval clustered by tile.
        fallbacks: decisions in which the policy's own law gave no answer.
    """

    episodes: int
    safe_site: Interval
    safe_site_by_tile: Interval
    success: Interval
    success_by_tile: Interval
    success_at_least: float
    success_at_least_by_tile: float
    means: dict[str, Interval]
    means_by_tile: dict[str, Interval]
    fallbacks: int

    @property
    def propellant(self) -> Interval:
        """[%] mean with Student's interval."""
        return self.means["propellant_percent"]


@dataclass
class RunningScore:
    """Score of one policy so far.

    Attributes:
        episodes: episodes so far.
        successes: safe_site, success -> tile -> number of them.
        flown: tile -> episodes.
        fallbacks: decisions in which the policy's own law gave no answer.
        means: moments of MEASURES.
    """

    episodes: int = 0
    successes: dict[str, dict[int, int]] = field(default_factory=lambda: {name: {} for name in RATIOS})
    flown: dict[int, int] = field(default_factory=dict)
    fallbacks: int = 0
    means: TileMoments = field(default_factory=lambda: TileMoments(len(MEASURES)))

    def add(self, row: EpisodeRow) -> None:
        """Add an episode."""
        self.episodes += 1
        self.flown[row.tile] = self.flown.get(row.tile, 0) + 1
        self.fallbacks += row.fallbacks
        self.means.add(row.tile, measured(row))
        for name in RATIOS:
            of_tile = self.successes[name]
            of_tile[row.tile] = of_tile.get(row.tile, 0) + getattr(row, name)

    def count_successes(self, name: str) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Successes and episodes of each tile, tiles ascending."""
        tiles = sorted(self.flown)
        return np.array([self.successes[name][t] for t in tiles]), np.array([self.flown[t] for t in tiles])

    def collect(self) -> Score:
        """The score of what was added.

        Raises:
            ValueError: no episode was added.
        """
        plain, by_tile = {}, {}
        for name in RATIOS:
            successes, flown = self.count_successes(name)
            plain[name] = wilson_interval(int(successes.sum()), self.episodes)
            by_tile[name] = clustered_count_interval(successes, flown)
        moments = self.means.collect()
        means = {name: mean_intervals(moments, k) for k, name in enumerate(MEASURES)}
        successes, flown = self.count_successes("success")
        faultless = int(np.count_nonzero(successes == flown))
        return Score(
            episodes=self.episodes,
            safe_site=plain["safe_site"],
            safe_site_by_tile=by_tile["safe_site"],
            success=plain["success"],
            success_by_tile=by_tile["success"],
            success_at_least=exact_lower_bound(int(successes.sum()), self.episodes, AT_LEAST_CONFIDENCE),
            success_at_least_by_tile=exact_lower_bound(faultless, flown.size, AT_LEAST_CONFIDENCE),
            means={name: student for name, (student, _) in means.items()},
            means_by_tile={name: tiled for name, (_, tiled) in means.items()},
            fallbacks=self.fallbacks,
        )


def measured(row: EpisodeRow) -> NDArray[np.float64]:
    """MEASURES of a row."""
    return np.array([getattr(row, name) for name in MEASURES], dtype=np.float64)


def score_rows(rows: Iterable[EpisodeRow]) -> Score:
    """Score the rows of one policy, episodes ascending.

    Raises:
        ValueError: there is no row.
    """
    running = RunningScore()
    for row in rows:
        running.add(row)
    return running.collect()


def success_drop(reference: Sequence[EpisodeRow], rows: Sequence[EpisodeRow]) -> Interval:
    """Fall of the ratio of successes against the same episodes in another setting: paired, 95 % interval.

    Raises:
        ValueError: there is no row, or not as many of both.
    """
    return paired_ratio_interval([row.success for row in reference], [row.success for row in rows])


def propellant_rise(
    reference: Sequence[EpisodeRow], rows: Sequence[EpisodeRow], confidence: float = 0.95
) -> Interval:
    """[%] by how much more of it is burnt, over the episodes that succeed in both, clustered by tile.

    A flight that fails early burns little, so failed ones tell nothing. nan where none succeeds in both.
    """
    pairs = [(one, row) for one, row in zip(reference, rows, strict=True) if one.success and row.success]
    if not pairs:
        return NO_INTERVAL
    more = [row.propellant_percent - one.propellant_percent for one, row in pairs]
    return mean_intervals(collect_moments(more, [row.tile for _, row in pairs]), 0, confidence)[1]


def _ratio_column(name: str, heading: str) -> Column[Score]:
    plain: Column[Score] = percent_interval(
        f"{name}_percent", heading, lambda score: getattr(score, name), stem=name
    )
    return replace(plain, by_tile=lambda score: scaled(getattr(score, f"{name}_by_tile"), 100.0))


def _mean_column(name: str, heading: str, label: str, unit: str, digits: int) -> Column[Score]:
    return Column(
        name,
        heading,
        lambda score: score.means[name],
        digits=digits,
        unit=unit,
        label=label,
        interval=True,
        by_tile=lambda score: score.means_by_tile[name],
        brief=True,
        outputs=Output.ALL & ~Output.DOCUMENT if name == "reward" else Output.ALL,
    )


RATIO_COLUMNS = (_ratio_column("safe_site", "safe site"), _ratio_column("success", "success"))
"""The ratios, in percent."""

AT_LEAST_COLUMN: Column[Score] = Column(
    "success_at_least",
    "at least",
    lambda score: 100.0 * score.success_at_least,
    digits=2,
    unit="%",
    label=f"success at least (at {AT_LEAST_CONFIDENCE:.0%})",
    late=True,
)

AT_LEAST_BY_TILE_COLUMN: Column[Score] = Column(
    "success_at_least_by_tile",
    "by tile",
    lambda score: 100.0 * score.success_at_least_by_tile,
    digits=2,
    unit="%",
    label=f"success at least, over independent tiles (at {AT_LEAST_CONFIDENCE:.0%})",
    late=True,
    outputs=Output.ALL & ~Output.REPORT,
)

MEASURE_COLUMNS = (
    _mean_column("miss_distance_m", "miss", "distance to the final target", "m", 3),
    _mean_column("touchdown_speed_mps", "speed", "final speed", "m/s", 2),
    _mean_column("propellant_percent", "propellant", "propellant burnt", "%", 2),
    _mean_column("minimum_slant_angle_deg", "slant", "minimum slant angle", "deg", 2),
    _mean_column("maximum_thrust_n", "thrust", "maximum thrust", "N", 0),
    _mean_column("reward", "reward", "reward", "", 2),
)
"""The means, in the order of MEASURES."""

DROP_COLUMN: Column[Interval] = replace(
    percent_interval("success_drop_points", "drop", lambda drop: drop, stem="drop"), unit="points"
)
"""What `success_drop` gives, in points."""

PROPELLANT_COLUMN = next(column for column in MEASURE_COLUMNS if column.key == "propellant_percent")

FALLBACKS_COLUMN: Column[Score] = Column("fallbacks", "fallbacks", lambda score: score.fallbacks)


def label_measure(measure: str) -> str:
    """Axis of a measure: its name in full, with the unit."""
    return next(column.full_title for column in MEASURE_COLUMNS if column.key == measure)
