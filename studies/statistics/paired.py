"""Differences between policies that flew the same episodes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.statistics.moments import tiled_mean
from studies.statistics.ratios import (
    Interval,
    PairCounts,
    count_pairs,
    mcnemar_count_p_value,
    wilson_interval,
)

CHANCE = 0.05
"""Of one false lead or more among all that are asked for together."""


@dataclass(frozen=True)
class Lead:
    """Which of two success ratios over the same episodes is the greater.

    Attributes:
        sign: 1 for the first, -1 for the second, 0 where chance explains the difference.
        holm_p: exact McNemar test, corrected for the number of pairs that were asked for together.
    """

    sign: int
    holm_p: float


def paired_ratio_interval(first: ArrayLike, second: ArrayLike, confidence: float = 0.95) -> Interval:
    """Interval of the difference of two success ratios over the same independent episodes.

    Newcombe's hybrid score interval with a corrected correlation (Statistics in Medicine 17, 1998, paired
    data, method 10): the Wilson limits of both ratios, joined by the correlation of the pairs. It is defined
    where the policies never differ.

    Args:
        first: shape (n,), booleans or zeros and ones.
        second: the same of the other policy, episode by episode.
        confidence: in (0, 0.9999].

    Returns:
        First less second.

    Raises:
        ValueError: an argument is empty or holds something else, or the shapes differ.
    """
    return pair_count_interval(count_pairs(first, second), confidence)


def pair_count_interval(pairs: PairCounts, confidence: float = 0.95) -> Interval:
    """The interval of `paired_ratio_interval`, from counts.

    Raises:
        ValueError: there is no episode, or `confidence` is out of range.
    """
    count = pairs.episodes
    first, second = pairs.both + pairs.only_first, pairs.both + pairs.only_second
    a = wilson_interval(first, count, confidence)
    b = wilson_interval(second, count, confidence)
    correlation = _corrected_correlation(pairs)
    difference = (first - second) / count

    def half_width(near: float, far: float) -> float:
        return math.sqrt(max(0.0, near * near - 2.0 * correlation * near * far + far * far))

    low = difference - half_width(a.estimate - a.low, b.high - b.estimate)
    high = difference + half_width(a.high - a.estimate, b.estimate - b.low)
    return Interval(difference, max(-1.0, low), min(1.0, high))


def _corrected_correlation(pairs: PairCounts) -> float:
    """Phi coefficient of the pairs; a positive association is lessened by half an episode's worth."""
    first, second = pairs.both + pairs.only_first, pairs.both + pairs.only_second
    margins = first * (pairs.episodes - first) * second * (pairs.episodes - second)
    if margins == 0:
        return 0.0
    product = float(pairs.both * pairs.neither - pairs.only_first * pairs.only_second)
    if product > 0.0:
        product = max(product - pairs.episodes / 2.0, 0.0)
    return product / math.sqrt(margins)


def holm_adjust(p_values: ArrayLike) -> NDArray[np.float64]:
    """Adjusted p-values that keep the family-wise error rate (Holm, Scand. J. Statist. 6, 1979).

    Args:
        p_values: shape (n,), in [0, 1].

    Returns:
        Shape (n,), in the order given; not below the plain ones.

    Raises:
        ValueError: a value is not a probability.
    """
    plain = np.asarray(p_values, dtype=np.float64)
    if plain.ndim != 1 or not ((plain >= 0.0) & (plain <= 1.0)).all():
        raise ValueError("p_values must be a one-dimensional array of probabilities")
    order = np.argsort(plain, kind="stable")
    stepped = plain[order] * np.arange(plain.size, 0, -1)
    adjusted = np.empty_like(plain)
    adjusted[order] = np.minimum(np.maximum.accumulate(stepped), 1.0)
    return adjusted


def decide_leads(pairs: Sequence[tuple[ArrayLike, ArrayLike]], tile: ArrayLike) -> list[Lead]:
    """Which ratio of each pair is the greater, over the same episodes.

    A lead counts where the exact McNemar test, corrected by Holm for all pairs, is below CHANCE, and the
    interval of the difference, clustered by tile, lies off zero.

    Args:
        pairs: two arrays of booleans or zeros and ones each, shape (n,), episode by episode.
        tile: shape (n,), number of the tile of each episode.

    Raises:
        ValueError: an array is empty or holds something else, or the shapes differ.
    """
    counts = [count_pairs(first, second) for first, second in pairs]
    adjusted = holm_adjust([mcnemar_count_p_value(one) for one in counts])
    found = []
    for (first, second), p in zip(pairs, adjusted, strict=True):
        lead = tiled_mean(np.asarray(first, dtype=int) - np.asarray(second, dtype=int), tile)
        sign = int(lead.low > 0.0) - int(lead.high < 0.0)
        found.append(Lead(sign if p < CHANCE else 0, float(p)))
    return found
