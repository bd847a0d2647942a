"""Interval of the probability of an event that is counted by weights: few events, each of its own weight."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from guidance.validation import finite_number
from studies.statistics.ratios import Interval


def weighted_interval(
    events: ArrayLike, weights: ArrayLike, tile: ArrayLike, confidence: float = 0.95
) -> Interval:
    """Interval of the mean weight of an event over independent starts that come in clusters.

    The gamma interval of Fay and Feuer (Statistics in Medicine 16, 1997) for weighted sums of rare counts:
    exact for counts of one weight, and valid where there are few or none, since the upper end adds an event
    of the greatest weight that a start carried. Each start's weight of the event is taken as one jump of a
    compound Poisson sum, of variance sum_i e_i^2 / n^2. Where the totals of the C tiles scatter more, theirs
    is taken, C/(C - 1) sum_c (e_c - n_c mean)^2 / n^2. Variance and greatest weight grow by (t/z)^2, of
    Student's quantile at C - 1 degrees of freedom and the normal one, as in `clustered_interval`. One tile
    says nothing of others: the interval is [0, 1].

    Args:
        events: shape (n,), weight of what of each start was the event, zero or more.
        weights: shape (n,), weight of all that came of each start, 1 in expectation; at least `events`.
        tile: shape (n,), a label for each start.
        confidence: in (0, 0.9999].

    Raises:
        ValueError: an argument is empty, of the wrong shape, or out of range.
    """
    from scipy.special import ndtri, stdtrit
    from scipy.stats import chi2

    level = finite_number("confidence", confidence, above=0.0, at_most=0.9999)
    counted, carried, labels = np.asarray(events, float), np.asarray(weights, float), np.asarray(tile)
    if counted.ndim != 1 or counted.size == 0 or not counted.shape == carried.shape == labels.shape:
        raise ValueError(
            "events, weights and tile must be non-empty one-dimensional arrays of one shape, got"
            f" {counted.shape}, {carried.shape} and {labels.shape}"
        )
    if not ((counted >= 0.0) & (counted <= carried * (1.0 + 1e-9)) & np.isfinite(carried)).all():
        raise ValueError("events must lie between zero and weights")
    number = counted.size
    _, member = np.unique(labels, return_inverse=True)
    starts = np.bincount(member)
    mean = float(counted.sum()) / number
    if starts.size == 1:
        return Interval(mean, 0.0, max(1.0, mean))
    totals = np.bincount(member, weights=counted)
    between = starts.size / (starts.size - 1) * float(((totals - mean * starts) ** 2).sum())
    tail = 0.5 - 0.5 * level
    stretch = (float(stdtrit(starts.size - 1, 1.0 - tail)) / float(ndtri(1.0 - tail))) ** 2
    variance = stretch * max(float((counted**2).sum()), between) / number**2
    jump = stretch * max(1.0, float(carried.max())) / number
    low = 0.0
    if mean > 0.0:
        low = variance / (2.0 * mean) * float(chi2.ppf(tail, 2.0 * mean**2 / variance))
    reach, spread = mean + jump, variance + jump**2
    high = spread / (2.0 * reach) * float(chi2.isf(tail, 2.0 * reach**2 / spread))
    return Interval(mean, min(low, mean), max(min(high, 1.0), mean))


def relative_error(events: ArrayLike) -> float:
    """Standard error of the mean weight of an event over its mean, over independent starts; nan without one.

    Args:
        events: shape (n,), weight of the event of each start.
    """
    counted = np.asarray(events, float)
    mean = float(counted.mean())
    return float(counted.std()) / math.sqrt(counted.size) / mean if mean > 0.0 else math.nan
