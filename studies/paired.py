"""Differences between policies that flew the same episodes."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.rows import MEASURES, EpisodeRow
from studies.statistics import Interval, bootstrap_mean, mcnemar_p_value, wilson_interval

RATIOS = ("safe_site", "success")
_BOOTSTRAP_STREAM = 7919  # keeps these resamples apart from those of the table


@dataclass(frozen=True)
class PairedDifference:
    """One policy less the reference, on the same episodes.

    Attributes:
        policy: name.
        reference: name of the policy that is subtracted.
        ratios: safe_site, success -> difference of the ratios with its interval, in [-1, 1].
        means: measure -> mean difference with its bootstrap interval.
        mcnemar_p: exact McNemar test of `safe_site`.
        holm_p: the same, corrected for the number of policies in the study.
    """

    policy: str
    reference: str
    ratios: dict[str, Interval]
    means: dict[str, Interval]
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
    mcnemar_p_value(first, second)  # checks both
    one, other = np.asarray(first) == 1, np.asarray(second) == 1
    count = one.size
    a = wilson_interval(int(one.sum()), count, confidence)
    b = wilson_interval(int(other.sum()), count, confidence)
    correlation = _corrected_correlation(one, other)
    difference = (int(one.sum()) - int(other.sum())) / count

    def reach(near: float, far: float) -> float:
        return math.sqrt(max(0.0, near * near - 2.0 * correlation * near * far + far * far))

    low = difference - reach(a.estimate - a.low, b.high - b.estimate)
    high = difference + reach(a.high - a.estimate, b.estimate - b.low)
    return Interval(difference, max(-1.0, low), min(1.0, high))


def _corrected_correlation(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> float:
    """Phi coefficient of the pairs; a positive association is lessened by half an episode's worth."""
    both = int((one & other).sum())
    neither = int((~one & ~other).sum())
    only_one, only_other = int((one & ~other).sum()), int((~one & other).sum())
    margins = (both + only_one) * (only_other + neither) * (both + only_other) * (only_one + neither)
    if margins == 0:
        return 0.0
    product = float(both * neither - only_one * only_other)
    if product > 0.0:
        product = max(product - one.size / 2.0, 0.0)
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


def compare_pairs(
    rows: dict[str, Sequence[EpisodeRow]], reference: Sequence[EpisodeRow], study_seed: int
) -> list[PairedDifference]:
    """Compare every policy with the reference.

    Args:
        rows: policy -> its rows; the reference policy itself is left out.
        reference: rows of the reference policy, of the same episodes.
        study_seed: seeds the bootstrap.

    Raises:
        ValueError: the episodes of a policy are not those of the reference.
    """
    name = reference[0].policy
    others = {policy: own for policy, own in rows.items() if policy != name}
    p_values = []
    for policy, own in others.items():
        if [row.episode for row in own] != [row.episode for row in reference]:
            raise ValueError(f"policy {policy!r} and {name!r} must have flown the same episodes")
        p_values.append(mcnemar_p_value(_column(own, "safe_site"), _column(reference, "safe_site")))
    adjusted = holm_adjust(p_values)
    return [
        PairedDifference(
            policy=policy,
            reference=name,
            ratios={
                ratio: paired_ratio_interval(_column(own, ratio), _column(reference, ratio))
                for ratio in RATIOS
            },
            means={
                measure: bootstrap_mean(
                    _column(own, measure) - _column(reference, measure),
                    np.random.default_rng([study_seed, k, _BOOTSTRAP_STREAM]),
                )
                for k, measure in enumerate(MEASURES)
            },
            mcnemar_p=p_values[index],
            holm_p=float(adjusted[index]),
        )
        for index, (policy, own) in enumerate(others.items())
    ]


def _column(rows: Sequence[EpisodeRow], name: str) -> NDArray[np.float64]:
    return np.array([getattr(row, name) for row in rows], dtype=np.float64)


def write_paired(path: Path, differences: Sequence[PairedDifference]) -> None:
    """Write the differences as CSV: ratios in percentage points, means in the units of their names."""
    header = ["policy", "reference"]
    header += [f"{name}_points{end}" for name in RATIOS for end in ("", "_low", "_high")]
    header += ["mcnemar_p", "holm_p"]
    header += [f"{name}{end}" for name in MEASURES for end in ("", "_low", "_high")]
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(header)
        for difference in differences:
            cells = [100.0 * value for name in RATIOS for value in _ends(difference.ratios[name])]
            cells += [difference.mcnemar_p, difference.holm_p]
            cells += [value for name in MEASURES for value in _ends(difference.means[name])]
            writer.writerow([difference.policy, difference.reference, *(f"{value:.9g}" for value in cells)])


def _ends(interval: Interval) -> tuple[float, float, float]:
    return interval.estimate, interval.low, interval.high
