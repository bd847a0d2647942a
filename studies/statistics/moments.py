"""Means over a stream of episodes: count, mean and squares for each tile, and nothing else is kept.

Welford's update (Technometrics 4, 1962) for each tile; tiles are joined as Chan, Golub and LeVeque do (The
American Statistician 37, 1983). Episodes must come in the same order to give the same last bits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from guidance.validation import finite_number
from studies.statistics.ratios import Interval


@dataclass(frozen=True, eq=False)
class Moments:
    """Of some measures over episodes, tile by tile.

    Attributes:
        count: episodes of each tile, shape (tiles,).
        mean: mean of each measure, shape (tiles, measures).
        square: sum of squared deviations from that mean, shape (tiles, measures).
    """

    count: NDArray[np.int64]
    mean: NDArray[np.float64]
    square: NDArray[np.float64]


class TileMoments:
    """Collects moments, one episode at a time; its size depends on the number of tiles only."""

    def __init__(self, measures: int) -> None:
        """Begin with no episode, for so many measures."""
        self._measures = measures
        self._tiles: dict[int, tuple[list[int], NDArray[np.float64]]] = {}

    def add(self, tile: int, values: NDArray[np.float64]) -> None:
        """Add an episode over a tile; `values` has shape (measures,)."""
        if tile not in self._tiles:
            self._tiles[tile] = [0], np.zeros((2, self._measures))
        count, (mean, square) = self._tiles[tile]
        count[0] += 1
        delta = values - mean
        mean += delta / count[0]
        square += delta * (values - mean)

    def collect(self) -> Moments:
        """What was added so far, tiles ascending."""
        tiles = [self._tiles[number] for number in sorted(self._tiles)]
        return Moments(
            count=np.array([count[0] for count, _ in tiles]),
            mean=np.array([sums[0] for _, sums in tiles]),
            square=np.array([sums[1] for _, sums in tiles]),
        )


def collect_moments(values: ArrayLike, tile: ArrayLike) -> Moments:
    """Moments of one measure that is held whole.

    Args:
        values: shape (n,).
        tile: shape (n,), number of the tile of each episode.
    """
    moments = TileMoments(1)
    for value, number in zip(np.asarray(values, dtype=np.float64), np.asarray(tile), strict=True):
        moments.add(int(number), np.array([value]))
    return moments.collect()


def mean_intervals(moments: Moments, measure: int, confidence: float = 0.95) -> tuple[Interval, Interval]:
    """Intervals of the mean of a measure: for independent episodes, and clustered by tile.

    The first is Student's. The second takes the variance of the mean from the totals of the C tiles by
    linearisation, C/(C - 1) sum_c n_c^2 (mean_c - mean)^2 / n^2, at least that of independent episodes (as
    `clustered_interval` of ratios does), with Student's quantile at C - 1 degrees of freedom. One episode
    says nothing of others, nor one tile: the interval is then the whole line.

    Args:
        moments: at least one episode.
        measure: index of the measure.
        confidence: in (0, 0.9999].

    Raises:
        ValueError: `confidence` is out of range.
    """
    from scipy.special import stdtrit

    level = finite_number("confidence", confidence, above=0.0, at_most=0.9999)
    count, means = moments.count, moments.mean[:, measure]
    episodes, tiles = int(count.sum()), count.size
    mean = float(count @ means) / episodes
    between = count * (means - mean)
    square = float(moments.square[:, measure].sum() + between @ (means - mean))

    def student_interval(variance: float, freedom: int) -> Interval:
        if freedom < 1:
            return Interval(mean, -math.inf, math.inf)
        half = float(stdtrit(freedom, 0.5 + 0.5 * level)) * math.sqrt(variance)
        return Interval(mean, mean - half, mean + half)

    independent = square / max(episodes - 1, 1) / episodes
    clustered = tiles / max(tiles - 1, 1) * float(between @ between) / episodes**2
    by_tile = student_interval(max(independent, clustered), tiles - 1)
    return student_interval(independent, episodes - 1), by_tile


def tiled_mean(values: ArrayLike, tile: ArrayLike) -> Interval:
    """Mean over episodes, clustered by tile; where all are equal nothing shows how tiles differ: no ends.

    Args:
        values: shape (n,), at least one.
        tile: shape (n,), number of the tile of each episode.
    """
    held = np.asarray(values, dtype=np.float64)
    if np.ptp(held) == 0.0:
        return Interval(float(held[0]), math.nan, math.nan)
    return mean_intervals(collect_moments(held, tile), 0)[1]
