"""Error bars and tests for ratios and means over episodes.

Episodes on one tile of terrain resemble one another, so a ratio over few tiles is less certain than its
number of episodes says: beside each Wilson interval stands one that is clustered by tile.
"""

from __future__ import annotations

import math
import operator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from guidance.validation import finite_number


@dataclass(frozen=True)
class Interval:
    """An estimate with its two-sided confidence interval.

    Attributes:
        estimate: the ratio or mean of the sample.
        low: lower end.
        high: upper end.
    """

    estimate: float
    low: float
    high: float


NO_INTERVAL = Interval(math.nan, math.nan, math.nan)
"""Where there is nothing to estimate: an empty cell in tables."""


def scaled(interval: Interval, factor: float) -> Interval:
    """The interval in another unit, such as percent."""
    return Interval(factor * interval.estimate, factor * interval.low, factor * interval.high)


def wilson_interval(successes: int, episodes: int, confidence: float = 0.95) -> Interval:
    """Interval of a success ratio over independent episodes (Wilson 1927).

    Args:
        successes: from 0 to `episodes`.
        episodes: at least 1.
        confidence: in (0, 0.9999].

    Raises:
        ValueError: an argument is out of range.
    """
    from scipy.stats import binomtest

    trials = _whole_number("episodes", episodes, at_least=1)
    hits = _whole_number("successes", successes, at_least=0, at_most=trials)
    level = _confidence(confidence)
    ends = binomtest(hits, trials).proportion_ci(confidence_level=level, method="wilson")
    return Interval(hits / trials, float(ends.low), float(ends.high))


def clustered_interval(success: ArrayLike, tile: ArrayLike, confidence: float = 0.95) -> Interval:
    """Interval of a success ratio over episodes that come in clusters, one per tile of terrain.

    Wilson's interval at an effective number of episodes n_eff = n / D (z/t)^2 (Korn and Graubard, Survey
    Methodology 24, 1998). D is the design effect: the variance of the ratio from the totals of the C tiles
    by linearisation, C/(C - 1) sum_c (successes_c - ratio episodes_c)^2 / n^2, over ratio (1 - ratio) / n,
    that of independent episodes. It is taken as at least 1, so that luck never makes the interval narrower
    than Wilson's. z and t are the normal quantile and Student's at C - 1 degrees of freedom: few tiles tell
    their variance badly.

    Where all episodes end alike nothing shows how tiles differ, and D is 1: the interval may then be too
    narrow. One tile says nothing of others: the interval is [0, 1]. Very unequal numbers of episodes per tile
    cost some points of coverage (92 % in place of 95 % at 18 tiles of geometrically distributed size).

    Args:
        success: shape (n,), booleans or zeros and ones.
        tile: shape (n,), a label for each episode; tiles may have unequal numbers of episodes.
        confidence: in (0, 0.9999].

    Raises:
        ValueError: an argument is empty, of the wrong shape, or holds something else.
    """
    hits = _outcomes("success", success)
    labels = np.asarray(tile)
    if labels.shape != hits.shape:
        raise ValueError(f"tile must have the shape of success, {hits.shape}, got {labels.shape}")
    _, member = np.unique(labels, return_inverse=True)
    return clustered_count_interval(np.bincount(member, weights=hits), np.bincount(member), confidence)


def clustered_count_interval(successes: ArrayLike, episodes: ArrayLike, confidence: float = 0.95) -> Interval:
    """The interval of `clustered_interval` from the counts of each tile.

    Args:
        successes: shape (tiles,).
        episodes: shape (tiles,), each at least 1.
        confidence: in (0, 0.9999].

    Raises:
        ValueError: `confidence` is out of range.
    """
    from scipy.special import ndtri, stdtrit

    level = _confidence(confidence)
    hits, flown = np.asarray(successes, dtype=np.float64), np.asarray(episodes)
    clusters, total = flown.size, int(flown.sum())
    ratio = float(hits.sum()) / total
    if clusters == 1:
        return Interval(ratio, 0.0, 1.0)
    residual = hits - ratio * flown
    variance = clusters / (clusters - 1) * float(residual @ residual) / total**2
    independent = ratio * (1.0 - ratio) / total
    design_effect = max(1.0, variance / independent) if independent > 0.0 else 1.0
    normal = float(ndtri(0.5 + 0.5 * level))
    student = float(stdtrit(clusters - 1, 0.5 + 0.5 * level))
    return _score_interval(ratio, total / design_effect * (normal / student) ** 2, normal)


def mcnemar_p_value(first: ArrayLike, second: ArrayLike) -> float:
    """Exact two-sided test that two policies succeed equally often on the same episodes (McNemar 1947).

    Args:
        first: shape (n,), success of one policy, booleans or zeros and ones.
        second: the same of the other, episode by episode.

    Returns:
        The p-value of the binomial test on the episodes where they differ; 1 where they never do.

    Raises:
        ValueError: an argument is empty or holds something else, or the shapes differ.
    """
    return mcnemar_count_p_value(count_pairs(first, second))


@dataclass(frozen=True)
class PairCounts:
    """How the same episodes ended for two policies.

    Attributes:
        both: episodes in which both succeed.
        only_first: the first alone.
        only_second: the second alone.
        neither: none.
    """

    both: int
    only_first: int
    only_second: int
    neither: int

    @property
    def episodes(self) -> int:
        """All of them."""
        return self.both + self.only_first + self.only_second + self.neither


def count_pairs(first: ArrayLike, second: ArrayLike) -> PairCounts:
    """Count the pairs of two policies that flew the same episodes.

    Args:
        first: shape (n,), success of one policy, booleans or zeros and ones.
        second: the same of the other, episode by episode.

    Raises:
        ValueError: an argument is empty or holds something else, or the shapes differ.
    """
    one, other = _outcomes("first", first), _outcomes("second", second)
    if one.shape != other.shape:
        raise ValueError(f"second must have the shape of first, {one.shape}, got {other.shape}")
    kinds = np.bincount(2 * one + other, minlength=4)  # neither, only second, only first, both
    return PairCounts(*(int(kinds[k]) for k in (3, 2, 1, 0)))


def mcnemar_count_p_value(pairs: PairCounts) -> float:
    """The test of `mcnemar_p_value`, from counts."""
    from scipy.stats import binomtest

    discordant = pairs.only_first + pairs.only_second
    return float(binomtest(pairs.only_first, discordant).pvalue) if discordant else 1.0


def least_passing(episodes: int, reference_ratio: float, false_alarm: float = 1e-4) -> int:
    """Least number of successes that a one-sided regression gate lets pass.

    The gate fails a policy whose successes fall below it; a policy as good as the reference, over independent
    episodes, fails with a probability of at most `false_alarm`, and one more success would exceed that.

    Args:
        episodes: at least 1.
        reference_ratio: success ratio of the reference, in [0, 1].
        false_alarm: in (0, 0.5].

    Raises:
        ValueError: an argument is out of range.
    """
    from scipy.stats import binom

    trials = _whole_number("episodes", episodes, at_least=1)
    ratio = finite_number("reference_ratio", reference_ratio, at_least=0.0, at_most=1.0)
    alarm = finite_number("false_alarm", false_alarm, above=0.0, at_most=0.5)
    fails = np.asarray(binom.cdf(np.arange(trials), trials, ratio)) <= alarm  # at k successes or fewer
    return int(np.count_nonzero(fails))


def power(episodes: int, reference_ratio: float, drop: float, false_alarm: float = 1e-4) -> float:
    """Probability that the gate of `least_passing` fails a policy whose success ratio has dropped by `drop`.

    Args:
        episodes: at least 1.
        reference_ratio: success ratio of the reference, in [0, 1].
        drop: loss of success ratio, in [0, reference_ratio].
        false_alarm: in (0, 0.5].

    Raises:
        ValueError: an argument is out of range.
    """
    from scipy.stats import binom

    least = least_passing(episodes, reference_ratio, false_alarm)
    lost = finite_number("drop", drop, at_least=0.0, at_most=reference_ratio)
    return float(binom.cdf(least - 1, episodes, reference_ratio - lost))


def _score_interval(ratio: float, episodes: float, quantile: float) -> Interval:
    """Wilson's interval for a number of episodes that need not be whole."""
    square = quantile * quantile / episodes
    centre = (ratio + 0.5 * square) / (1.0 + square)
    half = math.sqrt(square * (ratio * (1.0 - ratio) + 0.25 * square)) / (1.0 + square)
    # rounding must not push an end past the estimate or out of [0, 1]
    return Interval(ratio, max(0.0, min(centre - half, ratio)), min(1.0, max(centre + half, ratio)))


def _confidence(confidence: float) -> float:
    return finite_number("confidence", confidence, above=0.0, at_most=0.9999)


def _outcomes(name: str, value: ArrayLike) -> NDArray[np.bool_]:
    outcomes = np.asarray(value)
    if outcomes.ndim != 1 or outcomes.size == 0:
        raise ValueError(f"{name} must be a non-empty one-dimensional array, got shape {outcomes.shape}")
    hits = outcomes == 1
    if not np.logical_or(hits, outcomes == 0).all():
        raise ValueError(f"{name} must hold booleans, or zeros and ones only")
    return hits


def _whole_number(name: str, value: int, at_least: int, at_most: float = math.inf) -> int:
    try:
        number = operator.index(value)
    except TypeError as error:
        raise ValueError(f"{name} must be a whole number, got {value!r}") from error
    if not at_least <= number <= at_most:
        allowed = f"at least {at_least}" if at_most == math.inf else f"from {at_least} to {at_most:g}"
        raise ValueError(f"{name} must be {allowed}, got {number}")
    return number
