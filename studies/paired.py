"""Differences between policies that flew the same episodes."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.moments import mean_intervals
from studies.rows import MEASURES, RATIOS
from studies.scores import StudyScores
from studies.statistics import Interval, PairCounts, count_pairs, mcnemar_count_p_value, wilson_interval


@dataclass(frozen=True)
class PairedDifference:
    """One policy less the reference, on the same episodes.

    Attributes:
        policy: name.
        reference: name of the policy that is subtracted.
        ratios: safe_site, success -> difference of the ratios with its interval, in [-1, 1].
        means: measure -> mean difference with Student's interval.
        means_by_tile: measure -> the same with the interval clustered by tile.
        mcnemar_p: exact McNemar test of `safe_site`.
        holm_p: the same, corrected for the number of policies in the study.
    """

    policy: str
    reference: str
    ratios: dict[str, Interval]
    means: dict[str, Interval]
    means_by_tile: dict[str, Interval]
    mcnemar_p: float
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

    def reach(near: float, far: float) -> float:
        return math.sqrt(max(0.0, near * near - 2.0 * correlation * near * far + far * far))

    low = difference - reach(a.estimate - a.low, b.high - b.estimate)
    high = difference + reach(a.high - a.estimate, b.estimate - b.low)
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


def compare_pairs(scores: StudyScores, policies: Sequence[str]) -> list[PairedDifference]:
    """Compare policies with the reference policy, which is left out itself."""
    others = [scores.policies[name] for name in policies if name != scores.reference]
    p_values = [mcnemar_count_p_value(score.pairs["safe_site"]) for score in others]
    adjusted = holm_adjust(p_values)
    found = []
    for index, score in enumerate(others):
        moments = score.differences.collect()
        means = {name: mean_intervals(moments, k) for k, name in enumerate(MEASURES)}
        found.append(
            PairedDifference(
                policy=score.policy,
                reference=scores.reference,
                ratios={name: pair_count_interval(score.pairs[name]) for name in RATIOS},
                means={name: plain for name, (plain, _) in means.items()},
                means_by_tile={name: by_tile for name, (_, by_tile) in means.items()},
                mcnemar_p=p_values[index],
                holm_p=float(adjusted[index]),
            )
        )
    return found


def write_paired(path: Path, differences: Sequence[PairedDifference]) -> None:
    """Write the differences as CSV: ratios in percentage points, means in the units of their names."""
    header = ["policy", "reference"]
    header += [f"{name}_points{end}" for name in RATIOS for end in ("", "_low", "_high")]
    header += ["mcnemar_p", "holm_p"]
    header += [f"{name}{end}" for name in MEASURES for end in ("", "_low", "_high")]
    header += [f"{name}_tile_{end}" for name in MEASURES for end in ("low", "high")]
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        for difference in differences:
            cells = [100.0 * value for name in RATIOS for value in _ends(difference.ratios[name])]
            cells += [difference.mcnemar_p, difference.holm_p]
            cells += [value for name in MEASURES for value in _ends(difference.means[name])]
            cells += [value for name in MEASURES for value in _ends(difference.means_by_tile[name])[1:]]
            writer.writerow([difference.policy, difference.reference, *(f"{value:.9g}" for value in cells)])


def _ends(interval: Interval) -> tuple[float, float, float]:
    return interval.estimate, interval.low, interval.high
