"""Paired differences between the policies of a comparison, and their table."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from studies.campaign.rows import MEASURES, RATIOS
from studies.compare.scores import StudyScores
from studies.statistics.moments import mean_intervals
from studies.statistics.paired import holm_adjust, pair_count_interval
from studies.statistics.ratios import (
    Interval,
    mcnemar_count_p_value,
)


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
